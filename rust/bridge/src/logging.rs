// SPDX-License-Identifier: Apache-2.0
//! Sets up the log of the whole process, once.
//!
//! `OOCPT_LOG` is a filter such as `info` or `oocpt_render=debug`; without it only errors appear. Lines go to standard
//! error. A subscriber that the host program installed stays.

use std::sync::Once;
use tracing_subscriber::EnvFilter;

/// Name of the variable that holds the filter.
const VARIABLE: &str = "OOCPT_LOG";

/// Installs the subscriber on the first call; later calls do nothing. Any thread.
pub(crate) fn install() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let filter = EnvFilter::builder().with_env_var(VARIABLE).from_env_lossy();
        let subscriber =
            tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).with_thread_names(true);
        if subscriber.try_init().is_err() {
            tracing::debug!("the host program has its own log subscriber");
        }
    });
}
