// SPDX-License-Identifier: Apache-2.0
//! The environment in which `usdrecord --renderer OocPT` works: with an SDK (`OOCPT_USD_ROOT`) its own tools, else the
//! wheel host's.

use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Result, ensure};

use crate::host::{HOST_VENV, USD_VENV};
use crate::places::RootFolders;
use crate::process::shell_word;

/// The plugin's resources below an install prefix, to be named in `PXR_PLUGINPATH_NAME`.
pub(crate) const INSTALLED_RESOURCES: &str = "plugin/usd/hdOocPT/resources";

/// The variable with which OpenUSD and the renderer find `MaterialX`'s data libraries.
const MATERIALX: &str = "PXR_MTLX_STDLIB_SEARCH_PATHS";

/// A variable and the way in which it is set.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum VariableSetting {
    /// Put in front of a colon-separated list.
    Prepend(&'static str, PathBuf),
    /// Set, whatever the previous value was.
    Set(&'static str, PathBuf),
    /// Set where it is not set, or empty.
    Default(&'static str, PathBuf),
}

/// The SDK that the user named, if any.
///
/// # Errors
/// If `OOCPT_USD_ROOT` names a folder without headers.
pub(crate) fn sdk_root() -> Result<Option<PathBuf>> {
    let Some(root) = env::var_os("OOCPT_USD_ROOT").filter(|root| !root.is_empty()).map(PathBuf::from) else {
        return Ok(None);
    };
    ensure!(root.join("include/pxr/pxr.h").is_file(), "OOCPT_USD_ROOT={}: no include/pxr/pxr.h there", root.display());
    Ok(Some(root))
}

/// Settings for the wheel host.
pub(crate) fn for_wheel(places: &RootFolders) -> Vec<VariableSetting> {
    let mut settings = vec![
        VariableSetting::Prepend("PATH", places.wheel_bin()),
        VariableSetting::Prepend("PXR_PLUGINPATH_NAME", places.wheel_resources()),
    ];
    settings.extend(interpreters(places));
    settings
}

/// Variables for tests that start other interpreters: one that imports the wheel host's `pxr`, one that imports
/// usd-core's.
pub(crate) fn interpreters(places: &RootFolders) -> Vec<VariableSetting> {
    vec![
        VariableSetting::Set("OOCPT_HOST_PYTHON", places.venv_python(HOST_VENV.name)),
        VariableSetting::Set("OOCPT_USD_PYTHON", places.venv_python(USD_VENV.name)),
        VariableSetting::Set("OOCPT_HOST_ROOT", places.host()),
        VariableSetting::Set("OOCPT_BUILD", places.wheel_build()),
        VariableSetting::Default(MATERIALX, places.materialx()),
        VariableSetting::Default("OOCPT_DENOISER_LIBRARY", places.denoiser()),
    ]
}

/// Settings for the SDK at `usd`, with the plugin installed below `prefix`.
pub(crate) fn for_sdk(usd: &Path, prefix: &Path) -> Vec<VariableSetting> {
    vec![
        VariableSetting::Prepend("PATH", usd.join("bin")),
        VariableSetting::Prepend("PYTHONPATH", usd.join("lib/python")),
        VariableSetting::Prepend("LD_LIBRARY_PATH", usd.join("lib")),
        VariableSetting::Prepend("PXR_PLUGINPATH_NAME", prefix.join(INSTALLED_RESOURCES)),
        VariableSetting::Default(MATERIALX, usd.join("libraries")),
    ]
}

/// The settings as lines for `eval` in a POSIX shell.
pub(crate) fn exports(settings: &[VariableSetting]) -> String {
    let line = |setting: &VariableSetting| match setting {
        VariableSetting::Prepend(name, path) => {
            format!("export {name}={}${{{name}:+:${name}}}\n", shell_word(&path.to_string_lossy()))
        }
        VariableSetting::Set(name, path) => format!("export {name}={}\n", shell_word(&path.to_string_lossy())),
        VariableSetting::Default(name, path) => {
            format!("[ -n \"${{{name}:-}}\" ] || {name}={}\nexport {name}\n", shell_word(&path.to_string_lossy()))
        }
    };
    settings.iter().map(line).collect()
}

/// Passes the settings to a child process.
pub(crate) fn apply(settings: &[VariableSetting], command: &mut std::process::Command) {
    for setting in settings {
        match setting {
            VariableSetting::Set(name, path) => command.env(name, path),
            VariableSetting::Default(name, _) if env::var_os(name).is_some_and(|old| !old.is_empty()) => command,
            VariableSetting::Default(name, path) => command.env(name, path),
            VariableSetting::Prepend(name, path) => {
                let mut list = path.clone().into_os_string();
                if let Some(old) = env::var_os(name).filter(|old| !old.is_empty()) {
                    list.push(":");
                    list.push(old);
                }
                command.env(name, list)
            }
        };
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;
    use crate::process::capture;

    #[test]
    fn a_shell_evaluates_the_exports() {
        let settings =
            [VariableSetting::Prepend("A_LIST", "/new dir".into()), VariableSetting::Set("A_VALUE", "/it's".into())];
        let script = format!("{}printf '%s|%s' \"$A_LIST\" \"$A_VALUE\"", exports(&settings));
        let fresh = capture(Command::new("sh").args(["-c", &script]).env_remove("A_LIST")).unwrap();
        assert_eq!(fresh, "/new dir|/it's", "an unset list has no trailing colon");
        let extended = capture(Command::new("sh").args(["-c", &script]).env("A_LIST", "/old")).unwrap();
        assert_eq!(extended, "/new dir:/old|/it's", "the user's entries are kept");
    }

    #[test]
    fn a_default_gives_way() {
        let settings = [VariableSetting::Default("A_DEFAULT", "/new dir".into())];
        let script = format!("{}printf '%s' \"$A_DEFAULT\"", exports(&settings));
        let shell = |old: &str| capture(Command::new("sh").args(["-c", &script]).env("A_DEFAULT", old)).unwrap();
        assert_eq!((shell("").as_str(), shell("/old").as_str()), ("/new dir", "/old"), "empty is not set");
    }

    #[test]
    fn a_child_gets_the_same() {
        let mut child = Command::new("sh");
        child.args(["-c", "printf '%s|%s' \"$XTASK_TEST_LIST\" \"$A_VALUE\""]);
        apply(
            &[VariableSetting::Prepend("XTASK_TEST_LIST", "/a".into()), VariableSetting::Set("A_VALUE", "/b".into())],
            &mut child,
        );
        assert_eq!(capture(&mut child).unwrap(), "/a|/b", "both kinds");
    }
}
