// SPDX-License-Identifier: Apache-2.0
//! One image as tiles: the bytes of each, as the device will have them. Any thread; called by the loader's.

use super::image::{Image, ImageError, ImageInfo};
use super::mips::{Made, MipStore, Slot};
use crate::sync::lock;
use half::f16;
use oocpt_core::texture::{Layout, Piece, TexelFormat, linear_from_srgb};
use rustc_hash::FxHashSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// How texels are stored: in the file, on the device, and what they mean.
#[derive(Debug)]
pub(super) struct Texels {
    /// In the file, 1 to 4.
    from: u32,
    format: TexelFormat,
    is_srgb: bool,
    /// What a byte of a colour channel stands for.
    decoded: [f32; 256],
    /// Where one byte ends and the next begins.
    between: [f32; 255],
}

#[expect(clippy::cast_possible_truncation, reason = "tables of values between 0 and 1")]
impl Texels {
    fn new(info: &ImageInfo, is_srgb: bool) -> Self {
        let value = |byte: f64| if is_srgb { linear_from_srgb(byte / 255.0) } else { byte / 255.0 };
        let mut texels =
            Self { from: info.channels, format: info.format, is_srgb, decoded: [0.0; 256], between: [0.0; 255] };
        for (byte, out) in (0_u8..=255).zip(&mut texels.decoded) {
            *out = value(f64::from(byte)) as f32;
        }
        for (byte, out) in (0_u8..=254).zip(&mut texels.between) {
            *out = value(f64::from(byte) + 0.5) as f32;
        }
        texels
    }

    /// Channels on the device: 1, 2 or 4.
    pub(super) fn channels(&self) -> usize {
        if self.from == 3 { 4 } else { self.from as usize }
    }

    /// Bytes of a texel in the file.
    pub(super) fn file_bytes(&self) -> usize {
        (self.from * self.format.bytes()) as usize
    }

    /// Bytes of a texel on the device.
    fn bytes(&self) -> usize {
        self.channels() * self.format.bytes() as usize
    }

    /// Whether a channel of the device's goes through the curve.
    fn is_color(&self, channel: usize) -> bool {
        self.is_srgb && (channel == 0 || (channel < 3 && self.channels() == 4))
    }

    /// Texels of the file, decoded, with the channels of the device's.
    pub(super) fn decode(&self, row: &[u8], out: &mut [f32]) {
        for (texel, out) in row.chunks_exact(self.file_bytes()).zip(out.chunks_exact_mut(self.channels())) {
            let values = texel.chunks_exact(self.format.bytes() as usize);
            out.fill(1.0);
            for (channel, (bytes, out)) in values.zip(out).enumerate() {
                *out = self.value(bytes, channel);
            }
        }
    }

    fn value(&self, bytes: &[u8], channel: usize) -> f32 {
        let curve = |v: f32| if self.is_color(channel) { linear_from_srgb(f64::from(v)) as f32 } else { v };
        let value = match *bytes {
            [byte] if self.is_color(channel) => return self.decoded[usize::from(byte)],
            [byte] => return f32::from(byte) / 255.0,
            [a, b] => f16::from_ne_bytes([a, b]).to_f32(),
            [a, b, c, d] => f32::from_ne_bytes([a, b, c, d]),
            _ => 0.0,
        };
        curve(value)
    }

    /// Decoded texels, as the device has them, at the end of `out`.
    pub(super) fn encode(&self, row: &[f32], out: &mut Vec<u8>) {
        for texel in row.chunks_exact(self.channels()) {
            for (channel, &value) in texel.iter().enumerate() {
                let color = self.is_color(channel);
                let curved =
                    || if color { oocpt_core::texture::srgb_from_linear(f64::from(value)) as f32 } else { value };
                match self.format {
                    // 0 to 255.
                    TexelFormat::U8 if color => out.push(self.between.partition_point(|edge| *edge <= value) as u8),
                    #[expect(clippy::cast_sign_loss, reason = "clamped")]
                    TexelFormat::U8 => out.push((value * 255.0 + 0.5).clamp(0.0, 255.0) as u8),
                    TexelFormat::F16 => out.extend(f16::from_f32(curved()).to_ne_bytes()),
                    TexelFormat::F32 => out.extend(curved().to_ne_bytes()),
                }
            }
        }
    }

    /// Texels of the file with the channels of the device's, not decoded.
    fn widen(&self, row: &[u8], out: &mut [u8]) {
        let one: &[u8] = match self.format {
            TexelFormat::U8 => &[255],
            TexelFormat::F16 => &f16::ONE.to_ne_bytes(),
            TexelFormat::F32 => &1.0_f32.to_ne_bytes(),
        };
        for (from, to) in row.chunks_exact(self.file_bytes()).zip(out.chunks_exact_mut(self.bytes())) {
            to[..from.len()].copy_from_slice(from);
            if to.len() > from.len() {
                to[from.len()..].copy_from_slice(one);
            }
        }
    }
}

