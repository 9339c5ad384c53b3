// SPDX-License-Identifier: Apache-2.0
//! `place_records` makes the records that the host makes, `refit_chunks` the trees that the host refits, bit for bit,
//! and both drop what the host drops; `scatter_words` changes what it is told and nothing else.

use super::handmade_scene::Random;
use super::{close_device, open};
use crate::scenes::{instanced, instancer, prim, sphere};
use bytemuck::Zeroable;
use glam::{DMat4, DQuat, DVec3};
use oocpt_abi::{
    GpuChunkMember, GpuHeldChunk, GpuRefittedChunk, LevelNode, MEMBER_AFTER, MEMBER_HALVES, MEMBER_INSTANCED,
    PlacingPush, REFIT_LEVELS, groups,
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

/// A crowd of which one instance in so many is as in another frame.
fn mixed(path: &str, kind: usize, (frame, other, step): (u32, u32, usize)) -> InstancerDesc {
    fn mix(rest: Option<&TypedArray>, moved: Option<&TypedArray>, step: usize) -> Option<TypedArray> {
        let (rest, moved) = (rest?, moved?);
        let size = rest.element().size();
        let mut bytes = rest.view().bytes().to_vec();
        for (n, element) in bytes.chunks_mut(size).enumerate().filter(|(n, _)| n.is_multiple_of(step)) {
            element.copy_from_slice(&moved.view().bytes()[n * size..][..size]);
        }
        Some(match rest.element() {
            ElementType::Vec3f => array::<[f32; 3]>(ElementType::Vec3f, &bytes),
            ElementType::Quatf => array::<[f32; 4]>(ElementType::Quatf, &bytes),
            ElementType::Quath => array::<[half::f16; 4]>(ElementType::Quath, &bytes),
            other => array::<[f64; 16]>(other, &bytes),
        })
    }
    fn array<T: bytemuck::Pod + Send + Sync + std::fmt::Debug>(element: ElementType, bytes: &[u8]) -> TypedArray {
        let values: Vec<T> = bytes.chunks(size_of::<T>()).map(bytemuck::pod_read_unaligned).collect();
        TypedArray::from_vec(element, values).expect("elements of this size")
    }
    let (mut desc, moved) = (crowd(path, kind, frame), crowd(path, kind, other));
    desc.translations = mix(desc.translations.as_ref(), moved.translations.as_ref(), step);
    desc.rotations = mix(desc.rotations.as_ref(), moved.rotations.as_ref(), step);
    desc.scales = mix(desc.scales.as_ref(), moved.scales.as_ref(), step);
    desc.transforms = mix(desc.transforms.as_ref(), moved.transforms.as_ref(), step);
    desc
}

/// The scene in a frame, of which nothing was measured since the first.
fn commit(db: &mut SceneDb, frame: u32) -> Arc<Snapshot> {
    commit_crowds(db, |path, kind| crowd(path, kind, frame))
}

fn commit_crowds(db: &mut SceneDb, crowd: impl Fn(&str, usize) -> InstancerDesc) -> Arc<Snapshot> {
    for kind in 0..3 {
        let path = format!("/crowd{kind}");
        db.upsert_instancer(crowd(&path, kind));
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
            changed: [0; 4],
            count: u32::try_from(member.count).expect("few"),
            flags: flag(lent.is_some(), MEMBER_INSTANCED)
                | flag(member.after.is_some(), MEMBER_AFTER)
                | flag(is_half, MEMBER_HALVES),
        });
    }
    (described, arrays)
}

/// What the device made of a chunk: records, nodes, the result.
type DeviceChunk = (Vec<u8>, Vec<LevelNode>, GpuRefittedChunk);

/// A chunk on the device.
struct ResidentChunk<'a> {
    gpu: &'a Arc<Gpu>,
    records: Buffer,
    nodes: Buffer,
    tree: Buffer,
    is_known: bool,
}

