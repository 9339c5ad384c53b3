// SPDX-License-Identifier: Apache-2.0
//! Which samples a device renders next. Pure.
//!
//! Blocks ascend, and get smaller towards the end (guided self-scheduling, Polychronopoulos and Kuck 1987): from the
//! speeds of their last blocks follows when all devices can end together, given what is left and under way. A device
//! takes three quarters of what it renders until then, and all of it where that takes less than [`LEAST_SECS`]. So
//! devices end together, whatever their speeds, and few blocks are made, each of which drains its device. The first
//! block of a device, whose speed is not known, is an eighth of its share; a device that is alone takes all.

use oocpt_film::SampleRange;

/// Seconds before the end from which on a device takes all of its share.
const LEAST_SECS: f64 = 0.25;
/// Share of what a device is to render that it takes at once.
const SHARE: f64 = 0.75;
/// The same for its first block.
const FIRST_SHARE: f64 = 0.125;
/// Most samples of a first block where time is limited.
const FIRST_IN_TIME: u32 = 4;

/// What a device is to do.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NextBlock {
    /// Render these samples.
    Render(SampleRange),
    /// Ask again once another device has ended a block, or more samples may begin.
    Wait,
    /// Nothing is left.
    Done,
}

#[derive(Clone, Copy, Debug, Default)]
struct QueueDevice {
    /// Samples that it renders, and since when, in seconds.
    under_way: Option<(u32, f64)>,
    /// It takes no more blocks.
    is_out: bool,
    /// Samples a second.
    rate: Option<f64>,
    /// Blocks that it has ended.
    ended: u32,
}

/// The samples of a picture, and who renders them.
#[derive(Clone, Debug)]
pub(super) struct BlockQueue {
    /// Ascending; they do not meet.
    left: Vec<SampleRange>,
    /// Samples from here on wait until the error of those before is known.
    open: u32,
    is_closed: bool,
    devices: Vec<QueueDevice>,
}

impl BlockQueue {
    /// A queue of samples, of which those before `open` may begin, for so many devices.
    pub(super) fn new(left: Vec<SampleRange>, open: u32, devices: usize) -> Self {
        Self { left, open, is_closed: false, devices: vec![QueueDevice::default(); devices] }
    }

    /// What a device does next, at `now` in seconds; so many seconds are `left` until no block may begin.
    pub(super) fn next(&mut self, device: usize, now: f64, left: Option<f64>) -> NextBlock {
        let is_out = self.devices.get(device).is_none_or(|device| device.is_out);
        if self.is_closed || is_out {
            return NextBlock::Done;
        }
        let Some(first) = self.left.first().copied().filter(|range| range.begin < self.open) else {
            let is_busy = self.devices.iter().any(|device| device.under_way.is_some());
            return if is_busy || !self.left.is_empty() { NextBlock::Wait } else { NextBlock::Done };
        };
        let most = first.end.min(self.open) - first.begin;
        let block = SampleRange::new(first.begin, first.begin + self.size(device, now, left).clamp(1, most));
        if block.end == first.end {
            self.left.remove(0);
        } else {
            self.left[0].begin = block.end;
        }
        self.devices[device].under_way = Some((block.samples(), now));
        NextBlock::Render(block)
    }

    /// A device has rendered a block, in so many seconds.
    pub(super) fn done(&mut self, device: usize, block: SampleRange, secs: f64) {
        if let Some(device) = self.devices.get_mut(device) {
            device.under_way = None;
            device.ended += 1;
            device.rate = Some(f64::from(block.samples()) / secs.max(1e-6));
        }
    }

    /// A device gives these samples back, and takes no more.
    pub(super) fn give_back(&mut self, device: usize, samples: &[SampleRange]) {
        if let Some(device) = self.devices.get_mut(device) {
            *device = QueueDevice { is_out: true, ..QueueDevice::default() };
        }
        self.left.extend(samples);
        self.left.sort_unstable();
    }

    /// Lets samples before `open` begin.
    pub(super) fn open(&mut self, open: u32) {
        self.open = self.open.max(open);
    }

    /// No block begins any more.
    pub(super) fn close(&mut self) {
        self.is_closed = true;
    }

    /// Whether no device is rendering, and no sample that may begin is left.
    pub(super) fn is_idle(&self) -> bool {
        let waits = self.left.first().is_some_and(|range| range.begin < self.open);
        !waits && !self.devices.iter().any(|device| device.under_way.is_some())
    }

