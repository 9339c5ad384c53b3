// SPDX-License-Identifier: Apache-2.0
//! Hostile networks, as scenes may contain them: random kinds, wrong types, NaN, endless texts, cycles. Each gives a
//! material of finite numbers or none, and one message for its prim.

use std::sync::OnceLock;

use oocpt_core::material::{CompiledMaterial, Material, compile, describe};
use oocpt_core::scene::SceneDb;
use oocpt_core::{AssetRef, ConnectionDesc, InputValue, MaterialDesc, NodeDesc, ParamDesc, ParamValue};
use oocpt_materialx::eval::run;
use oocpt_materialx::library::{NodeDef, standard};
use proptest::prelude::*;

use crate::material::preview_surface::{file, network, node, text};
use crate::scene::bindings::bind;
use crate::support::grid;

/// Networks; all seeds with `cargo xtask test --full`.
fn networks() -> u32 {
    if std::env::var_os("OOCPT_TEST_FULL").is_some() { 10_000 } else { 300 }
}

/// Most bytes of a message about a material: eight lines of 512, and the separators.
const MAX_MESSAGE_BYTES: usize = 8 * (512 + 8);

fn definitions() -> &'static [&'static NodeDef] {
    static ALL: OnceLock<Vec<&'static NodeDef>> = OnceLock::new();
    ALL.get_or_init(|| {
        let library = standard();
        let mut names = library.names();
        names.sort_unstable();
        names.into_iter().filter_map(|name| library.definition(name)).map(|definition| &**definition).collect()
    })
}

const NUMBERS: [f32; 12] =
    [0.0, -0.0, 1.0, -1.0, 0.5, 1e-45, 3.4e38, -3.4e38, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e9];

fn any_number() -> impl Strategy<Value = f32> {
    prop_oneof![prop::sample::select(&NUMBERS[..]), -2.0_f32..3.0, any::<f32>()]
}

fn any_text() -> impl Strategy<Value = String> {
    prop_oneof!["[a-z]{0,6}", any::<String>(), (0..3_usize).prop_map(|n| "\u{e9}\u{1b}".repeat(n * 10_000))]
}

fn any_value() -> impl Strategy<Value = ParamValue> {
    prop_oneof![
        any_number().prop_map(ParamValue::Float),
        prop::array::uniform2(any_number()).prop_map(ParamValue::Vec2),
        prop::array::uniform3(any_number()).prop_map(ParamValue::Vec3),
        prop::array::uniform4(any_number()).prop_map(ParamValue::Vec4),
        any::<i64>().prop_map(ParamValue::Int),
        any::<bool>().prop_map(ParamValue::Bool),
        any_text().prop_map(|words| ParamValue::Text(words.into())),
        (any_text(), any::<bool>()).prop_map(|(name, found)| {
            ParamValue::Asset(AssetRef {
                authored: name.clone().into(),
                resolved: if found { name } else { String::new() }.into(),
            })
        }),
    ]
}

/// Kinds that no library has.
const OTHERS: [&str; 6] =
    ["UsdPreviewSurface", "UsdUVTexture", "UsdPrimvarReader_float2", "UsdTransform2d", "ND_nothing", ""];

prop_compose! {
    fn any_node(count: usize)(
        kind in any::<prop::sample::Index>(),
        other in prop::option::weighted(0.1, prop::sample::select(&OTHERS[..])),
        inputs in prop::collection::vec(
            (any::<prop::sample::Index>(), 0..count + 1, any_value(), any::<bool>()),
            0..6,
        ),
        path in prop::option::weighted(0.1, any_text()),
    ) -> NodeDesc {
        let definition = kind.get(definitions());
        let mut made = node(other.unwrap_or(&definition.name), &[], &[]);
        made.path = path.map_or(made.path, Into::into);
        for (input, upstream, value, is_connected) in inputs {
            let Some(input) = definition.inputs.get(input.index(definition.inputs.len().max(1))) else { continue };
            if is_connected {
                let output = definition.outputs.first().map_or_else(|| "out".into(), |(name, ..)| name.clone());
                made.connections.push(ConnectionDesc { input: input.name.clone(), node: upstream, output });
            } else {
                made.params.push(ParamDesc { name: input.name.clone(), value });
            }
        }
        made
    }
}

prop_compose! {
    fn any_network()(
        nodes in (2..14_usize).prop_flat_map(|count| prop::collection::vec(any_node(count), count)),
        surface in 0..4_u8,
        wires in prop::collection::vec((any::<prop::sample::Index>(), any::<prop::sample::Index>()), 0..6),
        displaced in 0..5_u8,
    ) -> MaterialDesc {
        let mut nodes = nodes;
        let kind = match surface {
            0 => Some("ND_open_pbr_surface_surfaceshader"),
            1 => Some("ND_standard_surface_surfaceshader"),
            2 => Some("UsdPreviewSurface"),
            _ => None,
        };
        if let Some(kind) = kind {
            nodes[0].kind = kind.into();
            nodes[0].connections.clear();
            let names: Vec<_> = match standard().definition(kind) {
                Some(definition) => definition.inputs.iter().map(|input| input.name.clone()).collect(),
                None => ["diffuseColor", "roughness", "opacity", "normal", "displacement"].map(Into::into).to_vec(),
            };
            for (input, from) in wires {
                let (input, node) = (input.get(&names).clone(), from.index(nodes.len()));
                nodes[0].connections.push(ConnectionDesc { input, node, output: "out".into() });
            }
        }
        let last = nodes.len() - 1;
        let displacement = match displaced {
            0 => None,
            1 => Some(0),
            _ => Some(last),
        };
        if displaced > 2 {
            nodes[last].kind =
                (if displaced == 3 { "ND_displacement_float" } else { "ND_displacement_vector3" }).into();
            let connection = ConnectionDesc { input: "displacement".into(), node: last - 1, output: "out".into() };
            nodes[last].connections.push(connection);
        }
        MaterialDesc { displacement, ..network("/m", nodes) }
    }
}

