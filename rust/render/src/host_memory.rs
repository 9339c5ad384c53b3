// SPDX-License-Identifier: Apache-2.0
//! The budget of host memory: how much there is, how it is divided among its users, and how much the process took.
//!
//! With a budget, what must stay in host memory comes first: arrays that the host application lends, tables of
//! instances, the loader's staging memory. Decoded images have their share, and the rest is divided among what can be
//! evicted or moved to disk ([`HostMemoryUser`]). On Linux the figures come from `/proc/meminfo`, the limits of control
//! groups and `/proc/self/status`; elsewhere free memory is a guess and used memory is 0.

use oocpt_abi::{ExactPixel, FilmPixel};
use oocpt_core::partition::ITEM_BYTES;
use oocpt_core::scene::LentBytes;
use oocpt_core::settings::Settings;
use std::path::Path;

/// Bytes that are taken if the system does not tell how much is free.
const UNKNOWN: u64 = 2 << 30;
/// The users of host memory; each has so many eighths of the budget, or of free memory if there is no budget.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HostMemoryUser {
    /// Built meshes; an eighth of a budget is for those that are read again ([`reading`]). They are taken first, and
    /// free memory is measured again afterwards, so that the eighths of free memory add up to more than eight.
    Meshes,
    /// Instances in the encoding of the device.
    Encoded,
    /// The radiance of ended paths.
    EndedPaths,
}

impl HostMemoryUser {
    const fn eighths(self) -> (u64, u64) {
        match self {
            Self::Meshes => (3, 4),
            Self::Encoded => (3, 4),
            Self::EndedPaths => (1, 1),
        }
    }
}

/// Most bytes of decoded images that are kept in memory.
const IMAGES: u64 = 512 << 20;
/// Decoded images may take one part in so many of a budget.
const IMAGES_SHARE: u64 = 8;
/// Of a budget that cannot hold what must stay in host memory, one part in so many is still given to the other users:
/// data in transit needs some memory.
const MIN_SHARE: u64 = 8;
/// Sorting placements may take one part in so many of what is left; kept meshes may take half of that.
const SORTING_SHARE: u64 = 4;

/// The budget in bytes; `None` if no budget is set.
pub(crate) fn budget(settings: &Settings) -> Option<u64> {
    (settings.host_memory_budget_mib > 0).then(|| u64::from(settings.host_memory_budget_mib) << 20)
}

/// Most bytes of decoded images that are kept in memory.
pub(crate) fn images(settings: &Settings) -> u64 {
    budget(settings).map_or(IMAGES, |budget| IMAGES.min(budget / IMAGES_SHARE))
}

/// Most bytes of a user that already holds `held`, beside `fixed` bytes that must stay in host memory.
pub(crate) fn limit_of(part: HostMemoryUser, settings: &Settings, held: u64, fixed: u64) -> u64 {
    let (of_budget, of_free) = part.eighths();
    match budget(settings) {
        None => free(Path::new("/")).map_or(UNKNOWN, |free| free.saturating_add(held)) / 8 * of_free,
        Some(budget) => left(settings, budget, fixed) / 8 * of_budget,
    }
}

/// Most bytes of meshes in files that are read at a time, beside `fixed` bytes that must stay in host memory; unlimited
/// without a budget.
pub(crate) fn reading(settings: &Settings, fixed: u64) -> u64 {
    budget(settings).map_or(u64::MAX, |budget| left(settings, budget, fixed) / 8)
}

/// The limits of host memory for a commit, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct OfCommit {
    /// Limit on meshes: those that are kept and those being built.
    pub(crate) building: u64,
    /// Limit on sorting placements into chunks.
    pub(crate) sorting: u64,
}

/// The limits of a commit beside `fixed` bytes that must stay in host memory. Before the first render, the parts that
/// only rendering needs are free for building.
pub(crate) fn of_commit(settings: &Settings, fixed: u64, has_rendered: bool) -> OfCommit {
    let Some(budget) = budget(settings) else { return OfCommit { building: u64::MAX, sorting: ITEM_BYTES } };
    let left = left(settings, budget, fixed);
    let (of_meshes, _) = HostMemoryUser::Meshes.eighths();
    let building = if has_rendered { left / 8 * of_meshes } else { left };
    OfCommit { building, sorting: ITEM_BYTES.min(left / SORTING_SHARE) }
}

