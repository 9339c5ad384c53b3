// SPDX-License-Identifier: Apache-2.0
//! Edits of many instances at once, one after the other: each gives the result of a new database, which cuts in
//! stretches.

use oocpt_core::{InstancerDesc, PartitionOptions, SceneDb, TypedArray};

use crate::partition::cut::spread;
use crate::partition::edits::{assert_keys_tell, assert_same_world};
use crate::support::{by, committed, scatter, triangle};

/// Instances; more than are sorted without buckets.
const COUNT: usize = 60_000;

/// Prototype that an instance shows: most show one, few each of the others, which are scanned anew where it is edited.
fn kind(n: usize) -> usize {
    (n % 10).saturating_sub(7)
}

/// An instancer of instances `gone..` at `points`.
fn instancer(points: &[[f32; 3]], gone: usize) -> InstancerDesc {
    let numbers = |of: usize| (gone..points.len()).filter(move |n| kind(*n) == of).map(|n| i32::try_from(n).unwrap());
    let [a, b, c] = [0, 1, 2].map(|of| numbers(of).collect::<Vec<i32>>());
    scatter("/i", points, &[("/i/p0", &a), ("/i/p1", &b), ("/i/p2", &c)])
}

fn database(desc: &InstancerDesc) -> SceneDb {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 64 << 10 });
    for (root, shape) in [("/i/p0", 0.5), ("/i/p1", 1.0), ("/i/p2", 2.0)] {
        let mut mesh = triangle(&format!("{root}/m"), shape);
        mesh.prim.instanced_by = vec![by("/i", root)];
        db.upsert_mesh(mesh);
    }
    db.upsert_instancer(desc.clone());
    db
}

/// An edit: its name, and the new position of each point, by number.
type Edit = (&'static str, fn(usize, [f32; 3]) -> [f32; 3]);

#[test]
fn bulk_moves_equal_a_new_database() {
    let edits: [Edit; 12] = [
        ("all, a little", |n, p| p.map(|v| v + 0.01 * f32::from(u8::try_from(n % 7).unwrap()))),
        ("all of one prototype", |n, p| if kind(n) == 1 { p.map(|v| -v) } else { p }),
        ("a twentieth", |n, p| if n.is_multiple_of(20) { [p[1], p[2], p[0]] } else { p }),
        ("one to another chunk", |n, p| if n == 30_000 { p.map(|v| -v) } else { p }),
        ("some are nowhere", |n, p| match n % 1000 {
            7 => [f32::NAN; 3],
            8 => [f32::INFINITY, 0.0, 0.0],
            _ => p,
        }),
        ("nine tenths, and those come back", |n, p| match n % 1000 {
            7 | 8 => [1.0, 2.0, f32::from(u16::try_from(n).unwrap()) / 4096.0],
            k if k % 10 == 0 => p,
            _ => [p[2], p[0], p[1]],
        }),
        ("apart", |n, p| if n.is_multiple_of(2) { p.map(|v| v * 1e9) } else { p.map(|v| v * -1e3) }),
        ("to one point", |_, _| [3.0; 3]),
        ("most from there", |n, p| if n.is_multiple_of(4) { p } else { [0.001, 0.002, 0.0005].map(|v| v * n as f32) }),
        ("to a line", |n, _| [n as f32, 0.0, 0.0]),
        ("all are nowhere", |_, _| [f32::NAN; 3]),
        ("and somewhere again", |n, _| [(n % 200) as f32, (n / 200) as f32, 0.0]),
    ];
    let mut points = spread(COUNT, 50.0, 5);
    let mut desc = instancer(&points, 0);
    let mut db = database(&desc);
    let mut before = committed(&mut db);
    assert!(before.world.chunks.len() > 50, "{} chunks", before.world.chunks.len());
    for (at, (name, edit)) in edits.into_iter().enumerate() {
        points.iter_mut().enumerate().for_each(|(n, p)| *p = edit(n, *p));
        if at < 5 {
            desc.translations = Some(TypedArray::of(points.clone()));
        } else {
            // Some instances are removed and come back; with other numbers all are scanned anew.
            desc = instancer(&points, [5000, 0, 100][at % 3]);
        }
        db.upsert_instancer(desc.clone());
        let after = committed(&mut db);
        let mut new = database(&desc);
        new.set_partition_memory(1);
        println!("{name}: {} chunks", after.world.chunks.len());
        assert_same_world(&committed(&mut new), &after);
        assert_keys_tell(&before, &after);
        before = after;
    }
    db.upsert_instancer(desc);
    assert!(!db.commit().changed, "nothing moved");
}
