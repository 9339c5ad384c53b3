// SPDX-License-Identifier: Apache-2.0
//! Ids of `MaterialX` 1.38: every one that 1.39 has no definition of gives what 1.38 specifies, or is named.

use oocpt_materialx::library::NodeLibrary;
use oocpt_materialx::network::{Network, NetworkNode};
use oocpt_materialx::program::Geometry;
use oocpt_materialx::surface::Input;
use oocpt_materialx::uses::MaterialUses;
use oocpt_materialx::value::PortValue;
use oocpt_materialx::{InputSource, TranslatedNetwork, translate};

use crate::support::{node, number, sound, source, text, translated, value, vector};

/// A unit normal that is no axis, with tangents to it.
const NORMAL: [f32; 4] = [0.6, 0.0, 0.8, 0.0];
const TANGENT: [f32; 4] = [0.8, 0.0, -0.6, 0.0];
const BITANGENT: [f32; 4] = [0.0, 1.0, 0.0, 0.0];

fn surface(what: Geometry) -> [f32; 4] {
    match what {
        Geometry::Normal => NORMAL,
        Geometry::Tangent | Geometry::FrameX => TANGENT,
        Geometry::Bitangent | Geometry::FrameY => BITANGENT,
        Geometry::ViewDirection => [0.0, 0.0, -1.0, 0.0],
        _ => [0.0; 4],
    }
}

fn near(value: [f32; 4], expected: [f32; 3]) -> bool {
    value.iter().zip(expected).all(|(a, b)| (a - b).abs() <= 1e-5)
}

/// What the emission is, that the last of these nodes gives: numbers of the world.
fn given(nodes: Vec<NetworkNode>) -> [f32; 4] {
    let mut all = vec![node("ND_surface_unlit", &[], &[("emission_color", nodes.len())])];
    all.extend(nodes);
    value(&sound(all), Input::EmissiveColor, surface, |_, _| [0.5; 4])
}

/// A map that leans along the tangent.
fn leaning() -> PortValue {
    vector(0.8, 0.5, 0.9)
}

#[test]
fn a_1_38_normal_map_uses_the_world_normal() {
    let in_world = |kind: &str| given(vec![node(kind, &[("in", leaning())], &[])]);
    // 0.6 T + 0.8 N.
    let expected = [0.96, 0.0, 0.28];
    for kind in ["ND_normalmap", "ND_normalmap_float", "ND_normalmap_vector2"] {
        assert!(near(in_world(kind), expected), "{kind}: {:?}", in_world(kind));
    }
    let scaled = given(vec![node("ND_normalmap", &[("in", leaning()), ("scale", number(0.0))], &[])]);
    assert!(near(scaled, [0.6, 0.0, 0.8]), "flat: {scaled:?}");
    let through =
        given(vec![node("ND_normalmap", &[("in", leaning())], &[]), node("ND_normalize_vector3", &[], &[("in", 1)])]);
    assert!(near(through, expected), "normalised: {through:?}");
    let facing =
        vec![node("ND_normalmap", &[("in", leaning())], &[]), node("ND_facingratio_float", &[], &[("normal", 1)])];
    assert!(near(given(facing), [0.28; 3]), "its cosine to the view");
}

/// 1.38 has no bitangent: it is at right angles to what is said.
#[test]
fn a_normal_map_of_1_38_makes_its_bitangent() {
    let about = |kind: &str| {
        let values =
            [("in", vector(0.5, 0.8, 0.9)), ("tangent", vector(0.0, 1.0, 0.0)), ("normal", vector(0.0, 0.0, 1.0))];
        given(vec![node(kind, &values, &[])])
    };
    // cross((0, 0, 1), (0, 1, 0)) = (-1, 0, 0).
    assert!(near(about("ND_normalmap"), [-0.6, 0.0, 0.8]), "{:?}", about("ND_normalmap"));
    assert!(near(about("ND_normalmap_float"), [0.0, 0.6, 0.8]), "1.39 has its own: {:?}", about("ND_normalmap_float"));
}

/// A map of normals that doubles x and turns a quarter about z, as the mesh's primvars say it.
fn placed(slot: usize) -> [f32; 4] {
    [[0.0, 2.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0]][slot]
}

fn by_slot(translation: &TranslatedNetwork, what: Geometry) -> [f32; 4] {
    let slot = match what {
        Geometry::Primvar0 => 0,
        Geometry::Primvar1 => 1,
        other => return surface(other),
    };
    let name = &*translation.uses.primvars[slot].name;
    placed(usize::from(name == MaterialUses::OBJECT_FRAME[1]))
}

