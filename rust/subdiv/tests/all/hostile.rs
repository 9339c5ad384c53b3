// SPDX-License-Identifier: Apache-2.0
//! Topologies that make no sense: an error or triangles, never a crash; and what is refused is named.
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use oocpt_subdiv::{
    BoundaryRule, ControlMesh, CreaseRule, Error, FaceVaryingChannel, FaceVaryingLinear, LimitSurface, PackedValues,
    SubdivisionRules, SubdivisionScheme, SurfaceData, TriangleRule,
};
use proptest::prelude::*;

fn rules() -> impl Strategy<Value = SubdivisionRules> {
    let scheme = prop_oneof![
        Just(SubdivisionScheme::CatmullClark),
        Just(SubdivisionScheme::Loop),
        Just(SubdivisionScheme::Bilinear)
    ];
    let boundary =
        prop_oneof![Just(BoundaryRule::None), Just(BoundaryRule::EdgeOnly), Just(BoundaryRule::EdgeAndCorner)];
    let linear = prop_oneof![
        Just(FaceVaryingLinear::None),
        Just(FaceVaryingLinear::CornersOnly),
        Just(FaceVaryingLinear::CornersPlus1),
        Just(FaceVaryingLinear::CornersPlus2),
        Just(FaceVaryingLinear::Boundaries),
        Just(FaceVaryingLinear::All),
    ];
    (scheme, boundary, linear, any::<bool>(), any::<bool>()).prop_map(|(scheme, boundary, face_varying, a, b)| {
        SubdivisionRules {
            scheme,
            boundary,
            face_varying,
            triangles: if a { TriangleRule::Smooth } else { TriangleRule::CatmullClark },
            creasing: if b { CreaseRule::Chaikin } else { CreaseRule::Uniform },
        }
    })
}

/// Numbers of the first dozen points, in faces of three to seven: most meshes are non-manifold, many faces double.
fn faces(triangles: bool) -> impl Strategy<Value = Vec<Vec<i32>>> {
    let corners = if triangles { 3..4_usize } else { 3..8_usize };
    let all: Vec<i32> = (0..12).collect();
    let face = corners.prop_flat_map(move |count| proptest::sample::subsequence(all.clone(), count).prop_shuffle());
    proptest::collection::vec(face, 1..14)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 600, ..ProptestConfig::default() })]

    #[test]
    fn random_meshes_never_crash(
        rules in rules(),
        faces in any::<bool>().prop_flat_map(faces),
        creases in proptest::collection::vec((0..12_i32, 0..12_i32, 0.0..12.0_f32), 0..10),
        corners in proptest::collection::vec((0..12_i32, 0.0..12.0_f32), 0..5),
        holes in proptest::collection::vec(0..14_i32, 0..3),
        numbers in proptest::collection::vec(0..9_i32, 7 * 14),
        rate in 1..9_i32,
        positions in proptest::collection::vec(prop_oneof![-2.0..2.0_f32, Just(0.0), Just(1e18), Just(f32::NAN)], 36),
    ) {
        let counts: Vec<i32> = faces.iter().map(|face| i32::try_from(face.len()).unwrap()).collect();
        let points: Vec<i32> = faces.iter().flatten().copied().collect();
        let pairs: Vec<i32> = creases.iter().flat_map(|&(a, b, _)| [a, b]).collect();
        let weights: Vec<f32> = creases.iter().map(|crease| crease.2).collect();
        let holes: Vec<i32> = holes.into_iter().filter(|&hole| hole < i32::try_from(faces.len()).unwrap()).collect();
        let channels = [FaceVaryingChannel { corners: &numbers[..points.len()], count: 9 }];
        let control = ControlMesh {
            rules,
            point_count: 12,
            face_counts: &counts,
            face_points: &points,
            crease_pairs: &pairs,
            crease_weights: &weights,
            corner_points: &corners.iter().map(|c| c.0).collect::<Vec<_>>(),
            corner_weights: &corners.iter().map(|c| c.1).collect::<Vec<_>>(),
            holes: &holes,
            channels: &channels,
        };
        let Ok(surface) = LimitSurface::new(&control) else {
            let is_odd = rules.scheme == SubdivisionScheme::Loop && counts.iter().any(|&count| count != 3);
            prop_assert!(is_odd, "only this is refused here");
            return Ok(());
        };
        let rates: Vec<i32> = (0..surface.edges().len()).map(|edge| 1 + (rate + i32::try_from(edge).unwrap()) % 8).collect();
        let floats = [0.5_f32; 18];
        let values = [PackedValues { width: 2, floats: &floats }];
        let data = SurfaceData { positions: &positions, channels: &values, ..SurfaceData::default() };
        let facets = surface.tessellate(&rates, &data).unwrap();
        let vertices = facets.positions.len() / 3;
        prop_assert!(facets.triangles.iter().all(|&v| (v as usize) < vertices), "vertices in range");
        prop_assert!(facets.faces.iter().all(|&face| (face as usize) < faces.len()), "faces in range");
        prop_assert_eq!(facets.normals.len(), 3 * vertices);
        prop_assert_eq!(facets.face_varying.len(), 2 * vertices);
        prop_assert!(facets.face_varying.iter().all(|v| (v - 0.5).abs() < 1e-4), "a constant stays one");
    }
}

