// SPDX-License-Identifier: Apache-2.0
//! Programs that tests start in place of `usdrecord`.

use std::os::unix::fs::PermissionsExt;
use std::path::PathBuf;

/// A shell script in a temporary file.
pub(crate) fn script(name: &str, text: &str) -> PathBuf {
    let path = std::env::temp_dir().join(format!("oocpt-host-{name}-{}", std::process::id()));
    std::fs::write(&path, format!("#!/bin/sh\n{text}\n")).expect("a temporary file");
    std::fs::set_permissions(&path, PermissionsExt::from_mode(0o755)).expect("it is ours");
    path
}