#[test]
fn a_normal_map_of_object_space_goes_to_the_world() {
    let nodes = vec![
        node("ND_surface_unlit", &[], &[("emission_color", 1)]),
        node("ND_normalmap", &[("in", vector(0.8, 0.5, 0.9)), ("space", text("object"))], &[]),
    ];
    let translation = sound(nodes);
    let found = value(&translation, Input::EmissiveColor, |what| by_slot(&translation, what), |_, _| [0.5; 4]);
    // (0.6, 0, 0.8) goes to (0, 1.2, 0.8).
    let size = 1.2_f32.hypot(0.8);
    assert!(near(found, [0.0, 1.2 / size, 0.8 / size]), "{found:?}");
}

/// To the world as normals go, and back; between equal spaces nothing is done.
#[test]
fn normals_are_transformed_between_the_object_and_the_world() {
    let transformed = |from: &str, to: &str, normal: PortValue| {
        let values = [("in", normal), ("fromspace", text(from)), ("tospace", text(to))];
        let nodes = vec![
            node("ND_surface_unlit", &[], &[("emission_color", 1)]),
            node("ND_transformnormal_vector3", &values, &[]),
        ];
        let translation = sound(nodes);
        value(&translation, Input::EmissiveColor, |what| by_slot(&translation, what), |_, _| [0.5; 4])
    };
    let size = 1.2_f32.hypot(0.8);
    let there = [0.0, 1.2 / size, 0.8 / size];
    assert!(near(transformed("object", "world", vector(0.6, 0.0, 0.8)), there));
    let back = transformed("world", "object", vector(0.0, 1.2, 0.8));
    assert!(near(back, [0.6, 0.0, 0.8]), "{back:?}");
    assert!(near(transformed("model", "object", vector(0.0, 0.6, 0.8)), [0.0, 0.6, 0.8]));
}

/// The octahedral pair is unfolded on both sides of the plane z = 0.
#[test]
fn the_object_frame_z_axis_is_decoded() {
    let nodes = || {
        vec![
            node("ND_surface_unlit", &[], &[("emission_color", 1)]),
            node("ND_normalmap", &[("in", vector(0.5, 0.5, 1.0)), ("space", text("object"))], &[]),
        ]
    };
    let translation = sound(nodes());
    for axis in [[0.36, 0.48, 0.8], [0.36, 0.48, -0.8], [-0.48, 0.6, -0.64], [0.6, -0.8, 0.0], [0.0, 0.0, -1.0]] {
        let [x, y, z]: [f32; 3] = axis;
        let sum = x.abs() + y.abs() + z.abs();
        let sign = |v: f32| if v >= 0.0 { 1.0 } else { -1.0 };
        let (p, q) = (x / sum, y / sum);
        let pair = if z >= 0.0 { [p, q] } else { [(1.0 - q.abs()) * sign(p), (1.0 - p.abs()) * sign(q)] };
        let at = |what: Geometry| match what {
            Geometry::Primvar0 => [0.3, 0.1, 0.2, pair[0]],
            Geometry::Primvar1 => [0.3, -0.1, 0.2, pair[1]],
            other => surface(other),
        };
        let found = value(&translation, Input::EmissiveColor, at, |_, _| [0.5; 4]);
        assert!(near(found, axis), "{axis:?}: {found:?}");
    }
}

/// The normal of a surface, in its own frame.
fn local(nodes: Vec<NetworkNode>) -> [f32; 4] {
    value(&sound(nodes), Input::Normal, surface, |_, _| [0.5; 4])
}

#[test]
fn constant_world_space_normals_are_applied() {
    let shader = |normal: PortValue| vec![node("ND_standard_surface_surfaceshader", &[("normal", normal)], &[])];
    // Its parts along T, B, N.
    assert!(near(local(shader(vector(0.96, 0.0, 0.28))), [0.6, 0.0, 0.8]));
    assert!(near(local(shader(vector(-0.96, 0.0, -0.28))), [0.6, 0.0, 0.8]), "turned to the surface's own side");
    assert!(near(local(shader(vector(0.0, 0.0, 0.0))), [0.0, 0.0, 1.0]), "0 says nothing");
    let mut connected = shader(vector(1.0, 0.0, 0.0));
    connected[0].connections.push(("normal".into(), 1, "out".into()));
    connected.push(node("ND_constant_vector3", &[("value", vector(0.96, 0.0, 0.28))], &[]));
    assert!(near(local(connected), [0.6, 0.0, 0.8]), "by a node");
    let translation = sound(shader(vector(0.96, 0.0, 0.28)));
    assert!(translation.framed_normal, "it counts on meshes without tangents");
    assert!(translation.uses.uv_sets.is_empty(), "so none are asked for");
}

