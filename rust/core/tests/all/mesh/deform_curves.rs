// SPDX-License-Identifier: Apache-2.0
//! Curves and points whose widths and normals change while the shutter is open, and ribbons that move: every key is
//! what a still prim of its values is.

use glam::Vec3;
use oocpt_core::mesh::{LeafKind, MeshKeys, build_mesh, mesh_key};
use oocpt_core::scene::{
    CurveBasis, CurveWrap, CurvesDesc, Interpolation, PointsMotion, PointsSample, PrimShape, Primvar,
};
use oocpt_core::{DroppedData, MeshAsset, MeshDesc, TypedArray};

type Points = Vec<[f32; 3]>;
/// Three vectors for each item.
type Corners = Vec<[[f32; 3]; 3]>;

/// Values of a prim at a time.
#[derive(Clone, Default)]
struct At {
    time: f64,
    points: Points,
    normals: Option<Points>,
    widths: Option<Vec<f32>>,
}

fn primvar<T: oocpt_core::array::ArrayElement + std::fmt::Debug>(
    interpolation: Interpolation,
    values: Vec<T>,
) -> Primvar {
    Primvar { interpolation, values: TypedArray::of(values), indices: None }
}

fn curves(basis: CurveBasis, wrap: CurveWrap, counts: &[i32]) -> PrimShape {
    PrimShape::Curves(CurvesDesc { basis, wrap, counts: TypedArray::of(counts.to_vec()), indices: None })
}

/// The prim as it is at the first time, with the motion from there on.
fn moving(shape: PrimShape, by: Interpolation, all: &[At]) -> MeshDesc {
    let sample = |at: &At| PointsSample {
        time: at.time,
        points: TypedArray::of(at.points.clone()),
        normals: at.normals.clone().map(TypedArray::of),
        widths: at.widths.clone().map(TypedArray::of),
    };
    let first = &all[0];
    MeshDesc {
        shape,
        points: TypedArray::of(first.points.clone()),
        normals: first.normals.clone().map(|values| primvar(Interpolation::Vertex, values)),
        widths: first.widths.clone().map(|values| primvar(by, values)),
        point_motion: PointsMotion {
            samples: if all.len() > 1 { all.iter().map(sample).collect() } else { Vec::new() },
            ..PointsMotion::default()
        },
        ..MeshDesc::default()
    }
}

fn built(desc: &MeshDesc) -> MeshAsset {
    let built = build_mesh(desc, 1);
    assert!(built.notes.is_empty() && built.dropped == DroppedData::default(), "{:?} {:?}", built.notes, built.dropped);
    (*built.asset.expect("something is seen")).clone()
}

/// The vertices of all items at each key, and their normals by corner.
fn keys(asset: &MeshAsset) -> Vec<(Corners, Corners)> {
    let count = asset.triangles.len();
    let first: Vec<_> = asset.triangles.iter().map(|item| item.vertices).collect();
    let normals = asset.normals.as_ref();
    let corner = |at: usize, corner: usize| {
        let normals = normals.expect("normals");
        let at =
            if asset.keys.normals.is_empty() { asset.corner_indices[at][corner] as usize } else { 3 * at + corner };
        normals.values[at]
    };
    let own: Vec<[[f32; 3]; 3]> =
        if normals.is_some() { (0..count).map(|at| [0, 1, 2].map(|k| corner(at, k))).collect() } else { Vec::new() };
    let mut all = vec![(first, own.clone())];
    for (key, vertices) in asset.keys.vertices.chunks(count).enumerate() {
        let turned = asset.keys.normals.chunks(count).nth(key).map_or(own.clone(), <[_]>::to_vec);
        all.push((vertices.to_vec(), turned));
    }
    all
}

fn distance(a: &[[f32; 3]; 3], b: &[[f32; 3]; 3]) -> f32 {
    let apart = |(a, b): (&[f32; 3], &[f32; 3])| Vec3::from(*a).distance(Vec3::from(*b));
    a.iter().zip(b).map(apart).fold(0.0, f32::max)
}

/// Compares each key with the still prim of its values.
fn agree(what: &str, shape: &PrimShape, by: Interpolation, all: &[At]) {
    let found = keys(&built(&moving(shape.clone(), by, all)));
    assert_eq!(found.len(), all.len(), "{what}: a key for each sample");
    for (key, (at, (vertices, normals))) in all.iter().zip(&found).enumerate() {
        let still = keys(&built(&moving(shape.clone(), by, std::slice::from_ref(at))));
        let (known, known_normals) = &still[0];
        assert_eq!(known.len(), vertices.len(), "{what}, key {key}: as many items");
        assert_eq!(known_normals.len(), normals.len(), "{what}, key {key}: normals");
        for (i, item) in known.iter().enumerate() {
            let nearest = (0..vertices.len())
                .min_by(|a, b| distance(&vertices[*a], item).total_cmp(&distance(&vertices[*b], item)));
            let nearest = nearest.expect("items");
            assert!(
                distance(&vertices[nearest], item) < 2e-6,
                "{what}, key {key}: {item:?}, not {:?}",
                vertices[nearest]
            );
            if let Some(known) = known_normals.get(i) {
                assert!(
                    distance(&normals[nearest], known) < 1e-5,
                    "{what}, key {key}: {known:?}, {:?}",
                    normals[nearest]
                );
            }
        }
    }
}

