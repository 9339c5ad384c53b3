// SPDX-License-Identifier: Apache-2.0
//! Light path expressions: parts add up to the picture, each event is where it must be, light is split as lights'
//! multipliers split it; the same bits everywhere, and nothing of them where nobody asks.

use crate::checkpoints::{Folder, by, open};
use crate::last_bounce::surface;
use crate::lights::TestFiles;
use crate::materials::hair::lock;
use crate::scenes::{dome, features, glow, mesh, nested, prim, sphere, square, sun};
use crate::streaming::{DEFORMING, MOVING_BULBS, SCENES, Scene};
use crate::support::{self, color_request, few_of, orthographic, perspective, read, render, settings};
use glam::{DMat4, DVec3};
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::{ParamValue, SceneDb};
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_core::{LightDesc, LightKind, MeshDesc};
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};
use std::f64::consts::PI;
use std::sync::Arc;

const SIZE: [u32; 2] = [45, 31];

/// Sets of expressions each of which every path is of one.
const PARTITIONS: [&[&str]; 5] = [
    &["C.*"],
    &["C[LO]", "C<RD>.*", "C<RG>.*", "C<RS>.*", "C<TD>.*", "C<TG>.*", "C<TS>.*"],
    &["C.*B", "C.*<[^BO]>", "C.*O"],
    &["C[LO]", "C.[LO]", "C..[LO]", "C.{3,}[LO]"],
    &["C.*<[LO].'key'>", "C.*<[LO].'default'>", "C.*<[LO].[^'key''default']>"],
];

fn part(text: &str) -> AovKind {
    AovKind::from_token(&format!("lpe:{text}")).expect("an expression")
}

/// The view with the colour and the parts of these expressions.
fn asking(view: &RenderRequest, texts: &[&str]) -> RenderRequest {
    let kinds = [AovKind::Color].into_iter().chain(texts.iter().map(|text| part(text)));
    RenderRequest { aovs: kinds.map(|kind| AovRequest { kind, clear: [0.0; 4] }).collect(), ..view.clone() }
}

fn all_partitions() -> Vec<&'static str> {
    let mut all: Vec<&str> = PARTITIONS.iter().flat_map(|texts| texts.iter().copied()).collect();
    all.sort_unstable();
    all.dedup();
    all
}

fn session_of(settings: Settings, streams: bool, build: impl FnOnce(&mut SceneDb)) -> Session {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.set_light_files(Arc::new(TestFiles));
    session.with_scene(build);
    session
}

fn image(session: &Session, view: &RenderRequest, text: &str) -> Vec<[f32; 3]> {
    read(session, view, part(text))
}

/// The largest difference of the sum of these parts from the colour, relative to the mean of that.
fn apart(session: &Session, view: &RenderRequest, texts: &[&str]) -> f64 {
    let color = read::<[f32; 4]>(session, view, AovKind::Color);
    let parts: Vec<_> = texts.iter().map(|text| image(session, view, text)).collect();
    let mean = color.iter().map(|c| f64::from(c[0] + c[1] + c[2]) / 3.0).sum::<f64>() / color.len() as f64;
    let difference = |pixel: usize, channel: usize| {
        let sum: f64 = parts.iter().map(|part| f64::from(part[pixel][channel])).sum();
        (sum - f64::from(color[pixel][channel])).abs() / (mean + f64::from(color[pixel][channel]))
    };
    (0..color.len()).flat_map(|pixel| [0, 1, 2].map(|c| difference(pixel, c))).fold(0.0, f64::max)
}

fn number(name: &'static str, value: f32) -> (&'static str, ParamValue) {
    (name, ParamValue::Float(value))
}

fn tint(name: &'static str, value: [f32; 3]) -> (&'static str, ParamValue) {
    (name, ParamValue::Vec3(value))
}

fn labelled(label: &str, light: LightDesc) -> LightDesc {
    LightDesc { label: Some(label.into()), ..light }
}

