// SPDX-License-Identifier: Apache-2.0
//! The two lanes of work, and which Vulkan queue serves each.
//!
//! The main lane computes, the transfer lane only copies. Each has a timeline of its own. Where the device has no queue
//! to spare both submit to the same one, in the order of submission; everything else is the same. The choice is pure.
//! Any thread.

use ash::vk;

/// Number of lanes.
pub(crate) const LANES: usize = 2;

/// Where a command list runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum QueueLane {
    /// Computes and copies.
    Main,
    /// Copies, fills and updates.
    Transfer,
}

impl QueueLane {
    pub(crate) const ALL: [Self; LANES] = [Self::Main, Self::Transfer];

    pub(crate) fn index(self) -> usize {
        match self {
            Self::Main => 0,
            Self::Transfer => 1,
        }
    }
}

/// A timeline value of each lane. The derived order is for maps only; see [`TimelinePoints::reached_by`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct TimelinePoints(pub(crate) [u64; LANES]);

impl TimelinePoints {
    /// Before the first submission.
    pub(crate) const START: Self = Self([0; LANES]);
    /// After everything, as on a lost device.
    pub(crate) const END: Self = Self([u64::MAX; LANES]);

    pub(crate) fn of(self, lane: QueueLane) -> u64 {
        self.0[lane.index()]
    }

    /// Whether both lanes have come as far as this.
    pub(crate) fn reached_by(self, completed: Self) -> bool {
        self.0.iter().zip(completed.0).all(|(&point, completed)| point <= completed)
    }

    /// The later of both, lane by lane.
    pub(crate) fn later(mut self, other: Self) -> Self {
        for lane in QueueLane::ALL {
            self.raise(lane, other.of(lane));
        }
        self
    }

    /// Raises one lane to at least `value`.
    pub(crate) fn raise(&mut self, lane: QueueLane, value: u64) {
        let point = &mut self.0[lane.index()];
        *point = value.max(*point);
    }
}

/// One queue of one family.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct QueueChoice {
    pub(crate) family: u32,
    /// Number of the queue in its family.
    pub(crate) index: u32,
    /// Valid bits of its timestamps; 0 = none.
    pub(crate) timestamp_bits: u32,
    /// The family computes: all stages of ours are allowed, and debug labels.
    pub(crate) computes: bool,
}

/// The queue of each lane; the same one twice when there is none to spare.
pub(crate) type QueueChoices = [QueueChoice; LANES];

/// Main: the first family that computes. Transfer: a family made for transfers, else a second queue beside the main
/// one.
pub(crate) fn choose_queues(families: &[vk::QueueFamilyProperties]) -> Option<QueueChoices> {
    let choice = |family: u32, index, found: &vk::QueueFamilyProperties| QueueChoice {
        family,
        index,
        timestamp_bits: found.timestamp_valid_bits,
        computes: found.queue_flags.contains(vk::QueueFlags::COMPUTE),
    };
    let numbered = || (0_u32..).zip(families).filter(|(_, family)| family.queue_count > 0);
    let (main, found) = numbered().find(|(_, family)| family.queue_flags.contains(vk::QueueFlags::COMPUTE))?;
    // Video and optical flow engines can copy too, but slowly: only pure copy engines are wanted.
    let extras = vk::QueueFlags::SPARSE_BINDING | vk::QueueFlags::PROTECTED;
    let copies = |family: &vk::QueueFamilyProperties| {
        let flags = family.queue_flags;
        flags.contains(vk::QueueFlags::TRANSFER) && (vk::QueueFlags::TRANSFER | extras).contains(flags)
    };
    let transfer = match numbered().find(|(_, family)| copies(family)) {
        Some((family, found)) => choice(family, 0, found),
        None => choice(main, u32::from(found.queue_count > 1), found),
    };
    Some([choice(main, 0, found), transfer])
}

#[cfg(test)]
mod tests {
    use super::*;

    type F = vk::QueueFlags;

    fn families(list: &[(F, u32)]) -> Vec<vk::QueueFamilyProperties> {
        let family = |&(queue_flags, queue_count): &(F, u32)| vk::QueueFamilyProperties {
            queue_flags,
            queue_count,
            timestamp_valid_bits: 64,
            ..vk::QueueFamilyProperties::default()
        };
        list.iter().map(family).collect()
    }

    fn chosen(list: &[(F, u32)]) -> Option<[(u32, u32); LANES]> {
        choose_queues(&families(list)).map(|choices| choices.map(|choice| (choice.family, choice.index)))
    }

    #[test]
    fn transfers_go_to_a_copy_engine_if_there_is_one() {
        let all = F::GRAPHICS | F::COMPUTE | F::TRANSFER | F::SPARSE_BINDING;
        let video = F::VIDEO_DECODE_KHR | F::TRANSFER;
        let copy = F::TRANSFER | F::SPARSE_BINDING;
        let large = [(all, 16), (video, 1), (copy, 2), (F::COMPUTE | F::TRANSFER, 8)];
        assert_eq!(chosen(&large), Some([(0, 0), (2, 0)]), "not the video engine");
        assert_eq!(chosen(&[(F::GRAPHICS, 1), (all, 2)]), Some([(1, 0), (1, 1)]), "the second queue of the family");
        assert_eq!(chosen(&[(all, 1)]), Some([(0, 0), (0, 0)]), "one queue for both");
        assert_eq!(chosen(&[(all, 1), (copy, 0)]), Some([(0, 0), (0, 0)]), "an empty family has no queue");
        assert_eq!(chosen(&[(copy, 1)]), None, "nothing computes");
    }

    #[test]
    fn a_timeline_point_is_reached_when_both_queues_are() {
        let point = TimelinePoints([3, 5]);
        assert!(
            point.reached_by(TimelinePoints([3, 5])) && point.reached_by(TimelinePoints::END),
            "there, and past it"
        );
        assert!(
            !point.reached_by(TimelinePoints([9, 4])) && !point.reached_by(TimelinePoints([2, 9])),
            "one lane is not enough"
        );
        assert!(TimelinePoints::START.reached_by(TimelinePoints::START), "nothing to wait for");
        let mut raised = point;
        raised.raise(QueueLane::Transfer, 4);
        raised.raise(QueueLane::Main, 7);
        assert_eq!(raised, TimelinePoints([7, 5]), "never lowered");
        assert_eq!(TimelinePoints([3, 5]).later(TimelinePoints([2, 9])), TimelinePoints([3, 9]), "lane by lane");
        assert_eq!(TimelinePoints([3, 5]).later(TimelinePoints([4, 2])), TimelinePoints([4, 5]), "either one");
    }
}
