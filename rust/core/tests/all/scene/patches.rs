// SPDX-License-Identifier: Apache-2.0
//! Large surfaces near the camera, which are refined patch by patch: seen as one mesh, without a crack, and refined
//! again only where rates change.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use glam::{DMat4, DVec3, Vec3};
use oocpt_core::{Interpolation, MeshDesc, PrimDesc, SceneDb, Snapshot, Subdivision, TypedArray};

use super::dicing::{by, camera_with, instancer, look};
use crate::mesh::displace::{Files, st, textured};
use crate::support::asset;

/// Faces along a side of the terrain; each is two units wide.
const SIDE: i16 = 80;
const PATCHES: u64 = 7;

/// A bumpy terrain around the origin; up is y.
fn terrain(subdivision: Subdivision) -> MeshDesc {
    let side = SIDE + 1;
    let at = |k: i16| 2.0 * f32::from(k) - f32::from(SIDE);
    let height = |x: i16, z: i16| if (x + z) % 3 == 0 { 0.5 } else { 0.0 };
    let points: Vec<[f32; 3]> = (0..side).flat_map(|z| (0..side).map(move |x| [at(x), height(x, z), at(z)])).collect();
    let corner = |x: i16, z: i16| i32::from(z) * i32::from(side) + i32::from(x);
    let faces = (0..SIDE).flat_map(|z| (0..SIDE).map(move |x| (x, z)));
    let corners: Vec<i32> =
        faces.flat_map(|(x, z)| [corner(x, z), corner(x, z + 1), corner(x + 1, z + 1), corner(x + 1, z)]).collect();
    // Two islands of coordinates, so that levels of textures differ where they meet.
    let uv = |&corner: &i32| {
        let [x, _, z] = points[usize::try_from(corner).expect("a point")];
        if x < 0.0 { [x / 8.0, z / 8.0] } else { [x / 64.0, z / 64.0] }
    };
    MeshDesc {
        prim: PrimDesc { path: "/terrain".into(), ..PrimDesc::default() },
        subdivision,
        face_vertex_counts: TypedArray::of(vec![4_i32; corners.len() / 4]),
        primvars: st(Interpolation::FaceVarying, corners.iter().map(uv).collect()),
        face_vertex_indices: TypedArray::of::<i32>(corners),
        points: TypedArray::of(points),
        ..MeshDesc::default()
    }
}

fn view(place: DVec3, turn: f64) -> oocpt_core::scene::DicingCamera {
    camera_with(DMat4::from_translation(place) * DMat4::from_rotation_y(turn), 1.0, 600)
}

fn near() -> DVec3 {
    DVec3::new(5.0, 3.0, 70.0)
}

/// Open edges that are not at the border of the terrain; and normals that differ at one place.
fn cracks(snapshot: &Snapshot) -> (usize, usize) {
    let bits = |v: [f32; 3]| v.map(|v| (v + 0.0).to_bits());
    let (mut edges, mut normals) = (BTreeMap::new(), BTreeMap::new());
    let mut bent = 0;
    for mesh in &snapshot.meshes {
        let mesh = asset(mesh);
        let known = mesh.normals.as_ref().expect("normals");
        for (triangle, corners) in mesh.triangles.iter().zip(&mesh.corner_indices) {
            for (k, corner) in corners.iter().enumerate() {
                let (from, to) = (triangle.vertices[k], triangle.vertices[(k + 1) % 3]);
                edges.insert((bits(from), bits(to)), from);
                let normal = Vec3::from(known.values[*corner as usize]);
                bent += usize::from(normals.entry(bits(from)).or_insert(normal).dot(normal) < 0.9999);
            }
        }
    }
    let is_inside = |[x, _, z]: [f32; 3]| x.abs().max(z.abs()) < f32::from(SIDE) - 1.5;
    let open = edges.iter().filter(|((from, to), at)| is_inside(**at) && !edges.contains_key(&(*to, *from)));
    (open.count(), bent)
}

fn commit(db: &mut SceneDb) -> Arc<Snapshot> {
    db.set_dicing(view(near(), 0.0));
    db.commit().snapshot
}

