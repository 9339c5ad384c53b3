// SPDX-License-Identifier: Apache-2.0
//! Coverage of cutouts: the same from every distance, and the same bits in core, where lookups may have passes of their
//! own, streaming, and natively. Up close masks change nothing.

#![expect(clippy::cast_precision_loss, reason = "counts of pixels")]

use super::test_images::LEAF_AREA;
use super::*;
use oocpt_abi::Features;
use oocpt_core::inventory::RenderInventory;
use oocpt_core::settings::TraversalKind;

/// Image, wrap modes, factor, summand, threshold (0: a probability).
type Cut = (&'static str, [&'static str; 2], f32, f32, f32);

const CUTS: [Cut; 12] = [
    ("disc 64x64", ["clamp", "clamp"], 1.0, 0.0, 0.5),
    ("disc 300x200", ["black", "black"], 1.0, 0.0, 0.5),
    ("disc 512x512", ["repeat", "repeat"], 1.0, 0.0, 0.75),
    ("disc 33x70", ["mirror", "repeat"], 1.0, 0.0, 0.25),
    ("disc 128x256", ["repeat", "clamp"], -1.0, 1.0, 0.5),
    ("disc 1200x700", ["clamp", "black"], -2.0, 1.25, 0.5),
    ("disc 3x2", ["mirror", "mirror"], 1.0, 0.0, 0.4),
    ("disc 1x1", ["repeat", "clamp"], 1.0, 0.0, 0.4),
    ("disc 128x128", ["clamp", "repeat"], 1.0, 0.0, 0.0),
    ("disc 200x256", ["black", "mirror"], 0.5, 0.25, 0.0),
    ("256x256x2", ["repeat", "mirror"], 1.0, 0.0, 0.5),
    ("nothing", ["repeat", "mirror"], 1.0, 0.0, 0.5),
];

pub(super) fn material_of(path: &str, (file, wraps, scale, bias, threshold): Cut) -> MaterialDesc {
    let mut own = vec![("opacityThreshold", ParamValue::Float(threshold))];
    if threshold == 0.0 {
        own.push(("opacityMode", text("presence")));
    }
    let mut desc = textured(path, file, own, &[("opacity", "a")]);
    let mut set = |name: &str, value: ParamValue| {
        let params = &mut desc.nodes[1].params;
        params.retain(|param| *param.name != *name);
        params.push(ParamDesc { name: name.into(), value });
    };
    set("wrapS", text(wraps[0]));
    set("wrapT", text(wraps[1]));
    set("scale", ParamValue::Vec4([scale; 4]));
    set("bias", ParamValue::Vec4([bias; 4]));
    desc
}

const AROUND: [[f32; 2]; 4] = [[-0.7, -1.2], [1.8, -0.9], [2.1, 1.6], [-1.3, 1.9]];

/// Leaves of all sizes, each kind cut in another way, of which every other one has coordinates that leave the image on
/// all sides.
pub(super) fn cut_in_many_ways(db: &mut SceneDb) {
    cut_with(db, |kind| kind.is_multiple_of(2).then_some(AROUND));
}

