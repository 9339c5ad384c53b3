// SPDX-License-Identifier: Apache-2.0
//! One image as tiles: the bytes of each, as the device will have them. Any thread; called by the loader's.

use super::PAUSES;
use super::disk::DiskCache;
use super::image::{ImageError, ImageInfo, ImageLibrary, SourceImage};
use super::memory::MemoryStore;
use super::prepared::{ImageOrigin, PreparedImage, PreparedParts, TexelSource};
use super::ptex::PtexSource;
use super::texels::StoredTexels;
use crate::sync::lock;
use oocpt_abi::TILE_SIDE;
use oocpt_core::again::again;
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::{ColorSpace, FaceLayout, TexelFormat, TileLayout, TilePiece, is_srgb};
use rustc_hash::FxHashSet;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

/// Where texels come from.
#[derive(Debug)]
enum PixelSource {
    /// A tiled file that has all levels: read as it is.
    File(Arc<dyn SourceImage>),
    /// Any other.
    Prepared(Arc<PreparedImage>),
}

/// Where images are kept.
#[derive(Clone, Debug, Default)]
pub(crate) struct ImageStores {
    pub(super) disk: Option<Arc<DiskCache>>,
    pub(super) memory: Arc<MemoryStore>,
}

/// An image that textures use, read one way (sRGB or not).
#[derive(Debug)]
pub(crate) struct TextureImage {
    /// Different for every image that was ever opened.
    id: u64,
    name: Arc<str>,
    pixels: PixelSource,
    info: ImageInfo,
    layout: TileLayout,
    /// Of Ptex: where the texels of faces are.
    faces: Option<Arc<FaceLayout>>,
    texels: Arc<StoredTexels>,
    /// What is not as the scene asks.
    warning: Option<String>,
    complaint: Mutex<Option<String>>,
    /// Tiles that could not be read. Always the same ones, as long as the file is.
    broken: Mutex<FxHashSet<u32>>,
}

/// Which image to open.
#[derive(Debug)]
pub(super) struct WantedImage<'a> {
    /// For messages.
    pub(super) name: &'a Arc<str>,
    pub(super) library: &'a Arc<dyn ImageLibrary>,
    pub(super) asset: &'a AssetRef,
    /// A member of a set of files, or 0.
    pub(super) member: u32,
    /// The file itself: the asset, or the member.
    pub(super) file: &'a AssetRef,
    pub(super) color_space: &'a ColorSpace,
    /// The file is Ptex.
    pub(super) is_ptex: bool,
}

impl WantedImage<'_> {
    /// The key in the cache on disk of the file, read as of a colour space; none where nothing tells the file from
    /// others.
    pub(super) fn key(&self, disk: Option<&Arc<DiskCache>>, space: &ColorSpace) -> Option<(Arc<DiskCache>, String)> {
        // First: without a cache no file need be hashed.
        let disk = disk?;
        let identity = self.library.identity(self.file).ok()?;
        let config = match space {
            ColorSpace::Named(_) => format!(" of {}", self.library.color_config()),
            _ => String::new(),
        };
        let by_face = if self.is_ptex { " by face" } else { "" };
        Some((Arc::clone(disk), format!("{identity} as {space:?}{config}{by_face}")))
    }
}

impl TextureImage {
    /// Opens an image; `None` for a member of a set that does not exist. What is in the cache on disk is not decoded.
    pub(super) fn open(wanted: &WantedImage<'_>, stores: &ImageStores) -> Result<Option<Self>, ImageError> {
        if wanted.is_ptex {
            return Self::open_ptex(wanted, stores).map(Some);
        }
        let origin = ImageOrigin::new(wanted.library, wanted.asset, wanted.member);
        let mut space = wanted.color_space.clone();
        let mut warning = None;
        let mut key = wanted.key(stores.disk.as_ref(), &space);
        let mut entry = key.as_ref().and_then(|(disk, key)| disk.find(key));
        // An entry would not be there if its colour space were not known.
        if let (None, ColorSpace::Named(name)) = (&entry, &space)
            && let Err(error) = wanted.library.color_transform(name)
        {
            warning = Some(format!("{error}; the file's own colour space is taken"));
            space = ColorSpace::Auto;
            key = wanted.key(stores.disk.as_ref(), &space);
            entry = key.as_ref().and_then(|(disk, key)| disk.find(key));
        }
        let (info, image) = match &entry {
            Some(entry) => (entry.description().info(), None),
            None => match origin.open()? {
                Some(image) => (stored_as(image.info(), &space), Some(image)),
                None => return Ok(None),
            },
        };
        let Some(&size) = info.levels.first() else { return Err(ImageError("it has no texels".into())) };
        if !(1..=4).contains(&info.channels) {
            return Err(ImageError(format!("{} channels are not supported (1 to 4)", info.channels)));
        }
        let is_srgb = is_srgb(&space, info.is_srgb, info.format, info.channels);
        let texels = Arc::new(StoredTexels::new(&info, is_srgb));
        let bytes = u32::try_from(texels.device_bytes()).unwrap_or(0);
        let layout = TileLayout::new(size, bytes).map_err(|error| ImageError(error.to_string()))?;
        let has_all = (0..layout.levels()).all(|l| info.levels.get(l as usize) == Some(&layout.level_size(l)));
        let transform = name_of(space);
        let pixels = match image {
            Some(image) if info.tile_friendly && has_all && transform.is_none() => PixelSource::File(image),
            _ => PixelSource::Prepared(PreparedImage::new(PreparedParts {
                source: TexelSource::Image(origin),
                info: info.clone(),
                transform,
                layout,
                texels: Arc::clone(&texels),
                disk: key,
                memory: Arc::clone(&stores.memory),
                entry,
            })),
        };
        Ok(Some(Self {
            id: next_id(),
            name: Arc::clone(wanted.name),
            pixels,
            info,
            layout,
            faces: None,
            texels,
            warning,
            complaint: Mutex::default(),
            broken: Mutex::default(),
        }))
    }

