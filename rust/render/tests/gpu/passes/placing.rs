// SPDX-License-Identifier: Apache-2.0
//! `refit_chunks` makes the records that the host makes, and the trees that the host refits, bit for bit, and drops
//! what the host drops; `scatter_words` changes what it is told and nothing else.

use super::handmade_scene::Random;
use super::{close_device, open};
use crate::scenes::{instanced, instancer, prim, sphere};
use bytemuck::Zeroable;
use glam::{DMat4, DQuat, DVec3};
use oocpt_abi::{
    GpuChunkMember, GpuHeldChunk, GpuRefittedChunk, LevelNode, MEMBER_AFTER, MEMBER_HALVES, MEMBER_INSTANCED,
    PlacingPush, groups,
};
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::mesh::{LevelShape, build_level};
use oocpt_core::partition::{Chunk, HELD_FROM, PartitionOptions};
use oocpt_core::scene::{Aabb, InstanceRecord, InstancerDesc, SceneDb, Snapshot};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, Pipeline};
use oocpt_shaders::{ShaderModule, scene};
use std::sync::Arc;
use std::time::Duration;

const COUNT: usize = HELD_FROM / 2 + 100;

/// Numbers at which placements go wrong, but none is far away for it.
const HOSTILE: [f32; 8] = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e22, 0.0, 1e-30, 1e-20];

/// Instances in a slab, moved a little by each frame; some are hostile in later ones.
fn crowd(path: &str, kind: usize, frame: u32) -> InstancerDesc {
    let mut random = Random(u64::from(frame) * 97 + kind as u64 + 1);
    let place = |n: usize| {
        let [x, y, z, turn] = oocpt_abi::sampler::sample_4d(u32::try_from(n).expect("few"), 0, 3).map(f64::from);
        let at = f64::from(frame) * 0.4 + turn * std::f64::consts::TAU;
        let moved = 0.1 * DVec3::new(at.cos(), at.sin(), 0.0);
        let turned = DQuat::from_xyzw(at.sin(), 0.3, 0.1 * turn, 0.5 + at.cos());
        let mirror = if n.is_multiple_of(5) { -1.0 } else { 1.0 };
        (
            DVec3::new(8.0 * x - 4.0, y, 8.0 * z - 4.0) + moved,
            turned,
            DVec3::new(0.03, mirror * 0.05 * (1.0 + turn), 0.04),
        )
    };
    let places: Vec<_> = (0..COUNT).map(place).collect();
    let mut desc = instancer(
        prim(path, DMat4::from_rotation_z(0.3) * DMat4::from_scale(DVec3::splat(1.5))),
        &format!("{path}/ball"),
        &places,
    );
    let mut points: Vec<[f32; 3]> = places.iter().map(|p| p.0.as_vec3().to_array()).collect();
    let mut scales: Vec<[f32; 3]> = places.iter().map(|p| p.2.as_vec3().to_array()).collect();
    for _ in 0..if frame > 1 { 40 } else { 0 } {
        let value = HOSTILE[random.word() as usize % HOSTILE.len()];
        let [n, axis] = [COUNT, 3].map(|below| random.word() as usize % below);
        if random.word().is_multiple_of(2) { points[n][axis] = value } else { scales[n][axis] = value }
    }
    desc.translations = Some(TypedArray::of(points));
    desc.scales = Some(TypedArray::of(scales));
    match kind {
        0 => {}
        1 => {
            let halves = |n: usize| -> [half::f16; 4] { places[n].1.to_array().map(half::f16::from_f64) };
            let halves: Vec<[half::f16; 4]> = (0..COUNT).map(halves).collect();
            desc.rotations = Some(TypedArray::from_vec(ElementType::Quath, halves).expect("four halves"));
        }
        _ => {
            // As Gf stores matrices, one in four scaled as a whole.
            let matrix = |n: usize| {
                let (at, turn, scale) = places[n];
                let m = DMat4::from_scale_rotation_translation(scale, turn.normalize(), at);
                m.to_cols_array().map(|v| if n.is_multiple_of(4) { 2.0 * v } else { v })
            };
            let matrices: Vec<[f64; 16]> = (0..COUNT).map(matrix).collect();
            desc.transforms = Some(TypedArray::from_vec(ElementType::Matrix4d, matrices).expect("sixteen doubles"));
            (desc.translations, desc.rotations, desc.scales) = (None, None, None);
        }
    }
    desc
}

/// The scene in a frame, of which nothing was measured since the first.
fn commit(db: &mut SceneDb, frame: u32) -> Arc<Snapshot> {
    for kind in 0..3 {
        let path = format!("/crowd{kind}");
        db.upsert_instancer(crowd(&path, kind, frame));
        let at = DMat4::from_rotation_x(0.2) * DMat4::from_translation(DVec3::new(0.1, 0.2, 0.3));
        let at = if kind == 0 { DMat4::IDENTITY } else { at };
        db.upsert_mesh(sphere(instanced(prim(&format!("{path}/ball"), at), &path), 2, 4, 0.7));
    }
    db.commit().snapshot
}

