// SPDX-License-Identifier: Apache-2.0
//! Cutouts of every kind, walked by the shaders and by the host: the same bits, in core and streaming; and who walks
//! them. On a device with memory of its own there is nothing to compare.

use super::*;
use crate::scenes::{deforming, widening};
use crate::support::request;
use glam::Vec3;
use oocpt_core::inventory::TraversalUse;
use oocpt_core::scene::{CurveBasis, CurveWrap, CurvesDesc, PrimShape};
use oocpt_core::settings::TraversalKind;

/// Image and output that cut a kind of leaf out.
const IMAGES: [(&str, &str); 12] = [
    ("part <UDIM>", "a"),
    ("half 300x170x4", "a"),
    ("half 60x90x2", "a"),
    ("half 200x64x1", "r"),
    ("float 150x140x4", "g"),
    ("float 70x30x2", "a"),
    ("float 33x260x1", "r"),
    ("640x400x4", "b"),
    ("300x500x2", "r"),
    ("90x1x1", "r"),
    ("torn", "r"),
    ("disc 600x300", "a"),
];

/// What a leaf of a kind is made of.
#[derive(Clone, Copy, PartialEq)]
enum Made {
    Card,
    /// With values at corners of faces.
    Faceted,
    /// Without coordinates: the instances have them.
    Bare,
    /// With the same ones everywhere.
    Flat,
    Deforming,
    Curves,
}

fn unit(i: u32, k: u32) -> f64 {
    f64::from(hash(5 * i + k) >> 8) / f64::from(1 << 24) - 0.5
}

#[expect(clippy::cast_possible_truncation, reason = "single precision is what a scene has")]
fn single(x: f64) -> f32 {
    x as f32
}

fn of<T: oocpt_core::ArrayElement + std::fmt::Debug>(
    name: &str,
    interpolation: Interpolation,
    v: Vec<T>,
) -> NamedPrimvar {
    NamedPrimvar { name: name.into(), primvar: Primvar { interpolation, values: TypedArray::of(v), indices: None } }
}

/// Some leaves of a kind, in two nested levels, with values of their own for what they lack.
fn kind(db: &mut SceneDb, number: u32, made: Made, material: MaterialDesc) {
    let [name, inner] = [format!("/kind_{number}"), format!("/kind_{number}/inner")];
    let leaf = format!("{inner}/leaf");
    let place = |i: u32, spread: f64| {
        let at = DVec3::new(unit(i, 0), unit(i, 1) * 0.4, unit(i, 2)) * spread;
        let turn = DQuat::from_rotation_y(f64::from(i)) * DQuat::from_rotation_x(0.3 + unit(i, 3));
        (at, turn, DVec3::splat(0.7) * (unit(i, 4) * 2.0).exp2())
    };
    let (outer, own): (Vec<_>, Vec<_>) =
        ((0..12).map(|i| place(500 * number + i, 4.0)).collect(), (0..10).map(|i| place(i, 1.5)).collect());
    let up = DMat4::from_translation(DVec3::Y * 0.8);
    db.upsert_instancer(instancer(prim(&name, up), &inner, &outer));
    let mut placed = instancer(instanced(prim(&inner, DMat4::IDENTITY), &name), &leaf, &own);
    let scattered = |k: u32| (0..10_u32).map(move |i| single(unit(i, k) + 0.5));
    placed.primvars.push(of("alpha", Interpolation::Instance, scattered(0).collect()));
    placed.primvars.push(of("st", Interpolation::Instance, scattered(1).map(|x| [x, 3.0 * x]).collect()));
    db.upsert_instancer(placed);
    let id = 10 + i32::try_from(number).expect("small");
    let mut desc = square(instanced(prim(&leaf, DMat4::from_scale(DVec3::splat(0.2))), &inner), id, 0.5);
    let st = vec![[-0.7_f32, -1.2], [1.8, -0.9], [2.1, 1.6], [0.3, 1.9]];
    match made {
        Made::Card => desc.primvars.push(of("st", Interpolation::Vertex, st)),
        Made::Faceted => {
            desc.primvars.push(of("st", Interpolation::FaceVarying, st));
            desc.primvars.push(of("alpha", Interpolation::FaceVarying, vec![0.0_f32, 1.0, 0.3, 0.9]));
        }
        Made::Bare => {}
        Made::Flat => desc.primvars.push(of("st", Interpolation::Constant, vec![[0.4_f32, 0.6]])),
        Made::Deforming => {
            desc.primvars.push(of("st", Interpolation::Vertex, st));
            desc = deforming(desc, &[0.0, 0.4, 1.0], &|p: Vec3, time| p + Vec3::Y * (single(time) * (p.x + 0.4 * p.z)));
        }
        Made::Curves => {
            desc.shape = PrimShape::Curves(CurvesDesc {
                basis: CurveBasis::Linear,
                wrap: CurveWrap::Nonperiodic,
                counts: TypedArray::of(vec![4_i32]),
                indices: None,
            });
            desc.primvars.push(of("st", Interpolation::Vertex, st));
            desc = widening(deforming(desc, &[0.0, 1.0], &|p: Vec3, time| p + Vec3::Z * single(time)), &|_| 0.5);
        }
    }
    desc.display_color = constant([0.2_f32, 0.5, 0.1]);
    desc.material = Some(material.path.clone());
    db.upsert_mesh(desc);
    db.upsert_material(material);
}

