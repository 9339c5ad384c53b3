// SPDX-License-Identifier: Apache-2.0
//! Curves and points as assets: pieces, radii, values along curves; unusable data are left out and counted.

use glam::{DVec3, Vec3};
use oocpt_abi::AttributeRate;
use oocpt_core::desc::{CurveBasis, CurveWrap, CurvesDesc, PrimShape};
use oocpt_core::mesh::{BuildDemand, BuiltMesh, DicingRate, LeafKind, WantedPrimvar, build_mesh_with, split_mesh};
use oocpt_core::{
    Aabb, AnyAttribute, DroppedData, Interpolation, MeshAsset, MeshDesc, NamedPrimvar, Primvar, TypedArray,
};
use proptest::prelude::*;

fn primvar<T: oocpt_core::array::ArrayElement + std::fmt::Debug>(
    interpolation: Interpolation,
    values: Vec<T>,
) -> Primvar {
    Primvar { interpolation, values: TypedArray::of(values), indices: None }
}

fn curves(basis: CurveBasis, wrap: CurveWrap, counts: &[i32], points: &[[f32; 3]]) -> MeshDesc {
    MeshDesc {
        shape: PrimShape::Curves(CurvesDesc { basis, wrap, counts: TypedArray::of(counts.to_vec()), indices: None }),
        points: TypedArray::of(points.to_vec()),
        widths: Some(primvar(Interpolation::Constant, vec![0.2_f32])),
        ..MeshDesc::default()
    }
}

fn build_with(desc: &MeshDesc, wanted: &[&str], dicing: &DicingRate) -> BuiltMesh {
    let wanted: Vec<WantedPrimvar> =
        wanted.iter().zip(7..).map(|(name, id)| WantedPrimvar { name: (*name).into(), id }).collect();
    let demand = BuildDemand { wanted: &wanted, dicing: Some(dicing), ..BuildDemand::default() };
    build_mesh_with(desc, &demand, 1, u64::MAX, u64::MAX)
}

fn build(desc: &MeshDesc) -> BuiltMesh {
    build_with(desc, &[], &DicingRate::default())
}

fn asset(built: &BuiltMesh) -> MeshAsset {
    assert_eq!(built.dropped, DroppedData::default(), "nothing is wrong");
    (**built.asset.as_ref().unwrap()).clone()
}

/// The pieces in the order of their faces and ends, as (curve, ends, radii).
fn pieces(asset: &MeshAsset) -> Vec<(u32, [Vec3; 2], [f32; 2])> {
    assert_ne!(asset.kind, LeafKind::Triangles, "no triangles");
    let piece = |t: &oocpt_core::Triangle| {
        let [a, b, radii] = t.vertices;
        (t.face, [a, b].map(Vec3::from), [radii[0], radii[1]])
    };
    asset.triangles.iter().map(piece).collect()
}

const ZIGZAG: [[f32; 3]; 4] = [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [2.0, -1.0, 1.0], [3.0, 0.0, 0.0]];

#[test]
fn linear_curves_are_their_segments() {
    let one = curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[2, 2], &ZIGZAG);
    let asset = asset(&build(&one));
    let mut found = pieces(&asset);
    found.sort_by_key(|piece| piece.0);
    let z = ZIGZAG.map(Vec3::from);
    assert_eq!(found, [(0, [z[0], z[1]], [0.1; 2]), (1, [z[2], z[3]], [0.1; 2])], "ends and half the width");
    assert!(asset.double_sided, "curves are seen from all sides");
    let around = asset.triangles.iter().fold(Aabb::EMPTY, |b, t| b.union(&t.bounds(asset.kind)));
    assert_eq!(asset.bounds, around, "the box is that of the balls");
    assert!(asset.bounds.min[0] <= -0.1 && asset.bounds.min[0] > -0.1001, "{:?}", asset.bounds);
    let closed = build(&curves(CurveBasis::Linear, CurveWrap::Periodic, &[4], &ZIGZAG));
    assert_eq!(closed.asset.unwrap().triangles.len(), 4, "and back to the first point");
}

