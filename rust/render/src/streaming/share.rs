// SPDX-License-Identifier: Apache-2.0
//! Divides device memory between paths and units: decisions/0029. Pure.
//!
//! Paths in flight fill the device `paths / slots` times, and each fill loads about what does not stay: `units - kept`
//! bytes, several times over. With `room = slots * slot_bytes + kept` that is `paths * (slot_bytes + missing / slots)`,
//! `missing = units - room`, which only falls as slots grow. So paths get a large share, up to what a render has, and
//! units keep what batches of loads need to be resident together. If hardly anything is missing the sum hardly falls,
//! and 2^24 slots were slower than 2^23 with less memory: then paths get what fills a device (see the book,
//! design/residency).

/// Paths may take one part in so many of the room. Neither more nor less was faster (decisions/0029).
const PATHS_SHARE: u64 = 2;
/// Slots that fill a device.
const ENOUGH_SLOTS: u64 = 1 << 22;
/// Beyond these, slots may take so many times the missing bytes.
const WORTH: u64 = 2;
/// Units keep at least so many times the largest one: one is traced while others are loaded.
const UNITS_PER_LARGEST: u64 = 4;
/// The same number if rays read units in host memory, so that none has to be loaded.
const MAPPED_UNITS_PER_LARGEST: u64 = 2;

/// The memory to be shared and its users.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct ShareRequest {
    /// Bytes for paths and units together.
    pub(super) bytes: u64,
    /// Bytes of one path in flight.
    pub(super) slot_bytes: u64,
    /// Bytes of the largest unit with all it needs.
    pub(super) largest_unit: u64,
    /// Bytes of all units.
    pub(super) units: u64,
    /// Most bytes that units may take.
    pub(super) cap: u64,
    /// True if rays read missing units in host memory: more slots then do not reduce loads.
    pub(super) maps: bool,
    /// Paths in flight that the render could use.
    pub(super) wanted: u64,
    /// Fewest paths in flight that are worth it.
    pub(super) fewest: u64,
}

impl ShareRequest {
    /// Slots for paths: a power of two, `fewest` if there is hardly room for anything.
    pub(super) fn slots(self) -> u64 {
        let Self { bytes, slot_bytes, largest_unit, units, cap, maps, wanted, fewest } = self;
        let slot_bytes = slot_bytes.max(1);
        let share = bytes / PATHS_SHARE;
        let few = if maps { MAPPED_UNITS_PER_LARGEST } else { UNITS_PER_LARGEST };
        let beside_few = bytes.saturating_sub(few.saturating_mul(largest_unit));
        let beside_all = bytes.saturating_sub(units.min(cap));
        // The largest unit must always find room.
        let share = share.min(beside_few).max(beside_all);
        let slots = (share / slot_bytes).clamp(1, wanted.max(1));
        let missing = units.saturating_sub(bytes.min(cap));
        let worth = if maps { 0 } else { missing.saturating_mul(WORTH) / slot_bytes };
        let enough = worth.max(ENOUGH_SLOTS);
        (1 << slots.min(enough).ilog2()).max(fewest)
    }
}

/// Bytes of units on the device if the rest of a picture may be traced without streaming: so many of the `left` bytes
/// that, when the `slots` bytes of paths in slots are freed, there is room for `waves` bytes of paths in core, or half
/// of both. The rest of the scene is read in host memory then; a wave that is too small costs more time than that
/// (decisions/0029).
pub(super) fn beside_waves(left: u64, slots: u64, waves: u64) -> u64 {
    let all = left.saturating_add(slots);
    left.min(all.saturating_sub(waves).max(all / 2))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_leave_room_for_the_waves_that_come_after_streaming() {
        assert_eq!(beside_waves(140, 27, 98), 83, "both freed, the waves have room");
        assert_eq!(beside_waves(500, 200, 98), 500, "the slots alone leave enough");
        assert_eq!(beside_waves(60, 20, 98), 40, "half of both, however small");
        assert_eq!(beside_waves(0, 0, 98), 0);
    }

    const ROOM: ShareRequest = ShareRequest {
        bytes: 1 << 30,
        slot_bytes: 256,
        largest_unit: 16 << 20,
        units: 8 << 30,
        cap: u64::MAX,
        maps: false,
        wanted: 1 << 25,
        fewest: 1 << 12,
    };

    #[test]
    fn paths_get_half_of_a_budget_too_small_for_all_units() {
        assert_eq!(ROOM.slots(), 1 << 21, "512 MiB");
        assert_eq!(
            ShareRequest { bytes: (1 << 30) - 1, ..ROOM }.slots(),
            1 << 20,
            "a power of two, never more than the share"
        );
        assert_eq!(ShareRequest { wanted: 1 << 16, ..ROOM }.slots(), 1 << 16, "no more than the render has");
    }

    #[test]
    fn paths_get_all_memory_that_units_leave() {
        assert_eq!(ShareRequest { units: 1 << 28, ..ROOM }.slots(), 1 << 21, "768 MiB beside them");
        assert_eq!(ShareRequest { units: 0, ..ROOM }.slots(), 1 << 22, "no unit");
    }

    #[test]
    fn a_nearly_fitting_scene_still_fills_the_device_with_paths() {
        let large = ShareRequest { bytes: 16 << 30, slot_bytes: 256, ..ROOM };
        assert_eq!(ShareRequest { units: 64 << 30, ..large }.slots(), 1 << 25, "half of the room");
        assert_eq!(ShareRequest { units: 17 << 30, ..large }.slots(), 1 << 23, "a gigabyte is missing");
        assert_eq!(ShareRequest { units: 16 << 30, ..large }.slots(), 1 << 22, "nothing is");
        assert_eq!(ShareRequest { units: 1 << 30, ..large }.slots(), 1 << 22, "all have room");
        assert_eq!(
            ShareRequest { units: 64 << 30, cap: 1 << 30, ..large }.slots(),
            1 << 25,
            "what is capped is missing"
        );
        assert_eq!(ShareRequest { units: 1 << 30, cap: 1 << 28, ..large }.slots(), 1 << 22, "768 MiB are");
    }

    #[test]
    fn room_for_the_largest_units_is_reserved() {
        assert_eq!(ShareRequest { largest_unit: 192 << 20, ..ROOM }.slots(), 1 << 20, "256 MiB beside four of them");
        assert_eq!(ShareRequest { largest_unit: 400 << 20, ..ROOM }.slots(), 1 << 12, "the fewest");
        let mapped = ShareRequest { largest_unit: 400 << 20, maps: true, ..ROOM };
        assert_eq!(mapped.slots(), 1 << 19, "224 MiB beside two of them");
        assert_eq!(ShareRequest { largest_unit: 1 << 30, ..mapped }.slots(), 1 << 12, "the fewest");
        assert_eq!(ShareRequest { bytes: 0, ..ROOM }.slots(), 1 << 12, "allocating tells");
        assert_eq!(ShareRequest { wanted: 0, fewest: 1, ..ROOM }.slots(), 1, "a render of nothing");
    }

    #[test]
    fn more_memory_never_means_fewer_paths() {
        let sizes = (1..4000_u64).map(|at| ShareRequest { bytes: at << 20, ..ROOM });
        for (less, more) in sizes.clone().zip(sizes.skip(1)) {
            assert!(less.slots() <= more.slots(), "{} bytes", less.bytes);
            assert!(less.slots() * less.slot_bytes <= less.bytes.max(1 << 20), "{} bytes", less.bytes);
        }
    }
}
