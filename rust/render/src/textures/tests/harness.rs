// SPDX-License-Identifier: Apache-2.0
//! Procedural images, and a device that looks them up.

use crate::textures::{ImageError, ImageInfo, ImageLibrary, SourceImage, TextureCache, TextureSet};
use bytemuck::Zeroable;
use half::f16;
use oocpt_abi::{Features, FrameConstants, GpuTexture, PushConstants, groups};
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::{ColorSpace, TexelFormat, TextureRef, TileLayout, Wrap, expand, linear_from_srgb};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, OpenOptions, Pipeline};
use oocpt_shaders::checks;
use std::sync::Arc;
use std::time::Duration;

/// Numbers that depend on `i` only, spread over 32 bits.
pub(super) fn hash(i: u32) -> u32 {
    let mut x = i.wrapping_mul(0x9e37_79b9) ^ 0x85eb_ca6b;
    x = (x ^ (x >> 16)).wrapping_mul(0x21f0_aaad);
    x = (x ^ (x >> 15)).wrapping_mul(0x735a_2d97);
    x ^ (x >> 15)
}

pub(super) fn unit(i: u32) -> f32 {
    f32::from(u16::try_from(hash(i) >> 16).expect("16 bits")) / 65536.0
}

/// An image without a file: channel `c` of texel (x, y) of level `l` is byte(l, x, y, c) / 255, in any format.
#[derive(Debug)]
pub(super) struct Procedural {
    pub(super) info: ImageInfo,
    pub(super) byte: fn(u32, u32, u32, u32) -> u8,
}

pub(super) fn noise(level: u32, x: u32, y: u32, channel: u32) -> u8 {
    (hash(x ^ hash(y ^ hash(channel + 4 * level))) >> 24) as u8
}

pub(super) fn encoded(byte: u8, format: TexelFormat) -> Vec<u8> {
    let value = f32::from(byte) / 255.0;
    match format {
        TexelFormat::U8 => vec![byte],
        TexelFormat::F16 => f16::from_f32(value).to_ne_bytes().to_vec(),
        TexelFormat::F32 => value.to_ne_bytes().to_vec(),
    }
}

impl SourceImage for Procedural {
    fn info(&self) -> ImageInfo {
        self.info.clone()
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let mut texels = Vec::with_capacity(out.len());
        for y in at[1]..at[1] + size[1] {
            for x in at[0]..at[0] + size[0] {
                for channel in 0..self.info.channels {
                    texels.extend(encoded((self.byte)(level, x, y, channel), self.info.format));
                }
            }
        }
        out.copy_from_slice(&texels);
        Ok(())
    }
}

/// Images by number: "3" is the fourth; "5<UDIM>" has the members of 1001, 1002 and 1012.
#[derive(Debug)]
struct Library(Vec<Arc<Procedural>>);

impl ImageLibrary for Library {
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        let missing = || ImageError("no such image".into());
        let name = asset.resolved.trim_end_matches("_1001").trim_end_matches("_1002").trim_end_matches("_1012");
        let number: usize = name.parse().map_err(|_not_a_number| missing())?;
        let image: Arc<dyn SourceImage> = Arc::clone(self.0.get(number).ok_or_else(missing)?) as Arc<dyn SourceImage>;
        Ok(image)
    }
}

pub(super) fn image(size: [u32; 2], channels: u32, format: TexelFormat) -> Arc<Procedural> {
    let info = ImageInfo { levels: vec![size], channels, format, tile_friendly: true, is_srgb: None, wrap: None };
    Arc::new(Procedural { info, byte: noise })
}

pub(super) fn texture(name: &str, wrap: [Wrap; 2], color_space: ColorSpace) -> TextureRef {
    let asset = AssetRef { authored: name.into(), resolved: name.into() };
    TextureRef {
        prim: "/Material/Texture".into(),
        asset,
        wrap,
        color_space,
        fallback: [0.25, 0.5, 0.75, 1.0],
        has_border: false,
        is_ptex: false,
    }
}

