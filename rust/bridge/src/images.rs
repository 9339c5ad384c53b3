// SPDX-License-Identifier: Apache-2.0
//! The host's image files as the renderer asks for them; C++ finds and decodes them.
//!
//! Error texts follow on the name of the file, which the renderer puts in front. Any thread, several at once.

use crate::ffi_images as ffi;
use crate::host_file::{HostFile, OpenFiles};
use cxx::UniquePtr;
use oocpt_abi::TILE_SIDE;
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::{TexelFormat, Wrap};
use oocpt_ptex::ReadAt;
use oocpt_render::textures::{ColorTransform, ImageError, ImageInfo, ImageLibrary, SourceImage};
use oocpt_render::{LightFiles, LightPicture};
use std::fmt;
use std::sync::Arc;
use xxhash_rust::xxh3::Xxh3;

/// Numbers that a set of files may have in place of `<UDIM>`.
const UDIM_NUMBERS: std::ops::RangeInclusive<u32> = 1001..=1100;

const UDIM: &str = "<UDIM>";

/// The host's files.
pub(crate) struct HostImages {
    source: Arc<UniquePtr<ffi::ImageSource>>,
    files: Arc<OpenFiles>,
}

impl fmt::Debug for HostImages {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("HostImages")
    }
}

impl HostImages {
    /// Files of this source; a null source has none.
    pub(crate) fn new(source: UniquePtr<ffi::ImageSource>) -> Self {
        Self { source: Arc::new(source), files: Arc::default() }
    }

    fn source(&self) -> Result<&ffi::ImageSource, ImageError> {
        self.source.as_ref().as_ref().ok_or_else(|| error("cannot be read: the host gives no files"))
    }

    /// The bytes of a file of at most `limit` bytes.
    pub(crate) fn file(&self, asset: &AssetRef, limit: u64) -> Result<Vec<u8>, ImageError> {
        found(asset)?;
        self.source()?.read_file(&asset.resolved, limit).map_err(|reason| error(reason.what()))
    }

    /// The member of a set of files, if it is there.
    fn part(&self, set: &AssetRef, number: u32) -> Option<AssetRef> {
        let part = numbered(set, number)?;
        let exists = self.source.as_ref().as_ref()?.exists(&part.resolved).unwrap_or(false);
        exists.then_some(part)
    }
}

fn error(reason: impl Into<String>) -> ImageError {
    ImageError(reason.into())
}

fn found(asset: &AssetRef) -> Result<(), ImageError> {
    if asset.resolved.is_empty() { Err(error("cannot be found")) } else { Ok(()) }
}

/// The name of one member of a set; `None` if the path names no set, or the number is none of UDIM's.
fn numbered(set: &AssetRef, number: u32) -> Option<AssetRef> {
    let is_set = set.resolved.contains(UDIM) && UDIM_NUMBERS.contains(&number);
    let name = |text: &str| Arc::from(text.replace(UDIM, &number.to_string()));
    is_set.then(|| AssetRef { authored: name(&set.authored), resolved: name(&set.resolved) })
}

