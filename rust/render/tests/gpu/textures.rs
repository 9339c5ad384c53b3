// SPDX-License-Identifier: Apache-2.0
//! Textures in renders: known colours, warnings, absent textures; and the same bits at every budget, of textured
//! surfaces and of thousands of leaves with holes.

mod clipped_boxes;
mod filter;
mod leaving_streaming;
mod native_cutouts;
mod opacity_masks;
mod programs;
mod test_images;
mod tile_demand;

use self::test_images::{Library, Noise, hash};
use crate::scenes::{constant, dome, instanced, instancer, mesh, prim, square, sun};
use crate::support::{self, orthographic, perspective, read, read_all, render_with_messages, request, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_abi::FAULT_ALL;
use oocpt_core::TypedArray;
use oocpt_core::residency::PolicyKind;
use oocpt_core::scene::{
    AssetRef, ConnectionDesc, Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, NodeDesc, ParamDesc, ParamValue,
    Primvar, SceneDb, TransformSample,
};
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_core::stats::StreamingStats;
use oocpt_core::texture::linear_from_srgb;
use oocpt_render::{AovKind, PlantedFaults, RenderRequest, Session, SessionOptions};
use std::sync::Arc;

fn text(value: &str) -> ParamValue {
    ParamValue::Text(value.into())
}

fn node(path: &str, kind: &str, params: Vec<(&str, ParamValue)>, connections: &[(&str, usize, &str)]) -> NodeDesc {
    let params = params.into_iter().map(|(name, value)| ParamDesc { name: name.into(), value });
    let connections = connections.iter().map(|(input, node, output)| ConnectionDesc {
        input: (*input).into(),
        node: *node,
        output: (*output).into(),
    });
    NodeDesc { path: path.into(), kind: kind.into(), params: params.collect(), connections: connections.collect() }
}

/// A material: the surface's own inputs, and those that are outputs of the texture `file`.
fn textured(path: &str, file: &str, own: Vec<(&str, ParamValue)>, read: &[(&str, &str)]) -> MaterialDesc {
    let asset = ParamValue::Asset(AssetRef { authored: file.into(), resolved: file.into() });
    let inputs: Vec<(&str, usize, &str)> = read.iter().map(|(input, output)| (*input, 1, *output)).collect();
    let fallback = ("fallback", ParamValue::Vec4([0.25, 0.5, 0.75, 1.0]));
    let wraps = vec![("file", asset), ("wrapS", text("repeat")), ("wrapT", text("mirror")), fallback];
    let nodes = vec![
        node("/surface", "UsdPreviewSurface", own, &inputs),
        node("/texture", "UsdUVTexture", wraps, &[("st", 2, "result")]),
        node("/reader", "UsdPrimvarReader_float2", vec![("varname", text("st"))], &[]),
    ];
    MaterialDesc { path: path.into(), nodes, surface: Some(0), ..MaterialDesc::default() }
}

/// A square with st from 0 to `repeats`.
fn with_st(mut desc: MeshDesc, repeats: f32, material: &str) -> MeshDesc {
    let st = vec![[0.0, 0.0], [repeats, 0.0], [repeats, repeats], [0.0, repeats]];
    let primvar = Primvar { interpolation: Interpolation::Vertex, values: TypedArray::of(st), indices: None };
    desc.primvars.push(NamedPrimvar { name: "st".into(), primvar });
    desc.material = Some(material.into());
    desc
}

fn options() -> SessionOptions {
    SessionOptions { validation: true, ..SessionOptions::default() }
}

fn session(settings: Settings, options: SessionOptions, build: fn(&mut SceneDb)) -> Session {
    let session = Session::with_options(settings, options).with_images(Arc::new(Library));
    session.with_scene(build);
    session
}

/// An image of 32 x 32 on a board that fills the picture of 32 x 32: every pixel is a texel, sampled at its centre.
fn board(db: &mut SceneDb, file: &str) {
    let points = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let desc = mesh(prim("/board", DMat4::IDENTITY), 1, points, &[vec![0, 1, 2, 3]], 0.5);
    db.upsert_mesh(with_st(desc, 1.0, "/m"));
    db.upsert_material(textured("/m", file, Vec::new(), &[("diffuseColor", "rgb")]));
    db.upsert_light(dome([1.0; 3]));
}

fn front() -> RenderRequest {
    request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [32, 32]))
}

