// SPDX-License-Identifier: Apache-2.0
//! All textures of a snapshot: their images, the numbers of their tiles, their records on the device.
//!
//! Tiles are numbered image by image. Textures that read one file the same way share its tiles. A UDIM set is a record
//! whose `first_page` is the number of the first of 100 records, one for each member. Images stay open from snapshot to
//! snapshot.

use super::disk::DiskCache;
use super::image::ImageLibrary;
use super::mask_key::MadeMasks;
use super::open::{OpenedMember, named, open};
use super::tiles::{ImageStores, TextureImage};
use crate::host_memory;
use oocpt_abi as abi;
use oocpt_abi::GpuTexture;
use oocpt_core::settings::Settings;
use oocpt_core::texture::{FaceLayout, TexelFormat, TextureRef, Wrap};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;

/// Most tiles: their numbers share 32 bits with those of chunks.
const MAX_TILES: u64 = 1 << 30;

/// Identity of a file read one way: path, member of the set (0: no set), color space, Ptex or not.
type ImageKey = (Arc<str>, u32, oocpt_core::texture::ColorSpace, bool);

/// The images, tiles and records of all textures.
#[derive(Debug, Default)]
pub(crate) struct TextureSet {
    images: Vec<Arc<TextureImage>>,
    /// Number of the first tile of every image, and of one past the last.
    firsts: Vec<u32>,
    /// Number of the first tile of an image, by the image's own number.
    by_id: FxHashMap<u64, u32>,
    /// First the textures by their number in the snapshot, then members of sets. `decode` and `directory` are still 0.
    pub(crate) records: Vec<GpuTexture>,
    /// Numbers and layouts of the records of Ptex textures.
    pub(crate) directories: Vec<(usize, Arc<FaceLayout>)>,
    /// Warnings, one for each texture that cannot be shown as the scene asks.
    pub(crate) warnings: Vec<String>,
    disk: Option<Arc<DiskCache>>,
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

    /// The image of a tile of the scene, and the number of the tile in it.
    pub(crate) fn locate(&self, tile: u32) -> Option<(&Arc<TextureImage>, u32)> {
        let at = self.firsts.partition_point(|first| *first <= tile).checked_sub(1)?;
        let within = tile - self.firsts.get(at)?;
        self.images.get(at).map(|image| (image, within))
    }

    /// The number among all tiles of the scene of a tile of an image; `None` for an image of another scene.
    pub(crate) fn number_of(&self, image: u64, tile: u32) -> Option<u32> {
        self.by_id.get(&image).map(|first| first + tile)
    }

    /// Returns true if the image belongs to the set.
    pub(crate) fn has(&self, image: u64) -> bool {
        self.by_id.contains_key(&image)
    }

    /// The errors of reading tiles that were not reported yet.
    pub(crate) fn take_complaints(&self) -> Vec<String> {
        let of_cache = self.disk.iter().filter_map(|disk| disk.take_complaint());
        of_cache.chain(self.images.iter().filter_map(|image| image.take_complaint())).collect()
    }

    /// Returns true if nothing reads a texture.
    pub(crate) fn is_empty(&self) -> bool {
        self.records.is_empty()
    }
}

/// Images that are open.
#[derive(Debug, Default)]
pub(crate) struct TextureCache {
    open: FxHashMap<ImageKey, OpenedMember>,
    stores: ImageStores,
    /// The settings that `stores` is made from.
    folder: Option<(String, u32)>,
    set: Arc<TextureSet>,
    textures: Vec<TextureRef>,
    /// The masks of the materials of the last snapshot.
    pub(super) masks: MadeMasks,
}

impl TextureCache {
    /// Sets where decoded images are kept from now on.
    pub(crate) fn keep_in(&mut self, settings: &Settings) {
        self.stores.memory.limit(host_memory::images(settings));
        let folder = (settings.texture_cache.clone(), settings.texture_cache_mib);
        if self.folder.as_ref() != Some(&folder) {
            self.stores.disk = DiskCache::of_setting(&folder.0, folder.1).map(Arc::new);
            self.folder = Some(folder);
        }
    }

    /// The set of `textures`; the previous set if they are the same.
    pub(crate) fn sync(&mut self, library: Option<&Arc<dyn ImageLibrary>>, textures: &[TextureRef]) -> Arc<TextureSet> {
        if self.textures != textures {
            self.open_all(library, textures);
            let disk = self.stores.disk.clone();
            let set = TextureSet { firsts: vec![0], disk, ..TextureSet::default() };
            let mut making = SetBuilder { open: &self.open, set, numbers: FxHashMap::default() };
            making.all(textures);
            let SetBuilder { set, numbers, .. } = making;
            self.open.retain(|key, _| numbers.contains_key(key));
            self.set = Arc::new(set);
            self.textures = textures.to_vec();
        }
        Arc::clone(&self.set)
    }

