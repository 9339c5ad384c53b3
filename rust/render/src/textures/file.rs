// SPDX-License-Identifier: Apache-2.0
//! One texture file by itself, without a scene: what it is and what the cache on disk has of it, and filling that
//! beforehand. Any thread, several files at once; the entries are those that renders look for, as long as the same
//! library names the files.

use super::disk::DiskCache;
use super::image::{ImageError, ImageLibrary};
use super::tiles::{ImageStores, TextureImage, WantedImage};
use oocpt_core::material::is_ptex_name;
use oocpt_core::scene::AssetRef;
use oocpt_core::settings::Settings;
use oocpt_core::texture::{ColorSpace, TexelFormat};
use serde::Serialize;
use std::sync::Arc;

/// What a texture file is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FileReport {
    /// Texels of the finest level; of Ptex the texels of all faces and their reductions, in rows.
    pub size: [u32; 2],
    /// Of Ptex: the number of faces.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<u32>,
    /// Levels in the file; 1 where only the entry in the cache was looked at.
    pub levels: usize,
    /// 1 to 4.
    pub channels: u32,
    /// Of a channel: `u8`, `f16` or `f32`.
    pub format: &'static str,
    /// Parts of the file can be read alone.
    pub is_tiled: bool,
    /// Whether colours go through the sRGB curve.
    pub is_srgb: bool,
    /// What decides that, or which conversion is used instead.
    pub why: String,
    /// Whether it is read as it is, without a cache.
    pub is_direct: bool,
    /// What the cache has of it.
    pub cache: CacheEntry,
}

/// What the cache on disk has of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CacheEntry {
    /// What tells the file, read this way, from others; empty where there is no cache.
    pub key: String,
    /// Where it would be; empty where there is no cache.
    pub path: String,
    /// Its bytes; none if it is not there, or damaged.
    pub bytes: Option<u64>,
    /// The finest level in it.
    pub first_level: Option<u32>,
}

/// What to look at, and where decoded textures are kept.
#[derive(Debug)]
pub struct TextureFile<'a> {
    /// Opens the file.
    pub library: &'a Arc<dyn ImageLibrary>,
    /// The file; no set of files.
    pub asset: &'a AssetRef,
    /// How it is read.
    pub color_space: &'a ColorSpace,
    /// Say where the cache is.
    pub settings: &'a Settings,
}

impl TextureFile<'_> {
    /// What the file is.
    ///
    /// # Errors
    /// It cannot be opened, or is none that textures are read from.
    pub fn inspect(&self) -> Result<FileReport, ImageError> {
        let disk = self.disk();
        self.report(disk.as_ref(), &self.open(disk.clone())?)
    }

    /// Puts all levels of the file into the cache, unless they are there, or it is read as it is.
    ///
    /// # Errors
    /// As [`Self::inspect`]; or the file cannot be decoded, there is no cache, or it cannot be written.
    pub fn fill(&self) -> Result<FileReport, ImageError> {
        let disk = self.disk();
        let image = self.open(disk.clone())?;
        if !image.is_direct() {
            let cache =
                disk.as_ref().ok_or_else(|| ImageError("there is no texture cache: it is turned off".into()))?;
            // Who asks for a tile of the finest level gets all levels.
            image.try_finest()?;
            if let Some(complaint) = cache.take_complaint() {
                return Err(ImageError(complaint));
            }
        }
        let report = self.report(disk.as_ref(), &image)?;
        if !report.is_direct && report.cache.first_level != Some(0) {
            return Err(ImageError("the texture cache does not keep it: it is larger than the cache may be".into()));
        }
        Ok(report)
    }

    fn disk(&self) -> Option<Arc<DiskCache>> {
        DiskCache::of_setting(&self.settings.texture_cache, self.settings.texture_cache_mib).map(Arc::new)
    }

    fn wanted<'a>(&'a self, name: &'a Arc<str>) -> WantedImage<'a> {
        let (library, asset) = (self.library, self.asset);
        let is_ptex = is_ptex_name(&asset.resolved);
        WantedImage { name, library, asset, member: 0, file: asset, color_space: self.color_space, is_ptex }
    }

    fn open(&self, disk: Option<Arc<DiskCache>>) -> Result<TextureImage, ImageError> {
        let stores = ImageStores { disk, ..ImageStores::default() };
        let image = TextureImage::open(&self.wanted(&self.asset.authored), &stores)?;
        let image = image.ok_or_else(|| ImageError("cannot be found".into()))?;
        match image.warning() {
            Some(warning) => Err(ImageError(warning.to_owned())),
            None => Ok(image),
        }
    }

    fn report(&self, disk: Option<&Arc<DiskCache>>, image: &TextureImage) -> Result<FileReport, ImageError> {
        let key = self.wanted(&self.asset.authored).key(disk, self.color_space);
        let mut cache = CacheEntry::default();
        if let Some((disk, key)) = key {
            let entry = disk.find(&key);
            cache.bytes = entry.as_ref().map(super::tx::TxFile::bytes);
            cache.first_level = entry.as_ref().map(|entry| entry.description().first_level);
            cache.path = disk.path(&key).display().to_string();
            cache.key = key;
        }
        // An entry does not tell what levels and tiles its source has.
        let source = match image.faces() {
            Some(_) => image.info().clone(),
            None => self.library.open(self.asset)?.info(),
        };
        Ok(FileReport {
            size: image.layout().size(),
            faces: image.faces().map(|faces| faces.faces()),
            levels: source.levels.len(),
            channels: source.channels,
            format: match source.format {
                TexelFormat::U8 => "u8",
                TexelFormat::F16 => "f16",
                TexelFormat::F32 => "f32",
            },
            is_tiled: source.tile_friendly,
            is_srgb: image.is_srgb(),
            why: self.why(source.is_srgb, source.format, source.channels),
            is_direct: image.is_direct(),
            cache,
        })
    }

    fn why(&self, metadata: Option<bool>, format: TexelFormat, channels: u32) -> String {
        match (self.color_space, metadata) {
            (ColorSpace::Raw, _) => "raw was asked for".into(),
            (ColorSpace::Srgb, _) => "sRGB was asked for".into(),
            (ColorSpace::Named(name), _) => format!("converted from {name}, which was asked for"),
            (ColorSpace::Auto, Some(true)) => "the file says sRGB".into(),
            (ColorSpace::Auto, Some(false)) => "the file says linear, or its kind always is".into(),
            (ColorSpace::Auto, None) if format != TexelFormat::U8 => "the file does not say; not 8 bits".into(),
            (ColorSpace::Auto, None) => format!("the file does not say; 8 bits, channels: {channels}"),
        }
    }
}
