// SPDX-License-Identifier: Apache-2.0
//! Hair on curves: a white fibre in a white furnace, a sun behind a fibre against the reference, ribbons across their
//! width, the same bits when the scene streams.

use super::*;
use crate::bsdf::cases::Hair;
use crate::bsdf::hair::reference;
use crate::lights::light;
use crate::scenes::sun;
use crate::support::render_with_messages;
use oocpt_core::LightKind;
use oocpt_core::scene::{CurveBasis, CurveWrap, CurvesDesc, PrimShape};

fn numbers([x, y]: [f32; 2]) -> ParamValue {
    ParamValue::Vec2([x, y])
}

/// A material of one `chiang_hair_bsdf`.
pub(crate) fn hair_of(path: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    material(path, vec![node("ND_surface", &[], &[("bsdf", 1)]), node("ND_chiang_hair_bsdf", params, &[])])
}

/// Curves through points, of one width.
pub(crate) fn curves(path: &str, basis: CurveBasis, lines: &[Vec<[f32; 3]>], width: f32) -> MeshDesc {
    let counts: Vec<i32> = lines.iter().map(|line| i32::try_from(line.len()).expect("few")).collect();
    MeshDesc {
        shape: PrimShape::Curves(CurvesDesc {
            basis,
            wrap: if basis == CurveBasis::Linear { CurveWrap::Nonperiodic } else { CurveWrap::Pinned },
            counts: TypedArray::of(counts),
            indices: None,
        }),
        points: TypedArray::of(lines.concat()),
        widths: constant(width),
        material: Some("/material".into()),
        ..mesh(prim(path, DMat4::IDENTITY), 1, Vec::new(), &[], 0.5)
    }
}

/// A tube along x, wider than the view is high, or a ribbon that faces the camera.
fn fibre(width: f32, is_ribbon: bool) -> MeshDesc {
    let mut desc = curves("/fibre", CurveBasis::Linear, &[vec![[-3.0, 0.0, 0.0], [3.0, 0.0, 0.0]]], width);
    if is_ribbon {
        desc.normals = constant([0.0, 0.0, 1.0_f32]);
    }
    desc
}

fn picture(db: impl FnOnce(&mut SceneDb), samples: u32, streams: bool) -> Vec<[f32; 4]> {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings(samples, 4), options).with_images(Arc::new(Ramps));
    session.with_scene(db);
    let request = front();
    render(&session, &request);
    read(&session, &request, AovKind::Color)
}

/// Light that enters the tube leaves it: its inside is never met, by a ray or on the way to a light; nor is that of the
/// next piece where a curve turns.
#[test]
fn a_white_fibre_in_a_white_furnace_disappears() {
    let bent: Vec<[f32; 3]> = [[-1.2, -0.6], [-0.4, 0.5], [0.4, -0.5], [1.2, 0.6]].map(|[x, y]| [x, y, 0.0]).to_vec();
    let wave = curves("/fibre", CurveBasis::BSpline, &[bent], 0.1);
    // A path that met an inside would be one bounce longer, and be lost at the last bounce.
    for (name, desc, bound, most) in [
        ("a tube", fibre(1.0, false), 1e-5, 1e-4),
        ("a thin tube", fibre(0.05, false), 1e-5, 1e-4),
        ("a ribbon", fibre(1.0, true), 1e-5, 1e-4),
        ("a wave", wave, 1e-4, 0.02),
    ] {
        let pixels = picture(
            |db| {
                db.upsert_material(hair_of("/material", &[("roughness_R", numbers([0.3, 0.5]))]));
                db.upsert_mesh(desc);
                db.upsert_light(dome([1.0; 3]));
            },
            64,
            false,
        );
        let mean = pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 1024.0;
        let worst = pixels.iter().map(|pixel| (pixel[0] - 1.0).abs()).fold(0.0, f32::max);
        println!("{name}: mean {mean}, a pixel is off by {worst} at most");
        assert!((mean - 1.0).abs() < bound, "{name}: mean radiance {mean}, not 1");
        assert!(worst < most, "{name}: a pixel is off by {worst}");
    }
}

/// The radiance of a fibre along x seen along -z where it is met at `h`, under a sun of irradiance 1.
fn lit(hair: &Hair, h: f64, to_sun: DVec3) -> f64 {
    // The reference has its normal along z: turn everything about x until the tube's is.
    let turn = DQuat::from_rotation_x(h.asin());
    reference(hair, 1.55, turn * DVec3::Z, turn * to_sun).x
}