/// An image that textures use, read one way (sRGB or not).
#[derive(Debug)]
pub(crate) struct TextureImage {
    /// Different for every image that was ever opened.
    id: u64,
    name: Arc<str>,
    image: Arc<dyn Image>,
    info: ImageInfo,
    layout: Layout,
    texels: Texels,
    /// Levels of the file that are used.
    file_levels: u32,
    made: Slot,
    store: Arc<MipStore>,
    complaint: Mutex<Option<String>>,
    /// Tiles that could not be read. Always the same ones, as long as the file is.
    broken: Mutex<FxHashSet<u32>>,
}

impl TextureImage {
    /// Takes an open image.
    pub(crate) fn new(
        name: &Arc<str>,
        image: Arc<dyn Image>,
        is_srgb: impl FnOnce(&ImageInfo) -> bool,
        store: &Arc<MipStore>,
    ) -> Result<Self, ImageError> {
        static NEXT: AtomicU64 = AtomicU64::new(0);
        let info = image.info();
        let Some(&size) = info.levels.first() else { return Err(ImageError("it has no texels".into())) };
        if !(1..=4).contains(&info.channels) {
            return Err(ImageError(format!("{} channels are not supported (1 to 4)", info.channels)));
        }
        let texels = Texels::new(&info, is_srgb(&info));
        let bytes = u32::try_from(texels.bytes()).unwrap_or(0);
        let layout = Layout::new(size, bytes).map_err(|error| ImageError(error.to_string()))?;
        let fits = |(level, size): &(u32, &[u32; 2])| *level < layout.levels() && layout.level_size(*level) == **size;
        let file_levels = (0..).zip(&info.levels).take_while(fits).map(|(level, _)| level + 1).last().unwrap_or(1);
        Ok(Self {
            id: NEXT.fetch_add(1, Ordering::Relaxed),
            name: Arc::clone(name),
            image,
            layout,
            texels,
            file_levels,
            info,
            made: Slot::default(),
            store: Arc::clone(store),
            complaint: Mutex::default(),
            broken: Mutex::default(),
        })
    }

    /// Its number.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// How it is cut.
    pub(crate) fn layout(&self) -> &Layout {
        &self.layout
    }

    /// What the file says.
    pub(crate) fn info(&self) -> &ImageInfo {
        &self.info
    }

    /// Channels on the device.
    pub(crate) fn channels(&self) -> u32 {
        if self.info.channels == 3 { 4 } else { self.info.channels }
    }

    /// Whether colours go through the sRGB curve.
    pub(crate) fn is_srgb(&self) -> bool {
        self.texels.is_srgb
    }

    /// What went wrong while tiles were read, once.
    pub(crate) fn take_complaint(&self) -> Option<String> {
        lock(&self.complaint).take()
    }

    /// Whether a tile could not be read, all of it, when it was last asked for.
    pub(crate) fn is_broken(&self, tile: u32) -> bool {
        lock(&self.broken).contains(&tile)
    }

    /// The bytes of a tile. What cannot be read is zero, with one complaint, and the tile is broken.
    pub(crate) fn tile(&self, tile: u32) -> Vec<u8> {
        let length = usize::try_from(self.layout.tile_bytes(tile)).unwrap_or(0);
        let mut out = vec![0; length];
        for piece in self.layout.pieces(tile) {
            let begin = usize::try_from(piece.offset).unwrap_or(0);
            let bytes = piece.size[0] as usize * piece.size[1] as usize * self.texels.bytes();
            let Some(out) = out.get_mut(begin..begin + bytes) else { continue };
            if let Err(error) = self.piece(&piece, out) {
                out.fill(0);
                let text = format!("{}: {error}; its fallback is used where it cannot be read", self.name);
                tracing::debug!("{text}");
                lock(&self.broken).insert(tile);
                lock(&self.complaint).get_or_insert(text);
            }
        }
        out
    }

    fn piece(&self, piece: &Piece, out: &mut [u8]) -> Result<(), ImageError> {
        if piece.level >= self.file_levels {
            let made = self.made_levels()?;
            self.cut(&made, piece, out);
            return Ok(());
        }
        if self.texels.file_bytes() == self.texels.bytes() {
            return self.image.read(piece.level, piece.at, piece.size, out);
        }
        let mut raw = vec![0; piece.size[0] as usize * piece.size[1] as usize * self.texels.file_bytes()];
        self.image.read(piece.level, piece.at, piece.size, &mut raw)?;
        self.texels.widen(&raw, out);
        Ok(())
    }

    fn made_levels(&self) -> Result<Arc<Made>, ImageError> {
        self.store.levels(&self.made, &*self.image, &self.texels, &self.layout, self.file_levels)
    }

    fn cut(&self, made: &Made, piece: &Piece, out: &mut [u8]) {
        let bytes = self.texels.bytes();
        let stride = self.layout.level_size(piece.level)[0] as usize * bytes;
        let rows = made.level(piece.level).chunks_exact(stride).skip(piece.at[1] as usize);
        let (begin, length) = (piece.at[0] as usize * bytes, piece.size[0] as usize * bytes);
        for (row, out) in rows.zip(out.chunks_exact_mut(length)) {
            out.copy_from_slice(&row[begin..begin + length]);
        }
    }
}
