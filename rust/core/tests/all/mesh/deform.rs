// SPDX-License-Identifier: Apache-2.0
//! Points that move while the shutter is open: what the keys of an asset hold.

use glam::DVec3;
use oocpt_core::mesh::{MeshKeys, build_mesh, build_mesh_split, mesh_key};
use oocpt_core::scene::{Interpolation, PointsMotion, PointsSample, PrimShape, Primvar};
use oocpt_core::{MeshAsset, MeshDesc, Subdivision, TypedArray};

use crate::mesh::displace;
use crate::support::{grid, polygons};

type Points = Vec<[f32; 3]>;

fn samples(all: Vec<(f64, Points)>) -> PointsMotion {
    let sample = |(time, points): (f64, Points)| PointsSample {
        time,
        points: TypedArray::of(points),
        normals: None,
        widths: None,
    };
    PointsMotion { samples: all.into_iter().map(sample).collect(), ..PointsMotion::default() }
}

/// A triangle in the plane z = `z`.
fn at(z: f32) -> Points {
    vec![[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]]
}

fn triangle(point_motion: PointsMotion) -> MeshDesc {
    MeshDesc { point_motion, ..polygons("/t", &[3], &[0, 1, 2], &at(0.5)) }
}

/// The z of all keys, and their times.
fn heights(desc: &MeshDesc) -> (Vec<f32>, Vec<f32>) {
    let built = build_mesh(desc, 1);
    assert!(built.notes.is_empty(), "{:?}", built.notes);
    let asset = built.asset.unwrap();
    let first = asset.triangles[0].vertices;
    let keys = [first].into_iter().chain(asset.keys.vertices.iter().copied());
    let heights = keys.map(|[a, b, c]| {
        assert!(a[2] == b[2] && b[2] == c[2] && b[0] == 1.0 && c[1] == 1.0, "the same triangle: {a:?} {b:?} {c:?}");
        a[2]
    });
    (heights.collect(), asset.keys.times.clone())
}

#[test]
fn motion_keys_are_the_shutter_ends_and_samples_between() {
    let linear = samples(vec![(-1.0, at(-1.0)), (2.0, at(2.0))]);
    assert_eq!(heights(&triangle(linear)), (vec![0.0, 1.0], vec![0.0, 1.0]), "clipped to the shutter");
    let bent = samples(vec![(-0.5, at(1.0)), (0.25, at(4.0)), (1.0, at(0.0))]);
    assert_eq!(heights(&triangle(bent)), (vec![3.0, 4.0, 0.0], vec![0.0, 0.25, 1.0]), "with the sample between");
    let late = samples(vec![(0.5, at(1.0)), (0.75, at(3.0))]);
    let known = (vec![1.0, 1.0, 3.0, 3.0], vec![0.0, 0.5, 0.75, 1.0]);
    assert_eq!(heights(&triangle(late)), known, "at rest before the first sample and after the last");
    let many = samples((0..=40_u16).map(|k| (f64::from(k) / 40.0, at(f32::from(k)))).collect());
    let (heights_of_many, times) = heights(&triangle(many));
    assert_eq!((times.len(), times[0], times[15]), (16, 0.0, 1.0), "as many as there is room for");
    assert!(heights_of_many.iter().zip(&times).all(|(z, time)| (z - 40.0 * time).abs() < 1e-5), "{heights_of_many:?}");
    let still = samples(vec![(0.0, at(1.0)), (1.0, at(1.0))]);
    assert_eq!(build_mesh(&triangle(still), 1).asset.unwrap().keys, MeshKeys::default(), "nothing moves");
}

#[test]
fn velocities_win_over_samples_and_accelerations_bend() {
    let of = |values: [f32; 3]| Some(TypedArray::of(vec![values; 3]));
    let moving = PointsMotion {
        velocities: of([0.0, 0.0, 4.0]),
        seconds: [-0.25, 0.5],
        ..samples(vec![(0.0, at(9.0)), (1.0, at(8.0))])
    };
    assert_eq!(heights(&triangle(moving.clone())), (vec![-0.5, 2.5], vec![0.0, 1.0]), "z = 0.5 + 4 t");
    let falling = PointsMotion { accelerations: of([0.0, 0.0, 2.0]), ..moving };
    let (found, times) = heights(&triangle(falling));
    assert_eq!(times, [0.0, 0.25, 0.5, 0.75, 1.0]);
    for (z, time) in found.iter().zip(times) {
        let t = -0.25 + 0.75 * time;
        assert!((z - (0.5 + 4.0 * t + t * t)).abs() < 1e-6, "{z} at {time}");
    }
}

