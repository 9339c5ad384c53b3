// SPDX-License-Identifier: Apache-2.0
//! Emission that a program computes: found by BSDF rays alone, it counts once.

use super::*;

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

/// The mean of a floor beside a wall that shines in rising strength, by a program or by a primvar, which makes the wall
/// a sampled light. Another wall is a light in both.
fn floor(by_program: bool) -> f64 {
    let surface = [("base_weight", float(0.0)), ("specular_weight", float(0.0)), ("emission_luminance", float(3.0))];
    let shines = if by_program {
        // The dot product is the first coordinate.
        vec![
            node("ND_open_pbr_surface_surfaceshader", &surface, &[("emission_color", 1)]),
            node("ND_convert_float_color3", &[], &[("in", 2)]),
            node("ND_dotproduct_vector2", &[("in2", ParamValue::Vec2([1.0, 0.0]))], &[("in1", 3)]),
            node("ND_texcoord_vector2", &[], &[]),
        ]
    } else {
        let name = [("geomprop", ParamValue::Text("glow".into()))];
        vec![
            node("ND_open_pbr_surface_surfaceshader", &surface, &[("emission_color", 1)]),
            node("ND_geompropvalue_color3", &name, &[]),
        ]
    };
    let session = session(settings(512, 2));
    session.with_scene(|db| {
        db.upsert_material(material("/shines", shines));
        db.upsert_material(crate::scenes::glow("/glows", [0.5; 3]));
        db.upsert_mesh(MeshDesc { material: None, ..board("/floor", 1, "") });
        for (k, x, name) in [(2, 1.0, "/shines"), (3, -1.0, "/glows")] {
            let st = with(board(&format!("/wall{k}"), k, name), "st", Interpolation::Vertex, coordinates(|st| st));
            let glow: Vec<[f32; 3]> = coordinates(|st| st).iter().map(|st| [st[0]; 3]).collect();
            let mut wall = with(st, "glow", Interpolation::Vertex, glow);
            wall.prim.transform =
                DMat4::from_translation(DVec3::new(x, 0.0, 1.0)) * DMat4::from_rotation_y(std::f64::consts::FRAC_PI_2);
            db.upsert_mesh(wall);
        }
    });
    let request = front();
    render(&session, &request);
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 1024.0
}

#[test]
fn program_emission_is_not_counted_twice() {
    let (found, asked) = (floor(true), floor(false));
    assert!(asked > 0.1, "the floor is lit: {asked}");
    assert!((found / asked - 1.0).abs() < 0.01, "{found} by reflected rays, {asked} by asking");
}
