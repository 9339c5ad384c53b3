// SPDX-License-Identifier: Apache-2.0
//! Images that are filtered with the samples: the mean of what each sample meets by closed forms in f64, with depth of
//! field and motion; the same bits everywhere; and nothing of them where nobody asks.

use crate::checkpoints::{Folder, by, open};
use crate::scenes::{dome, features, mesh, nested, prim, square};
use crate::streaming::SCENES;
use crate::support::{self, filtering, orthographic, perspective, read, render, request, settings};
use glam::{DMat4, DVec3};
use oocpt_abi::sampler::{pixel_seed, sample_1d, sample_4d};
use oocpt_core::camera::Camera;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::{MeshDesc, SceneDb, TransformSample};
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

pub(crate) const SIZE: [u32; 2] = [24, 18];
pub(crate) const SAMPLES: u32 = 32;
const FILTERED: [AovKind; 6] =
    [AovKind::Albedo, AovKind::Normal, AovKind::Neye, AovKind::Position, AovKind::Peye, AovKind::GeometricNormal];

pub(crate) fn asking(camera: Camera, kinds: &[AovKind], clear: [f32; 4]) -> RenderRequest {
    let aovs = kinds.iter().map(|&kind| AovRequest { kind, clear }).collect();
    RenderRequest { aovs, ..request(camera) }
}

pub(crate) fn session_of(settings: Settings, streams: bool, build: impl FnOnce(&mut SceneDb)) -> Session {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    session
}

/// A rectangle in the plane z: its sides from, to; its albedo.
#[derive(Clone, Copy)]
struct Card {
    z: f64,
    x: [f64; 2],
    y: [f64; 2],
    albedo: f32,
}

/// Far from the origin of the world, so that the frame of what is rendered is not its own.
const PLACE: DVec3 = DVec3::new(5000.0, -300.0, 70.0);
const CARDS: [Card; 2] = [
    Card { z: 1.5, x: [-0.9, 0.13], y: [-0.7, 0.62], albedo: 0.8 },
    Card { z: -2.0, x: [-1.7, 1.9], y: [-1.31, 1.2], albedo: 0.3 },
];

#[expect(clippy::cast_possible_truncation, reason = "a test")]
fn card(path: &str, id: i32, Card { z, x, y, albedo }: Card) -> MeshDesc {
    let corner = |x: f64, y: f64| [x as f32, y as f32, z as f32];
    let corners = vec![corner(x[0], y[0]), corner(x[1], y[0]), corner(x[1], y[1]), corner(x[0], y[1])];
    mesh(prim(path, DMat4::from_translation(PLACE)), id, corners, &[vec![0, 1, 2, 3]], albedo)
}

pub(crate) fn cards(db: &mut SceneDb) {
    for (id, of) in (0..).zip(CARDS) {
        db.upsert_mesh(card(&format!("/card{id}"), id, of));
    }
}

/// The unit disk by two numbers (Shirley and Chiu 1997).
pub(crate) fn disk(u: [f32; 2]) -> [f64; 2] {
    let [a, b] = u.map(|u| 2.0 * f64::from(u) - 1.0);
    let (radius, angle) =
        if a.abs() > b.abs() { (a, FRAC_PI_4 * (b / a)) } else { (b, FRAC_PI_2 - FRAC_PI_4 * (a / b)) };
    if radius == 0.0 { [0.0; 2] } else { [radius * angle.cos(), radius * angle.sin()] }
}

/// Origin and direction in the world of a sample's ray, by the camera's definition.
pub(crate) fn ray(camera: &Camera, p: [f64; 2], lens: [f64; 2]) -> (DVec3, DVec3) {
    let [width, height] = SIZE.map(f64::from);
    let (x, y) = (2.0 * p[0] / width - 1.0, 2.0 * p[1] / height - 1.0);
    // In focus: the ray of a pinhole at the distance of the focus.
    let in_focus =
        DVec3::new(x / camera.projection.x_axis.x, y / camera.projection.y_axis.y, -1.0) * camera.focus_distance;
    let lens = DVec3::new(lens[0], lens[1], 0.0) * camera.lens_radius;
    let world = &camera.world_from_view;
    (world.transform_point3(lens), world.transform_vector3((in_focus - lens).normalize()))
}