/// The same with coordinates that no author means.
pub(super) fn cut_with_bad_coordinates(db: &mut SceneDb) {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let bad = [
        [[0.3, 0.6]; 4],
        [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0], [-1.0, -1.0]],
        [[nan, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        [[0.0, 0.0], [inf, 0.0], [1.0, 1.0], [0.0, 1.0]],
        [[-1.0e30, 0.0], [1.0e30, 0.0], [1.0e30, 1.0], [-1.0e30, 1.0]],
        [[0.2, 0.2], [0.2 + 1.0e-6, 0.2], [0.2 + 1.0e-6, 0.9], [0.2, 0.9]],
        [[3.0e38, 3.0e38], [-3.0e38, 3.0e38], [-3.0e38, -3.0e38], [3.0e38, -3.0e38]],
    ];
    cut_with(db, |kind| Some(bad[kind as usize % bad.len()]));
}

fn cut_with(db: &mut SceneDb, coordinates: impl Fn(u32) -> Option<[[f32; 2]; 4]>) {
    let ground = DMat4::from_scale(DVec3::splat(20.0));
    db.upsert_mesh(square(prim("/ground", ground), 1, 0.5));
    db.upsert_light(dome([1.0; 3]));
    db.upsert_light(sun(2.0, 1.0, DMat4::from_rotation_x(-0.8)));
    let unit = |i: u32, k: u32| f64::from(hash(5 * i + k) >> 8) / f64::from(1 << 24) - 0.5;
    for (kind, cut) in (0_u32..).zip(CUTS) {
        let places: Vec<_> = (0..120)
            .map(|i| 1000 * kind + i)
            .map(|i| {
                let at = DVec3::new(unit(i, 0) * 4.0, unit(i, 1) * 1.5 + 0.9, unit(i, 2) * 4.0);
                let turn = DQuat::from_rotation_y(f64::from(i)) * DQuat::from_rotation_x(0.3 + unit(i, 3));
                (at, turn, DVec3::new(0.3, 0.3, 0.3) * (unit(i, 4) * 6.0).exp2())
            })
            .collect();
        let name = format!("/kind_{kind}");
        let leaf = format!("{name}/leaf");
        db.upsert_instancer(instancer(prim(&name, DMat4::IDENTITY), &leaf, &places));
        let id = 10 + i32::try_from(kind).expect("small");
        let mut desc = square(instanced(prim(&leaf, DMat4::IDENTITY), &name), id, 0.5);
        let material = format!("{name}_material");
        desc.display_color = constant([0.2_f32, 0.5, 0.1]);
        desc = with_st(desc, 1.0, &material);
        if let Some(st) = coordinates(kind) {
            desc.primvars[0].primvar.values = TypedArray::of(st.to_vec());
        }
        db.upsert_mesh(desc);
        db.upsert_material(material_of(&material, cut));
    }
}

fn with_masks(are_there: bool, budget: Option<u32>) -> Render {
    masked(cut_in_many_ways, (are_there, false), budget, small_chunks()).0
}

/// Whether there are masks, and whether what they do not know has passes of its own.
pub(super) type Masks = (bool, bool);

pub(super) fn masked(
    build: fn(&mut SceneDb),
    (are_there, are_apart): Masks,
    budget: Option<u32>,
    settings: Settings,
) -> (Render, Session) {
    let more_features = if are_apart { Features::DEFERRED_CUTOUTS } else { Features::empty() };
    let (no_opacity_masks, no_deferred_cutouts) = (!are_there, !are_apart);
    let faults = PlantedFaults { no_opacity_masks, no_deferred_cutouts, more_features, ..PlantedFaults::default() };
    let force_streaming = budget.is_some();
    let settings = Settings { geometry_budget_kib: budget.unwrap_or(0), ..settings };
    let wanted = settings.traversal;
    let session = session(settings, SessionOptions { faults, force_streaming, ..options() }, build);
    render_with_messages(&session, &close());
    let RenderInventory { features: listed, traversal: used, passes, .. } = session.stats().inventory;
    assert!(wanted != TraversalKind::Native || used.backend == "native", "{used:?}");
    let has = |name: &str| listed.iter().find(|feature| feature.name == name).expect("a feature").present;
    assert_eq!(has("OPACITY_MASKS"), are_there, "masks are used where they are wanted");
    let settles = passes.iter().filter(|pass| pass.name.starts_with("settle_") && pass.made).count();
    assert_eq!((has("DEFERRED_CUTOUTS"), settles), (are_apart, if are_apart { 2 } else { 0 }), "passes of their own");
    let render = Render { images: read_all(&session, &close()), stats: session.stats().streaming };
    (render, session)
}

/// The shaders that ask together, those that look up in passes of their own, and streaming.
#[test]
fn masked_cutouts_have_the_same_bits_in_every_engine() {
    let (together, _) = masked(cut_in_many_ways, (true, false), None, small_chunks());
    assert!(together.stats.in_core, "all of it fits");
    let (apart, _) = masked(cut_in_many_ways, (true, true), None, small_chunks());
    assert!(apart.images == together.images, "the picture differs where lookups have passes of their own");
    let without = with_masks(false, Some(600));
    for budget in [600, 2 << 10] {
        let part = with_masks(true, Some(budget));
        assert!(part.images == together.images, "the picture differs at {budget} KiB");
        let loads = [&without, &part].map(|render| render.stats.texture_loads);
        assert!(!part.stats.in_core && loads[1] > 0, "tiles were loaded: {:?}", part.stats);
        assert!(3 * loads[1] < 2 * loads[0], "rays wait for fewer tiles: {loads:?}");
    }
}

#[test]
fn opacity_masks_tolerate_nan_coordinates() {
    let (together, _) = masked(cut_with_bad_coordinates, (true, false), None, small_chunks());
    for (masks, budget) in [((true, true), None), ((true, false), Some(600))] {
        let (other, _) = masked(cut_with_bad_coordinates, masks, budget, small_chunks());
        assert!(other.images == together.images, "{masks:?} {budget:?}: the picture differs");
    }
}

/// The host looks at masks and textures as the shaders do. On a device with memory of its own there is nothing to
/// compare.
#[test]
fn native_masked_cutouts_match_the_shaders() {
    for build in [cut_in_many_ways, cut_with_bad_coordinates] {
        let (shaders, session) = masked(build, (true, false), None, small_chunks());
        if !session.device_report().expect("a device").host_memory {
            return;
        }
        let native = Settings { traversal: TraversalKind::Native, ..small_chunks() };
        for budget in [None, Some(600)] {
            let (host, _) = masked(build, (true, false), budget, native.clone());
            assert!(host.images == shaders.images, "KiB: {budget:?}: the picture differs");
        }
    }
    let (shaders, _) = masked(cut_in_many_ways, (false, false), None, small_chunks());
    let native = Settings { traversal: TraversalKind::Native, ..small_chunks() };
    let (host, _) = masked(cut_in_many_ways, (false, false), None, native);
    assert!(host.images == shaders.images, "without masks: the picture differs");
}

/// As many cards along a side as there are, side by side, that fill a square of 2 x 2; `part` is where the image of a
/// card is.
pub(super) fn cards(path: &str, id: i32, along: u16, part: impl Fn(u16, u16) -> [f32; 2]) -> MeshDesc {
    let at = |i: u16| 2.0 * f32::from(i) / f32::from(along) - 1.0;
    let points = (0..=along).flat_map(|y| (0..=along).map(move |x| [at(x), at(y), 0.0])).collect();
    let number = |x: u16, y: u16| i32::from(y) * (i32::from(along) + 1) + i32::from(x);
    let all = || (0..along).flat_map(|y| (0..along).map(move |x| (x, y)));
    let faces: Vec<Vec<i32>> =
        all().map(|(x, y)| vec![number(x, y), number(x + 1, y), number(x + 1, y + 1), number(x, y + 1)]).collect();
    let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    let st: Vec<[f32; 2]> =
        all().flat_map(|(x, y)| corners.map(|[s, t]| [s + part(x, y)[0], t + part(x, y)[1]])).collect();
    let mut desc = mesh(prim(path, DMat4::IDENTITY), id, points, &faces, 0.5);
    let primvar = Primvar { interpolation: Interpolation::FaceVarying, values: TypedArray::of(st), indices: None };
    desc.primvars.push(NamedPrimvar { name: "st".into(), primvar });
    desc.material = Some("/m".into());
    desc
}

/// What share of camera rays meets something, and of pixels that have an id.
pub(super) fn coverage(samples: u32, masks: Masks, budget: Option<u32>, build: impl Fn(&mut SceneDb)) -> [f64; 2] {
    let more_features = if masks.1 { Features::DEFERRED_CUTOUTS } else { Features::empty() };
    let (no_opacity_masks, no_deferred_cutouts) = (!masks.0, !masks.1);
    let faults = PlantedFaults { no_opacity_masks, no_deferred_cutouts, more_features, ..PlantedFaults::default() };
    let force_streaming = budget.is_some();
    let settings = Settings { geometry_budget_kib: budget.unwrap_or(0), ..settings(samples, 1) };
    let options = SessionOptions { faults, force_streaming, ..options() };
    let session = Session::with_options(settings, options).with_images(Arc::new(Library));
    session.with_scene(build);
    let request = request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [64, 64]));
    support::render(&session, &request);
    let features = session.stats().inventory.features;
    assert_eq!(features.iter().any(|feature| feature.name == "OPACITY_MASKS" && feature.present), masks.0, "masks");
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    let alpha = pixels.iter().map(|pixel| f64::from(pixel[3])).sum::<f64>() / pixels.len() as f64;
    [alpha, ids.iter().filter(|id| **id >= 0).count() as f64 / ids.len() as f64]
}

