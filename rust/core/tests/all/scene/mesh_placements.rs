// SPDX-License-Identifier: Apache-2.0
//! Placements of meshes, multiplied out: their positions at every time of the shutter, and bounds that contain them
//! then.

use std::f64::consts::PI;

use glam::{DAffine3, DMat4, DQuat, DVec3};
use oocpt_core::scene::{InstancerMotion, MeshDesc, MeshPlacement, MeshPlacements, PointsMotion, PointsSample};
use oocpt_core::{ElementType, InstancerDesc, PartitionOptions, SceneDb, Snapshot, TransformSample, TypedArray};

use crate::support::{by, committed, scatter, triangle};

type Map<'a> = dyn Fn(f64) -> DMat4 + 'a;

fn samples(map: &Map<'_>) -> Vec<TransformSample> {
    [0.0, 1.0].map(|time| TransformSample { time, transform: map(time) }).to_vec()
}

/// A triangle placed by `map`, of the prototype of an instancer if there is one.
fn mesh(path: &str, instancer: Option<&str>, map: &Map<'_>) -> MeshDesc {
    let mut mesh = triangle(path, 0.5);
    mesh.prim.instanced_by = instancer.map(|instancer| by(instancer, path)).into_iter().collect();
    mesh.prim.transform = map(0.5);
    if map(0.0) != map(1.0) {
        mesh.prim.motion = samples(map);
    }
    mesh
}

fn turned(angle: f64) -> DMat4 {
    DMat4::from_axis_angle(DVec3::new(0.3, 1.0, -0.4).normalize(), angle)
}

fn at(x: f64, y: f64, z: f64) -> DMat4 {
    DMat4::from_translation(DVec3::new(x, y, z))
}

/// Instances with velocities, seconds as parts of the shutter.
fn flying(path: &str, places: &[[f32; 3]], speeds: &[[f32; 3]]) -> InstancerDesc {
    let numbers: Vec<i32> = (0..).take(places.len()).collect();
    let root = format!("{path}/p");
    InstancerDesc {
        motion: InstancerMotion {
            velocities: Some(TypedArray::of(speeds.to_vec())),
            seconds: [0.0, 1.0],
            ..InstancerMotion::default()
        },
        ..scatter(path, places, &[(&root, &numbers)])
    }
}

fn all(snapshot: &Snapshot) -> MeshPlacements {
    snapshot.mesh_placements(&|_| true, 1000)
}

/// Checks that a placement is at `known` at every time, and that all bounds contain it.
fn check(what: &str, snapshot: &Snapshot, placement: &MeshPlacement, known: &Map<'_>) {
    let mesh = &snapshot.meshes[placement.mesh as usize];
    let [low, high] = [mesh.bounds.min, mesh.bounds.max].map(|corner| corner.map(f64::from));
    let (min, max) = placement.swept(low, high);
    let (min, max) = (DVec3::from_array(min), DVec3::from_array(max));
    let (determinant, size) = placement.extent();
    let (mut least, mut most, mut around) = (f64::INFINITY, 0.0_f64, (DVec3::INFINITY, DVec3::NEG_INFINITY));
    for step in 0..=1000 {
        let time = f64::from(step) / 1000.0;
        let map = placement.world_at(time);
        let right = DAffine3::from_translation(-snapshot.origin) * DAffine3::from_mat4(known(time));
        assert!(map.abs_diff_eq(right, 2e-6), "{what} at {time}: {map:?} is not {right:?}");
        for corner in 0..8_usize {
            let side = |k: usize| if corner >> k & 1 == 1 { high[k] } else { low[k] };
            let p = map.transform_point3(DVec3::new(side(0), side(1), side(2)));
            around = (around.0.min(p), around.1.max(p));
        }
        least = least.min(map.matrix3.determinant().abs());
        for axis in [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis] {
            most = most.max(axis.length());
        }
    }
    assert!(min.cmple(around.0).all() && max.cmpge(around.1).all(), "{what}: {min} {max} for {around:?}");
    assert!(determinant <= least * (1.0 + 1e-9) && determinant > 0.0, "{what}: {determinant} for {least}");
    assert!(size >= most * (1.0 - 1e-9) && size < 30.0 * most, "{what}: {size} for {most}");
}