#[test]
fn texels_appear_at_their_texture_coordinates() {
    let session = session(settings(1, 1), options(), |db| board(db, "32x32x3"));
    support::render(&session, &front());
    let albedo: Vec<[f32; 3]> = read(&session, &front(), AovKind::Albedo);
    let noise = Noise { size: [32, 32], channels: 3, seed: 32 };
    for (i, seen) in (0..).zip(&albedo) {
        let texel = noise.texel(i % 32, i / 32);
        for (value, byte) in seen.iter().zip(texel) {
            let expected = linear_from_srgb(f64::from(byte) / 255.0);
            assert!((f64::from(*value) - expected).abs() < 2e-5, "pixel {i}: {seen:?} for {texel:?}");
        }
    }
    let left_out = session.stats().features_left_out;
    assert!(!left_out.iter().any(|part| part.starts_with("textures,")), "{left_out:?}");
}

#[test]
fn a_missing_image_is_one_warning_and_its_fallback() {
    let session = session(settings(1, 1), options(), |db| board(db, "nothing"));
    let messages = render_with_messages(&session, &front());
    assert_eq!(messages.len(), 1, "{messages:?}");
    let named = ["nothing", "/texture"].iter().all(|name| messages[0].text.contains(name));
    assert!(named, "the file and the prim: {messages:?}");
    let albedo: Vec<[f32; 3]> = read(&session, &front(), AovKind::Albedo);
    assert!(albedo.iter().all(|pixel| *pixel == [0.25, 0.5, 0.75]), "the fallback: {:?}", albedo[0]);
}

/// Scale and bias are the picture's, not the fallback's; its channels are told apart.
#[test]
fn the_fallback_applies_to_every_channel() {
    for (output, expected) in [("rgb", [0.25, 0.5, 0.75]), ("r", [0.25; 3]), ("g", [0.5; 3]), ("b", [0.75; 3])] {
        let session = Session::with_options(settings(1, 1), options()).with_images(Arc::new(Library));
        session.with_scene(|db| {
            board(db, "nothing");
            let mut desc = textured("/m", "nothing", Vec::new(), &[("diffuseColor", output)]);
            for (name, value) in [("scale", 0.5), ("bias", 0.125)] {
                desc.nodes[1].params.push(ParamDesc { name: name.into(), value: ParamValue::Vec4([value; 4]) });
            }
            db.upsert_material(desc);
        });
        assert_eq!(render_with_messages(&session, &front()).len(), 1, "the file is missing");
        let albedo: Vec<[f32; 3]> = read(&session, &front(), AovKind::Albedo);
        assert!(albedo.iter().all(|pixel| *pixel == expected), "{output}: {:?}", albedo[0]);
    }
}

#[test]
fn an_unreadable_texture_gives_one_warning_and_the_fallback() {
    let seen = |budget: Option<u32>| {
        let settings = Settings { geometry_budget_kib: budget.unwrap_or(0), ..settings(1, 1) };
        let streams = SessionOptions { force_streaming: budget.is_some(), ..options() };
        let session = session(settings, streams, |db| board(db, "torn"));
        let request = request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [256, 256]));
        let messages = render_with_messages(&session, &request);
        let text = messages.iter().map(|message| message.text.as_str()).collect::<Vec<_>>().join("; ");
        assert!(
            messages.len() == 1 && text.contains("torn") && text.contains("/texture"),
            "one line, both names: {text}"
        );
        read::<[f32; 3]>(&session, &request, AovKind::Albedo)
    };
    let albedo = seen(None);
    // An image is decoded as a whole: if it breaks off there are no coarser levels of it either.
    assert!(albedo.iter().all(|pixel| *pixel == [0.25, 0.5, 0.75]), "its fallback everywhere: {:?}", albedo[0]);
    assert!(seen(Some(256)) == albedo, "the same when it streams");
}

