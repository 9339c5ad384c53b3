// SPDX-License-Identifier: Apache-2.0
//! Arrays of instancers on the device, as the host lends them. An array that replaces another one of its length is
//! compared with it, and what differs is sent: few elements as a list that a pass scatters, with a set of them
//! (`shaders/scene/scatter_words.comp`), else all of it. Render thread only; threads of the pool compare and copy.

use super::copied::CopiedAssets;
use super::encode::AssetCopier;
use crate::device::Device;
use crate::error::RenderError;
use oocpt_abi::ALL_CHANGED;
use oocpt_core::array::TypedArray;
use oocpt_core::partition::{ArrayChanges, MemberPlacing};
use oocpt_gpu::HeapRange;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Elements compared at a time.
const BLOCK: usize = 1 << 12;
/// Listed elements that a thread reads at a time.
const LISTED: usize = 1 << 10;
/// An array of which more than one element in so many changed is sent whole.
const FEW: usize = 8;
/// Bytes that a thread sends at a time.
const SENT_BYTES: usize = 4 << 20;
const ALIGN: u64 = 256;

/// Copies to the device. Large ones are made by all threads.
pub(super) struct SentBytes<'a> {
    device: &'a Device,
    copier: AssetCopier<'a>,
    copied: CopiedAssets,
}

impl<'a> SentBytes<'a> {
    pub(super) fn new(device: &'a Device) -> Result<Self, RenderError> {
        let copier = AssetCopier::new(&device.gpu, device.loader()?.ring());
        Ok(Self { device, copier, copied: CopiedAssets::default() })
    }

    /// Begins to copy `bytes` to the start of `target`.
    pub(super) fn send(&mut self, target: &HeapRange, bytes: &[u8]) -> Result<(), RenderError> {
        if bytes.len() <= SENT_BYTES {
            return self.copier.bytes(target, 0, bytes);
        }
        // Other threads may wait for the staging memory of copies in hand.
        self.copier.submit()?;
        let (gpu, ring) = (&self.device.gpu, self.device.loader()?.ring());
        let parts = bytes.par_chunks(SENT_BYTES).enumerate().map(|(part, bytes)| {
            let mut copier = AssetCopier::new(gpu, ring);
            copier.bytes(target, (part * SENT_BYTES) as u64, bytes)?;
            copier.finish()
        });
        for copied in parts.collect::<Result<Vec<_>, RenderError>>()? {
            self.copied.submissions.extend(copied.submissions);
            self.copied.bytes += copied.bytes;
        }
        Ok(())
    }

    /// A new range that is to hold `bytes`.
    pub(super) fn range(&mut self, name: &str, bytes: &[u8]) -> Result<HeapRange, RenderError> {
        let range = self.device.heap.alloc(name, (bytes.len() as u64).max(16), ALIGN)?;
        self.send(&range, bytes)?;
        Ok(range)
    }

    /// Submits the rest; returns all submissions, and the bytes.
    pub(super) fn finish(self) -> Result<CopiedAssets, RenderError> {
        let CopiedAssets { submissions, bytes, .. } = self.copier.finish()?;
        let mut copied = self.copied;
        copied.submissions.extend(submissions);
        copied.bytes += bytes;
        Ok(copied)
    }
}

/// Arrays, each listed once.
#[derive(Debug, Default)]
pub(super) struct ArrayList {
    arrays: Vec<TypedArray>,
    known: FxHashSet<(usize, usize)>,
    /// By the identity of an array which one it is of an instancer, and what the commit found to differ in these.
    changes: FxHashMap<(usize, usize), (usize, ArrayChanges)>,
}