/// A set on the device.
pub(super) struct Bench {
    gpu: Arc<Gpu>,
    pipeline: Pipeline,
    pub(super) set: Arc<TextureSet>,
    /// By tile of the scene.
    tiles: Vec<Vec<u8>>,
    pub(super) addresses: Vec<u64>,
    records: Buffer,
    pub(super) pages: Buffer,
    frame: Buffer,
    _kept: Vec<Buffer>,
}

#[derive(Clone, Copy)]
pub(super) struct Query {
    pub(super) texture: u32,
    pub(super) st: [f32; 2],
    pub(super) width: f32,
}

/// Value, what the lookup said, texels it is done with.
pub(super) type Answer = ([f32; 4], u32, u32);

/// The device that tests run on.
pub(super) fn open() -> Arc<Gpu> {
    let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
    Gpu::open(&OpenOptions { selector, validation: true, ..OpenOptions::default() }).expect("a device")
}

impl Bench {
    pub(super) fn new(images: Vec<Arc<Procedural>>, textures: &[TextureRef]) -> Self {
        Self::with(Arc::new(Library(images)), textures, Features::empty())
    }

    /// With a library, and with more than plain textures.
    pub(super) fn with(library: Arc<dyn ImageLibrary>, textures: &[TextureRef], more: Features) -> Self {
        let gpu = open();
        let set = TextureCache::default().sync(Some(&library), textures);
        let tiles: Vec<Vec<u8>> =
            set.images().flat_map(|(image, count)| (0..count).map(|tile| image.tile(tile))).collect();
        let upload = |name: &str, bytes: &[u8]| {
            let buffer = Buffer::new(&gpu, name, (bytes.len() as u64).max(16), BufferUsage::Upload).expect("memory");
            buffer.write(0, bytes).expect("mapped");
            buffer
        };
        let mut all: Vec<u8> = Vec::new();
        let mut offsets = Vec::new();
        for tile in &tiles {
            offsets.push(all.len() as u64);
            all.extend(tile);
            all.resize(all.len().next_multiple_of(16), 0);
        }
        let texels = upload("tiles", &all);
        let decode: Vec<f32> = (0..=255_u8).map(|byte| linear_from_srgb(f64::from(byte) / 255.0) as f32).collect();
        let decode = upload("decode", bytemuck::cast_slice(&decode));
        let mut records = set.records.clone();
        for record in &mut records {
            record.decode = decode.address();
        }
        let mut kept = vec![texels, decode];
        for (record, faces) in &set.directories {
            let directory = upload("directory", bytemuck::cast_slice(&faces.directory()));
            records[*record].directory = directory.address();
            kept.push(directory);
        }
        let records = upload("records", bytemuck::cast_slice::<GpuTexture, u8>(&records));
        let addresses: Vec<u64> = offsets.iter().map(|offset| kept[0].address() + offset).collect();
        let pages = upload("pages", bytemuck::cast_slice(&addresses));
        let frame = upload("frame", bytemuck::bytes_of(&FrameConstants::zeroed()));
        let spec = (Features::MATERIALS | Features::TEXTURES | more).constants();
        let module = &checks::CHECK_TEXTURE;
        let pipeline =
            Pipeline::new(&gpu, module.name, &module.specialised(&spec), &spec, 32).expect("the pass compiles");
        Self { gpu, pipeline, set, tiles, addresses, records, pages, frame, _kept: kept }
    }

    pub(super) fn ask(&self, queries: &[Query]) -> Vec<Answer> {
        let none = vec![([0.0; 4], 0, 0); queries.len()];
        self.go_on(queries, &none)
    }

