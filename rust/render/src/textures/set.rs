// SPDX-License-Identifier: Apache-2.0
//! All textures of a snapshot: which images they are, the numbers of their tiles, their records on the device.
//!
//! Tiles are numbered image by image. Textures that read one file the same way share its tiles. A UDIM set is a record whose
//! `first_page` is the number of the first of 100 records, one for each member. Images stay open from snapshot to snapshot.

use super::image::{ImageError, ImageLibrary};
use super::mips::MipStore;
use super::tiles::TextureImage;
use oocpt_core::texture::{TexelFormat, TextureRef, Wrap, is_srgb};
use oocpt_shader_abi as abi;
use oocpt_shader_abi::GpuTexture;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Most tiles: their numbers share 32 bits with those of chunks.
const MOST_TILES: u64 = 1 << 30;

/// A file read one way: path, member of the set (0: no set), through the sRGB curve or not or by the file.
type ImageKey = (Arc<str>, u32, oocpt_core::texture::ColorSpace);

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct TextureSet {
    images: Vec<Arc<TextureImage>>,
    /// Number of the first tile of every image, and of one past the last.
    firsts: Vec<u32>,
    /// First the textures by their number in the snapshot, then members of sets. `decode` is still 0.
    pub(crate) records: Vec<GpuTexture>,
    /// One for each texture that lacks something.
    pub(crate) warnings: Vec<String>,
}

impl TextureSet {
    /// Tiles of all images.
    pub(crate) fn tile_count(&self) -> usize {
        self.firsts.last().map_or(0, |count| *count as usize)
    }

    /// The images with their number of tiles each, in the order of tiles.
    pub(crate) fn images(&self) -> impl Iterator<Item = (&Arc<TextureImage>, u32)> {
        self.images.iter().map(|image| (image, image.layout().tile_count()))
    }

    /// What went wrong while tiles were read and was not yet told.
    pub(crate) fn take_complaints(&self) -> Vec<String> {
        self.images.iter().filter_map(|image| image.take_complaint()).collect()
    }

    /// Whether nothing reads a texture.
    pub(crate) fn is_empty(&self) -> bool {
        self.records.is_empty()
    }
}

/// Images that are open.
#[derive(Debug, Default)]
pub(crate) struct TextureCache {
    open: FxHashMap<ImageKey, Result<Option<Arc<TextureImage>>, ImageError>>,
    store: Arc<MipStore>,
    set: Arc<TextureSet>,
    textures: Vec<TextureRef>,
}

impl TextureCache {
    /// The set of `textures`; the same as last time if they are the same.
    pub(crate) fn sync(&mut self, library: Option<&dyn ImageLibrary>, textures: &[TextureRef]) -> Arc<TextureSet> {
        if self.textures != textures {
            let mut making = Making { cache: self, library, set: TextureSet::default(), numbers: FxHashMap::default() };
            making.set.firsts.push(0);
            making.all(textures);
            let Making { set, numbers, .. } = making;
            self.open.retain(|key, _| numbers.contains_key(key));
            self.set = Arc::new(set);
            self.textures = textures.to_vec();
        }
        Arc::clone(&self.set)
    }
}

struct Making<'a> {
    cache: &'a mut TextureCache,
    library: Option<&'a dyn ImageLibrary>,
    set: TextureSet,
    /// Numbers of the images in the set.
    numbers: FxHashMap<ImageKey, Option<usize>>,
}

