// SPDX-License-Identifier: Apache-2.0
//! Materials and meshes of the textured scenes: `UsdPreviewSurface` with pictures at the primvar `st`.

use anyhow::Result;
use glam::DVec3;
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::scene::{
    AssetRef, ConnectionDesc, Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, NodeDesc, ParamDesc, ParamValue,
    Primvar,
};

/// A picture, and which of its outputs go to which inputs of the surface.
pub(crate) struct Picture<'a> {
    pub(crate) name: String,
    pub(crate) outputs: &'a [(&'a str, &'a str)],
}

/// A material of pictures; `threshold`: its opacity cuts.
pub(crate) fn material(path: &str, pictures: &[Picture<'_>], threshold: Option<f32>) -> MaterialDesc {
    let own = threshold.map(|value| ParamDesc { name: "opacityThreshold".into(), value: ParamValue::Float(value) });
    let mut surface = node("UsdPreviewSurface", own.into_iter().collect());
    // Nodes: the surface, the reader, then pictures.
    let reader = node(
        "UsdPrimvarReader_float2",
        vec![ParamDesc { name: "varname".into(), value: ParamValue::Text("st".into()) }],
    );
    let mut nodes = Vec::new();
    for (at, picture) in (2..).zip(pictures) {
        for (output, input) in picture.outputs {
            surface.connections.push(ConnectionDesc { input: (*input).into(), node: at, output: (*output).into() });
        }
        let text = |value: &str| ParamValue::Text(value.into());
        let name = picture.name.as_str();
        let raw = name.starts_with("surface");
        let params = [
            ("file", ParamValue::Asset(AssetRef { authored: name.into(), resolved: name.into() })),
            ("sourceColorSpace", text(if raw { "raw" } else { "sRGB" })),
            ("wrapS", text("repeat")),
            ("wrapT", text("repeat")),
        ];
        let params = params.map(|(name, value)| ParamDesc { name: name.into(), value });
        let mut node = node("UsdUVTexture", params.into());
        node.connections.push(ConnectionDesc { input: "st".into(), node: 1, output: "result".into() });
        nodes.push(node);
    }
    nodes.splice(0..0, [surface, reader]);
    MaterialDesc { path: path.into(), nodes, surface: Some(0), ..MaterialDesc::default() }
}

fn node(kind: &str, params: Vec<ParamDesc>) -> NodeDesc {
    NodeDesc { path: format!("/{kind}").into(), kind: kind.into(), params, connections: Vec::new() }
}

/// Gives a mesh texture coordinates, one at each of its points, and a material.
pub(crate) fn dress(mut mesh: MeshDesc, st: Vec<[f32; 2]>, material: &str) -> Result<MeshDesc> {
    let values = TypedArray::from_vec(ElementType::Vec2f, st)?;
    let primvar = Primvar { interpolation: Interpolation::Vertex, values, indices: None };
    mesh.primvars.push(NamedPrimvar { name: "st".into(), primvar });
    mesh.material = Some(material.into());
    Ok(mesh)
}

/// Cards of one quad each: the centre of one, and half its sides.
pub(crate) fn cards(mesh: MeshDesc, cards: &[(DVec3, DVec3, DVec3)], material: &str) -> Result<MeshDesc> {
    let mut points = Vec::new();
    let mut st = Vec::new();
    for (centre, right, up) in cards {
        for (s, t) in [(0.0_f32, 0.0_f32), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let at = *centre + *right * f64::from(2.0 * s - 1.0) + *up * f64::from(2.0 * t - 1.0);
            points.push(at.as_vec3().to_array());
            st.push([s, t]);
        }
    }
    let indices = (0..i32::try_from(points.len())?).collect::<Vec<_>>();
    let mesh = MeshDesc {
        face_vertex_counts: TypedArray::from_vec(ElementType::I32, vec![4_i32; cards.len()])?,
        face_vertex_indices: TypedArray::from_vec(ElementType::I32, indices)?,
        points: TypedArray::from_vec(ElementType::Vec3f, points)?,
        ..mesh
    };
    dress(mesh, st, material)
}