impl<'a> ResidentChunk<'a> {
    fn new(gpu: &'a Arc<Gpu>, records: &[u8], nodes: &[LevelNode]) -> Self {
        let boxes = 24 * (records.len() / 64) as u64;
        let tree_bytes = boxes + 28 * nodes.len() as u64 + 4 * u64::from(REFIT_LEVELS + 2);
        let tree = Buffer::new(gpu, "tree", tree_bytes, BufferUsage::Device).expect("small");
        let nodes = upload(gpu, bytemuck::cast_slice(nodes));
        Self { gpu, records: upload(gpu, records), nodes, tree, is_known: false }
    }

    /// Places the chunk; after the first time what `changed` says of an array of a member.
    fn place(&mut self, chunk: &Chunk, changed: impl Fn(usize, usize) -> Option<Vec<u32>>) -> DeviceChunk {
        let gpu = self.gpu;
        let (mut described, _arrays) = described(gpu, chunk);
        let mut sets = Vec::new();
        for (number, member) in described.iter_mut().enumerate() {
            for (at, slot) in member.changed.iter_mut().enumerate() {
                if let Some(bits) = changed(number, at) {
                    sets.push(upload(gpu, bytemuck::cast_slice(&bits)));
                    *slot = sets.last().expect("pushed").address();
                }
            }
        }
        let mut places: Vec<[u32; 2]> = Vec::new();
        chunk.each_place(|member, number| places.push([member, number]));
        let [members, places] =
            [bytemuck::cast_slice(&described), bytemuck::cast_slice(&places)].map(|bytes: &[u8]| upload(gpu, bytes));
        let (node_count, boxes) = (self.nodes.size() / 64, self.tree.address() + 24 * (self.records.size() / 64));
        let held = GpuHeldChunk {
            records: self.records.address(),
            nodes: self.nodes.address(),
            places: places.address(),
            members: members.address(),
            record_boxes: self.tree.address(),
            boxes,
            order: boxes + 24 * node_count,
            levels: boxes + 28 * node_count,
            record_count: u32::try_from(chunk.len()).expect("few"),
            node_count: u32::try_from(node_count).expect("few"),
            is_known: u32::from(std::mem::replace(&mut self.is_known, true)),
            pad: 0,
        };
        let held = upload(gpu, bytemuck::bytes_of(&held));
        let result_bytes = size_of::<GpuRefittedChunk>() as u64;
        let result = Buffer::new(gpu, "result", result_bytes, BufferUsage::Device).expect("small");
        let read = |bytes: u64| Buffer::new(gpu, "read", bytes, BufferUsage::Readback).expect("small");
        let back = [read(self.records.size()), read(self.nodes.size()), read(result.size())];
        let push = PlacingPush { source: held.address(), target: result.address(), count: 0, words: 0, changed: 0 };
        let copies = [(&self.records, &back[0]), (&self.nodes, &back[1]), (&result, &back[2])];
        // Fewer threads than records: each places several.
        run(gpu, &scene::SCENE_PLACE_RECORDS, push, [2, 1, 1], &[]);
        run(gpu, &scene::SCENE_REFIT_CHUNKS, push, [1, 1, 1], &copies);
        let mut records = vec![0; usize::try_from(back[0].size()).expect("small")];
        let mut nodes = vec![LevelNode::zeroed(); usize::try_from(node_count).expect("few")];
        let mut result = GpuRefittedChunk::zeroed();
        back[0].read(0, &mut records).expect("mapped");
        back[1].read(0, bytemuck::cast_slice_mut(&mut nodes)).expect("mapped");
        back[2].read(0, bytemuck::bytes_of_mut(&mut result)).expect("mapped");
        (records, nodes, result)
    }
}

/// Records, nodes and results of a chunk by the device, whose records and tree were `records` and `nodes`.
fn placed(gpu: &Arc<Gpu>, chunk: &Chunk, records: &[u8], nodes: &[LevelNode]) -> DeviceChunk {
    ResidentChunk::new(gpu, records, nodes).place(chunk, |_, _| None)
}