    /// Whether a device has ended a block, and others, which may go on, less than `blocks`.
    #[cfg(feature = "faults")]
    pub(super) fn is_ahead_of(&self, device: usize, blocks: u32) -> bool {
        let ended = |number: usize| self.devices.get(number).map_or(0, |device| device.ended);
        let others = || (0..self.devices.len()).filter(|other| *other != device);
        ended(device) > 0
            && others().any(|other| !self.devices[other].is_out)
            && others().map(ended).sum::<u32>() < blocks
            && !self.left.is_empty()
    }

    /// Samples of a device's next block.
    fn size(&self, device: usize, now: f64, secs: Option<f64>) -> u32 {
        let open = |range: &SampleRange| range.end.min(self.open).saturating_sub(range.begin);
        let left = f64::from(self.left.iter().map(open).fold(0_u32, u32::saturating_add));
        let living: Vec<QueueDevice> = self.devices.iter().copied().filter(|device| !device.is_out).collect();
        if living.len() < 2 && secs.is_none() {
            return whole(left);
        }
        #[expect(clippy::cast_precision_loss, reason = "a few devices")]
        let devices = living.len().max(1) as f64;
        let Some(rate) = self.devices[device].rate else {
            let first = whole(left * FIRST_SHARE / devices);
            return if secs.is_some() { first.min(FIRST_IN_TIME) } else { first };
        };
        let known: Vec<f64> = living.iter().filter_map(|device| device.rate).collect();
        #[expect(clippy::cast_precision_loss, reason = "a few devices")]
        let mean = known.iter().sum::<f64>() / known.len().max(1) as f64;
        // A device whose speed is not known yet counts as one of the known ones.
        let rate_of = |device: &QueueDevice| device.rate.unwrap_or(mean);
        let rest = |device: &QueueDevice| {
            let rest = |(samples, began): (u32, f64)| f64::from(samples) - rate_of(device) * (now - began);
            device.under_way.map_or(0.0, |block| rest(block).max(0.0))
        };
        let until_end = (left + living.iter().map(rest).sum::<f64>()) / living.iter().map(rate_of).sum::<f64>();
        let share = if until_end > LEAST_SECS { SHARE } else { 1.0 };
        let size = rate * until_end * share;
        whole(secs.map_or(size, |secs| size.min(rate * secs)))
    }
}