fn bent(by: f32) -> Points {
    (0..5_u8).map(f32::from).map(|k| [k, 0.3 * by * k * k, 0.1 * by * k]).collect()
}

fn turned(by: f32) -> Points {
    (0..5_u8).map(|k| [0.0, (by + 0.2 * f32::from(k)).sin(), (by + 0.2 * f32::from(k)).cos()]).collect()
}

fn widths(by: f32, count: u8) -> Vec<f32> {
    (0..count).map(|k| 0.1 + by * (0.2 + 0.05 * f32::from(k))).collect()
}

#[test]
fn ribbon_keys_move_turn_and_widen() {
    let at = |time: f64, by: f32, turn: f32, wide: f32| At {
        time,
        points: bent(by),
        normals: Some(turned(turn)),
        widths: Some(widths(wide, 5)),
    };
    for (name, basis, wrap) in [
        ("linear", CurveBasis::Linear, CurveWrap::Nonperiodic),
        ("B-spline", CurveBasis::BSpline, CurveWrap::Pinned),
        ("Catmull-Rom", CurveBasis::CatmullRom, CurveWrap::Periodic),
    ] {
        let shape = curves(basis, wrap, &[5]);
        let by = Interpolation::Vertex;
        agree(
            &format!("{name} moves"),
            &shape,
            by,
            &[at(0.0, 0.5, 0.0, 1.0), at(0.5, 1.0, 0.0, 1.0), at(1.0, -0.5, 0.0, 1.0)],
        );
        agree(&format!("{name} turns"), &shape, by, &[at(0.0, 0.5, 0.0, 1.0), at(1.0, 0.5, 0.7, 1.0)]);
        agree(&format!("{name} widens"), &shape, by, &[at(0.0, 0.5, 0.3, 1.0), at(1.0, 0.5, 0.3, 0.0)]);
        agree(&format!("{name} does all"), &shape, by, &[at(0.0, 0.5, 0.0, 1.0), at(1.0, -1.0, 0.7, 2.0)]);
    }
}

#[test]
fn a_turning_ribbon_stays_perpendicular_to_its_normal_at_each_key() {
    let straight: Points = vec![[0.0; 3], [2.0, 0.0, 0.0]];
    let at = |time: f64, normal: [f32; 3], width: f32| At {
        time,
        points: straight.clone(),
        normals: Some(vec![normal; 2]),
        widths: Some(vec![width; 2]),
    };
    let all = [at(0.0, [0.0, 0.0, 1.0], 1.0), at(1.0, [0.0, 1.0, 0.0], 3.0)];
    let asset = built(&moving(curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[2]), Interpolation::Vertex, &all));
    assert_eq!((asset.kind, asset.triangles.len()), (LeafKind::Triangles, 2));
    let keys = keys(&asset);
    for (vertices, normals) in keys[0].0.iter().zip(&keys[0].1) {
        assert!(vertices.iter().all(|v| v[1].abs() == 0.5 && v[2] == 0.0), "flat in y: {vertices:?}");
        assert!(normals.iter().all(|n| Vec3::from(*n).distance(Vec3::Z) < 1e-6), "{normals:?}");
    }
    for (vertices, normals) in keys[1].0.iter().zip(&keys[1].1) {
        assert!(
            vertices.iter().all(|v| v[1].abs() < 1e-6 && v[2].abs() == 1.5),
            "upright, three times as wide: {vertices:?}"
        );
        assert!(normals.iter().all(|n| Vec3::from(*n).distance(Vec3::Y) < 1e-6), "{normals:?}");
    }
    assert!(asset.bounds.max[2] >= 1.5 && asset.bounds.min[1] <= -0.5, "all keys are in the box: {:?}", asset.bounds);
}