#[test]
fn a_near_surface_in_patches_is_one_mesh_without_cracks() {
    let mut db = SceneDb::new();
    db.upsert_mesh(terrain(Subdivision::CatmullClark));
    db.set_dicing(view(near(), 0.0));
    let commit = db.commit();
    assert_eq!(commit.warnings, [], "nothing is wrong");
    assert_eq!((db.meshes_made(), commit.snapshot.counts.meshes), (PATCHES, 1), "patches made, meshes seen");
    assert_eq!(cracks(&commit.snapshot), (0, 0), "open edges, and places with two normals");
    let faces = commit.snapshot.meshes.iter().flat_map(|mesh| asset(mesh).triangles.clone()).map(|t| t.face);
    let faces: BTreeSet<u32> = faces.collect();
    assert!(faces.into_iter().eq(0..u32::try_from(SIDE * SIDE).expect("few")), "authored numbers, every face once");
    db.set_dicing(view(DVec3::new(0.0, 0.0, 2000.0), 0.0));
    assert_eq!(db.commit().snapshot.meshes.len(), 1, "far away it is refined as a whole");
}

#[test]
fn what_is_scattered_stays_whole() {
    let made = |places: &[[f32; 3]]| {
        let mut db = SceneDb::new();
        let mesh = terrain(Subdivision::CatmullClark);
        let prim = PrimDesc { path: "/i/p/m".into(), instanced_by: by("/i", "/i/p"), ..PrimDesc::default() };
        db.upsert_mesh(MeshDesc { prim, ..mesh });
        db.upsert_instancer(instancer("/i", "/i/p", places, 1.0, Vec::new()));
        commit(&mut db);
        db.meshes_made()
    };
    let near = [[0.0; 3], [10.0, -30.0, 0.0]];
    let far: Vec<[f32; 3]> = (0..20_u8).map(|k| [0.0, 0.0, -1000.0 - 500.0 * f32::from(k)]).collect();
    assert_eq!(made(&near), PATCHES, "near placements share their patches");
    assert_eq!(made(&[&near[..], &far].concat()), 1, "many placements would place each patch");
}

/// The level of a texture follows from each face alone: patches beside each other agree about it.
#[test]
fn a_textured_displacement_in_patches_has_no_cracks() {
    for (subdivision, name) in
        [(Subdivision::CatmullClark, "levels"), (Subdivision::None, "levels"), (Subdivision::CatmullClark, "waves")]
    {
        let mut db = SceneDb::new();
        db.set_height_files(Arc::new(Files));
        db.upsert_material(textured(name, "r", &[], &[]));
        db.upsert_mesh(MeshDesc { material: Some("/m".into()), ..terrain(subdivision) });
        let snapshot = commit(&mut db);
        assert_eq!(db.meshes_made(), PATCHES, "in patches");
        let (open, bent) = cracks(&snapshot);
        assert_eq!(open, 0, "open edges of {subdivision:?} by {name}");
        // Where coordinates jump, the surface is sharp; flat faces have normals of their own.
        assert!(bent == 0 || subdivision == Subdivision::None, "{bent} places have two normals, by {name}");
    }
}

#[test]
fn a_step_of_a_live_view_refines_some_patches() {
    let mut db = SceneDb::new();
    db.upsert_mesh(terrain(Subdivision::CatmullClark));
    let place = |step: i32| near() - DVec3::Z * (0.5 * f64::from(step));
    assert_eq!(look(&mut db, view(place(0), 0.0)), PATCHES, "the first view");
    let steps: Vec<u64> = (1..=20).map(|step| look(&mut db, view(place(step), 0.0))).collect();
    let (all, most): (u64, u64) = (steps.iter().sum(), *steps.iter().max().expect("steps"));
    assert!((1..=30).contains(&all) && most < PATCHES, "{steps:?} patches refined again");
    assert_eq!(cracks(db.snapshot()), (0, 0), "after a walk");
    let made = look(&mut db, view(place(20), 0.3)) + look(&mut db, view(place(20), 0.0));
    assert_eq!(made, look(&mut db, view(place(20), 0.3)) + made, "what left the picture is still there");
    // A final picture is a function of scene and camera.
    let mut alone = SceneDb::new();
    alone.upsert_mesh(terrain(Subdivision::CatmullClark));
    let keys = |snapshot: &Snapshot| snapshot.meshes.iter().map(|mesh| mesh.key).collect::<BTreeSet<u128>>();
    assert_eq!(keys(&commit(&mut db)), keys(&commit(&mut alone)), "after a live view, and alone");
    let again = db.meshes_made();
    db.set_dicing(view(near(), 0.0));
    db.commit();
    assert_eq!(db.meshes_made(), again, "the same camera");
}
