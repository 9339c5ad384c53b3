// SPDX-License-Identifier: Apache-2.0
//! Speed, run by hand: `cargo test --profile fast -p oocpt-core -- --ignored --nocapture throughput`.

use std::time::Instant;

use oocpt_core::{ElementType, InstanceRecord, SceneDb, TypedArray};
use rayon::prelude::*;

use crate::support::{by, grid, scatter, triangle};

const INSTANCES: u32 = 4_000_000;

/// Wall clock and processor time (of all threads) since a moment; the latter holds on a busy machine too.
struct Watch {
    start: Instant,
    ticks: u64,
}

impl Watch {
    fn start() -> Self {
        Self { start: Instant::now(), ticks: ticks() }
    }

    /// Millions per second of wall clock, and per second of processor time.
    #[expect(clippy::cast_precision_loss, reason = "a figure for people")]
    fn rates(&self, count: f64) -> String {
        let wall = count / self.start.elapsed().as_secs_f64() / 1e6;
        let processor = count / ((ticks() - self.ticks) as f64 / 100.0) / 1e6;
        format!("{wall:.2} M/s, {processor:.2} M/s per busy core")
    }
}

/// User time of this process in hundredths of a second (Linux), 0 elsewhere.
fn ticks() -> u64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap_or_default();
    let after_name = stat.rsplit(')').next().unwrap_or_default();
    after_name.split_whitespace().nth(11).and_then(|t| t.parse().ok()).unwrap_or(0)
}

#[test]
#[ignore = "measures time"]
fn throughput_of_instances() {
    let n = f64::from(INSTANCES);
    let unit = |k: u32, d: usize| oocpt_core::sample_4d(k, 0, 1)[d];
    let points: Vec<[f32; 3]> = (0..INSTANCES).map(|k| [0, 1, 2].map(|d| 1000.0 * unit(k, d))).collect();
    let turns: Vec<[f32; 4]> = (0..INSTANCES).map(|k| [unit(k, 0), unit(k, 1), unit(k, 2), 0.5]).collect();
    let scales: Vec<[f32; 3]> = (0..INSTANCES).map(|k| [0.5 + unit(k, 3); 3]).collect();
    let numbers: Vec<i32> = (0..i32::try_from(INSTANCES).unwrap()).collect();
    let mut desc = scatter("/i", &points, &[("/i/p", &numbers)]);
    desc.rotations = Some(TypedArray::from_vec(ElementType::Quatf, turns).unwrap());
    desc.scales = Some(TypedArray::of(scales));
    let mut db = SceneDb::new();
    db.upsert_instancer(desc);
    let mut mesh = triangle("/i/p/m", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    let start = Watch::start();
    let snapshot = db.commit().snapshot;
    println!("commit: {}", start.rates(n));
    let root = snapshot.assemblies.last().unwrap();
    let mut records = vec![InstanceRecord::default(); root.len()];
    for label in ["cold", "warm"] {
        let start = Watch::start();
        let chunk = 1 << 14;
        let pieces = records.par_chunks_mut(chunk).enumerate();
        pieces.for_each(|(k, out)| root.encode(k * chunk..k * chunk + out.len(), out));
        println!("encode, {} threads, {label}: {}", rayon::current_num_threads(), start.rates(n));
    }
    let start = Watch::start();
    root.encode(0..root.len(), &mut records);
    println!("encode, 1 thread: {}", start.rates(n));
    assert!(records.iter().all(|r| r.bounds[0][0] <= r.bounds[1][0]));
}

#[test]
#[ignore = "measures time"]
fn throughput_of_mesh_builds() {
    for (meshes, side) in [(1_u16, 700_u16), (16, 175)] {
        let mut db = SceneDb::new();
        for k in 0..meshes {
            let mut mesh = grid(&format!("/m{k}"), side);
            // Makes each mesh unique, at no cost.
            mesh.face_vertex_counts = TypedArray::of(vec![4; usize::from(side) * usize::from(side) + usize::from(k)]);
            db.upsert_mesh(mesh);
        }
        let start = Watch::start();
        let snapshot = db.commit().snapshot;
        #[expect(clippy::cast_precision_loss, reason = "a figure for people")]
        let triangles = snapshot.counts.unique_triangles as f64;
        let depth = snapshot.meshes.iter().map(|m| m.bvh.depth).max();
        println!("{meshes} meshes, {triangles} triangles: {}, depth {depth:?}", start.rates(triangles));
    }
}