/// Balls of glass, metal and plastic on a floor, and one that glows; lamps with and without labels.
fn zoo(db: &mut SceneDb) {
    let red = [0.8, 0.1, 0.05];
    let materials = [
        surface("/glass", &[number("opacity", 0.0), number("roughness", 0.0), tint("diffuseColor", [0.9; 3])]),
        surface("/frosted", &[number("opacity", 0.0), number("roughness", 0.4), tint("diffuseColor", [0.9; 3])]),
        surface("/mirror", &[number("metallic", 1.0), number("roughness", 0.0), tint("diffuseColor", [0.9, 0.8, 0.6])]),
        surface("/steel", &[number("metallic", 1.0), number("roughness", 0.35), tint("diffuseColor", [0.6; 3])]),
        surface("/plastic", &[number("roughness", 0.3), number("clearcoat", 0.7), tint("diffuseColor", red)]),
        glow("/glow", [3.0, 2.0, 0.5]),
    ];
    let names: Vec<Arc<str>> = materials.iter().map(|material| Arc::clone(&material.path)).collect();
    materials.into_iter().for_each(|material| db.upsert_material(material));
    for (at, (name, id)) in names.iter().zip(2..).enumerate() {
        let at = DVec3::new((at % 3) as f64 * 1.3 - 1.3, -0.4, (at / 3) as f64 * 1.5 - 0.7);
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.6));
        let ball = sphere(prim(&format!("{name}_ball"), place), id, 10, 0.5);
        let label = (id == 7).then(|| "key".into());
        db.upsert_mesh(MeshDesc { material: Some(Arc::clone(name)), label, ..ball });
    }
    db.upsert_mesh(square(
        prim("/floor", DMat4::from_translation(-DVec3::Y) * DMat4::from_scale(DVec3::splat(6.0))),
        1,
        0.6,
    ));
    let above = DMat4::from_translation(DVec3::new(1.0, 3.0, 1.0)) * DMat4::from_rotation_x(-PI / 2.0);
    let rect = LightKind::Rect { width: 1.5, height: 1.0, texture: None };
    let ball = LightKind::Sphere { radius: 0.3, treat_as_point: false };
    let aside = DMat4::from_translation(DVec3::new(-2.5, 1.0, 1.0));
    let lamp =
        |path: &str, place, kind| LightDesc { prim: prim(path, place), kind, color: [6.0, 5.0, 4.0], ..dome([1.0; 3]) };
    db.upsert_light(labelled("key", lamp("/key", above, rect)));
    db.upsert_light(LightDesc { diffuse: 0.5, specular: 1.5, ..labelled("rim", lamp("/rim", aside, ball)) });
    db.upsert_light(dome([0.2, 0.25, 0.4]));
    db.upsert_light(labelled("key", sun(0.7, 3.0, DMat4::from_rotation_x(-0.9))));
}

fn zoo_view() -> RenderRequest {
    color_request(perspective(DVec3::new(1.0, 2.0, 5.0), DVec3::new(0.0, -0.4, 0.0), 0.7, SIZE))
}

/// The view of a scene of the streaming tests.
fn view_of(scene: &Scene) -> RenderRequest {
    color_request(perspective(scene.eye, scene.target, 0.8, SIZE))
}

/// Name, scene, view and settings.
type SummedScene = (&'static str, fn(&mut SceneDb), RenderRequest, Settings);

#[test]
fn parts_add_up_to_the_picture() {
    let texts = all_partitions();
    let front = color_request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, SIZE));
    let clamped = Settings { clamp: 0.4, ..settings(9, 5) };
    let adaptive = Settings { adaptive_sampling: true, pixel_filter: PixelFilterKind::Mitchell, ..settings(16, 4) };
    let of = |scene: &Scene| (scene.name, scene.build, view_of(scene), settings(6, 4));
    let scenes: Vec<SummedScene> = vec![
        ("zoo", zoo, zoo_view(), settings(12, 6)),
        ("zoo, clamped", zoo, zoo_view(), clamped),
        ("zoo, adaptive and filtered", zoo, zoo_view(), adaptive),
        ("hair", lock, color_request(perspective(DVec3::Z * 5.0, DVec3::ZERO, 0.6, SIZE)), settings(8, 6)),
        ("nested", nested, front.clone(), settings(6, 4)),
        of(&MOVING_BULBS),
        of(&SCENES[8]),
        ("features", features, front, settings(6, 4)),
        of(&SCENES[6]),
        of(&DEFORMING),
    ];
    for (name, build, view, settings) in few_of(&scenes, 7) {
        let session = session_of(settings.clone(), false, *build);
        let view = asking(view, &texts);
        render(&session, &view);
        let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
        assert!(color.iter().any(|c| c[0] > 0.01), "{name}: there is a picture");
        for partition in PARTITIONS {
            let off = apart(&session, &view, partition);
            assert!(off < 2e-5, "{name}: {partition:?} is {off} apart");
        }
    }
}

