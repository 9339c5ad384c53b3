// SPDX-License-Identifier: Apache-2.0
//! Balls, each a hull of two that are the same: what points are made of. Pure.

pub(super) use super::round::{bounds, vertices};