#[test]
fn invalid_motion_gives_one_note_and_a_static_mesh() {
    let rates = |count: usize| PointsMotion {
        velocities: Some(TypedArray::of(vec![[1.0_f32, 0.0, 0.0]; count])),
        seconds: [0.0, 1.0],
        ..PointsMotion::default()
    };
    let mut nan = at(1.0);
    nan[1][0] = f32::NAN;
    let mut far = rates(3);
    far.seconds = [0.0, 1e30];
    let cases = [
        ("another number of points", samples(vec![(0.0, at(0.0)), (1.0, vec![[0.0; 3]; 7])])),
        ("no points", samples(vec![(0.0, Vec::new()), (1.0, Vec::new())])),
        ("NaN", samples(vec![(0.0, at(0.0)), (1.0, nan)])),
        ("the order of time", samples(vec![(1.0, at(0.0)), (0.0, at(1.0))])),
        ("no time", samples(vec![(0.0, at(0.0)), (f64::NAN, at(1.0))])),
        ("the same time", samples(vec![(0.5, at(0.0)), (0.5, at(1.0))])),
        ("too few velocities", rates(2)),
        ("too many velocities", rates(4)),
        ("too far", far),
        ("another type", PointsMotion { velocities: Some(TypedArray::of(vec![1.0_f32; 3])), ..rates(3) }),
        ("no seconds", PointsMotion { seconds: [f64::NAN, 1.0], ..rates(3) }),
        ("a shutter of zero", PointsMotion { seconds: [0.0, 0.0], ..rates(3) }),
        ("closed before it opens", PointsMotion { seconds: [1.0, 0.0], ..rates(3) }),
    ];
    for (what, motion) in cases {
        let built = build_mesh(&triangle(motion), 1);
        assert_eq!(built.notes.len(), 1, "{what}: {:?}", built.notes);
        let asset = built.asset.unwrap_or_else(|| panic!("{what}: the mesh stays"));
        assert_eq!(asset.keys, MeshKeys::default(), "{what}");
        assert_eq!(asset.triangles[0].vertices.to_vec(), at(0.5), "{what}: as at the frame's own time");
    }
}

/// All triangles with their later vertices, as bits.
fn looks<'a>(assets: impl IntoIterator<Item = &'a MeshAsset>) -> Vec<Vec<u32>> {
    let mut looks = Vec::new();
    for asset in assets {
        let count = asset.triangles.len();
        assert_eq!(asset.keys.vertices.len(), 2 * count, "two later keys");
        for (at, item) in asset.triangles.iter().enumerate() {
            let keys = [item.vertices, asset.keys.vertices[at], asset.keys.vertices[count + at]];
            for v in keys.as_flattened() {
                let holds = |k: usize| asset.bounds.min[k] <= v[k] && v[k] <= asset.bounds.max[k];
                assert!((0..3).all(holds), "{v:?} in {:?}", asset.bounds);
            }
            let normals = [&asset.keys.normals[at], &asset.keys.normals[count + at]];
            let numbers = keys.iter().chain(normals).flatten().flatten();
            looks.push(numbers.map(|v| v.to_bits()).chain([item.face]).collect());
        }
    }
    looks.sort_unstable();
    looks
}

/// A smooth grid that is bent at three keys.
fn bending(n: u16) -> MeshDesc {
    let mut desc = grid("/grid", n);
    let view = desc.points.view();
    let bend = |by: f64| {
        let point = |at: usize| view.vec3(at).unwrap();
        let bent = |p: DVec3| DVec3::new(p.x, p.y, p.z + by * p.x * p.y).as_vec3().to_array();
        (0..view.len()).map(|at| bent(point(at))).collect::<Points>()
    };
    let motion = samples(vec![(0.0, bend(0.0)), (0.5, bend(2.0)), (1.0, bend(-1.0))]);
    desc.subdivision = Subdivision::CatmullClark;
    desc.point_motion = motion;
    desc
}

#[test]
fn clusters_have_all_keys_of_their_triangles() {
    let desc = bending(40);
    let whole = build_mesh(&desc, 1).asset.unwrap();
    let limit = whole.device_bytes() / 5;
    let split = build_mesh_split(&desc, 1, limit, limit);
    assert!(split.clusters.len() >= 5, "{} clusters", split.clusters.len());
    assert!(split.clusters.iter().all(|cluster| cluster.device_bytes() <= limit), "each as small as asked for");
    assert_eq!(looks(split.clusters.iter().map(|c| &**c)), looks([&*whole]), "every triangle once, with all its bits");
}