/// How opacity is meant: by a threshold or by chance.
fn mode(number: u32) -> Vec<(&'static str, ParamValue)> {
    match number % 2 {
        0 => vec![("opacityThreshold", ParamValue::Float(0.45))],
        _ => vec![("opacityThreshold", ParamValue::Float(0.0)), ("opacityMode", text("presence"))],
    }
}

/// Cut out by a texture, looked at through a map that turns and stretches.
fn by_image(number: u32, (file, output): (&str, &str)) -> MaterialDesc {
    let mut desc = textured(&format!("/material_{number}"), file, mode(number), &[("opacity", output)]);
    let map = vec![
        ("rotation", ParamValue::Float(20.0)),
        ("scale", ParamValue::Vec2([1.3, 0.6])),
        ("translation", ParamValue::Vec2([0.15, -0.3])),
    ];
    if number.is_multiple_of(3) {
        desc.nodes.push(node("/map", "UsdTransform2d", map, &[("in", 2, "result")]));
        desc.nodes[1].connections[0].node = 3;
    }
    desc
}

/// By a primvar, or by a number.
fn by_value(number: u32, name: Option<&str>) -> MaterialDesc {
    let mut own = mode(number);
    if name.is_none() {
        own.push(("opacity", ParamValue::Float(0.5)));
    }
    let connections = [("opacity", 1, "result")];
    let params = vec![("varname", text(name.unwrap_or("none"))), ("fallback", ParamValue::Float(0.6))];
    let nodes = vec![
        node("/surface", "UsdPreviewSurface", own, if name.is_some() { &connections[..] } else { &[] }),
        node("/reader", "UsdPrimvarReader_float", params, &[]),
    ];
    MaterialDesc { path: format!("/material_{number}").into(), nodes, surface: Some(0), ..MaterialDesc::default() }
}