/// Pieces of a cubic curve stay within the tolerance of it, whatever the camera sees of them.
#[test]
fn curve_pieces_stay_within_their_tolerance() {
    let bezier = |t: f64| {
        let s = 1.0 - t;
        let w = [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t];
        ZIGZAG.iter().zip(w).map(|(p, w)| Vec3::from(*p).as_dvec3() * w).sum::<DVec3>()
    };
    let mut before = 0;
    for density in [1.0, 30.0, 300.0] {
        let dicing = DicingRate { pixels: 2.0, density, focal: 1.0, ..DicingRate::default() };
        let thin = MeshDesc {
            widths: Some(primvar(Interpolation::Constant, vec![1e-4_f32])),
            ..curves(CurveBasis::Bezier, CurveWrap::Nonperiodic, &[4], &ZIGZAG)
        };
        let found = pieces(&asset(&build_with(&thin, &[], &dicing)));
        let off = (0..=1000).map(|k| {
            let p = bezier(f64::from(k) / 1000.0);
            let distance = |[a, b]: [Vec3; 2]| {
                let (a, along) = (a.as_dvec3(), (b - a).as_dvec3());
                p.distance(a + along * ((p - a).dot(along) / along.length_squared()).clamp(0.0, 1.0))
            };
            found.iter().map(|piece| distance(piece.1)).fold(f64::INFINITY, f64::min)
        });
        let (off, allowed) = (off.fold(0.0, f64::max), 0.05 * 2.0 / density);
        assert!(off <= allowed, "{} pieces are {off} from the curve, {allowed} is allowed", found.len());
        assert!(found.len() > before, "more pieces where it is nearer");
        before = found.len();
    }
    assert!(before < 256, "not the most that are possible");
}

#[test]
fn widths_support_uniform_varying_and_vertex_rates() {
    let points: Vec<[f32; 3]> = (0..10_u8).map(|k| [f32::from(k), 0.0, 0.0]).collect();
    let two = curves(CurveBasis::BSpline, CurveWrap::Nonperiodic, &[5, 5], &points);
    let radii_of = |interpolation, widths: Vec<f32>| {
        let built = build(&MeshDesc { widths: Some(primvar(interpolation, widths)), ..two.clone() });
        let mut all: Vec<(f32, f32)> = Vec::new();
        for (_, ends, radii) in pieces(&asset(&built)) {
            all.extend(ends.iter().zip(radii).map(|(end, radius)| (end.x, radius)));
        }
        all
    };
    for (x, radius) in radii_of(Interpolation::Uniform, vec![2.0, 4.0]) {
        assert!((radius - if x < 4.5 { 1.0 } else { 2.0 }).abs() < 1e-6, "by curve, at {x}");
    }
    // Two segments a curve, three ends: at 1, 2, 3 and 6, 7, 8.
    for (x, radius) in radii_of(Interpolation::Varying, vec![0.0, 2.0, 4.0, 6.0, 8.0, 10.0]) {
        let expected = if x < 4.5 { x - 1.0 } else { x - 6.0 + 3.0 };
        assert!((radius - expected).abs() < 1e-4, "by end: {radius} at {x}");
    }
    // A spline reproduces linear values.
    for (x, radius) in radii_of(Interpolation::Vertex, (0..10_u8).map(f32::from).collect()) {
        assert!((radius - 0.5 * x).abs() < 1e-4, "by point: {radius} at {x}");
    }
    let built = build(&MeshDesc { widths: Some(primvar(Interpolation::Vertex, vec![1.0_f32; 3])), ..two.clone() });
    assert_eq!(built.dropped, DroppedData { primvars: 1, ..DroppedData::NONE }, "too few widths");
    let first = pieces(&built.asset.unwrap()).iter().all(|piece| (piece.2[0] - 0.5).abs() < 1e-6);
    assert!(first, "where one is missing, the first counts");
}

