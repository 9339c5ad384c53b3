// SPDX-License-Identifier: Apache-2.0
//! Short ways to describe prims, and a brute-force flattening of snapshots.

use std::sync::Arc;

use glam::{DMat4, DVec3, DVec4};
use oocpt_core::{
    DroppedData, InstanceRecord, InstanceTarget, InstancedBy, InstancerDesc, InstancerPrototype, Interpolation,
    MeshAsset, MeshDesc, PrimDesc, Primvar, SceneDb, SceneMesh, Snapshot, Subdivision, TypedArray,
};

pub(crate) fn prim(path: &str) -> PrimDesc {
    PrimDesc {
        path: path.into(),
        transform: DMat4::IDENTITY,
        visible: true,
        purpose: "default".into(),
        motion: Vec::new(),
        instanced_by: Vec::new(),
    }
}

pub(crate) fn by(instancer: &str, root: &str) -> InstancedBy {
    InstancedBy { instancer: instancer.into(), prototype_root: root.into() }
}

pub(crate) fn polygons(path: &str, counts: &[i32], indices: &[i32], points: &[[f32; 3]]) -> MeshDesc {
    MeshDesc {
        prim: prim(path),
        prim_id: 7,
        double_sided: true,
        left_handed: false,
        subdivision: Subdivision::None,
        face_vertex_counts: TypedArray::of(counts.to_vec()),
        face_vertex_indices: TypedArray::of(indices.to_vec()),
        hole_indices: None,
        points: TypedArray::of(points.to_vec()),
        normals: None,
        display_color: None,
        display_opacity: None,
        ..MeshDesc::default()
    }
}

/// One triangle with its own shape per `tag`, so that different tags are different assets.
pub(crate) fn triangle(path: &str, tag: f32) -> MeshDesc {
    polygons(path, &[3], &[0, 1, 2], &[[0.0, 0.0, 0.0], [1.0, 0.0, tag], [0.0, 1.0 + tag, 0.0]])
}

/// A grid of `n x n` quads over a wavy surface, 0..1 in x and y.
pub(crate) fn grid(path: &str, n: u16) -> MeshDesc {
    let side = i32::from(n) + 1;
    let coordinate = |k: i32| f32::from(u16::try_from(k).unwrap()) / f32::from(n);
    let points: Vec<[f32; 3]> = (0..side * side)
        .map(|k| (coordinate(k % side), coordinate(k / side)))
        .map(|(x, y)| [x, y, 0.1 * (9.0 * x).sin() * (7.0 * y).cos()])
        .collect();
    let corners = |k: i32| [k, k + 1, k + side + 1, k + side];
    let indices: Vec<i32> =
        (0..i32::from(n)).flat_map(|y| (0..i32::from(n)).flat_map(move |x| corners(y * side + x))).collect();
    polygons(path, &vec![4; indices.len() / 4], &indices, &points)
}

pub(crate) fn constant<T: oocpt_core::ArrayElement + std::fmt::Debug>(value: T) -> Primvar {
    primvar(Interpolation::Constant, vec![value])
}

pub(crate) fn primvar<T: oocpt_core::ArrayElement + std::fmt::Debug>(
    interpolation: Interpolation,
    values: Vec<T>,
) -> Primvar {
    Primvar { interpolation, values: TypedArray::of(values), indices: None }
}

/// An instancer with translations only; prototypes as (root, indices).
pub(crate) fn scatter(path: &str, translations: &[[f32; 3]], prototypes: &[(&str, &[i32])]) -> InstancerDesc {
    let prototype = |(root, indices): &(&str, &[i32])| InstancerPrototype {
        root: (*root).into(),
        indices: TypedArray::of(indices.to_vec()),
    };
    InstancerDesc {
        prim: prim(path),
        prototypes: prototypes.iter().map(prototype).collect(),
        mask: None,
        translations: Some(TypedArray::of(translations.to_vec())),
        rotations: None,
        scales: None,
        transforms: None,
        ..InstancerDesc::default()
    }
}

