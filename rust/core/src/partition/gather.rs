// SPDX-License-Identifier: Apache-2.0
//! Items of many members put into one order, by all threads together: items go to buckets first, told by a sample of
//! them (samplesort, see `buckets`), and buckets are sorted side by side. Pure; depends on the items only.

use rayon::prelude::*;

use crate::instancing::item::PlacementItem;

/// Buckets at most.
const BUCKETS: usize = 256;
/// Items looked at for each of them.
const SAMPLES: usize = 32;
/// Items that a task reads.
const TASK: usize = 1 << 16;
/// Fewer are sorted as they are.
const FEW: usize = 1 << 15;

/// Items of a part, and where each goes.
struct BucketTask<'a> {
    items: &'a [PlacementItem],
    buckets: Vec<u8>,
    counts: [u32; BUCKETS],
}

/// The items of all parts, sorted. `most_bytes`: where both they and their copy would take more, parts are appended.
pub(super) fn sorted(mut parts: Vec<Vec<PlacementItem>>, most_bytes: u64) -> Vec<PlacementItem> {
    let total: usize = parts.iter().map(Vec::len).sum();
    if total < FEW || (2 * total * size_of::<PlacementItem>()) as u64 > most_bytes {
        let mut rest = parts.iter_mut();
        let mut items = rest.next().map(std::mem::take).unwrap_or_default();
        items.reserve_exact(total - items.len());
        rest.for_each(|part| items.append(&mut std::mem::take(part)));
        items.par_sort_unstable_by_key(PlacementItem::key);
        return items;
    }
    let splitters = splitters(&parts, total);
    let tasks: Vec<BucketTask<'_>> = parts
        .par_iter()
        .flat_map(|part| part.par_chunks(TASK))
        .map(|items| {
            let mut counts = [0_u32; BUCKETS];
            let bucket = |item: &PlacementItem| {
                let bucket = splitters.partition_point(|first| *first <= item.code()) & (BUCKETS - 1);
                counts[bucket] += 1;
                u8::try_from(bucket).unwrap_or(u8::MAX)
            };
            let buckets = items.iter().map(bucket).collect();
            BucketTask { items, buckets, counts }
        })
        .collect();
    let mut sorted: Vec<PlacementItem> = bytemuck::zeroed_vec(total);
    scatter(&tasks, &mut sorted);
    let lens = (0..BUCKETS).map(|bucket| tasks.iter().map(|task| task.counts[bucket] as usize).sum());
    let mut regions: Vec<&mut [PlacementItem]> = slices(&mut sorted, lens);
    regions.par_iter_mut().with_max_len(1).for_each(|region| region.par_sort_unstable_by_key(PlacementItem::key));
    sorted
}

/// The first code of each bucket but the first one, in order; fewer than [`BUCKETS`].
fn splitters(parts: &[Vec<PlacementItem>], total: usize) -> Vec<u64> {
    let stride = total.div_ceil(BUCKETS * SAMPLES).max(1);
    let mut codes: Vec<u64> =
        parts.iter().flat_map(|part| part.iter().step_by(stride)).map(PlacementItem::code).collect();
    codes.sort_unstable();
    let mut firsts: Vec<u64> = codes.iter().copied().step_by(codes.len().div_ceil(BUCKETS).max(1)).skip(1).collect();
    firsts.dedup();
    firsts.truncate(BUCKETS - 1);
    firsts
}

/// Puts the items of all tasks into place, bucket by bucket.
fn scatter(tasks: &[BucketTask<'_>], out: &mut [PlacementItem]) {
    let lens = (0..BUCKETS).flat_map(|bucket| tasks.iter().map(move |task| task.counts[bucket] as usize));
    let mut slots: Vec<Vec<std::slice::IterMut<'_, PlacementItem>>> =
        tasks.iter().map(|_| Vec::with_capacity(BUCKETS)).collect();
    for (at, slot) in slices(out, lens).into_iter().enumerate() {
        slots[at % tasks.len()].push(slot.iter_mut());
    }
    tasks.par_iter().zip(slots).for_each(|(task, mut slots)| {
        for (item, bucket) in task.items.iter().zip(&task.buckets) {
            if let Some(place) = slots.get_mut(usize::from(*bucket)).and_then(Iterator::next) {
                *place = *item;
            }
        }
    });
}

/// Neighbouring slices of these lengths.
fn slices(mut items: &mut [PlacementItem], lens: impl Iterator<Item = usize>) -> Vec<&mut [PlacementItem]> {
    lens.map(|len| {
        let all = std::mem::take(&mut items);
        let (slice, rest) = all.split_at_mut(len.min(all.len()));
        items = rest;
        slice
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instancing::placement::InstanceFootprint;
    use glam::DVec3;

    /// Parts of items whose codes are `code(k)`.
    fn parts(lens: &[u32], code: impl Fn(u64) -> u64) -> Vec<Vec<PlacementItem>> {
        let footprint = InstanceFootprint { center: DVec3::ZERO, half: DVec3::ONE, spread: 1.0, lever: 0.0 };
        let mut seen = 0;
        let item = |member: u32, rank: u32, seen: &mut u64| {
            let mut item = PlacementItem::new(&footprint, rank);
            *seen += 1;
            item.set_place(code(*seen), member);
            item
        };
        (0..).zip(lens).map(|(member, &len)| (0..len).map(|rank| item(member, rank, &mut seen)).collect()).collect()
    }

    #[test]
    fn items_are_gathered_in_order_for_any_codes() {
        let scattered = |k: u64| k.wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 1;
        let lens = [70_000, 0, 1, 33_333, 5, 65_536];
        let codes: [(&str, &dyn Fn(u64) -> u64); 4] = [
            ("scattered", &scattered),
            ("all at one point", &|_| 5),
            ("half at one point", &|k| if k % 2 == 0 { 77 } else { scattered(k) }),
            ("at the ends", &|k| if k % 3 == 0 { 0 } else { u64::MAX >> 1 }),
        ];
        for (name, code) in codes {
            let mut expected = parts(&lens, code).concat();
            expected.sort_unstable_by_key(PlacementItem::key);
            assert!(sorted(parts(&lens, code), u64::MAX) == expected, "{name}, in buckets");
            assert!(sorted(parts(&lens, code), 0) == expected, "{name}, at once");
        }
        assert!(sorted(Vec::new(), u64::MAX).is_empty());
    }
}
