// SPDX-License-Identifier: Apache-2.0
//! What `oocpt` and `oocpt-bench` share: the programs that they start, which end when the command does ([`stop`]), and
//! Hydra hosts among them ([`host`]).
#![forbid(unsafe_code)]

pub mod host;
pub mod stop;

use anyhow::Result;

/// Runs a command line: sends what `OOCPT_LOG` selects to standard error, and ends the programs that `run` starts when
/// the user interrupts it. Call it once, from the main thread.
///
/// # Errors
/// Returns the error of `run`, or says that signals cannot be received.
pub fn main(run: impl FnOnce() -> Result<()>) -> Result<()> {
    tracing_subscriber::fmt()
        .with_env_filter(tracing_subscriber::EnvFilter::from_env("OOCPT_LOG"))
        .with_writer(std::io::stderr)
        .init();
    stop::listen()?;
    let result = run();
    stop::done();
    result
}
