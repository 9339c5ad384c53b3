// SPDX-License-Identifier: Apache-2.0
//! Meshes displaced along tangents, bitangents and normals, against closed forms.

use glam::DVec3;
use oocpt_core::{Interpolation, MeshDesc, ParamValue, Subdivision, SubsetDesc, TypedArray};

use crate::material::preview_surface::node;
use crate::mesh::displace::{asset, build, build_by_slot, constant, corners, cube, square, st};
use crate::mesh::displace_patterns::{VECTOR, displacing, number, of};

/// A square whose coordinates go another way: x along the tangent, y along the bitangent, z along the normal.
#[test]
fn vector_displacement_uses_the_tangent_frame() {
    let by = |amount: [f32; 3]| displacing(vec![node(VECTOR, &[("displacement", ParamValue::Vec3(amount))], &[])]);
    let moved = |coordinates: Vec<[f32; 2]>, left_handed: bool| {
        let primvars = st(Interpolation::Vertex, coordinates);
        let built = build(&MeshDesc { primvars, left_handed, ..square() }, &by([1.0, 10.0, 100.0]), 4.0);
        let bounds = asset(&built).bounds;
        let all = corners(asset(&built));
        assert!(all.iter().all(|(_, normal, _)| normal.x == 0.0 && normal.y == 0.0), "a flat square stays flat");
        assert!((0..2).all(|k| (bounds.max[k] - bounds.min[k] - 1.0).abs() < 1e-6), "as a whole");
        bounds.min
    };
    let plain = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let mapped = |map: fn([f32; 2]) -> [f32; 2]| plain.iter().copied().map(map).collect::<Vec<_>>();
    for (name, coordinates, left_handed, expected) in [
        ("plain", plain.clone(), false, [1.0, 10.0, 100.0]),
        ("turned", mapped(|[s, t]| [t, -s]), false, [-10.0, 1.0, 100.0]),
        ("mirrored", mapped(|[s, t]| [-s, t]), false, [-1.0, 10.0, 100.0]),
        ("stretched", mapped(|[s, t]| [5.0 * s, 0.1 * t]), false, [1.0, 10.0, 100.0]),
        ("left-handed", plain.clone(), true, [1.0, 10.0, -100.0]),
    ] {
        let found = moved(coordinates, left_handed);
        let off = (0..3).map(|k| (found[k] - expected[k]).abs()).fold(0.0, f32::max);
        assert!(off < 1e-5, "{name}: {found:?}, not {expected:?}");
    }
    let [x, y, z] = moved(vec![[0.5; 2]; 4], false);
    assert!((x.hypot(y) - 101.0_f32.sqrt()).abs() < 1e-5 && (z - 100.0).abs() < 1e-5, "no coordinates: some frame");
}

/// A shear by texture coordinates: x is moved by the square of y, and normals are those of the sheared surface.
#[test]
fn a_constant_vector_shears_the_square() {
    let material = displacing(vec![
        node(VECTOR, &[("scale", number(0.5))], &[("displacement", 1, "out")]),
        node("ND_combine3_vector3", &[], &[("in1", 2, "out"), ("in3", 2, "out")]),
        node("ND_multiply_float", &[], &[("in1", 3, "out"), ("in2", 3, "out")]),
        node("ND_extract_vector2", &[("index", ParamValue::Int(1))], &[("in", 4, "out")]),
        node("ND_texcoord_vector2", &[], &[]),
    ]);
    let built = build(&square(), &material, 64.0);
    for (position, normal, _) in corners(asset(&built)) {
        // (x + y^2 / 2, y, y^2 / 2)
        let y = position.y;
        assert!((position.z - 0.5 * y * y).abs() < 1e-6, "{position}");
        let exact = DVec3::X.cross(DVec3::new(y, 1.0, y)).normalize();
        assert!(normal.dot(exact) > 0.9998, "{normal} at {position}, not {exact}");
        assert!((-1e-6..1.000_001).contains(&(position.x - 0.5 * y * y)), "{position}");
    }
}

/// Faces have vectors of their own; a position between them takes the mean.
#[test]
fn per_face_vectors_are_averaged_at_shared_points() {
    let material = displacing(vec![node(VECTOR, &[("displacement", ParamValue::Vec3([0.0, 0.0, 0.5]))], &[])]);
    for left_handed in [false, true] {
        let side = if left_handed { -0.5 } else { 0.5 };
        let built = build(&MeshDesc { left_handed, ..cube(Subdivision::None) }, &material, 5.0);
        let mut seen = [0; 3];
        for (position, _, face) in corners(asset(&built)) {
            // Faces are those of -z, z, -y, y, -x, x. Inside of one h, on an edge h / 2 twice, at a corner h / 3.
            let own = 2 - face as usize / 2;
            let far = position.abs().to_array();
            let is = |v: f64, share: f64| (v - 1.0 - side * share).abs() < 1e-6;
            let on = |share: f64| far.iter().filter(|v| is(**v, share)).count();
            let kind = match () {
                () if on(1.0 / 3.0) == 3 => 2,
                () if is(far[own], 0.5) && on(0.5) == 2 => 1,
                () if is(far[own], 1.0) => 0,
                () => panic!("face {face}: {position}"),
            };
            seen[kind] += 1;
        }
        assert_eq!(seen.map(|count| count > 0), [true; 3], "{seen:?}");
    }
    // A face of a subset is moved by a number, the others by vectors.
    let subset = SubsetDesc { path: "/c/s".into(), material: None, faces: TypedArray::of(vec![1_i32]) };
    let desc = MeshDesc { subsets: vec![subset], ..cube(Subdivision::None) };
    let built = build_by_slot(&desc, &[Some(of(&material)), Some(of(&constant(3.0)))], 4.0);
    let inner = |p: &DVec3| p.x.abs() < 0.9 && p.y.abs() < 0.9;
    for (position, _, face) in corners(built.asset.as_ref().unwrap()) {
        if inner(&position) && face < 2 {
            let expected = if face == 1 { 4.0 } else { -1.5 };
            assert!((position.z - expected).abs() < 1e-6, "face {face}: {position}");
        }
    }
}
