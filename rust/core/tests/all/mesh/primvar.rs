// SPDX-License-Identifier: Apache-2.0
//! Primvars of every interpolation, with and without indices, good and bad.

use oocpt_abi::AttributeRate;
use std::sync::Arc;

use oocpt_core::mesh::build_mesh;
use oocpt_core::{Attribute, DroppedData, Interpolation, MeshAsset, MeshDesc, Primvar, Subdivision, TypedArray};

use crate::support::{constant, grid, polygons, primvar};

const N: u16 = 4;

fn build(desc: &MeshDesc) -> (Arc<MeshAsset>, DroppedData) {
    let built = build_mesh(desc, 1);
    (built.asset.unwrap(), built.dropped)
}

/// Value of corner `corner` of triangle `triangle` as a shader reads it.
fn at<T: Copy>(asset: &MeshAsset, attribute: &Attribute<T>, triangle: usize, corner: usize) -> T {
    let index = match attribute.rate {
        AttributeRate::Constant => 0,
        AttributeRate::Uniform => triangle,
        AttributeRate::Vertex => asset.corner_indices[triangle][corner] as usize,
        AttributeRate::FaceVarying => triangle * 3 + corner,
    };
    attribute.values[index]
}

/// The expected values, from the position of the corner and the face: (x, y, face).
fn expected(asset: &MeshAsset, triangle: usize, corner: usize) -> [f32; 3] {
    let t = &asset.triangles[triangle];
    [t.vertices[corner][0], t.vertices[corner][1], f32::from(u16::try_from(t.face).unwrap())]
}

/// One colour per element of the grid: points and corners get their x and y, faces their number.
fn colors(desc: &MeshDesc, interpolation: Interpolation) -> Vec<[f32; 3]> {
    let of_point = |i: usize| desc.points.vec3(i).unwrap().as_vec3().to_array();
    match interpolation {
        Interpolation::Uniform => (0..N * N).map(|face| [0.0, 0.0, f32::from(face)]).collect(),
        Interpolation::FaceVarying => {
            let corner = |k| usize::try_from(desc.face_vertex_indices.index(k).unwrap()).unwrap();
            (0..desc.face_vertex_indices.len()).map(|k| of_point(corner(k))).collect()
        }
        _ => (0..desc.points.len()).map(of_point).collect(),
    }
}

fn check(desc: &MeshDesc, interpolation: Interpolation) {
    let (asset, dropped) = build(desc);
    assert_eq!(dropped, DroppedData::default());
    let colors = asset.colors.as_ref().unwrap();
    for triangle in 0..asset.triangles.len() {
        for corner in 0..3 {
            let [x, y, face] = expected(&asset, triangle, corner);
            let value = at(&asset, colors, triangle, corner);
            match interpolation {
                Interpolation::Uniform => assert!((value[2] - face).abs() < 1e-6, "{value:?} {face}"),
                _ => assert!((value[0] - x).abs() + (value[1] - y).abs() < 1e-6, "{value:?} {x} {y}"),
            }
        }
    }
}

#[test]
fn values_arrive_at_the_right_corners() {
    use Interpolation::{FaceVarying, Uniform, Varying, Vertex};
    for interpolation in [Uniform, Varying, Vertex, FaceVarying] {
        let mut desc = grid("/g", N);
        let values = colors(&desc, interpolation);
        desc.display_color = Some(primvar(interpolation, values.clone()));
        check(&desc, interpolation);
        // The same through indices into a reversed list.
        let n = i32::try_from(values.len()).unwrap();
        desc.display_color = Some(Primvar {
            interpolation,
            values: TypedArray::of(values.into_iter().rev().collect()),
            indices: Some(TypedArray::of((0..n).rev().collect())),
        });
        check(&desc, interpolation);
    }
}

#[test]
fn corner_indices_exist_only_for_point_rates() {
    let mut desc = grid("/g", 2);
    desc.display_color = Some(constant([0.5_f32; 3]));
    let (asset, _) = build(&desc);
    assert!(asset.corner_indices.is_empty());
    assert_eq!(
        asset.colors.as_ref().map(|c| (c.rate, c.values.clone())),
        Some((AttributeRate::Constant, vec![[0.5; 3]]))
    );
    desc.display_opacity = Some(primvar(Interpolation::Vertex, vec![0.5_f32; 9]));
    assert_eq!(build(&desc).0.corner_indices.len(), 8);
}

#[test]
fn lengths_are_checked() {
    let mut desc = grid("/g", 2);
    for (interpolation, wanted) in
        [(Interpolation::Uniform, 4), (Interpolation::Vertex, 9), (Interpolation::FaceVarying, 16)]
    {
        desc.display_color = Some(primvar(interpolation, vec![[0.5_f32; 3]; wanted - 1]));
        let (asset, dropped) = build(&desc);
        assert!(asset.colors.is_none());
        assert_eq!(dropped, DroppedData { primvars: 1, ..DroppedData::default() }, "{interpolation:?}");
        desc.display_color = Some(primvar(interpolation, vec![[0.5_f32; 3]; wanted + 1]));
        let (asset, dropped) = build(&desc);
        assert!(asset.colors.is_some());
        assert_eq!(dropped, DroppedData { long_primvars: 1, ..DroppedData::default() }, "{interpolation:?}");
    }
}

