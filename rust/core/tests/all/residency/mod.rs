// SPDX-License-Identifier: Apache-2.0
//! The residency planner: its guarantees under any demand, its decisions where the answer is known, and the policies on
//! a simulated device.

mod decisions;
mod guarantees;
mod mapped;
mod pairs;
mod policies;
mod progress;
mod simulate;
mod witness;