fn upload(gpu: &Arc<Gpu>, bytes: &[u8]) -> Buffer {
    let buffer = Buffer::new(gpu, "input", (bytes.len() as u64).max(16), BufferUsage::Upload).expect("small");
    buffer.write(0, bytes).expect("mapped");
    buffer
}

fn run(gpu: &Arc<Gpu>, module: &ShaderModule, push: PlacingPush, size: [u32; 3], back: &[(&Buffer, &Buffer)]) {
    let words = module.specialised(&[]);
    let pipeline = Pipeline::new(gpu, module.name, &words, &[], 32).expect("it compiles");
    let mut commands = gpu.commands("test").expect("a list");
    commands.dispatch(&pipeline, bytemuck::bytes_of(&push), size);
    for (from, to) in back {
        commands.copy(*from, 0, *to, 0, to.size());
    }
    assert!(commands.submit().expect("submitted").wait(Duration::from_secs(120)).expect("alive"), "it ends");
}

/// The members of a chunk for the pass, and the arrays that they point to.
fn described(gpu: &Arc<Gpu>, chunk: &Chunk) -> (Vec<GpuChunkMember>, Vec<Buffer>) {
    let members = chunk.placing().expect("at rest");
    let mut arrays: Vec<Buffer> = Vec::new();
    let mut described = Vec::new();
    for member in &members {
        let lent = member.arrays.as_ref();
        let mut address = |at: usize| {
            let array = lent.and_then(|arrays| arrays[at].as_ref());
            array.map_or(0, |array| {
                arrays.push(upload(gpu, array.view().bytes()));
                arrays.last().expect("pushed").address()
            })
        };
        let is_half = lent.and_then(|a| a[1].as_ref()).is_some_and(|a| a.element() == ElementType::Quath);
        let flag = |is_set: bool, flag: u32| if is_set { flag } else { 0 };
        described.push(GpuChunkMember {
            before: member.before.map(f64::to_bits),
            after: member.after.unwrap_or_default().map(f64::to_bits),
            parent: member.parent.map(f64::to_bits),
            center: member.center.map(f64::to_bits),
            half_sides: member.half.map(f64::to_bits),
            translations: address(0),
            rotations: address(1),
            scales: address(2),
            transforms: address(3),
            count: u32::try_from(member.count).expect("few"),
            flags: flag(lent.is_some(), MEMBER_INSTANCED)
                | flag(member.after.is_some(), MEMBER_AFTER)
                | flag(is_half, MEMBER_HALVES),
        });
    }
    (described, arrays)
}

/// Records, nodes and results of a chunk by the device, whose records and tree were `records` and `nodes`.
fn placed(
    gpu: &Arc<Gpu>,
    chunk: &Chunk,
    records: &[u8],
    nodes: &[LevelNode],
) -> (Vec<u8>, Vec<LevelNode>, GpuRefittedChunk) {
    let (described, _arrays) = described(gpu, chunk);
    let mut places: Vec<[u32; 2]> = Vec::new();
    chunk.each_place(|member, number| places.push([member, number]));
    let inputs =
        [bytemuck::cast_slice(&described), bytemuck::cast_slice(&places), records, bytemuck::cast_slice(nodes)];
    let [members, places, records_on, nodes_on] = inputs.map(|bytes: &[u8]| upload(gpu, bytes));
    let scratch = Buffer::new(gpu, "scratch", 28 * nodes.len() as u64, BufferUsage::Device).expect("small");
    let held = GpuHeldChunk {
        records: records_on.address(),
        nodes: nodes_on.address(),
        places: places.address(),
        members: members.address(),
        boxes: scratch.address(),
        order: scratch.address() + 24 * nodes.len() as u64,
        record_count: u32::try_from(chunk.len()).expect("few"),
        node_count: u32::try_from(nodes.len()).expect("few"),
    };
    let held = upload(gpu, bytemuck::bytes_of(&held));
    let result = Buffer::new(gpu, "result", size_of::<GpuRefittedChunk>() as u64, BufferUsage::Device).expect("small");
    let read = |bytes: u64| Buffer::new(gpu, "read", bytes, BufferUsage::Readback).expect("small");
    let back = [read(records.len() as u64), read(64 * nodes.len() as u64), read(result.size())];
    let push = PlacingPush { source: held.address(), target: result.address(), count: 0, words: 0, pad: [0; 2] };
    let copies = [(&records_on, &back[0]), (&nodes_on, &back[1]), (&result, &back[2])];
    run(gpu, &scene::SCENE_REFIT_CHUNKS, push, [1, 1, 1], &copies);
    let (mut records, mut nodes, mut result) = (records.to_vec(), nodes.to_vec(), GpuRefittedChunk::zeroed());
    back[0].read(0, &mut records).expect("mapped");
    back[1].read(0, bytemuck::cast_slice_mut(&mut nodes)).expect("mapped");
    back[2].read(0, bytemuck::bytes_of_mut(&mut result)).expect("mapped");
    (records, nodes, result)
}