pub(crate) fn committed(db: &mut SceneDb) -> Arc<Snapshot> {
    let commit = db.commit();
    assert_eq!(commit.snapshot.validate(), Ok(()));
    assert_eq!(commit.snapshot.world.validate(&commit.snapshot.meshes, &commit.snapshot.assemblies), Ok(()));
    commit.snapshot
}

pub(crate) fn records(snapshot: &Snapshot, assembly: usize) -> Vec<InstanceRecord> {
    let assembly = &snapshot.assemblies[assembly];
    let mut out = vec![InstanceRecord::default(); assembly.len()];
    assembly.encode(0..assembly.len(), &mut out);
    out
}

/// A placement of a mesh, multiplied out in f64.
#[derive(Clone, Debug)]
pub(crate) struct Leaf {
    pub(crate) mesh: Arc<MeshAsset>,
    pub(crate) world: DMat4,
    pub(crate) prim_id: i32,
    pub(crate) instance_id: i64,
}

/// Multiplies a snapshot out.
pub(crate) fn flatten(snapshot: &Snapshot) -> Vec<Leaf> {
    let mut leaves = Vec::new();
    let root = snapshot.assemblies.len() - 1;
    flatten_into(snapshot, root, DMat4::from_translation(snapshot.origin), 0, &mut leaves);
    leaves
}

fn flatten_into(snapshot: &Snapshot, assembly: usize, frame: DMat4, id: i64, leaves: &mut Vec<Leaf>) {
    for record in records(snapshot, assembly) {
        let row = |k: usize| DVec4::from(record.object_from_parent[k].map(f64::from));
        let object_from_parent = DMat4::from_cols(row(0), row(1), row(2), DVec4::W).transpose();
        let world = frame * object_from_parent.inverse();
        let instance_id = id * i64::from(record.prototype_count) + i64::from(record.index_in_prototype);
        match record.target {
            InstanceTarget::Mesh(m) => leaves.push(Leaf {
                mesh: asset(&snapshot.meshes[m as usize]),
                world,
                prim_id: record.prim_id,
                instance_id,
            }),
            InstanceTarget::Assembly(a) => flatten_into(snapshot, a as usize, world, instance_id, leaves),
        }
    }
}

/// Sum of the triangles' areas.
pub(crate) fn area(mesh: &MeshAsset) -> f64 {
    mesh.triangles.iter().map(|t| 0.5 * double_area(&t.vertices).length()).sum()
}

/// Sum of the triangles' area vectors.
pub(crate) fn area_vector(mesh: &MeshAsset) -> DVec3 {
    mesh.triangles.iter().map(|t| 0.5 * double_area(&t.vertices)).sum()
}

fn double_area(v: &[[f32; 3]; 3]) -> DVec3 {
    let [a, b, c] = v.map(|v| DVec3::from(v.map(f64::from)));
    (b - a).cross(c - a)
}

/// An instancer at `/i` whose prototype `/i/p` is one triangle.
pub(crate) fn with_instancer(desc: InstancerDesc) -> SceneDb {
    let mut db = SceneDb::new();
    let mut mesh = triangle("/i/p/m", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    db.upsert_instancer(desc);
    db
}

/// Instances left, what was dropped, and the warned paths.
pub(crate) fn outcome(db: &mut SceneDb) -> (u128, DroppedData, Vec<String>) {
    let commit = db.commit();
    assert_eq!(commit.snapshot.validate(), Ok(()));
    assert_eq!(commit.snapshot.world.validate(&commit.snapshot.meshes, &commit.snapshot.assemblies), Ok(()));
    let paths = commit.warnings.iter().map(|w| w.path.to_string()).collect();
    (commit.snapshot.counts.instances, commit.snapshot.dropped, paths)
}

/// Nothing dropped.
pub(crate) const NONE: DroppedData = DroppedData::NONE;

/// The asset of a mesh.
pub(crate) fn asset(mesh: &SceneMesh) -> Arc<MeshAsset> {
    mesh.asset().expect("it is in memory, or can be read")
}
