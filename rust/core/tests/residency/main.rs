// SPDX-License-Identifier: Apache-2.0
//! The residency planner: its guarantees under any demand, its decisions where the answer is known.

#[cfg(test)]
mod decisions;
