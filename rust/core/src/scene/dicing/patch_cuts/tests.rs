// SPDX-License-Identifier: Apache-2.0
//! The rates of a terrain that is cut in patches, measured in the picture; and how many patches a step of the camera
//! changes. Nothing is refined here.

use glam::{DMat4, DVec3, DVec4, Vec4Swizzles as _};
use xxhash_rust::xxh3::Xxh3;

use super::*;
use crate::array::TypedArray;
use crate::camera::Camera;
use crate::desc::{MeshDesc, Subdivision};
use crate::material::{Displacement, InputValue, PreviewDisplacement};
use crate::mesh::MeshPatch;

const SIZE: [f64; 2] = [1280.0, 720.0];
/// Pixels of a unit of length at distance 1.
const FOCAL: f64 = 1152.0;

fn projection() -> DMat4 {
    let [x, y] = SIZE.map(|size| 2.0 * FOCAL / size);
    DMat4::from_cols(DVec4::X * x, DVec4::Y * y, DVec4::new(0.0, 0.0, -1.0, -1.0), DVec4::Z * -0.2)
}

/// A camera of 1280 x 720 pixels that looks along -z, turned about y by `turn`.
fn camera(place: DVec3, turn: f64) -> (DicingCamera, DMat4) {
    zoomed(place, turn, 1.0)
}

fn zoomed(place: DVec3, turn: f64, zoom: f64) -> (DicingCamera, DMat4) {
    let world_from_view = DMat4::from_translation(place) * DMat4::from_rotation_y(turn);
    let projection = DMat4::from_scale(DVec3::new(zoom, zoom, 1.0)) * projection();
    let camera = Camera {
        world_from_view,
        projection,
        display_window: [0.0, 0.0, 1280.0, 720.0],
        data_window: [0, 0, 1280, 720],
        lens_radius: 0.0,
        focus_distance: 1.0,
        clip_planes: Vec::new(),
        motion: Vec::new(),
        exposure_scale: 1.0,
    };
    (DicingCamera::new(&camera, 2.0), projection * world_from_view.inverse())
}

/// A displaced terrain of `side` squared quads, 1024 units wide, around the origin; up is y.
#[expect(clippy::cast_precision_loss, reason = "small numbers")]
fn terrain(side: i32) -> MeshEntry {
    let points = side + 1;
    let unit = 1024.0 / side as f32;
    let place = |at: i32| {
        let [x, z] = [at % points, at / points].map(|k| k as f32 * unit - 512.0);
        [x, 3.0 * (0.02 * x).sin() * (0.03 * z).cos(), z]
    };
    let quad = |at: i32| {
        let a = at / side * points + at % side;
        [a, a + points, a + points + 1, a + 1]
    };
    let desc = MeshDesc {
        subdivision: Subdivision::CatmullClark,
        face_vertex_counts: TypedArray::of((0..side * side).map(|_| 4).collect::<Vec<i32>>()),
        face_vertex_indices: TypedArray::of::<i32>((0..side * side).flat_map(quad).collect()),
        points: TypedArray::of::<[f32; 3]>((0..points * points).map(place).collect()),
        ..MeshDesc::default()
    };
    let (mut entry, _) = MeshEntry::update(None, desc);
    let amount = InputValue::Constant([0.1; 4]);
    let preview = PreviewDisplacement { amount, texture: None, uv: None, primvar: None };
    entry.ask(Vec::new(), vec![Some(Arc::new(Displacement::Preview(preview)))], false);
    entry
}

/// How the terrain is cut in `camera`, at some places.
fn cut_at(
    entry: &MeshEntry,
    camera: &DicingCamera,
    maps: &[DAffine3],
    kept: Option<&Arc<PatchCuts>>,
) -> Arc<PatchCuts> {
    let mut found = PatchDensities::default();
    for map in maps {
        found.see(camera, entry.patches().expect("patches"), entry.outline().ball.radius, map);
    }
    found.cut(camera, entry, kept).expect("in patches")
}

fn cut(entry: &MeshEntry, camera: &DicingCamera, kept: Option<&Arc<PatchCuts>>) -> Arc<PatchCuts> {
    cut_at(entry, camera, &[DAffine3::IDENTITY], kept)
}

/// Names of the contents of all patches.
fn contents(cuts: &PatchCuts) -> Vec<u128> {
    let content = |patch: MeshPatch| {
        let mut hasher = Xxh3::new();
        patch.hash(&mut hasher);
        hasher.digest128()
    };
    cuts.patches(true).map(content).collect()
}