/// Bytes of host memory that samples of so many pixels take on their way to files: with `oocpt:filmPart` exact sums for
/// each octave, of which those from the first sample on are one, and those that are added; with `oocpt:checkpoint` the
/// records of the film. 0 without a budget.
pub(crate) fn film_files(settings: &Settings, pixels: u64) -> u64 {
    if budget(settings).is_none() || settings.interactive {
        return 0;
    }
    let octave = |sample: u32| sample.checked_ilog2().map_or(0, |octave| octave + 1);
    let planes = match (settings.span.begin, settings.samples_per_pixel) {
        _ if settings.film_part.is_empty() => 0,
        (0, _) => 2,
        (first, end) => octave(end.saturating_sub(1)).saturating_sub(octave(first)) + 2,
    };
    let records = if settings.checkpoint.is_empty() { 0 } else { size_of::<FilmPixel>() as u64 };
    pixels.saturating_mul(u64::from(planes) * size_of::<ExactPixel>() as u64 + records)
}

/// The part of a budget that is left beside fixed bytes and images.
fn left(settings: &Settings, budget: u64, fixed: u64) -> u64 {
    budget.saturating_sub(fixed).saturating_sub(images(settings)).max(budget / MIN_SHARE)
}

/// The bytes of host memory that a scene takes, by user.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HostMemoryTaken<'a> {
    /// Arrays that the host application lends.
    pub(crate) lent: &'a LentBytes,
    /// Tables of instances.
    pub(crate) tables: u64,
    /// The loader's staging memory.
    pub(crate) staging: u64,
    /// Built meshes in memory.
    pub(crate) held: u64,
    /// The bytes that meshes took while they were built, if that exceeded the limit.
    pub(crate) building: Option<u64>,
    /// True if built meshes can be moved to files.
    pub(crate) has_files: bool,
}

/// The warning about a scene that exceeds `budget`; it names what must stay in host memory first.
pub(crate) fn complaint(budget: u64, taken: &HostMemoryTaken<'_>) -> Option<String> {
    let HostMemoryTaken { lent, tables, staging, held, building, has_files } = *taken;
    let mib = |bytes: u64| bytes.div_ceil(1 << 20);
    let fixed = lent.bytes.saturating_add(tables);
    let what = if fixed > budget {
        let largest = lent.largest.as_ref().map(|(path, bytes)| format!(" (most: {path}, {} MiB)", mib(*bytes)));
        format!(
            "arrays of the scene, which the host application lends, take {} MiB{}, tables of instances {} MiB; these \
             cannot be on disk",
            mib(lent.bytes),
            largest.unwrap_or_default(),
            mib(tables)
        )
    } else if !has_files && fixed.saturating_add(held) > budget {
        format!(
            "built meshes take {} MiB beside {} MiB of the scene, and there is no file for them (oocpt:geometryCache)",
            mib(held),
            mib(fixed)
        )
    } else {
        // More than its own share is not an excess: other users may take less than theirs.
        let beside = fixed.saturating_add(staging);
        let building = building.filter(|building| beside.saturating_add(*building) > budget)?;
        let [building, beside] = [building, beside].map(mib);
        format!("building meshes takes up to {building} MiB beside {beside} MiB of the scene and of staging memory")
    };
    Some(format!("oocpt:hostMemoryBudget of {} MiB is exceeded: {what}", mib(budget)))
}

/// Bytes that can be taken before the machine swaps or the control group ends the process. `root` is the folder with
/// `proc` and `sys`.
fn free(root: &Path) -> Option<u64> {
    let read = |path: &str| std::fs::read_to_string(root.join(path)).ok();
    let of_machine = available(&read("proc/meminfo")?)?;
    let number = |path: &str| read(path)?.trim().parse::<u64>().ok();
    // Version 2 of control groups, then version 1. Without a limit the file says "max", or a number beyond any memory.
    let of_group = |limit: &str, used: &str| Some(number(limit)?.saturating_sub(number(used)?));
    let groups = [
        of_group("sys/fs/cgroup/memory.max", "sys/fs/cgroup/memory.current"),
        of_group("sys/fs/cgroup/memory/memory.limit_in_bytes", "sys/fs/cgroup/memory/memory.usage_in_bytes"),
    ];
    Some(groups.into_iter().flatten().fold(of_machine, u64::min))
}