#[test]
fn limit_surfaces_have_one_tessellation_at_all_keys() {
    let desc = MeshDesc { refine_level: 2, ..bending(6) };
    let moving = build_mesh(&desc, 1).asset.unwrap();
    let count = moving.triangles.len();
    assert!(count >= 36 * 32, "{count} triangles");
    for (key, sample) in desc.point_motion.samples.iter().enumerate() {
        let still = MeshDesc { points: sample.points.clone(), point_motion: PointsMotion::default(), ..desc.clone() };
        let still = build_mesh(&still, 1).asset.unwrap();
        let corners = |vertices: &[[f32; 3]; 3]| vertices.as_flattened().iter().map(|v| v.to_bits()).collect();
        let mut known: Vec<Vec<u32>> = still.triangles.iter().map(|item| corners(&item.vertices)).collect();
        let later = moving.keys.vertices.chunks(count);
        let mut found: Vec<Vec<u32>> = match key.checked_sub(1) {
            None => moving.triangles.iter().map(|item| corners(&item.vertices)).collect(),
            Some(key) => later.skip(key).flat_map(|key| key.iter().map(corners)).take(count).collect(),
        };
        known.sort_unstable();
        found.sort_unstable();
        assert!(known == found, "key {key} is the surface of its points");
    }
}

#[test]
fn displacement_applies_at_all_keys() {
    // A square that turns about an edge: as long at all keys, so that each alone is cut alike.
    let turned = |angle: f32| {
        let points = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        points.map(|[x, y]: [f32; 2]| [x * angle.cos(), y, x * angle.sin()]).to_vec()
    };
    let point_motion = samples(vec![(0.0, turned(0.0)), (1.0, turned(0.8))]);
    let moving = displace::build(&MeshDesc { point_motion, ..displace::square() }, &displace::constant(0.25), 3.5);
    let moving = displace::asset(&moving);
    assert_eq!((moving.triangles.len(), moving.keys.times.len()), (32, 2));
    let corners = |vertices: &[[f32; 3]; 3]| vertices.as_flattened().iter().map(|v| v.to_bits()).collect();
    let first: Vec<_> = moving.triangles.iter().map(|item| item.vertices).collect();
    for (angle, found) in [(0.0, &first), (0.8, &moving.keys.vertices)] {
        let still = MeshDesc { points: TypedArray::of(turned(angle)), ..displace::square() };
        let still = displace::build(&still, &displace::constant(0.25), 3.5);
        let mut known: Vec<Vec<u32>> =
            displace::asset(&still).triangles.iter().map(|item| corners(&item.vertices)).collect();
        let mut found: Vec<Vec<u32>> = found.iter().map(corners).collect();
        known.sort_unstable();
        found.sort_unstable();
        assert!(known == found, "at {angle}");
    }
}

#[test]
fn points_move_with_their_widths() {
    let one = Primvar { interpolation: Interpolation::Constant, values: TypedArray::of(vec![1.0_f32]), indices: None };
    let desc = MeshDesc {
        shape: PrimShape::Points,
        widths: Some(one),
        ..triangle(samples(vec![(0.0, at(1.0)), (1.0, at(3.0))]))
    };
    let asset = build_mesh(&desc, 1).asset.unwrap();
    assert_eq!(asset.keys.vertices.len(), 3);
    for (item, later) in asset.triangles.iter().zip(&asset.keys.vertices) {
        let [first, _, radii] = item.vertices;
        assert!(first[2] == 1.0 && later[0] == [first[0], first[1], 3.0], "{first:?} to {later:?}");
        assert_eq!((radii, later[2]), ([0.5, 0.5, 0.0], [0.5, 0.5, 0.0]), "half the width");
    }
}

#[test]
fn different_motion_gives_a_different_mesh_key() {
    let still = triangle(PointsMotion::default());
    let moving = triangle(samples(vec![(0.0, at(0.0)), (1.0, at(1.0))]));
    let faster = triangle(samples(vec![(0.0, at(0.0)), (1.0, at(2.0))]));
    let later = triangle(samples(vec![(0.0, at(0.0)), (1.5, at(1.0))]));
    let keys = [&still, &moving, &faster, &later].map(mesh_key);
    assert!((0..4).all(|i| (0..i).all(|j| keys[i] != keys[j])), "{keys:?}");
}
