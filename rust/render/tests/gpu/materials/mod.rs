// SPDX-License-Identifier: Apache-2.0
//! Materials with known answers; and the same bits when the scene streams.

pub(super) mod absorption;
pub(super) mod cutouts;
mod dispersion;
mod emission_programs;
pub(super) mod hair;
mod instance_primvars;
pub(super) mod materialx;
pub(super) mod mixtures;
mod patterns;
mod preview_surface;
mod preview_surface_textures;
mod primvars;
mod streaming_and_edits;

use crate::scenes::{constant, dome, instanced, instancer, mesh, prim};
use crate::support::{orthographic, read, read_all, render, request, session, settings};
use glam::{DMat4, DQuat, DVec3, Vec3};
use oocpt_core::scene::{
    AssetRef, ConnectionDesc, Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, NodeDesc, ParamDesc, ParamValue,
    Primvar, SceneDb, SubsetDesc,
};
use oocpt_core::texture::TexelFormat;
use oocpt_core::{ArrayElement, TypedArray};
use oocpt_ptex::{DataType, MeshType, PtexFace, PtexWriter, ReadAt};
use oocpt_render::textures::{ImageError, ImageInfo, ImageLibrary, SourceImage};
use oocpt_render::{AovKind, RenderRequest, Session, SessionOptions};
use std::sync::Arc;

pub(super) const SIZE: [u32; 2] = [32, 32];

pub(super) fn node(kind: &str, params: &[(&str, ParamValue)], connections: &[(&str, usize)]) -> NodeDesc {
    let param = |(name, value): &(&str, ParamValue)| ParamDesc { name: (*name).into(), value: value.clone() };
    let connection =
        |(input, node): &(&str, usize)| ConnectionDesc { input: (*input).into(), node: *node, output: "result".into() };
    NodeDesc {
        path: format!("/{kind}").into(),
        kind: kind.into(),
        params: params.iter().map(param).collect(),
        connections: connections.iter().map(connection).collect(),
    }
}

pub(super) fn material(path: &str, nodes: Vec<NodeDesc>) -> MaterialDesc {
    MaterialDesc { path: path.into(), nodes, surface: Some(0), ..MaterialDesc::default() }
}

pub(super) fn plain(path: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    material(path, vec![node("UsdPreviewSurface", params, &[])])
}

/// A material that takes `input` from a primvar.
pub(super) fn reading(path: &str, input: &str, kind: &str, name: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    let reader = format!("UsdPrimvarReader_{kind}");
    let name = ("varname", ParamValue::Text(name.into()));
    material(path, vec![node("UsdPreviewSurface", params, &[(input, 1)]), node(&reader, &[name], &[])])
}

pub(super) fn color(value: [f32; 3]) -> ParamValue {
    ParamValue::Vec3(value)
}

/// Two by two quads over -1..1 in x and y, facing +z; faces 0, 1 below, 2, 3 above.
pub(super) fn board(path: &str, prim_id: i32, material: &str) -> MeshDesc {
    let at = [-1.0, 0.0, 1.0_f32];
    let points: Vec<[f32; 3]> = at.iter().flat_map(|&y| at.map(|x| [x, y, 0.0])).collect();
    let faces: Vec<Vec<i32>> = [0, 1, 3, 4].iter().map(|&k| vec![k, k + 1, k + 4, k + 3]).collect();
    let mut desc = mesh(prim(path, DMat4::IDENTITY), prim_id, points, &faces, 0.75);
    desc.material = Some(material.into());
    desc
}

pub(super) fn with<T: ArrayElement + std::fmt::Debug>(
    mut desc: MeshDesc,
    name: &str,
    interpolation: Interpolation,
    values: Vec<T>,
) -> MeshDesc {
    let primvar = Primvar { interpolation, values: TypedArray::of(values), indices: None };
    desc.primvars.push(NamedPrimvar { name: name.into(), primvar });
    desc
}

pub(super) fn front() -> RenderRequest {
    request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, SIZE))
}