/// Every class of events, in a picture of which it alone must be.
#[test]
fn each_event_is_where_it_must_be() {
    let plain = |params: &[(&'static str, ParamValue)]| {
        let params = params.to_vec();
        move |db: &mut SceneDb| {
            db.upsert_material(surface("/stuff", &params));
            let corners = [[-9.0, -9.0, 0.0], [9.0, -9.0, 0.0], [9.0, 9.0, 0.0], [-9.0, 9.0, 0.0]];
            let board = mesh(prim("/board", DMat4::IDENTITY), 1, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5);
            db.upsert_mesh(MeshDesc { material: Some("/stuff".into()), ..board });
        }
    };
    let metal = |roughness| [number("metallic", 1.0), number("roughness", roughness), tint("diffuseColor", [1.0; 3])];
    let none = [number("ior", 1.0), number("roughness", 1.0), tint("diffuseColor", [0.5; 3])];
    // Glass of index 1 reflects nothing.
    let clear = |rough| [number("opacity", 0.0), number("ior", 1.0), number("roughness", rough)];
    let emits = [number("ior", 1.0), tint("diffuseColor", [0.0; 3]), tint("emissiveColor", [0.5; 3])];
    let sky = |db: &mut SceneDb| db.upsert_light(LightDesc { camera_visible: false, ..dome([1.0; 3]) });
    let shine = |db: &mut SceneDb| db.upsert_light(sun(1.0, 5.0, DMat4::IDENTITY));
    type Build<'a> = &'a dyn Fn(&mut SceneDb);
    let cases: [(&str, Build<'_>, Build<'_>); 7] = [
        ("C<RD>B", &plain(&none), &sky),
        ("C<RD>[^B]", &plain(&none), &shine),
        ("C<RG>B", &plain(&metal(0.5)), &sky),
        ("C<RS>B", &plain(&metal(0.0)), &sky),
        ("C<RS>[^B]", &plain(&metal(0.0)), &shine),
        ("C<TS>B", &plain(&clear(0.0)), &sky),
        ("CO", &plain(&emits), &sky),
    ];
    let texts = cases.map(|(text, ..)| text);
    let view = asking(&color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [8, 8])), &texts);
    for (only, board, light) in cases {
        let session = session_of(settings(16, 3), false, |db| {
            board(db);
            light(db);
        });
        render(&session, &view);
        let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
        let shown = color.iter().map(|c| c[0]).sum::<f32>();
        assert!(shown > 1.0, "{only}: something is seen: {shown}");
        for text in texts {
            let sum = image(&session, &view, text).iter().map(|c| c[0]).sum::<f32>();
            let expected = if text == only { shown } else { 0.0 };
            assert!((sum - expected).abs() < 1e-4 * shown, "{text} where only {only} is: {sum}, not {expected}");
        }
    }
}