/// The records of a chunk as the host encodes them, and their boxes.
fn encoded(chunk: &Chunk) -> (Vec<u8>, Vec<Aabb>) {
    let mut records = vec![InstanceRecord::default(); chunk.len()];
    chunk.encode(0..chunk.len(), &mut records);
    let boxes = records.iter().map(|record| Aabb { min: record.bounds[0], max: record.bounds[1] }).collect();
    let bytes = records.iter().flat_map(|record| {
        let flip = if record.flips_handedness { oocpt_abi::FLIPS_HANDEDNESS } else { 0 };
        let rows = record.object_from_parent.map(|row| row.map(f32::to_bits));
        let rest = [7, record.prim_id.cast_unsigned(), record.index_in_prototype, record.prototype_count | flip];
        rows.into_iter().flatten().chain(rest).flat_map(u32::to_ne_bytes).collect::<Vec<u8>>()
    });
    (bytes.collect(), boxes)
}

#[test]
fn the_device_places_and_refits_as_the_host_does() {
    let gpu = open();
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 64 << 10 });
    db.set_live(true);
    db.set_late(true);
    let before = commit(&mut db, 0);
    let (mut chunks, mut dropped, mut flipped) = (0, 0, 0);
    for frame in [1, 2, 3] {
        let after = commit(&mut db, frame);
        let held = after.world.chunks.iter().filter(|chunk| chunk.is_held());
        assert!(held.clone().count() > 20 && held.clone().all(|chunk| chunk.is_late()), "nothing was measured");
        // Those of all kinds of instancers.
        for chunk in held.step_by(3) {
            let rest = before.world.chunks.iter().find(|old| old.key() == chunk.shape()).expect("of this shape");
            let (records, boxes) = encoded(rest);
            let tree = build_level(&boxes);
            let shape = LevelShape::of(&tree, &boxes);
            let (expected, moved) = encoded(chunk);
            let refitted = shape.refit(&moved).expect("as many");
            let (found, nodes, result) = placed(&gpu, chunk, &records, &tree.nodes);
            for (at, (found, expected)) in found.chunks(64).zip(expected.chunks(64)).enumerate() {
                assert_eq!(found, expected, "frame {frame}, record {at} of {}", chunk.len());
            }
            let all = moved.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
            assert_eq!(Aabb { min: result.min, max: result.max }, all, "its box");
            for (at, (found, expected)) in nodes.iter().zip(&refitted.tree.nodes).enumerate() {
                // A node without anything in it has no planes of the host.
                let is_empty = found.lower == [u32::MAX; 3] && found.upper == [0; 3];
                assert!(found == expected || (is_empty && expected.cell == 0), "node {at}: {found:?} {expected:?}");
                assert_eq!(found.child, expected.child, "node {at}");
            }
            let area = f64::from_bits(result.area);
            let host = shape.refit(&boxes).map(|_| refitted.growth).expect("as many");
            let base = f64::from_bits(placed(&gpu, rest, &records, &tree.nodes).2.area);
            assert!((area / base / host - 1.0).abs() < 1e-9, "{area}, {base}, {host}");
            let nowhere = moved.iter().filter(|b| b.is_empty()).count();
            assert_eq!(result.unusable as usize, nowhere, "what the host drops");
            flipped += expected.chunks(64).filter(|record| record[63] & 0x80 != 0).count();
            (chunks, dropped) = (chunks + 1, dropped + nowhere);
        }
        assert_eq!(dropped > 0, frame > 1, "{dropped} were dropped until frame {frame}");
    }
    assert!(chunks > 20 && flipped > 100, "{chunks} chunks, {flipped} mirrored instances");
    close_device(&gpu);
}

#[test]
fn scattered_words_change_their_elements_alone() {
    let gpu = open();
    let mut random = Random(3);
    let target: Vec<u32> = (0..3000).map(|_| random.word()).collect();
    let mut expected = target.clone();
    let mut entries = Vec::new();
    for element in [0_u32, 7, 8, 500, 999] {
        let words = [random.word(), random.word(), random.word()];
        expected[element as usize * 3..][..3].copy_from_slice(&words);
        entries.extend([element].iter().chain(&words));
    }
    // One entry more than the pass is told of.
    entries.extend([5, 0, 0, 0]);
    let (on_device, list) = (upload(&gpu, bytemuck::cast_slice(&target)), upload(&gpu, bytemuck::cast_slice(&entries)));
    let back = Buffer::new(&gpu, "read", 12_000, BufferUsage::Readback).expect("small");
    let push = PlacingPush { source: list.address(), target: on_device.address(), count: 5, words: 3, pad: [0; 2] };
    run(&gpu, &scene::SCENE_SCATTER_WORDS, push, groups(5), &[(&on_device, &back)]);
    let mut found = vec![0_u32; 3000];
    back.read(0, bytemuck::cast_slice_mut(&mut found)).expect("mapped");
    assert_eq!(found, expected);
    close_device(&gpu);
}