/// Checks that a normal is within half the turn of its direction at one of the times.
fn check_normals(what: &str, placement: &MeshPlacement, bounded: bool) {
    let (times, turn) = placement.motion.times();
    assert!(times.first() == Some(&0.0) && times.last() == Some(&1.0) && times.is_sorted(), "{what}: {times:?}");
    assert_eq!(turn < PI, bounded, "{what}: a turn of {turn}");
    assert!(!bounded || turn < 0.11, "{what}: {turn}");
    for inside in [DVec3::X, DVec3::Z, DVec3::new(0.5, -0.3, 0.8)] {
        let normal = |time: f64| (placement.world_at(time).matrix3.inverse().transpose() * inside).normalize();
        let known: Vec<DVec3> = times.iter().map(|time| normal(*time)).collect();
        for step in 0..=1000 {
            let own = normal(f64::from(step) / 1000.0);
            let off = known.iter().map(|known| known.angle_between(own)).fold(f64::INFINITY, f64::min);
            assert!(off <= 0.5 * turn + 1e-6, "{what}: {off} away, with a turn of {turn}");
        }
    }
}

#[test]
fn a_moving_mesh_follows_its_samples() {
    let flat = DMat4::from_rotation_x(1.0);
    let ways: [(&str, bool, &Map<'_>); 6] = [
        ("goes", true, &|time| at(5.0 * time, 1.0, 0.0) * flat),
        ("turns", true, &|time| at(3.0, 1.0, time) * turned(2.0 * time) * DMat4::from_scale(DVec3::new(1.0, 2.0, 0.3))),
        ("grows evenly", true, &|time| turned(time) * DMat4::from_scale(DVec3::splat(0.1 + 3.0 * time))),
        ("grows", false, &|time| turned(time) * DMat4::from_scale(DVec3::new(0.1 + 3.0 * time, 1.0, 1.0))),
        ("is mirrored", true, &|time| turned(1.5 * time) * DMat4::from_scale(DVec3::new(-1.0, 1.0, 0.2))),
        ("rests", true, &|_| at(1.0, 2.0, 3.0) * flat),
    ];
    for (what, is_bounded, map) in ways {
        let mut db = SceneDb::new();
        db.upsert_mesh(mesh("/mesh", None, map));
        let snapshot = committed(&mut db);
        let MeshPlacements { all, is_complete, leaves_out_deforming } = all(&snapshot);
        assert!(is_complete && !leaves_out_deforming && all.len() == 1, "{what}: {all:?}");
        assert_eq!(all[0].motion.levels.len(), usize::from(what != "rests"), "{what}: one motion is one level");
        check(what, &snapshot, &all[0], map);
        check_normals(what, &all[0], is_bounded);
    }
}

#[test]
fn nested_motion_composes_exactly() {
    let hub = |time: f64| at(1.0, 0.0, -1.0) * turned(2.0 * time);
    let own = |time: f64| at(0.2, 0.0, 0.0) * DMat4::from_rotation_z(1.5 * time);
    let still = |_: f64| at(0.2, 0.0, 0.1) * DMat4::from_rotation_z(0.5);
    let places = [[1.0_f32, 2.0, 0.0], [-4.0, 0.5, 1.0]];
    let speeds = [[2.0_f32, 0.0, 0.0], [0.0, -1.0, 3.0]];
    let ways: [(&str, &Map<'_>); 2] = [("itself too", &own), ("at rest there", &still)];
    for (what, inside) in ways {
        let mut db = SceneDb::new();
        let mut row = flying("/i", &places, &speeds);
        row.prim.transform = hub(0.5);
        row.prim.motion = samples(&hub);
        db.upsert_instancer(row);
        db.upsert_mesh(mesh("/i/p", Some("/i"), inside));
        let snapshot = committed(&mut db);
        let placements = all(&snapshot).all;
        assert_eq!(placements.len(), 2, "{what}");
        for placement in &placements {
            let lamp = usize::try_from(placement.instance_id).expect("small");
            let place = |time: f64| {
                let [at, way] = [places[lamp], speeds[lamp]].map(|p| DVec3::from(p.map(f64::from)));
                hub(time) * DMat4::from_translation(at + way * time) * inside(time)
            };
            check(what, &snapshot, placement, &place);
            check_normals(what, placement, true);
        }
        let first = |placement: &MeshPlacement| placement.motion.levels[0].clone();
        assert!(std::sync::Arc::ptr_eq(&first(&placements[0]), &first(&placements[1])), "{what}: there once");
    }
}

/// A frame at rest that stretches a rotating frame inside is a level of its own, and the turn of normals in it is
/// unknown.
#[test]
fn rotation_inside_a_nonuniform_scale_is_exact() {
    let mut outer = scatter("/outer", &[[3.0, 0.0, 1.0]], &[("/outer/hub", &[0])]);
    outer.rotations = Some(TypedArray::from_vec(ElementType::Quatf, vec![[0.0_f32, 0.0, 0.6, 0.8]]).unwrap());
    outer.scales = Some(TypedArray::of(vec![[2.0_f32, 0.5, 1.0]]));
    let place = DMat4::from_scale_rotation_translation(
        DVec3::new(2.0, 0.5, 1.0),
        DQuat::from_xyzw(0.0, 0.0, f64::from(0.6_f32), f64::from(0.8_f32)).normalize(),
        DVec3::new(3.0, 0.0, 1.0),
    );
    let hub = |time: f64| turned(2.0 * time);
    let own = |_: f64| at(1.0, 0.0, 0.0);
    let mut db = SceneDb::new();
    db.upsert_instancer(outer);
    let mut inner = scatter("/outer/hub", &[[0.0, 1.0, 0.0]], &[("/outer/hub/p", &[0])]);
    inner.prim.instanced_by = vec![by("/outer", "/outer/hub")];
    inner.prim.transform = hub(0.5);
    inner.prim.motion = samples(&hub);
    db.upsert_instancer(inner);
    db.upsert_mesh(mesh("/outer/hub/p", Some("/outer/hub"), &own));
    let snapshot = committed(&mut db);
    let placements = all(&snapshot).all;
    assert_eq!(placements.len(), 1);
    check("nested", &snapshot, &placements[0], &|time| place * hub(time) * at(0.0, 1.0, 0.0) * own(time));
    check_normals("nested", &placements[0], false);
}

#[test]
fn bounds_widen_by_the_rounding_error_at_their_distance() {
    let reach = |map: &Map<'_>| {
        let mut db = SceneDb::new();
        db.upsert_mesh(mesh("/mesh", None, map));
        // The origin of the snapshot is the middle of the scene.
        db.upsert_mesh(MeshDesc { prim_id: 8, ..mesh("/other", None, &|_| at(-1000.0, 0.0, 0.0)) });
        db.set_partition(PartitionOptions { chunk_bytes: 16 << 20 });
        let snapshot = committed(&mut db);
        snapshot.mesh_placements(&|id| id == 7, 9).all.first().expect("it is placed").reach
    };
    let still = reach(&|_| at(1000.0, 0.0, 0.0));
    let goes = reach(&|time| at(1000.0 + time, 0.0, 0.0));
    let far = reach(&|time| at(1000.0 + 4000.0 * time, 0.0, 0.0));
    assert!(goes > 2.0 * still && goes < 8.0 * still, "{goes} for {still}");
    assert!(far > 1.8 * goes, "{far} for {goes}: the farthest counts");
}

#[test]
fn deforming_or_excess_mesh_lights_are_omitted_with_a_warning() {
    let mut db = SceneDb::new();
    let mut deforms = mesh("/mesh", None, &|_| DMat4::IDENTITY);
    let points = |x: f32| TypedArray::of(vec![[x, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, x]]);
    let sample = |time: f64, x: f32| PointsSample { time, points: points(x), normals: None, widths: None };
    deforms.point_motion =
        PointsMotion { samples: vec![sample(0.0, 0.0), sample(1.0, 0.5)], ..PointsMotion::default() };
    db.upsert_mesh(deforms);
    db.upsert_instancer(flying("/i", &[[0.0; 3]; 5], &[[1.0, 0.0, 0.0]; 5]));
    db.upsert_mesh(mesh("/i/p", Some("/i"), &|_| DMat4::IDENTITY));
    let snapshot = committed(&mut db);
    let found = all(&snapshot);
    assert_eq!((found.all.len(), found.is_complete, found.leaves_out_deforming), (5, true, true));
    let few = snapshot.mesh_placements(&|_| true, 3);
    assert!(few.all.len() <= 3 && !few.is_complete, "{few:?}");
}