/// What `C<RD>L` shows is what a light shows whose multiplier of specular reflection is 0, and the other way round.
#[test]
fn light_is_split_by_lobes_as_lights_multipliers_split_it() {
    let red = [0.8, 0.1, 0.05];
    let floor = |db: &mut SceneDb| {
        let params =
            [number("roughness", 0.4), number("clearcoat", 0.6), number("ior", 1.6), tint("diffuseColor", red)];
        db.upsert_material(surface("/plastic", &params));
        let floor = square(prim("/floor", DMat4::IDENTITY), 1, 0.5);
        db.upsert_mesh(MeshDesc { material: Some("/plastic".into()), ..floor });
    };
    let above = DMat4::from_translation(DVec3::new(0.3, 1.2, -0.9)) * DMat4::from_rotation_x(-PI / 2.0);
    let rect = LightKind::Rect { width: 1.0, height: 1.0, texture: None };
    let lamp = LightDesc { prim: prim("/lamp", above), kind: rect, color: [4.0; 3], ..dome([1.0; 3]) };
    // A little beside the direction that mirrors the camera's.
    let mirrored = DMat4::from_rotation_x(PI / 4.0 + 0.2) * DMat4::from_rotation_y(PI);
    let lights = [("a lamp", lamp), ("a sun", sun(2.0, 9.0, mirrored)), ("a sky", dome([0.7; 3]))];
    let view = color_request(orthographic(DVec3::new(0.0, 3.0, 3.0), DVec3::ZERO, 1.2, [16, 12]));
    for (name, light) in lights {
        let shown = |multipliers: [f32; 2], text: &str| {
            let session = session_of(settings(16, 1), false, |db| {
                floor(db);
                db.upsert_light(LightDesc { diffuse: multipliers[0], specular: multipliers[1], ..light.clone() });
            });
            let view = asking(&view, &[text]);
            render(&session, &view);
            image(&session, &view, text)
        };
        for (text, alone) in [("C<RD>L", [1.0, 0.0]), ("C<RG>L", [0.0, 1.0])] {
            let (part, expected) = (shown([1.0; 2], text), shown(alone, "C.*"));
            let most = expected.iter().map(|c| c[0]).fold(0.0, f32::max);
            let off = part
                .iter()
                .zip(&expected)
                .flat_map(|(a, b)| [0, 1, 2].map(|c| (a[c] - b[c]).abs()))
                .fold(0.0, f32::max);
            assert!(most > 0.02 && off < 2e-4 * most, "{name}: {text} is {off} apart of {most}");
        }
    }
}

/// A white mirror under a sky that is alike everywhere changes nothing. What it reflects onto coloured plastic is light
/// of two bounces, whose hue must be that of the lobe: red by the diffuse one, white by the other.
#[test]
fn parts_of_indirect_light_are_right_by_channel() {
    let scene = |has_mirror: bool| {
        move |db: &mut SceneDb| {
            let params = [number("roughness", 0.5), number("ior", 1.8), tint("diffuseColor", [0.8, 0.08, 0.02])];
            db.upsert_material(surface("/plastic", &params));
            let params = [number("metallic", 1.0), number("roughness", 0.0), tint("diffuseColor", [1.0; 3])];
            db.upsert_material(surface("/mirror", &params));
            let floor = square(prim("/floor", DMat4::from_scale(DVec3::splat(0.5))), 1, 0.5);
            db.upsert_mesh(MeshDesc { material: Some("/plastic".into()), ..floor });
            if has_mirror {
                let corners = [[-9.0, 0.01, -1.2], [9.0, 0.01, -1.2], [9.0, 9.0, -1.2], [-9.0, 9.0, -1.2]];
                let wall = mesh(prim("/wall", DMat4::IDENTITY), 2, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5);
                db.upsert_mesh(MeshDesc { material: Some("/mirror".into()), ..wall });
            }
            db.upsert_light(dome([1.0; 3]));
        }
    };
    let view = color_request(orthographic(DVec3::new(0.0, 3.0, 3.0), DVec3::ZERO, 0.5, [16, 16]));
    let mean = |has_mirror: bool, texts: &[&str]| {
        let session = session_of(settings(256, 4), false, scene(has_mirror));
        let view = asking(&view, texts);
        render(&session, &view);
        let sums: Vec<_> = texts.iter().flat_map(|text| image(&session, &view, text)).collect();
        [0, 1, 2].map(|c| sums.iter().map(|pixel| f64::from(pixel[c])).sum::<f64>() / 256.0)
    };
    for (direct, indirect) in [("C<RD>L", "C<RD>[GS]*<RS>.*L"), ("C<RG>L", "C<RG><RS>.*L")] {
        let expected = mean(false, &[direct]);
        let given = mean(true, &[direct, indirect]);
        let through = mean(true, &[indirect]);
        assert!(through[0] > 0.1 * expected[0], "much comes by the mirror: {through:?} of {expected:?}");
        for c in 0..3 {
            assert!((given[c] / expected[c] - 1.0).abs() < 0.01, "{indirect}: {given:?}, not {expected:?}");
        }
    }
}

