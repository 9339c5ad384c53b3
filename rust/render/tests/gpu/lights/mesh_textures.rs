// SPDX-License-Identifier: Apache-2.0
//! Mesh lights whose emission is a primvar's or a texture's: closed forms by polygons, and the same light met by
//! chance.

use super::mesh::{black, corners, quad, small};
use super::shapes::polygon;
use super::{ALBEDO, downwards, expect};
use crate::materials::{reading, with};
use crate::scenes::{instanced, instancer, mesh, prim, square};
use crate::support::{color_request, orthographic, read, render, render_with_messages, session, settings};
use glam::{DMat4, DVec3};
use oocpt_core::scene::{
    AssetRef, ConnectionDesc, Interpolation, MaterialDesc, MeshDesc, NamedPrimvar, NodeDesc, ParamDesc, ParamValue,
    Primvar, SceneDb,
};
use oocpt_core::texture::TexelFormat;
use oocpt_core::{ArrayElement, TypedArray};
use oocpt_render::AovKind;
use oocpt_render::textures::{ImageError, ImageInfo, ImageLibrary, SourceImage};
use std::f64::consts::PI;
use std::sync::Arc;

/// Emits what the primvar "glow" says.
fn by_primvar() -> MaterialDesc {
    reading("/glow", "emissiveColor", "float3", "glow", &black())
}

/// Emits what a file says at "st", times `scale`.
pub(super) fn by_texture(file: &str, scale: f32) -> MaterialDesc {
    let text = |text: &str| ParamValue::Text(text.into());
    let node = |kind: &str, params: Vec<(&str, ParamValue)>, connections: Vec<(&str, usize, &str)>| NodeDesc {
        path: format!("/{kind}").into(),
        kind: kind.into(),
        params: params.into_iter().map(|(name, value)| ParamDesc { name: name.into(), value }).collect(),
        connections: connections
            .into_iter()
            .map(|(input, node, output)| ConnectionDesc { input: input.into(), node, output: output.into() })
            .collect(),
    };
    let asset = ParamValue::Asset(AssetRef { authored: file.into(), resolved: file.into() });
    let settings = vec![
        ("file", asset),
        ("sourceColorSpace", text("raw")),
        ("wrapS", text("clamp")),
        ("wrapT", text("clamp")),
        ("scale", ParamValue::Vec4([scale; 4])),
        ("fallback", ParamValue::Vec4([0.25, 0.25, 0.25, 1.0])),
    ];
    let nodes = vec![
        node("UsdPreviewSurface", black().to_vec(), vec![("emissiveColor", 1, "rgb")]),
        node("UsdUVTexture", settings, vec![("st", 2, "result")]),
        node("UsdPrimvarReader_float2", vec![("varname", text("st"))], Vec::new()),
    ];
    MaterialDesc { path: "/glow".into(), nodes, surface: Some(0), ..MaterialDesc::default() }
}

/// "steps": level `l` of 512 texels is `25 l + 25` all over. "letters": 64 texels, bright in some of them, all levels
/// made. "atlas": four by four texels, texel number `k` is `17 k`.
#[derive(Debug)]
pub(super) struct Library(pub(super) &'static str);

impl ImageLibrary for Library {
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        match &*asset.resolved {
            "steps" => Ok(Arc::new(Self("steps"))),
            "letters" => Ok(Arc::new(Self("letters"))),
            "atlas" => Ok(Arc::new(Self("atlas"))),
            _ => Err(ImageError("no such image".into())),
        }
    }
}

impl SourceImage for Library {
    fn info(&self) -> ImageInfo {
        let levels = match self.0 {
            "steps" => (0..10).map(|level| [512 >> level; 2]).collect(),
            "letters" => vec![[64; 2]],
            _ => vec![[4; 2]],
        };
        ImageInfo { levels, channels: 1, format: TexelFormat::U8, tile_friendly: true, is_srgb: None, wrap: None }
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        for (k, texel) in (0_u32..).zip(out) {
            let [x, y] = [at[0] + k % size[0], at[1] + k / size[0]];
            *texel = match self.0 {
                "steps" => u8::try_from(25 * level + 25).expect("ten levels"),
                "letters" => 255 * u8::from(x / 5 * 7 % 3 == 1 && y / 9 % 2 == 1),
                _ => u8::try_from(17 * (4 * y + x)).expect("16 texels"),
            };
        }
        Ok(())
    }
}

