// SPDX-License-Identifier: Apache-2.0
//! Fault injection into an open device, for tests: plants failures of driver calls and reads the counters of
//! [`crate::device::watch`]. Compiled with the feature `faults` alone.

use crate::device::watch::{DriverMemory, PlantedFailure};
use crate::gpu::Gpu;

impl Gpu {
    /// Makes calls fail. Replaces a failure that was planted before.
    pub fn plant_failure(&self, failure: PlantedFailure) {
        self.device().watch.plant(failure);
    }

    /// Calls that have failed because of a planted failure.
    #[must_use]
    pub fn planted_failures(&self) -> u64 {
        self.device().watch.struck()
    }

    /// Device memory of the driver, as counted at `vkAllocateMemory` and `vkFreeMemory`.
    #[must_use]
    pub fn driver_memory(&self) -> DriverMemory {
        self.device().watch.memory()
    }

    /// Peak of the bytes that the budget has counted, host and device together.
    #[must_use]
    pub fn peak_budgeted_bytes(&self) -> u64 {
        self.device().budget.most()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{GpuError, OpenOptions, enumerate_for, hide_capabilities};

    #[test]
    fn a_missing_capability_is_named() {
        hide_capabilities(Some(|capabilities| {
            (capabilities.scalar_block_layout, capabilities.host_query_reset) = (false, false);
        }));
        let reports = enumerate_for(None).expect("a driver");
        assert!(!reports.is_empty(), "some device");
        for report in &reports {
            assert!(!report.chosen, "{report:?}");
            assert!(report.missing.ends_with(&["scalarBlockLayout", "hostQueryReset"]), "{report:?}");
            assert!(report.why.contains("it lacks") && report.why.contains("scalarBlockLayout, hostQueryReset"));
        }
        let error = Gpu::open(&OpenOptions::default()).expect_err("none can be used");
        for part in [&reports[0].name[..], "lacks", "scalarBlockLayout, hostQueryReset"] {
            assert!(error.to_string().contains(part), "{part}: {error}");
        }
        let named = OpenOptions { selector: Some("0".into()), ..OpenOptions::default() };
        let error = Gpu::open(&named).expect_err("this one neither");
        assert!(matches!(&error, GpuError::MissingCapability { missing, .. } if missing.contains("hostQueryReset")));
        hide_capabilities(None);
        assert!(enumerate_for(None).expect("a driver").iter().any(|report| report.chosen), "with all there is one");
    }
}
