// SPDX-License-Identifier: Apache-2.0
//! Pictures of reports with known results.

use oocpt_render::chunk_report::{ChunkReport, ReportCamera, ReportChunk, ReportInstance, ReportMoment};

use super::{FACE, SHADE, draw, paint, progress, summary};

/// Three boxes side by side in front of an orthographic camera that looks along -z: 60 x 40 pixels, one unit each.
fn report() -> ChunkReport {
    let chunk = |loads, rays| ReportChunk { bytes: 1 << 20, records: 10, loads, rays, ..ReportChunk::default() };
    let cube = |x: f32, chunk| ReportInstance { bounds: [[x, 10.0, -9.0], [x + 12.0, 30.0, -5.0]], chunk };
    ChunkReport {
        width: 60,
        height: 40,
        camera: ReportCamera {
            o_x: [1.0, 0.0, 0.0],
            o_y: [0.0, 1.0, 0.0],
            d: [0.0, 0.0, -1.0],
            ..ReportCamera::default()
        },
        instances: vec![cube(4.0, 0), cube(24.0, 1), cube(44.0, 2)],
        chunks: vec![chunk(0, 7), chunk(1, 7), chunk(100, 7)],
        progress: (0..1001_u32)
            .map(|k| ReportMoment { seconds: f64::from(k), paths_left: u64::from(1000 - k) * 1000 })
            .collect(),
        ..ChunkReport::default()
    }
}

/// The colour of a face towards the camera over the background.
fn face(color: [f64; 3]) -> [u8; 3] {
    paint::pixel(paint::mix(paint::BACKGROUND, color.map(|c| c * SHADE[2]), FACE)).0
}

#[test]
fn boxes_have_the_colour_of_their_loads() {
    let image = draw(&report(), "LOADS", |chunk| chunk.loads).expect("a picture");
    assert_eq!(image.dimensions(), (60, 40 + paint::LEGEND), "the picture and its legend");
    let middle = |x| image.get_pixel(x, 20).0;
    assert_eq!(middle(10), face(paint::NEVER), "never loaded");
    assert_eq!(middle(30), face(paint::ramp(0.0)), "loaded once");
    assert_eq!(middle(50), face(paint::ramp(1.0)), "loaded most");
    assert_eq!(image.get_pixel(20, 20).0, paint::pixel(paint::BACKGROUND).0, "between boxes");
    assert_eq!(image.get_pixel(10, 2).0, paint::pixel(paint::BACKGROUND).0, "above the boxes");
    assert_ne!(image.get_pixel(4, 20).0, middle(10), "an edge stands out from its face");
}

#[test]
fn chunks_of_equal_rays_look_the_same() {
    let image = draw(&report(), "RAYS", |chunk| chunk.rays).expect("a picture");
    let colors = [10, 30, 50].map(|x| image.get_pixel(x, 20).0);
    assert!(colors[0] == colors[1] && colors[1] == colors[2], "{colors:?}");
}

#[test]
fn a_box_behind_shines_through_and_a_box_around_the_camera_does_not() {
    let mut behind = report();
    behind.instances.push(ReportInstance { bounds: [[0.0, 0.0, -30.0], [60.0, 40.0, -20.0]], chunk: 2 });
    let with = draw(&behind, "LOADS", |chunk| chunk.loads).expect("a picture");
    let without = draw(&report(), "LOADS", |chunk| chunk.loads).expect("a picture");
    assert_ne!(with.get_pixel(10, 20), without.get_pixel(10, 20), "seen through the box in front");
    let mut around = report();
    around.instances.push(ReportInstance { bounds: [[-9.0, -9.0, -90.0], [90.0, 90.0, 90.0]], chunk: 2 });
    assert!(draw(&around, "LOADS", |chunk| chunk.loads).expect("a picture") == without, "it would cover everything");
}

#[test]
fn the_picture_is_not_upside_down() {
    let mut report = report();
    report.instances = vec![ReportInstance { bounds: [[20.0, 30.0, -9.0], [40.0, 38.0, -5.0]], chunk: 1 }];
    let image = draw(&report, "LOADS", |chunk| chunk.loads).expect("a picture");
    assert_eq!(image.get_pixel(30, 6).0, face(paint::ramp(0.0)), "y = 34 is near the top");
    assert_eq!(image.get_pixel(30, 34).0, paint::pixel(paint::BACKGROUND).0, "nothing near the bottom");
}

#[test]
fn the_table_is_short_and_has_its_end() {
    let text = progress(&report());
    assert!(text.lines().count() < 60, "{text}");
    let last = text.lines().last().unwrap_or_default();
    assert!(last.contains("1000.000") && last.contains(" 0 "), "the last moment: {last}");
    assert!(text.contains(" 100000 "), "the first tenfold drop: {text}");
}

#[test]
fn the_summary_counts() {
    let text = summary(&report());
    assert!(
        text.starts_with("3 chunks of 3 MiB (what they share counted for each), 3 chunk instances; 1 never loaded, 0 "),
        "{text}"
    );
    assert!(text.contains("most loaded: 100 loads (0 of them again), 7 rays"), "{text}");
}

#[test]
fn an_empty_report_is_an_empty_picture() {
    let image = draw(&ChunkReport { width: 8, height: 8, ..ChunkReport::default() }, "RAYS", |chunk| chunk.rays)
        .expect("a picture");
    assert!((0..8).all(|x| image.get_pixel(x, x).0 == paint::pixel(paint::BACKGROUND).0), "nothing to see");
}