pub(super) fn add<T: ArrayElement + std::fmt::Debug>(
    desc: &mut MeshDesc,
    name: &str,
    interpolation: Interpolation,
    values: Vec<T>,
) {
    let primvar = Primvar { interpolation, values: TypedArray::of(values), indices: None };
    desc.primvars.push(NamedPrimvar { name: name.into(), primvar });
}

/// Three quads and two triangles in a row along x, over -1..1, in the plane z = 0; and their corners.
pub(super) fn row(transform: DMat4) -> (MeshDesc, Vec<Vec<DVec3>>) {
    let at = [-1.0, -0.6, 0.1, 0.6, 1.0_f32];
    let points: Vec<[f32; 3]> = at.iter().flat_map(|&x| [[x, -0.5, 0.0], [x, 0.5, 0.0]]).collect();
    let faces = [vec![0, 2, 3, 1], vec![2, 4, 5, 3], vec![4, 6, 7, 5], vec![6, 8, 7], vec![8, 9, 7]];
    let place = |k: &i32| {
        let [x, y, z] = points[usize::try_from(*k).expect("positive")].map(f64::from);
        transform.transform_point3(DVec3::new(x, y, z))
    };
    let places = faces.iter().map(|face| face.iter().map(place).collect()).collect();
    let mut desc = mesh(prim("/row", transform), 2, points.clone(), &faces, 0.0);
    desc.material = Some("/glow".into());
    (desc, places)
}

pub(super) fn above() -> DMat4 {
    downwards(DVec3::new(0.2, 0.8, -0.4))
}

/// For a square of half size 1: out of the camera's way.
pub(super) fn behind() -> DMat4 {
    downwards(DVec3::new(0.2, 0.8, -1.1))
}

/// One value for all, for each face, for each corner of a face; one face is dark.
#[test]
fn uniform_emission_primvars_match_polygon_irradiance() {
    let values = [[1.0_f32, 0.0, 0.0], [0.0; 3], [16.0, 8.0, 0.25], [0.0, 0.5, 4.0], [0.0, 0.0, 0.125]];
    let (desc, places) = row(above());
    let corners: Vec<[f32; 3]> = places.iter().zip(values).flat_map(|(face, value)| vec![value; face.len()]).collect();
    let cases = [
        (Interpolation::Constant, vec![[0.5_f32, 2.0, 1.0]]),
        (Interpolation::Uniform, values.to_vec()),
        (Interpolation::FaceVarying, corners),
    ];
    for (interpolation, given) in cases {
        let value = |face: usize| if given.len() == 1 { given[0] } else { values[face] };
        let wanted = |k: usize| -> f64 {
            places.iter().enumerate().map(|(face, corners)| f64::from(value(face)[k]) * polygon(corners)).sum()
        };
        let build = |db: &mut SceneDb| {
            db.upsert_material(by_primvar());
            db.upsert_mesh(with(desc.clone(), "glow", interpolation, given.clone()));
        };
        for (irradiance, how) in super::irradiances(2048, &build).into_iter().zip(["shadow rays", "both"]) {
            for (k, irradiance) in irradiance.into_iter().enumerate() {
                let wanted = wanted(k);
                assert!(
                    (irradiance / wanted - 1.0).abs() < 1e-2,
                    "{interpolation:?}, {how}, {k}: {irradiance}, not {wanted}"
                );
            }
        }
    }
}

/// Values at points, some of them negative: what is below 0 between them emits nothing.
#[test]
fn interpolated_emission_primvars_match_their_integral() {
    const STEPS: u32 = 200;
    let transform = behind();
    let mut desc = quad("/quad", 2, transform);
    let ramp = vec![[-1.0_f32, 0.0, 1.0], [3.0, 0.0, 1.0], [3.0, 2.0, 1.0], [-1.0, 2.0, 1.0]];
    add(&mut desc, "glow", Interpolation::Vertex, ramp);
    let mut wanted = [0.0; 3];
    let at = |k: u32| f64::from(k) / f64::from(STEPS) * 2.0 - 1.0;
    for (i, j) in (0..STEPS).flat_map(|i| (0..STEPS).map(move |j| (i, j))) {
        let [low, high] = [[at(i), at(j)], [at(i + 1), at(j + 1)]];
        let patch = [[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]]
            .map(|[x, y]| transform.transform_point3(DVec3::new(x, y, 0.0)));
        let share = polygon(&patch);
        let [x, y] = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
        let values: [f64; 3] = [1.0 + 2.0 * x, 1.0 + y, 1.0];
        for (wanted, value) in wanted.iter_mut().zip(values) {
            *wanted += share * value.max(0.0);
        }
    }
    let build = |db: &mut SceneDb| {
        db.upsert_material(by_primvar());
        db.upsert_mesh(desc.clone());
    };
    for irradiance in super::irradiances(2048, &build) {
        for (given, wanted) in irradiance.into_iter().zip(wanted) {
            assert!((given / wanted - 1.0).abs() < 1e-2, "{given}, not {wanted}");
        }
    }
}

