// SPDX-License-Identifier: Apache-2.0
//! The image of waits for loads: as many as the statistics count, none of a scene that is there, and nothing else
//! changes.

use crate::scenes::nested;
use crate::support::{color_request, perspective, read, render, settings};
use glam::DVec3;
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};

const SAMPLES: u32 = 4;

/// Images of a session and how often it waited, by its statistics.
fn rendered(kinds: &[AovKind], traversal: TraversalKind, streams: bool) -> (Vec<Vec<f32>>, u64) {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(Settings { traversal, ..settings(SAMPLES, 2) }, options);
    session.with_scene(nested);
    let view = color_request(perspective(DVec3::new(0.0, 3.0, 8.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [48, 36]));
    let aovs = kinds.iter().map(|&kind| AovRequest { kind, clear: [0.0; 4] }).collect();
    let request = RenderRequest { aovs, ..view };
    render(&session, &request);
    (kinds.iter().map(|&kind| read::<f32>(&session, &request, kind)).collect(), session.stats().streaming.waits)
}

#[test]
fn waits_are_those_of_the_statistics_and_other_images_stay() {
    let others = [AovKind::Color, AovKind::Shadow, AovKind::from_token("lpe:C.*L").expect("an expression")];
    let with = [&others[..], &[AovKind::LoadWaits]].concat();
    let (plain, _) = rendered(&others, TraversalKind::Auto, false);
    for traversal in [TraversalKind::Auto, TraversalKind::Compute] {
        let (images, counted) = rendered(&with, traversal, true);
        let waits: f64 = images[3].iter().map(|&mean| f64::from(mean)).sum();
        assert!(counted > 0 && (waits * f64::from(SAMPLES) - counted as f64).abs() < 0.01, "{waits} {counted}");
        assert!(images[..3] == plain, "{traversal:?}: the same bits");
    }
    let (images, counted) = rendered(&with, TraversalKind::Auto, false);
    assert!(counted == 0 && images[3].iter().all(|&mean| mean == 0.0), "all is there");
    assert!(images[..3] == plain, "the same bits");
}