#[test]
fn curve_primvars_are_interpolated_along_the_curve() {
    let points: Vec<[f32; 3]> = (0..6_u8).map(|k| [f32::from(k), 0.0, 0.0]).collect();
    let named = |name: &str, primvar| NamedPrimvar { name: name.into(), primvar };
    let desc = MeshDesc {
        primvars: vec![
            named("smooth", primvar(Interpolation::Vertex, (0..6_u8).map(f32::from).collect())),
            named("ends", primvar(Interpolation::Varying, vec![1.0_f32, 2.0, 3.0, 4.0])),
            named("curve", primvar(Interpolation::Uniform, vec![7.0_f32])),
        ],
        ..curves(CurveBasis::CatmullRom, CurveWrap::Nonperiodic, &[6], &points)
    };
    let asset = asset(&build_with(&desc, &["smooth", "ends", "curve"], &DicingRate::default()));
    let values = |id: u32| match &asset.primvars.iter().find(|primvar| primvar.id == id).unwrap().values {
        AnyAttribute::One(values) => values.clone(),
        other => panic!("{other:?} has one float"),
    };
    let (smooth, ends, curve) = (values(7), values(8), values(9));
    assert_eq!([smooth.rate, curve.rate], [AttributeRate::Vertex, AttributeRate::Uniform], "rates");
    for (at, (triangle, corners)) in asset.triangles.iter().zip(&asset.corner_indices).enumerate() {
        assert_eq!(corners[0], corners[2], "the third corner is the first one");
        for (place, corner) in triangle.vertices.iter().zip(corners).take(2) {
            let (x, vertex) = (place[0], *corner as usize);
            assert!((smooth.values[vertex] - x).abs() < 1e-4, "by point at {x}");
            assert!((ends.values[vertex] - x).abs() < 1e-4, "by end at {x}");
        }
        assert!((curve.values[at] - 7.0).abs() < 1e-6, "by curve");
    }
}

#[test]
fn curves_with_normals_are_ribbons() {
    let desc = MeshDesc {
        normals: Some(primvar(Interpolation::Vertex, vec![[0.0_f32, 0.0, 1.0]; 4])),
        ..curves(
            CurveBasis::Linear,
            CurveWrap::Nonperiodic,
            &[4],
            &[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 0.0, 0.0]],
        )
    };
    let asset = asset(&build(&desc));
    assert_eq!((asset.kind, asset.triangles.len()), (LeafKind::Triangles, 6), "two triangles a piece");
    assert_eq!((asset.bounds.min, asset.bounds.max), ([0.0, -0.1, 0.0], [3.0, 0.1, 0.0]), "as wide as the curve");
    for triangle in &asset.triangles {
        let [a, b, c] = triangle.vertices.map(Vec3::from);
        assert!((b - a).cross(c - a).z > 0.0, "it faces where its normals point");
    }
    for normal in &asset.normals.as_ref().unwrap().values {
        assert!(Vec3::from(*normal).distance(Vec3::Z) < 1e-6, "{normal:?}");
    }
}

#[test]
fn points_are_spheres() {
    let desc = MeshDesc {
        shape: PrimShape::Points,
        widths: Some(primvar(Interpolation::Vertex, vec![1.0_f32, 2.0, 0.0, 4.0])),
        display_color: Some(primvar(Interpolation::Vertex, ZIGZAG.map(|p| p.map(f32::abs)).to_vec())),
        ..curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[], &ZIGZAG)
    };
    let asset = asset(&build(&desc));
    assert_eq!(asset.kind, LeafKind::Points);
    let mut found = pieces(&asset);
    found.sort_by_key(|piece| piece.0);
    let numbers: Vec<u32> = found.iter().map(|piece| piece.0).collect();
    assert_eq!(numbers, [0, 1, 3], "a point without a width is not seen, and nothing bad");
    assert_eq!(found[2].1, [Vec3::from(ZIGZAG[3]); 2], "both ends are the point");
    assert_eq!(found[2].2, [2.0; 2], "half the width");
    let colors = asset.colors.as_ref().unwrap();
    for (triangle, corners) in asset.triangles.iter().zip(&asset.corner_indices) {
        let expected = triangle.vertices[0].map(f32::abs);
        assert_eq!(colors.values[corners[0] as usize], expected, "the colour of the point");
    }
}