/// The number of the card that a ray meets.
pub(crate) fn card_met((o, d): (DVec3, DVec3)) -> Option<usize> {
    CARDS.iter().position(|card| card.met_at(o, d).is_some())
}

/// The distance along the view axis at which a ray meets a card.
pub(crate) fn card_depth(camera: &Camera, card: usize, (o, d): (DVec3, DVec3)) -> f64 {
    let at = CARDS[card].met_at(o, d).expect("it meets the card");
    -camera.world_from_view.inverse().transform_point3(at).z
}

impl Card {
    fn met_at(&self, o: DVec3, d: DVec3) -> Option<DVec3> {
        let at = o + d * ((PLACE.z + self.z - o.z) / d.z);
        let (x, y) = (at.x - PLACE.x, at.y - PLACE.y);
        let inside = x >= self.x[0] && x <= self.x[1] && y >= self.y[0] && y <= self.y[1];
        inside.then_some(at)
    }
}

/// What a sample has for an image.
fn value(kind: AovKind, camera: &Camera, (o, d): (DVec3, DVec3), clear: f64) -> DVec3 {
    let met = CARDS.iter().find_map(|card| Some((card.met_at(o, d)?, card.albedo)));
    let Some((at, albedo)) = met else { return DVec3::splat(clear) };
    let view = camera.world_from_view.inverse();
    match kind {
        AovKind::Albedo => DVec3::splat(albedo.into()),
        AovKind::Normal | AovKind::GeometricNormal => DVec3::Z,
        AovKind::Neye => view.transform_vector3(DVec3::Z),
        AovKind::Position => at,
        AovKind::Peye => view.transform_point3(at),
        _ => unreachable!("no filtered image"),
    }
}

pub(crate) fn blurred() -> Camera {
    let mut camera = perspective(PLACE + DVec3::new(0.9, 0.4, 5.0), PLACE, 0.6, SIZE);
    (camera.lens_radius, camera.focus_distance) = (0.25, 4.0);
    camera
}

/// Largest difference of an image from the mean of `SAMPLES` values by `of(pixel, sample)`, but for so many pixels:
/// where a sample is at an edge to the last bit, single precision may see it on the other side.
fn apart(image: &[[f32; 3]], spared: usize, of: impl Fn([u32; 2], u32) -> DVec3) -> f64 {
    let pixels = (0..SIZE[1]).flat_map(|y| (0..SIZE[0]).map(move |x| [x, y]));
    let mut differences: Vec<f64> = image
        .iter()
        .zip(pixels)
        .map(|(given, pixel)| {
            let mean = (0..SAMPLES).map(|sample| of(pixel, sample)).sum::<DVec3>() / f64::from(SAMPLES);
            (DVec3::from_array(given.map(f64::from)) - mean).abs().max_element()
        })
        .collect();
    differences.sort_by(f64::total_cmp);
    differences[differences.len() - 1 - spared]
}

#[test]
fn filtered_images_are_means_over_lens_and_pixel() {
    const CLEAR: f64 = -4.0;
    let camera = blurred();
    let view = asking(camera.clone(), &FILTERED, [-4.0; 4]);
    let session = session_of(filtering(settings(SAMPLES, 0)), false, cards);
    render(&session, &view);
    let of = |kind: AovKind| {
        let camera = &camera;
        move |[x, y]: [u32; 2], sample| {
            let u = sample_4d(sample, 0, pixel_seed(x, y, 0));
            let p = [f64::from(x) + f64::from(u[0]), f64::from(y) + f64::from(u[1])];
            value(kind, camera, ray(camera, p, disk([u[2], u[3]])), CLEAR)
        }
    };
    for kind in FILTERED {
        let image = read::<[f32; 3]>(&session, &view, kind);
        // Positions in the world are rounded to floats of 5000.
        let bound = if kind == AovKind::Position { 1e-3 } else { 2e-5 };
        let off = apart(&image, 1, of(kind));
        assert!(off < bound, "{kind:?} is {off} apart");
        let edges = image.iter().filter(|v| v[2] > -3.9 && (v[0] - image[0][0]).abs() > 0.01).count();
        assert!(edges > 50 || kind != AovKind::Albedo, "{kind:?}: blurred edges are seen: {edges}");
    }
}