impl ArrayList {
    pub(super) fn add<'a>(&mut self, arrays: impl Iterator<Item = &'a TypedArray>) {
        let new = arrays.filter(|array| self.known.insert(array.identity()));
        self.arrays.extend(new.cloned());
    }

    /// Adds the arrays of a member, with what is known to differ in them.
    pub(super) fn add_member(&mut self, member: &MemberPlacing) {
        let arrays = member.arrays.iter().flatten().enumerate();
        for (at, array) in arrays.filter_map(|(at, array)| Some((at, array.as_ref()?))) {
            if self.known.insert(array.identity()) {
                self.arrays.push(array.clone());
                let changes = member.changes.as_ref().map(|changes| (array.identity(), (at, changes.clone())));
                self.changes.extend(changes);
            }
        }
    }

    /// Number and words of each element of `array` that differs from `old`; `None` if these are many.
    fn changed(&self, old: &TypedArray, array: &TypedArray) -> Option<Vec<u32>> {
        let size = array.element().size();
        let [before, after] = [old, array].map(|array| array.view());
        let (before, after) = (before.bytes(), after.bytes());
        let known = self.changes.get(&array.identity());
        match known.filter(|(at, changes)| changes.are_since(*at, old)) {
            Some((_, changes)) => Some(among(&changes.listed(array.len() / FEW)?, before, after, size)),
            None => changed(before, after, size),
        }
    }
}

/// Elements of an array on the device that are to be replaced.
#[derive(Debug)]
pub(super) struct ScatteredWords {
    /// Of each its number and its words.
    pub(super) entries: HeapRange,
    pub(super) target: u64,
    /// One bit for each element of the array, to be set for those that are replaced.
    pub(super) changed: HeapRange,
    pub(super) count: u32,
    pub(super) words: u32,
}

#[derive(Debug)]
struct LentArray {
    /// It is held, so that its identity is that of no other array.
    array: TypedArray,
    memory: HeapRange,
    /// What differs from before it was brought last, as [`oocpt_abi::GpuChunkMember::changed`].
    changed: u64,
}

/// Arrays on the device.
#[derive(Debug, Default)]
pub(super) struct LentArrays {
    arrays: Vec<LentArray>,
    /// Addresses by the identity of the array.
    addresses: FxHashMap<(usize, usize), [u64; 2]>,
}

impl LentArrays {
    /// Bytes of device memory held.
    pub(super) fn bytes(&self) -> u64 {
        self.arrays.iter().map(|array| array.memory.size()).sum()
    }

    /// The address of an array, and what changed in it when it was brought last; zeros without one, or if it is not
    /// there.
    pub(super) fn find(&self, wanted: Option<&TypedArray>) -> [u64; 2] {
        wanted.and_then(|wanted| self.addresses.get(&wanted.identity())).copied().unwrap_or_default()
    }

    /// Brings all of `wanted`, in place of arrays that are not among `live`; frees the others of these. Elements to be
    /// scattered are added to `scattered`.
    pub(super) fn bring(
        &mut self,
        [wanted, live]: [&ArrayList; 2],
        sent: &mut SentBytes<'_>,
        scattered: &mut Vec<ScatteredWords>,
    ) -> Result<(), RenderError> {
        let is_live = |known: &LentArray| live.known.contains(&known.array.identity());
        let (mut kept, mut stale): (Vec<_>, Vec<_>) = std::mem::take(&mut self.arrays).into_iter().partition(is_live);
        kept.iter_mut().for_each(|known| known.changed = 0);
        self.addresses = kept.iter().map(LentArray::address).collect();
        self.arrays = kept;
        for array in &wanted.arrays {
            if self.find(Some(array))[0] != 0 {
                continue;
            }
            let fits = |known: &LentArray| known.array.element() == array.element() && known.array.len() == array.len();
            let (memory, changed) = match stale.iter().position(fits).map(|at| stale.remove(at)) {
                Some(LentArray { array: old, memory, .. }) => {
                    let changed = match wanted.changed(&old, array) {
                        Some(entries) if entries.is_empty() => 0,
                        Some(entries) => {
                            let words = ScatteredWords::new(sent, &memory, array, &entries)?;
                            let address = words.changed.address();
                            scattered.push(words);
                            address
                        }
                        None => {
                            sent.send(&memory, array.view().bytes())?;
                            u64::from(ALL_CHANGED)
                        }
                    };
                    // Freeing a large array takes milliseconds; the render thread does not wait for it.
                    rayon::spawn(move || drop(old));
                    (memory, changed)
                }
                None => (sent.range("array of instances", array.view().bytes())?, u64::from(ALL_CHANGED)),
            };
            let known = LentArray { array: array.clone(), memory, changed };
            self.addresses.extend([known.address()]);
            self.arrays.push(known);
        }
        Ok(())
    }
}

impl LentArray {
    fn address(&self) -> ((usize, usize), [u64; 2]) {
        (self.array.identity(), [self.memory.address(), self.changed])
    }
}

