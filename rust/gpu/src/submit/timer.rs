// SPDX-License-Identifier: Apache-2.0
//! Timestamps around operations of one command list.
//!
//! Used only when profiling is on. A [`QueryTimer`] belongs to one command list while it is recorded and is read after
//! its submission has finished; the query pools go back to the device when the last holder drops it.

use std::sync::Arc;

use ash::vk;

use crate::device::logical::{LogicalDevice, POOL_QUERIES};
use crate::error::GpuError;

/// A name with the numbers of its two queries.
#[derive(Debug)]
struct TimerEntry {
    name: String,
    begin: u32,
    end: u32,
}

/// Query pools in use by one command list, and what they measure.
#[derive(Debug)]
pub(crate) struct QueryTimer {
    device: Arc<LogicalDevice>,
    /// Valid bits of the queue's timestamps.
    bits: u32,
    pools: Vec<vk::QueryPool>,
    entries: Vec<TimerEntry>,
    used: u32,
}

impl QueryTimer {
    pub(crate) fn new(device: &Arc<LogicalDevice>, bits: u32) -> Self {
        Self { device: Arc::clone(device), bits, pools: Vec::new(), entries: Vec::new(), used: 0 }
    }

    /// Records a timestamp that is taken when all earlier work is done, and returns its number.
    pub(crate) fn stamp(&mut self, commands: vk::CommandBuffer) -> Result<u32, GpuError> {
        let (pool, query) = (self.used / POOL_QUERIES, self.used % POOL_QUERIES);
        if pool as usize == self.pools.len() {
            self.pools.push(self.device.query_pool()?);
        }
        let raw = self.pools[pool as usize];
        // SAFETY: `commands` is recording, the query exists, was reset by the host and is written once; the list's
        // queue family has timestamps (else no Timer is made).
        unsafe {
            self.device.raw.cmd_write_timestamp(commands, vk::PipelineStageFlags::BOTTOM_OF_PIPE, raw, query);
        }
        self.used += 1;
        Ok(self.used - 1)
    }

    /// Adds an entry between two stamps. Entries are reported in the order of their begin.
    pub(crate) fn add(&mut self, name: String, begin: u32, end: u32) {
        self.entries.push(TimerEntry { name, begin, end });
    }

    /// Name and seconds of every entry, in recording order. Call only after the submission has finished.
    pub(crate) fn read(&self) -> Result<Vec<(String, f64)>, GpuError> {
        let mut stamps: Vec<u64> = Vec::new();
        let mut left = self.used as usize;
        for &pool in &self.pools {
            let mut part = vec![0_u64; left.min(POOL_QUERIES as usize)];
            if part.is_empty() {
                break;
            }
            let flags = vk::QueryResultFlags::TYPE_64;
            // SAFETY: the queries were written by a submission that has finished, and `part` holds one u64 for each.
            let result = unsafe { self.device.raw.get_query_pool_results(pool, 0, &mut part, flags) };
            self.device.check("vkGetQueryPoolResults", result)?;
            left -= part.len();
            stamps.append(&mut part);
        }
        let tick_secs = f64::from(self.device.limits.timestamp_period_ns) * 1e-9;
        let mut entries: Vec<_> = self.entries.iter().collect();
        entries.sort_by_key(|entry| entry.begin);
        let secs = |entry: &TimerEntry| {
            let ticks = ticks_between(stamps[entry.begin as usize], stamps[entry.end as usize], self.bits);
            tick_secs * ticks as f64
        };
        Ok(entries.into_iter().map(|entry| (entry.name.clone(), secs(entry))).collect())
    }
}

/// Ticks from `begin` to `end` of a counter with `bits` valid bits, which may have wrapped once.
fn ticks_between(begin: u64, end: u64, bits: u32) -> u64 {
    let mask = if bits >= 64 { u64::MAX } else { (1_u64 << bits) - 1 };
    end.wrapping_sub(begin) & mask
}

impl Drop for QueryTimer {
    fn drop(&mut self) {
        self.device.recycle_query_pools(&mut self.pools);
    }
}

#[cfg(test)]
mod tests {
    use super::ticks_between;

    #[test]
    fn counters_that_wrap_still_give_differences() {
        assert_eq!(ticks_between(10, 25, 64), 15, "plain");
        assert_eq!(ticks_between(0xFFFF_FFF0, 0x10, 32), 0x20, "wrapped at 32 bits");
        assert_eq!(ticks_between(u64::MAX, 1, 64), 2, "wrapped at 64 bits");
    }
}