/// `MemAvailable` of `/proc/meminfo`, in bytes.
fn available(meminfo: &str) -> Option<u64> {
    kib(meminfo, "MemAvailable:")
}

/// The most memory that this process has held, bytes: `VmHWM` of `/proc/self/status`; 0 if the system does not tell.
/// The host application's own data count too.
#[must_use]
pub fn peak() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    kib(&status, "VmHWM:").unwrap_or(0)
}

/// The value behind `key`, which is in KiB, in bytes.
fn kib(text: &str, key: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1 << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The result of `free` for a machine with these files.
    fn free_of(test: &str, files: &[(&str, &str)]) -> Option<u64> {
        let root = std::env::temp_dir().join(format!("oocpt-host-memory-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&root).expect("a folder");
        for (path, text) in files {
            let path = root.join(path);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(path, text).expect("written");
        }
        let free = free(&root);
        std::fs::remove_dir_all(&root).expect("removed");
        free
    }

    const MEMINFO: (&str, &str) = ("proc/meminfo", "MemTotal:  16000 kB\nMemFree: 10 kB\nMemAvailable:    8000 kB\n");

    #[test]
    fn the_tightest_memory_limit_wins() {
        let free_of = |files: &[(&str, &str)]| free_of("limits", files);
        assert_eq!(free_of(&[MEMINFO]), Some(8000 << 10));
        let group = |limit| [MEMINFO, ("sys/fs/cgroup/memory.max", limit), ("sys/fs/cgroup/memory.current", "1000\n")];
        assert_eq!(free_of(&group("max\n")), Some(8000 << 10), "no limit");
        assert_eq!(free_of(&group("5000\n")), Some(4000));
        assert_eq!(free_of(&group("500\n")), Some(0), "beyond its limit");
        let old = "sys/fs/cgroup/memory/memory.";
        let (limit, used) = (format!("{old}limit_in_bytes"), format!("{old}usage_in_bytes"));
        assert_eq!(free_of(&[MEMINFO, (&limit, "3000"), (&used, "1")]), Some(2999));
    }

    #[test]
    fn samples_on_their_way_to_files_are_counted() {
        let of = |span: [u32; 2], part: &str, checkpoint: &str| {
            let plain = Settings { host_memory_budget_mib: 64, interactive: false, ..Settings::default() };
            let mut settings = Settings { film_part: part.into(), checkpoint: checkpoint.into(), ..plain };
            (settings.span.begin, settings.samples_per_pixel) = (span[0], span[1]);
            film_files(&settings, 1000)
        };
        assert_eq!(of([0, 64], "", ""), 0, "no file");
        assert_eq!(of([0, 64], "", "a.film"), 80_000, "the records");
        assert_eq!(of([0, 64], "a.film", ""), 320_000, "what is there, and an octave that is added");
        assert_eq!(of([64, 128], "a.film", ""), 320_000, "one octave");
        assert_eq!(of([60, 200], "a.film", ""), 640_000, "32 to 63, 64 to 127, 128 to 255");
        assert_eq!(film_files(&Settings { film_part: "a.film".into(), ..Settings::default() }, 1000), 0, "no budget");
    }

    #[test]
    fn unreadable_memory_limits_give_none() {
        for text in
            ["", "MemAvailable:", "MemAvailable: x kB", "MemAvailable: 12", "MemAvailable: 99999999999999999999 kB"]
        {
            assert_eq!(free_of("unread", &[("proc/meminfo", text)]), None, "{text:?}");
        }
        assert_eq!(free_of("unread", &[]), None);
    }

    #[test]
    fn the_peak_is_never_below_what_is_held() {
        let status = "Name:\tVmHWM: 3 kB\nVmPeak:\t   90 kB\nVmHWM:\t      42 kB\nVmRSS:\t 41 kB\n";
        assert_eq!(kib(status, "VmHWM:"), Some(42 << 10), "the line that begins with it");
        let before = peak();
        let held = std::hint::black_box(vec![1_u8; 64 << 20]);
        let after = peak();
        assert!(after >= 64 << 20 && after >= before, "{before}, then {after} with {} more", held.len());
    }

    #[test]
    fn a_scene_above_the_host_budget_names_its_largest_prim() {
        let lent = LentBytes { bytes: 60 << 20, largest: Some(("/city".into(), 50 << 20)) };
        let of = |tables: u64, held: u64, building: Option<u64>, has_files| {
            let building = building.map(|mib| mib << 20);
            let taken = HostMemoryTaken {
                lent: &lent,
                tables: tables << 20,
                staging: 0,
                held: held << 20,
                building,
                has_files,
            };
            complaint(64 << 20, &taken)
        };
        assert_eq!([of(4, 0, None, false), of(4, 1 << 20, None, true)], [None, None], "it fits, or can be on disk");
        let text = of(4, 1, None, false).expect("there is no disk");
        assert!(text.contains("built meshes take 1 MiB beside 64 MiB") && text.contains("geometryCache"), "{text}");
        let text = of(4, 1, Some(9), true).expect("building takes more");
        assert!(text.contains("building meshes takes up to 9 MiB beside 64 MiB"), "{text}");
        let lends_nothing = LentBytes::default();
        let building = Some(60 << 20);
        let within =
            HostMemoryTaken { lent: &lends_nothing, tables: 4 << 20, staging: 0, held: 0, building, has_files: true };
        let text = complaint(64 << 20, &HostMemoryTaken { staging: 1, ..within }).expect("staging memory counts");
        assert!(text.contains("staging memory"), "{text}");
        assert_eq!(complaint(64 << 20, &within), None, "all of it together fits");
        let text = of(5, 0, Some(9), true).expect("it does not fit");
        for part in ["64 MiB", "60 MiB", "/city, 50 MiB", "5 MiB"] {
            assert!(text.contains(part), "{part}: {text}");
        }
        assert_eq!(images(&Settings { host_memory_budget_mib: 64, ..Settings::default() }), 8 << 20);
        assert_eq!(images(&Settings::default()), 512 << 20);
    }

    #[test]
    fn a_commit_may_take_what_rendering_does_not() {
        let settings = Settings { host_memory_budget_mib: 64, ..Settings::default() };
        let of = |fixed, has_rendered| {
            let OfCommit { building, sorting } = of_commit(&settings, fixed, has_rendered);
            [building >> 20, sorting >> 20]
        };
        assert_eq!([of(0, false), of(0, true)], [[56, 14], [21, 14]], "an eighth is for images");
        assert_eq!([of(24 << 20, false), of(24 << 20, true)], [[32, 8], [12, 8]], "what is fixed comes first");
        assert_eq!(of(1 << 40, false), [8, 2], "some is left");
        let none = of_commit(&Settings::default(), 1 << 40, true);
        assert_eq!(none, OfCommit { building: u64::MAX, sorting: 1 << 30 }, "without a budget");
    }

    #[test]
    fn the_host_memory_setting_overrides_the_detected_limit() {
        let settings = Settings { host_memory_budget_mib: 64, ..Settings::default() };
        let parts = [HostMemoryUser::Meshes, HostMemoryUser::Encoded, HostMemoryUser::EndedPaths];
        let limits = |fixed| parts.map(|part| limit_of(part, &settings, 1 << 40, fixed) >> 20);
        assert_eq!(limits(0), [21, 21, 7], "an eighth is for images");
        assert_eq!(limits(24 << 20), [12, 12, 4], "what is fixed comes first");
        assert_eq!(limits(1 << 40), [3, 3, 1], "some is left");
        for fixed in (0..60).map(|mib| mib << 20) {
            let all = parts.iter().map(|part| limit_of(*part, &settings, 0, fixed)).sum::<u64>();
            let all = all + reading(&settings, fixed);
            let most = (64 << 20) - images(&settings);
            assert!(all + fixed <= most || all <= 8 << 20, "{fixed}: together they keep to the budget");
        }
        let half = limit_of(HostMemoryUser::Meshes, &Settings::default(), 1 << 40, 1 << 50);
        assert!(half >= 1 << 39, "what is held already counts as free: {half}");
    }
}