/// Cards of 16 pixels, of 4, of 1, of a quarter and of an eighth: as from ever farther away.
pub(super) const DISTANCES: [u16; 5] = [4, 16, 64, 256, 512];
const IN_CORE: [Masks; 3] = [(true, false), (true, true), (false, false)];

pub(super) fn is_near(what: &str, found: f64, expected: f64) {
    assert!((found / expected - 1.0).abs() < 0.01, "{what}: {found}, not {expected}");
}

#[test]
fn coverage_of_a_cutout_is_the_same_from_every_distance() {
    let wraps = ["clamp", "clamp"];
    for along in DISTANCES {
        for (file, scale, bias, threshold, expected) in [
            ("leaf 512x512", 1.0, 0.0, 0.5, LEAF_AREA),
            ("leaf 75x40", -1.0, 1.0, 0.5, 1.0 - LEAF_AREA),
            ("leaf 1200x900", 0.8, 0.0, 0.0, 0.8 * (LEAF_AREA + std::f64::consts::PI * 0.0025 / 12.0)),
        ] {
            for masks in IN_CORE.into_iter().take(if along == 64 { 3 } else { 1 }) {
                let [alpha, _] = coverage(64, masks, None, |db| {
                    db.upsert_mesh(cards("/cards", 1, along, |_, _| [0.0; 2]));
                    db.upsert_material(material_of("/m", (file, wraps, scale, bias, threshold)));
                });
                is_near(&format!("{along} cards of {file}, {masks:?}"), alpha, expected);
            }
        }
    }
}