#[test]
fn an_invalid_primvar_is_dropped_whole() {
    let mut desc = grid("/g", 2);
    let instance = primvar(Interpolation::Instance, vec![[0.5_f32; 3]]);
    let empty = primvar(Interpolation::Constant, Vec::<[f32; 3]>::new());
    let scalar = constant(0.5_f32);
    let mut bad_indices = constant([0.5_f32; 3]);
    bad_indices.indices = Some(TypedArray::of(vec![0.0_f32]));
    for (name, primvar) in
        [("instance", instance), ("empty", empty), ("scalar", scalar), ("float indices", bad_indices)]
    {
        desc.display_color = Some(primvar);
        let (asset, dropped) = build(&desc);
        assert!(asset.colors.is_none(), "{name}");
        assert_eq!(dropped.primvars, 1, "{name}");
    }
}

#[test]
fn single_bad_values_are_replaced() {
    let mut desc = grid("/g", 2);
    let mut values = vec![[0.5_f32, 0.5, 0.5]; 9];
    values[3] = [f32::NAN, 0.0, 0.0];
    values[4] = [-1.0, 2.0, 0.0];
    desc.display_color = Some(primvar(Interpolation::Vertex, values));
    let (asset, dropped) = build(&desc);
    let colors = asset.colors.as_ref().unwrap();
    assert_eq!((colors.values[3], colors.values[4]), ([0.18; 3], [0.0, 2.0, 0.0]));
    assert_eq!(dropped, DroppedData { primvar_values: 1, ..DroppedData::default() });

    let mut indexed = primvar(Interpolation::Vertex, vec![[0.5_f32; 3]]);
    indexed.indices = Some(TypedArray::of(vec![0, 0, 0, 1, -1, 0, 0, 0, 0]));
    desc.display_color = Some(indexed);
    assert_eq!(build(&desc).1, DroppedData { primvar_values: 2, ..DroppedData::default() });
}

#[test]
fn opacity_is_clamped_and_dropped_when_one() {
    let mut desc = grid("/g", 2);
    desc.display_opacity = Some(primvar(Interpolation::Uniform, vec![1.0_f32, 2.0, 1.0, 1.0]));
    assert!(build(&desc).0.opacities.is_none());
    desc.display_opacity = Some(primvar(Interpolation::Uniform, vec![1.0_f32, 2.0, -1.0, 0.25]));
    let opacities = build(&desc).0.opacities.clone().unwrap();
    assert_eq!(opacities.values.iter().sum::<f32>(), 2.0 * (1.0 + 1.0 + 0.0 + 0.25));
}

/// A cube of quads with outward faces.
fn cube() -> MeshDesc {
    let points: Vec<[f32; 3]> =
        (0..8_u8).map(|k| [k & 1, k >> 1 & 1, k >> 2].map(|b| f32::from(b) * 2.0 - 1.0)).collect();
    let indices = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
    polygons("/cube", &[4; 6], &indices, &points)
}

#[test]
fn subdivision_meshes_get_smooth_outward_normals() {
    for left_handed in [false, true] {
        let mut desc = cube();
        desc.subdivision = Subdivision::CatmullClark;
        desc.left_handed = left_handed;
        if left_handed {
            let indices: Vec<i32> = (0..24).rev().map(|k| desc.face_vertex_indices.index(k).unwrap()).collect();
            desc.face_vertex_indices = TypedArray::of(indices);
        }
        let (asset, _) = build(&desc);
        let normals = asset.normals.as_ref().unwrap();
        assert_eq!(normals.rate, AttributeRate::Vertex);
        for (point, normal) in normals.values.iter().enumerate() {
            let p = desc.points.vec3(point).unwrap().as_vec3() / 3.0_f32.sqrt();
            assert!((glam::Vec3::from(*normal) - p).length() < 1e-6, "{left_handed} {normal:?} at {p}");
        }
    }
    assert!(build(&cube()).0.normals.is_none(), "polygon meshes are flat");
}

#[test]
fn authored_normals_win_and_bad_ones_are_replaced() {
    let mut desc = cube();
    desc.subdivision = Subdivision::CatmullClark;
    let mut values = vec![[0.0_f32, 0.0, 5.0]; 24];
    values[0] = [0.0; 3];
    desc.normals = Some(primvar(Interpolation::FaceVarying, values));
    let (asset, dropped) = build(&desc);
    let normals = asset.normals.as_ref().unwrap();
    assert_eq!(normals.rate, AttributeRate::FaceVarying);
    // The replaced corner belongs to the bottom face, whose outward normal is -z; a quad may use it twice.
    let down = normals.values.iter().filter(|n| **n == [0.0, 0.0, -1.0]).count() as u64;
    assert_eq!((down, dropped.primvar_values), (dropped.primvar_values, down));
    assert!((1..=2).contains(&down), "{down}");
    assert!(normals.values.iter().all(|n| *n == [0.0, 0.0, -1.0] || *n == [0.0, 0.0, 1.0]));
}
