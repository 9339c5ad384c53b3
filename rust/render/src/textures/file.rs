// SPDX-License-Identifier: Apache-2.0
//! One texture file by itself, without a scene: its properties and its entry in the cache on disk, and filling the
//! cache beforehand. Any thread, several files at once; the entries are those that renders look for, as long as the
//! same library names the files.

use super::disk::DiskCache;
use super::image::{ImageError, ImageLibrary};
use super::tiles::{ImageStores, TextureImage, WantedImage};
use oocpt_core::material::is_ptex_name;
use oocpt_core::scene::AssetRef;
use oocpt_core::settings::Settings;
use oocpt_core::texture::{ColorSpace, TexelFormat};
use serde::Serialize;
use std::sync::Arc;

/// The properties of a texture file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct FileReport {
    /// Texels of the finest level; for Ptex, the texels of all faces and their reductions, in rows.
    pub size: [u32; 2],
    /// The number of faces of a Ptex file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<u32>,
    /// Levels in the file; 1 if only the entry in the cache was read.
    pub levels: usize,
    /// Number of channels, 1 to 4.
    pub channels: u32,
    /// Format of a channel: `u8`, `f16` or `f32`.
    pub format: &'static str,
    /// True if parts of the file can be read alone.
    pub is_tiled: bool,
    /// True if colours go through the sRGB curve.
    pub is_srgb: bool,
    /// The reason for that, or the conversion that is used instead.
    pub why: String,
    /// True if the file is read without a cache.
    pub is_direct: bool,
    /// The entry in the cache.
    pub cache: CacheEntry,
}

/// The entry of a file in the cache on disk.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CacheEntry {
    /// The identity of the file, read this way; empty if there is no cache.
    pub key: String,
    /// The path of the entry, whether it exists or not; empty if there is no cache.
    pub path: String,
    /// Bytes of the entry; `None` if it does not exist, or is damaged.
    pub bytes: Option<u64>,
    /// The finest level in the entry.
    pub first_level: Option<u32>,
}

/// A file to inspect, and the settings of the cache.
#[derive(Debug)]
pub struct TextureFile<'a> {
    /// Opens the file.
    pub library: &'a Arc<dyn ImageLibrary>,
    /// The file; not a set of files.
    pub asset: &'a AssetRef,
    /// The color space in which it is read.
    pub color_space: &'a ColorSpace,
    /// The settings that name the cache.
    pub settings: &'a Settings,
}

impl TextureFile<'_> {
    /// Returns the properties of the file.
    ///
    /// # Errors
    /// The file cannot be opened, or is not a texture.
    pub fn inspect(&self) -> Result<FileReport, ImageError> {
        let disk = self.disk();
        self.report(disk.as_ref(), &self.open(disk.clone())?)
    }

    /// Puts all levels of the file into the cache, unless they are there, or the file needs no cache.
    ///
    /// # Errors
    /// The errors of [`Self::inspect`]; or the file cannot be decoded, there is no cache, or it cannot be written.
    pub fn fill(&self) -> Result<FileReport, ImageError> {
        let disk = self.disk();
        let image = self.open(disk.clone())?;
        if !image.is_direct() {
            let cache =
                disk.as_ref().ok_or_else(|| ImageError("there is no texture cache: it is turned off".into()))?;
            // A request for a tile of the finest level decodes all levels.
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
        // An entry does not store the levels and tiles of its source.
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