    /// The image that a texture reads, or for a set of files its member (else 0), if it is open.
    pub(crate) fn image(&self, texture: &TextureRef, member: u32) -> Option<Arc<TextureImage>> {
        self.open.get(&image_key(texture, member)).cloned()?.ok()?
    }

    /// Opens the images that are not open, on all cores.
    fn open_all(&mut self, library: Option<&Arc<dyn ImageLibrary>>, textures: &[TextureRef]) {
        let mut requested: FxHashSet<ImageKey> = FxHashSet::default();
        let missing: Vec<(ImageKey, &TextureRef)> = textures
            .iter()
            .flat_map(|texture| members(texture).map(move |member| (image_key(texture, member), texture)))
            .filter(|(key, _)| !self.open.contains_key(key) && requested.insert(key.clone()))
            .collect();
        let stores = &self.stores;
        let opened: Vec<(ImageKey, OpenedMember)> = missing
            .into_par_iter()
            .map(|(key, texture)| {
                let image = open(library, texture, key.1, stores);
                (key, image)
            })
            .collect();
        self.open.extend(opened);
    }
}

/// The members of a set of files; 0 for a single file.
fn members(texture: &TextureRef) -> std::ops::Range<u32> {
    if texture.is_udim() { 1001..1001 + abi::UDIM_PARTS } else { 0..1 }
}

fn image_key(texture: &TextureRef, member: u32) -> ImageKey {
    (Arc::clone(&texture.asset.resolved), member, texture.color_space.clone(), texture.is_ptex)
}

struct SetBuilder<'a> {
    open: &'a FxHashMap<ImageKey, OpenedMember>,
    set: TextureSet,
    /// Numbers of the images in the set.
    numbers: FxHashMap<ImageKey, Option<usize>>,
}

impl SetBuilder<'_> {
    fn all(&mut self, textures: &[TextureRef]) {
        let mut members = Vec::new();
        for texture in textures {
            if !texture.is_udim() {
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
                flags: abi::TEXTURE_UDIM | border(texture),
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
        let missing = GpuTexture { fallback: texture.fallback, flags: border(texture), ..GpuTexture::default() };
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
        if let Some(faces) = image.faces() {
            let flags = image.channels() | format << abi::TEXTURE_FORMAT_SHIFT | srgb | abi::TEXTURE_PTEX;
            let (width, height) = (faces.faces(), faces.classes());
            let directories = &mut self.set.directories;
            directories.push((self.set.records.len(), Arc::clone(faces)));
            return GpuTexture { first_page, flags, width, height, levels: 1, ..missing };
        }
        let [width, height] = image.layout().size();
        GpuTexture {
            decode: 0,
            directory: 0,
            first_page,
            flags: image.channels()
                | format << abi::TEXTURE_FORMAT_SHIFT
                | srgb
                | border(texture)
                | mode(0) << abi::TEXTURE_WRAP_S_SHIFT
                | mode(1) << abi::TEXTURE_WRAP_T_SHIFT,
            width,
            height,
            levels: image.layout().levels(),
            pad: 0,
            fallback: texture.fallback,
        }
    }

    /// The number of an image in the set; `None` if it cannot be opened.
    fn image(&mut self, texture: &TextureRef, member: u32) -> Option<usize> {
        let key = image_key(texture, member);
        if let Some(number) = self.numbers.get(&key) {
            return *number;
        }
        let opened = self.open.get(&key).cloned().unwrap_or(Ok(None)).unwrap_or_else(|error| {
            self.set.warnings.push(format!("{}: {error}; its fallback is used", named(texture)));
            None
        });
        if let Some(warning) = opened.as_ref().and_then(|image| image.warning()) {
            self.set.warnings.push(format!("{}: {warning}", named(texture)));
        }
        let number = opened.and_then(|image| self.add(image, texture));
        self.numbers.insert(key, number);
        number
    }

    fn add(&mut self, image: Arc<TextureImage>, texture: &TextureRef) -> Option<usize> {
        let first = self.set.firsts.last().copied().unwrap_or(0);
        let count = image.layout().tile_count();
        if u64::from(first) + u64::from(count) > MAX_TILES {
            self.set.warnings.push(format!("{}: the scene has too many texels", named(texture)));
            return None;
        }
        self.set.firsts.push(first + count);
        self.set.by_id.insert(image.id(), first);
        self.set.images.push(image);
        Some(self.set.images.len() - 1)
    }
}

/// The prim that asks and the file, for messages.
fn border(texture: &TextureRef) -> u32 {
    if texture.has_border { abi::TEXTURE_BORDER } else { 0 }
}

fn wrap_mode(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::UseMetadata | Wrap::Black => abi::WRAP_BLACK,
        Wrap::Clamp => abi::WRAP_CLAMP,
        Wrap::Repeat => abi::WRAP_REPEAT,
        Wrap::Mirror => abi::WRAP_MIRROR,
    }
}
