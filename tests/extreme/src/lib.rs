// SPDX-License-Identifier: Apache-2.0
//! Stiff and extreme cases through the real renderer, each against a closed form or a small path tracer in f64
//! (`tracer`, which shares no code with the renderer), each with a bound. A run gives one [`Table`].
//!
//! A bound that does not hold stays in the table as MISSED, with the error as measured and an explanation, and may not
//! get worse ([`Row::known`]); nothing is dropped and no bound is loosened for it. Every render of every case is looked
//! through for NaN, Inf, errors, hangs.
//!
//! Where: `tests/table.rs` is the test, `oocpt-extreme` the same as a program that runs on any machine with a Vulkan
//! device and no file besides. Both render on the device that `OOCPT_TEST_DEVICE` (the program: `--device`) names.
#![forbid(unsafe_code)]

mod build;
mod cases;
mod lab;
mod shot;
mod table;
mod tracer;

pub use table::{Row, Table};

/// What to run and where.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Device by index or part of its name; empty: the best.
    pub device: String,
    /// Vulkan's validation layer on.
    pub validation: bool,
    /// As many rays as the cases are meant to have, not as many as a software renderer has time for.
    pub full: bool,
    /// Only cases whose name contains this.
    pub filter: Option<String>,
}

/// Runs the cases.
#[must_use]
pub fn run(options: &Options) -> Table {
    let mut lab = lab::Lab::new(options);
    cases::run(&mut lab);
    lab.finish()
}
