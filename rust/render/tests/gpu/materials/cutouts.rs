// SPDX-License-Identifier: Apache-2.0
//! Cutouts by programs: surfaces are there where the program for their opacity says so, for camera and shadow rays.

use super::*;
use oocpt_abi::MaterialInput;
use oocpt_core::material::{InputValue, compile};
use oocpt_core::materialx::eval::run;

const OPEN_PBR: &str = "ND_open_pbr_surface_surfaceshader";
const GLTF: &str = "ND_gltf_pbr_surfaceshader";
/// `alpha_mode` of glTF.
const MASK: i64 = 1;
const BLEND: i64 = 2;

fn float(value: f32) -> ParamValue {
    ParamValue::Float(value)
}

/// Noise of the coordinates, from 0 to 1 or so, as the opacity of a surface: at `input` of node 0.
fn noisy(surface: &str, params: &[(&str, ParamValue)], input: &str) -> MaterialDesc {
    let nodes = vec![
        node(surface, params, &[(input, 1)]),
        node("ND_clamp_float", &[], &[("in", 2)]),
        node("ND_noise2d_float", &[("amplitude", float(0.75)), ("pivot", float(0.5))], &[("texcoord", 3)]),
        node("ND_multiply_vector2FA", &[("in2", float(5.0))], &[("in1", 4)]),
        node("ND_texcoord_vector2", &[], &[]),
    ];
    material("/m", nodes)
}

/// A board with holes, by noise.
pub(crate) fn holed(path: &str) -> MaterialDesc {
    MaterialDesc { path: path.into(), ..noisy(OPEN_PBR, &[], "geometry_opacity") }
}

/// The opacity at the coordinates of a pixel, by the twin.
fn opacity(desc: &MaterialDesc, pixel: usize) -> f32 {
    let compiled = compile(desc);
    assert_eq!(compiled.problem(), None, "all of it is understood");
    let material = compiled.material.expect("a surface");
    let register = match *material.input(MaterialInput::Opacity) {
        InputValue::Register(register) => Some(register),
        _ => None,
    };
    let register = register.expect("the opacity has a program");
    let [x, y] = place(pixel);
    let at = [0.5 + 0.5 * x, 0.5 + 0.5 * y, 0.0, 0.0];
    run(&material.opacity_program, |_| at, |_, _| [0.0; 4])[usize::from(register)][0]
}

fn st(desc: MeshDesc) -> MeshDesc {
    with(desc, "st", Interpolation::Vertex, coordinates(|st| st))
}

fn gltf(mode: i64, cutoff: f32) -> MaterialDesc {
    noisy(GLTF, &[("alpha_mode", ParamValue::Int(mode)), ("alpha_cutoff", float(cutoff))], "alpha")
}

/// The white board of such a material, under a white sky.
fn shown_with(desc: &MaterialDesc, samples: u32) -> (Session, RenderRequest) {
    shown(
        |db| {
            db.upsert_material(desc.clone());
            db.upsert_mesh(st(board("/a", 1, "/m")));
        },
        samples,
    )
}

#[test]
fn opacity_masks_follow_their_program() {
    let desc = gltf(MASK, 0.5);
    let (session, request) = shown_with(&desc, 1);
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    let mut there = 0;
    for (pixel, id) in ids.iter().enumerate() {
        let opacity = opacity(&desc, pixel);
        // A ray's place rounds.
        if (opacity - 0.5).abs() > 1e-5 {
            assert_eq!(*id == 1, opacity > 0.5, "pixel {pixel}: opacity {opacity}");
        }
        there += usize::from(*id == 1);
    }
    assert!((256..768).contains(&there), "{there} of 1024: no mask");
}

/// Opacity without a threshold is a probability, for camera rays and for shadows.
#[test]
fn an_opacity_is_a_probability() {
    for (what, desc) in [("blend", gltf(BLEND, 0.0)), ("OpenPBR", noisy(OPEN_PBR, &[], "geometry_opacity"))] {
        let (session, request) = shown_with(&desc, 64);
        let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        let expected = (0..1024).map(|pixel| f64::from(opacity(&desc, pixel))).sum::<f64>() / 1024.0;
        let mean = pixels.iter().map(|pixel| f64::from(pixel[3])).sum::<f64>() / 1024.0;
        // The error of 2^16 samples is 0.002.
        assert!((mean - expected).abs() < 0.008, "{what}: {mean}, not {expected}");
    }
    // A black floor under the board, lit from above through it: it is what shadow rays see.
    let light = |opaque: bool| {
        let desc = if opaque { gltf(0, 0.0) } else { gltf(BLEND, 0.0) };
        let session = session(settings(64, 1)).with_images(Arc::new(Ramps));
        session.with_scene(|db| {
            db.upsert_material(desc);
            let mut above = st(board("/above", 1, "/m"));
            above.prim.transform = DMat4::from_translation(DVec3::Z);
            db.upsert_mesh(above);
            let mut floor = MeshDesc { material: None, ..board("/floor", 2, "") };
            floor.prim.transform = DMat4::from_scale(DVec3::splat(0.5));
            db.upsert_mesh(floor);
            db.upsert_light(crate::scenes::sun(2.0, 0.5, DMat4::IDENTITY));
        });
        let from_below = request(orthographic(DVec3::new(0.0, -4.0, 0.5), DVec3::ZERO, 0.4, SIZE));
        render(&session, &from_below);
        let pixels: Vec<[f32; 4]> = read(&session, &from_below, AovKind::Color);
        pixels.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / 1024.0
    };
    let (closed, open) = (light(true), light(false));
    assert!(
        closed < 1e-3 && open > 0.01,
        "light through the board: {closed} where it is whole, {open} where it is not"
    );
}

/// A program knows the normal of a candidate, the view, its point: a board that is turned away is not there.
#[test]
fn opacity_programs_know_the_view_direction() {
    let world = ("space", ParamValue::Text("world".into()));
    let facing = |cutoff: f32| {
        let params = [("alpha_mode", ParamValue::Int(MASK)), ("alpha_cutoff", float(cutoff))];
        let nodes = vec![
            node(GLTF, &params, &[("alpha", 1)]),
            node("ND_absval_float", &[], &[("in", 2)]),
            node("ND_dotproduct_vector3", &[], &[("in1", 3), ("in2", 4)]),
            node("ND_normal_vector3", std::slice::from_ref(&world), &[]),
            node("ND_viewdirection_vector3", std::slice::from_ref(&world), &[]),
        ];
        material("/m", nodes)
    };
    // cos 0.5 = 0.8776.
    for (cutoff, is_there) in [(0.877, true), (0.878, false)] {
        let (session, request) = shown(
            |db| {
                db.upsert_material(facing(cutoff));
                let mut leaf = board("/trees/leaf", 4, "/m");
                leaf.prim = instanced(leaf.prim, "/trees");
                db.upsert_mesh(leaf);
                let places = [(DVec3::ZERO, DQuat::from_rotation_y(0.5), DVec3::new(0.5, 2.0, 1.0))];
                db.upsert_instancer(instancer(
                    prim("/trees", DMat4::from_scale(DVec3::splat(2.0))),
                    "/trees/leaf",
                    &places,
                ));
            },
            1,
        );
        let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
        let there = ids.iter().filter(|id| **id == 4).count();
        assert_eq!(there > 500, is_there, "cutoff {cutoff}: {there} pixels");
        assert!(is_there || there == 0, "cutoff {cutoff}: {there} pixels");
    }
}
