// SPDX-License-Identifier: Apache-2.0
//! Materials with known answers: emission seen as it is authored, subsets, primvars, opacity, normals in tangent space; and the
//! same bits when the scene streams.

use crate::scenes::{constant, dome, instanced, instancer, mesh, prim};
use crate::support::{orthographic, read, read_all, render, request, session, settings};
use glam::{DMat4, DQuat, DVec3, Vec3};
use oocpt_core::scene::{
    AssetRef, ConnectionDesc, Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, NodeDesc, ParamDesc, ParamValue,
    Primvar, SceneDb, SubsetDesc,
};
use oocpt_core::texture::TexelFormat;
use oocpt_core::{Element, TypedArray};
use oocpt_render::textures::{Image, ImageError, ImageInfo, ImageLibrary};
use oocpt_render::{AovKind, RenderRequest, Session, SessionOptions};
use std::sync::Arc;

const SIZE: [u32; 2] = [32, 32];

fn node(kind: &str, params: &[(&str, ParamValue)], connections: &[(&str, usize)]) -> NodeDesc {
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

fn material(path: &str, nodes: Vec<NodeDesc>) -> MaterialDesc {
    MaterialDesc { path: path.into(), nodes, surface: Some(0) }
}

fn plain(path: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    material(path, vec![node("UsdPreviewSurface", params, &[])])
}

/// A material that takes `input` from a primvar.
fn reading(path: &str, input: &str, kind: &str, name: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
    let reader = format!("UsdPrimvarReader_{kind}");
    let name = ("varname", ParamValue::Text(name.into()));
    material(path, vec![node("UsdPreviewSurface", params, &[(input, 1)]), node(&reader, &[name], &[])])
}

fn color(value: [f32; 3]) -> ParamValue {
    ParamValue::Vec3(value)
}

/// Two by two quads over -1..1 in x and y, facing +z; faces 0, 1 below, 2, 3 above.
fn board(path: &str, prim_id: i32, material: &str) -> MeshDesc {
    let at = [-1.0, 0.0, 1.0_f32];
    let points: Vec<[f32; 3]> = at.iter().flat_map(|&y| at.map(|x| [x, y, 0.0])).collect();
    let faces: Vec<Vec<i32>> = [0, 1, 3, 4].iter().map(|&k| vec![k, k + 1, k + 4, k + 3]).collect();
    let mut desc = mesh(prim(path, DMat4::IDENTITY), prim_id, points, &faces, 0.75);
    desc.material = Some(material.into());
    desc
}

fn with<T: Element + std::fmt::Debug>(
    mut desc: MeshDesc,
    name: &str,
    interpolation: Interpolation,
    values: Vec<T>,
) -> MeshDesc {
    let primvar = Primvar { interpolation, values: TypedArray::of(values), indices: None };
    desc.primvars.push(NamedPrimvar { name: name.into(), primvar });
    desc
}

fn front() -> RenderRequest {
    request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 2.0, SIZE))
}

fn shown(build: impl FnOnce(&mut SceneDb), samples: u32) -> (Session, RenderRequest) {
    let session = session(settings(samples, 2)).with_images(Arc::new(Ramps));
    session.with_scene(build);
    let request = front();
    render(&session, &request);
    (session, request)
}

/// Images of two by two texels of four bytes: red grows along s, green along t.
#[derive(Debug)]
struct Ramps;

impl ImageLibrary for Ramps {
    fn open(&self, _: &AssetRef) -> Result<Arc<dyn Image>, ImageError> {
        Ok(Arc::new(Self))
    }
}

impl Image for Ramps {
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
        assert_eq!((level, at, size), (0, [0; 2], [2; 2]), "the whole of it");
        out.copy_from_slice(&[51, 51, 0, 255, 255, 51, 0, 255, 51, 255, 0, 255, 255, 255, 0, 255]);
        Ok(())
    }
}