fn changed(before: &PatchCuts, after: &PatchCuts) -> usize {
    contents(before).iter().zip(contents(after)).filter(|(before, after)| *before != after).count()
}

/// Lengths of the pieces of all edges that are in the picture, sorted: in pixels, and in pixels as they are in the
/// middle of the picture, where all are as large as the angle that they are seen at.
fn pieces_in_picture(entry: &MeshEntry, cuts: &PatchCuts, eye: DVec3, clip_from_world: &DMat4) -> [Vec<f64>; 2] {
    let points = entry.desc.points.view();
    let pixel = |point: i32| {
        let place = points.vec3(usize::try_from(point).ok()?)?;
        let clip = *clip_from_world * place.extend(1.0);
        let seen = clip.xy() / clip.w;
        (clip.w > 0.0 && seen.abs().max_element() <= 1.0).then_some([0.5 * SIZE[0] * seen.x, 0.5 * SIZE[1] * seen.y])
    };
    let place = |point: i32| usize::try_from(point).ok().and_then(|point| points.vec3(point)).expect("a point") - eye;
    let [mut lengths, mut angles] = [Vec::new(), Vec::new()];
    for face in 0..u32::try_from(entry.desc.face_vertex_counts.len()).expect("few") {
        let (corners, edges) = cuts.all.corners(face);
        let ends: Vec<i32> = corners.filter_map(|at| entry.desc.face_vertex_indices.index(at)).collect();
        for (k, edge) in edges.iter().enumerate() {
            if let (Some(a), Some(b)) = (pixel(ends[k]), pixel(ends[(k + 1) % ends.len()])) {
                let pieces = f64::from(cuts.rates[*edge as usize]);
                lengths.push((a[0] - b[0]).hypot(a[1] - b[1]) / pieces);
                angles.push(FOCAL * place(ends[k]).angle_between(place(ends[(k + 1) % ends.len()])) / pieces);
            }
        }
    }
    [lengths, angles].map(|mut all| {
        all.sort_by(f64::total_cmp);
        all
    })
}

/// From its edge, 2 units above the ground.
fn edge_of_terrain() -> DVec3 {
    DVec3::new(100.0, 5.0, 512.0)
}

#[test]
fn a_large_terrain_seen_from_its_edge_gets_what_was_asked() {
    let entry = terrain(512);
    let (view, clip_from_world) = camera(edge_of_terrain(), 0.0);
    let cuts = cut(&entry, &view, None);
    let triangles = cuts.all.expected_triangles(&cuts.rates);
    assert!(!cuts.is_coarse, "{triangles} triangles are too many");
    assert!((1 << 21..1 << 24).contains(&triangles), "{triangles} triangles");
    let [lengths, angles] = pieces_in_picture(&entry, &cuts, edge_of_terrain(), &clip_from_world);
    assert!(lengths.len() > 50_000, "{} edges in the picture", lengths.len());
    let median = lengths[lengths.len() / 2];
    let [long, longest] = [&lengths, &angles].map(|all| all[all.len() - 1]);
    let above = lengths.iter().filter(|length| **length > 2.0).count();
    assert!(longest <= 2.0, "a piece of {longest} pixels");
    // A picture plane stretches what is away from its middle.
    assert!(long <= 2.4 && above * 100 < lengths.len(), "{above} pieces are longer in the picture, up to {long}");
    // Most edges are seen at a flat angle.
    assert!(median >= 0.1, "pieces of {median} pixels are finer than anybody sees");
    // At the border of two patches the larger number counts.
    let surface = CutSurface { all: &cuts.all, entry: &entry, displaces: true, dicing: &cuts.dicing };
    for (patch, edges) in surface.patches().collect::<Vec<(usize, EdgeRates<'_>)>>() {
        let wanted = cuts.all.own_edges(&entry.desc, patch, |a, b| small(edges.pieces(a, b)));
        let own = cuts.all.rates_at(patch, 0, &cuts.rates);
        assert!(own.iter().zip(wanted).all(|(own, wanted)| *own >= wanted), "patch {patch} has less than it needs");
    }
    // Cut by the place of the camera alone, as a whole, it would be too large.
    let mut whole = SurfaceDensity::default();
    let ball = entry.outline().ball;
    whole.see(&view, &ball, ball.radius, &DAffine3::IDENTITY);
    let dicing = whole.dicing(&view);
    let edges = EdgeRates::new(&entry.desc, &dicing, true);
    let as_one: Vec<Vec<u16>> = (0..cuts.all.patches.len())
        .map(|patch| cuts.all.own_edges(&entry.desc, patch, |a, b| small(edges.pieces(a, b))))
        .collect();
    let as_one = cuts.all.expected_triangles(&cuts.all.rates(&as_one));
    assert!(as_one > MAX_REFINED_TRIANGLES && as_one > triangles, "{as_one} triangles as a whole");
}