#[test]
fn preview_surface_normals_are_in_tangent_space() {
    let shader = |normal: PortValue| vec![node("ND_UsdPreviewSurface_surfaceshader", &[("normal", normal)], &[])];
    let translation = sound(shader(vector(0.6, 0.0, 0.8)));
    assert!(near(local(shader(vector(0.6, 0.0, 0.8))), [0.6, 0.0, 0.8]));
    assert!(!translation.framed_normal && &*translation.uses.uv_sets[0] == "st", "about tangents of a set");
    // How files of 1.38 decode a map for it.
    let decoded = vec![
        node("ND_UsdPreviewSurface_surfaceshader", &[], &[("normal", 1)]),
        node("ND_normalmap", &[("in", leaning()), ("space", text("object"))], &[]),
    ];
    assert!(near(local(decoded), [0.6, 0.0, 0.8]), "2 x - 1");
}

#[test]
fn a_normal_map_connected_directly_stays_a_texture() {
    let straight = |kind: &str| {
        sound(vec![
            node("ND_standard_surface_surfaceshader", &[], &[("normal", 1)]),
            node(kind, &[], &[("in", 2)]),
            node("ND_image_vector3", &[("file", crate::support::file("n.png"))], &[]),
        ])
    };
    for kind in ["ND_normalmap", "ND_normalmap_float"] {
        assert!(matches!(source(&straight(kind), Input::Normal), InputSource::Texture(..)), "{kind}");
    }
}

fn closure(kind: &str, values: &[(&str, PortValue)], connections: &[(&str, usize)]) -> NetworkNode {
    node(kind, values, connections)
}

#[test]
fn a_thin_film_layer_applies_to_the_base() {
    let film = |values: &[(&str, PortValue)]| {
        let nodes = vec![
            closure("ND_surface", &[], &[("bsdf", 1)]),
            closure("ND_layer_bsdf", &[], &[("top", 2), ("base", 3)]),
            closure("ND_thin_film_bsdf", values, &[]),
            closure("ND_conductor_bsdf", &[], &[]),
        ];
        match source(&sound(nodes), Input::ThinFilm) {
            InputSource::Constant([weight, thickness, index, _]) => [weight, thickness, index],
            other => panic!("{other:?}"),
        }
    };
    assert_eq!(film(&[]), [1.0, 550.0, 1.5], "the defaults of 1.38");
    assert_eq!(film(&[("thickness", number(300.0)), ("ior", number(1.3))]), [1.0, 300.0, 1.3]);
    assert_eq!(film(&[("thickness", number(0.0))])[0], 0.0, "none");
}

#[test]
fn a_thin_surface_uses_its_front_closure() {
    let sheet = |back: &[(&str, usize)]| {
        let mut connections = vec![("front_bsdf", 1)];
        connections.extend_from_slice(back);
        translated(vec![
            closure("ND_thin_surface", &[("opacity", number(0.5))], &connections),
            closure("ND_oren_nayar_diffuse_bsdf", &[("color", vector(0.1, 0.2, 0.3))], &[]),
            closure("ND_oren_nayar_diffuse_bsdf", &[], &[]),
        ])
    };
    let front = sheet(&[]);
    assert!(front.problems.is_empty() && front.thin_walled, "{:?}", front.problems);
    assert_eq!(source(&front, Input::Opacity), InputSource::Constant([0.5; 4]));
    let InputSource::Constant(color) = source(&front, Input::DiffuseColor) else { panic!("a colour") };
    assert!(near(color, [0.1, 0.2, 0.3]), "{color:?}");
    let both = sheet(&[("back_bsdf", 2)]);
    assert!(both.problems.len() == 1 && both.problems[0].contains("`thin_surface`"), "{:?}", both.problems);
}

