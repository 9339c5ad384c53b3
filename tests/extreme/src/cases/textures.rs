// SPDX-License-Identifier: Apache-2.0
//! Textures at the limits: coordinates far away or without a value, shapes of one texel across, texels without a value,
//! and a large one that streams and gives the bits it gives in core.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{DMat4, DVec3};
use oocpt_core::TypedArray;
use oocpt_core::scene::{AssetRef, Interpolation, MeshDesc, NamedPrimvar, ParamValue, Primvar, SceneDb};
use oocpt_core::texture::TexelFormat;
use oocpt_render::textures::{ImageError, ImageInfo, ImageLibrary, SourceImage};

use crate::build::{Body, dome, network, node, prim};
use crate::lab::{Found, Lab, mean};
use crate::shot::{Engine, Way};
use crate::tracer::camera::Eye;

/// Fields of eight texels, 0.25 and 0.75; levels that are smaller than a field are 0.5.
#[derive(Debug)]
struct Fields([u32; 2]);

impl Fields {
    fn texel(level: u32, x: u32, y: u32) -> f32 {
        if level > 3 {
            return 0.5;
        }
        let field = |texel: u32| (texel >> (3 - level)) & 1;
        if field(x) == field(y) { 0.25 } else { 0.75 }
    }
}

impl SourceImage for Fields {
    fn info(&self) -> ImageInfo {
        let count = 32 - self.0[0].max(self.0[1]).leading_zeros();
        let levels = (0..count).map(|level| self.0.map(|side| (side >> level).max(1))).collect();
        ImageInfo {
            levels,
            channels: 1,
            format: TexelFormat::F32,
            tile_friendly: true,
            is_srgb: Some(false),
            wrap: None,
        }
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let columns = usize::try_from(size[0]).unwrap_or(0);
        for (y, row) in (at[1]..).zip(out.chunks_exact_mut(columns * 4)) {
            for (x, texel) in (at[0]..).zip(row.chunks_exact_mut(4)) {
                texel.copy_from_slice(&Self::texel(level, x, y).to_ne_bytes());
            }
        }
        Ok(())
    }
}

/// Half of its texels are 0.5, the others a number that cannot be light.
#[derive(Debug)]
struct Bad(f32);

impl SourceImage for Bad {
    fn info(&self) -> ImageInfo {
        ImageInfo { levels: vec![[8, 8]], ..Fields([8, 8]).info() }
    }

    fn read(&self, _: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let columns = usize::try_from(size[0]).unwrap_or(0);
        for row in out.chunks_exact_mut(columns * 4) {
            for (x, texel) in (at[0]..).zip(row.chunks_exact_mut(4)) {
                texel.copy_from_slice(&if x < 4 { 0.5 } else { self.0 }.to_ne_bytes());
            }
        }
        Ok(())
    }
}

/// `WIDTHxHEIGHT` are fields, anything else is a number that is no light.
#[derive(Debug)]
struct Library;

impl ImageLibrary for Library {
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        let bad = || ImageError("no such picture".into());
        if let Some((width, height)) = asset.resolved.split_once('x') {
            let side = |text: &str| text.parse().map_err(|_no_number| bad());
            return Ok(Arc::new(Fields([side(width)?, side(height)?])));
        }
        Ok(Arc::new(Bad(asset.resolved.parse().map_err(|_no_number| bad())?)))
    }

    fn identity(&self, asset: &AssetRef) -> Result<String, ImageError> {
        Ok(asset.resolved.to_string())
    }
}

/// A matt square of a picture, `repeats` times in each direction from `from` on.
fn textured(db: &mut SceneDb, picture: &str, from: f32, repeats: f32) {
    let st = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|st| st.map(|v: f32| from + repeats * v));
    let values = TypedArray::of(st.to_vec());
    let primvar = Primvar { interpolation: Interpolation::Vertex, values, indices: None };
    let mut mesh = Body::square(0.5).mesh(prim("/board", DMat4::from_rotation_x(FRAC_PI_2)), 1);
    mesh.primvars.push(NamedPrimvar { name: "st".into(), primvar });
    db.upsert_mesh(MeshDesc { material: Some("/material".into()), ..mesh });
    let text = |value: &str| ParamValue::Text(value.into());
    let file = ParamValue::Asset(AssetRef { authored: picture.into(), resolved: picture.into() });
    // An index of 1 leaves nothing but the matt part.
    let surface = node(
        "UsdPreviewSurface",
        &[("ior", ParamValue::Float(1.0)), ("roughness", ParamValue::Float(1.0))],
        &[("diffuseColor", 1, "r")],
    );
    let texture = node(
        "UsdUVTexture",
        &[("file", file), ("wrapS", text("repeat")), ("wrapT", text("repeat"))],
        &[("st", 2, "result")],
    );
    let reader = node("UsdPrimvarReader_float2", &[("varname", text("st"))], &[]);
    db.upsert_material(network("/material", vec![surface, texture, reader]));
    db.upsert_light(dome(1.0));
}

