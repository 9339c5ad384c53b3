// SPDX-License-Identifier: Apache-2.0
//! Networks of `UsdPreviewSurface` against the rules of its specification.

use oocpt_abi::{MaterialFlags, MaterialInput};
use oocpt_core::material::{CompiledMaterial, MAX_NODES, compile};
use oocpt_core::{
    AssetRef, ColorSpace, ConnectionDesc, InputValue, Material, MaterialDesc, NodeDesc, ParamDesc, ParamValue, Wrap,
};
use proptest::prelude::*;

pub(crate) fn node(kind: &str, params: &[(&str, ParamValue)], connections: &[(&str, usize, &str)]) -> NodeDesc {
    let param = |(name, value): &(&str, ParamValue)| ParamDesc { name: (*name).into(), value: value.clone() };
    let connection = |(input, node, output): &(&str, usize, &str)| ConnectionDesc {
        input: (*input).into(),
        node: *node,
        output: (*output).into(),
    };
    NodeDesc {
        path: format!("/{kind}").into(),
        kind: kind.into(),
        params: params.iter().map(param).collect(),
        connections: connections.iter().map(connection).collect(),
    }
}

pub(crate) fn network(path: &str, nodes: Vec<NodeDesc>) -> MaterialDesc {
    MaterialDesc { path: path.into(), nodes, surface: Some(0), ..MaterialDesc::default() }
}

pub(crate) fn surface(params: &[(&str, ParamValue)]) -> NodeDesc {
    node("UsdPreviewSurface", params, &[])
}

pub(crate) fn text(text: &str) -> ParamValue {
    ParamValue::Text(text.into())
}

pub(crate) fn file(name: &str) -> ParamValue {
    ParamValue::Asset(AssetRef { authored: name.into(), resolved: name.into() })
}

fn of(nodes: Vec<NodeDesc>) -> CompiledMaterial {
    compile(&network("/m", nodes))
}

fn material(nodes: Vec<NodeDesc>) -> Material {
    let compiled = of(nodes);
    assert_eq!(compiled.problem(), None, "a sound network has no problem");
    compiled.material.expect("a surface")
}

fn reader(kind: &str, name: &str, fallback: ParamValue) -> NodeDesc {
    node(&format!("UsdPrimvarReader_{kind}"), &[("varname", text(name)), ("fallback", fallback)], &[])
}

const SURFACE: &str = "UsdPreviewSurface";
const TEXTURE: &str = "UsdUVTexture";

#[test]
fn defaults_match_the_specification() {
    let plain = material(vec![surface(&[])]);
    let expected = [[0.18, 0.18, 0.18, 1.0], [0.0, 0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]].into_iter();
    let expected = expected.chain([0.0, 0.5, 0.0, 0.01, 1.0, 1.5].map(|v| [v; 4])).chain([[0.0, 0.0, 1.0, 1.0]]);
    let expected: Vec<InputValue> = expected.map(InputValue::Constant).collect();
    // The others are OpenPBR's.
    let (own, others) = plain.inputs.split_at(expected.len());
    assert_eq!(own, expected);
    assert!(others.iter().all(|input| matches!(input, InputValue::Constant(_))), "{others:?}");
    assert_eq!((plain.flags, plain.opacity_threshold), (MaterialFlags::empty(), 0.0));
}

#[test]
fn authored_values_and_flags() {
    let made = material(vec![surface(&[
        ("diffuseColor", ParamValue::Vec3([0.1, 0.2, 0.3])),
        ("emissiveColor", ParamValue::Vec3([0.0, 2.0, 0.0])),
        ("useSpecularWorkflow", ParamValue::Int(1)),
        ("clearcoat", ParamValue::Float(0.5)),
        ("opacity", ParamValue::Float(0.25)),
        ("metallic", ParamValue::Int(1)),
        ("occlusion", ParamValue::Float(0.5)),
        ("normal", ParamValue::Vec3([0.0, 1.0, 0.0])),
    ])]);
    assert_eq!(made.input(MaterialInput::DiffuseColor), &InputValue::Constant([0.1, 0.2, 0.3, 1.0]));
    assert_eq!(made.input(MaterialInput::Metallic), &InputValue::Constant([1.0; 4]));
    let flags = MaterialFlags::SPECULAR_WORKFLOW | MaterialFlags::EMISSIVE | MaterialFlags::COAT;
    let glass = MaterialFlags::TRANSMISSIVE | MaterialFlags::ROUGH_TRANSMISSION;
    assert_eq!(made.flags, flags | glass | MaterialFlags::NORMAL_MAP);
}

