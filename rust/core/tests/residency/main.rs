// SPDX-License-Identifier: Apache-2.0
//! The residency planner: its guarantees under any demand, its decisions where the answer is known, and the policies on
//! a simulated device.

#[cfg(test)]
mod decisions;
#[cfg(test)]
mod guarantees;
#[cfg(test)]
mod mapped;
#[cfg(test)]
mod progress;
#[cfg(test)]
mod simulated;
#[cfg(test)]
mod witness;