    /// Opens a Ptex file. Its table of faces is read even where its texels are in the cache: it says where they are.
    fn open_ptex(wanted: &WantedImage<'_>, stores: &ImageStores) -> Result<Self, ImageError> {
        let source = PtexSource::open(wanted.library.bytes(wanted.file)?)?;
        let mut space = wanted.color_space.clone();
        let mut warning = None;
        if let ColorSpace::Named(name) = &space
            && let Err(error) = wanted.library.color_transform(name)
        {
            warning = Some(format!("{error}; the file's own colour space is taken"));
            space = ColorSpace::Auto;
        }
        let info = stored_as(source.info().clone(), &space);
        let is_srgb = is_srgb(&space, info.is_srgb, info.format, info.channels);
        let texels = Arc::new(StoredTexels::new(&info, is_srgb));
        let bytes = u32::try_from(texels.device_bytes()).unwrap_or(0);
        let layout = TileLayout::of_rows(source.layout().texels(), bytes).map_err(|e| ImageError(e.to_string()))?;
        let key = wanted.key(stores.disk.as_ref(), &space);
        let entry = key.as_ref().and_then(|(disk, key)| disk.find(key));
        let entry = entry.filter(|entry| entry.description().info().levels.first() == Some(&layout.size()));
        let transform = name_of(space);
        let faces = Some(Arc::clone(source.layout()));
        let pixels = PixelSource::Prepared(PreparedImage::new(PreparedParts {
            source: TexelSource::Ptex(Arc::clone(wanted.library), Box::new(source)),
            info: info.clone(),
            transform,
            layout,
            texels: Arc::clone(&texels),
            disk: key,
            memory: Arc::clone(&stores.memory),
            entry,
        }));
        Ok(Self {
            id: next_id(),
            name: Arc::clone(wanted.name),
            pixels,
            info,
            layout,
            faces,
            texels,
            warning,
            complaint: Mutex::default(),
            broken: Mutex::default(),
        })
    }

    /// Of Ptex: where the texels of faces are.
    pub(crate) fn faces(&self) -> Option<&Arc<FaceLayout>> {
        self.faces.as_ref()
    }

    /// Its number.
    pub(crate) fn id(&self) -> u64 {
        self.id
    }

    /// How it is cut.
    pub(crate) fn layout(&self) -> &TileLayout {
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
        self.texels.is_srgb()
    }

    /// Whether tiles are read from the file as it is.
    pub(super) fn is_direct(&self) -> bool {
        matches!(self.pixels, PixelSource::File(_))
    }

    /// What is not as the scene asks.
    pub(super) fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// What went wrong while tiles were read, once.
    pub(crate) fn take_complaint(&self) -> Option<String> {
        lock(&self.complaint).take()
    }

    /// Whether a tile could not be read, all of it, when it was last asked for.
    pub(crate) fn is_broken(&self, tile: u32) -> bool {
        lock(&self.broken).contains(&tile)
    }

    /// Says that a tile will be read. Said of all tiles that are wanted before the first is read, one decoding serves
    /// them.
    pub(crate) fn expect(&self, tile: u32) {
        let PixelSource::Prepared(prepared) = &self.pixels else { return };
        if let Some(piece) = self.layout.pieces(tile).first() {
            prepared.expect(piece.level);
        }
    }

