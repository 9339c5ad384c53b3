// SPDX-License-Identifier: Apache-2.0
//! An image whose file cannot give parts of its levels at little cost: decoded once, kept on disk or in memory. Any
//! thread.
//!
//! The first request decides the finest level that is kept: a picture that shows a wall of 8 K on 200 pixels needs
//! 1/1000 of it on disk. If a finer level is requested later, the image is decoded a second time, and all of it is
//! kept.

use super::PAUSES;
use super::convert::{ImageDecoding, TileSink, convert};
use super::disk::DiskCache;
use super::image::{ColorTransform, ImageError, ImageInfo, ImageLibrary, SourceImage};
use super::memory::{DroppableLevels, MemoryStore, StoredLevels};
use super::ptex::{PtexSource, TexelConversion};
use super::texels::StoredTexels;
use super::tx::{TxDescription, TxFile};
use crate::sync::lock;
use oocpt_core::again::again;
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::TileLayout;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex, OnceLock, TryLockError, Weak};

/// The source of an image, opened when it is first needed: an entry on disk needs no decoder.
#[derive(Debug)]
pub(crate) struct ImageOrigin {
    library: Arc<dyn ImageLibrary>,
    asset: AssetRef,
    /// The number of a member of a set of files, or 0.
    member: u32,
    open: OnceLock<Arc<dyn SourceImage>>,
}

impl ImageOrigin {
    pub(super) fn new(library: &Arc<dyn ImageLibrary>, asset: &AssetRef, member: u32) -> Self {
        Self { library: Arc::clone(library), asset: asset.clone(), member, open: OnceLock::new() }
    }

    /// The open image; `None` for a member of a set that does not exist.
    pub(super) fn open(&self) -> Result<Option<Arc<dyn SourceImage>>, ImageError> {
        if let Some(image) = self.open.get() {
            return Ok(Some(Arc::clone(image)));
        }
        let image = match self.member {
            0 => self.library.open(&self.asset)?,
            _ => match self.library.open_part(&self.asset, self.member) {
                Some(part) => part?,
                None => return Ok(None),
            },
        };
        Ok(Some(Arc::clone(self.open.get_or_init(|| image))))
    }
}

/// The source of texels to decode.
#[derive(Debug)]
pub(super) enum TexelSource {
    /// An image, through its library.
    Image(ImageOrigin),
    /// A Ptex file; its texels are those of an image of one level.
    Ptex(Arc<dyn ImageLibrary>, Box<PtexSource>),
}

/// A source that is open.
enum OpenedSource<'a> {
    Image(Arc<dyn SourceImage>),
    Ptex(&'a PtexSource),
}

impl TexelSource {
    fn color_transform(&self, name: &str) -> Result<Arc<dyn ColorTransform>, ImageError> {
        match self {
            Self::Image(origin) => origin.library.color_transform(name),
            Self::Ptex(library, _) => library.color_transform(name),
        }
    }
}

/// The levels that are held, and where.
#[derive(Debug)]
enum HeldLevels {
    Disk(TxFile),
    Memory(StoredLevels),
}

impl HeldLevels {
    fn first_level(&self) -> u32 {
        match self {
            Self::Disk(file) => file.description().first_level,
            Self::Memory(levels) => levels.first(),
        }
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        match self {
            Self::Disk(file) => file.tile(level, at, size, out).map_err(|error| ImageError(error.to_string())),
            Self::Memory(levels) => levels.read(level, at, size, out),
        }
    }
}

#[derive(Debug, Default)]
struct PreparedState {
    held: Option<Arc<HeldLevels>>,
    failed: Option<ImageError>,
}

/// An image and its decoded levels.
#[derive(Debug)]
pub(super) struct PreparedImage {
    source: TexelSource,
    /// Properties of the image as it is stored.
    info: ImageInfo,
    /// The colour space that it is converted from.
    transform: Option<Arc<str>>,
    layout: TileLayout,
    texels: Arc<StoredTexels>,
    /// The cache on disk and its key there; `None` if there is no cache, or the file has no identity.
    disk: Option<(Arc<DiskCache>, String)>,
    memory: Arc<MemoryStore>,
    state: Mutex<PreparedState>,
    /// The finest level that was ever requested.
    finest: AtomicU32,
    this: Weak<Self>,
}

/// The inputs of a [`PreparedImage`].
pub(super) struct PreparedParts {
    pub(super) source: TexelSource,
    pub(super) info: ImageInfo,
    pub(super) transform: Option<Arc<str>>,
    pub(super) layout: TileLayout,
    pub(super) texels: Arc<StoredTexels>,
    pub(super) disk: Option<(Arc<DiskCache>, String)>,
    pub(super) memory: Arc<MemoryStore>,
    /// The entry that is on disk already.
    pub(super) entry: Option<TxFile>,
}

impl PreparedImage {
    pub(super) fn new(making: PreparedParts) -> Arc<Self> {
        let PreparedParts { source, info, transform, layout, texels, disk, memory, entry } = making;
        let held = entry.map(|file| Arc::new(HeldLevels::Disk(file)));
        Arc::new_cyclic(|this| Self {
            source,
            info,
            transform,
            layout,
            texels,
            disk,
            memory,
            state: Mutex::new(PreparedState { held, ..PreparedState::default() }),
            finest: AtomicU32::new(u32::MAX),
            this: Weak::clone(this),
        })
    }

