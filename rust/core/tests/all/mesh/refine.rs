// SPDX-License-Identifier: Apache-2.0
//! Subdivision surfaces as assets: values by face are kept, values by point are those of the surface.

use glam::{DVec3, Vec3};
use oocpt_abi::AttributeRate;
use oocpt_core::desc::{FaceVaryingLinear, SubdivisionTags};
use oocpt_core::mesh::{BuildDemand, BuiltMesh, CameraEye, DicingRate, WantedPrimvar, build_mesh_with};
use oocpt_core::{
    AnyAttribute, DroppedData, Interpolation, MeshAsset, MeshDesc, NamedPrimvar, Primvar, Subdivision, SubsetDesc,
    TypedArray,
};

/// A cube from -1 to 1, cut into 4 pieces an edge.
fn cube() -> MeshDesc {
    let coordinate = |k: usize, bit: usize| if k >> bit & 1 == 1 { 1.0_f32 } else { -1.0 };
    let points: Vec<[f32; 3]> = (0..8).map(|k| [coordinate(k, 0), coordinate(k, 1), coordinate(k, 2)]).collect();
    let corners = vec![0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
    MeshDesc {
        subdivision: Subdivision::CatmullClark,
        refine_level: 2,
        double_sided: true,
        face_vertex_counts: TypedArray::of(vec![4_i32; 6]),
        face_vertex_indices: TypedArray::of::<i32>(corners),
        points: TypedArray::of(points),
        ..MeshDesc::default()
    }
}

fn build(desc: &MeshDesc) -> BuiltMesh {
    build_with(desc, &[], &DicingRate::default())
}

fn build_with(desc: &MeshDesc, wanted: &[WantedPrimvar], dicing: &DicingRate) -> BuiltMesh {
    let demand = BuildDemand { wanted, dicing: Some(dicing), ..BuildDemand::default() };
    build_mesh_with(desc, &demand, 1, u64::MAX, u64::MAX)
}

fn asset(built: BuiltMesh) -> MeshAsset {
    assert_eq!(built.dropped, DroppedData::default(), "nothing is wrong");
    (*built.asset.unwrap()).clone()
}

fn primvar<T: oocpt_core::array::ArrayElement + std::fmt::Debug>(
    interpolation: Interpolation,
    values: Vec<T>,
) -> Primvar {
    Primvar { interpolation, values: TypedArray::of(values), indices: None }
}

/// Position and normal of each corner.
fn corners(asset: &MeshAsset) -> Vec<(DVec3, DVec3)> {
    let normals = asset.normals.as_ref().unwrap();
    assert_eq!(normals.rate, AttributeRate::Vertex, "one normal a vertex");
    let both = asset.triangles.iter().zip(&asset.corner_indices);
    both.flat_map(|(triangle, indices)| {
        [0, 1, 2].map(|k| {
            let normal = Vec3::from(normals.values[indices[k] as usize]);
            (Vec3::from(triangle.vertices[k]).as_dvec3(), normal.as_dvec3())
        })
    })
    .collect()
}

#[test]
fn a_cube_becomes_round_and_keeps_its_faces() {
    let asset = asset(build(&cube()));
    assert_eq!(asset.triangles.len(), 6 * 4 * 4 * 2, "level 2: 4 pieces an edge");
    for face in 0..6 {
        let of_face = asset.triangles.iter().filter(|triangle| triangle.face == face).count();
        assert_eq!(of_face, 32, "triangles of face {face}");
    }
    for (position, normal) in corners(&asset) {
        assert!((0.8..1.1).contains(&position.length()), "{position} is on something like a ball");
        assert!(normal.dot(position.normalize()) > 0.9, "{normal} points outwards at {position}");
    }
}

#[test]
fn left_handed_meshes_have_flipped_limit_normals() {
    let asset = asset(build(&MeshDesc { left_handed: true, ..cube() }));
    for (position, normal) in corners(&asset) {
        assert!(normal.dot(position.normalize()) < -0.9, "{normal} points inwards at {position}");
    }
}

#[test]
fn authored_normals_are_ignored_on_subdivision_surfaces() {
    let normals = primvar(Interpolation::Vertex, vec![[0.0_f32, 0.0, 1.0]; 8]);
    let (with, without) = (asset(build(&MeshDesc { normals: Some(normals), ..cube() })), asset(build(&cube())));
    assert_eq!(with.normals, without.normals, "USD: only polygon meshes have authored normals");
}

#[test]
fn uniform_values_and_subsets_follow_their_face() {
    let colors: Vec<[f32; 3]> = (0..6_u8).map(|face| [f32::from(face), 0.0, 0.0]).collect();
    let subset = SubsetDesc { path: "/c/s".into(), material: None, faces: TypedArray::of(vec![4_i32]) };
    let desc =
        MeshDesc { display_color: Some(primvar(Interpolation::Uniform, colors)), subsets: vec![subset], ..cube() };
    let asset = asset(build(&desc));
    let colors = asset.colors.as_ref().unwrap();
    for (at, triangle) in asset.triangles.iter().enumerate() {
        assert!((colors.values[at][0] - triangle.face as f32).abs() < 1e-6, "colour of face {}", triangle.face);
        assert_eq!(asset.subsets[at], u16::from(triangle.face == 4), "subset of face {}", triangle.face);
    }
}

#[test]
fn vertex_and_face_varying_values_are_refined() {
    let positions: Vec<[f32; 3]> = (0..8).map(|k| cube().points.vec3(k).unwrap().as_vec3().to_array()).collect();
    let by_corner = (0..24).map(|c| positions[cube().face_vertex_indices.index(c).unwrap() as usize]).collect();
    let named = |name: &str, primvar| NamedPrimvar { name: name.into(), primvar };
    let desc = MeshDesc {
        primvars: vec![
            named("smooth", primvar(Interpolation::Vertex, positions.clone())),
            named("linear", primvar(Interpolation::Varying, positions)),
            named("corner", primvar(Interpolation::FaceVarying, by_corner)),
            named("unwanted", primvar(Interpolation::Vertex, vec![0.0_f32; 3])),
        ],
        subdivision_tags: SubdivisionTags { face_varying: FaceVaryingLinear::All, ..SubdivisionTags::default() },
        ..cube()
    };
    let wanted = ["smooth", "linear", "corner"];
    let wanted: Vec<WantedPrimvar> =
        wanted.iter().zip(7..).map(|(name, id)| WantedPrimvar { name: (*name).into(), id }).collect();
    let asset = asset(build_with(&desc, &wanted, &DicingRate::default()));
    let values = |id: u32| match &asset.primvars.iter().find(|primvar| primvar.id == id).unwrap().values {
        AnyAttribute::Three(values) => values.clone(),
        other => panic!("{other:?} has three floats"),
    };
    let (smooth, linear, corner) = (values(7), values(8), values(9));
    assert_eq!([smooth.rate, linear.rate, corner.rate], [AttributeRate::Vertex; 3], "all by vertex");
    for (triangle, indices) in asset.triangles.iter().zip(&asset.corner_indices) {
        for (vertex, index) in triangle.vertices.iter().zip(indices) {
            let (vertex, at) = (Vec3::from(*vertex), *index as usize);
            assert!(vertex.distance(Vec3::from(smooth.values[at])) < 1e-5, "positions as values are positions");
            let flat = Vec3::from(linear.values[at]);
            assert!((flat.abs().max_element() - 1.0).abs() < 1e-6, "linear values stay on the cube");
            assert!(flat.distance(Vec3::from(corner.values[at])) < 1e-5, "and so do linear values by corner");
        }
    }
}

#[test]
fn creases_are_read_by_crease_and_by_edge() {
    let ints = |values: &[i32]| Some(TypedArray::of(values.to_vec()));
    let floats = |values: &[f32]| Some(TypedArray::of(values.to_vec()));
    let with = |tags: SubdivisionTags| build(&MeshDesc { subdivision_tags: tags, ..cube() });
    let top = [2, 3, 7, 6, 2];
    let tags = |lengths: &[i32], sharpnesses: &[f32]| SubdivisionTags {
        crease_indices: ints(&top),
        crease_lengths: ints(lengths),
        crease_sharpnesses: floats(sharpnesses),
        ..SubdivisionTags::default()
    };
    let highest = |asset: &MeshAsset| asset.triangles.iter().flat_map(|t| t.vertices).map(|v| v[1]).fold(0.0, f32::max);
    let sharp = asset(with(tags(&[5], &[10.0])));
    assert!((highest(&sharp) - 1.0).abs() < 1e-6, "a sharp top stays where it is");
    assert!(highest(&asset(build(&cube()))) < 0.9, "a smooth one sinks");
    let by_edge = asset(with(tags(&[5], &[10.0; 4])));
    assert_eq!(sharp.triangles, by_edge.triangles, "the same sharpness, edge by edge");
    for (lengths, sharpnesses, bad, what) in [
        (&[5_i32][..], &[f32::NAN][..], 4, "a sharpness that is no number"),
        (&[9], &[10.0], 2, "a crease that is longer than its points: one edge without an end, one that cannot begin"),
        (&[1, 4], &[10.0, 10.0], 1, "a crease of one point"),
        (&[5], &[], 1, "no sharpness"),
    ] {
        assert_eq!(
            with(tags(lengths, sharpnesses)).dropped,
            DroppedData { creases: bad, ..DroppedData::NONE },
            "{what}"
        );
    }
    let corner = SubdivisionTags {
        corner_indices: ints(&[7, 99]),
        corner_sharpnesses: floats(&[10.0, 10.0]),
        ..SubdivisionTags::default()
    };
    let built = with(corner);
    assert_eq!(built.dropped, DroppedData { creases: 1, ..DroppedData::NONE }, "point 99 is none");
    let reached = built.asset.unwrap().triangles.iter().flat_map(|t| t.vertices).any(|v| v == [1.0; 3]);
    assert!(reached, "a sharp point stays where it is");
}

#[test]
fn faces_with_repeated_points_are_refined_or_refused() {
    // A pole: points in a row count once. A face that comes back to a point cannot be subdivided.
    let desc = MeshDesc {
        face_vertex_counts: TypedArray::of(vec![4_i32, 4, 4]),
        face_vertex_indices: TypedArray::of::<i32>(vec![0, 1, 2, 2, 0, 2, 3, 4, 0, 1, 0, 4]),
        points: TypedArray::of(vec![
            [0.0_f32, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.0],
            [0.0, 1.0, 0.0],
            [-1.0, 0.0, 0.0],
        ]),
        ..cube()
    };
    let built = build(&desc);
    assert_eq!(built.dropped, DroppedData { folded_faces: 1, ..DroppedData::NONE });
    let faces: Vec<u32> = built.asset.unwrap().triangles.iter().map(|triangle| triangle.face).collect();
    assert!(faces.contains(&0) && faces.contains(&1) && !faces.contains(&2), "the other faces are there");
}

#[test]
fn a_mesh_that_cannot_be_refined_stays_polygonal_and_is_counted() {
    let refused = DroppedData { unrefined_meshes: 1, ..DroppedData::NONE };
    let quads = build(&MeshDesc { subdivision: Subdivision::Loop, ..cube() });
    assert_eq!((quads.dropped, quads.asset.unwrap().triangles.len()), (refused, 12), "Loop's scheme needs triangles");
    let bilinear = build(&MeshDesc { subdivision: Subdivision::Bilinear, refine_level: 0, ..cube() });
    assert_eq!(asset(bilinear).triangles.len(), 12, "bilinear surfaces are flat unless somebody asks for more");
    let bilinear = build(&MeshDesc { subdivision: Subdivision::Bilinear, refine_level: 1, ..cube() });
    assert_eq!(asset(bilinear).triangles.len(), 12 * 4, "level 1");
    let none = build(&MeshDesc { subdivision: Subdivision::None, ..cube() });
    assert_eq!(asset(none).triangles.len(), 12, "polygons stay polygons");
}

#[test]
fn edge_rates_follow_projected_edge_length() {
    let near = |distance: f64| CameraEye { position: DVec3::new(0.0, 0.0, 1.0 + distance), nearest: 0.01 };
    let dicing = |eyes| DicingRate { pixels: 2.0, density: 1.0, focal: 100.0, eyes, views: Vec::new() };
    let (a, b) = (DVec3::new(-1.0, 0.0, 1.0), DVec3::new(1.0, 0.0, 1.0));
    let pieces = |dicing: &DicingRate| dicing.pieces(a, b, 1);
    // Two units: 2 pixels without an eye; at distance 10 they cover 20 pixels, ten pieces of two.
    assert_eq!(pieces(&dicing(vec![])), 1, "two pixels are one piece");
    assert_eq!(pieces(&dicing(vec![near(10.0)])), 10, "ten times two pixels");
    assert_eq!(pieces(&dicing(vec![near(10.0), near(5.0)])), 20, "the nearest counts");
    assert_eq!(pieces(&dicing(vec![near(1e-9)])), 256, "there is a largest number");
    assert_eq!(dicing(vec![]).pieces(a, b, 4), 4, "the level is the least");
    assert_eq!(DicingRate { pixels: 0.0, ..dicing(vec![near(5.0)]) }.pieces(a, b, 1), 1, "switched off");
    let odd = dicing(vec![CameraEye { position: DVec3::new(0.3, 5.0, 2.7), nearest: 0.01 }]);
    assert_eq!(odd.pieces(a, b, 1), odd.pieces(b, a, 1), "both directions");
    let no_length = odd.pieces(a, a, 1);
    assert_eq!(no_length, 1, "an edge without length is one piece");
}