/// A sun behind the fibre, beside and before it: the contribution of shadow rays, at every height, of a tube and of a
/// ribbon.
#[test]
fn a_sun_shines_on_and_through_a_fibre() {
    let own = Hair {
        tints: [DVec3::splat(0.9), DVec3::splat(0.8), DVec3::splat(0.7)],
        absorption: DVec3::splat(0.2),
        variance: DVec3::new(0.1, 0.06, 0.2),
        spread: DVec3::new(0.3, 0.2, 0.4),
        tilt: std::f64::consts::PI * 0.53 - std::f64::consts::FRAC_PI_2,
        ..Hair::default()
    };
    let params = [
        ("tint_R", color([0.9; 3])),
        ("tint_TT", color([0.8; 3])),
        ("tint_TRT", color([0.7; 3])),
        ("roughness_R", numbers([0.1, 0.3])),
        ("roughness_TT", numbers([0.06, 0.2])),
        ("roughness_TRT", numbers([0.2, 0.4])),
        ("cuticle_angle", ParamValue::Float(0.53)),
        ("absorption_coefficient", color([0.2; 3])),
    ];
    for is_ribbon in [false, true] {
        for place in [
            DMat4::from_rotation_y(3.0),
            DMat4::from_rotation_x(2.0) * DMat4::from_rotation_y(0.5),
            DMat4::from_rotation_y(-0.6) * DMat4::from_rotation_x(0.8),
        ] {
            let to_sun = place.transform_vector3(DVec3::Z);
            let pixels = picture(
                |db| {
                    db.upsert_material(hair_of("/material", &params));
                    db.upsert_mesh(fibre(1.5, is_ribbon));
                    db.upsert_light(sun(1.0, 0.0, place));
                },
                64,
                false,
            );
            for row in 5..27_usize {
                // Over a pixel's height; rows go up.
                let at = |k: u32| (f64::from(place_of(row)) + ((f64::from(k) + 0.5) / 32.0 - 0.5) / 16.0) / 0.75;
                let known = (0..32).map(|k| lit(&own, at(k), to_sun)).sum::<f64>() / 32.0;
                let found = pixels[row * 32..][..32].iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 32.0;
                let off = (found - known).abs() / known.max(1e-3);
                assert!(off < 0.01, "ribbon {is_ribbon}, sun {to_sun}, row {row}: {found}, not {known}");
            }
        }
    }
}

fn place_of(row: usize) -> f32 {
    place(row * 32)[1]
}

/// A lock of curls in the light of a dome, a sun and a lamp, absorption by a pattern; some of it instanced.
pub(crate) fn lock(db: &mut SceneDb) {
    let text = |text: &str| ParamValue::Text(text.into());
    let mut nodes = vec![
        node("ND_surface", &[], &[("bsdf", 1)]),
        node("ND_chiang_hair_bsdf", &[("cuticle_angle", ParamValue::Float(0.52))], &[("absorption_coefficient", 2)]),
        node("ND_deon_hair_absorption_from_melanin", &[], &[("melanin_concentration", 3)]),
        node("ND_geompropvalue_float", &[("geomprop", text("melanin"))], &[]),
        node("ND_chiang_hair_roughness", &[("longitudinal", ParamValue::Float(0.3))], &[]),
    ];
    for (input, output) in
        [("roughness_R", "roughness_R"), ("roughness_TT", "roughness_TT"), ("roughness_TRT", "roughness_TRT")]
    {
        nodes[1].connections.push(ConnectionDesc { input: input.into(), node: 4, output: output.into() });
    }
    db.upsert_material(material("/material", nodes));
    let lines: Vec<Vec<[f32; 3]>> = (0..40_u8)
        .map(|k| {
            let (at, turn) = (0.04 * f32::from(k) - 0.8, 2.4 * f32::from(k));
            let point = |t: u8| {
                let angle = 1.1 * f32::from(t) + turn;
                [at + 0.08 * angle.cos(), 0.3 * f32::from(t) - 1.0, 0.1 * angle.sin()]
            };
            (0..8).map(point).collect()
        })
        .collect();
    let melanin: Vec<f32> = (0..40_u8).map(|k| 0.02 * f32::from(k)).collect();
    let tubes = with(curves("/lock", CurveBasis::BSpline, &lines, 0.03), "melanin", Interpolation::Uniform, melanin);
    let mut flat = MeshDesc { normals: constant([0.0, 0.0, 1.0_f32]), ..tubes.clone() };
    flat.prim = instanced(prim("/row/flat", DMat4::IDENTITY), "/row");
    let places = [(DVec3::new(0.0, 0.0, -0.5), DQuat::from_rotation_y(0.3), DVec3::new(0.5, 0.8, 0.5))];
    db.upsert_instancer(instancer(prim("/row", DMat4::IDENTITY), "/row/flat", &places));
    db.upsert_mesh(flat);
    db.upsert_mesh(tubes);
    db.upsert_light(dome([0.3, 0.4, 0.5]));
    db.upsert_light(sun(2.0, 1.0, DMat4::from_rotation_y(2.5)));
    let place = DMat4::from_translation(DVec3::new(0.5, 0.5, 3.0));
    db.upsert_light(light(LightKind::Sphere { radius: 0.2, treat_as_point: false }, place));
}

#[test]
fn hair_streams_with_the_same_bits() {
    let request = front();
    let images = [false, true].map(|force_streaming| {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let session = Session::with_options(crate::support::filtering(settings(8, 3)), options);
        session.with_scene(lock);
        render(&session, &request);
        assert_eq!(session.stats().streaming.in_core, !force_streaming, "it streams when it is told to");
        read_all(&session, &request)
    });
    assert!(images[0] == images[1], "streaming changed a picture");
    let colors: Vec<[f32; 4]> = bytemuck::pod_collect_to_vec(&images[0][0]);
    assert!(colors.iter().flatten().all(|x| x.is_finite()), "every pixel is a number");
}

/// Hair on a mesh is shaded by its normals, and a warning says so.
#[test]
fn hair_on_a_mesh_gives_a_warning() {
    let session = session(settings(1, 1));
    session.with_scene(|db| {
        db.upsert_material(hair_of("/material", &[]));
        db.upsert_mesh(board("/board", 1, "/material"));
        db.upsert_light(dome([1.0; 3]));
    });
    let messages = render_with_messages(&session, &front());
    let told: Vec<String> = messages.iter().map(|message| format!("{message:?}")).collect();
    assert!(told.len() == 1 && told[0].contains("/board") && told[0].contains("is for curves"), "{told:?}");
}