#[test]
fn opacity_is_transmission_presence_or_a_threshold() {
    let made = |opacity: f32, more: &[(&str, ParamValue)]| {
        let params: Vec<_> =
            [("opacity", ParamValue::Float(opacity))].into_iter().chain(more.iter().cloned()).collect();
        let made = material(vec![surface(&params)]);
        (made.flags, *made.input(MaterialInput::Opacity))
    };
    let threshold = |v: f32| ("opacityThreshold", ParamValue::Float(v));
    let presence = ("opacityMode", text("presence"));
    let all = |v: f32| InputValue::Constant([v; 4]);
    let rough = MaterialFlags::TRANSMISSIVE | MaterialFlags::ROUGH_TRANSMISSION;
    assert_eq!(made(0.5, &[]), (rough, all(0.5)));
    assert_eq!(made(0.5, &[("opacityMode", text("transparent"))]), (rough, all(0.5)));
    // Sharp glass does not ask for the rough one; a rough coat over it does.
    let number = |name: &'static str, v: f32| (name, ParamValue::Float(v));
    let sharp = [number("roughness", 0.0), number("clearcoat", 0.0), number("clearcoatRoughness", 0.5)];
    assert_eq!(made(0.5, &sharp), (MaterialFlags::TRANSMISSIVE, all(0.5)));
    let coated = [number("roughness", 0.0), number("clearcoat", 1.0), number("clearcoatRoughness", 0.5)];
    assert_eq!(made(0.5, &coated), (rough | MaterialFlags::COAT, all(0.5)));
    assert_eq!(made(0.5, std::slice::from_ref(&presence)), (MaterialFlags::PRESENCE, all(0.5)));
    // At the threshold the surface is there, all of it.
    assert_eq!(made(0.5, &[threshold(0.5)]), (MaterialFlags::empty(), all(1.0)));
    assert_eq!(made(0.4, &[threshold(0.5)]), (MaterialFlags::PRESENCE, all(0.0)));
    assert_eq!(made(1.0, &[presence]), (MaterialFlags::empty(), all(1.0)));
}