/// A quad, changed.
fn quad<'a>() -> ControlMesh<'a> {
    ControlMesh { point_count: 4, face_counts: &[4], face_points: &[0, 1, 2, 3], ..ControlMesh::default() }
}

fn refusal(control: &ControlMesh<'_>) -> String {
    LimitSurface::new(control).unwrap_err().to_string()
}

#[test]
fn inconsistent_topology_is_refused() {
    assert!(LimitSurface::new(&quad()).is_ok(), "the quad itself is fine");
    let cases = [
        ("a corner of a face names no point", ControlMesh { face_points: &[0, 1, 2, 4], ..quad() }),
        ("a corner of a face names no point", ControlMesh { face_points: &[0, 1, 2, -1], ..quad() }),
        ("a face has a point twice", ControlMesh { face_points: &[0, 1, 2, 1], ..quad() }),
        ("a face has too few or too many points", ControlMesh { face_counts: &[2, 2], ..quad() }),
        ("a face has too few or too many points", ControlMesh { face_counts: &[-4], ..quad() }),
        ("faces have more corners than there are", ControlMesh { face_counts: &[4, 3], ..quad() }),
        ("corners that belong to no face", ControlMesh { face_counts: &[3], ..quad() }),
        ("a crease names no point", ControlMesh { crease_pairs: &[0, 4], crease_weights: &[1.0], ..quad() }),
        ("one sharpness for each sharp edge", ControlMesh { crease_pairs: &[0, 1], ..quad() }),
        (
            "a sharpness is not a number from 0 on",
            ControlMesh { corner_points: &[0], corner_weights: &[f32::NAN], ..quad() },
        ),
        ("one sharpness for each sharp point", ControlMesh { corner_points: &[0], ..quad() }),
        ("a hole names no face", ControlMesh { holes: &[1], ..quad() }),
        (
            "one value for each corner",
            ControlMesh { channels: &[FaceVaryingChannel { corners: &[0], count: 1 }], ..quad() },
        ),
        (
            "a corner names no value",
            ControlMesh { channels: &[FaceVaryingChannel { corners: &[0, 0, 0, 1], count: 1 }], ..quad() },
        ),
        (
            "Loop's scheme subdivides triangles only",
            ControlMesh {
                rules: SubdivisionRules { scheme: SubdivisionScheme::Loop, ..SubdivisionRules::default() },
                ..quad()
            },
        ),
    ];
    for (reason, control) in cases {
        assert_eq!(refusal(&control), reason);
    }
    let fan: Vec<i32> = (0..4000).flat_map(|k| [0, k + 1, k + 2]).collect();
    let counts = vec![3; 4000];
    let fan = ControlMesh { point_count: 4002, face_counts: &counts, face_points: &fan, ..ControlMesh::default() };
    assert_eq!(refusal(&fan), "too many faces meet at a point");
}