/// A number of samples, at least so many.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "saturates")]
fn whole(samples: f64) -> u32 {
    samples.ceil() as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Renders all of `0..samples` on devices of these samples a second, in the order of their clocks; gives the blocks
    /// of each, and when each ended.
    fn simulate(samples: u32, rates: &[f64]) -> (Vec<Vec<SampleRange>>, Vec<f64>) {
        let mut queue = BlockQueue::new(vec![SampleRange::new(0, samples)], u32::MAX, rates.len());
        let mut clocks = vec![0.0_f64; rates.len()];
        let mut under_way: Vec<Option<SampleRange>> = vec![None; rates.len()];
        let mut blocks = vec![Vec::new(); rates.len()];
        loop {
            for device in 0..rates.len() {
                if under_way[device].is_none()
                    && let NextBlock::Render(block) = queue.next(device, clocks[device], None)
                {
                    clocks[device] += f64::from(block.samples()) / rates[device];
                    blocks[device].push(block);
                    under_way[device] = Some(block);
                }
            }
            let busy = (0..rates.len()).filter(|device| under_way[*device].is_some());
            let Some(first) = busy.min_by(|a, b| clocks[*a].total_cmp(&clocks[*b])) else { break };
            let block = under_way[first].take().expect("it is busy");
            queue.done(first, block, f64::from(block.samples()) / rates[first]);
        }
        assert!(queue.is_idle());
        (blocks, clocks)
    }

    fn check(samples: u32, rates: &[f64], slack: f64, most_blocks: usize) {
        let (blocks, clocks) = simulate(samples, rates);
        let mut all: Vec<SampleRange> = blocks.iter().flatten().copied().collect();
        all.sort_unstable();
        let mut next = 0;
        for block in all {
            assert_eq!((block.begin, block.samples() > 0), (next, true), "{rates:?}: each sample once");
            next = block.end;
        }
        assert_eq!(next, samples, "{rates:?}: all of them");
        let ideal = f64::from(samples) / rates.iter().sum::<f64>();
        let last = clocks.iter().copied().fold(0.0, f64::max);
        assert!(last < ideal * slack, "{rates:?}: {last} s where {ideal} s are possible");
        let longest = blocks.iter().map(Vec::len).max().unwrap_or(0);
        assert!(longest <= most_blocks, "{rates:?}: {longest} blocks of a device");
    }

    #[test]
    fn devices_end_together_after_few_blocks() {
        check(1024, &[340.0, 340.0], 1.02, 6);
        check(256, &[36.0, 36.0], 1.05, 6);
        check(1024, &[300.0, 100.0], 1.05, 8);
        check(4096, &[100.0, 90.0, 110.0, 95.0], 1.03, 10);
        check(64, &[1.0, 40.0], 2.7, 10); // its share before its speed is known takes 4 s
        check(1, &[5.0, 5.0], 2.1, 1);
    }

    #[test]
    fn a_device_keeps_a_part_of_its_share_for_when_it_slows_down() {
        let range = SampleRange::new;
        let mut queue = BlockQueue::new(vec![range(0, 1024)], u32::MAX, 2);
        for device in 0..2 {
            let NextBlock::Render(block) = queue.next(device, 0.0, None) else { panic!("all is left") };
            queue.done(device, block, f64::from(block.samples()) / 100.0);
        }
        // 900 samples are left, half of them for each.
        assert_eq!(queue.next(0, 1.0, None), NextBlock::Render(range(124, 462)), "three quarters of its half");
        let mut late = BlockQueue::new(vec![range(0, 1000)], u32::MAX, 1);
        assert_eq!(late.next(0, 0.0, Some(10.0)), NextBlock::Render(range(0, 4)), "few while its speed is not known");
    }

    #[test]
    fn samples_that_are_given_back_are_rendered_first_and_by_others() {
        let range = SampleRange::new;
        let mut queue = BlockQueue::new(vec![range(0, 64)], u32::MAX, 2);
        assert_eq!(queue.next(0, 0.0, None), NextBlock::Render(range(0, 4)), "an eighth of a half");
        assert_eq!(queue.next(1, 0.0, None), NextBlock::Render(range(4, 8)));
        queue.give_back(0, &[range(1, 4)]);
        assert_eq!(queue.next(0, 0.0, None), NextBlock::Done, "it is out");
        queue.done(1, range(4, 8), 1.0);
        assert_eq!(queue.next(1, 0.0, None), NextBlock::Render(range(1, 4)), "what is missing, and no more");
        queue.done(1, range(1, 4), 1.0);
        assert_eq!(queue.next(1, 0.0, None), NextBlock::Render(range(8, 64)), "alone it takes what is left");
        queue.give_back(1, &[range(8, 64)]);
        assert_eq!(
            (queue.next(1, 0.0, None), queue.is_idle()),
            (NextBlock::Done, false),
            "nobody is left, and samples are"
        );
    }

    #[test]
    fn a_device_waits_for_what_another_may_give_back() {
        let range = SampleRange::new;
        let mut queue = BlockQueue::new(vec![range(3, 5)], u32::MAX, 2);
        assert_eq!(queue.next(0, 0.0, None), NextBlock::Render(range(3, 4)));
        assert_eq!(queue.next(1, 0.0, None), NextBlock::Render(range(4, 5)));
        queue.done(0, range(3, 4), 1.0);
        assert_eq!(queue.next(0, 0.0, None), NextBlock::Wait, "the other one may fail");
        queue.done(1, range(4, 5), 1.0);
        assert_eq!((queue.next(0, 0.0, None), queue.is_idle()), (NextBlock::Done, true));
    }

    #[test]
    fn samples_beyond_an_octave_wait_for_its_error_and_none_begins_late() {
        let range = SampleRange::new;
        let mut queue = BlockQueue::new(vec![range(0, 1000)], 16, 1);
        let mut next = 0;
        while let NextBlock::Render(block) = queue.next(0, 0.0, Some(10.0)) {
            assert!(block.begin == next && block.end <= 16 && block.samples() <= 4, "{block}");
            queue.done(0, block, f64::from(block.samples()) / 0.3);
            next = block.end;
        }
        assert_eq!(
            (next, queue.next(0, 0.0, None), queue.is_idle()),
            (16, NextBlock::Wait, true),
            "until it is decided"
        );
        queue.open(32);
        assert_eq!(queue.next(0, 0.0, Some(10.0)), NextBlock::Render(range(16, 19)), "as many as the time allows");
        queue.close();
        assert_eq!(queue.next(0, 0.0, None), NextBlock::Done);
    }
}