/// A material with a texture at `input`, looked up at the primvar "st", in raw numbers.
fn textured(path: &str, input: &str, output: &str, params: &[(&str, ParamValue)]) -> MaterialDesc {
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

/// Texture coordinates of the board's points: (0, 0) to (1, 1) over it, then mapped.
fn coordinates(map: impl Fn([f32; 2]) -> [f32; 2]) -> Vec<[f32; 2]> {
    let at = [0.0, 0.5, 1.0_f32];
    at.iter().flat_map(|&t| at.map(|s| map([s, t]))).collect()
}

/// Centre of a pixel in the plane of the board.
fn place(pixel: usize) -> [f32; 2] {
    let at = |k: usize| (f32::from(u16::try_from(k).expect("small")) + 0.5) / 16.0 - 1.0;
    [at(pixel % 32), at(pixel / 32)]
}

#[test]
fn emission_is_seen_exactly() {
    let glow = [1.5, 0.25, 3.7];
    let (session, request) = shown(
        |db| {
            let black = [("emissiveColor", color(glow)), ("diffuseColor", color([0.0; 3]))];
            db.upsert_material(plain("/glow", &black));
            db.upsert_mesh(board("/a", 1, "/glow"));
        },
        8,
    );
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    assert!(pixels.iter().all(|p| *p == [glow[0], glow[1], glow[2], 1.0]), "{:?}", pixels[0]);
    let left_out = session.stats().features_left_out;
    let has = |part: &str| left_out.iter().any(|name| name.contains(part));
    assert!(!has("materials, and") && !has("emission") && has("coats") && has("transmission"), "{left_out:?}");
}

#[test]
fn a_scene_without_materials_leaves_them_out() {
    let (session, _) = shown(
        |db| {
            db.upsert_mesh(MeshDesc { material: None, ..board("/a", 1, "") });
            db.upsert_light(dome([1.0; 3]));
        },
        1,
    );
    let left_out = session.stats().features_left_out;
    for part in ["materials, and", "cutouts in traversal", "emission", "coats", "transmission"] {
        assert!(left_out.iter().any(|name| name.contains(part)), "{part}: {left_out:?}");
    }
}

#[test]
fn emission_lights_other_surfaces() {
    // An emissive board of radiance 2 that fills the hemisphere of a small patch facing it: albedo * 2.
    let (session, request) = shown(
        |db| {
            // No specular lobe: what it would reflect is not in the sum.
            let dull = [("useSpecularWorkflow", ParamValue::Int(1)), ("specularColor", color([0.0; 3]))];
            let with = |params: &[(&'static str, ParamValue)]| [&dull[..], params].concat();
            let glow = [("emissiveColor", color([2.0; 3])), ("diffuseColor", color([0.0; 3]))];
            db.upsert_material(plain("/glow", &with(&glow)));
            db.upsert_material(plain("/grey", &with(&[("diffuseColor", color([0.5; 3]))])));
            let mut ceiling = board("/ceiling", 1, "/glow");
            ceiling.prim.transform = DMat4::from_scale_rotation_translation(
                DVec3::new(4000.0, 4000.0, 1.0),
                DQuat::IDENTITY,
                DVec3::new(0.0, 0.0, 9.0),
            );
            db.upsert_mesh(ceiling);
            db.upsert_mesh(board("/floor", 2, "/grey"));
        },
        16,
    );
    let pixels: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let mean: f32 = pixels.iter().map(|p| p[0]).sum::<f32>() / 1024.0;
    assert!((mean - 1.0).abs() < 0.01, "{mean}, not 0.5 * 2");
}

#[test]
fn subsets_show_their_materials_and_the_rest_its_color() {
    let values = [[0.25, 0.5, 1.0], [1.0, 0.0, 0.0]];
    let (session, request) = shown(
        |db| {
            db.upsert_material(plain("/m", &[("diffuseColor", color(values[0]))]));
            db.upsert_material(plain("/n", &[("diffuseColor", color(values[1]))]));
            let subset = |material: Option<&str>, face: i32| SubsetDesc {
                path: "/s".into(),
                material: material.map(Into::into),
                faces: TypedArray::of(vec![face]),
            };
            let mut desc = board("/a", 5, "/m");
            desc.subsets = vec![subset(Some("/n"), 3), subset(None, 1)];
            db.upsert_mesh(desc);
        },
        1,
    );
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    let faces: Vec<i32> = read(&session, &request, AovKind::ElementId);
    assert!((0..4).all(|face| faces.contains(&face)), "all faces are seen");
    for (albedo, face) in albedo.iter().zip(faces) {
        let expected = match face {
            3 => values[1],
            1 => [0.75; 3],
            _ => values[0],
        };
        assert_eq!(*albedo, expected, "face {face}");
    }
}

#[test]
fn primvars_of_every_rate_reach_the_surface() {
    let corners = |f: fn([f32; 2]) -> [f32; 3]| {
        let at = [-1.0, 0.0, 1.0_f32];
        at.iter().flat_map(|&y| at.map(|x| f([x, y]))).collect::<Vec<_>>()
    };
    let ramp = |[x, y]: [f32; 2]| [0.5 + 0.25 * x, 0.5 + 0.25 * y, 0.125];
    let by_face = [[0.0, 0.25, 0.5], [0.25; 3], [0.5; 3], [1.0; 3]];
    let by_corner: Vec<[f32; 3]> = (0..16_u8).map(|k| by_face[usize::from(k / 4)]).collect();
    let cases: Vec<(Interpolation, Vec<[f32; 3]>)> = vec![
        (Interpolation::Constant, vec![[0.5, 0.25, 0.75]]),
        (Interpolation::Uniform, by_face.to_vec()),
        (Interpolation::FaceVarying, by_corner),
        (Interpolation::Vertex, corners(ramp)),
        (Interpolation::Varying, corners(ramp)),
    ];
    for (interpolation, values) in cases {
        let first = values[0];
        let (session, request) = shown(
            |db| {
                db.upsert_material(reading("/m", "diffuseColor", "float3", "tint", &[]));
                db.upsert_mesh(with(board("/a", 5, "/m"), "tint", interpolation, values));
            },
            1,
        );
        let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
        let faces: Vec<i32> = read(&session, &request, AovKind::ElementId);
        for (pixel, (albedo, face)) in albedo.iter().zip(faces).enumerate() {
            let expected = match interpolation {
                Interpolation::Constant => first,
                Interpolation::Uniform | Interpolation::FaceVarying => by_face[usize::try_from(face).expect("a hit")],
                _ => ramp(place(pixel)),
            };
            let off = (Vec3::from(*albedo) - Vec3::from(expected)).abs().max_element();
            assert!(off < 1e-5, "{interpolation:?}, pixel {pixel}: {albedo:?}, not {expected:?}");
        }
    }
}

#[test]
fn a_missing_primvar_is_the_readers_fallback() {
    let (session, request) = shown(
        |db| {
            let fallback = ("fallback", color([0.5, 0.25, 0.125]));
            let name = ("varname", ParamValue::Text("nowhere".into()));
            let reader = node("UsdPrimvarReader_float3", &[fallback, name], &[]);
            db.upsert_material(material("/m", vec![node("UsdPreviewSurface", &[], &[("diffuseColor", 1)]), reader]));
            db.upsert_mesh(board("/a", 5, "/m"));
        },
        1,
    );
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    assert!(albedo.iter().all(|a| *a == [0.5, 0.25, 0.125]), "{:?}", albedo[0]);
}

#[test]
fn thresholds_cut_out_and_presence_is_a_probability() {
    let opacity: Vec<f32> = [-1.0, 0.0, 1.0_f32].iter().flat_map(|_| [0.0, 0.5, 1.0]).collect();
    let (session, request) = shown(
        |db| {
            let threshold = [("opacityThreshold", ParamValue::Float(0.25))];
            db.upsert_material(reading("/leaf", "opacity", "float", "alpha", &threshold));
            let leaf = with(board("/a", 5, "/leaf"), "alpha", Interpolation::Vertex, opacity);
            // displayOpacity is not for surfaces with a material.
            db.upsert_mesh(MeshDesc { display_opacity: constant(0.5_f32), ..leaf });
        },
        4,
    );
    // Opacity is (x + 1) / 2: what is left of x = -0.5 is not there, the rest is all there.
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    for (pixel, id) in ids.iter().enumerate() {
        assert_eq!(*id, if place(pixel)[0] < -0.5 { -1 } else { 5 }, "pixel {pixel}");
    }
    // The same for paths, apart from the column of pixels that the edge runs beside.
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    for (pixel, color) in colors.iter().enumerate().filter(|(k, _)| (place(*k)[0] + 0.5).abs() > 0.05) {
        assert_eq!(color[3], if place(pixel)[0] < -0.5 { 0.0 } else { 1.0 }, "pixel {pixel}");
    }

    let (session, request) = shown(
        |db| {
            let params = [("opacity", ParamValue::Float(0.25)), ("opacityMode", ParamValue::Text("presence".into()))];
            db.upsert_material(plain("/veil", &params));
            db.upsert_mesh(board("/a", 5, "/veil"));
        },
        256,
    );
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let mean: f32 = colors.iter().map(|c| c[3]).sum::<f32>() / 1024.0;
    // 262144 trials: the standard deviation is 0.00085.
    assert!((mean - 0.25).abs() < 0.004, "{mean} of the rays met it, not a quarter");
}

#[test]
fn normals_are_in_tangent_space() {
    // (u, v) to the board's plane: as it is, mirrored, turned by a quarter.
    type Map = fn([f32; 2]) -> [f32; 2];
    let maps: [(&str, Map, [f32; 3]); 3] = [
        ("plain", |[x, y]| [0.5 * x, 0.5 * y], [0.6, 0.0, 0.8]),
        ("mirrored", |[x, y]| [-0.5 * x, 2.0 * y], [-0.6, 0.0, 0.8]),
        ("turned", |[x, y]| [y, -x], [0.0, 0.6, 0.8]),
    ];
    for (name, map, expected) in maps {
        let st = coordinates(map);
        let (session, request) = shown(
            |db| {
                db.upsert_material(textured("/bent", "metallic", "r", &[("normal", color([0.6, 0.0, 0.8]))]));
                db.upsert_mesh(with(board("/a", 5, "/bent"), "st", Interpolation::Vertex, st));
            },
            1,
        );
        let normals: Vec<[f32; 3]> = read(&session, &request, AovKind::Normal);
        for normal in normals {
            let off = (Vec3::from(normal) - Vec3::from(expected)).abs().max_element();
            assert!(off < 1e-6, "{name}: {normal:?}, not {expected:?}");
        }
    }
}

#[test]
fn a_texture_lies_where_its_coordinates_say() {
    let (session, request) = shown(
        |db| {
            db.upsert_material(textured("/t", "diffuseColor", "rgb", &[]));
            db.upsert_mesh(with(board("/a", 5, "/t"), "st", Interpolation::Vertex, coordinates(|st| st)));
        },
        1,
    );
    let albedo: Vec<[f32; 3]> = read(&session, &request, AovKind::Albedo);
    // Bilinear between the texels' centres at a quarter and three quarters of the side.
    let ramp = |x: f32| 0.2 + 0.8 * (2.0 * (0.5 * x + 0.5) - 0.5).clamp(0.0, 1.0);
    for (pixel, albedo) in albedo.iter().enumerate() {
        let [x, y] = place(pixel);
        let off = (Vec3::from(*albedo) - Vec3::new(ramp(x), ramp(y), 0.0)).abs().max_element();
        assert!(off < 1e-5, "pixel {pixel}: {albedo:?}");
    }
}

#[test]
fn a_texture_cuts_out() {
    let (session, request) = shown(
        |db| {
            let threshold = [("opacityThreshold", ParamValue::Float(0.6))];
            db.upsert_material(textured("/leaf", "opacity", "r", &threshold));
            db.upsert_mesh(with(board("/a", 5, "/leaf"), "st", Interpolation::Vertex, coordinates(|st| st)));
        },
        1,
    );
    // Red is 0.2 to 1 over the middle half, 0.6 in the middle.
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    for (pixel, id) in ids.iter().enumerate() {
        assert_eq!(*id, if place(pixel)[0] < 0.0 { -1 } else { 5 }, "pixel {pixel}");
    }
}

/// Boards with everything above, one of them instanced.
fn everything(db: &mut SceneDb) {
    db.upsert_material(plain("/glow", &[("emissiveColor", color([1.5, 0.5, 0.25]))]));
    db.upsert_material(reading("/tinted", "diffuseColor", "float3", "tint", &[]));
    let threshold = [("opacityThreshold", ParamValue::Float(0.5))];
    db.upsert_material(reading("/leaf", "opacity", "float", "alpha", &threshold));
    let tint: Vec<[f32; 3]> = (0..9_u8).map(|k| [0.1 * f32::from(k), 0.5, 0.9]).collect();
    let mut tinted = with(board("/tinted_board", 3, "/tinted"), "tint", Interpolation::Vertex, tint);
    tinted.subsets =
        vec![SubsetDesc { path: "/s".into(), material: Some("/glow".into()), faces: TypedArray::of(vec![2]) }];
    db.upsert_mesh(tinted);
    let alpha: Vec<f32> = (0..9_u8).map(|k| 0.125 * f32::from(k)).collect();
    let mut leaf = with(board("/trees/leaf", 4, "/leaf"), "alpha", Interpolation::Vertex, alpha);
    leaf.prim = instanced(leaf.prim, "/trees");
    db.upsert_mesh(leaf);
    let turn = DQuat::from_rotation_y(0.5);
    let places = [1.0, 2.0].map(|z| (DVec3::new(0.3 * z, 0.1, z), turn, DVec3::splat(0.5)));
    db.upsert_instancer(instancer(prim("/trees", DMat4::IDENTITY), "/trees/leaf", &places));
    db.upsert_material(textured("/picture", "diffuseColor", "rgb", &[]));
    let mut picture = with(board("/picture_board", 6, "/picture"), "st", Interpolation::Vertex, coordinates(|st| st));
    picture.prim.transform =
        DMat4::from_scale_rotation_translation(DVec3::splat(0.4), turn, DVec3::new(0.5, -0.5, 1.5));
    db.upsert_mesh(picture);
    db.upsert_light(dome([0.5, 0.6, 0.7]));
}

#[test]
fn streaming_gives_the_same_bits() {
    let request = front();
    let images = [false, true].map(|force_streaming| {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let session = Session::with_options(settings(8, 3), options).with_images(Arc::new(Ramps));
        session.with_scene(everything);
        render(&session, &request);
        assert_eq!(session.stats().streaming.in_core, !force_streaming, "it streams when it is told to");
        read_all(&session, &request)
    });
    assert!(images[0] == images[1], "streaming changed a picture");
}

#[test]
fn an_edit_of_a_material_uploads_no_geometry() {
    let session = session(settings(1, 1)).with_images(Arc::new(Ramps));
    session.with_scene(everything);
    let request = front();
    render(&session, &request);
    let before = read_all(&session, &request);
    session.with_scene(|db| db.upsert_material(plain("/glow", &[("emissiveColor", color([0.25; 3]))])));
    render(&session, &request);
    assert!(before != read_all(&session, &request), "the edit is seen");
    let bytes = session.timings().uploaded_bytes;
    assert_eq!(bytes, 0, "nothing but tables is uploaded");
}
