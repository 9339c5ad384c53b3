// SPDX-License-Identifier: Apache-2.0
//! apt-get, as root: install packages, and Mesa from the backports where the stock one is too old, of the running Debian release.

use std::fs;
use std::path::PathBuf;
use std::process::Command;

use anyhow::{Context as _, Result};

use super::{find_program, sources};
use crate::process::{capture, run, say};

/// Whether this process may install packages.
pub(super) fn is_root() -> bool {
    capture(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

/// Whether the machine has apt-get.
pub(super) fn is_there() -> bool {
    find_program("apt-get").is_some()
}

/// Installs `packages`; refreshes the package lists only if that fails at first.
///
/// # Errors
/// If apt-get fails with fresh lists.
pub(super) fn install(packages: &[&str], options: &[&str]) -> Result<()> {
    say(format_args!("installing {}", packages.join(" ")));
    let attempt = || run(apt_get().args(["install", "--yes", "--no-install-recommends"]).args(options).args(packages));
    if attempt().is_ok() {
        return Ok(());
    }
    say("refreshing apt's lists");
    run(apt_get().arg("update"))?;
    attempt()
}

fn apt_get() -> Command {
    let mut apt = Command::new("apt-get");
    apt.env("DEBIAN_FRONTEND", "noninteractive").args(["-q", "-o", "DPkg::Lock::Timeout=300"]);
    apt
}

/// Whether the machine's packaged Mesa is the 22 of Debian 12, and its llvmpipe is what would render.
pub(super) fn has_old_mesa() -> bool {
    capture(Command::new("dpkg-query").args(["-W", "-f=${Status} ${Version}", "mesa-vulkan-drivers"]))
        .is_ok_and(|state| is_old_mesa(&state))
}

fn is_old_mesa(state: &str) -> bool {
    state.strip_prefix("install ok installed ").is_some_and(|version| version.starts_with("22."))
}

/// Installs Mesa's Vulkan drivers from `<release>-backports`, served by the mirror that already serves `<release>`.
///
/// # Errors
/// If the release or its mirror cannot be read off the machine, or apt-get fails.
pub(super) fn install_backported_mesa() -> Result<()> {
    let release = fs::read_to_string("/etc/os-release").context("cannot read /etc/os-release")?;
    let codename = codename(&release).context("/etc/os-release names no VERSION_CODENAME")?;
    let suite = format!("{codename}-backports");
    let lists = source_lists();
    if !lists.iter().any(|list| sources::mirror_of(list, &suite).is_some()) {
        let mirror = lists.iter().find_map(|list| sources::mirror_of(list, codename));
        let mirror = mirror.with_context(|| format!("no apt source of this machine serves {codename}"))?;
        fs::write("/etc/apt/sources.list.d/oocpt-backports.list", format!("deb {mirror} {suite} main\n"))
            .context("cannot add the backports to apt's sources")?;
        run(apt_get().arg("update"))?;
    }
    install(&["mesa-vulkan-drivers"], &["-t", &suite])
}

fn codename(os_release: &str) -> Option<&str> {
    os_release.lines().find_map(|line| line.strip_prefix("VERSION_CODENAME=")).map(|name| name.trim_matches('"'))
}

fn source_lists() -> Vec<String> {
    let parts = fs::read_dir("/etc/apt/sources.list.d").into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = parts.collect();
    files.sort();
    files.insert(0, PathBuf::from("/etc/apt/sources.list"));
    files.iter().filter_map(|file| fs::read_to_string(file).ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_installed_mesa_22_is_old() {
        assert!(is_old_mesa("install ok installed 22.3.6-1+deb12u2"), "the stock one");
        assert!(!is_old_mesa("install ok installed 25.0.7-2~bpo12+1"), "the backport");
        assert!(!is_old_mesa("deinstall ok config-files 22.3.6-1+deb12u2"), "one that was removed");
        assert!(!is_old_mesa(""), "none");
    }

    #[test]
    fn the_release_is_read_off_the_machine() {
        assert_eq!(codename("NAME=\"Debian\"\nVERSION_CODENAME=bookworm\n"), Some("bookworm"), "plain");
        assert_eq!(codename("VERSION_CODENAME=\"noble\"\n"), Some("noble"), "quoted");
        assert_eq!(codename("NAME=Arch\n"), None, "rolling release");
    }
}
