// SPDX-License-Identifier: Apache-2.0
//! Crash markers: a word of host memory for each lane that its operations stamp, so that the error of a lost device
//! names the last pass.
//!
//! Before each operation, behind the barrier that waits for the one before, a 4-byte fill writes the operation's
//! number; the fill overlaps the operation itself. After a loss the word tells how far the GPU came.

use std::sync::atomic::{AtomicU32, Ordering};

use ash::vk;

use crate::device::raw_buffer::RawBuffer;
use crate::instance::lane::{LANES, QueueLane};

/// Bytes of one lane's word.
const WORD: u64 = 4;
/// Bytes of all words.
pub(crate) const MARKER_BYTES: u64 = WORD * LANES as u64;

/// An operation with its number.
#[derive(Debug)]
pub(crate) struct OperationMark {
    id: u32,
    name: String,
}

/// The stamped words.
#[derive(Debug)]
pub(crate) struct OperationMarkers {
    raw: RawBuffer,
    next: AtomicU32,
}

impl OperationMarkers {
    /// Words in a new mapped buffer of [`MARKER_BYTES`].
    pub(crate) fn new(raw: RawBuffer) -> Self {
        if let Some(mapped) = raw.mapped {
            // SAFETY: at least one word for each lane is mapped, and nothing else uses them yet.
            unsafe { mapped.as_ptr().cast::<[u32; LANES]>().write_volatile([0; LANES]) };
        }
        Self { raw, next: AtomicU32::new(1) }
    }

    /// Records the stamp of an operation called `name`. The caller has just recorded a full barrier.
    pub(crate) fn stamp(
        &self,
        device: &ash::Device,
        lane: QueueLane,
        commands: vk::CommandBuffer,
        name: &str,
    ) -> OperationMark {
        let id = self.next.fetch_add(1, Ordering::Relaxed);
        let offset = WORD * lane.index() as u64;
        // SAFETY: `commands` is recording, and the buffer has TRANSFER_DST usage and a word for each lane.
        unsafe { device.cmd_fill_buffer(commands, self.raw.buffer, offset, WORD, id) };
        OperationMark { id, name: name.to_owned() }
    }

    /// The number that a lane stamped last. Meaningful once the device is lost or idle.
    pub(crate) fn read(&self, lane: QueueLane) -> u32 {
        let Some(mapped) = self.raw.mapped else { return 0 };
        // SAFETY: a word for each lane is mapped and aligned; the device may write them meanwhile, hence volatile.
        let words = unsafe { mapped.as_ptr().cast::<[u32; LANES]>().read_volatile() };
        words[lane.index()]
    }

    /// The buffer, to be destroyed by the device.
    pub(crate) fn into_raw(self) -> RawBuffer {
        self.raw
    }
}

/// What the stamp `id` says about the work in flight, labels with their marks in the order of submission; None when no
/// operation there has this number.
pub(crate) fn describe<'a>(work: impl Iterator<Item = (&'a str, &'a [OperationMark])>, id: u32) -> Option<String> {
    let mut before = None;
    for (label, marks) in work {
        for mark in marks {
            if mark.id == id {
                let finished = before.unwrap_or("an earlier submission");
                return Some(format!("{finished} (then {} of {label} began)", mark.name));
            }
            before = Some(mark.name.as_str());
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marks(list: &[(u32, &str)]) -> Vec<OperationMark> {
        list.iter().map(|&(id, name)| OperationMark { id, name: name.to_owned() }).collect()
    }

    #[test]
    fn the_stamp_names_the_last_finished_pass_and_the_running_one() {
        // Numbers are given while recording, which need not be the order of submission.
        let (first, second) = (marks(&[(7, "generate"), (9, "intersect")]), marks(&[(3, "shade")]));
        let work = || [("wave 1", first.as_slice()), ("wave 2", second.as_slice())].into_iter();
        assert_eq!(describe(work(), 9), Some("generate (then intersect of wave 1 began)".into()), "inside");
        assert_eq!(describe(work(), 3), Some("intersect (then shade of wave 2 began)".into()), "across");
        assert_eq!(
            describe(work(), 7),
            Some("an earlier submission (then generate of wave 1 began)".into()),
            "at the start"
        );
        assert_eq!(describe(work(), 8), None, "unknown number");
    }
}
