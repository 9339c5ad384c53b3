// SPDX-License-Identifier: Apache-2.0
//! The number of paths that a scene in core has in flight: the size of its waves, and so most of what a small scene
//! takes of the device. This is the only place that decides it; `oocpt bench forest --in-flight` tries other sizes. The
//! picture does not depend on it. Pure.
//!
//! A wave ends with its longest path, so part of the device idles at its end; larger waves make that rarer
//! (decisions/0029). But a wave takes memory in proportion, which others may want, and one that is larger than what is
//! left to render is of no use. So a wave is
//! - no more than a share of the render ([`WAVES`]): `schedule` begins with small waves and doubles them at most, so a
//!   render of few samples never gets to larger ones, and what it loses at their ends is a few milliseconds;
//! - but as many paths as fill a large device ([`FILLS`]), if the render has so many;
//! - no more than a share of the device's memory ([`DEVICE_SHARE`]), which tells how large it is: a card of 2 GiB is
//!   busy with a tenth of what an H200 needs;
//! - never more than [`MAX_PATHS`].

/// Most paths in flight on a GPU.
const MAX_PATHS: u64 = 1 << 22;
/// Most paths in flight on a processor: more do not trace faster there.
const MAX_PATHS_CPU: u64 = 1 << 17;
/// Least number of waves of a render, as long as each still fills the device.
const WAVES: u64 = 4;
/// Paths that fill a large device: twice the threads that an H200 keeps.
const FILLS: u64 = 1 << 19;
/// Paths take at most one part in so many of a GPU's memory.
const DEVICE_SHARE: u64 = 16;
/// Paths that may be in flight however small the memory of the GPU is.
const MIN_PATHS_GPU: u64 = 1 << 16;
/// Fewest in flight.
pub(crate) const MIN_PATHS: u64 = 1 << 12;
/// A scene counts as fitting a GPU only if it leaves room for waves of this many paths (or of all paths that the render
/// has). Smaller waves leave a GPU idle between them, and a scene that is nearly resident streams faster
/// (decisions/0029).
const ROOMY: u64 = 1 << 19;
/// The same number for a processor.
const ROOMY_CPU: u64 = 1 << 16;

/// The figures that decide the number of paths in flight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct InFlight {
    pub(crate) is_cpu: bool,
    /// Memory of the device, whatever the budget.
    pub(crate) device_bytes: u64,
    /// Paths of the whole render.
    pub(crate) paths: u64,
    /// Bytes of a path in flight.
    pub(crate) path_bytes: u64,
    /// The most that a caller asks for; `None` applies the rules above.
    pub(crate) asked: Option<u32>,
}

impl InFlight {
    /// Paths that waves are to have room for: a power of two.
    pub(crate) fn wanted(self) -> u64 {
        let Self { is_cpu, device_bytes, paths, path_bytes, asked } = self;
        let all = paths.clamp(MIN_PATHS, MAX_PATHS).next_power_of_two();
        if let Some(asked) = asked {
            return all.min(1 << u64::from(asked).clamp(MIN_PATHS, MAX_PATHS).ilog2());
        }
        if is_cpu {
            return all.min(MAX_PATHS_CPU);
        }
        let of_device = (device_bytes / DEVICE_SHARE / path_bytes.max(1)).max(MIN_PATHS_GPU);
        let of_render = (paths / WAVES).max(FILLS).next_power_of_two();
        all.min(of_render).min(1 << of_device.ilog2())
    }

    /// Paths that there has to be room for.
    pub(crate) fn roomy(self) -> u64 {
        let roomy = if self.is_cpu { ROOMY_CPU } else { ROOMY };
        roomy.min(self.wanted()).min(self.paths)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LARGE: InFlight =
        InFlight { is_cpu: false, device_bytes: 140 << 30, paths: 1 << 30, path_bytes: 196, asked: None };

    #[test]
    fn large_renders_get_the_largest_waves() {
        assert_eq!((LARGE.wanted(), LARGE.roomy()), (1 << 22, 1 << 19));
        let picture = InFlight { paths: 1024 * 429 * 64, ..LARGE };
        assert_eq!(picture.wanted(), 1 << 22, "of the benches");
    }

    #[test]
    fn small_renders_get_smaller_waves() {
        let small = InFlight { paths: 256 * 256 * 64, path_bytes: 128, ..LARGE };
        assert_eq!(small.wanted(), 1 << 20, "a quarter of all");
        assert_eq!(InFlight { paths: 1 << 20, ..small }.wanted(), 1 << 19, "as many as fill the device");
        assert_eq!(small.wanted() * small.path_bytes, 128 << 20, "784 MiB it was");
        assert_eq!(InFlight { paths: 5000, ..LARGE }.wanted(), 8192, "all of them");
        assert_eq!(InFlight { paths: 5000, ..LARGE }.roomy(), 5000);
        assert_eq!(InFlight { paths: 0, ..LARGE }.wanted(), 1 << 12, "the fewest");
    }

    #[test]
    fn small_devices_spend_little_memory_on_paths() {
        for (gib, wanted) in [(1, 1 << 18), (2, 1 << 19), (4, 1 << 20), (8, 1 << 21), (16, 1 << 22)] {
            let device = InFlight { device_bytes: gib << 30, ..LARGE };
            assert_eq!(device.wanted(), wanted, "{gib} GiB");
            assert!(device.wanted() * device.path_bytes <= device.device_bytes / 16, "{gib} GiB");
            assert_eq!(device.roomy(), wanted.min(1 << 19), "no more than it is to have");
        }
        assert_eq!(InFlight { device_bytes: 1 << 20, ..LARGE }.wanted(), 1 << 16, "some all the same");
    }

    #[test]
    fn processors_get_few_paths_in_flight() {
        let cpu = InFlight { is_cpu: true, ..LARGE };
        assert_eq!((cpu.wanted(), cpu.roomy()), (1 << 17, 1 << 16));
        assert_eq!(InFlight { device_bytes: 1 << 20, ..cpu }.wanted(), 1 << 17, "its memory is the machine's");
    }

    #[test]
    fn an_explicit_path_count_is_clamped_and_used() {
        let of = |asked| InFlight { asked: Some(asked), ..LARGE }.wanted();
        assert_eq!([of(0), of(5000), of(1 << 20), of(u32::MAX)], [1 << 12, 1 << 12, 1 << 20, 1 << 22]);
        assert_eq!(InFlight { asked: Some(1 << 20), paths: 5000, ..LARGE }.wanted(), 8192, "no more than there are");
    }
}