#[test]
fn rates_and_values_must_fit() {
    let surface = LimitSurface::new(&quad()).unwrap();
    let positions = [0.0; 12];
    let data = SurfaceData { positions: &positions, ..SurfaceData::default() };
    let fails =
        |rates: &[i32], data: &SurfaceData<'_>| matches!(surface.tessellate(rates, data), Err(Error::Invalid(_)));
    assert!(surface.tessellate(&[1, 2, 3, 4], &data).is_ok(), "fits");
    assert!(fails(&[1, 2, 3], &data), "a rate is missing");
    assert!(fails(&[1, 2, 3, 0], &data) && fails(&[1, 2, 3, 2049], &data), "rates are from 1 to 2048");
    assert!(fails(&[1; 4], &SurfaceData { positions: &positions[1..], ..data }), "a position is missing");
    assert!(
        fails(&[1; 4], &SurfaceData { vertex: PackedValues { width: 2, floats: &[0.0; 7] }, ..data }),
        "half a value"
    );
    assert!(fails(&[1; 4], &SurfaceData { channels: &[PackedValues::default()], ..data }), "a channel too many");
}

/// A fan of `count` triangles around a point, whose edges have all kinds of sharpness up to `sharpness`.
fn fan(count: i32, sharpness: f32) -> Result<usize, Error> {
    let corners: Vec<i32> = (0..count).flat_map(|k| [0, k + 1, (k + 1) % count + 1]).collect();
    let number = usize::try_from(count).unwrap();
    let pairs: Vec<i32> = (0..count).flat_map(|k| [0, k + 1]).collect();
    let weights: Vec<f32> = (0..37_u8).cycle().take(number).map(|k| sharpness * f32::from(k) * 0.1).collect();
    let is_sharp = sharpness > 0.0;
    let control = ControlMesh {
        point_count: number + 1,
        face_counts: &vec![3; number],
        face_points: &corners,
        crease_pairs: if is_sharp { &pairs } else { &[] },
        crease_weights: if is_sharp { &weights } else { &[] },
        ..ControlMesh::default()
    };
    let surface = LimitSurface::new(&control)?;
    let around = |k: i32| [(k as f32).cos(), (k as f32).sin(), 0.0];
    let positions: Vec<f32> = (0..=count).flat_map(around).collect();
    let data = SurfaceData { positions: &positions, ..SurfaceData::default() };
    Ok(surface.tessellate(&vec![1; surface.edges().len()], &data)?.triangles.len() / 3)
}

/// The work around a point grows with the third power of its faces, or the fourth: what is allowed ends in seconds.
#[test]
fn high_valence_points_terminate() {
    assert_eq!(fan(256, 0.0), Ok(256), "one triangle a face");
    assert_eq!(fan(120, 1.0), Ok(120), "with sharp edges");
    assert_eq!(fan(257, 0.0), Err(Error::Invalid("too many faces meet at a point")));
    assert_eq!(fan(200, 1.0), Err(Error::Invalid("too many faces meet at too many points")));
    let corners: Vec<i32> = (0..256).collect();
    let polygon =
        ControlMesh { point_count: 256, face_counts: &[256], face_points: &corners, ..ControlMesh::default() };
    let surface = LimitSurface::new(&polygon).unwrap();
    let positions = vec![0.5; 3 * 256];
    let data = SurfaceData { positions: &positions, ..SurfaceData::default() };
    assert!(surface.tessellate(&vec![2; 256], &data).is_ok(), "a face with many points");
}
