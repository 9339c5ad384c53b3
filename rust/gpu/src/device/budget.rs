// SPDX-License-Identifier: Apache-2.0
//! Counts bytes against the hard budget. Pure bookkeeping, no Vulkan.
//!
//! Guarantee: `used <= budget` after every successful `reserve`, whatever threads do; `reserve` comes before the driver
//! is asked, `release` after the driver has freed. Any thread.

use std::sync::{Mutex, MutexGuard, PoisonError};

use crate::error::GpuError;

/// Which count an allocation goes to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MemoryAccount {
    /// Device memory: bounded by the budget.
    Device,
    /// Memory of the host that the device reaches (staging, readback): counted, not bounded.
    Host,
}

/// Memory held by one [`Gpu`](crate::Gpu), in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MemoryUse {
    /// Device memory held now, including what is retired but still in use by the GPU.
    pub used: u64,
    /// Most device memory ever held.
    pub peak: u64,
    /// The hard budget for `used`.
    pub budget: u64,
    /// Host memory held for uploads and readbacks (also when it shares a heap with the device).
    pub host_used: u64,
    /// Number of driver allocations held now.
    pub allocations: u64,
}

#[derive(Debug)]
pub(crate) struct MemoryBudget {
    state: Mutex<BudgetState>,
}

#[derive(Debug, Default)]
struct BudgetState {
    counts: MemoryUse,
    #[cfg(feature = "faults")]
    most: u64,
}

impl MemoryBudget {
    pub(crate) fn new(budget: u64) -> Self {
        let counts = MemoryUse { budget, ..MemoryUse::default() };
        let state = BudgetState {
            counts,
            #[cfg(feature = "faults")]
            most: 0,
        };
        Self { state: Mutex::new(state) }
    }

    fn lock(&self) -> MutexGuard<'_, BudgetState> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn counts(&self) -> MemoryUse {
        self.lock().counts
    }

    /// Sets the bound for later reservations; what is held stays held.
    pub(crate) fn set_budget(&self, budget: u64) {
        self.lock().counts.budget = budget;
    }

    /// Most bytes ever counted, of both accounts together.
    #[cfg(feature = "faults")]
    pub(crate) fn most(&self) -> u64 {
        self.lock().most
    }

    /// Counts `bytes` as held, or refuses and changes nothing.
    pub(crate) fn reserve(&self, name: &str, bytes: u64, account: MemoryAccount) -> Result<(), GpuError> {
        let mut state = self.lock();
        let counts = &mut state.counts;
        match account {
            MemoryAccount::Device => match counts.used.checked_add(bytes).filter(|&total| total <= counts.budget) {
                Some(total) => {
                    counts.used = total;
                    counts.peak = counts.peak.max(total);
                }
                None => return Err(out_of_memory(name, bytes, counts)),
            },
            MemoryAccount::Host => counts.host_used = counts.host_used.saturating_add(bytes),
        }
        counts.allocations += 1;
        #[cfg(feature = "faults")]
        {
            state.most = state.most.max(state.counts.used + state.counts.host_used);
        }
        Ok(())
    }

    /// Takes back a reservation of exactly `bytes`.
    pub(crate) fn release(&self, bytes: u64, account: MemoryAccount) {
        let counts = &mut self.lock().counts;
        match account {
            MemoryAccount::Device => counts.used = counts.used.saturating_sub(bytes),
            MemoryAccount::Host => counts.host_used = counts.host_used.saturating_sub(bytes),
        }
        counts.allocations = counts.allocations.saturating_sub(1);
    }

    /// The error for a request that the driver refused although the budget allowed it.
    pub(crate) fn refused(&self, name: &str, bytes: u64) -> GpuError {
        out_of_memory(name, bytes, &self.counts())
    }
}

fn out_of_memory(name: &str, bytes: u64, counts: &MemoryUse) -> GpuError {
    GpuError::OutOfMemory { name: name.to_owned(), bytes, used: counts.used, budget: counts.budget }
}

/// Nine tenths of what is free: the rest is for the driver, the display and other programs.
pub(crate) fn automatic_budget(free_bytes: u64) -> u64 {
    free_bytes - free_bytes / 10
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn never_above_the_budget() {
        let budget = MemoryBudget::new(100);
        assert!(budget.reserve("a", 60, MemoryAccount::Device).is_ok(), "fits");
        let refused = budget.reserve("b", 41, MemoryAccount::Device);
        let expected = GpuError::OutOfMemory { name: "b".into(), bytes: 41, used: 60, budget: 100 };
        assert_eq!(refused, Err(expected), "one byte too many");
        assert!(budget.reserve("c", 40, MemoryAccount::Device).is_ok(), "exactly full is allowed");
        assert!(budget.reserve("d", u64::MAX, MemoryAccount::Device).is_err(), "no overflow");
        budget.release(60, MemoryAccount::Device);
        let counts = budget.counts();
        assert_eq!((counts.used, counts.peak, counts.allocations), (40, 100, 1), "peak stays");
    }

    #[test]
    fn host_memory_is_counted_but_not_bounded() {
        let budget = MemoryBudget::new(10);
        assert!(budget.reserve("staging", 1000, MemoryAccount::Host).is_ok(), "not bounded");
        assert_eq!((budget.counts().used, budget.counts().host_used), (0, 1000), "counted apart");
    }

    #[test]
    fn lowering_the_budget_below_use_refuses_until_freed() {
        let budget = MemoryBudget::new(100);
        assert!(budget.reserve("a", 80, MemoryAccount::Device).is_ok(), "fits");
        budget.set_budget(50);
        assert!(budget.reserve("b", 1, MemoryAccount::Device).is_err(), "over the new bound");
        budget.release(80, MemoryAccount::Device);
        assert!(budget.reserve("b", 50, MemoryAccount::Device).is_ok(), "fits again");
    }
}