#[test]
fn images_through_pixel_centres_are_those_of_a_pinhole() {
    let camera = blurred();
    let view = asking(camera.clone(), &FILTERED, [-4.0; 4]);
    let session = session_of(settings(SAMPLES, 0), false, cards);
    render(&session, &view);
    assert_eq!(session.timings().paths, 0, "no samples are taken for them");
    for kind in FILTERED {
        let image = read::<[f32; 3]>(&session, &view, kind);
        let off = apart(&image, 1, |[x, y], _| {
            let centre = [f64::from(x) + 0.5, f64::from(y) + 0.5];
            value(kind, &camera, ray(&camera, centre, [0.0; 2]), -4.0)
        });
        assert!(off < if kind == AovKind::Position { 1e-3 } else { 2e-5 }, "{kind:?} is {off} apart");
    }
}

#[test]
fn filtered_images_have_the_motion_of_the_shutter() {
    const AT_ONCE: f64 = 2.0; // units while the shutter is open
    let camera = orthographic(DVec3::Z * 5.0, DVec3::ZERO, 3.0, SIZE);
    let [width, height] = SIZE.map(f64::from);
    let session = session_of(filtering(settings(SAMPLES, 0)), false, |db| {
        let flat = DMat4::from_rotation_x(FRAC_PI_2) * DMat4::from_scale(DVec3::splat(0.5));
        let place = |time: f64| DMat4::from_translation(DVec3::X * AT_ONCE * (time - 0.5)) * flat;
        let mut desc = square(prim("/card", place(0.0)), 0, 0.6);
        desc.prim.motion = [0.0, 1.0].map(|time| TransformSample { time, transform: place(time) }).to_vec();
        db.upsert_mesh(desc);
    });
    let view = asking(camera, &[AovKind::Albedo, AovKind::Color], [0.0; 4]);
    render(&session, &view);
    let image = read::<[f32; 3]>(&session, &view, AovKind::Albedo);
    let off = apart(&image, 1, |[x, y], sample| {
        let seed = pixel_seed(x, y, 0);
        let (u, time) = (sample_4d(sample, 0, seed), sample_1d(sample, oocpt_abi::TIME_SET, seed));
        let at = |pixel: u32, u: f32, side: f64| (f64::from(pixel) + f64::from(u) - 0.5 * side) * 3.0 / height;
        let (px, py) = (at(x, u[0], width), at(y, u[1], height));
        let inside = (px - AT_ONCE * (f64::from(time) - 0.5)).abs() <= 0.5 && py.abs() <= 0.5;
        DVec3::splat(if inside { f64::from(0.6_f32) } else { 0.0 })
    });
    assert!(off < 1e-6, "{off} apart");
    let partly = image.iter().filter(|v| v[0] > 0.05 && v[0] < 0.55).count();
    assert!(partly > 60, "it is smeared over many pixels: {partly}");
}

/// A black board before a sky of one value.
fn board(db: &mut SceneDb) {
    db.upsert_mesh(mesh(
        prim("/board", DMat4::IDENTITY),
        1,
        vec![[0.3, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [-1.1, 9.0, 0.0]],
        &[vec![0, 1, 2, 3]],
        0.0,
    ));
    db.upsert_light(dome([0.3; 3]));
}

/// With a clear value as the sky and an albedo as black as the board, the filtered albedo is the picture: each sample
/// has the same value for both, so both are the same bits, whatever weighs and orders the samples.
#[test]
fn filtered_images_are_weighted_and_ordered_as_the_colour() {
    let view =
        asking(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 6.0, SIZE), &[AovKind::Albedo, AovKind::Color], [0.0; 4]);
    let mut view = view;
    view.aovs[0].clear = [0.3; 4];
    for (kind, adaptive, streams) in [
        (PixelFilterKind::Box, false, false),
        (PixelFilterKind::Gaussian, false, true),
        (PixelFilterKind::Mitchell, false, false),
        (PixelFilterKind::Mitchell, true, false),
        (PixelFilterKind::Box, true, true),
    ] {
        for samples in [1, 2, 3, 7, 64] {
            let of = Settings { pixel_filter: kind, adaptive_sampling: adaptive, ..settings(samples, 0) };
            let session = session_of(filtering(of), streams, board);
            render(&session, &view);
            let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
            let albedo = read::<[f32; 3]>(&session, &view, AovKind::Albedo);
            for (pixel, (color, albedo)) in color.iter().zip(&albedo).enumerate() {
                let same = albedo.map(f32::to_bits) == [color[0], color[1], color[2]].map(f32::to_bits);
                assert!(same, "{kind:?}, adaptive {adaptive}, {samples} samples, pixel {pixel}: {albedo:?} {color:?}");
            }
            let edges = albedo.iter().filter(|v| v[0] > 1e-3 && v[0] < 0.299).count();
            assert!(samples < 7 || edges > 10, "an edge is there: {edges}");
        }
    }
}