impl ImageLibrary for HostImages {
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        found(asset)?;
        let held = self.source()?.open(&asset.resolved).map_err(|reason| error(reason.what()))?;
        let facts = match held.as_ref() {
            Some(held) => held.facts().map_err(|reason| error(reason.what()))?,
            None => return Err(error("cannot be opened")),
        };
        let info = info(&facts).ok_or_else(|| error("is of a form that the renderer does not know"))?;
        tracing::debug!(asset = &*asset.authored, ?info, "image");
        Ok(Arc::new(HostImage { asset: asset.clone(), held, info }))
    }

    fn open_part(&self, set: &AssetRef, number: u32) -> Option<Result<Arc<dyn SourceImage>, ImageError>> {
        let part = self.part(set, number)?;
        Some(self.open(&part).map_err(|reason| error(format!("{}: {reason}", part.authored))))
    }

    fn identity(&self, asset: &AssetRef) -> Result<String, ImageError> {
        found(asset)?;
        let source = self.source()?;
        let facts = source.file_facts(&asset.resolved).map_err(|reason| error(reason.what()))?;
        if facts.is_plain {
            return Ok(format!("file:{}:{}:{}", facts.canonical, facts.size, facts.modified_ns));
        }
        let mut hash = Xxh3::new();
        let size = source
            .stream_file(&asset.resolved, &mut ffi::ByteSink(&mut hash))
            .map_err(|reason| error(reason.what()))?;
        Ok(format!("hash:{:032x}:{size}", hash.digest128()))
    }

    fn bytes(&self, asset: &AssetRef) -> Result<Box<dyn ReadAt>, ImageError> {
        found(asset)?;
        let file = HostFile::open(&self.source, &self.files, Arc::clone(&asset.resolved));
        Ok(Box::new(file.map_err(|reason| error(reason.to_string()))?))
    }

    /// `$OCIO`, with the size and time of the file that it names; the configuration of ours does not change.
    fn color_config(&self) -> String {
        let Some(path) = std::env::var_os("OCIO").filter(|path| !path.is_empty()) else { return String::new() };
        let said = std::fs::metadata(&path).ok().and_then(|metadata| {
            let age = metadata.modified().ok()?.duration_since(std::time::UNIX_EPOCH).ok()?;
            Some(format!("{}:{}", metadata.len(), age.as_nanos()))
        });
        format!("{}:{}", path.to_string_lossy(), said.unwrap_or_default())
    }

    fn color_transform(&self, name: &str) -> Result<Arc<dyn ColorTransform>, ImageError> {
        let held = self.source()?.color_transform(name).map_err(|reason| error(reason.what()))?;
        Ok(Arc::new(HostTransform { name: name.into(), held }))
    }
}

impl LightFiles for HostImages {
    fn picture(&self, asset: &AssetRef) -> Result<LightPicture, String> {
        let image = self.open(asset).map_err(|reason| reason.to_string())?;
        LightPicture::of_image(&*image).map_err(|reason| reason.to_string())
    }

    fn bytes(&self, asset: &AssetRef, limit: u64) -> Result<Vec<u8>, String> {
        self.file(asset, limit).map_err(|reason| reason.to_string())
    }
}

/// An open file.
struct HostImage {
    asset: AssetRef,
    held: UniquePtr<ffi::HeldImage>,
    info: ImageInfo,
}

impl fmt::Debug for HostImage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "HostImage({})", self.asset.authored)
    }
}

impl SourceImage for HostImage {
    fn info(&self) -> ImageInfo {
        self.info.clone()
    }

    fn read(&self, level: u32, at: [u32; 2], size: [u32; 2], out: &mut [u8]) -> Result<(), ImageError> {
        let texels = ffi::TexelBox { level, x: at[0], y: at[1], width: size[0], height: size[1] };
        match self.held.as_ref() {
            Some(held) => held.read(&texels, out).map_err(|reason| error(reason.what())),
            None => Err(error("is closed")),
        }
    }

    fn decode(&self, level: u32, sink: &mut dyn FnMut(u32, &[u8]) -> bool) -> Result<(), ImageError> {
        match self.held.as_ref() {
            Some(held) => held.decode(level, &mut ffi::RowSink(sink)).map_err(|reason| error(reason.what())),
            None => Err(error("is closed")),
        }
    }
}

/// A conversion that `OpenColorIO` does.
struct HostTransform {
    name: Arc<str>,
    held: UniquePtr<ffi::HeldTransform>,
}

impl fmt::Debug for HostTransform {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "HostTransform({})", self.name)
    }
}

impl ColorTransform for HostTransform {
    fn apply(&self, texels: &mut [f32], channels: u32) -> Result<(), ImageError> {
        match self.held.as_ref() {
            Some(held) => held.apply(texels, channels).map_err(|reason| error(reason.what())),
            None => Err(error("is not known")),
        }
    }
}

/// What the renderer wants to know; `None` for what it cannot use.
fn info(facts: &ffi::ImageFacts) -> Option<ImageInfo> {
    let levels: Vec<[u32; 2]> = facts.levels.chunks_exact(2).map(|size| [size[0], size[1]]).collect();
    let format = match facts.format {
        ffi::TexelTag::UInt8 => TexelFormat::U8,
        ffi::TexelTag::Half => TexelFormat::F16,
        ffi::TexelTag::Float => TexelFormat::F32,
        _ => return None,
    };
    let is_srgb = match facts.is_srgb {
        0 => Some(false),
        1 => Some(true),
        _ => None,
    };
    let wrap = wrap(facts.wrap_s).zip(wrap(facts.wrap_t)).map(|(s, t)| [s, t]);
    // A part of a level that the file lacks is made of the coarsest one that it has.
    let has_coarse = levels.last().is_some_and(|size| size.iter().all(|side| *side <= TILE_SIDE));
    let is_usable = !levels.is_empty() && (1..=4).contains(&facts.channels);
    is_usable.then_some(ImageInfo {
        levels,
        channels: facts.channels,
        format,
        tile_friendly: facts.is_tiled && has_coarse,
        is_srgb,
        wrap,
    })
}

