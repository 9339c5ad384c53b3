// SPDX-License-Identifier: Apache-2.0
//! Drivers that generate machine code at the first dispatch do that apart from the waves, which are bounded in
//! time.
//!
//! Holds in a process where no other test has rendered: `cargo xtask test` runs each module of tests in its own.

use crate::scenes::nested;
use crate::support::{TIMEOUT, perspective, render, request, settings};
use glam::DVec3;
use oocpt_abi::Features;
use oocpt_gpu::DeviceKind;
use oocpt_render::{Session, SessionOptions};
use oocpt_shaders::ALL;
use std::collections::BTreeSet;

#[test]
fn every_pass_is_warmed_up_before_the_first_wave() {
    // The second scene shares the pipelines of passes to which streaming is nothing.
    let mut used = BTreeSet::new();
    let asks =
        |name: &str| ALL.iter().any(|module| module.name == name && module.features.contains(Features::STREAMING));
    for streams in [false, true] {
        let options = SessionOptions { force_streaming: streams, validation: true, ..SessionOptions::default() };
        let session = Session::with_options(settings(2, 2), options);
        session.with_scene(nested);
        let view = request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::ZERO, 0.7, [16, 12]));
        render(&session, &view);
        let is_cpu = session.device_report().is_some_and(|device| device.kind == DeviceKind::Cpu);
        let inventory = session.stats().inventory;
        let made: Vec<&str> = inventory.passes.iter().filter(|pass| pass.made).map(|pass| pass.name.as_str()).collect();
        let new = made.iter().filter(|name| !used.contains(**name) || asks(name)).count() as u64;
        let expected = if is_cpu { new } else { 0 };
        assert!(new > 9, "{new} passes");
        assert_eq!(session.timings().warmed_up_pipelines, expected, "streams: {streams}");
        session.restart();
        assert!(session.wait_converged(TIMEOUT), "it renders again");
        assert_eq!(session.timings().warmed_up_pipelines, 0, "once");
        used.extend(made.into_iter().map(str::to_owned));
    }
}
