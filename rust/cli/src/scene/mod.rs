// SPDX-License-Identifier: Apache-2.0
//! The scenes of benches and tests.

pub(crate) mod forest;
pub(crate) mod island;