    pub(super) fn go_on(&self, queries: &[Query], before: &[Answer]) -> Vec<Answer> {
        let asked: Vec<[u32; 8]> = queries
            .iter()
            .zip(before)
            .map(|(q, b)| [q.texture, b.2, q.st[0].to_bits(), q.st[1].to_bits(), q.width.to_bits(), 0, 0, 0])
            .collect();
        let kept: Vec<[f32; 8]> = before.iter().map(|b| [b.0[0], b.0[1], b.0[2], b.0[3], 0.0, 0.0, 0.0, 0.0]).collect();
        let bytes = 32 * queries.len() as u64;
        let input = Buffer::new(&self.gpu, "queries", bytes, BufferUsage::Upload).expect("memory");
        input.write(0, bytemuck::cast_slice(&asked)).expect("mapped");
        let start = Buffer::new(&self.gpu, "values", bytes, BufferUsage::Upload).expect("memory");
        start.write(0, bytemuck::cast_slice(&kept)).expect("mapped");
        let output = Buffer::new(&self.gpu, "answers", bytes, BufferUsage::Readback).expect("memory");
        let frame = FrameConstants {
            rays: input.address(),
            radiance: start.address(),
            textures: self.records.address(),
            texture_pages: self.pages.address(),
            ..FrameConstants::zeroed()
        };
        self.frame.write(0, bytemuck::bytes_of(&frame)).expect("mapped");
        let count = u32::try_from(queries.len()).expect("few");
        let push = PushConstants::wave(self.frame.address(), 0, count, 1);
        let mut commands = self.gpu.commands("lookups").expect("a list");
        commands.dispatch(&self.pipeline, bytemuck::bytes_of(&push), groups(u64::from(count)));
        commands.copy(&start, 0, &output, 0, bytes);
        assert!(commands.submit().expect("submitted").wait(Duration::from_secs(60)).expect("alive"), "it ends");
        let messages = self.gpu.take_validation_messages();
        assert!(messages.is_empty(), "Vulkan validation: {messages:?}");
        let words: Vec<[u32; 8]> = output.map(|bytes| bytemuck::pod_collect_to_vec(bytes)).expect("mapped");
        words.iter().map(|w| ([0, 1, 2, 3].map(|i: usize| f32::from_bits(w[i])), w[4], w[5])).collect()
    }

    /// The bytes of all tiles of image `number`.
    pub(super) fn bytes(&self, number: usize) -> Vec<u8> {
        let first: u32 = self.set.images().take(number).map(|(_, count)| count).sum();
        let count = self.set.images().nth(number).expect("there").1;
        self.tiles[first as usize..(first + count) as usize].concat()
    }

    /// The texels of image `number`, decoded from its tiles, level by level.
    pub(super) fn texels(&self, number: usize, is_srgb: bool) -> (TileLayout, Vec<Vec<[f64; 4]>>) {
        let first: u32 = self.set.images().take(number).map(|(_, count)| count).sum();
        let (image, count) = self.set.images().nth(number).expect("there");
        let (layout, channels, format) = (*image.layout(), image.channels() as usize, image.info().format);
        let mut levels: Vec<Vec<[f64; 4]>> = (0..layout.levels())
            .map(|level| vec![[f64::NAN; 4]; layout.level_size(level).iter().product::<u32>() as usize])
            .collect();
        for tile in 0..count {
            let bytes = &self.tiles[(first + tile) as usize];
            for piece in layout.pieces(tile) {
                for i in 0..piece.size[0] * piece.size[1] {
                    let at = piece.offset as usize + (i * layout.texel_bytes()) as usize;
                    let texel = &bytes[at..at + layout.texel_bytes() as usize];
                    let values: Vec<f64> = texel.chunks(format.bytes() as usize).map(number_of).collect();
                    let color = |c: usize| is_srgb && (c == 0 || (c < 3 && channels == 4));
                    let curve = |(c, v): (usize, &f64)| if color(c) { linear_from_srgb(*v) } else { *v };
                    let values: Vec<f64> = values.iter().enumerate().map(curve).collect();
                    let (x, y) = (piece.at[0] + i % piece.size[0], piece.at[1] + i / piece.size[0]);
                    let row = layout.level_size(piece.level)[0];
                    levels[piece.level as usize][(y * row + x) as usize] = expand(&values);
                }
            }
        }
        (layout, levels)
    }
}

pub(super) fn number_of(bytes: &[u8]) -> f64 {
    match *bytes {
        [byte] => f64::from(byte) / 255.0,
        [a, b] => f16::from_ne_bytes([a, b]).to_f64(),
        [a, b, c, d] => f64::from(f32::from_ne_bytes([a, b, c, d])),
        _ => f64::NAN,
    }
}
