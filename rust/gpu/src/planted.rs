// SPDX-License-Identifier: Apache-2.0
//! What tests plant in an open device, and what they ask of its watch ([`crate::device::watch`]). Compiled with the
//! feature `faults` alone.

use crate::device::watch::{DriverMemory, PlantedFailure};
use crate::gpu::Gpu;

impl Gpu {
    /// Makes calls fail, in place of what was planted before.
    pub fn plant_failure(&self, failure: PlantedFailure) {
        self.device().watch.plant(failure);
    }

    /// How many calls failed because a test wanted it.
    #[must_use]
    pub fn failures_struck(&self) -> u64 {
        self.device().watch.struck()
    }

    /// What the driver gave, as counted at its own functions.
    #[must_use]
    pub fn driver_memory(&self) -> DriverMemory {
        self.device().watch.memory()
    }

    /// Most bytes that the budget ever had on its books, of host and device together.
    #[must_use]
    pub fn most_on_the_books(&self) -> u64 {
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
