// SPDX-License-Identifier: Apache-2.0
//! Points as balls, each a hull of two equal balls. Pure.

pub(super) use super::round::{bounds, vertices};