#[test]
fn light_groups_are_those_of_their_lights() {
    let texts = ["C.*<L.'a'>", "C.*<L.'b'>", "C.*<L.[^'a''b']>", "C.*<O.'c'>", "C<RD'floor'>L"];
    let build = |db: &mut SceneDb| {
        let lamp = |path: &str, color: [f32; 3], x: f64| LightDesc {
            prim: prim(path, DMat4::from_translation(DVec3::new(x, 2.0, 0.0))),
            kind: LightKind::Sphere { radius: 0.2, treat_as_point: false },
            color,
            intensity: 20.0,
            camera_visible: false,
            ..LightDesc::default()
        };
        db.upsert_light(labelled("a", lamp("/a", [1.0, 0.0, 0.0], -1.0)));
        db.upsert_light(labelled("b", lamp("/b", [0.0, 1.0, 0.0], 1.0)));
        db.upsert_light(lamp("/rest", [0.0, 0.0, 1.0], 0.0));
        let floor = square(prim("/floor", DMat4::from_scale(DVec3::splat(4.0))), 1, 0.5);
        db.upsert_mesh(MeshDesc { label: Some("floor".into()), ..floor });
    };
    let view = asking(&color_request(orthographic(DVec3::new(0.0, 5.0, 1.0), DVec3::ZERO, 3.0, [16, 12])), &texts);
    for streams in [false, true] {
        let session = session_of(settings(32, 0), streams, build);
        render(&session, &view);
        let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
        assert!(color.iter().all(|c| c[0] > 0.0 && c[1] > 0.0 && c[2] > 0.0), "all three are seen");
        let parts = texts.map(|text| image(&session, &view, text));
        for (pixel, color) in color.iter().enumerate() {
            for channel in 0..3 {
                let of: Vec<f32> = parts[..3].iter().map(|part| part[pixel][channel]).collect();
                let own = (of[channel] - color[channel]).abs() <= 1e-6 * color[channel];
                assert!(own && of.iter().sum::<f32>() == of[channel], "streaming {streams}: {of:?} of {color:?}");
            }
            assert_eq!(parts[3][pixel], [0.0; 3], "no surface shines");
            // A device may fuse products of one of the two sums.
            let is_same = |c: usize| (parts[4][pixel][c] - color[c]).abs() <= 1e-6 * color[c];
            assert!((0..3).all(is_same), "the floor has a label: {:?} of {color:?}", parts[4][pixel]);
        }
    }
}

#[test]
fn parts_have_the_same_bits_everywhere() {
    let ways = [
        ("shaders", by(TraversalKind::Compute), false),
        ("host", by(TraversalKind::Auto), false),
        ("streaming", by(TraversalKind::Compute), true),
        ("streaming on the host", by(TraversalKind::Auto), true),
        ("at a small budget", Settings { geometry_budget_kib: 64, ..by(TraversalKind::Compute) }, true),
    ];
    let texts = all_partitions();
    let view = asking(&color_request(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::Y * 0.5, 0.7, SIZE)), &texts);
    // The first has more paths than are in flight at a time: their slots are not their places.
    for (name, build, samples) in
        [("nested", nested as fn(&mut SceneDb), 64), ("features", features, 9), ("zoo", zoo, 9)]
    {
        let pictures = ways.clone().map(|(_, way, streams)| {
            let session = open(build, Settings { samples_per_pixel: samples, max_bounces: 4, ..way }, streams);
            render(&session, &view);
            view.aovs.iter().map(|aov| read::<u8>(&session, &view, aov.kind)).collect::<Vec<_>>()
        });
        for ((way, ..), images) in ways.iter().zip(&pictures) {
            for (aov, (a, b)) in view.aovs.iter().zip(pictures[0].iter().zip(images)) {
                assert!(a == b, "{name}, {way}: another {}", aov.kind.name());
            }
        }
        let alone = open(build, Settings { samples_per_pixel: samples, max_bounces: 4, ..ways[0].1.clone() }, false);
        let color = RenderRequest { aovs: view.aovs[..1].to_vec(), ..view.clone() };
        render(&alone, &color);
        assert!(read::<u8>(&alone, &color, AovKind::Color) == pictures[0][0], "{name}: parts change the picture");
    }
}