/// A value for each instance; a hundred lamps of one mesh, some dark.
#[test]
fn instances_emit_their_own_primvar_values() {
    const COUNT: u32 = 100;
    let value = |i: u32| f32::from(u8::try_from(i % 7).expect("small")).powi(2);
    let half = 0.03;
    let wanted: f64 = (0..COUNT).map(|i| f64::from(value(i)) * small(i, half)).sum();
    expect("a value each", 2048, wanted, 1.2e-2, &|db| {
        let places: Vec<_> =
            (0..COUNT).map(|i| (super::mesh::place(i), super::mesh::turn(i), DVec3::splat(half))).collect();
        let mut lamps = instancer(prim("/lamps", DMat4::IDENTITY), "/lamps/lamp", &places);
        let values: Vec<[f32; 3]> = (0..COUNT).map(|i| [value(i); 3]).collect();
        let primvar = Primvar { interpolation: Interpolation::Instance, values: TypedArray::of(values), indices: None };
        lamps.primvars.push(NamedPrimvar { name: "glow".into(), primvar });
        db.upsert_instancer(lamps);
        db.upsert_material(by_primvar());
        let mut lamp = quad("/lamps/lamp", 2, DMat4::IDENTITY);
        lamp.prim = instanced(lamp.prim, "/lamps");
        db.upsert_mesh(lamp);
    });
}

/// Irradiance with a library of images, with shadow rays alone and with both strategies; the noise of the second.
pub(super) fn textured(samples: u32, build: &dyn Fn(&mut SceneDb)) -> [(f64, f64); 2] {
    [0, 1].map(|bounces| {
        let session = session(settings(samples, bounces)).with_images(Arc::new(Library("")));
        session.with_scene(|db| {
            db.upsert_mesh(square(prim("/floor", DMat4::IDENTITY), 1, ALBEDO));
            build(db);
        });
        let request = color_request(orthographic(DVec3::new(0.0, 5.0, 3.0), DVec3::ZERO, 0.01, [16, 16]));
        render(&session, &request);
        let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
        let values: Vec<f64> = colors.iter().map(|c| PI / f64::from(ALBEDO) * f64::from(c[0])).collect();
        let count = f64::from(u32::try_from(values.len()).expect("small"));
        let mean = values.iter().sum::<f64>() / count;
        (mean, values.iter().map(|v| (v / mean - 1.0).powi(2)).sum::<f64>() / count)
    })
}

/// Each face looks at the middle of one texel: no level but the finest counts.
#[test]
fn an_atlas_gives_each_face_its_texel() {
    let (mut desc, places) = row(above());
    let texels = [5_u8, 0, 15, 9, 2];
    let st = |k: u8| [f32::from(k % 4) / 4.0 + 0.125, f32::from(k / 4) / 4.0 + 0.125];
    let values: Vec<[f32; 2]> = places.iter().zip(texels).flat_map(|(face, k)| vec![st(k); face.len()]).collect();
    add(&mut desc, "st", Interpolation::FaceVarying, values);
    let wanted: f64 = places.iter().zip(texels).map(|(face, k)| 3.0 * f64::from(k) / 15.0 * polygon(face)).sum();
    let build = |db: &mut SceneDb| {
        db.upsert_material(by_texture("atlas", 3.0));
        db.upsert_mesh(desc.clone());
    };
    for (given, _) in textured(512, &build) {
        assert!((given / wanted - 1.0).abs() < 1e-2, "{given}, not {wanted}");
    }
}