#[test]
fn disney_2012_and_2015_map_to_disney_principled() {
    for kind in ["ND_disney_brdf_2012_surface", "ND_disney_bsdf_2015_surface"] {
        let translation = sound(vec![node(kind, &[("metallic", number(1.0))], &[])]);
        assert_eq!(source(&translation, Input::Metallic), InputSource::Constant([1.0; 4]), "{kind}");
        assert_eq!(source(&translation, Input::Roughness), InputSource::Constant([0.5; 4]), "{kind}: its default");
    }
    let thin = sound(vec![node("ND_disney_bsdf_2015_surface", &[("thin", number(1.0))], &[])]);
    assert!(thin.thin_walled, "a sheet");
}

/// What nobody can work out any more is named with its prim.
#[test]
fn removed_1_38_ids_are_reported_by_name() {
    for kind in [
        "ND_curveadjust_color3",
        "ND_arrayappend_color3_color3array",
        "ND_ambientocclusion_float",
        "ND_geompropvalue_string",
        "ND_no_such_node",
    ] {
        let surface = node("ND_open_pbr_surface_surfaceshader", &[], &[("base_color", 1)]);
        let translation = translated(vec![surface, node(kind, &[], &[])]);
        let path = format!("/m/{kind}");
        let is_named = translation.problems.iter().any(|line| line.contains(&path) && line.contains("not supported"));
        assert!(is_named && translation.inputs.is_some(), "{kind}: {:?}", translation.problems);
    }
    for kind in ["ND_add_surfaceshader", "ND_multiply_surfaceshaderF"] {
        let translation = translated(vec![node(kind, &[], &[])]);
        assert!(translation.problems.iter().any(|line| line.contains("not supported")), "{:?}", translation.problems);
    }
}

/// Graphs of files of 1.38, whose inputs later definitions do not have.
#[test]
fn graphs_of_1_38_are_understood() {
    let text = r#"<materialx version="1.38">
      <nodedef name="ND_old" node="old"><input name="v" type="vector2" value="0.25, 0.75" />
        <output name="out" type="color3" /></nodedef>
      <nodegraph name="NG_old" nodedef="ND_old">
        <swizzle name="y" type="float"><input name="in" type="vector2" interfacename="v" />
          <input name="channels" type="string" value="y" /></swizzle>
        <swizzle name="yyy" type="color3"><input name="in" type="float" nodename="y" />
          <input name="channels" type="string" value="xxx" /></swizzle>
        <output name="out" type="color3" nodename="yyy" />
      </nodegraph>
      <nodedef name="ND_lean" node="lean"><output name="out" type="color3" /></nodedef>
      <nodegraph name="NG_lean" nodedef="ND_lean">
        <normalmap name="n" type="vector3"><input name="in" type="vector3" value="0.8, 0.5, 0.9" />
          <input name="space" type="string" value="tangent" /></normalmap>
        <convert name="c" type="color3"><input name="in" type="vector3" nodename="n" /></convert>
        <output name="out" type="color3" nodename="c" />
      </nodegraph>
      <nodedef name="ND_turn" node="turn"><output name="out" type="float" /></nodedef>
      <nodegraph name="NG_turn" nodedef="ND_turn">
        <atan2 name="a" type="float"><input name="in1" type="float" value="1" />
          <input name="in2" type="float" value="0" /></atan2>
        <output name="out" type="float" nodename="a" />
      </nodegraph>
    </materialx>"#;
    let home = || std::path::PathBuf::from(std::env::var_os("HOME").expect("a home")).join(".cache/oocpt/host-25.08");
    let host = std::env::var_os("OOCPT_HOST_ROOT").map_or_else(home, std::path::PathBuf::from);
    let own = std::env::temp_dir().join(format!("oocpt-older-{}", std::process::id()));
    std::fs::create_dir_all(&own).expect("a folder");
    std::fs::write(own.join("old.mtlx"), text).expect("a file");
    let library =
        NodeLibrary::read_with(&[host.join("python/bpy/lib/materialx/libraries")], std::slice::from_ref(&own));
    drop(std::fs::remove_dir_all(&own));
    for (kind, expected) in
        [("ND_old", [0.75; 3]), ("ND_lean", [0.96, 0.0, 0.28]), ("ND_turn", [std::f32::consts::FRAC_PI_2; 3])]
    {
        let nodes = vec![node("ND_surface_unlit", &[], &[("emission_color", 1)]), node(kind, &[], &[])];
        let translation = translate(&Network { nodes, ..Network::default() }, &library);
        assert_eq!(translation.problems, Vec::<String>::new(), "{kind}");
        let found = value(&translation, Input::EmissiveColor, surface, |_, _| [0.5; 4]);
        assert!(near(found, expected), "{kind}: {found:?}");
    }
}
