// SPDX-License-Identifier: Apache-2.0
//! Dicing of surfaces in a scene: by their nearest placement, through any chain of instancers.

use glam::{DMat4, DVec3, DVec4};
use oocpt_core::camera::Camera;
use oocpt_core::scene::DicingCamera;
use oocpt_core::{
    InstancedBy, InstancerDesc, InstancerPrototype, MeshDesc, PrimDesc, SceneDb, Snapshot, Subdivision, TypedArray,
};
use std::sync::Arc;

use crate::support::asset;

/// A camera at `position` that looks along -z, 90 degrees wide, 200 pixels.
fn camera(position: DVec3) -> DicingCamera {
    camera_with(DMat4::from_translation(position), 1.0, 200)
}

/// A camera that sees half as much at a `zoom` of 2, in so many pixels.
pub(super) fn camera_with(world_from_view: DMat4, zoom: f64, pixels: u16) -> DicingCamera {
    let [x, y] = [DVec4::X * zoom, DVec4::Y * zoom];
    let projection = DMat4::from_cols(x, y, DVec4::new(0.0, 0.0, -1.0, -1.0), DVec4::Z * -0.2);
    let camera = Camera {
        world_from_view,
        projection,
        display_window: [0.0, 0.0, f32::from(pixels), f32::from(pixels)],
        data_window: [0, 0, i32::from(pixels), i32::from(pixels)],
        lens_radius: 0.0,
        focus_distance: 1.0,
        clip_planes: Vec::new(),
        motion: Vec::new(),
        exposure_scale: 1.0,
    };
    DicingCamera::new(&camera, 2.0)
}