#[test]
fn widths_of_tubes_and_points_change_by_every_interpolation() {
    let linear = curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[3, 2]);
    let cubic = curves(CurveBasis::BSpline, CurveWrap::Nonperiodic, &[5]);
    for (name, shape, by, count) in [
        ("constant", &linear, Interpolation::Constant, 1),
        ("uniform", &linear, Interpolation::Uniform, 2),
        ("vertex", &linear, Interpolation::Vertex, 5),
        ("varying", &linear, Interpolation::Varying, 5),
        ("cubic, vertex", &cubic, Interpolation::Vertex, 5),
        ("cubic, varying", &cubic, Interpolation::Varying, 3),
        ("points, vertex", &PrimShape::Points, Interpolation::Vertex, 5),
        ("points, constant", &PrimShape::Points, Interpolation::Constant, 1),
    ] {
        let at = |time: f64, by: f32, wide: f32| At {
            time,
            points: bent(by),
            widths: Some(widths(wide, count)),
            ..At::default()
        };
        agree(&format!("{name}: at rest"), shape, by, &[at(0.0, 1.0, 1.0), at(0.25, 1.0, 0.0), at(1.0, 1.0, 3.0)]);
        agree(&format!("{name}: moving"), shape, by, &[at(0.0, 1.0, 1.0), at(1.0, 2.0, 3.0)]);
    }
}

#[test]
fn a_curve_with_a_width_at_any_key_is_kept() {
    let at = |time: f64, widths: [f32; 3]| At {
        time,
        points: vec![[0.0; 3], [2.0, 0.0, 0.0], [4.0, 0.0, 0.0]],
        widths: Some(widths.to_vec()),
        ..At::default()
    };
    let all = [at(0.0, [0.0; 3]), at(1.0, [0.0, 0.0, 1.0])];
    let points = built(&moving(PrimShape::Points, Interpolation::Vertex, &all));
    assert_eq!(points.triangles.len(), 1, "of three points one is seen later");
    assert_eq!((points.triangles[0].vertices[2], points.keys.vertices[0][2]), ([0.0; 3], [0.5, 0.5, 0.0]), "it grows");
    let tube = curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[3]);
    let tube = built(&moving(tube, Interpolation::Vertex, &all));
    assert_eq!(tube.triangles.len(), 1, "of two pieces one is seen later");
    assert_eq!((tube.triangles[0].vertices[2], tube.keys.vertices[0][2]), ([0.0; 3], [0.0, 0.5, 0.0]), "its end grows");
}

#[test]
fn widths_between_samples_and_outside_the_shutter() {
    let at = |time: f64, width: f32| At { time, points: vec![[0.0; 3]], widths: Some(vec![width]), ..At::default() };
    let all = [at(-1.0, 1.0), at(0.5, 4.0), at(1.5, 8.0)];
    let asset = built(&moving(PrimShape::Points, Interpolation::Vertex, &all));
    let radii: Vec<f32> = keys(&asset).iter().map(|(vertices, _)| vertices[0][2][0]).collect();
    assert_eq!((radii, asset.keys.times), (vec![1.5, 2.0, 3.0], vec![0.0, 0.5, 1.0]), "clipped to the shutter");
}

#[test]
fn invalid_widths_give_one_note() {
    let at = |time: f64, widths: Option<Vec<f32>>| At { time, points: bent(1.0), widths, ..At::default() };
    let good = || Some(vec![1.0; 5]);
    for (what, later) in [
        ("another number", Some(vec![1.0; 4])),
        ("none", Some(Vec::new())),
        ("missing", None),
        ("NaN", Some(vec![1.0, 1.0, f32::NAN, 1.0, 1.0])),
        ("negative", Some(vec![1.0, 1.0, -1.0, 1.0, 1.0])),
        ("huge", Some(vec![1.0, 1.0, 1e38, 1.0, 1.0])),
    ] {
        for shape in [PrimShape::Points, curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[5])] {
            let desc = moving(shape, Interpolation::Vertex, &[at(0.0, good()), at(1.0, later.clone())]);
            let built = build_mesh(&desc, 1);
            assert!(built.notes.len() == 1 && built.notes[0].contains("widths"), "{what}: {:?}", built.notes);
            let asset = built.asset.unwrap_or_else(|| panic!("{what}: the prim stays"));
            assert_eq!(asset.keys, MeshKeys::default(), "{what}");
        }
    }
    // A point without a usable width is dropped, whatever its width is later.
    let bad = || Some(vec![f32::NAN, 1.0, 1.0, 1.0, 1.0]);
    let desc = moving(PrimShape::Points, Interpolation::Vertex, &[at(0.0, bad()), at(1.0, bad())]);
    let built = build_mesh(&desc, 1);
    assert_eq!((built.notes.len(), built.dropped.points), (0, 1), "{:?}", built.notes);
}

#[test]
fn different_width_motion_gives_a_different_mesh_key() {
    let at = |time: f64, width: f32| At { time, points: bent(1.0), widths: Some(vec![width; 5]), ..At::default() };
    let key = |all: &[At]| mesh_key(&moving(PrimShape::Points, Interpolation::Vertex, all));
    let keys = [key(&[at(0.0, 1.0), at(1.0, 1.0)]), key(&[at(0.0, 1.0), at(1.0, 2.0)]), key(&[at(0.0, 1.0)])];
    assert!((0..3).all(|i| (0..i).all(|j| keys[i] != keys[j])), "{keys:?}");
}
