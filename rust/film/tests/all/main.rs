// SPDX-License-Identifier: Apache-2.0
//! Tests of exact sums, of films that merge, and of their files.

#![expect(clippy::cast_possible_truncation, reason = "oracles cut numbers at will")]

#[cfg(test)]
mod blocks;
#[cfg(test)]
mod errors;
#[cfg(test)]
mod exact;
#[cfg(test)]
mod hostile;
#[cfg(test)]
mod merging;
#[cfg(test)]
mod support;