/// A cube from -1 to 1 at `place`.
fn cube(path: &str, place: DVec3) -> MeshDesc {
    let coordinate = |k: usize, bit: usize| if k >> bit & 1 == 1 { 1.0_f32 } else { -1.0 };
    let points: Vec<[f32; 3]> = (0..8).map(|k| [coordinate(k, 0), coordinate(k, 1), coordinate(k, 2)]).collect();
    let corners = vec![0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
    MeshDesc {
        prim: PrimDesc { path: path.into(), transform: DMat4::from_translation(place), ..PrimDesc::default() },
        subdivision: Subdivision::CatmullClark,
        face_vertex_counts: TypedArray::of(vec![4_i32; 6]),
        face_vertex_indices: TypedArray::of::<i32>(corners),
        points: TypedArray::of(points),
        ..MeshDesc::default()
    }
}

fn commit(db: &mut SceneDb, position: DVec3) -> Arc<Snapshot> {
    db.set_dicing(camera(position));
    db.commit().snapshot
}

/// Triangles of all unique meshes, smallest first.
fn triangles(snapshot: &Snapshot) -> Vec<u64> {
    let mut counts: Vec<u64> = snapshot.meshes.iter().map(|mesh| mesh.triangles).collect();
    counts.sort_unstable();
    counts
}

fn at(z: f64) -> DVec3 {
    DVec3::new(0.0, 0.0, z)
}

/// Returns true if this count of triangles fits the rate: 200 pixels for 2 units at distance 1, so edges of 2 units at
/// `distance` have `200 / distance` pixels, and rounding up is by a factor of less than the root of two.
fn is_fine_enough(count: u64, distance: f64) -> bool {
    let pieces = 200.0 / distance / 2.0;
    let least = 12.0 * pieces * pieces;
    (least..least * 6.0 + 12.0).contains(&(count as f64))
}

#[test]
fn nearer_surfaces_are_diced_more_finely() {
    let mut db = SceneDb::new();
    db.upsert_mesh(cube("/a", at(-20.0)));
    let far = triangles(&commit(&mut db, at(60.0)));
    let near = triangles(&commit(&mut db, at(0.0)));
    assert!(is_fine_enough(near[0], 18.3), "{near:?} triangles at distance 20");
    assert!(far[0] < near[0] / 4, "{far:?} triangles at distance 80");
    let inside = triangles(&commit(&mut db, at(-20.0)));
    assert!(inside[0] > near[0] && inside[0] <= 12 * 256 * 256, "{inside:?} from inside");
    let behind = triangles(&commit(&mut db, at(-40.0)));
    assert!(behind[0] <= near[0] / 8, "{behind:?} triangles out of the picture");
}

#[test]
fn a_small_step_of_the_camera_changes_nothing() {
    let mut db = SceneDb::new();
    db.upsert_mesh(cube("/a", at(-20.0)));
    let first = commit(&mut db, at(0.0));
    let second = commit(&mut db, at(0.05));
    assert!(Arc::ptr_eq(&first.meshes[0], &second.meshes[0]), "the same mesh");
    let third = commit(&mut db, at(-10.0));
    assert!(!Arc::ptr_eq(&first.meshes[0], &third.meshes[0]), "half the way makes another one");
    let back = commit(&mut db, at(0.0));
    assert_eq!(
        asset(&first.meshes[0]).triangles,
        asset(&back.meshes[0]).triangles,
        "a function of the camera, not of the past"
    );
}

#[test]
fn prims_with_equal_content_share_one_diced_mesh() {
    let mut db = SceneDb::new();
    db.upsert_mesh(cube("/a", at(-5.0)));
    db.upsert_mesh(cube("/b", at(-500.0)));
    let both = triangles(&commit(&mut db, at(0.0)));
    assert_eq!(both.len(), 1, "one mesh");
    db.remove("/b");
    assert_eq!(triangles(&commit(&mut db, at(0.0))), both, "cut for the nearer one");
}

/// `/i` has instances at `places` with the scale `scale`; each is the cube.
pub(super) fn instancer(
    path: &str,
    root: &str,
    places: &[[f32; 3]],
    scale: f32,
    by: Vec<InstancedBy>,
) -> InstancerDesc {
    let indices: Vec<i32> = (0..i32::try_from(places.len()).expect("few")).collect();
    InstancerDesc {
        prim: PrimDesc { path: path.into(), instanced_by: by, ..PrimDesc::default() },
        prototypes: vec![InstancerPrototype { root: root.into(), indices: TypedArray::of(indices) }],
        translations: Some(TypedArray::of(places.to_vec())),
        scales: Some(TypedArray::of(vec![[scale; 3]; places.len()])),
        ..InstancerDesc::default()
    }
}

pub(super) fn by(instancer: &str, root: &str) -> Vec<InstancedBy> {
    vec![InstancedBy { instancer: instancer.into(), prototype_root: root.into() }]
}

fn instanced(places: &[[f32; 3]], scale: f32) -> u64 {
    let mut db = SceneDb::new();
    let mesh = cube("/i/p/m", DVec3::ZERO);
    db.upsert_mesh(MeshDesc { prim: PrimDesc { instanced_by: by("/i", "/i/p"), ..mesh.prim }, ..mesh });
    db.upsert_instancer(instancer("/i", "/i/p", places, scale, Vec::new()));
    triangles(&commit(&mut db, at(0.0)))[0]
}

#[test]
fn the_nearest_instance_sets_the_dicing_rate() {
    let far: Vec<[f32; 3]> = (0..50_u8).map(|k| [f32::from(k) - 25.0, 0.0, -400.0]).collect();
    let with = |place: [f32; 3]| [far.as_slice(), &[place]].concat();
    let alone = instanced(&[[0.0, 0.0, -20.0]], 1.0);
    assert!(is_fine_enough(alone, 18.3), "{alone} triangles of one at distance 20");
    assert_eq!(instanced(&with([0.0, 0.0, -20.0]), 1.0), alone, "others that are farther change nothing");
    assert!(instanced(&far, 1.0) < alone / 50, "without it");
    assert!(instanced(&far, 20.0) >= alone, "twenty times as large at twenty times the distance");
    let near = instanced(&with([0.0, 0.0, -3.0]), 1.0);
    assert!(near > alone * 8, "{near} triangles of one that is near");
}

/// Instances in instances: the same placements, multiplied out or not, are cut alike within a factor.
#[test]
fn dicing_finds_nested_instances() {
    let nested = |outer: &[[f32; 3]], inner: &[[f32; 3]]| {
        let mut db = SceneDb::new();
        let mesh = cube("/o/q/i/p/m", DVec3::ZERO);
        let inside = "/o/q/i";
        db.upsert_mesh(MeshDesc { prim: PrimDesc { instanced_by: by(inside, "/o/q/i/p"), ..mesh.prim }, ..mesh });
        db.upsert_instancer(instancer(inside, "/o/q/i/p", inner, 1.0, by("/o", "/o/q")));
        db.upsert_instancer(instancer("/o", "/o/q", outer, 1.0, Vec::new()));
        triangles(&commit(&mut db, at(0.0)))[0]
    };
    // Four rows of cubes, wide enough for the camera to be within the size of the nearest row.
    let row: Vec<[f32; 3]> = (0..40_u8).map(|k| [4.0 * f32::from(k) - 80.0, 0.0, 0.0]).collect();
    let places = [-20.0_f32, -60.0, -300.0, -900.0].map(|z| [0.0, 0.0, z]);
    let all: Vec<[f32; 3]> = places.iter().flat_map(|p| row.iter().map(|r| [r[0], 0.0, p[2]])).collect();
    assert_eq!(nested(&places, &row), instanced(&all, 1.0), "gone into");
    let far = places.map(|[x, y, z]| [x, y, z - 3000.0]);
    let all: Vec<[f32; 3]> = far.iter().flat_map(|p| row.iter().map(|r| [r[0], 0.0, p[2]])).collect();
    let (whole, each) = (nested(&far, &row), instanced(&all, 1.0));
    assert!(whole >= each && whole <= each * 4, "{whole} triangles as a whole, {each} one by one");
}

#[test]
fn rate_zero_leaves_the_cage() {
    let mut db = SceneDb::new();
    db.upsert_mesh(cube("/a", at(-5.0)));
    assert_eq!(triangles(&db.commit().snapshot), [12], "no camera was given");
    db.upsert_mesh(MeshDesc { refine_level: 1, ..cube("/a", at(-5.0)) });
    assert_eq!(triangles(&db.commit().snapshot), [48], "a refine level");
    db.set_dicing(DicingCamera::default());
    assert!(!db.commit().changed, "a camera that cuts nothing is none");
}

#[test]
fn dicing_ends_on_recursive_prototypes() {
    let mut db = SceneDb::new();
    let mesh = cube("/i/p/m", DVec3::ZERO);
    db.upsert_mesh(MeshDesc { prim: PrimDesc { instanced_by: by("/i", "/i/p"), ..mesh.prim }, ..mesh });
    db.upsert_instancer(instancer("/i", "/i/p", &[[0.0, 0.0, -5.0]], 1.0, by("/i/p/j", "/j")));
    db.upsert_instancer(instancer("/i/p/j", "/j", &[[0.0, 0.0, -5.0]], 1.0, by("/i", "/i/p")));
    assert_eq!(commit(&mut db, at(0.0)).meshes.len(), 0, "a cycle shows nothing, and takes no time");
}

/// Commits as a live view sees the scene; gives how many meshes were built for it.
pub(super) fn look(db: &mut SceneDb, camera: DicingCamera) -> u64 {
    let before = db.meshes_made();
    db.set_dicing(camera.live(true));
    db.commit();
    db.meshes_made() - before
}

/// A bumpy terrain of 32 x 32 faces, 64 units wide, around the origin; up is y.
fn terrain() -> MeshDesc {
    let side = 33_u8;
    let at = |k: u8| 2.0 * f32::from(k) - 32.0;
    let height = |x: u8, z: u8| if (x + z).is_multiple_of(3) { 0.5 } else { 0.0 };
    let points: Vec<[f32; 3]> = (0..side).flat_map(|z| (0..side).map(move |x| [at(x), height(x, z), at(z)])).collect();
    let corner = |x: u8, z: u8| i32::from(z) * i32::from(side) + i32::from(x);
    let faces = (0..side - 1).flat_map(|z| (0..side - 1).map(move |x| (x, z)));
    let corners: Vec<i32> =
        faces.flat_map(|(x, z)| [corner(x, z), corner(x, z + 1), corner(x + 1, z + 1), corner(x + 1, z)]).collect();
    MeshDesc {
        face_vertex_counts: TypedArray::of(vec![4_i32; corners.len() / 4]),
        face_vertex_indices: TypedArray::of::<i32>(corners),
        points: TypedArray::of(points),
        ..cube("/terrain", DVec3::ZERO)
    }
}

#[test]
fn a_zoom_in_a_live_view_rebuilds_at_octaves() {
    for place in [at(-20.0), at(-3.0)] {
        let mut db = SceneDb::new();
        db.upsert_mesh(cube("/a", place));
        let zoom = |step: i32| camera_with(DMat4::IDENTITY, 1.05_f64.powi(step), 200);
        assert_eq!(look(&mut db, zoom(0)), 1, "the first view");
        let there: u64 = (1..=45).map(|step| look(&mut db, zoom(step))).sum();
        assert!(there <= 4, "{there} meshes built while a zoom of 9 went in, at {place}");
        let back: u64 = (0..45).rev().map(|step| look(&mut db, zoom(step))).sum();
        assert!(back <= 2, "{back} built on the way back, at {place}");
        let here_and_there: u64 = (0..40).map(|step| look(&mut db, zoom(step % 7))).sum();
        assert!(here_and_there <= 1, "{here_and_there} built while it went back and forth, at {place}");
        let resized: u64 = (0..20).map(|step| look(&mut db, camera_with(DMat4::IDENTITY, 1.0, 200 + 5 * step))).sum();
        assert!(resized <= 1, "{resized} built for other widths, at {place}");
    }
}

#[test]
fn a_walk_in_a_live_view_rebuilds_when_it_has_come_far() {
    let mut db = SceneDb::new();
    db.upsert_mesh(terrain());
    let step =
        |step: i32| camera_with(DMat4::from_translation(DVec3::new(0.0, 2.0, 20.0 - 0.1 * f64::from(step))), 1.0, 200);
    assert_eq!(look(&mut db, step(0)), 1, "the first view");
    let built: u64 = (1..=200).map(|k| look(&mut db, step(k))).sum();
    // 20 units, where what is nearer than 1 counts as that far away.
    assert!((1..=16).contains(&built), "{built} built on 200 steps of a walk");
    let turned = |k: i32| {
        let turn = DMat4::from_rotation_y(0.1 * f64::from(k));
        camera_with(DMat4::from_translation(DVec3::new(0.0, 2.0, 0.0)) * turn, 1.0, 200)
    };
    look(&mut db, turned(0));
    let built: u64 = (1..63).map(|k| look(&mut db, turned(k))).sum();
    assert_eq!(built, 0, "looking around builds nothing");
}

#[test]
fn what_leaves_the_picture_of_a_live_view_stays_as_it_is() {
    let mut db = SceneDb::new();
    db.upsert_mesh(cube("/a", at(-20.0)));
    let turned = |k: i32| camera_with(DMat4::from_rotation_y(0.2 * f64::from(k)), 1.0, 200);
    assert_eq!(look(&mut db, turned(16)), 1, "out of the picture");
    assert_eq!(look(&mut db, turned(0)), 1, "it comes in");
    let built: u64 = (1..100).map(|k| look(&mut db, turned(k))).sum();
    assert_eq!(built, 0, "going out and coming in again");
}

/// Edges of the surfaces in a live view are as fine as in a final one, or finer by a bounded factor, wherever the
/// camera came from.
#[test]
fn a_live_view_cuts_as_finely_as_a_final_one() {
    let mut live = SceneDb::new();
    live.upsert_mesh(cube("/a", at(-20.0)));
    let places = [60.0, 30.0, 0.0, -10.0, -15.0, -10.0, 0.0, 30.0, 90.0, 300.0].map(at);
    for place in places {
        look(&mut live, camera(place));
        let live = triangles(&live.commit().snapshot)[0];
        let mut exact = SceneDb::new();
        exact.upsert_mesh(cube("/a", at(-20.0)));
        let exact = triangles(&commit(&mut exact, place))[0];
        // Final rates are rounded up by less than the root of two in each direction.
        assert!(live * 2 >= exact, "{live} triangles, {exact} in a final picture, at {place}");
        assert!(live <= exact * 16 + 12, "{live} triangles, {exact} in a final picture, at {place}");
    }
}

#[test]
fn a_final_picture_after_a_live_view_has_its_own_rates() {
    let mut db = SceneDb::new();
    db.upsert_mesh(cube("/a", at(-20.0)));
    for place in [at(-10.0), at(-2.0), at(0.0)] {
        look(&mut db, camera(place));
    }
    let mut other = SceneDb::new();
    other.upsert_mesh(cube("/a", at(-20.0)));
    let (after, alone) = (commit(&mut db, at(0.0)), commit(&mut other, at(0.0)));
    assert_eq!(asset(&after.meshes[0]).triangles, asset(&alone.meshes[0]).triangles, "the same mesh");
}
