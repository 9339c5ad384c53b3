// SPDX-License-Identifier: Apache-2.0
//! Generated scenes, made straight into a scene database: a pure function of their parameters, the same on every
//! machine. Benches render them; `oocpt scene` writes the island as USD.
#![forbid(unsafe_code)]

pub mod forest;
pub mod fur;
pub mod generated;
pub mod island;
mod lamps;
pub mod leaves;
pub mod materials;
pub mod pictures;
mod preview;
pub mod woods;
