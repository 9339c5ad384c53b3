// SPDX-License-Identifier: Apache-2.0
//! Mixtures by chance: in the mean they are the mean of their parts, the same bits when the scene streams, and no
//! random choice in images through pixel centres.

use super::*;
use crate::scenes::sun;
use crate::support::color_request;

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

/// A metal of this roughness, which is the root of its alpha.
fn metal(roughness: f32, albedo: [f32; 3]) -> NodeDesc {
    let alpha = roughness * roughness;
    let params = [("color0", color(albedo)), ("roughness", ParamValue::Vec2([alpha; 2]))];
    node("ND_generalized_schlick_bsdf", &params, &[])
}

fn glass(roughness: f32) -> NodeDesc {
    let params = [
        ("scatter_mode", ParamValue::Text("RT".into())),
        ("roughness", ParamValue::Vec2([roughness * roughness; 2])),
        ("ior", float(1.5)),
    ];
    node("ND_dielectric_bsdf", &params, &[])
}

/// A mixture with `share` of the second.
fn mixture(path: &str, share: f32, parts: [NodeDesc; 2]) -> MaterialDesc {
    let mut nodes = vec![
        node("ND_surface", &[], &[("bsdf", 1)]),
        node("ND_mix_bsdf", &[("mix", float(share))], &[("bg", 2), ("fg", 3)]),
    ];
    nodes.extend(parts);
    material(path, nodes)
}

const PARTS: [(f32, [f32; 3]); 2] = [(0.6, [0.9, 0.5, 0.3]), (0.1, [0.3, 0.5, 0.9])];

/// A rough and a sharp metal.
pub(crate) fn two_metals(path: &str, share: f32) -> MaterialDesc {
    mixture(path, share, PARTS.map(|(roughness, albedo)| metal(roughness, albedo)))
}

/// Means of the channels, and the standard errors of them: pixels are independent.
fn means(desc: MaterialDesc, samples: u32) -> [[f64; 2]; 3] {
    let session = session(settings(samples, 2));
    session.with_scene(|db| {
        let path = desc.path.to_string();
        db.upsert_material(desc);
        db.upsert_mesh(board("/a", 1, &path));
        db.upsert_light(dome([0.2; 3]));
        // 17 degrees off the mirror direction: a rough metal shines, a sharp one does not.
        db.upsert_light(sun(2.0, 0.0, DMat4::from_rotation_y(0.3)));
    });
    let request = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 1.9, SIZE));
    render(&session, &request);
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let count = pixels.len() as f64;
    [0, 1, 2].map(|channel| {
        let values = || pixels.iter().map(|pixel| f64::from(pixel[channel]));
        let mean = values().sum::<f64>() / count;
        let variance = values().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
        [mean, (variance / count).sqrt()]
    })
}

/// Standard errors between a mixture and the mean with `share` of its second part.
fn off(mixture: [[f64; 2]; 3], [back, front]: [[[f64; 2]; 3]; 2], share: f64) -> f64 {
    let channel = |k: usize| {
        let expected = (1.0 - share) * back[k][0] + share * front[k][0];
        let error = [mixture[k][1], (1.0 - share) * back[k][1], share * front[k][1]];
        let error = error.iter().map(|error| error * error).sum::<f64>().sqrt();
        (mixture[k][0] - expected).abs() / (error + 1e-6)
    };
    [0, 1, 2].map(channel).into_iter().fold(0.0, f64::max)
}

/// w A + (1 - w) B, rendered apart: two metals, two kinds of rough glass. A squared weight would show.
#[test]
fn a_mixture_equals_the_weighted_mean_of_its_parts() {
    let alone = |part: NodeDesc| material("/m", vec![node("ND_surface", &[], &[("bsdf", 1)]), part]);
    let metals = PARTS.map(|(roughness, albedo)| metal(roughness, albedo));
    for (what, parts) in [("metals", metals), ("glass", [glass(0.6), glass(0.1)])] {
        let apart = parts.clone().map(|part| means(alone(part), 64));
        for share in [0.25_f32, 0.5] {
            let found = means(mixture("/m", share, parts.clone()), 64);
            let share = f64::from(share);
            let [right, wrong] = [share, share * share].map(|share| off(found, apart, share));
            println!("{what}, {share}: {right:.2} standard errors off, {wrong:.1} from the square; {found:?}");
            assert!(right < 4.0, "{what}, {share}: {found:?}, of {apart:?}");
            assert!(wrong > 12.0, "{what}, {share}: a weight that is squared is not noticed: {wrong}");
        }
    }
}

