// SPDX-License-Identifier: Apache-2.0
//! Networks by hand, and what their programs give.

use std::path::PathBuf;
use std::sync::OnceLock;

use oocpt_materialx::eval::run;
use oocpt_materialx::library::NodeLibrary;
use oocpt_materialx::network::{Network, NetworkNode};
use oocpt_materialx::program::{Geometry, ProgramLookup};
use oocpt_materialx::surface::Input;
use oocpt_materialx::value::{FileRef, PortValue};
use oocpt_materialx::{InputSource, TranslatedNetwork, translate};

/// `MaterialX`'s own data libraries, from the host that the tests have.
pub(crate) fn library() -> &'static NodeLibrary {
    static LIBRARY: OnceLock<NodeLibrary> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let home = || PathBuf::from(std::env::var_os("HOME").expect("a home")).join(".cache/oocpt/host-25.08");
        let host = std::env::var_os("OOCPT_HOST_ROOT").map_or_else(home, PathBuf::from);
        let library = NodeLibrary::read(&[host.join("python/bpy/lib/materialx/libraries")]);
        assert!(!library.is_empty(), "no data libraries in {}: run the tests by `cargo xtask test`", host.display());
        library
    })
}

pub(crate) fn node(kind: &str, values: &[(&str, PortValue)], connections: &[(&str, usize)]) -> NetworkNode {
    NetworkNode {
        path: format!("/m/{kind}").into(),
        kind: kind.into(),
        values: values.iter().map(|(name, value)| ((*name).into(), value.clone())).collect(),
        connections: connections.iter().map(|(name, node)| ((*name).into(), *node, "out".into())).collect(),
    }
}

pub(crate) fn number(value: f32) -> PortValue {
    PortValue::Numbers([value; 4])
}

pub(crate) fn vector(x: f32, y: f32, z: f32) -> PortValue {
    PortValue::Numbers([x, y, z, 0.0])
}

pub(crate) fn text(text: &str) -> PortValue {
    PortValue::Text(text.into())
}

pub(crate) fn file(name: &str) -> PortValue {
    PortValue::File(FileRef {
        authored: name.into(),
        resolved: name.into(),
        color_space: None,
        node: "/m/image".into(),
    })
}

/// A network whose surface is its first node.
pub(crate) fn translated(nodes: Vec<NetworkNode>) -> TranslatedNetwork {
    translate(&Network { nodes, ..Network::default() }, library())
}

/// The same, without a problem.
pub(crate) fn sound(nodes: Vec<NetworkNode>) -> TranslatedNetwork {
    let translation = translated(nodes);
    assert_eq!(translation.problems, Vec::<String>::new(), "a sound network has no problem");
    translation
}

/// Where an input comes from.
pub(crate) fn source(translation: &TranslatedNetwork, input: Input) -> InputSource {
    translation.inputs.expect("a surface")[input as usize]
}

/// The value of an input at a surface, texels being what `lookup` says.
pub(crate) fn value(
    translation: &TranslatedNetwork,
    input: Input,
    surface: impl Fn(Geometry) -> [f32; 4],
    lookup: impl Fn(&ProgramLookup, [f32; 2]) -> [f32; 4],
) -> [f32; 4] {
    match source(translation, input) {
        InputSource::Constant(value) => value,
        InputSource::Register(register) => {
            let lookup = |found: &ProgramLookup, place: Option<[f32; 2]>| lookup(found, place.unwrap_or_default());
            run(&translation.program, surface, lookup)[usize::from(register)]
        }
        other => panic!("{input:?} is {other:?}"),
    }
}

/// The value of an expression of one node of `kind` at texture coordinates (0.3, 0.6).
pub(crate) fn of_node(kind: &str, values: &[(&str, PortValue)]) -> [f32; 4] {
    let surface = node("ND_open_pbr_surface_surfaceshader", &[("base_weight", number(1.0))], &[("base_color", 1)]);
    let translation = sound(vec![surface, node(kind, values, &[])]);
    let at = |what: Geometry| match what {
        Geometry::Uv0 => [0.3, 0.6, 0.0, 0.0],
        _ => [0.2, 0.4, 0.8, 0.0],
    };
    value(&translation, Input::DiffuseColor, at, |_, _| [0.5; 4])
}
