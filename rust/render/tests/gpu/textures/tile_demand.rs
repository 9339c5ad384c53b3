// SPDX-License-Identifier: Apache-2.0
//! In core: tiles are loaded when they are seen, and stay; if they outgrow their memory the scene is streamed.

use super::{board, options, session};
use crate::support::{self, orthographic, read, read_all, request, settings};
use glam::DVec3;
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_core::stats::StreamingStats;
use oocpt_render::{AovKind, RenderRequest, Session, SessionOptions};

/// A picture of a square of the board, `width` of its 2 across.
fn part(width: f64, pixels: u32) -> RenderRequest {
    request(orthographic(DVec3::new(0.5, 0.5, 5.0), DVec3::new(0.5, 0.5, 0.0), width, [pixels; 2]))
}

fn stats(session: &Session) -> StreamingStats {
    session.stats().streaming
}

#[test]
fn only_visible_tiles_are_loaded() {
    let build = |db: &mut _| board(db, "2048x2048x3");
    let far = part(4.0, 32);
    let in_core = session(settings(4, 1), options(), build);
    support::render(&in_core, &far);
    let seen = stats(&in_core);
    assert!(seen.in_core && seen.texture_scene_bytes > 20 << 20, "22 MiB of tiles fit: {seen:?}");
    assert!(seen.texture_loads <= 6 && seen.texture_bytes < 1 << 19, "a texel is 1/128 of a pixel: {seen:?}");
    assert!(seen.texture_bytes > 0 && seen.texture_bytes_paged == seen.texture_bytes, "what came is there: {seen:?}");
    let streams = SessionOptions { force_streaming: true, ..options() };
    let streamed = session(settings(4, 1), streams, build);
    support::render(&streamed, &far);
    assert!(read_all(&streamed, &far) == read_all(&in_core, &far), "the same bits");
    // Another camera requests the tiles that it sees; the rest stays and is not loaded again.
    let near = part(0.01, 32);
    support::render(&in_core, &near);
    let later = stats(&in_core);
    assert!((1..=8).contains(&later.texture_loads), "one place, as fine as can be: {later:?}");
    assert!(later.texture_bytes > seen.texture_bytes, "what was there stays: {later:?}");
    support::render(&in_core, &far);
    let again = stats(&in_core);
    assert_eq!((again.texture_loads, again.texture_bytes), (0, later.texture_bytes), "nothing new");
    support::render(&streamed, &near);
    support::render(&in_core, &near);
    assert!(read_all(&streamed, &near) == read_all(&in_core, &near), "the same bits");
}

#[test]
fn textures_that_outgrow_their_memory_are_streamed() {
    let build = |db: &mut _| board(db, "1500x1500x4");
    // This is finer than the picture: all of level 0, of 8.6 MiB.
    let all = part(4.0, 1000);
    let roomy = session(settings(1, 0), options(), build);
    support::render(&roomy, &all);
    let whole = stats(&roomy);
    assert!(whole.in_core && whole.texture_bytes > 8 << 20, "all fits: {whole:?}");
    let budget = (whole.scene_bytes - whole.texture_scene_bytes + (8 << 20) + (100 << 10)) >> 10;
    let tight = Settings { geometry_budget_kib: u32::try_from(budget).expect("small"), ..settings(1, 0) };
    let session = session(tight, options(), build);
    support::render(&session, &all);
    let after = stats(&session);
    assert!(!after.in_core && after.geometry_peak_bytes <= budget << 10, "it streams within its budget: {after:?}");
    assert!(read_all(&session, &all) == read_all(&roomy, &all), "the same bits");
    // What is seen from afar fits, but the scene has shown that it does not.
    support::render(&session, &part(4.0, 16));
    assert!(!stats(&session).in_core, "no second try");
}

/// What finds no room on the device is read in host memory: a scene in core stays there, within its budget.
#[test]
fn tiles_beyond_the_budget_are_read_in_host_memory() {
    let build = |db: &mut _| board(db, "2900x2900x4");
    let mut all = part(2.0, 1000);
    all.aovs.retain(|aov| aov.kind == AovKind::Color);
    let picture = |session: &Session| read::<u32>(session, &all, AovKind::Color);
    let roomy = session(settings(1, 0), options(), build);
    support::render(&roomy, &all);
    let whole = stats(&roomy);
    assert!(whole.in_core && whole.texture_bytes > 24 << 20 && whole.mapped_bytes == 0, "all fits: {whole:?}");
    // Waves are made smaller first, so the budget at which tiles have no room depends on the device.
    let peak = |session: &Session| u32::try_from(session.stats().gpu_peak_bytes >> 20).expect("small");
    let mut budget = peak(&roomy);
    let session = loop {
        budget = budget.checked_sub(4).expect("tiles are mapped");
        let settings = Settings { memory_budget_mib: budget, host_mapped: HostMapped::On, ..settings(1, 0) };
        let session = session(settings, options(), build);
        support::render(&session, &all);
        assert!(stats(&session).in_core, "{budget} MiB: it is not streamed before tiles are mapped");
        if stats(&session).mapped_bytes > 0 {
            break session;
        }
        budget = budget.min(peak(&session));
    };
    let is_right = || picture(&session) == picture(&roomy);
    assert!(session.stats().gpu_peak_bytes <= u64::from(budget) << 20, "within {budget} MiB");
    assert!(is_right(), "the same bits");
    session.restart();
    support::render(&session, &all);
    let again = stats(&session);
    assert_eq!((again.loads, again.texture_loads), (0, 0), "a second picture finds what is there: {again:?}");
    assert!(is_right(), "the same bits again");
    // A session that may not read host memory has the same device, with the limit that the other one has set.
    drop(session);
    let settings = Settings { memory_budget_mib: budget, host_mapped: HostMapped::Off, ..settings(1, 0) };
    let off = self::session(settings, options(), build);
    support::render(&off, &all);
    assert_eq!(stats(&off).mapped_bytes, 0, "it reads tiles there: {:?}", stats(&off));
    assert!(picture(&off) == picture(&roomy), "the same bits without host memory");
}