fn finite(values: &[f32]) -> bool {
    values.iter().all(|value| value.is_finite())
}

fn check_material(material: &Material) {
    for input in &material.inputs {
        let is_finite = match input {
            InputValue::Constant(value) | InputValue::Primvar { fallback: value, .. } => finite(value),
            InputValue::Texture { scale, bias, transform, .. } => {
                finite(scale) && finite(bias) && finite(transform.as_flattened())
            }
            InputValue::Register(_) => true,
        };
        assert!(is_finite, "{input:?}");
    }
    assert!(material.opacity_threshold.is_finite());
    let emission = material.emission.as_ref().map_or(&material.program, |emission| &emission.program);
    for program in [&material.program, &material.opacity_program, emission] {
        for surface in [[0.3, -0.7, 1.9, 0.0], [0.0; 4], [3.0e38, -3.0e38, 1.0e-38, 0.0]] {
            let registers = run(program, |_| surface, |_, _| [65504.0, -1.0, 0.5, 0.0]);
            assert!(finite(registers.as_flattened()), "{registers:?}");
        }
    }
}

/// Checks everything that is guaranteed for a material of unknown origin.
fn check(desc: &MaterialDesc) {
    let CompiledMaterial { material, textures, problems, .. } = compile(desc);
    assert!(material.is_some() || !problems.is_empty(), "a surface that is none says why");
    material.iter().for_each(check_material);
    assert!(textures.iter().all(|texture| finite(&texture.fallback)), "{textures:?}");
    let told = describe(desc);
    assert_eq!(told.warnings.len(), problems.len());
    assert!(!format!("{told:?}").contains("\\u{1b}"), "no escapes of a terminal");
    // In a scene there is one message with the prim.
    let mut db = SceneDb::new();
    db.upsert_material(desc.clone());
    db.upsert_mesh(bind(grid("/q", 1), "/m", &[]));
    let commit = db.commit();
    commit.snapshot.validate().expect("a sound mesh, wherever it was moved to");
    let warnings = commit.warnings;
    let of_it: Vec<_> = warnings.iter().filter(|warning| &*warning.path == "/m").collect();
    assert_eq!(of_it.len(), usize::from(!problems.is_empty()), "{of_it:?}");
    assert!(of_it.iter().all(|warning| warning.message.len() <= MAX_MESSAGE_BYTES), "{} bytes", of_it[0].message.len());
    assert!(db.commit().warnings.is_empty(), "not again");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: networks(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_networks_are_materials_or_one_message(desc in any_network()) {
        check(&desc);
    }
}

#[test]
fn non_finite_values_count_as_unauthored() {
    for value in [f32::NAN, f32::INFINITY] {
        for surface in ["ND_open_pbr_surface_surfaceshader", "UsdPreviewSurface"] {
            let params = [
                ("base_weight", ParamValue::Float(value)),
                ("base_color", ParamValue::Vec3([0.5, value, 0.5])),
                ("diffuseColor", ParamValue::Vec3([0.5, value, 0.5])),
                ("ior", ParamValue::Float(value)),
            ];
            let desc = network("/m", vec![node(surface, &params, &[])]);
            check(&desc);
            let plain = network("/m", vec![node(surface, &[], &[])]);
            assert_eq!(compile(&desc).material, compile(&plain).material, "{surface} {value}");
        }
    }
}

#[test]
fn overlong_strings_give_short_messages() {
    let long = "x".repeat(5_000_000);
    let mut nodes = vec![node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1, "out")])];
    nodes.push(node("ND_image_color3", &[("file", text(&long))], &[]));
    nodes[1].path = format!("/m/{long}").into();
    check(&network("/m", nodes.clone()));
    nodes[1].kind = long.as_str().into();
    let desc = network("/m", nodes);
    check(&desc);
    let problems = compile(&desc).problems;
    assert!(problems.len() == 1 && problems[0].starts_with("`xxx") && problems[0].ends_with("..."), "{problems:?}");
}

/// Sums and differences of numbers near the largest one overflow; random networks found these.
#[test]
fn overflowing_inputs_are_dropped() {
    let huge = ParamValue::Vec3([3.4e38; 3]);
    let standard = "ND_standard_surface_surfaceshader";
    check(&network("/m", vec![node(standard, &[("opacity", huge.clone())], &[])]));
    // A texel is mapped from the least number to the greatest, at coordinates that grow without end.
    let [low, high] = [ParamValue::Vec3([-3.4e38; 3]), ParamValue::Vec3([3.4e38; 3])];
    let mapped = node("ND_mix_color3", &[("fg", high.clone()), ("bg", low.clone())], &[("mix", 2, "out")]);
    let picture = node("ND_image_float", &[("file", file("a.png"))], &[("texcoord", 3, "out")]);
    let place = node("ND_multiply_vector2FA", &[("in2", ParamValue::Float(3.4e38))], &[("in1", 4, "out")]);
    let surface = node("ND_surface_unlit", &[], &[("emission_color", 1, "out"), ("transmission_color", 1, "out")]);
    let coordinates = node("ND_texcoord_vector2", &[], &[]);
    check(&network("/m", vec![surface, mapped, picture, place, coordinates]));
}
