// SPDX-License-Identifier: Apache-2.0
//! Networks of `MaterialX` as materials: colour spaces of values and files, what a material is flagged for. The
//! translation itself has tests of its own in `oocpt-materialx`.

use oocpt_abi::{MaterialFlags, MaterialInput};
use oocpt_core::material::{CompiledMaterial, compile};
use oocpt_core::{ColorSpace, InputValue, NodeDesc, ParamValue, Wrap};

use crate::material::preview_surface::{file, network, node, text};

const SURFACE: &str = "ND_standard_surface_surfaceshader";
const IMAGE: &str = "ND_image_color3";

fn of(nodes: Vec<NodeDesc>) -> CompiledMaterial {
    compile(&network("/m", nodes))
}

#[test]
fn colours_in_the_srgb_curve_are_made_linear() {
    let color = ("base_color", ParamValue::Vec3([0.5, 1.0, 0.0]));
    let space = ("colorSpace:base_color", text("srgb_texture"));
    for (params, expected) in [(vec![color.clone()], 0.5_f32), (vec![color, space], 0.214_041_14)] {
        let material = of(vec![node(SURFACE, &params, &[])]).material.expect("a surface");
        let InputValue::Constant([red, green, blue, _]) = *material.input(MaterialInput::DiffuseColor) else {
            panic!("{material:?}")
        };
        assert!((red - expected).abs() < 1e-6 && (green - 1.0).abs() < 1e-6 && blue == 0.0, "{red} {green} {blue}");
    }
}

/// A file without a colour space is linear, as the documents of `MaterialX` are.
#[test]
fn files_use_the_authored_color_space() {
    for (said, expected) in [(None, ColorSpace::Raw), (Some("srgb_texture"), ColorSpace::Srgb)] {
        let mut params = vec![("file", file("a.png")), ("uaddressmode", text("clamp"))];
        params.extend(said.map(|space| ("colorSpace:file", text(space))));
        let compiled = of(vec![node(SURFACE, &[], &[("base_color", 1, "out")]), node(IMAGE, &params, &[])]);
        assert_eq!(compiled.problem(), None);
        let [texture] = &compiled.textures[..] else { panic!("{compiled:?}") };
        assert_eq!((&texture.color_space, texture.wrap), (&expected, [Wrap::Clamp, Wrap::Repeat]));
        let material = compiled.material.expect("a surface");
        assert!(matches!(
            material.input(MaterialInput::DiffuseColor),
            InputValue::Texture { texture: 0, channel: None, .. }
        ));
    }
}

#[test]
fn material_flags_match_the_features_they_need() {
    let flags = |params: &[(&str, ParamValue)]| of(vec![node(SURFACE, params, &[])]).material.expect("a surface").flags;
    let plain = flags(&[]);
    assert!(plain == MaterialFlags::OPEN_PBR, "{plain:?}");
    let one = ParamValue::Float(1.0);
    for (name, flag) in [
        ("coat", MaterialFlags::COAT),
        ("sheen", MaterialFlags::SHEEN),
        ("emission", MaterialFlags::EMISSIVE),
        ("transmission", MaterialFlags::TRANSMISSIVE | MaterialFlags::ROUGH_TRANSMISSION),
    ] {
        assert_eq!(flags(&[(name, one.clone())]), plain | flag, "{name}");
    }
    let half = flags(&[("opacity", ParamValue::Vec3([0.5; 3]))]);
    assert_eq!(half, plain | MaterialFlags::PRESENCE, "opacity is whether the surface is there");
    let by_program = of(vec![node(SURFACE, &[], &[("opacity", 1, "out")]), node("ND_noise2d_color3", &[], &[])]);
    let expected = plain | MaterialFlags::PRESENCE | MaterialFlags::PATTERNS | MaterialFlags::CUTOUT_PROGRAM;
    let material = by_program.material.expect("a surface");
    assert_eq!(material.flags, expected, "its opacity has a program");
    assert!(material.program.instructions.is_empty() && !material.opacity_program.instructions.is_empty());
}

/// A fibre's inputs mean something else, so it needs nothing of what their names say.
#[test]
fn hair_materials_set_only_the_hair_flag() {
    let said = [("roughness_R", ParamValue::Vec2([0.5, 0.25])), ("absorption_coefficient", ParamValue::Vec3([1.0; 3]))];
    let nodes = vec![node("ND_surface", &[], &[("bsdf", 1, "out")]), node("ND_chiang_hair_bsdf", &said, &[])];
    let compiled = of(nodes);
    assert_eq!(compiled.problem(), None);
    let material = compiled.material.expect("a surface");
    assert_eq!(material.flags, MaterialFlags::OPEN_PBR | MaterialFlags::HAIR);
    assert!(material.uv_sets.is_empty() && &*material.primvars[0].name == oocpt_core::material::ACROSS_NAME);
}

#[test]
fn an_unsupported_surface_node_is_one_problem() {
    let compiled = of(vec![node("ND_no_such_surface", &[], &[])]);
    assert_eq!(compiled.material, None);
    assert!(compiled.problem().expect("a warning").contains("no_such_surface"));
}