/// A square with st from 0 to 1; `is_alone`: sampled as a light. Else another one below the floor shares its id, and
/// both are met by chance. `moved` says what else becomes of each, given how far it is from the first.
pub(super) fn screen_that(
    db: &mut SceneDb,
    transform: DMat4,
    is_alone: bool,
    moved: &dyn Fn(MeshDesc, DVec3) -> MeshDesc,
) {
    let mut desc = quad("/quad", 2, transform);
    add(&mut desc, "st", Interpolation::Vertex, vec![[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    if !is_alone {
        let below = DVec3::new(0.0, -50.0, 0.0);
        let place = DMat4::from_translation(below) * transform;
        db.upsert_mesh(moved(MeshDesc { prim: prim("/twin", place), ..desc.clone() }, below));
    }
    db.upsert_mesh(moved(desc, DVec3::ZERO));
}

/// The same at rest.
pub(super) fn screen(db: &mut SceneDb, transform: DMat4, is_alone: bool) {
    screen_that(db, transform, is_alone, &|desc, _| desc);
}

/// What shadow rays see of a texture is what rays see that come by chance: levels, slant and all.
#[test]
fn shadow_rays_and_hit_rays_see_the_same_emission_texture() {
    let leaning = DMat4::from_translation(DVec3::new(-0.3, 1.0, -0.6))
        * DMat4::from_rotation_x(-1.1)
        * DMat4::from_scale(DVec3::new(1.3, 0.8, 1.0));
    let large = downwards(DVec3::new(0.0, 6.0, -0.5)) * DMat4::from_scale(DVec3::splat(9.0));
    for (file, transform) in [("steps", leaning), ("steps", large), ("letters", leaning), ("letters", large)] {
        let build = |is_alone| {
            move |db: &mut SceneDb| {
                db.upsert_material(by_texture(file, 1.0));
                screen(db, transform, is_alone);
            }
        };
        let [shadow, both] = textured(512, &build(true));
        let [_, chance] = textured(1024, &build(false));
        // The scatter of 256 pixels tells the errors of the means.
        for (how, given) in [("shadow rays", shadow), ("both", both)] {
            let sigma = ((given.1 + chance.1) / 256.0).sqrt();
            let off = given.0 / chance.0 - 1.0;
            println!("{file}, {how}: {:.4}, by chance {:.4}: off by {off:.1e}, sigma {sigma:.1e}", given.0, chance.0);
            assert!(sigma < 4e-3, "{file}, {how}: too noisy to tell: {sigma}");
            assert!(off.abs() < 4.0 * sigma + 5e-4, "{file}, {how}: off by {off}, sigma {sigma}");
        }
    }
}

/// Far less noise than by chance, and no more than the texture itself makes.
#[test]
fn a_small_textured_emitter_has_low_noise() {
    let small = downwards(DVec3::new(0.0, 1.0, -0.5)) * DMat4::from_scale(DVec3::splat(0.1));
    let noise = |is_alone: bool| {
        let build = move |db: &mut SceneDb| {
            db.upsert_material(by_texture("letters", 1.0));
            screen(db, small, is_alone);
        };
        textured(64, &build)[1].1
    };
    let (light, chance) = (noise(true), noise(false));
    println!("relative MSE at 64 samples: as a light {light:.3e}, by chance {chance:.3e}");
    assert!(chance > 20.0 * light, "as a light {light}, by chance {chance}");
}

/// A texture without an image shows its fallback, to which no scale applies, and shines with it.
#[test]
fn a_missing_image_shines_with_its_fallback() {
    let session = session(settings(512, 0)).with_images(Arc::new(Library("")));
    session.with_scene(|db| {
        db.upsert_mesh(square(prim("/floor", DMat4::IDENTITY), 1, ALBEDO));
        db.upsert_material(by_texture("nothing", 7.0));
        screen(db, behind(), true);
    });
    let request = color_request(orthographic(DVec3::new(0.0, 5.0, 3.0), DVec3::ZERO, 0.01, [16, 16]));
    assert_eq!(render_with_messages(&session, &request).len(), 1, "that it is missing");
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let given = PI / f64::from(ALBEDO) * colors.iter().map(|c| f64::from(c[0])).sum::<f64>() / 256.0;
    let wanted = 0.25 * polygon(&corners(behind()));
    assert!((given / wanted - 1.0).abs() < 1e-2, "{given}, not {wanted}");
}

/// Only scenes that need it carry it.
#[test]
fn constant_emission_omits_light_textures() {
    let left_out = |material: MaterialDesc| {
        let session = session(settings(1, 1)).with_images(Arc::new(Library("")));
        session.with_scene(|db| {
            db.upsert_material(material);
            screen(db, DMat4::IDENTITY, true);
        });
        let request = color_request(orthographic(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, 1.0, [8, 8]));
        render(&session, &request);
        let left_out = session.stats().features_left_out;
        ["emissive meshes", "emission of lights by textures"]
            .map(|name| left_out.iter().any(|part| part.starts_with(name)))
    };
    assert_eq!(left_out(super::mesh::glow("/glow", [1.0; 3])), [false, true], "a constant");
    assert_eq!(left_out(by_texture("atlas", 1.0)), [false, false], "a texture");
    assert_eq!(left_out(by_primvar()), [true, true], "a primvar that is not there: its fallback is black");
}