#[test]
fn filtered_images_have_the_same_bits_everywhere() {
    let ways = [
        ("shaders", by(TraversalKind::Compute), false),
        ("host", by(TraversalKind::Auto), false),
        ("streaming", by(TraversalKind::Compute), true),
        ("streaming on the host", Settings { geometry_budget_kib: 96, ..by(TraversalKind::Auto) }, true),
        ("at a small budget", Settings { geometry_budget_kib: 64, ..by(TraversalKind::Compute) }, true),
    ];
    let view = request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [45, 31]));
    // The first has more paths than are in flight at a time: their slots are not their places.
    for (name, build, samples) in [("nested", nested as fn(&mut SceneDb), 64), ("features", features, 9)] {
        let images = ways.clone().map(|(_, way, streams)| {
            let session = open(build, filtering(Settings { samples_per_pixel: samples, ..way }), streams);
            render(&session, &view);
            support::read_all(&session, &view)
        });
        for ((way, ..), others) in ways.iter().zip(&images) {
            for (kind, (a, b)) in AovKind::ALL.iter().zip(images[0].iter().zip(others)) {
                assert!(a == b, "{name}, {way}: another {kind:?}");
            }
        }
    }
}

#[test]
fn filtered_images_alone_take_first_hits_and_no_light() {
    for streams in [false, true] {
        let settings = filtering(settings(6, 4));
        let of = |kinds: &[AovKind]| {
            let session = session_of(settings.clone(), streams, nested);
            let camera = perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, SIZE);
            let view = asking(camera, kinds, [0.0; 4]);
            render(&session, &view);
            let timings = session.timings();
            (read::<u8>(&session, &view, AovKind::Normal), timings.closest_rays, timings.shadow_rays)
        };
        let alone = of(&[AovKind::Normal]);
        let with_light = of(&[AovKind::Normal, AovKind::Color]);
        assert!(alone.0 == with_light.0, "the same image, streaming {streams}");
        assert_eq!((alone.1, alone.2), (u64::from(6 * SIZE[0] * SIZE[1]), 0), "a ray for each sample");
        assert!(with_light.1 > alone.1 && with_light.2 > 0, "light takes more: {with_light:?}");
    }
}

#[test]
fn filtered_images_exist_only_on_request() {
    let made = |kinds: &[AovKind], settings: Settings| {
        let session = session_of(settings, false, nested);
        let view = asking(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 6.0, SIZE), kinds, [0.0; 4]);
        render(&session, &view);
        let inventory = session.stats().inventory;
        let passes = ["shade_aovs", "generate_aov_rays", "sum_planes", "resolve_planes", "tell_spread"]
            .map(|name| inventory.passes.iter().any(|pass| pass.name == name && pass.made));
        let bytes = ["plane_sums", "plane_values"].map(|name| {
            inventory.buffers.iter().filter(|buffer| buffer.name == name).map(|buffer| buffer.bytes).sum::<u64>()
        });
        (passes, bytes, inventory.paths)
    };
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    let (passes, bytes, _) = made(&[AovKind::Color], filtering(settings(2, 1)));
    assert_eq!((passes, bytes), ([false; 5], [0, 0]), "colour alone");
    let (passes, bytes, _) = made(&[AovKind::Color, AovKind::Albedo], settings(2, 1));
    assert_eq!((passes, bytes), ([true, true, false, false, false], [0, 0]), "through pixel centres");
    let (passes, bytes, paths) = made(&[AovKind::Color, AovKind::Albedo], filtering(settings(2, 1)));
    assert_eq!(passes, [true, false, true, true, false], "filtered");
    assert_eq!(bytes, [pixels * 3 * 12, paths * 3 * 4], "three sums a pixel, three values a path");
    let (passes, bytes, _) = made(&[AovKind::Color, AovKind::Error], filtering(settings(2, 1)));
    assert_eq!((passes, bytes), ([false, false, false, false, true], [0, 0]), "the error is the film's");
}