/// Glass of two roughnesses absorbs nothing: a ball of it is white under a white sky.
#[test]
fn mixed_glass_in_a_white_furnace_stays_white() {
    let session = session(settings(64, 24));
    session.with_scene(|db| {
        db.upsert_material(mixture("/glass", 0.5, [glass(0.5), glass(0.1)]));
        let mut ball = crate::scenes::sphere(prim("/ball", DMat4::IDENTITY), 1, 16, 0.5);
        ball.material = Some("/glass".into());
        db.upsert_mesh(ball);
        db.upsert_light(dome([1.0; 3]));
    });
    let request = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 0.5, [16, 16]));
    render(&session, &request);
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let mean = pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 256.0;
    // Light that is still inside at the end is lost.
    assert!((mean - 1.0).abs() < 0.01, "{mean}");
}

/// Images through pixel centres have the number 0.5: the front from there on, whatever the pixel.
#[test]
fn pixel_centre_aovs_of_mixtures_are_not_stochastic() {
    for (share, [_, expected]) in [(0.25, PARTS[0]), (0.75, PARTS[1])].map(|(share, part)| (share, [part.1; 2])) {
        let (session, request) = shown(
            |db| {
                db.upsert_material(two_metals("/m", share));
                db.upsert_mesh(board("/a", 1, "/m"));
            },
            1,
        );
        let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
        for pixel in albedo {
            let off = pixel.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            assert!(off < 1e-6, "{share}: {pixel:?}, not {expected:?}");
        }
    }
}

/// A mask of a texture between a texture and a metal: paths that wait for tiles come back to what they had chosen.
#[test]
fn mixtures_stream_with_the_same_bits() {
    let request = front();
    let images = [false, true].map(|force_streaming| {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let session =
            Session::with_options(crate::support::filtering(settings(8, 3)), options).with_images(Arc::new(Ramps));
        session.with_scene(|db| {
            let file = ParamValue::Asset(AssetRef { authored: "ramps".into(), resolved: "ramps".into() });
            let mut masked = mixture(
                "/masked",
                0.0,
                [node("ND_oren_nayar_diffuse_bsdf", &[], &[("color", 5)]), metal(0.2, [0.9, 0.7, 0.3])],
            );
            masked.nodes[1] = node("ND_mix_bsdf", &[], &[("bg", 2), ("fg", 3), ("mix", 4)]);
            masked.nodes.push(node("ND_image_float", &[("file", file.clone())], &[]));
            masked.nodes.push(node("ND_image_color3", &[("file", file)], &[]));
            db.upsert_material(masked);
            db.upsert_material(two_metals("/metals", 0.5));
            db.upsert_material(mixture("/glass", 0.5, [glass(0.5), glass(0.0)]));
            let turn = DQuat::from_rotation_y(0.5);
            for (k, name) in [(0, "/masked"), (1, "/metals"), (2, "/glass")] {
                let mut desc =
                    with(board(&format!("/board{k}"), k + 1, name), "st", Interpolation::Vertex, coordinates(|st| st));
                let z = f64::from(k);
                desc.prim.transform =
                    DMat4::from_scale_rotation_translation(DVec3::splat(0.7), turn, DVec3::new(0.4 * z - 0.4, 0.0, z));
                db.upsert_mesh(desc);
            }
            db.upsert_light(dome([0.5, 0.6, 0.7]));
        });
        render(&session, &request);
        assert_eq!(session.stats().streaming.in_core, !force_streaming, "it streams when it is told to");
        read_all(&session, &request)
    });
    assert!(images[0] == images[1], "streaming changed a picture");
}