#[test]
fn a_walk_refines_what_comes_near_and_nothing_else() {
    let entry = terrain(256);
    let place = |step: i32| DVec3::new(90.0, 8.0, 500.0 - 8.0 * f64::from(step));
    let view = |step: i32| camera(place(step), 0.0).0.live(true);
    let mut cuts = cut(&entry, &view(0), None);
    let patches = cuts.all.patches.len();
    let (mut all, mut most, mut far) = (0, 0, 0);
    for step in 1..=125 {
        let next = cut(&entry, &view(step), Some(&cuts));
        let (before, after) = (contents(&cuts), contents(&next));
        let new: Vec<usize> = (0..patches).filter(|at| before[*at] != after[*at]).collect();
        // A patch and those beside it are some 130 units wide.
        let distance = |at: &usize| BoundingSphere::of(&cuts.all.patches[*at].bounds).center.distance(place(step));
        far += new.iter().filter(|at| distance(at) > 400.0).count();
        most = most.max(new.len());
        all += new.len();
        cuts = next;
    }
    assert!(all > patches, "{all} of {patches} patches refined again on a kilometre");
    assert!(all < 20 * patches, "{all} of {patches} patches refined again in 125 steps");
    assert!(most <= patches / 2, "{most} of {patches} patches refined again in one step");
    let triangles = cuts.all.expected_triangles(&cuts.rates);
    assert!(triangles < patches as u64 * MAX_LIVE_PATCH, "{triangles} triangles in {patches} patches");
    assert!(far * 3 < all, "{far} of {all} are far away");
}

#[test]
fn looking_around_and_a_zoom_and_back_refine_nothing_twice() {
    let entry = terrain(256);
    let place = DVec3::new(0.0, 8.0, 0.0);
    let turned = |step: i32| camera(place, 0.1 * f64::from(step)).0.live(true);
    let mut cuts = cut(&entry, &turned(0), None);
    let mut look = |view: &DicingCamera| {
        let next = cut(&entry, view, Some(&cuts));
        let new = changed(&cuts, &next);
        cuts = next;
        new
    };
    let once: usize = (1..63).map(|step| look(&turned(step))).sum();
    let again: usize = (0..63).map(|step| look(&turned(step))).sum();
    assert!(once > 0, "what comes into the picture is refined");
    assert_eq!(again, 0, "patches refined in the second turn");
    let zoom = |step: i32| zoomed(place, 0.0, 1.05_f64.powi(step)).0.live(true);
    let there: usize = (0..20).map(|step| look(&zoom(step))).sum();
    let back: usize = (0..20).rev().map(|step| look(&zoom(step))).sum();
    assert!(there > 0, "a zoom refines");
    assert!(back <= there, "{back} patches on the way back of a zoom, {there} on the way there");
    let here_and_there: usize = (0..20).map(|step| look(&zoom(step % 4))).sum();
    assert_eq!(here_and_there, 0, "a zoom back and forth");
}

#[test]
fn a_final_view_is_a_function_of_scene_and_camera() {
    let entry = terrain(256);
    let (view, _) = camera(edge_of_terrain(), 0.0);
    let live = cut(&entry, &camera(DVec3::new(0.0, 8.0, 0.0), 1.0).0.live(true), None);
    let alone = cut(&entry, &view, None);
    assert_eq!(changed(&alone, &cut(&entry, &view, Some(&live))), 0, "after another view");
    assert_eq!(changed(&alone, &cut(&entry, &camera(edge_of_terrain(), 0.0).0, None)), 0, "again");
    let turned = changed(&alone, &cut(&entry, &camera(edge_of_terrain(), 0.01).0, None));
    assert!((1..alone.all.patches.len() / 2).contains(&turned), "{turned} patches are at the sides of the picture");
}

#[test]
fn the_nearest_placement_decides_for_each_patch() {
    let entry = terrain(64);
    let (view, _) = camera(DVec3::new(0.0, 20.0, 0.0), 0.0);
    let there = [DVec3::ZERO, DVec3::new(300.0, 0.0, -300.0)].map(DAffine3::from_translation);
    let each = there.map(|map| cut_at(&entry, &view, &[map], None));
    let both = cut_at(&entry, &view, &there, None);
    let largest = each[0].rates.iter().zip(&each[1].rates).map(|(a, b)| *a.max(b));
    assert!(both.rates.iter().copied().eq(largest), "an edge has what its nearest placement needs");
}
