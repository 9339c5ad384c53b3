// SPDX-License-Identifier: Apache-2.0
//! Dispersion of glass: a prism against Snell's law by channel, a white sky, and the same bits when the scene streams.

use super::*;
use crate::support::color_request;

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";
/// Relative dispersion of n - 1, between the lines F and C: 1 / V.
const DISPERSION: f64 = 0.1;
const INDEX: f64 = 1.5;
/// The angle of the prism.
const ANGLE: f64 = std::f64::consts::FRAC_PI_6;
/// Position of the screen.
const SCREEN: f32 = -5.5;

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

/// Glass of this roughness, dispersive.
fn glass(roughness: f32) -> MaterialDesc {
    let params = [
        ("transmission_weight", float(1.0)),
        ("specular_roughness", float(roughness)),
        ("specular_ior", float(1.5)),
        ("transmission_dispersion_scale", float(2.0)),
        ("transmission_dispersion_abbe_number", float(20.0)),
    ];
    material("/glass", vec![node(OPEN_PBR, &params, &[])])
}

/// A wedge whose front is in the plane z = 0, -1 to 1 in x and y; its back goes away from the viewer along x.
fn prism() -> MeshDesc {
    // The tangent of the angle.
    let back = -2.0 * 3.0_f32.sqrt().recip();
    let points: Vec<[f32; 3]> =
        [-1.0, 1.0].iter().flat_map(|&y| [[-1.0, y, 0.0], [1.0, y, 0.0], [1.0, y, back]]).collect();
    let faces = [vec![0, 1, 4, 3], vec![0, 3, 5, 2], vec![1, 2, 5, 4], vec![0, 2, 1], vec![3, 4, 5]];
    let mut desc = mesh(prim("/prism", DMat4::IDENTITY), 1, points, &faces, 0.5);
    desc.material = Some("/glass".into());
    desc
}

/// A screen whose emission is its x.
fn screen(db: &mut SceneDb) {
    let black = color([0.0; 3]);
    let dark = [("diffuseColor", black.clone()), ("specularColor", black), ("useSpecularWorkflow", ParamValue::Int(1))];
    db.upsert_material(reading("/screen", "emissiveColor", "float3", "glow", &dark));
    let points = [[0.0, -1.0], [8.0, -1.0], [8.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x, y, SCREEN]).to_vec();
    let mut desc = mesh(prim("/screen_board", DMat4::IDENTITY), 2, points, &[vec![0, 1, 2, 3]], 0.5);
    desc.material = Some("/screen".into());
    let glow = [0.0_f32, 8.0, 8.0, 0.0].map(|x| [x; 3]).to_vec();
    db.upsert_mesh(with(desc, "glow", Interpolation::Vertex, glow));
}

/// The index at a wavelength in micrometres: Cauchy's two terms through the index of the line d and the Abbe number.
fn index(wavelength: f64) -> f64 {
    let inverse = |l: f64| (l * l).recip();
    let b = (INDEX - 1.0) * DISPERSION / (inverse(0.4861) - inverse(0.6563));
    let a = INDEX - b * inverse(0.5876);
    a + b * inverse(wavelength)
}

/// The part of the screen that a ray head on the front sees, by Snell and Fresnel.
fn seen(n: f64) -> f64 {
    let fresnel = |n1: f64, n2: f64, c1: f64, c2: f64| {
        let s = (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2);
        let p = (n1 * c2 - n2 * c1) / (n1 * c2 + n2 * c1);
        0.5 * (s * s + p * p)
    };
    let out = (n * ANGLE.sin()).asin();
    let through = (1.0 - fresnel(1.0, n, 1.0, 1.0)) * (1.0 - fresnel(n, 1.0, ANGLE.cos(), out.cos()));
    // It leaves at x = 0, where the back is so far behind the front, turned towards +x.
    let leaves = -ANGLE.tan();
    through * (leaves - f64::from(SCREEN)) * (out - ANGLE).tan()
}

#[test]
fn a_prism_refracts_each_channel_by_snells_law() {
    let session = session(settings(1024, 2));
    session.with_scene(|db| {
        db.upsert_material(glass(0.0));
        db.upsert_mesh(prism());
        screen(db);
    });
    let request = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 1e-4, [16, 16]));
    render(&session, &request);
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let known = [0.600, 0.546, 0.450].map(|wavelength| seen(index(wavelength)));
    assert!(known[2] > 1.1 * known[0] && known[1] > 1.02 * known[0], "they are told apart: {known:?}");
    for (channel, known) in known.into_iter().enumerate() {
        let mean = pixels.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>() / 256.0;
        println!("channel {channel}: {mean:.4}, {known:.4} by Snell");
        assert!((mean / known - 1.0).abs() < 5e-3, "channel {channel}: {mean}, not {known}");
    }
}

/// Clear glass under a white sky stays white, whatever it bends.
#[test]
fn dispersive_glass_in_a_white_furnace_stays_white() {
    for roughness in [0.0, 0.4] {
        let session = session(settings(256, 24));
        session.with_scene(|db| {
            db.upsert_material(glass(roughness));
            let mut ball = crate::scenes::sphere(prim("/ball", DMat4::IDENTITY), 1, 16, 0.5);
            ball.material = Some("/glass".into());
            db.upsert_mesh(ball);
            db.upsert_light(dome([1.0; 3]));
        });
        let request = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 0.5, [16, 16]));
        render(&session, &request);
        let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        for channel in 0..3 {
            let mean = pixels.iter().map(|pixel| f64::from(pixel[channel])).sum::<f64>() / 256.0;
            // Light that is still inside at the end is lost.
            assert!((mean - 1.0).abs() < 0.01, "roughness {roughness}, channel {channel}: {mean}");
        }
    }
}

/// Two prisms and an absorbing one in front of lights are the same if the scene streams and if it does not.
#[test]
fn dispersion_streams_with_the_same_bits() {
    let request = front();
    let images = [false, true].map(|force_streaming| {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let session =
            Session::with_options(crate::support::filtering(settings(8, 5)), options).with_images(Arc::new(Ramps));
        session.with_scene(|db| {
            db.upsert_material(glass(0.2));
            db.upsert_mesh(prism());
            screen(db);
            db.upsert_material(textured("/picture", "emissiveColor", "rgb", &[]));
            let mut picture =
                with(board("/picture_board", 6, "/picture"), "st", Interpolation::Vertex, coordinates(|st| st));
            picture.prim.transform = DMat4::from_translation(DVec3::new(0.0, 0.5, -2.0));
            db.upsert_mesh(picture);
            db.upsert_light(dome([0.5, 0.6, 0.7]));
        });
        render(&session, &request);
        assert_eq!(session.stats().streaming.in_core, !force_streaming, "it streams when it is told to");
        read_all(&session, &request)
    });
    assert!(images[0] == images[1], "streaming changed a picture");
}