#[test]
fn a_scene_without_textures_leaves_them_out() {
    let session = session(settings(1, 1), options(), |db| {
        db.upsert_mesh(square(prim("/ground", DMat4::IDENTITY), 1, 0.5));
        db.upsert_light(dome([1.0; 3]));
    });
    support::render(&session, &front());
    let left_out = session.stats().features_left_out;
    assert!(left_out.iter().any(|part| part.starts_with("textures,")), "{left_out:?}");
}

fn lights(db: &mut SceneDb) {
    db.upsert_light(dome([0.4, 0.5, 0.7]));
    db.upsert_light(sun(2.0, 2.0, DMat4::from_rotation_x(-0.8) * DMat4::from_rotation_y(0.5)));
}

/// Tilted squares over a ground, and a wall beside the view on which a texture is stretched by eight; five textures,
/// some inputs of one and some of another kind.
fn squares(db: &mut SceneDb) {
    lights(db);
    let both = [("diffuseColor", "rgb"), ("roughness", "a")];
    for (i, (file, read)) in (0..).zip([
        ("900x700x3", &both[..1]),
        ("1000x800x4", &both[..]),
        ("1100x300x4", &both[..]),
        ("512x512x1", &both[..1]),
        ("640x1030x2", &both[..]),
    ]) {
        db.upsert_material(textured(&format!("/m{i}"), file, Vec::new(), read));
    }
    let ground = square(prim("/ground", DMat4::from_scale(DVec3::splat(12.0))), 1, 0.5);
    db.upsert_mesh(with_st(ground, 1.5, "/m0"));
    let wall = DMat4::from_translation(DVec3::X * 1.2)
        * DMat4::from_rotation_z(1.5)
        * DMat4::from_scale(DVec3::new(1.0, 1.0, 12.0));
    let mut wall = with_st(square(prim("/wall", wall), 2, 0.5), 1.0, "/m1");
    wall.primvars[0].primvar.values = TypedArray::of(vec![[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.5], [0.0, 1.5]]);
    db.upsert_mesh(wall);
    for i in 0..30_i32 {
        let at = DVec3::new(f64::from(i % 6) * 1.5 - 3.75, 0.4, f64::from(i / 6) * 1.5 - 4.0);
        let place = DMat4::from_translation(at) * DMat4::from_rotation_x(0.9) * DMat4::from_scale(DVec3::splat(0.5));
        let desc = square(prim(&format!("/square_{i}"), place), 4 + i, 0.5);
        db.upsert_mesh(with_st(desc, 1.0, &format!("/m{}", 1 + i % 4)));
    }
}

/// Thousands of leaves with holes, half of them there by chance, among the squares.
fn leaves(db: &mut SceneDb) {
    squares(db);
    let unit = |i: u32, k: u32| f64::from(hash(3 * i + k) >> 8) / f64::from(1 << 24) - 0.5;
    for (name, first, threshold) in [("/sharp", 0, 0.5), ("/soft", 1, 0.0)] {
        let places: Vec<_> = (first..4000)
            .step_by(2)
            .map(|i| {
                let at = DVec3::new(unit(i, 0), unit(i, 2) / 6.0, unit(i, 1)) * 12.0 + DVec3::Y * 1.2;
                let turn = DQuat::from_rotation_y(f64::from(i)) * DQuat::from_rotation_x(1.0);
                (at, turn, DVec3::splat(0.12))
            })
            .collect();
        let leaf = format!("{name}/leaf");
        db.upsert_instancer(instancer(prim(name, DMat4::IDENTITY), &leaf, &places));
        let id = 100 + i32::try_from(first).expect("small");
        let mut desc = square(instanced(prim(&leaf, DMat4::IDENTITY), name), id, 0.5);
        desc.display_color = constant([0.2_f32, 0.5, 0.1]);
        let material = format!("{name}_leaf");
        db.upsert_mesh(with_st(desc, 1.0, &material));
        let mut own = vec![("opacityThreshold", ParamValue::Float(threshold))];
        if first == 1 {
            own.push(("opacityMode", text("presence")));
        }
        db.upsert_material(textured(&material, "700x900x2", own, &[("opacity", "a")]));
    }
}