#[test]
fn parts_go_on_from_a_checkpoint() {
    let folder = Folder::new("parts");
    let name = folder.file("film").to_string_lossy().into_owned();
    let view = asking(&zoo_view(), &["C<RD>.*", "C<RS>.*"]);
    let of = |samples, checkpoint: &str| Settings {
        samples_per_pixel: samples,
        checkpoint: checkpoint.to_owned(),
        checkpoint_secs: 0.0,
        ..by(TraversalKind::Compute)
    };
    for (samples, before, streams) in [(3, 0, false), (5, 3, true)] {
        let session = open(nested, of(samples, &name), streams);
        render(&session, &view);
        assert_eq!(session.stats().samples_kept, before, "it goes on");
        let whole = open(nested, of(samples, ""), false);
        render(&whole, &view);
        for aov in &view.aovs {
            let same = read::<u8>(&session, &view, aov.kind) == read::<u8>(&whole, &view, aov.kind);
            assert!(same, "other bits at {samples} of {}", aov.kind.name());
        }
    }
    let session = open(nested, of(6, &name), false);
    let messages = support::render_with_messages(&session, &asking(&zoo_view(), &["C<RD>.*", "C<RG>.*"]));
    let wanted = "of other filtered images: lpe:C<RD>.*, lpe:C<RS>.*, where";
    assert!(matches!(&*messages, [one] if one.text.contains(wanted)), "{messages:?}");
}

#[test]
fn parts_exist_only_on_request() {
    const NAMES: [&str; 6] =
        ["plane_sums", "plane_values", "light_values", "path_states", "shadow_states", "light path automaton"];
    let made = |texts: &[&str], streams: bool| {
        let session = session_of(settings(2, 1), streams, nested);
        render(&session, &asking(&zoo_view(), texts));
        let inventory = session.stats().inventory;
        let passes = ["shade_aovs", "sum_planes", "resolve_planes"]
            .map(|name| inventory.passes.iter().any(|pass| pass.name == name && pass.made));
        let bytes = NAMES.map(|name| {
            inventory.buffers.iter().filter(|buffer| buffer.name == name).map(|buffer| buffer.bytes).sum::<u64>()
        });
        let has = inventory.features.iter().any(|feature| feature.name == "PATH_EXPRESSIONS" && feature.present);
        (passes, bytes, has, inventory.paths)
    };
    let pixels = u64::from(SIZE[0] * SIZE[1]);
    for streams in [false, true] {
        let (passes, bytes, has, _) = made(&[], streams);
        assert_eq!((passes, bytes, has), ([false; 3], [0; 6], false), "colour alone");
        let (passes, bytes, has, paths) = made(&["C<RD>L", "C<RS>L"], streams);
        assert_eq!((passes, has), ([false, true, true], true), "no pass over first hits");
        let [sums, values, light, states, shadow_states, automaton] = bytes;
        assert_eq!(sums, pixels * 6 * 12, "six sums a pixel");
        assert_eq!((states, shadow_states), (24 * paths, 24 * paths), "states");
        assert!(automaton > 0 && automaton < 2000, "a small automaton: {automaton}");
        let expected = if streams { 24 * paths } else { 0 };
        assert_eq!((light, values >= 24 * paths), (expected, true), "six values a path");
    }
}