/// Coverage `c` of black by white has the variance c (1 - c) n / (n - 1).
#[test]
fn variance_is_that_of_the_samples() {
    for (samples, exposure) in [(2_u32, 1.0_f32), (16, 1.0), (37, 2.0)] {
        let mut camera = orthographic(DVec3::Z * 5.0, DVec3::ZERO, 6.0, SIZE);
        camera.exposure_scale = exposure;
        let view = asking(camera, &[AovKind::Color, AovKind::Variance, AovKind::Error], [0.0; 4]);
        let session = session_of(settings(samples, 0), false, board);
        render(&session, &view);
        let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
        let variance = read::<[f32; 3]>(&session, &view, AovKind::Variance);
        let (n, sky) = (f64::from(samples), 0.3 * f64::from(exposure));
        for (color, variance) in color.iter().zip(&variance) {
            let c = f64::from(color[0]) / sky;
            let expected = sky * sky * c * (1.0 - c) * n / (n - 1.0);
            assert!((f64::from(variance[1]) - expected).abs() < 1e-6, "{variance:?} of {color:?}, not {expected}");
        }
        assert!(variance.iter().any(|v| v[0] > 1e-3), "an edge varies");
    }
}

#[test]
fn squares_of_the_error_add_up_to_what_is_told() {
    let camera = perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, SIZE);
    let view = asking(camera, &[AovKind::Color, AovKind::Error], [0.0; 4]);
    for (samples, adaptive, streams) in [(16, false, false), (21, false, true), (64, true, false)] {
        let of = Settings { adaptive_sampling: adaptive, ..settings(samples, 2) };
        let session = session_of(of, streams, nested);
        render(&session, &view);
        let told = session.stats().error.and_then(|row| row.estimate).expect("an error is told").rel_mse;
        let errors = read::<f32>(&session, &view, AovKind::Error);
        let mean = errors.iter().map(|e| f64::from(*e).powi(2)).sum::<f64>() / f64::from(SIZE[0] * SIZE[1]);
        assert!(told > 0.0 && (mean / told - 1.0).abs() < 1e-4, "{samples}: {mean}, told {told}");
        let (least, most) = errors.iter().fold((f32::MAX, 0.0_f32), |(a, b), e| (a.min(*e), b.max(*e)));
        assert!(least < 0.3 * most, "it differs between pixels: {least} {most}");
    }
    let session = session_of(settings(1, 2), false, nested);
    render(&session, &view);
    assert!(read::<f32>(&session, &view, AovKind::Error).iter().all(|e| *e == 0.0), "one sample tells nothing");
}

#[test]
fn filtered_images_go_on_from_a_checkpoint() {
    let folder = Folder::new("filtered");
    let file = folder.file("film");
    let view = request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, [45, 31]));
    let of = |samples, checkpoint: &str| {
        let checkpoint = checkpoint.to_owned();
        filtering(Settings {
            samples_per_pixel: samples,
            checkpoint,
            checkpoint_secs: 0.0,
            ..by(TraversalKind::Compute)
        })
    };
    let name = file.to_string_lossy().into_owned();
    for (samples, before, streams) in [(3, 0, false), (5, 3, true), (8, 5, false)] {
        let session = open(nested, of(samples, &name), streams);
        render(&session, &view);
        assert_eq!(session.stats().samples_kept, before, "it goes on");
        let whole = open(nested, of(samples, ""), false);
        render(&whole, &view);
        assert!(support::read_all(&session, &view) == support::read_all(&whole, &view), "other bits at {samples}");
    }
    // Fewer filtered images, or none, are another render.
    let mut less = view;
    less.aovs.retain(|aov| ![AovKind::Albedo, AovKind::Shadow, AovKind::ShadowCatcher].contains(&aov.kind));
    let kept = std::fs::read(&file).expect("a file");
    for (settings, what) in [
        (of(9, &name), "has samples of other filtered images: "),
        (Settings { filter_aovs: false, ..of(9, &name) }, "where none are wanted"),
    ] {
        let session = open(nested, settings, false);
        let messages = support::render_with_messages(&session, &less);
        assert!(matches!(&*messages, [one] if one.text.contains(what)), "{what}: {messages:?}");
        assert_eq!(session.stats().samples_kept, 0, "{what}");
        assert!(std::fs::read(&file).expect("a file") == kept, "{what}: the file stays");
    }
}

