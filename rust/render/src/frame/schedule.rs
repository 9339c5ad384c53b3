// SPDX-License-Identifier: Apache-2.0
//! Cuts a render into waves. Pure: sizes and measured times in, ranges of paths out.
//!
//! Path `p` of an image of `n` pixels is sample `p / n` of pixel `p % n`; a wave is a contiguous range of paths. The
//! image does not depend on where the cuts fall, so wave sizes may follow the clock: they aim at a time per wave that
//! is short enough for watchdogs and for pause and stop to take effect at once, and long enough to keep the device
//! busy.

use crate::wave::{Wave, next_boundary};
use oocpt_gpu::DeviceKind;

/// Paths of the first wave, before anything was measured: few enough to be short on the slowest device of its kind
/// (some 10 000 paths a second, a million on a card), and not too few for the fastest. Later waves grow by the measured
/// times.
pub(crate) fn first_wave(kind: DeviceKind) -> u32 {
    match kind {
        DeviceKind::Cpu => 1 << 12,
        DeviceKind::Discrete => 1 << 19,
        _ => 1 << 16,
    }
}

/// Hands out waves until no path is left.
#[derive(Clone, Debug)]
pub(crate) struct WaveSchedule {
    total: u64,
    next: u64,
    size: u32,
    min: u32,
    max: u32,
    target_secs: f64,
    /// The number of pixels, if waves end where the samples of all are a power of two.
    octaves_of: Option<u64>,
    /// Paths that no wave may cross, ascending.
    cuts: Vec<u64>,
}

impl WaveSchedule {
    /// Cuts `total` paths into waves of `start` at first, never more than `max`, aiming at `target_secs` a wave.
    pub(crate) fn new(total: u64, start: u32, max: u32, target_secs: f64) -> Self {
        let min = 4096.min(max);
        Self { total, next: 0, size: start.clamp(min, max), min, max, target_secs, octaves_of: None, cuts: Vec::new() }
    }

    /// Ends waves where the samples of all `pixels` are a power of two.
    pub(crate) fn with_octaves(self, pixels: u64) -> Self {
        Self { octaves_of: Some(pixels), ..self }
    }

    /// Lets the first wave begin at this path.
    pub(crate) fn begin_at(&mut self, path: u64) {
        self.next = path;
    }

    /// Ends waves at these paths too, ascending.
    pub(crate) fn cut_at(&mut self, cuts: Vec<u64>) {
        self.cuts = cuts;
    }

    /// The next wave, or `None` if no path is left, or none before `open`.
    pub(crate) fn next(&mut self, open: u64) -> Option<Wave> {
        let mut left = self.total.min(open).saturating_sub(self.next);
        if let Some(cut) = self.cuts.iter().find(|cut| **cut > self.next) {
            left = left.min(cut - self.next);
        }
        if let Some(pixels) = self.octaves_of {
            left = left.min(next_boundary(self.next, pixels).1 - self.next);
            // The rest is cut into equal parts, so that none is too small for the device.
            left = left.div_ceil(left.div_ceil(u64::from(self.size)).max(1));
        }
        let count = u32::try_from(left.min(u64::from(self.size))).unwrap_or(self.size);
        let wave = Wave { first: self.next, count };
        self.next += u64::from(count);
        (count > 0).then_some(wave)
    }

    /// Adjusts the size of waves to one of `count` paths that took `secs`.
    pub(crate) fn measured(&mut self, count: u32, secs: f64) {
        if count < self.min.min(self.size) || secs.is_nan() || secs <= 0.0 {
            return;
        }
        let ideal = f64::from(count) * self.target_secs / secs;
        // The size changes at most by a factor of two a step: one odd measurement must not make a wave that trips a
        // watchdog.
        let bounded = ideal.clamp(f64::from(self.size) * 0.5, f64::from(self.size) * 2.0);
        let rounded = (bounded / 4096.0).round() * 4096.0;
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to u32 limits here")]
        let size = rounded.clamp(f64::from(self.min), f64::from(self.max)) as u32;
        self.size = size;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waves_cover_every_path_once_in_order() {
        let mut schedule = WaveSchedule::new(100_001, 8192, 1 << 16, 0.05);
        let mut expected = 0;
        let mut odd = false;
        while let Some(wave) = schedule.next(u64::MAX) {
            assert_eq!(wave.first, expected, "waves must be contiguous");
            expected += u64::from(wave.count);
            odd = !odd;
            schedule.measured(wave.count, if odd { 0.01 } else { 1.0 });
        }
        assert_eq!(expected, 100_001, "every path must be in a wave");
    }

    #[test]
    fn waves_end_at_octaves_and_open_limits() {
        let mut schedule = WaveSchedule::new(100_000, 8192, 1 << 16, 0.05).with_octaves(5000);
        let mut ends = Vec::new();
        while let Some(wave) = schedule.next(60_000) {
            ends.push(wave.first + u64::from(wave.count));
        }
        assert_eq!(ends, [5000, 10_000, 15_000, 20_000, 26_667, 33_334, 40_000, 46_667, 53_334, 60_000], "equal parts");
        assert!(schedule.next(u64::MAX).is_some(), "the rest when it is open");
    }

    /// Longest time of a wave, seconds, on a device of so many paths a second; a quarter of that from the 30th wave on.
    fn longest(kind: DeviceKind, rate: f64) -> f64 {
        let mut schedule = WaveSchedule::new(u64::MAX, first_wave(kind), 1 << 22, 0.2);
        let mut longest = 0.0_f64;
        for wave in 0..60 {
            let rate = if wave < 30 { rate } else { rate / 4.0 };
            let count = schedule.next(u64::MAX).expect("endless").count;
            let secs = f64::from(count) / rate;
            schedule.measured(count, secs);
            longest = longest.max(secs);
        }
        longest
    }

    #[test]
    fn waves_stay_short_on_slow_devices() {
        let slowest = [(DeviceKind::Cpu, 1e4), (DeviceKind::Integrated, 1e5), (DeviceKind::Discrete, 1e6)];
        for (kind, rate) in slowest {
            for speed in [1.0, 10.0, 1e3, 1e6] {
                let secs = longest(kind, rate * speed);
                assert!(secs < 2.0, "{kind:?} at {:.0} paths a second: a wave of {secs} s", rate * speed);
            }
        }
    }

    #[test]
    fn wave_sizes_adapt_to_measured_time_within_bounds() {
        let mut schedule = WaveSchedule::new(u64::MAX, 8192, 1 << 16, 0.05);
        for _ in 0..20 {
            let wave = schedule.next(u64::MAX).expect("endless");
            schedule.measured(wave.count, 1e-4);
        }
        assert_eq!(schedule.next(u64::MAX).map(|wave| wave.count), Some(1 << 16), "fast waves must grow to the limit");
        for _ in 0..20 {
            let wave = schedule.next(u64::MAX).expect("endless");
            schedule.measured(wave.count, 10.0);
        }
        assert_eq!(schedule.next(u64::MAX).map(|wave| wave.count), Some(4096), "slow waves must shrink to the minimum");
    }
}