fn small_chunks() -> Settings {
    support::filtering(Settings { chunk_size_kib: 16, ..settings(4, 3) })
}

fn close() -> RenderRequest {
    request(perspective(DVec3::new(0.0, 1.6, 3.0), DVec3::new(0.0, 0.2, 0.0), 0.6, [96, 64]))
}

struct Render {
    images: Vec<Vec<u8>>,
    stats: StreamingStats,
}

fn render(build: fn(&mut SceneDb), settings: Settings, options: SessionOptions) -> Render {
    let session = session(settings, options, build);
    support::render(&session, &close());
    Render { images: read_all(&session, &close()), stats: session.stats().streaming }
}

fn smallest_budget(build: fn(&mut SceneDb)) -> u32 {
    let session = session(Settings { geometry_budget_kib: 1, ..small_chunks() }, options(), build);
    let messages = render_with_messages(&session, &close());
    let text = &messages.first().expect("a budget of one KiB is an error").text;
    let needed = text.split("needs ").nth(1).and_then(|rest| rest.split(" KiB").next());
    needed.and_then(|kib| kib.parse().ok()).expect("the message says what is needed")
}

/// Renders at every budget, each under another policy, and compares with everything resident. Policies decide when a
/// tile comes, not what is done with it: all of them with all budgets are tried with one scene, or with all tests.
fn same_bits(build: fn(&mut SceneDb)) {
    same_bits_at(build, 2);
}

/// At so many budgets, each with a policy of its own; with all tests at each of three with each policy.
fn same_bits_at(build: fn(&mut SceneDb), budgets: usize) {
    let every_policy = support::is_full();
    let whole = render(build, small_chunks(), options());
    assert!(whole.stats.in_core && whole.stats.texture_scene_bytes > 8 << 20, "all fits: {:?}", whole.stats);
    let smallest = smallest_budget(build);
    let policies = [PolicyKind::Benefit, PolicyKind::Priority, PolicyKind::Sweep];
    let all = [smallest, 512, 4 << 10];
    for (at, budget) in all.into_iter().enumerate().take(if every_policy { 3 } else { budgets }) {
        for policy in if every_policy { &policies[..] } else { &policies[at..=at] } {
            let settings = Settings { geometry_budget_kib: budget, policy: *policy, ..small_chunks() };
            let part = render(build, settings, SessionOptions { force_streaming: true, ..options() });
            let what = format!("{policy}, {budget} KiB of {}", whole.stats.scene_bytes >> 10);
            let stats = &part.stats;
            assert!(part.images == whole.images, "{what}: the picture differs");
            assert!(!stats.in_core && stats.texture_loads > 0, "{what}: tiles were loaded: {stats:?}");
            assert!(stats.texture_bytes <= stats.geometry_bytes, "{what}: tiles are a part: {stats:?}");
            assert!(stats.geometry_peak_bytes <= u64::from(budget) << 10, "{what}: above the budget: {stats:?}");
            if budget == smallest {
                assert!(stats.texture_reloads > 0, "{what}: tiles came and went: {stats:?}");
            }
        }
    }
}

#[test]
fn texture_streaming_changes_no_bit() {
    same_bits_at(squares, 3);
}