#[test]
fn a_fifth_primvar_is_left_out_by_its_name() {
    let names = ["a", "b", "c", "d", "e", "d", "f"];
    let kinds = names.map(|name| AovKind::from_token(&format!("primvars:{name}")).expect("a primvar"));
    let view = asking(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 6.0, SIZE), &kinds, [0.0; 4]);
    let session = open(nested, filtering(settings(1, 0)), false);
    let messages = support::render_with_messages(&session, &view);
    let left: Vec<_> = messages.iter().filter(|said| said.text.starts_with("left out")).collect();
    assert!(matches!(&*left, [one] if one.text.ends_with(": primvars:e, primvars:f")), "{messages:?}");
    let bytes = (SIZE[0] * SIZE[1]) as usize * 16;
    let is_there = kinds.map(|kind| session.read_aov(kind, &mut vec![0; bytes]));
    assert_eq!(is_there, [true, true, true, true, false, true, false]);
}

#[test]
fn a_primvar_as_an_image_has_the_same_bits_while_streaming() {
    let scene = &SCENES[7];
    let kind = AovKind::from_token("primvars:displayColor").expect("a primvar");
    let mut view = request(perspective(scene.eye, scene.target, 0.7, SIZE));
    view.aovs.push(AovRequest { kind, clear: [0.0; 4] });
    for settings in [settings(4, 1), filtering(settings(4, 1))] {
        let [core, streamed] = [false, true].map(|streams| {
            let session = session_of(Settings { chunk_size_kib: 16, ..settings.clone() }, streams, scene.build);
            render(&session, &view);
            read::<[f32; 4]>(&session, &view, kind)
        });
        assert!(core.iter().any(|value| value[0] > 0.0), "there are colours");
        assert!(core == streamed, "other bits");
    }
}

#[test]
fn checkpoints_with_crafted_sums_are_left_alone() {
    let folder = Folder::new("crafted-sums");
    let file = folder.file("film");
    let checkpoint = file.to_string_lossy().into_owned();
    let of = filtering(Settings { checkpoint, samples_per_pixel: 2, ..by(TraversalKind::Compute) });
    let view =
        asking(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 6.0, SIZE), &[AovKind::Color, AovKind::Albedo], [0.0; 4]);
    render(&open(nested, of.clone(), false), &view);
    let whole = oocpt_film::FilmReader::open(&file).expect("a checkpoint");
    let [state, film, planes] = ["state", "film", "planes"].map(|name| whole.block(name, 1 << 30).expect("a block"));
    let mut nan = planes.clone();
    nan[..4].copy_from_slice(&f32::NAN.to_ne_bytes());
    let longer = [planes.as_slice(), &[0; 12]].concat();
    for (what, planes) in
        [("short", Some(planes[12..].to_vec())), ("long", Some(longer)), ("no number", Some(nan)), ("none", None)]
    {
        oocpt_film::write_film(&file, whole.header(), |writer| {
            writer.block("state", &state)?;
            writer.block("film", &film)?;
            planes.as_ref().map_or(Ok(()), |planes| writer.block("planes", planes))
        })
        .expect("a file");
        let session = open(nested, of.clone(), false);
        let messages = support::render_with_messages(&session, &view);
        assert!(matches!(&*messages, [one] if one.text.contains("stays as it is")), "{what}: {messages:?}");
        assert_eq!((session.stats().samples_completed, session.stats().samples_kept), (2, 0), "{what}: it is rendered");
    }
}