#[test]
fn a_texture_has_its_channels_and_settings() {
    let params = [
        ("file", file("a.png")),
        ("wrapS", text("repeat")),
        ("wrapT", text("mirror")),
        ("sourceColorSpace", text("raw")),
        ("scale", ParamValue::Vec4([2.0, 2.0, 2.0, 1.0])),
        ("bias", ParamValue::Vec4([-1.0, -1.0, -1.0, 0.0])),
        ("fallback", ParamValue::Vec4([0.5, 0.5, 1.0, 1.0])),
    ];
    let nodes = vec![
        node(SURFACE, &[], &[("normal", 1, "rgb"), ("roughness", 1, "g"), ("opacity", 2, "a")]),
        node(TEXTURE, &params, &[("st", 3, "result")]),
        node(TEXTURE, &[("file", file("a.png"))], &[("st", 3, "result")]),
        reader("float2", "st", ParamValue::Vec2([0.25, 0.5])),
    ];
    let compiled = of(nodes);
    let made = compiled.material.expect("a surface");
    let InputValue::Texture { texture, channel, scale, bias, uv, transform } = *made.input(MaterialInput::Normal)
    else {
        panic!("a texture");
    };
    assert_eq!((texture, channel, uv), (0, None, Some(0)));
    assert_eq!((scale, bias), ([2.0, 2.0, 2.0, 1.0], [-1.0, -1.0, -1.0, 0.0]));
    assert_eq!(transform, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    assert!(matches!(made.input(MaterialInput::Roughness), InputValue::Texture { texture: 0, channel: Some(1), .. }));
    assert!(matches!(made.input(MaterialInput::Opacity), InputValue::Texture { texture: 1, channel: Some(3), .. }));
    let [first, second] = &compiled.textures[..] else { panic!("one file in two ways is two textures") };
    assert_eq!((first.wrap, &first.color_space), ([Wrap::Repeat, Wrap::Mirror], &ColorSpace::Raw));
    assert_eq!(first.fallback, [0.5, 0.5, 1.0, 1.0]);
    assert_eq!(&*first.prim, "/m/UsdUVTexture", "a node is named within its material");
    assert_eq!((second.wrap, &second.color_space), ([Wrap::UseMetadata; 2], &ColorSpace::Auto));
    assert_eq!(second.fallback, [0.0, 0.0, 0.0, 1.0]);
    assert_eq!(&*made.uv_sets[0].name, "st");
    assert_eq!((made.uv_sets.len(), made.uv_sets[0].fallback), (1, [0.25, 0.5]));
    assert!(made.flags.contains(MaterialFlags::TEXTURED | MaterialFlags::NORMAL_MAP | MaterialFlags::TRANSMISSIVE));
}

#[test]
fn source_color_space_wins_over_color_space_metadata() {
    let space = |source: Option<&str>, metadata: Option<&str>| {
        let given = [("sourceColorSpace", source), ("colorSpace:file", metadata)];
        let named = given.into_iter().filter_map(|(name, value)| Some((name, text(value?))));
        let params: Vec<_> = [("file", file("a.png"))].into_iter().chain(named).collect();
        let compiled = of(vec![node(SURFACE, &[], &[("diffuseColor", 1, "rgb")]), node(TEXTURE, &params, &[])]);
        assert_eq!(compiled.problem(), None, "{source:?} with {metadata:?} is in order");
        compiled.textures.first().expect("a texture").color_space.clone()
    };
    let named = |name: &str| ColorSpace::Named(name.into());
    assert_eq!(space(None, None), ColorSpace::Auto);
    assert_eq!(space(None, Some("")), ColorSpace::Auto, "new front ends give empty metadata");
    assert_eq!(space(Some("raw"), Some("srgb_texture")), ColorSpace::Raw, "the input says it");
    assert_eq!(space(Some("sRGB"), Some("ACEScg")), ColorSpace::Srgb, "the input says it");
    assert_eq!(space(Some("auto"), Some("ACEScg")), named("ACEScg"), "the input leaves it open");
    assert_eq!(space(None, Some("lin_rec709")), ColorSpace::Raw, "a common name");
    assert_eq!(space(Some("lin_ap1"), Some("raw")), named("lin_ap1"), "a name in place of the three tokens");
}

#[test]
fn a_texture_without_a_file_is_its_fallback_unscaled() {
    let lost = ParamValue::Asset(AssetRef { authored: "gone.png".into(), resolved: "".into() });
    let more = [("fallback", ParamValue::Vec4([0.1, 0.2, 0.3, 0.4])), ("scale", ParamValue::Vec4([9.0; 4]))];
    let params: Vec<_> = [("file", lost)].into_iter().chain(more).collect();
    let nodes =
        vec![node(SURFACE, &[], &[("diffuseColor", 1, "rgb"), ("metallic", 1, "b")]), node(TEXTURE, &params, &[])];
    let compiled = of(nodes);
    assert_eq!(compiled.textures.len(), 0);
    assert!(compiled.problem().expect("a warning").contains("not found"));
    let made = compiled.material.expect("a surface");
    assert_eq!(made.input(MaterialInput::DiffuseColor), &InputValue::Constant([0.1, 0.2, 0.3, 0.4]));
    assert_eq!(made.input(MaterialInput::Metallic), &InputValue::Constant([0.3; 4]));
}

#[test]
fn a_transform_scales_then_rotates_then_translates() {
    let transform = |scale, angle, shift, source| {
        node(
            "UsdTransform2d",
            &[
                ("scale", ParamValue::Vec2(scale)),
                ("rotation", ParamValue::Float(angle)),
                ("translation", ParamValue::Vec2(shift)),
            ],
            &[("in", source, "result")],
        )
    };
    let with = |nodes: Vec<NodeDesc>| {
        let head = [
            node(SURFACE, &[], &[("diffuseColor", 1, "rgb")]),
            node(TEXTURE, &[("file", file("a.png"))], &[("st", 2, "result")]),
        ];
        match *material(head.into_iter().chain(nodes).collect()).input(MaterialInput::DiffuseColor) {
            InputValue::Texture { transform, uv, .. } => (uv, transform),
            _ => panic!("a texture"),
        }
    };
    let apply = |m: [[f32; 3]; 2], [s, t]: [f32; 2]| m.map(|[x, y, offset]| x * s + y * t + offset);
    let st = || reader("float2", "st", ParamValue::Vec2([0.0; 2]));
    // (1, 1) scaled (2, 3), turned a quarter counter-clockwise (-3, 2), moved (7, 13).
    let (uv, one) = with(vec![transform([2.0, 3.0], 90.0, [10.0, 11.0], 3), st()]);
    assert_eq!((uv, apply(one, [1.0, 1.0])), (Some(0), [7.0, 13.0]));
    // What is nearer to the texture comes later: (1, 1) moved (2, 3), then scaled (20, 300).
    let (_, two) =
        with(vec![transform([10.0, 100.0], 0.0, [0.0; 2], 3), transform([1.0; 2], 0.0, [1.0, 2.0], 4), st()]);
    assert_eq!(apply(two, [1.0, 1.0]), [20.0, 300.0]);
    // Without a reader: the default coordinates (0, 0), moved.
    let mut alone = transform([2.0; 2], 0.0, [0.5, 0.25], 0);
    alone.connections.clear();
    let (uv, none) = with(vec![alone]);
    assert_eq!((uv, none), (None, [[0.0, 0.0, 0.5], [0.0, 0.0, 0.25]]));
}

#[test]
fn primvar_readers_of_every_type() {
    let kinds = [
        ("float", ParamValue::Float(0.5), [0.5; 4]),
        ("float2", ParamValue::Vec2([0.5, 1.0]), [0.5, 1.0, 0.0, 0.0]),
        ("float3", ParamValue::Vec3([0.5, 1.0, 2.0]), [0.5, 1.0, 2.0, 1.0]),
        ("vector", ParamValue::Vec3([0.5, 1.0, 2.0]), [0.5, 1.0, 2.0, 1.0]),
        ("float4", ParamValue::Vec4([0.5, 1.0, 2.0, 3.0]), [0.5, 1.0, 2.0, 3.0]),
    ];
    for (kind, value, fallback) in kinds {
        let made = material(vec![
            node(SURFACE, &[], &[("diffuseColor", 1, "result"), ("emissiveColor", 2, "result")]),
            reader(kind, "tint", value.clone()),
            reader(kind, "glow", value),
        ]);
        assert_eq!(made.input(MaterialInput::DiffuseColor), &InputValue::Primvar { slot: 0, fallback }, "{kind}");
        assert_eq!(made.input(MaterialInput::EmissiveColor), &InputValue::Primvar { slot: 1, fallback }, "{kind}");
        let names: Vec<&str> = made.primvars.iter().map(|slot| &*slot.name).collect();
        assert_eq!(names, ["tint", "glow"]);
    }
}

#[test]
fn invalid_networks_keep_their_valid_inputs() {
    let grey = InputValue::Constant([0.18, 0.18, 0.18, 1.0]);
    let tinted = [("diffuseColor", ParamValue::Vec3([0.5; 3]))];
    let half = InputValue::Constant([0.5, 0.5, 0.5, 1.0]);
    let cases: Vec<(&str, Vec<NodeDesc>, InputValue)> = vec![
        ("not supported", vec![node(SURFACE, &tinted, &[("diffuseColor", 1, "out")]), node("Noise", &[], &[])], half),
        ("connected to nothing", vec![node(SURFACE, &tinted, &[("diffuseColor", 99, "rgb")])], half),
        ("wrong type", vec![surface(&[("diffuseColor", text("red"))])], grey),
        ("not finite", vec![surface(&[("diffuseColor", ParamValue::Vec3([f32::NAN; 3]))])], grey),
        (
            "no output",
            vec![node(SURFACE, &tinted, &[("diffuseColor", 1, "q")]), node(TEXTURE, &[("file", file("a"))], &[])],
            half,
        ),
        ("displacement output is not", vec![surface(&[("displacement", ParamValue::Float(1.0))])], grey),
    ];
    for (problem, nodes, diffuse) in cases {
        let compiled = of(nodes);
        assert!(compiled.problem().expect("a warning").contains(problem), "{problem}");
        assert_eq!(compiled.material.expect("a surface").input(MaterialInput::DiffuseColor), &diffuse, "{problem}");
    }
    for (problem, desc) in [
        ("no surface", MaterialDesc { surface: None, ..network("/m", vec![surface(&[])]) }),
        ("no surface", MaterialDesc { surface: Some(7), ..network("/m", vec![surface(&[])]) }),
        ("`Noise` (/Noise) are not supported", network("/m", vec![node("Noise", &[], &[])])),
        (
            "the host has no definition of /glsl",
            network("/m", vec![NodeDesc { path: "/glsl".into(), ..node("", &[], &[]) }]),
        ),
        ("more than", network("/m", vec![surface(&[]); MAX_NODES + 1])),
    ] {
        let compiled = compile(&desc);
        assert_eq!(compiled.material, None, "{problem}");
        assert!(compiled.problem().expect("a warning").contains(problem), "{problem}");
    }
}

#[test]
fn cyclic_networks_and_excess_texture_sets_are_refused() {
    let circle = of(vec![
        node(SURFACE, &[], &[("diffuseColor", 1, "rgb")]),
        node(TEXTURE, &[("file", file("a.png"))], &[("st", 2, "result")]),
        node("UsdTransform2d", &[("scale", ParamValue::Vec2([1e30; 2]))], &[("in", 3, "result")]),
        node("UsdTransform2d", &[], &[("in", 2, "result")]),
    ]);
    assert!(circle.problem().expect("a warning").contains("circle"));
    assert!(circle.material.is_some());
    let sets = ["a", "b", "c"].map(|name| reader("float2", name, ParamValue::Vec2([0.75, 0.5])));
    let textures = [4, 5, 6].map(|source| node(TEXTURE, &[("file", file("a.png"))], &[("st", source, "result")]));
    let head = node(SURFACE, &[], &[("diffuseColor", 1, "rgb"), ("metallic", 2, "r"), ("roughness", 3, "r")]);
    let many = of([head].into_iter().chain(textures).chain(sets).collect());
    assert!(many.problem().expect("a warning").contains("more than 2 sets"));
    let made = many.material.expect("a surface");
    assert_eq!(made.uv_sets.len(), 2);
    let at = [[0.0, 0.0, 0.75], [0.0, 0.0, 0.5]];
    assert!(
        matches!(made.input(MaterialInput::Roughness), InputValue::Texture { uv: None, transform, .. } if *transform == at)
    );
}

fn any_value() -> impl Strategy<Value = ParamValue> {
    prop_oneof![
        any::<bool>().prop_map(ParamValue::Bool),
        any::<i64>().prop_map(ParamValue::Int),
        any::<f32>().prop_map(ParamValue::Float),
        any::<[f32; 2]>().prop_map(ParamValue::Vec2),
        any::<[f32; 3]>().prop_map(ParamValue::Vec3),
        any::<[f32; 4]>().prop_map(ParamValue::Vec4),
        prop_oneof![Just("st"), Just(""), Just("repeat"), Just("presence"), Just("raw")].prop_map(text),
        prop_oneof![Just("a.png"), Just("b.<UDIM>.png"), Just("")].prop_map(file),
    ]
}

fn any_node() -> impl Strategy<Value = NodeDesc> {
    let kinds = ["UsdPreviewSurface", "UsdUVTexture", "UsdTransform2d", "UsdPrimvarReader_float2", "Other"];
    let kind =
        prop_oneof![prop::sample::select(kinds.to_vec()), Just("UsdPrimvarReader_float3"), Just("UsdPrimvarReader_")];
    let inputs = [
        "diffuseColor",
        "opacity",
        "opacityMode",
        "opacityThreshold",
        "normal",
        "metallic",
        "file",
        "st",
        "in",
        "wrapS",
        "scale",
        "bias",
        "rotation",
        "varname",
        "fallback",
    ];
    let name = move || prop::sample::select(inputs.to_vec());
    let output = prop_oneof![Just("rgb"), Just("r"), Just("a"), Just("result"), Just("")];
    let params = prop::collection::vec((name(), any_value()), 0..6);
    let connections = prop::collection::vec((name(), 0..9_usize, output), 0..6);
    (kind, params, connections).prop_map(|(kind, params, connections)| node(kind, &params, &connections))
}

proptest! {
    #[test]
    fn any_network_gives_finite_numbers_in_range(nodes in prop::collection::vec(any_node(), 0..8), first in 0..9_usize) {
        let mut desc = network("/m", nodes);
        if let Some(node) = desc.nodes.first_mut() {
            node.kind = "UsdPreviewSurface".into();
        }
        desc.surface = (first < 8).then_some(first / 4);
        let compiled = compile(&desc);
        let Some(made) = compiled.material else { return Ok(()) };
        for input in &made.inputs {
            match input {
                InputValue::Constant(value) => prop_assert!(value.iter().all(|v| v.is_finite())),
                InputValue::Texture { texture, uv, transform, scale, bias, .. } => {
                    prop_assert!((*texture as usize) < compiled.textures.len());
                    prop_assert!(uv.is_none_or(|uv| usize::from(uv) < made.uv_sets.len()));
                    prop_assert!(transform.as_flattened().iter().chain(scale).chain(bias).all(|v| v.is_finite()));
                }
                InputValue::Register(_) => prop_assert!(false, "only MaterialX has programs"),
                InputValue::Primvar { slot, fallback } => {
                    prop_assert!(usize::from(*slot) < made.primvars.len());
                    prop_assert!(fallback.iter().all(|v| v.is_finite()));
                }
            }
        }
    }
}
