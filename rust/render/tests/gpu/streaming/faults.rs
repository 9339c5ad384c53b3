// SPDX-License-Identifier: Apache-2.0
//! What is planted shows, and failures for lack of memory do not: lost chunks, calls that fail, bytes that nobody
//! counted.

use super::{Render, TestFiles, options, percent, planting, render, request_of, small_chunks, smallest_budget};
use crate::support::{self, read_all, render_with_messages};
use oocpt_core::settings::{Settings, Value};
use oocpt_gpu::{Call, Failure};
use oocpt_render::{Faults, Session, SessionOptions};
use oocpt_shader_abi::{FAULT_ALL, FAULT_ONE_IN};
use std::sync::Arc;

use super::scenes::{BEACH, SCENES, Scene};

/// At a quarter of the geometry.
fn quarter(scene: &Scene, whole: &Render) -> Settings {
    let budget = percent(whole.stats.scene_bytes, 25).max(smallest_budget(scene));
    Settings { geometry_budget_kib: budget, ..small_chunks() }
}

/// Of each scene with the chunk instances lost that a fault names, whether the picture shows it.
fn shows(scene: &Scene, whole: &Render, lost_chunks: u32) -> bool {
    let planted = planting(Faults { lost_chunks, ..Faults::default() });
    let part = render(scene, quarter(scene, whole), SessionOptions { force_streaming: true, ..planted });
    part.images != whole.images
}

#[test]
fn chunks_lost_when_deferred_are_noticed() {
    for scene in &SCENES {
        let whole = render(scene, small_chunks(), options());
        assert!(shows(scene, &whole, FAULT_ALL), "{}: the comparison must see lost chunks", scene.name);
    }
}

#[test]
fn one_lost_chunk_in_a_hundred_is_noticed() {
    for scene in &SCENES {
        let whole = render(scene, small_chunks(), options());
        let instances = u32::try_from(whole.stats.chunk_instances).expect("few");
        let places = [0, 1, 2, 3, 4, 5, 6, 7].map(|part| instances.min(FAULT_ONE_IN) * part / 8);
        let seen: Vec<u32> = places.into_iter().filter(|place| shows(scene, &whole, place + 1)).collect();
        println!("{}: {instances} chunk instances, {seen:?} of {places:?} show", scene.name);
    }
}