/// Points in a cube, without an order.
fn scattered(count: u32, widths: Interpolation) -> MeshDesc {
    let word = |k: u32| k.wrapping_mul(2_654_435_761).rotate_left(13).wrapping_mul(2_246_822_519);
    let place = |k: u32| f32::from(u16::try_from(word(k) >> 16).unwrap()) / 65536.0;
    let points: Vec<[f32; 3]> = (0..count).map(|k| [0, 1, 2].map(|axis| place(3 * k + axis))).collect();
    let count = if widths == Interpolation::Constant { 1 } else { count };
    let widths = primvar(widths, (0..count).map(|k| 0.002 + 0.001 * place(k)).collect::<Vec<f32>>());
    MeshDesc {
        shape: PrimShape::Points,
        widths: Some(widths),
        ..curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[], &points)
    }
}

#[test]
fn a_point_takes_at_most_twenty_bytes() {
    // Device bytes of an item, its radius, and its share of the tree.
    for (widths, most) in [(Interpolation::Constant, 20.0), (Interpolation::Vertex, 24.0)] {
        let asset = asset(&build(&scattered(50_000, widths)));
        asset.bvh.validate(&asset.triangles, asset.kind).unwrap();
        let bytes = f64::from(u32::try_from(asset.device_bytes()).unwrap()) / 50_000.0;
        assert!((16.0..=most).contains(&bytes), "{bytes} bytes");
    }
}

#[test]
fn point_trees_of_any_size_hold_every_point() {
    for count in (1..70).chain([127, 128, 129, 1000, 1023]) {
        let asset = asset(&build(&scattered(count, Interpolation::Vertex)));
        assert_eq!(asset.bvh.validate(&asset.triangles, asset.kind), Ok(()), "{count}");
        let mut faces: Vec<u32> = asset.triangles.iter().map(|item| item.face).collect();
        faces.sort_unstable();
        assert!(faces.into_iter().eq(0..count), "{count}: each once");
    }
}

#[test]
fn point_clusters_fill_the_chunk_size() {
    let whole = asset(&build(&scattered(20_000, Interpolation::Vertex)));
    let clusters = split_mesh(&whole, 64 << 10);
    assert_eq!(clusters.iter().map(|cluster| cluster.triangles.len()).sum::<usize>(), 20_000);
    for cluster in &clusters {
        assert_eq!(cluster.kind, LeafKind::Points);
        assert_eq!(cluster.bvh.validate(&cluster.triangles, cluster.kind), Ok(()));
        assert!(cluster.device_bytes() <= 64 << 10);
    }
    assert!(clusters.len() <= 9, "{} clusters, {} bytes", clusters.len(), whole.device_bytes());
}

#[test]
fn clusters_keep_their_leaf_kind() {
    let points: Vec<[f32; 3]> = (0..400_u16).map(|k| [f32::from(k) * 0.1, f32::from(k % 7), 0.0]).collect();
    let desc = curves(CurveBasis::BSpline, CurveWrap::Nonperiodic, &[400], &points);
    let whole = asset(&build(&desc));
    let clusters = split_mesh(&whole, 16 << 10);
    assert!(clusters.len() > 5, "{} clusters", clusters.len());
    assert!(clusters.iter().all(|cluster| cluster.kind == LeafKind::Rounds), "all round");
    assert_eq!(clusters.iter().map(|cluster| cluster.triangles.len()).sum::<usize>(), whole.triangles.len());
}

#[test]
fn invalid_curves_are_counted_as_dropped() {
    let dropped = |basis, counts: &[i32], points: &[[f32; 3]]| {
        let built = build(&curves(basis, CurveWrap::Nonperiodic, counts, points));
        (built.dropped.curves, built.asset.map_or(0, |asset| asset.triangles.len()))
    };
    let nan = [[0.0; 3], [f32::NAN, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]];
    assert_eq!(dropped(CurveBasis::Linear, &[2, 2], &nan), (1, 1), "a point that is no number");
    assert_eq!(dropped(CurveBasis::Linear, &[-3, 4], &ZIGZAG), (1, 3), "a negative count takes no points");
    assert_eq!(dropped(CurveBasis::Linear, &[2, 9, 2], &ZIGZAG), (2, 1), "past the end");
    assert_eq!(dropped(CurveBasis::BSpline, &[3], &ZIGZAG), (1, 0), "too few points");
    assert_eq!(dropped(CurveBasis::Linear, &[1, 0, 2], &ZIGZAG), (2, 1), "nothing to draw");
    let wide = MeshDesc {
        shape: PrimShape::Points,
        widths: Some(primvar(Interpolation::Vertex, vec![1.0, f32::INFINITY, -1.0, 1.0])),
        ..curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[], &nan)
    };
    let built = build(&wide);
    assert_eq!((built.dropped.points, built.asset.unwrap().triangles.len()), (2, 2), "points without place or width");
}