fn engine(streaming_kib: Option<u32>) -> Engine {
    Engine { streaming_kib, images: Some(Arc::new(Library)), ..Engine::default() }
}

fn eye() -> Eye {
    Eye::parallel(DVec3::Z * 5.0, DVec3::ZERO, 2.0, [64, 64])
}

fn way() -> Way {
    Way { samples: 64, bounces: 1, ..Way::default() }
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    // Whole fields are seen, as many of one kind as of the other; what has no value is 0, or a warning's fallback.
    let means = [
        ("one texel", "1x1", 0.0, 4.0, 0.25),
        ("16384 x 1 texels", "16384x1", 0.0, 1.0, 0.5),
        ("1 x 16384 texels", "1x16384", 0.0, 1.0, 0.5),
        ("65536 x 65536 texels", "65536x65536", 0.0, 1.0, 0.5),
        ("1e6 repeats", "256x256", 0.0, 1e6, 0.5),
        ("1024 repeats away", "256x256", 1024.0, 0.5, 0.5),
    ];
    for (name, picture, from, repeats, albedo) in means {
        lab.case(&format!("textures/{name}"), |lab, case| {
            let stage = lab.bench.stage_by(engine(None), |db| textured(db, picture, from, repeats));
            let shot = lab.shoot(case, &stage, &eye().camera(), &way());
            lab.mean(case, "radiance under a white sky, relative", albedo, &shot, 1e-2, None);
        });
    }
    for (name, from) in [("1e30", 1e30), ("infinity", f32::INFINITY), ("NaN", f32::NAN)] {
        lab.case(&format!("textures/coordinates of {name}"), |lab, case| {
            let stage = lab.bench.stage_by(engine(None), |db| textured(db, "256x256", from, 1.0));
            let shot = lab.shoot_warned(case, &stage, &eye().camera(), &way());
            let got = mean(&shot);
            let error = (got - got.clamp(0.0, 0.75)).abs();
            let found =
                Found { quantity: "radiance within what texels allow", reference: 0.5, got, error, bound: 1e-3 };
            lab.row(case, &found, None);
        });
    }
    for (name, texel) in [("NaN", "NaN"), ("minus infinity", "-inf"), ("-1e30", "-1e30")] {
        lab.case(&format!("textures/texels of {name}"), |lab, case| {
            let stage = lab.bench.stage_by(engine(None), |db| textured(db, texel, 0.0, 1.0));
            let shot = lab.shoot_warned(case, &stage, &eye().camera(), &way());
            // The middle of the good half.
            let good: Vec<f64> =
                (0..64).map(|y| f64::from(shot.color.get(y * 64 + 16).map_or(0.0, |c| c[0]))).collect();
            lab.number(case, "radiance of the texels that are numbers", 0.5, good.iter().sum::<f64>() / 64.0, 5e-3);
        });
    }
    lab.case("textures/4096 x 4096 texels that stream", streamed);
}

/// A grazing view asks for tiles of all levels.
fn streamed(lab: &mut Lab<'_>, case: &str) {
    let grazing = Eye::at(DVec3::new(0.0, -1.0, 0.02), DVec3::Y * 0.5, 0.5, [64, 64]);
    let grazing = Eye { planes: [1e-3, 10.0], up: DVec3::Z, ..grazing };
    let shots = [None, Some(64)].map(|streaming_kib| {
        let stage = lab.bench.stage_by(engine(streaming_kib), |db| textured(db, "4096x4096", 0.0, 1.0));
        lab.shoot(case, &stage, &grazing.camera(), &way())
    });
    let [core, streamed] = &shots;
    let differ = core.color.iter().zip(&streamed.color).filter(|(a, b)| a.map(f32::to_bits) != b.map(f32::to_bits));
    #[expect(clippy::cast_precision_loss, reason = "pixels of a small image")]
    lab.count(case, "pixels that differ from those in core", differ.count() as f64, None);
    let seen = core.color.iter().filter(|color| color[0] > 0.2 && color[0] < 0.8).count();
    lab.number(case, "pixels that show fields", 1.0, f64::from(u8::from(seen > 1000)), 0.0);
}