    /// Announces the level that will be read, before any is: one decoding then serves all.
    pub(super) fn expect(&self, level: u32) {
        self.finest.fetch_min(level, Ordering::Relaxed);
    }

    /// Reads a tile, or a rectangle of a level of the last tile, in the file's channels.
    pub(super) fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        self.expect(level);
        let held = self.held(level)?;
        let result = held.read(level, at, size, out);
        let (Err(error), HeldLevels::Disk(_)) = (&result, &*held) else { return result };
        tracing::debug!(%error, "an entry of the texture cache is damaged");
        self.forget(&held);
        self.held(level)?.read(level, at, size, out)
    }

    /// Drops a damaged entry.
    fn forget(&self, damaged: &Arc<HeldLevels>) {
        let mut state = lock(&self.state);
        if state.held.as_ref().is_some_and(|held| Arc::ptr_eq(held, damaged)) {
            state.held = None;
            if let (Some((disk, key)), HeldLevels::Disk(_)) = (&self.disk, &**damaged) {
                disk.remove(key);
            }
        }
    }

    /// The levels that include `level`; other threads wait while they are made.
    fn held(&self, level: u32) -> Result<Arc<HeldLevels>, ImageError> {
        let mut state = lock(&self.state);
        if let Some(error) = &state.failed {
            return Err(error.clone());
        }
        if let Some(held) = state.held.as_ref().filter(|held| held.first_level() <= level) {
            return Ok(Arc::clone(held));
        }
        // One level more than requested is kept: the next picture may be a little nearer. All levels are kept if that
        // was not enough.
        let first = match state.held {
            None => self.finest.load(Ordering::Relaxed).min(level).saturating_sub(1),
            Some(_) => 0,
        };
        match again(&PAUSES, |_| true, std::thread::sleep, || self.make(first)) {
            Ok(held) => {
                let held = Arc::new(held);
                state.held = Some(Arc::clone(&held));
                drop(state);
                if let HeldLevels::Memory(levels) = &*held {
                    let this: Weak<dyn DroppableLevels> = self.this.clone();
                    self.memory.added(this, levels);
                }
                Ok(held)
            }
            Err(error) => {
                state.failed = Some(error.clone());
                Err(error)
            }
        }
    }

    fn make(&self, first: u32) -> Result<HeldLevels, ImageError> {
        let opened = match &self.source {
            TexelSource::Image(origin) => {
                OpenedSource::Image(origin.open()?.ok_or_else(|| ImageError("is gone".into()))?)
            }
            TexelSource::Ptex(_, ptex) => OpenedSource::Ptex(ptex),
        };
        let info = match &opened {
            OpenedSource::Image(image) => image.info(),
            OpenedSource::Ptex(ptex) => ptex.info().clone(),
        };
        let is_same = info.levels.first() == self.info.levels.first()
            && info.channels == self.info.channels
            && (info.format == self.info.format || self.transform.is_some());
        if !is_same {
            return Err(ImageError("has changed since it was opened".into()));
        }
        let transform = match &self.transform {
            Some(name) => {
                // The conversion applies the curve of a named space.
                let from = StoredTexels::new(&ImageInfo { is_srgb: None, ..info }, false);
                Some((from, self.source.color_transform(name)?))
            }
            None => None,
        };
        let transform = transform.as_ref().map(|(from, transform)| (from, &**transform));
        let convert = |sink: &mut dyn TileSink| match &opened {
            OpenedSource::Image(image) => {
                let (texels, layout) = (&*self.texels, &self.layout);
                convert(&ImageDecoding { image: &**image, texels, transform, layout, first }, sink)
            }
            OpenedSource::Ptex(ptex) => {
                let from = transform.map_or(&*self.texels, |(from, _)| from);
                let transform = transform.map(|(_, transform)| transform);
                ptex.convert(TexelConversion { from, to: &self.texels, transform }, sink)
            }
        };
        if let Some((disk, key)) = &self.disk
            && let Some(mut pending) = disk.begin(TxDescription::new(key, &self.info, self.layout.is_flat(), first))
        {
            let decoded = convert(&mut pending);
            match decoded.map(|()| pending.commit()) {
                Ok(Some(entry)) => return Ok(HeldLevels::Disk(entry)),
                Ok(None) => {}
                Err(error) if !disk.has_failed() => return Err(error),
                Err(_disk) => {}
            }
        }
        let mut levels = StoredLevels::new(&self.layout, self.texels.file_bytes(), first);
        convert(&mut levels)?;
        Ok(HeldLevels::Memory(levels))
    }
}

impl DroppableLevels for PreparedImage {
    fn drop_levels(&self) -> bool {
        match self.state.try_lock() {
            Ok(mut state) => state.held = None,
            Err(TryLockError::Poisoned(state)) => state.into_inner().held = None,
            Err(TryLockError::WouldBlock) => return false,
        }
        true
    }
}
