// SPDX-License-Identifier: Apache-2.0
//! What masks say of cutouts is what lookups say: the same bits with masks and without, in core, where lookups may have
//! passes of their own, and streaming.

use super::*;
use oocpt_core::inventory::Inventory;
use oocpt_core::settings::TraversalKind;
use oocpt_shader_abi::Features;

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

fn material_of(path: &str, (file, wraps, scale, bias, threshold): Cut) -> MaterialDesc {
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
fn cut_in_many_ways(db: &mut SceneDb) {
    cut_with(db, |kind| kind.is_multiple_of(2).then_some(AROUND));
}

/// The same with coordinates that no author means.
fn cut_with_bad_coordinates(db: &mut SceneDb) {
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
type Masks = (bool, bool);

fn masked(
    build: fn(&mut SceneDb),
    (are_there, are_apart): Masks,
    budget: Option<u32>,
    settings: Settings,
) -> (Render, Session) {
    let more_features = if are_apart { Features::DEFERRED_CUTOUTS } else { Features::empty() };
    let faults = Faults { no_opacity_masks: !are_there, more_features, ..Faults::default() };
    let force_streaming = budget.is_some();
    let settings = Settings { geometry_budget_kib: budget.unwrap_or(0), ..settings };
    let wanted = settings.traversal;
    let session = session(settings, SessionOptions { faults, force_streaming, ..options() }, build);
    render_with_messages(&session, &close());
    let Inventory { features: listed, traversal: used, passes, .. } = session.stats().inventory;
    assert!(wanted != TraversalKind::Native || used.backend == "native", "{used:?}");
    let has = |name: &str| listed.iter().find(|feature| feature.name == name).expect("a feature").present;
    assert_eq!(has("OPACITY_MASKS"), are_there, "masks are used where they are wanted");
    let settles = passes.iter().filter(|pass| pass.name.starts_with("settle_") && pass.made).count();
    assert_eq!((has("DEFERRED_CUTOUTS"), settles), (are_apart, if are_apart { 2 } else { 0 }), "passes of their own");
    let render = Render { images: read_all(&session, &close()), stats: session.stats().streaming };
    (render, session)
}

#[test]
fn opacity_masks_change_no_bit() {
    let asked = with_masks(false, None);
    let known = with_masks(true, None);
    assert!(known.images == asked.images, "the picture differs in core");
    assert!(known.stats.in_core, "all of it fits");
    let (apart, _) = masked(cut_in_many_ways, (true, true), None, small_chunks());
    assert!(apart.images == asked.images, "the picture differs where lookups have passes of their own");
    let without = with_masks(false, Some(600));
    assert!(without.images == asked.images, "the picture differs without masks");
    for budget in [600, 2 << 10] {
        let part = with_masks(true, Some(budget));
        assert!(part.images == asked.images, "the picture differs at {budget} KiB");
        // 310 and 121 at 600 KiB when this was written.
        let loads = [&without, &part].map(|render| render.stats.texture_loads);
        assert!(!part.stats.in_core && loads[1] > 0, "tiles were loaded: {:?}", part.stats);
        assert!(3 * loads[1] < 2 * loads[0], "rays wait for fewer tiles: {loads:?}");
    }
}

#[test]
fn opacity_masks_tolerate_nan_coordinates() {
    let (asked, _) = masked(cut_with_bad_coordinates, (false, false), None, small_chunks());
    for masks in [(true, false), (true, true)] {
        let (known, _) = masked(cut_with_bad_coordinates, masks, None, small_chunks());
        assert!(known.images == asked.images, "{masks:?}: the picture differs");
    }
}

/// The host looks at masks and textures as the shaders do. On a device with memory of its own there is nothing to
/// compare.
#[test]
fn native_masked_cutouts_match_the_shaders() {
    let (shaders, session) = masked(cut_in_many_ways, (true, false), None, small_chunks());
    if !session.device_report().expect("a device").host_memory {
        return;
    }
    let native = Settings { traversal: TraversalKind::Native, ..small_chunks() };
    for (are_there, budget) in [(false, None), (true, None), (false, Some(600)), (true, Some(600))] {
        let (host, _) = masked(cut_in_many_ways, (are_there, false), budget, native.clone());
        assert!(host.images == shaders.images, "with masks: {are_there}, KiB: {budget:?}: the picture differs");
        assert!(budget.is_none() || host.stats.texture_loads > 0, "tiles were loaded: {:?}", host.stats);
    }
}