pub(super) fn shown(build: impl FnOnce(&mut SceneDb), samples: u32) -> (Session, RenderRequest) {
    let session = session(settings(samples, 2)).with_images(Arc::new(Ramps));
    session.with_scene(build);
    let request = front();
    render(&session, &request);
    (session, request)
}

/// Images of two by two texels of four bytes: red grows along s, green along t.
#[derive(Debug)]
pub(super) struct Ramps;

impl ImageLibrary for Ramps {
    fn open(&self, _: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        Ok(Arc::new(Self))
    }

    fn bytes(&self, _: &AssetRef) -> Result<Box<dyn ReadAt>, ImageError> {
        ptex_file()
    }
}

/// A Ptex file of a face of 2 x 2 texels for each of the board's four.
pub(super) fn ptex_file() -> Result<Box<dyn ReadAt>, ImageError> {
    let written = PtexWriter::new(Vec::new(), MeshType::Quad, DataType::U8, 1, None, 4).and_then(|mut writer| {
        (0..4).try_for_each(|face| writer.push_face(&PtexFace::new([1, 1]), &[51 * face, 80, 120, 255]))?;
        writer.finish()
    });
    Ok(Box::new(written.map_err(|error| ImageError(error.to_string()))?))
}

impl SourceImage for Ramps {
    fn info(&self) -> ImageInfo {
        ImageInfo {
            levels: vec![[2, 2]],
            channels: 4,
            format: TexelFormat::U8,
            tile_friendly: true,
            is_srgb: None,
            wrap: None,
        }
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        assert!(level == 0 && at[0] == 0 && size[0] == 2 && at[1] + size[1] <= 2, "rows of it: {at:?}, {size:?}");
        let rows: [[u8; 8]; 2] = [[51, 51, 0, 255, 255, 51, 0, 255], [51, 255, 0, 255, 255, 255, 0, 255]];
        out.copy_from_slice(&rows.concat()[at[1] as usize * 8..][..size[1] as usize * 8]);
        Ok(())
    }
}

/// A material with a texture at `input`, looked up at the primvar "st", in raw numbers.
pub(super) fn textured(path: &str, input: &str, output: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    let text = |text: &str| ParamValue::Text(text.into());
    let settings = [
        ("file", text("ramps")),
        ("sourceColorSpace", text("raw")),
        ("wrapS", text("clamp")),
        ("wrapT", text("clamp")),
    ];
    let nodes = vec![
        node("UsdPreviewSurface", params, &[(input, 1)]),
        node("UsdUVTexture", &settings, &[("st", 2)]),
        node("UsdPrimvarReader_float2", &[("varname", text("st"))], &[]),
    ];
    let mut desc = material(path, nodes);
    desc.nodes[0].connections[0].output = output.into();
    desc
}

/// A material whose diffuse colour is Ptex.
pub(super) fn painted(path: &str) -> MaterialDesc {
    let nodes = vec![
        node("UsdPreviewSurface", &[], &[("diffuseColor", 1)]),
        node("UsdUVTexture", &[("file", ParamValue::Text("ramps.ptx".into()))], &[]),
    ];
    let mut desc = material(path, nodes);
    desc.nodes[0].connections[0].output = "rgb".into();
    desc
}

/// Texture coordinates of the board's points: (0, 0) to (1, 1) over it, then mapped.
pub(super) fn coordinates(map: impl Fn([f32; 2]) -> [f32; 2]) -> Vec<[f32; 2]> {
    let at = [0.0, 0.5, 1.0_f32];
    at.iter().flat_map(|&t| at.map(|s| map([s, t]))).collect()
}

/// Centre of a pixel in the plane of the board.
pub(super) fn place(pixel: usize) -> [f32; 2] {
    let at = |k: usize| (f32::from(u16::try_from(k).expect("small")) + 0.5) / 16.0 - 1.0;
    [at(pixel % 32), at(pixel / 32)]
}
