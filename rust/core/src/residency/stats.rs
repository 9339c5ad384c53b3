// SPDX-License-Identifier: Apache-2.0
//! Counters of the planner: loads, repeated loads, evictions, failures.

use serde::{Deserialize, Serialize};

/// Totals since the planner was made. Units that were kept from before do not count as loads.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ResidencyStats {
    /// Number of units whose load completed.
    pub loads: u64,
    /// Part of `loads`: units that had been resident before.
    pub reloads: u64,
    /// Of `loads`, units that no ray waited for when the load began.
    pub prefetches: u64,
    /// Number of units evicted.
    pub evictions: u64,
    /// Number of loads that failed for lack of memory.
    pub failed_loads: u64,
    /// Failures since the last load that completed. Many of them with nothing resident mean that the device has less
    /// memory than one unit.
    pub failures_in_a_row: u64,
    /// Bytes of completed loads.
    pub bytes_loaded: u64,
    /// Of these, bytes of assets that had been on the device before.
    pub bytes_reloaded: u64,
    /// Bytes of assets that are loading or resident now.
    pub bytes_held: u64,
    /// Maximum of `bytes_held` so far.
    pub peak_bytes: u64,
    /// Bytes of loads in flight now.
    pub bytes_in_flight: u64,
    /// Number of units that are usable now.
    pub resident_units: u64,
    /// Number of units that were resident at least once.
    pub units_touched: u64,
    /// Number of steps planned.
    pub steps: u64,
}