impl Making<'_> {
    fn all(&mut self, textures: &[TextureRef]) {
        let mut members = Vec::new();
        for texture in textures {
            if !texture.asset.resolved.contains("<UDIM>") {
                let record = self.record(texture, 0, texture.wrap);
                self.set.records.push(record);
                continue;
            }
            let first = textures.len() + members.len();
            let parts: Vec<GpuTexture> =
                (1001..1001 + abi::UDIM_PARTS).map(|n| self.record(texture, n, [Wrap::Clamp; 2])).collect();
            let exists = parts.iter().any(|part| part.levels > 0);
            if !exists {
                self.set.warnings.push(format!("{}: none of its tiles is there", named(texture)));
            }
            self.set.records.push(GpuTexture {
                flags: abi::TEXTURE_UDIM,
                first_page: u32::try_from(first).unwrap_or(0),
                levels: u32::from(exists),
                fallback: texture.fallback,
                ..GpuTexture::default()
            });
            members.extend(parts);
        }
        self.set.records.extend(members);
    }

    /// The record of a texture or of a member of a set.
    fn record(&mut self, texture: &TextureRef, member: u32, wrap: [Wrap; 2]) -> GpuTexture {
        let missing = GpuTexture { fallback: texture.fallback, ..GpuTexture::default() };
        let Some(at) = self.image(texture, member) else { return missing };
        let (Some(image), Some(&first_page)) = (self.set.images.get(at), self.set.firsts.get(at)) else {
            return missing;
        };
        let metadata = image.info().wrap;
        let mode = |axis: usize| match wrap[axis] {
            Wrap::UseMetadata => metadata.map_or(abi::WRAP_BLACK, |wraps| wrap_mode(wraps[axis])),
            other => wrap_mode(other),
        };
        let format = match image.info().format {
            TexelFormat::U8 => abi::TEXTURE_U8,
            TexelFormat::F16 => abi::TEXTURE_F16,
            TexelFormat::F32 => abi::TEXTURE_F32,
        };
        let srgb = if image.is_srgb() { abi::TEXTURE_SRGB } else { 0 };
        let [width, height] = image.layout().size();
        GpuTexture {
            decode: 0,
            first_page,
            flags: image.channels()
                | format << abi::TEXTURE_FORMAT_SHIFT
                | srgb
                | mode(0) << abi::TEXTURE_WRAP_S_SHIFT
                | mode(1) << abi::TEXTURE_WRAP_T_SHIFT,
            width,
            height,
            levels: image.layout().levels(),
            pad: 0,
            fallback: texture.fallback,
        }
    }

    /// The number of an image in the set; `None` when there is none.
    fn image(&mut self, texture: &TextureRef, member: u32) -> Option<usize> {
        let key = (Arc::clone(&texture.asset.resolved), member, texture.color_space);
        if let Some(number) = self.numbers.get(&key) {
            return *number;
        }
        let opened = match self.cache.open.get(&key) {
            Some(opened) => opened.clone(),
            None => {
                let opened = self.open(texture, member);
                self.cache.open.insert(key.clone(), opened.clone());
                opened
            }
        };
        let opened = opened.unwrap_or_else(|error| {
            self.set.warnings.push(format!("{}: {error}; its fallback is used", named(texture)));
            None
        });
        let number = opened.and_then(|image| self.add(image, texture));
        self.numbers.insert(key, number);
        number
    }

    fn add(&mut self, image: Arc<TextureImage>, texture: &TextureRef) -> Option<usize> {
        let first = self.set.firsts.last().copied().unwrap_or(0);
        let count = image.layout().tile_count();
        if u64::from(first) + u64::from(count) > MOST_TILES {
            self.set.warnings.push(format!("{}: the scene has too many texels", named(texture)));
            return None;
        }
        self.set.firsts.push(first + count);
        self.set.images.push(image);
        Some(self.set.images.len() - 1)
    }

    fn open(&self, texture: &TextureRef, member: u32) -> Result<Option<Arc<TextureImage>>, ImageError> {
        let Some(library) = self.library else { return Err(ImageError("nobody here can open images".into())) };
        if texture.asset.resolved.is_empty() {
            return Err(ImageError("the file was not found".into()));
        }
        let image = match member {
            0 => library.open(&texture.asset)?,
            _ => match library.open_part(&texture.asset, member) {
                Some(part) => part?,
                None => return Ok(None),
            },
        };
        let space = texture.color_space;
        let image = TextureImage::new(
            &named(texture),
            image,
            |info| is_srgb(space, info.is_srgb, info.format, info.channels),
            &self.cache.store,
        )?;
        Ok(Some(Arc::new(image)))
    }
}

/// The prim that asks and the file, for messages.
fn named(texture: &TextureRef) -> Arc<str> {
    format!("{}: texture {}", texture.prim, texture.asset.authored).into()
}

fn wrap_mode(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::UseMetadata | Wrap::Black => abi::WRAP_BLACK,
        Wrap::Clamp => abi::WRAP_CLAMP,
        Wrap::Repeat => abi::WRAP_REPEAT,
        Wrap::Mirror => abi::WRAP_MIRROR,
    }
}
