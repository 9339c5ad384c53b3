// SPDX-License-Identifier: Apache-2.0
//! Assemblies and chunks in the encoding of the device: records, the tree over them, values of primvars, keys of
//! motion.
//!
//! The result holds no address, so it can be kept and copied to any place on the device. Pure; threads encode stretches
//! of records in parallel, and the one that finishes the last stretch builds the tree.

use super::shapes::LevelShapes;
use super::source::AssetSource;
use super::values::ValueLayout;
use oocpt_abi::{FLIPS_HANDEDNESS, GpuInstance, GpuMotionKey, TARGET_ASSEMBLY, TARGET_MOVING};
use oocpt_core::Aabb;
use oocpt_core::mesh::LevelTree;
use oocpt_core::scene::{InstanceRecord, InstanceTarget, MotionKey};
use std::ops::Range;

/// Records that one thread encodes at a time.
const PART_RECORDS: usize = 4096;
/// Bytes of a record.
pub(super) const RECORD: usize = size_of::<GpuInstance>();

/// Bytes of an asset, and their offset in it.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct EncodedPiece {
    pub(crate) offset: u64,
    pub(crate) bytes: Vec<u8>,
}

/// An assembly or chunk in the encoding of the device.
#[derive(Debug, Default)]
pub(crate) struct EncodedAsset {
    pub(crate) pieces: Vec<EncodedPiece>,
    /// Stack entries that a walk of its tree needs.
    pub(crate) stack: u32,
}

impl EncodedAsset {
    /// Bytes of host memory.
    pub(crate) fn bytes(&self) -> u64 {
        self.pieces.iter().map(|piece| piece.bytes.capacity() as u64).sum()
    }
}

/// An encoded stretch of records.
#[derive(Debug)]
pub(crate) struct EncodedStretch {
    pub(super) first: usize,
    pub(crate) pieces: Vec<EncodedPiece>,
    pub(super) boxes: Vec<Aabb>,
}

/// The stretches that threads may encode in parallel.
pub(crate) fn stretches(source: &AssetSource) -> impl Iterator<Item = Range<usize>> {
    let count = source.records();
    (0..count.max(1)).step_by(PART_RECORDS).map(move |first| first..(first + PART_RECORDS).min(count))
}

/// Encodes records `range` of `source` with their values and keys.
pub(crate) fn encode(source: &AssetSource, range: Range<usize>) -> EncodedStretch {
    let mut boxes = Vec::with_capacity(range.len());
    let mut bytes = vec![0; range.len() * RECORD];
    records(source, range.clone(), &mut bytes, &mut boxes);
    let mut pieces = vec![EncodedPiece { offset: (range.start * RECORD) as u64, bytes }];
    pieces.extend(beside(source, range.clone()));
    EncodedStretch { first: range.start, pieces, boxes }
}

/// The tree over the records of all stretches.
pub(crate) fn tree(source: &AssetSource, stretches: &mut [EncodedStretch], shapes: &LevelShapes) -> LevelTree {
    stretches.sort_unstable_by_key(|stretch| stretch.first);
    let boxes: Vec<Aabb> = stretches.iter_mut().flat_map(|stretch| std::mem::take(&mut stretch.boxes)).collect();
    shapes.tree(source.shape(), &boxes)
}

/// Writes records `range` to `out`, and adds their boxes to `boxes`.
pub(super) fn records(source: &AssetSource, range: Range<usize>, out: &mut [u8], boxes: &mut Vec<Aabb>) {
    let (keys_at, mut key) = (source.keys_at(), source.keys_before(range.start));
    let mut out = out.chunks_exact_mut(RECORD);
    source.encode_each(range, |_, record| {
        let mut instance = instance(record);
        if record.keys != 0 {
            // A target beyond 2^30 is rejected before it is encoded.
            let at = keys_at / 16 + (key * size_of::<GpuMotionKey>() / 16) as u64;
            instance.target |= TARGET_MOVING;
            instance.object_from_parent = [[0.0; 4]; 3];
            let words = [u32::try_from(at).unwrap_or(0), record.keys];
            instance.object_from_parent[0][..2].copy_from_slice(&words.map(f32::from_bits));
            key += record.keys as usize;
        }
        if let Some(bytes) = out.next() {
            bytes.copy_from_slice(bytemuck::bytes_of(&instance));
        }
        boxes.push(Aabb { min: record.bounds[0], max: record.bounds[1] });
    });
}

/// The values and keys of records.
pub(super) fn beside(source: &AssetSource, range: Range<usize>) -> Vec<EncodedPiece> {
    let mut pieces = Vec::new();
    values(source, range.clone(), &mut pieces);
    pieces.extend(keys(source, range));
    pieces
}

/// The values of records; the first stretch also has the table's entries.
fn values(source: &AssetSource, range: Range<usize>, pieces: &mut Vec<EncodedPiece>) {
    let layout = ValueLayout::new(source.columns(), source.records());
    let table = source.values_at();
    if range.start == 0 && !layout.columns.is_empty() {
        pieces.push(EncodedPiece { offset: table, bytes: bytemuck::cast_slice(&layout.entries()).to_vec() });
    }
    for (column, at) in &layout.columns {
        let width = column.width as usize;
        let mut values = vec![0.0_f32; range.len() * width];
        source.encode_values(*column, range.clone(), &mut values);
        let offset = table + at + (range.start * 4 * width) as u64;
        pieces.push(EncodedPiece { offset, bytes: bytemuck::cast_slice(&values).to_vec() });
    }
}

/// The keys of the records that move.
fn keys(source: &AssetSource, range: Range<usize>) -> Option<EncodedPiece> {
    let first = source.keys_before(range.start);
    let mut bytes = Vec::new();
    source.encode_keys(range, |of_record| {
        of_record.iter().for_each(|key| bytes.extend_from_slice(bytemuck::bytes_of(&motion_key(key))));
    });
    let offset = source.keys_at() + (first * size_of::<GpuMotionKey>()) as u64;
    (!bytes.is_empty()).then_some(EncodedPiece { offset, bytes })
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
pub(crate) fn motion_key(key: &MotionKey) -> GpuMotionKey {
    let [xx, xy, xz, _, yy, yz, _, _, zz] = key.stretch.to_cols_array().map(|v| v as f32);
    let half_angle = key.half_angle as f32;
    GpuMotionKey {
        translation: key.translation.as_vec3().to_array(),
        time: key.time,
        rotation: key.rotation.as_quat().to_array(),
        stretch: [xx, yy, zz],
        // Below this angle its sine equals it, and quotients of the two are not finite.
        half_angle: if half_angle > 1e-6 { half_angle } else { 0.0 },
        shear: [xy, xz, yz],
        pad: 0,
    }
}

fn instance(record: &InstanceRecord) -> GpuInstance {
    let flip = if record.flips_handedness { FLIPS_HANDEDNESS } else { 0 };
    GpuInstance {
        object_from_parent: record.object_from_parent,
        target: match record.target {
            InstanceTarget::Mesh(index) => index,
            InstanceTarget::Assembly(index) => index | TARGET_ASSEMBLY,
        },
        prim_id: record.prim_id,
        index_in_prototype: record.index_in_prototype,
        prototype_count: record.prototype_count | flip,
    }
}