impl ScatteredWords {
    /// Number and words of elements of `array`, to be written to `target`.
    fn new(
        sent: &mut SentBytes<'_>,
        target: &HeapRange,
        array: &TypedArray,
        entries: &[u32],
    ) -> Result<Self, RenderError> {
        let words = array.element().size() / size_of::<u32>();
        let count = entries.len() / (words + 1);
        let set_bytes = (array.len().div_ceil(32).max(1) * size_of::<u32>()) as u64;
        Ok(Self {
            changed: sent.device.heap.alloc("set of changed elements", set_bytes, ALIGN)?,
            entries: sent.range("changed elements", bytemuck::cast_slice(entries))?,
            target: target.address(),
            // Arrays have fewer elements than 2^32.
            count: u32::try_from(count).unwrap_or(u32::MAX),
            words: u32::try_from(words).unwrap_or(0),
        })
    }
}

/// Number and words of those of the elements `numbers` that differ.
fn among(numbers: &[usize], old: &[u8], new: &[u8], size: usize) -> Vec<u32> {
    let of_some = |numbers: &[usize]| {
        let mut entries = Vec::with_capacity(numbers.len() * (size / 4 + 1));
        for &number in numbers {
            let [old, new] = [old, new].map(|bytes| bytes.get(number * size..(number + 1) * size));
            if let Some(new) = new.filter(|_| old != new) {
                entries.push(u32::try_from(number).unwrap_or(u32::MAX));
                entries.extend(new.chunks_exact(4).map(bytemuck::pod_read_unaligned::<u32>));
            }
        }
        entries
    };
    // The elements are far apart in memory: several threads hide the latency of the reads.
    numbers.par_chunks(LISTED).map(of_some).collect::<Vec<_>>().concat()
}

/// Number and words of each element of `size` bytes, a multiple of 4, that differs; `None` if these are many.
fn changed(old: &[u8], new: &[u8], size: usize) -> Option<Vec<u32>> {
    let most = new.len() / size / FEW;
    let found = AtomicUsize::new(0);
    let blocks = old.par_chunks(BLOCK * size).zip(new.par_chunks(BLOCK * size)).enumerate();
    let of_block = |(block, (old, new)): (usize, (&[u8], &[u8]))| {
        let mut entries = Vec::new();
        if old != new && found.load(Ordering::Relaxed) <= most {
            let elements = old.chunks_exact(size).zip(new.chunks_exact(size)).enumerate();
            for (at, (_, new)) in elements.filter(|(_, (old, new))| old != new) {
                entries.push(u32::try_from(block * BLOCK + at).unwrap_or(u32::MAX));
                entries.extend(new.chunks_exact(4).map(bytemuck::pod_read_unaligned::<u32>));
            }
            found.fetch_add(entries.len() / (size / 4 + 1), Ordering::Relaxed);
        }
        entries
    };
    let entries: Vec<Vec<u32>> = blocks.map(of_block).collect();
    (found.into_inner() <= most).then(|| entries.concat())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_changed_elements_are_listed_and_many_are_not() {
        let old: Vec<u8> = (0..3 * BLOCK * 12).map(|at| u8::try_from(at % 251).expect("small")).collect();
        assert_eq!(changed(&old, &old, 12), Some(Vec::new()));
        let mut new = old.clone();
        for element in [0, 7, BLOCK, 3 * BLOCK - 1] {
            new[element * 12 + 11] ^= 1;
        }
        let entries = changed(&old, &new, 12).expect("few");
        let listed: Vec<u32> = entries.chunks(4).map(|entry| entry[0]).collect();
        assert_eq!(listed, [0, 7, BLOCK, 3 * BLOCK - 1].map(|at| u32::try_from(at).expect("small")));
        let words: Vec<u8> = entries[1..4].iter().flat_map(|word| word.to_ne_bytes()).collect();
        assert_eq!(words, new[..12], "with its words");
        let known = [0, 3, 7, BLOCK, BLOCK + 1, 3 * BLOCK - 1, 3 * BLOCK];
        assert_eq!(among(&known, &old, &new, 12), entries, "of those that are known to differ, at most");
        new.iter_mut().step_by(12 * FEW).for_each(|byte| *byte = byte.wrapping_add(1));
        assert!(changed(&old, &new, 12).is_none(), "more than an eighth");
    }
}