/// One bit for each element of an array of a member of a chunk that is another one in `after`.
fn changes(before: &Chunk, after: &Chunk) -> impl Fn(usize, usize) -> Option<Vec<u32>> {
    let [before, after] = [before, after].map(|chunk| chunk.placing().expect("at rest"));
    move |number, at| {
        let [old, new] = [&before, &after].map(|members| members[number].arrays.as_ref()?[at].clone());
        let (old, new) = (old?, new?);
        let (size, mut bits) = (old.element().size(), vec![0_u32; old.len().div_ceil(32)]);
        let elements = old.view().bytes().chunks(size).zip(new.view().bytes().chunks(size)).enumerate();
        elements.filter(|(_, (old, new))| old != new).for_each(|(n, _)| bits[n / 32] |= 1 << (n % 32));
        Some(bits)
    }
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
fn a_chunk_that_was_placed_is_placed_anew_where_something_changed() {
    let gpu = open();
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 64 << 10 });
    db.set_live(true);
    db.set_late(true);
    let rest = commit(&mut db, 0);
    let first = commit(&mut db, 1);
    // Few, hostile ones among them; then others, and what was moved is back; then each third.
    let steps = [(1, 3, 41), (1, 2, 67), (1, 3, 3)];
    let later = steps.map(|step| commit_crowds(&mut db, |path, kind| mixed(path, kind, step)));
    let find = |snapshot: &Snapshot, shape: u64| {
        let found = snapshot.world.chunks.iter().find(|chunk| chunk.shape() == shape);
        Arc::clone(found.expect("of this shape"))
    };
    for held in first.world.chunks.iter().filter(|chunk| chunk.is_held()).step_by(5) {
        let (records, boxes) = encoded(&find(&rest, held.shape()));
        let tree = build_level(&boxes);
        let mut resident = ResidentChunk::new(&gpu, &records, &tree.nodes);
        let mut before = (Arc::clone(held), resident.place(held, |_, _| None));
        for (step, snapshot) in later.iter().enumerate() {
            let chunk = find(snapshot, held.shape());
            // Where nothing is said to have changed nothing is placed.
            let still = resident.place(&chunk, |_, _| None);
            assert!(still.0 == before.1.0 && still.1 == before.1.1, "step {step}");
            assert_eq!((still.2.area, still.2.min, still.2.max), (before.1.2.area, before.1.2.min, before.1.2.max));
            let found = resident.place(&chunk, changes(&before.0, &chunk));
            let expected = placed(&gpu, &chunk, &records, &tree.nodes);
            assert!(found.0 == expected.0, "records of step {step}");
            assert!(found.1 == expected.1, "nodes of step {step}");
            assert_eq!((found.2.min, found.2.max), (expected.2.min, expected.2.max), "step {step}");
            let [area, whole] = [found.2.area, expected.2.area].map(f64::from_bits);
            assert!((area / whole - 1.0).abs() < 1e-12, "step {step}: {area}, {whole}");
            before = (chunk, found);
        }
    }
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
    let (set, set_back) = (upload(&gpu, &[0; 128]), Buffer::new(&gpu, "read", 128, BufferUsage::Readback));
    let set_back = set_back.expect("small");
    let (source, target, changed) = (list.address(), on_device.address(), set.address());
    let push = PlacingPush { source, target, count: 5, words: 3, changed };
    run(&gpu, &scene::SCENE_SCATTER_WORDS, push, groups(5), &[(&on_device, &back), (&set, &set_back)]);
    let mut bits = [0_u32; 32];
    set_back.read(0, bytemuck::cast_slice_mut(&mut bits)).expect("mapped");
    let listed: Vec<usize> = (0..1024).filter(|n| bits[n / 32] >> (n % 32) & 1 == 1).collect();
    assert_eq!(listed, [0, 7, 8, 500, 999], "the set of changed elements");
    let mut found = vec![0_u32; 3000];
    back.read(0, bytemuck::cast_slice_mut(&mut found)).expect("mapped");
    assert_eq!(found, expected);
    close_device(&gpu);
}