#[test]
fn too_many_expressions_are_left_out_with_a_warning() {
    let texts: Vec<String> = (1..=34).map(|depth| format!("C.{{{depth}}}L")).collect();
    let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
    let session = session_of(settings(1, 0), false, nested);
    let view = asking(&zoo_view(), &texts);
    let messages = support::render_with_messages(&session, &view);
    let is_told = |text: &str| text.ends_with("lpe:C.{33}L, lpe:C.{34}L");
    assert!(matches!(&*messages, [one] if is_told(&one.text)), "{messages:?}");
    assert!(image(&session, &view, "C.{1}L").iter().any(|c| c[0] > 0.0), "the others are there");
    assert!(!session.read_aov(part("C.{33}L"), &mut [0; 12]), "it is not there");
}

/// A floor with a roof over it or without, in the light of each kind of light; what is seen of it with this expression.
fn below_a_roof(text: &str, roof: bool, streams: bool, light: &dyn Fn(&mut SceneDb)) -> (Vec<[f32; 3]>, Session) {
    let view = color_request(orthographic(DVec3::new(0.0, 5.0, 5.0), DVec3::ZERO, 0.01, [8, 8]));
    let view = asking(&view, &[text]);
    let session = session_of(settings(256, 1), streams, |db| {
        db.upsert_mesh(square(prim("/floor", DMat4::from_scale(DVec3::splat(0.1))), 1, 0.5));
        if roof {
            let place = DMat4::from_translation(DVec3::Y * 3.0) * DMat4::from_scale(DVec3::new(9.0, 1.0, 2.0));
            db.upsert_mesh(square(prim("/roof", place), 2, 0.0));
        }
        light(db);
    });
    render(&session, &view);
    (image(&session, &view, text), session)
}

/// A light with a name.
type LightKindScene<'a> = (&'a str, &'a dyn Fn(&mut SceneDb));

/// Light without what is in its way is that of the scene without it, whatever finds it; where nothing is in the way it
/// is the light itself.
#[test]
fn unoccluded_light_is_that_without_the_occluder() {
    let lamp = |db: &mut SceneDb| {
        let kind = LightKind::Sphere { radius: 0.7, treat_as_point: false };
        let place = DMat4::from_translation(DVec3::Y * 4.0);
        db.upsert_light(LightDesc { prim: prim("/lamp", place), kind, color: [5.0; 3], ..dome([1.0; 3]) });
    };
    let glowing = |db: &mut SceneDb| {
        let ball = sphere(prim("/ball", DMat4::from_translation(DVec3::Y * 4.5)), 3, 6, 0.0);
        db.upsert_mesh(MeshDesc { material: Some("/glow".into()), ..ball });
        db.upsert_material(glow("/glow", [5.0; 3]));
    };
    let down = DMat4::from_rotation_x(-PI / 2.0);
    let kinds: [LightKindScene<'_>; 4] = [
        ("a lamp", &lamp),
        ("a sun of one direction", &|db| db.upsert_light(sun(1.0, 0.0, down))),
        ("a wide sun", &|db| db.upsert_light(sun(1.0, 30.0, down))),
        ("the sky", &|db| db.upsert_light(LightDesc { camera_visible: false, ..dome([0.5; 3]) })),
    ];
    let mean = |image: &[[f32; 3]]| image.iter().map(|c| f64::from(c[0])).sum::<f64>() / image.len() as f64;
    for (what, light) in kinds {
        let shown = |text: &str, roof: bool| mean(&below_a_roof(text, roof, false, light).0);
        let (open, covered) = (shown("C<RD>[LO]", false), shown("C<RD>[LO]", true));
        assert!(open > 0.05 && covered < 0.9 * open, "{what}: the roof is in the way, {covered} of {open}");
        for roof in [false, true] {
            let given = shown("unoccluded;C<RD>[LO]", roof);
            assert!((given / open - 1.0).abs() < 0.03, "{what}, roof {roof}: {given}, not {open}");
        }
    }
    for roof in [false, true] {
        let [with, without] = ["C.*", "unoccluded;C.*"].map(|text| below_a_roof(text, roof, false, &glowing).0);
        assert!(with == without, "a mesh that emits keeps its shadows, roof {roof}");
    }
    let both = [false, true].map(|streams| below_a_roof("unoccluded;C.*L", true, streams, &lamp).0);
    assert!(both[0] == both[1], "the same bits while streaming");
}
