// SPDX-License-Identifier: Apache-2.0
//! Turns material networks that cross the boundary into the core's descriptions. Pure; any thread.

use crate::convert::{ConversionWarnings, asset};
use crate::ffi;
use oocpt_core::scene::{AssetRef, ConnectionDesc, MaterialDesc, NodeDesc, ParamDesc, ParamValue};
use std::sync::Arc;

/// The core's material. Connections and terminals that lead to no node of the material are left out and named.
pub(crate) fn material(desc: ffi::MaterialDesc, complaints: &mut ConversionWarnings) -> MaterialDesc {
    let count = desc.nodes.len();
    let mut terminal = |name: &str, node: i32| {
        let found = usize::try_from(node).ok().filter(|node| *node < count);
        if found.is_none() && node >= 0 {
            complaints.add(&desc.path, name, "its node is not there");
        }
        found
    };
    let (surface, displacement) = (terminal("surface", desc.surface), terminal("displacement", desc.displacement));
    let nodes = desc.nodes.into_iter().map(|desc| node(desc, count, complaints)).collect();
    MaterialDesc { path: Arc::from(desc.path), nodes, surface, displacement }
}

fn node(desc: ffi::NodeDesc, count: usize, complaints: &mut ConversionWarnings) -> NodeDesc {
    let connection = |desc_: ffi::ConnectionDesc| {
        let node = usize::try_from(desc_.node).ok().filter(|node| *node < count);
        if node.is_none() {
            complaints.add(&desc.path, &desc_.input, "its source is not there");
        }
        Some(ConnectionDesc { input: Arc::from(desc_.input), node: node?, output: Arc::from(desc_.output) })
    };
    let connections = desc.connections.into_iter().filter_map(connection).collect();
    let params = desc.params.into_iter().filter_map(param).collect();
    NodeDesc { path: Arc::from(desc.path), kind: Arc::from(desc.kind), params, connections }
}

fn param(desc: ffi::ParamDesc) -> Option<ParamDesc> {
    let [x, y, z, w] = desc.numbers;
    let value = match desc.tag {
        ffi::ParamTag::Bool => ParamValue::Bool(desc.flag),
        ffi::ParamTag::Int => ParamValue::Int(desc.integer),
        ffi::ParamTag::Float => ParamValue::Float(x),
        ffi::ParamTag::Vec2 => ParamValue::Vec2([x, y]),
        ffi::ParamTag::Vec3 => ParamValue::Vec3([x, y, z]),
        ffi::ParamTag::Vec4 => ParamValue::Vec4([x, y, z, w]),
        ffi::ParamTag::Text => ParamValue::Text(Arc::from(desc.text)),
        // An authored but empty path is not the same as no input: the texture has its fallback.
        ffi::ParamTag::Asset => ParamValue::Asset(
            asset(desc.asset).unwrap_or_else(|| AssetRef { authored: Arc::from(""), resolved: Arc::from("") }),
        ),
        _ => return None,
    };
    Some(ParamDesc { name: Arc::from(desc.name), value })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn param_desc(name: &str, tag: ffi::ParamTag) -> ffi::ParamDesc {
        ffi::ParamDesc {
            name: name.into(),
            tag,
            flag: true,
            integer: -7,
            numbers: [0.25, 0.5, 0.75, 1.0],
            text: "repeat".into(),
            asset: ffi::AssetDesc { authored: "a.png".into(), resolved: "/t/a.png".into() },
        }
    }

    fn material_desc(node: u32, surface: i32) -> ffi::MaterialDesc {
        let connections = vec![ffi::ConnectionDesc { input: "diffuseColor".into(), node, output: "rgb".into() }];
        let tags = [
            ("b", ffi::ParamTag::Bool),
            ("i", ffi::ParamTag::Int),
            ("f", ffi::ParamTag::Float),
            ("2", ffi::ParamTag::Vec2),
            ("3", ffi::ParamTag::Vec3),
            ("4", ffi::ParamTag::Vec4),
            ("t", ffi::ParamTag::Text),
            ("a", ffi::ParamTag::Asset),
        ];
        let params = tags.map(|(name, tag)| param_desc(name, tag)).into();
        let tex = ffi::NodeDesc { path: "/M/Tex".into(), kind: "UsdUVTexture".into(), params, connections: Vec::new() };
        let surf =
            ffi::NodeDesc { path: "/M/S".into(), kind: "UsdPreviewSurface".into(), params: Vec::new(), connections };
        ffi::MaterialDesc { path: "/M".into(), nodes: vec![surf, tex], surface, displacement: surface + 1 }
    }

    #[test]
    fn a_material_network_is_converted_whole() {
        let mut complaints = ConversionWarnings::default();
        let material = material(material_desc(1, 0), &mut complaints);
        assert!(complaints.0.is_empty(), "nothing is wrong: {:?}", complaints.0);
        assert_eq!((&*material.path, material.surface), ("/M", Some(0)), "path and terminal");
        assert_eq!(material.displacement, Some(1), "the other terminal");
        let connection = &material.nodes[0].connections[0];
        assert_eq!((&*connection.input, connection.node, &*connection.output), ("diffuseColor", 1, "rgb"), "source");
        let values: Vec<ParamValue> = material.nodes[1].params.iter().map(|param| param.value.clone()).collect();
        let expected = [
            ParamValue::Bool(true),
            ParamValue::Int(-7),
            ParamValue::Float(0.25),
            ParamValue::Vec2([0.25, 0.5]),
            ParamValue::Vec3([0.25, 0.5, 0.75]),
            ParamValue::Vec4([0.25, 0.5, 0.75, 1.0]),
            ParamValue::Text("repeat".into()),
            ParamValue::Asset(AssetRef { authored: "a.png".into(), resolved: "/t/a.png".into() }),
        ];
        assert_eq!(values, expected, "every kind of value");
    }

    #[test]
    fn dangling_connections_are_dropped_with_a_warning() {
        let mut complaints = ConversionWarnings::default();
        let material = material(material_desc(9, 5), &mut complaints);
        assert_eq!((material.surface, material.displacement), (None, None), "no such node");
        assert!(material.nodes[0].connections.is_empty(), "no such source");
        assert_eq!(complaints.0.len(), 3, "all are named: {:?}", complaints.0);
    }

    #[test]
    fn a_value_of_unknown_type_is_dropped() {
        assert!(param(param_desc("x", ffi::ParamTag { repr: 200 })).is_none(), "unknown tag");
    }
}