/// Tiles for which the device has no room are read in host memory where rays may, in this picture and the next one.
#[test]
fn tiles_beyond_the_budget_are_read_in_host_memory() {
    let whole = render(squares, small_chunks(), options());
    let geometry_budget_kib = smallest_budget(squares);
    let pictures = |host_mapped, options: SessionOptions| {
        let settings = Settings { geometry_budget_kib, host_mapped, ..small_chunks() };
        let session = session(settings, options, squares);
        let mut stats = Vec::new();
        for _ in 0..2 {
            support::render(&session, &close());
            assert!(read_all(&session, &close()) == whole.images, "{host_mapped:?}: the picture differs");
            stats.push(session.stats().streaming);
            session.restart();
        }
        stats
    };
    let streams = SessionOptions { force_streaming: true, ..options() };
    let (without, mapped) = (pictures(HostMapped::Off, streams), pictures(HostMapped::On, streams));
    assert!(without.iter().all(|stats| stats.texture_reloads > stats.texture_loads / 2), "they go: {without:?}");
    let few = without[0].texture_loads / 8;
    assert!(mapped.iter().all(|stats| stats.texture_loads < few && stats.mapped_bytes > 0), "they stay: {mapped:?}");
}

/// Boards that shine with their textures, and few other lights: the emission of lights waits for tiles as well.
fn signs(db: &mut SceneDb) {
    squares(db);
    for (i, file) in (0..).zip(["1000x800x4", "900x700x3", "1100x300x4"]) {
        let name = format!("/glow_{i}");
        let own = vec![("diffuseColor", ParamValue::Vec3([0.0; 3]))];
        db.upsert_material(textured(&name, file, own, &[("emissiveColor", "rgb")]));
        let at = DMat4::from_translation(DVec3::new(f64::from(i) * 3.0 - 3.0, 0.9, -1.0 - f64::from(i % 2)));
        let board = at * DMat4::from_rotation_x(1.3) * DMat4::from_scale(DVec3::new(1.5, 1.0, 0.8));
        db.upsert_mesh(with_st(square(prim(&format!("/sign_{i}"), board), 60 + i, 0.5), 1.0, &name));
    }
}

/// The same boards, swinging.
fn swinging_signs(db: &mut SceneDb) {
    signs(db);
    for i in 0..3 {
        let at = DMat4::from_translation(DVec3::new(f64::from(i) * 3.0 - 3.0, 0.9, -1.0 - f64::from(i % 2)));
        let map = |time: f64| {
            at * DMat4::from_rotation_x(1.3 + 0.4 * time) * DMat4::from_scale(DVec3::new(1.5, 1.0, 0.8 + 0.2 * time))
        };
        let board = square(prim(&format!("/sign_{i}"), map(0.5)), 60 + i, 0.5);
        let mut board = with_st(board, 1.0, &format!("/glow_{i}"));
        board.prim.motion = [0.0, 1.0].map(|time| TransformSample { time, transform: map(time) }).to_vec();
        db.upsert_mesh(board);
    }
}

#[test]
fn streaming_emission_textures_changes_no_bit() {
    same_bits(signs);
    same_bits_at(swinging_signs, 1);
}

#[test]
fn streaming_cutout_textures_changes_no_bit() {
    same_bits(leaves);
}

#[test]
fn a_leaf_lost_when_deferred_is_noticed() {
    let whole = render(leaves, small_chunks(), options());
    let budget = smallest_budget(leaves).max(1 << 10);
    let settings = Settings { geometry_budget_kib: budget, ..small_chunks() };
    let faults = PlantedFaults { lost_chunks: FAULT_ALL, ..PlantedFaults::default() };
    let planted = SessionOptions { force_streaming: true, faults, ..options() };
    let part = render(leaves, settings, planted);
    assert!(part.images != whole.images, "the comparison must see lost leaves");
}