#[test]
fn curves_of_no_extent_give_no_asset() {
    let one = || curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[4], &ZIGZAG);
    let without_length = Some(primvar(Interpolation::Vertex, vec![[0.0_f32; 3]; 4]));
    let thin = || Some(primvar(Interpolation::Constant, vec![0.0_f32]));
    let cases = [
        ("no curves", curves(CurveBasis::Linear, CurveWrap::Nonperiodic, &[], &[])),
        ("ribbons whose normals have no length", MeshDesc { normals: without_length, ..one() }),
        ("points without a width", MeshDesc { shape: PrimShape::Points, widths: thin(), ..one() }),
    ];
    for (what, desc) in cases {
        let built = build(&desc);
        assert!(built.asset.is_none(), "{what}");
        assert_eq!(built.dropped, DroppedData { empty_items: 1, ..DroppedData::NONE }, "{what}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    /// Random arrays of wrong lengths give an asset of finite numbers, or nothing; never a panic.
    #[test]
    fn random_curves_never_panic(
        basis in 0..4_usize,
        wrap in 0..4_usize,
        counts in proptest::collection::vec(-2..9_i32, 0..8),
        indices in proptest::option::of(proptest::collection::vec(-1..14_i32, 0..30)),
        points in proptest::collection::vec(proptest::array::uniform3(prop_oneof![-2.0..2.0_f32, Just(0.0), Just(1e18), Just(1e30), Just(f32::NAN)]), 0..12),
        widths in proptest::collection::vec(prop_oneof![0.0..1.0_f32, Just(-1.0), Just(1e18), Just(f32::NAN)], 0..12),
        rate in 0..6_usize,
        normals in 0..14_usize,
        density in prop_oneof![Just(0.0), Just(1e-30), Just(50.0), Just(1e30), Just(f64::INFINITY)],
    ) {
        let rates = [Interpolation::Constant, Interpolation::Uniform, Interpolation::Varying, Interpolation::Vertex, Interpolation::FaceVarying, Interpolation::Instance];
        let basis = [CurveBasis::Linear, CurveBasis::Bezier, CurveBasis::BSpline, CurveBasis::CatmullRom][basis];
        let wrap = [CurveWrap::Nonperiodic, CurveWrap::Periodic, CurveWrap::Pinned, CurveWrap::Segmented][wrap];
        let mut desc = MeshDesc {
            widths: Some(primvar(rates[rate], widths.clone())),
            normals: (normals > 0).then(|| primvar(rates[rate], vec![[0.0_f32, 1.0, 0.0]; normals - 1])),
            display_color: Some(primvar(rates[(rate + 1) % 6], vec![[0.5_f32; 3]; widths.len()])),
            ..curves(basis, wrap, &counts, &points)
        };
        if let PrimShape::Curves(curves) = &mut desc.shape {
            curves.indices = indices.map(TypedArray::of);
        }
        let dicing = DicingRate { pixels: 2.0, density, focal: 1.0, ..DicingRate::default() };
        for desc in [desc.clone(), MeshDesc { shape: PrimShape::Points, ..desc }] {
            if let Some(asset) = build_with(&desc, &[], &dicing).asset {
                prop_assert!(!asset.triangles.is_empty(), "an asset has something");
                prop_assert!(asset.triangles.iter().flat_map(|t| t.vertices.as_flattened()).all(|v| v.is_finite()), "numbers");
                // The check itself has a rounding error proportional to the size of the whole.
                let largest = asset.bounds.max.iter().chain(&asset.bounds.min).fold(0.0, |m, v| v.abs().max(m));
                if largest < 1e6 {
                    prop_assert_eq!(asset.bvh.validate(&asset.triangles, asset.kind), Ok(()), "the hierarchy");
                }
            }
        }
    }
}
