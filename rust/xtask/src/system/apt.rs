// SPDX-License-Identifier: Apache-2.0
//! apt-get, as root: install packages, and Mesa from the backports where the stock one is too old, of the running
//! Debian release.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context as _, Result, ensure};

use super::{find_program, sources};
use crate::process::{capture, run, say};

/// Debian's name of the package that holds Mesa's Vulkan drivers.
pub(super) const MESA: &str = "mesa-vulkan-drivers";

const BACKPORTS_LIST: &str = "/etc/apt/sources.list.d/oocpt-backports.list";

/// Whether this process may install packages.
pub(super) fn is_root() -> bool {
    capture(Command::new("id").arg("-u")).is_ok_and(|id| id.trim() == "0")
}

/// Whether the machine has apt-get.
pub(super) fn is_there() -> bool {
    find_program("apt-get").is_some()
}

/// Installs `packages`; refreshes the package lists only if there are none or the first attempt fails.
///
/// # Errors
/// If apt-get fails with fresh lists.
pub(super) fn install(packages: &[&str], options: &[&str]) -> Result<()> {
    say(format_args!("installing {}", packages.join(" ")));
    let attempt = || run(apt_get().args(["install", "--yes", "--no-install-recommends"]).args(options).args(packages));
    if has_lists(Path::new("/var/lib/apt/lists")) && attempt().is_ok() {
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

/// A new container has no package lists: apt would call every package unknown.
fn has_lists(folder: &Path) -> bool {
    let mut entries = fs::read_dir(folder).into_iter().flatten().flatten();
    entries.any(|entry| entry.file_name().to_string_lossy().contains("_Packages"))
}

/// Whether the machine's packaged Mesa is the 22 of Debian 12.
pub(super) fn has_old_mesa() -> bool {
    is_old_mesa(&ask("dpkg-query", &["-W", "-f=${Status} ${Version}", MESA]))
}

fn is_old_mesa(state: &str) -> bool {
    state.strip_prefix("install ok installed ").is_some_and(|version| version.starts_with("22."))
}

/// Whether apt would install Mesa 22, were it asked for Mesa.
pub(super) fn offers_old_mesa() -> bool {
    is_old_candidate(&ask("apt-cache", &["policy", MESA]))
}

fn is_old_candidate(policy: &str) -> bool {
    policy.lines().any(|line| line.trim().strip_prefix("Candidate: ").is_some_and(|version| version.starts_with("22.")))
}

/// What `program` says, in plain English; nothing if it fails.
fn ask(program: &str, arguments: &[&str]) -> String {
    let answer = Command::new(program).args(arguments).env("LC_ALL", "C").stderr(Stdio::null()).output();
    answer.map(|output| String::from_utf8_lossy(&output.stdout).into_owned()).unwrap_or_default()
}

/// The suite that serves a newer Mesa for the running release.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct DebianBackports {
    suite: String,
    /// The line that apt's sources lack, on the mirror that already serves the release.
    missing_line: Option<String>,
}

impl DebianBackports {
    /// # Errors
    /// If the release or its mirror cannot be read off the machine.
    pub(super) fn of_this_machine() -> Result<Self> {
        let release = fs::read_to_string("/etc/os-release").context("cannot read /etc/os-release")?;
        Self::of(&release, &source_lists())
    }

    /// As `of_this_machine`, from the texts of `/etc/os-release` and of apt's source lists.
    pub(super) fn of(os_release: &str, lists: &[String]) -> Result<Self> {
        let codename = codename(os_release).context("/etc/os-release names no VERSION_CODENAME")?;
        let suite = format!("{codename}-backports");
        if lists.iter().any(|list| sources::mirror_of(list, &suite).is_some()) {
            return Ok(Self { suite, missing_line: None });
        }
        let mirror = lists.iter().find_map(|list| sources::mirror_of(list, codename));
        let mirror = mirror.with_context(|| format!("no apt source of this machine serves {codename}"))?;
        let missing_line = Some(format!("deb {mirror} {suite} main"));
        Ok(Self { suite, missing_line })
    }

    /// Installs Mesa's Vulkan drivers from here.
    ///
    /// # Errors
    /// If apt-get fails, or brings no newer Mesa.
    pub(super) fn install_mesa(&self) -> Result<()> {
        if let Some(line) = &self.missing_line {
            fs::write(BACKPORTS_LIST, format!("{line}\n")).context("cannot add the backports to apt's sources")?;
            run(apt_get().arg("update"))?;
        }
        install(&[MESA], &["-t", &self.suite])?;
        ensure!(!has_old_mesa(), "{} has no newer Mesa than 22, whose llvmpipe computes wrong images", self.suite);
        Ok(())
    }

    /// The same as a line for the user's shell.
    pub(super) fn mesa_command(&self) -> String {
        let install = format!("sudo apt-get install -t {} {MESA}", self.suite);
        match &self.missing_line {
            Some(line) => format!("echo '{line}' | sudo tee {BACKPORTS_LIST} && sudo apt-get update && {install}"),
            None => install,
        }
    }
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
    fn the_candidate_is_read_off_the_policy() {
        let policy = "mesa-vulkan-drivers:\n  Installed: (none)\n  Candidate: 22.3.6-1+deb12u2\n  Version table:\n";
        assert!(is_old_candidate(policy), "stock Debian 12");
        assert!(!is_old_candidate(&policy.replace("Candidate: 22.3.6", "Candidate: 25.0.7")), "a newer one");
        assert!(!is_old_candidate("  Installed: 22.3.6\n  Candidate: (none)\n"), "only the candidate counts");
    }

    #[test]
    fn the_backports_come_from_the_machines_own_mirror() {
        let release = "VERSION_CODENAME=bookworm\n";
        let stock = "deb http://mirror/debian bookworm main\n".to_owned();
        let lacking = DebianBackports::of(release, std::slice::from_ref(&stock)).unwrap();
        assert_eq!(lacking.missing_line.as_deref(), Some("deb http://mirror/debian bookworm-backports main"), "added");
        let command = lacking.mesa_command();
        assert!(
            command.starts_with("echo 'deb http://mirror/debian bookworm-backports main' | sudo tee "),
            "{command}"
        );
        assert!(command.ends_with("sudo apt-get install -t bookworm-backports mesa-vulkan-drivers"), "{command}");
        assert_eq!(command.lines().count(), 1, "one line");
        let served = DebianBackports::of(release, &[stock.replace("bookworm", "bookworm-backports"), stock]).unwrap();
        assert_eq!(served.mesa_command(), "sudo apt-get install -t bookworm-backports mesa-vulkan-drivers", "served");
        assert!(DebianBackports::of(release, &[]).unwrap_err().to_string().contains("bookworm"), "no mirror");
    }

    #[test]
    fn lists_are_the_packages_files() {
        let folder = std::env::temp_dir().join(format!("xtask-lists-{}", std::process::id()));
        fs::create_dir_all(folder.join("partial")).unwrap();
        assert!(!has_lists(&folder), "as a new container has it");
        fs::write(folder.join("mirror_dists_bookworm_main_binary-amd64_Packages.gz"), "").unwrap();
        assert!(has_lists(&folder), "compressed lists count");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn the_release_is_read_off_the_machine() {
        assert_eq!(codename("NAME=\"Debian\"\nVERSION_CODENAME=bookworm\n"), Some("bookworm"), "plain");
        assert_eq!(codename("VERSION_CODENAME=\"noble\"\n"), Some("noble"), "quoted");
        assert_eq!(codename("NAME=Arch\n"), None, "rolling release");
    }
}