/// Cutouts of every kind.
fn all_kinds(db: &mut SceneDb) {
    // Ptex beside them is no matter.
    let ground = square(prim("/ground", DMat4::from_scale(DVec3::splat(20.0))), 1, 0.5);
    db.upsert_mesh(MeshDesc { material: Some("/painted".into()), ..ground });
    db.upsert_material(crate::materials::painted("/painted"));
    lights(db);
    let mut number = 0;
    let mut add = |made: Made, material: &dyn Fn(u32) -> MaterialDesc| {
        for _ in 0..2 {
            kind(db, number, made, material(number));
            number += 1;
        }
    };
    for image in IMAGES {
        add(Made::Card, &|number| by_image(number, image));
    }
    for made in [Made::Faceted, Made::Bare, Made::Flat, Made::Deforming, Made::Curves] {
        add(made, &|number| by_image(number, ("disc 200x256", "a")));
        add(made, &|number| by_image(number, ("300x500x4", "r")));
    }
    for name in [Some("alpha"), Some("nowhere"), None] {
        add(Made::Faceted, &|number| by_value(number, name));
        add(Made::Bare, &|number| by_value(number, name));
    }
}

/// A render, who walked its rays, and whether the host could.
fn walked(build: fn(&mut SceneDb), traversal: TraversalKind, budget: Option<u32>) -> (Render, TraversalUse, bool) {
    let settings = Settings { geometry_budget_kib: budget.unwrap_or(0), traversal, ..small_chunks() };
    let force_streaming = budget.is_some();
    let session = session(settings, SessionOptions { force_streaming, ..options() }, build);
    let request = request(perspective(DVec3::new(0.0, 1.6, 3.0), DVec3::new(0.0, 0.4, 0.0), 0.9, [96, 64]));
    render_with_messages(&session, &request);
    let stats = session.stats();
    let can = session.device_report().expect("a device").host_memory;
    (Render { images: read_all(&session, &request), stats: stats.streaming }, stats.inventory.traversal, can)
}

#[test]
fn native_cutouts_of_every_kind_match_the_shaders() {
    let (shaders, used, can) = walked(all_kinds, TraversalKind::Compute, None);
    assert_eq!(used.backend, "compute", "{used:?}");
    if !can {
        return;
    }
    assert!(shaders.stats.in_core, "all of it fits");
    for budget in [None, Some(700)] {
        let (host, used, _) = walked(all_kinds, TraversalKind::Auto, budget);
        assert_eq!(used.backend, "native", "{used:?}");
        for (image, (a, b)) in shaders.images.iter().zip(&host.images).enumerate() {
            assert!(a == b, "{budget:?} KiB: image {image} differs");
        }
        assert!(budget.is_none() || host.stats.texture_reloads > 0, "tiles came and went: {:?}", host.stats);
    }
}

/// Leaves cut out by floats through the sRGB curve, which alpha does not go through.
fn curved(db: &mut SceneDb, output: &'static str) {
    lights(db);
    let mut material = by_image(0, ("float 150x140x4", output));
    material.nodes[1].params.push(ParamDesc { name: "sourceColorSpace".into(), value: text("sRGB") });
    kind(db, 0, Made::Card, material);
}

fn by_ptex(db: &mut SceneDb) {
    lights(db);
    let mut material = crate::materials::painted("/material_0");
    material.nodes[0].connections[0] = ConnectionDesc { input: "opacity".into(), node: 1, output: "r".into() };
    material.nodes[0].params.push(ParamDesc { name: "opacityThreshold".into(), value: ParamValue::Float(0.5) });
    kind(db, 0, Made::Card, material);
}

#[test]
fn unsupported_cutouts_fall_back_to_the_shaders() {
    let (_, used, can) = walked(|db| curved(db, "g"), TraversalKind::Auto, None);
    assert!(used.backend == "compute" && (!can || used.why.contains("sRGB")), "{used:?}");
    let (_, used, _) = walked(|db| curved(db, "a"), TraversalKind::Auto, None);
    assert!((used.backend == "native") == can, "{used:?}");
    let (_, used, _) = walked(by_ptex, TraversalKind::Auto, None);
    assert!(used.backend == "compute" && (!can || used.why.contains("Ptex")), "{used:?}");
    let (_, used, _) = walked(programs::leaves_by_program, TraversalKind::Auto, None);
    assert!(used.backend == "compute" && (!can || used.why.contains("programs")), "{used:?}");
}