    /// The bytes of a tile. What cannot be read is zero, with one complaint, and the tile is broken.
    pub(crate) fn tile(&self, tile: u32) -> Vec<u8> {
        let length = usize::try_from(self.layout.tile_bytes(tile)).unwrap_or(0);
        let mut out = vec![0; length];
        let mut raw = Vec::new();
        for piece in self.layout.pieces(tile) {
            let begin = usize::try_from(piece.offset).unwrap_or(0);
            let bytes = piece.size[0] as usize * piece.size[1] as usize * self.texels.device_bytes();
            let Some(out) = out.get_mut(begin..begin + bytes) else { continue };
            // A prepared image has tried again itself; one that could not be read is not waited for with every tile.
            let is_known = !self.is_direct() || !lock(&self.broken).is_empty();
            let pauses = if is_known { &[][..] } else { &PAUSES };
            if let Err(error) = again(pauses, |_| true, std::thread::sleep, || self.piece(&piece, &mut raw, out)) {
                out.fill(0);
                let text = format!("{}: {error}; its fallback is used where it cannot be read", self.name);
                tracing::debug!("{text}");
                lock(&self.broken).insert(tile);
                lock(&self.complaint).get_or_insert(text);
            }
        }
        out
    }

    /// Reads the first tile of the finest level: whether the image can be decoded.
    pub(super) fn try_finest(&self) -> Result<(), ImageError> {
        let Some(piece) = self.layout.pieces(0).first().copied() else { return Ok(()) };
        let bytes = piece.size[0] as usize * piece.size[1] as usize * self.texels.device_bytes();
        self.piece(&piece, &mut Vec::new(), &mut vec![0; bytes])
    }

    fn piece(&self, piece: &TilePiece, raw: &mut Vec<u8>, out: &mut [u8]) -> Result<(), ImageError> {
        let TilePiece { level, at, size, .. } = *piece;
        let read = |out: &mut [u8]| match &self.pixels {
            PixelSource::File(image) => image.read(level, at, size, out),
            PixelSource::Prepared(prepared) => prepared.read(level, at, size, out),
        };
        if self.texels.file_bytes() == self.texels.device_bytes() {
            return read(out);
        }
        raw.clear();
        raw.resize(size[0] as usize * size[1] as usize * self.texels.file_bytes(), 0);
        read(raw)?;
        self.texels.widen(raw, out);
        Ok(())
    }
}

/// All levels of a texture's image, for whoever looks at texels on the host: nothing is decoded for it a second time.
impl SourceImage for TextureImage {
    fn info(&self) -> ImageInfo {
        let levels = (0..self.layout.levels()).map(|level| self.layout.level_size(level)).collect();
        ImageInfo { levels, tile_friendly: true, ..self.info.clone() }
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let prepared = match &self.pixels {
            PixelSource::File(image) => return image.read(level, at, size, out),
            PixelSource::Prepared(prepared) => prepared,
        };
        let texel = self.texels.file_bytes();
        let whole = self.layout.level_size(level);
        let row = size[0] as usize * texel;
        let mut tile = Vec::new();
        let tiles = |axis: usize| (at[axis] / TILE_SIDE * TILE_SIDE..at[axis] + size[axis]).step_by(TILE_SIDE as usize);
        for (x, y) in tiles(1).flat_map(|y| tiles(0).map(move |x| (x, y))) {
            let side = [whole[0].saturating_sub(x).min(TILE_SIDE), whole[1].saturating_sub(y).min(TILE_SIDE)];
            tile.clear();
            tile.resize(side[0] as usize * side[1] as usize * texel, 0);
            prepared.read(level, [x, y], side, &mut tile)?;
            let (left, right) = (x.max(at[0]), (x + side[0]).min(at[0] + size[0]));
            for line in y.max(at[1])..(y + side[1]).min(at[1] + size[1]) {
                let from = ((line - y) * side[0] + left - x) as usize * texel;
                let to = (line - at[1]) as usize * row + (left - at[0]) as usize * texel;
                let length = right.saturating_sub(left) as usize * texel;
                let (Some(from), Some(to)) = (tile.get(from..from + length), out.get_mut(to..to + length)) else {
                    return Err(ImageError("has no such texels".into()));
                };
                to.copy_from_slice(from);
            }
        }
        Ok(())
    }
}

/// The name of a colour space that has one.
fn name_of(space: ColorSpace) -> Option<Arc<str>> {
    match space {
        ColorSpace::Named(name) => Some(name),
        _ => None,
    }
}

/// A number that no image has.
fn next_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// What an image of a colour space is once it is decoded: those that go through a conversion become linear, for which
/// 8 bits are too few.
fn stored_as(info: ImageInfo, space: &ColorSpace) -> ImageInfo {
    if !matches!(space, ColorSpace::Named(_)) {
        return info;
    }
    let format = if info.format == TexelFormat::F32 { TexelFormat::F32 } else { TexelFormat::F16 };
    ImageInfo { format, is_srgb: None, ..info }
}