fn wrap(tag: ffi::WrapTag) -> Option<Wrap> {
    match tag {
        ffi::WrapTag::Black => Some(Wrap::Black),
        ffi::WrapTag::Clamp => Some(Wrap::Clamp),
        ffi::WrapTag::Repeat => Some(Wrap::Repeat),
        ffi::WrapTag::Mirror => Some(Wrap::Mirror),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts() -> ffi::ImageFacts {
        ffi::ImageFacts {
            levels: vec![8, 4, 4, 2],
            channels: 3,
            format: ffi::TexelTag::Half,
            is_tiled: true,
            is_srgb: 0,
            wrap_s: ffi::WrapTag::Repeat,
            wrap_t: ffi::WrapTag::Clamp,
        }
    }

    #[test]
    fn image_facts_are_converted() {
        let info = info(&facts()).expect("usable");
        assert_eq!(info.levels, [[8, 4], [4, 2]], "levels");
        assert_eq!((info.channels, info.format, info.tile_friendly), (3, TexelFormat::F16, true), "texels");
        assert_eq!((info.is_srgb, info.wrap), (Some(false), Some([Wrap::Repeat, Wrap::Clamp])), "metadata");
    }

    #[test]
    fn partial_reads_need_tiles_and_coarse_levels() {
        let friendly = |levels: &[u32], is_tiled| {
            info(&ffi::ImageFacts { levels: levels.into(), is_tiled, ..facts() }).expect("usable").tile_friendly
        };
        assert!(friendly(&[512, 256, 256, 128, 128, 64], true), "down to a tile");
        assert!(friendly(&[128, 100], true), "needs no more");
        assert!(!friendly(&[512, 256, 256, 128], true), "coarser ones are made of all of the second");
        assert!(!friendly(&[128, 100], false), "rows are read from the top");
    }

    #[test]
    fn facts_missing_from_the_file_are_none() {
        let silent = ffi::ImageFacts { is_srgb: -1, wrap_t: ffi::WrapTag::Unknown, ..facts() };
        let info = info(&silent).expect("usable");
        assert_eq!((info.is_srgb, info.wrap), (None, None), "half a wrap mode is none");
    }

    #[test]
    fn images_without_levels_or_channels_are_refused() {
        assert_eq!(info(&ffi::ImageFacts { levels: Vec::new(), ..facts() }), None, "no levels");
        assert_eq!(info(&ffi::ImageFacts { channels: 0, ..facts() }), None, "no channels");
        assert_eq!(info(&ffi::ImageFacts { channels: 5, ..facts() }), None, "too many channels");
        assert_eq!(info(&ffi::ImageFacts { format: ffi::TexelTag { repr: 9 }, ..facts() }), None, "unknown format");
    }

    #[test]
    fn only_tile_sets_have_tile_numbers() {
        let asset = |text: &str| AssetRef { authored: text.into(), resolved: format!("/t/{text}").into() };
        let part = numbered(&asset("a.<UDIM>.png"), 1011).expect("a member");
        assert_eq!((&*part.authored, &*part.resolved), ("a.1011.png", "/t/a.1011.png"), "both names");
        assert_eq!(numbered(&asset("a.<UDIM>.png"), 1101), None, "beyond the last row");
        assert_eq!(numbered(&asset("a.1001.png"), 1001), None, "no set");
    }

    #[test]
    fn an_unresolved_file_gives_a_reason() {
        let images = HostImages::new(UniquePtr::null());
        let lost = AssetRef { authored: "a.png".into(), resolved: "".into() };
        let text = images.open(&lost).expect_err("not there").to_string();
        assert_eq!(text, "cannot be found", "an unresolved path");
        assert!(images.part(&lost, 1001).is_none(), "no members");
        assert!(images.file(&lost, 1).is_err(), "no bytes");
    }
}
