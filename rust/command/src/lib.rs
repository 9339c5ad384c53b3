// SPDX-License-Identifier: Apache-2.0
//! What `oocpt` and `oocpt-bench` share: the programs that they start, which end when the command does ([`stop`]), and
//! Hydra hosts among them ([`host`]).
#![forbid(unsafe_code)]

pub mod host;
pub mod stop;
