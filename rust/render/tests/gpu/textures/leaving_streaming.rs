// SPDX-License-Identifier: Apache-2.0
//! A scene with textures whose chunks are all on the device or in host memory: a streaming picture goes on without
//! streaming, as those without textures do (`streaming::host_mapped`), and its tiles are loaded as in core.

use super::{Library, close, leaves, small_chunks};
use crate::scenes::{prim, sphere};
use crate::streaming::MAX_PICTURES;
use crate::support::{self, read_all};
use glam::{DMat4, DVec3};
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_core::stats::RenderStats;
use oocpt_gpu::DeviceKind;
use oocpt_render::{PlantedFaults, Session, SessionOptions};
use std::sync::Arc;

/// Spheres of some 13 MiB behind thousands of leaves that are cut out.
fn leaves_before_stones(db: &mut SceneDb) {
    leaves(db);
    for i in 0..8_i32 {
        let place = DMat4::from_translation(DVec3::new(f64::from(i) - 3.5, 0.3, -1.5));
        let stone = prim(&format!("/stone_{i}"), place * DMat4::from_scale(DVec3::splat(0.45)));
        db.upsert_mesh(sphere(stone, 200 + i, 240, 0.6));
    }
}

fn session(settings: Settings, faults: PlantedFaults) -> Session {
    let options = SessionOptions { faults, ..super::options() };
    let session = Session::with_options(settings, options).with_images(Arc::new(Library));
    session.with_scene(leaves_before_stones);
    session
}

fn picture(session: &Session) -> (Vec<Vec<u8>>, RenderStats) {
    support::render(session, &close());
    let picture = (read_all(session, &close()), session.stats());
    session.restart();
    picture
}

#[test]
fn a_fully_resident_textured_scene_leaves_streaming() {
    let long = Settings { samples_per_pixel: 64, chunk_size_kib: 256, ..small_chunks() };
    let (images, in_core) = picture(&session(long.clone(), PlantedFaults::default()));
    let geometry = in_core.streaming.scene_bytes - in_core.streaming.texture_scene_bytes;
    assert!(in_core.streaming.in_core && geometry > 12 << 20, "all fits: {:?}", in_core.streaming);
    // Room for paths, for a part of the geometry, and for few tiles.
    let budget = u32::try_from((geometry / 2 + (17 << 20)) >> 20).expect("small");
    let settings = Settings { memory_budget_mib: budget, host_mapped: HostMapped::On, ..long };
    let session = session(settings, PlantedFaults { leaves_soon: true, ..PlantedFaults::default() });
    let (mut without, mut changed) = (0, 0);
    for number in 0..MAX_PICTURES {
        let (seen, stats) = picture(&session);
        let streaming = &stats.streaming;
        assert!(seen == images, "{number}: the picture differs");
        assert!(stats.gpu_peak_bytes <= u64::from(budget) << 20, "{number}: above the budget: {stats:?}");
        assert!(without == 0 || streaming.is_split, "{number}: streams again: {streaming:?}");
        without += u32::from(streaming.is_split);
        changed += u32::from(streaming.is_split && streaming.loads > 0);
        if without == 2 {
            assert!(streaming.mapped_bytes > 0, "{streaming:?}");
            break;
        }
    }
    assert_eq!(without, 2, "it streams to the end");
    let on_processor = session.device_report().is_some_and(|device| device.kind == DeviceKind::Cpu);
    assert!(changed > 0 || !on_processor, "no picture changed while it was rendered");
}