/// What is seen through ten layers with so many cards along a side each; leaves are in the same place or anywhere.
fn seen_through(along: u16, are_anywhere: bool, budget: Option<u32>) -> f64 {
    let [alpha, _] = coverage(64, (true, false), budget, |db| {
        db.upsert_material(material_of("/m", ("leaf 512x512", ["repeat", "repeat"], 1.0, 0.0, 0.5)));
        for i in 0..10_u16 {
            let at = |x: u16, y: u16, k: u32| {
                let number = hash(u32::from(i) << 24 | u32::from(x) << 12 | u32::from(y) << 1 | k);
                if are_anywhere { (number >> 8) as f32 / (1 << 24) as f32 } else { 0.0 }
            };
            let mut desc = cards(&format!("/cards_{i}"), 1 + i32::from(i), along, |x, y| [0, 1].map(|k| at(x, y, k)));
            desc.prim.transform = DMat4::from_translation(DVec3::Z * -0.1 * f64::from(i));
            db.upsert_mesh(desc);
        }
    });
    1.0 - alpha
}

/// Where leaves lie anywhere behind each other, what rays meet of one has nothing to do with what they meet of the
/// next.
#[test]
fn cutouts_behind_each_other_cover_as_chance_does() {
    for budget in [None, Some(2000)] {
        let seen = seen_through(64, true, budget);
        let expected = (1.0 - LEAF_AREA).powi(10);
        assert!((seen - expected).abs() < 0.05 * expected, "{budget:?}: {seen}, not {expected}");
    }
}

/// Leaves that hide each other do so from every distance, as modelled ones do.
#[test]
fn cutouts_that_hide_each_other_cover_as_one_does() {
    for along in DISTANCES {
        is_near(&format!("{along} cards"), seen_through(along, false, None), 1.0 - LEAF_AREA);
    }
}

#[test]
fn coverage_of_a_udim_set_is_the_same_from_every_distance() {
    for along in DISTANCES {
        for masks in IN_CORE.into_iter().take(if along == 64 { 3 } else { 1 }) {
            let [alpha, _] = coverage(64, masks, None, |db| {
                // Parts 1001 and 1012.
                db.upsert_mesh(cards("/cards", 1, along, |x, y| [f32::from((x + y) & 1); 2]));
                db.upsert_material(material_of("/m", ("leaves <UDIM>", ["clamp", "clamp"], 1.0, 0.0, 0.5)));
            });
            is_near(&format!("{along} cards, {masks:?}"), alpha, LEAF_AREA);
        }
    }
}

/// Ids and depths have one ray to a pixel and no chance: they are of what is in its middle, however small it is.
#[test]
fn images_of_ids_show_cutouts_in_the_middle_of_pixels() {
    for (scale, bias, threshold, at_rim, at_leaf) in
        [(1.0, 0.0, 0.5, 0.0, 1.0), (-1.0, 1.0, 0.5, 1.0, 0.0), (0.2, 0.0, 0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 0.0, 0.0)]
    {
        // In the middle of each pixel is a corner of cards.
        for (part, expected) in [(0.02, at_rim), (0.5, at_leaf)] {
            let [_, ids] = coverage(1, (true, false), None, |db| {
                db.upsert_mesh(cards("/cards", 1, 256, |_, _| [part; 2]));
                db.upsert_material(material_of("/m", ("leaf 512x512", ["repeat", "repeat"], scale, bias, threshold)));
            });
            assert_eq!(ids, expected, "{scale} {bias} {threshold}, {part}");
        }
    }
}

/// A lookup that is narrower than two texels is compared as if there were no mask.
#[test]
fn masks_change_no_bit_of_magnified_cutouts() {
    let seen = |masks: Masks, cut: Cut| {
        let faults = PlantedFaults { no_opacity_masks: !masks.0, ..PlantedFaults::default() };
        let session = Session::with_options(settings(4, 1), SessionOptions { faults, ..options() });
        let session = session.with_images(Arc::new(Library));
        session.with_scene(|db| {
            let mut desc =
                with_st(square(prim("/a", DMat4::from_rotation_x(std::f64::consts::FRAC_PI_2)), 1, 0.5), 1.0, "/m");
            desc.primvars[0].primvar.values = TypedArray::of(AROUND.to_vec());
            db.upsert_mesh(desc);
            db.upsert_material(material_of("/m", cut));
            db.upsert_light(dome([1.0; 3]));
        });
        let request = request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [200, 200]));
        support::render(&session, &request);
        read_all(&session, &request)
    };
    for cut in [CUTS[0], CUTS[3], CUTS[6], ("64x64x4", ["mirror", "black"], 1.0, 0.0, 0.5)] {
        let [known, asked] = [true, false].map(|masks| seen((masks, false), cut));
        assert!(known == asked, "{cut:?}: the picture differs");
    }
}
