// SPDX-License-Identifier: Apache-2.0
//! What tests plant in an open device, and what they ask of its watch ([`crate::watch`]). Compiled with the feature
//! `faults` alone.

use crate::gpu::Gpu;
use crate::watch::{DriverMemory, Failure};

impl Gpu {
    /// Makes calls fail, in place of what was planted before.
    pub fn plant_failure(&self, failure: Failure) {
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
