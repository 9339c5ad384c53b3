// SPDX-License-Identifier: Apache-2.0
//! Textures that displace surfaces. The caller decodes files through a trait; levels, colour spaces and filtering are
//! handled here.
//!
//! One level of an image is read for a mesh, whole: the coarsest one whose texels are not larger than the pieces that
//! the mesh is cut into. It is filtered bilinearly, as the shaders do. Only the channels that the
//! displacement reads are decoded. Any thread.

use std::fmt::Debug;
use std::sync::{Arc, Mutex, PoisonError};

use rustc_hash::FxHashMap;

use super::{ColorSpace, TextureRef, TextureSampler, TileLayout, Wrap};

/// Largest number of texels of a level, each channel counted: a quarter of a gibibyte.
const MAX_TEXELS: u64 = 1 << 26;
/// Number of the first member of a set of files.
const FIRST_MEMBER: u32 = 1001;

/// Opens height textures. It is called by several threads at once, and must not wait for work of the rayon pool.
pub trait HeightFiles: Send + Sync + Debug {
    /// Opens the file of a texture, or, if that is a set, the member of that number (1001 to 1100); `None` for a
    /// missing member.
    ///
    /// # Errors
    /// The reason why it cannot be read, for the user.
    fn open(&self, texture: &TextureRef, member: u32) -> Result<Option<Arc<dyn HeightImage>>, String>;
}

/// An open image.
pub trait HeightImage: Send + Sync + Debug {
    /// Levels and tiles of the image.
    fn layout(&self) -> TileLayout;

    /// Continuation of the image outside, as the file has it; never [`Wrap::UseMetadata`].
    fn wrap(&self) -> Option<[Wrap; 2]>;

    /// A channel (0 to 3; of images with fewer, as [`super::expand`] says) of all texels of a level: linear values, row
    /// by row from the bottom.
    ///
    /// # Errors
    /// The reason why it cannot be read, for the user.
    fn channel(&self, level: u32, channel: u8) -> Result<Vec<f32>, String>;

    /// Gives a channel of level 0 to `sink`, some rows at a time from the bottom on, with the same bits as on the
    /// device.
    ///
    /// # Errors
    /// The reason why it cannot be read, for the user.
    fn rows(&self, channel: u8, sink: &mut dyn FnMut(&[f32])) -> Result<(), String> {
        sink(&self.channel(0, channel)?);
        Ok(())
    }
}

/// Path, member and colour space of a file.
type FileKey = (Arc<str>, u32, ColorSpace);
type OpenedHeights = Result<Option<Arc<dyn HeightImage>>, String>;
type DecodedHeights = Result<Arc<Vec<f32>>, String>;

/// Height textures, decoded when they are needed, and kept as long as the cache.
#[derive(Debug, Default)]
pub struct HeightCache {
    files: Option<Arc<dyn HeightFiles>>,
    open: Mutex<FxHashMap<FileKey, OpenedHeights>>,
    /// Decoded channels, by file, level and channel.
    decoded: Mutex<FxHashMap<(FileKey, u32, u8), DecodedHeights>>,
}

impl HeightCache {
    /// Creates a cache of textures that `files` opens; without `files`, none can be read.
    #[must_use]
    pub fn new(files: Option<Arc<dyn HeightFiles>>) -> Self {
        Self { files, ..Self::default() }
    }

    /// The interface that opens files.
    pub(crate) fn files(&self) -> Option<&Arc<dyn HeightFiles>> {
        self.files.as_ref()
    }

    /// The `channels` (bit k: channel k) of the level of a texture (or of the member of a set) for pieces that cover
    /// `area` of its unit square each; `None` for a missing member.
    ///
    /// # Errors
    /// The reason why it cannot be read, for the user.
    pub(crate) fn level(
        &self,
        texture: &TextureRef,
        member: u32,
        channels: u8,
        area: f64,
    ) -> Result<Option<HeightLevel>, String> {
        let key = (texture.asset.resolved.clone(), member, texture.color_space.clone());
        let open = || match &self.files {
            Some(files) => files.open(texture, member),
            None => Err("nobody here can open images".to_owned()),
        };
        let Some(image) = once(&self.open, &key, open)? else { return Ok(None) };
        let layout = image.layout();
        let level = level_for(&layout, area, channels.count_ones());
        let size = layout.level_size(level);
        let mut texels = [const { None }; 4];
        for (channel, texels) in (0..4).zip(&mut texels).filter(|(channel, _)| channels >> channel & 1 == 1) {
            let decode = || {
                let texels = image.channel(level, channel)?;
                let is_whole = texels.len() as u64 == u64::from(size[0]) * u64::from(size[1]);
                if is_whole { Ok(Arc::new(texels)) } else { Err("has a level of another size than it says".to_owned()) }
            };
            *texels = Some(once(&self.decoded, &(key.clone(), level, channel), decode)?);
        }
        let layout = TileLayout::new(size, 4).map_err(|error| error.to_string())?;
        let metadata = image.wrap().unwrap_or([Wrap::Black; 2]);
        let wrap = [0, 1].map(|axis: usize| match texture.wrap[axis] {
            _ if member > 0 => Wrap::Clamp,
            Wrap::UseMetadata => metadata[axis],
            wrap => wrap,
        });
        let outside = if texture.has_border { texture.fallback.map(f64::from) } else { [0.0; 4] };
        Ok(Some(HeightLevel { layout, wrap, outside, texels }))
    }
}

/// The value of a key, computed if it is absent. Two threads may compute the same value, so that none waits.
fn once<K: Clone + Eq + std::hash::Hash, V: Clone>(
    known: &Mutex<FxHashMap<K, V>>,
    key: &K,
    make: impl FnOnce() -> V,
) -> V {
    let lock = || known.lock().unwrap_or_else(PoisonError::into_inner);
    let found = lock().get(key).cloned();
    found.unwrap_or_else(|| {
        let made = make();
        lock().entry(key.clone()).or_insert(made).clone()
    })
}

/// The coarsest level whose texels are not larger than pieces of `area`, and that does not have too many texels in this
/// number of channels.
fn level_for(layout: &TileLayout, area: f64, channels: u32) -> u32 {
    let texels =
        |level: u32| layout.level_size(level).into_iter().map(u64::from).product::<u64>() * u64::from(channels.max(1));
    let coarsest = layout.levels().saturating_sub(1);
    let [width, height] = layout.size().map(f64::from);
    // Number of texels of level 0 in a piece: each level has a quarter as many.
    let wanted = 0.5 * (area * width * height).log2();
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 32; NaN is 0")]
    let wanted = wanted.floor().clamp(0.0, 32.0) as u32;
    (wanted.min(coarsest)..coarsest).find(|&level| texels(level) <= MAX_TEXELS).unwrap_or(coarsest)
}

/// Decoded channels of a level of an image.
#[derive(Clone, Debug)]
pub(crate) struct HeightLevel {
    /// Layout of an image that has only this level.
    layout: TileLayout,
    wrap: [Wrap; 2],
    /// Value outside the image, as in [`TextureSampler`].
    outside: [f64; 4],
    /// Texels of the channels that were asked for.
    texels: [Option<Arc<Vec<f32>>>; 4],
}

impl HeightLevel {
    /// The value at texture coordinates, which for a member of a set are within the member. 0 in channels that were not
    /// asked for.
    pub(crate) fn at(&self, st: [f64; 2]) -> [f64; 4] {
        let width = self.layout.size()[0] as usize;
        let texel = |_: u32, x: u32, y: u32| {
            let at = y as usize * width + x as usize;
            let of = |texels: &Arc<Vec<f32>>| texels.get(at).copied();
            [0, 1, 2, 3].map(|k: usize| f64::from(self.texels[k].as_ref().and_then(of).unwrap_or(0.0)))
        };
        let Self { layout, wrap, outside, .. } = *self;
        TextureSampler { layout, wrap, outside, texel }.bilinear(st, 0)
    }
}

/// The member of a set of files that contains texture coordinates, counted from 1 (the one whose name ends in 1001); 0
/// for coordinates that no member can have.
pub(crate) fn member_of(st: [f64; 2]) -> u8 {
    let (number, _) = member_at(st);
    u8::try_from(number.saturating_sub(FIRST_MEMBER - 1)).unwrap_or(0)
}

/// Number in the file's name and lower left corner of a member counted from 1; 0 and the origin for member 0.
pub(crate) fn numbered(member: u8) -> (u32, [f64; 2]) {
    match member.checked_sub(1) {
        Some(at) => (u32::from(at) + FIRST_MEMBER, [f64::from(at % 10), f64::from(at / 10)]),
        None => (0, [0.0; 2]),
    }
}

/// The member of a set of files that contains texture coordinates, and its lower left corner; 0 for coordinates that no
/// member can have.
fn member_at(st: [f64; 2]) -> (u32, [f64; 2]) {
    let corner = st.map(f64::floor);
    let is_there = (0.0..10.0).contains(&corner[0]) && (0.0..10.0).contains(&corner[1]);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 99")]
    let number = if is_there { (corner[0] + 10.0 * corner[1]) as u32 + FIRST_MEMBER } else { 0 };
    (number, corner)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn displacement_texels_match_the_dicing_rate() {
        let layout = TileLayout::new([1024, 512], 4).unwrap();
        let piece = |texels: f64| texels * texels / (1024.0 * 512.0);
        let levels = [0.1, 1.0, 1.99, 2.0, 4.5, 300.0, 1e9].map(|texels| level_for(&layout, piece(texels), 1));
        assert_eq!(levels, [0, 0, 0, 1, 2, 8, 10], "pieces of so many texels of level 0");
        assert_eq!([f64::NAN, 0.0, f64::INFINITY].map(|area| level_for(&layout, area, 1)), [0, 0, 10], "no areas");
        let large = TileLayout::new([1 << 16, 1 << 16], 4).unwrap();
        let levels = [0, 1, 2, 4].map(|channels| level_for(&large, 0.0, channels));
        assert_eq!(levels, [3, 3, 4, 4], "8192 texels a side are enough for one channel, 4096 for four");
    }

    #[test]
    fn udim_tiles_have_their_numbers() {
        assert_eq!(member_at([0.5, 0.5]), (1001, [0.0, 0.0]));
        assert_eq!(member_at([9.5, 2.0]), (1030, [9.0, 2.0]));
        for st in [[10.0, 0.5], [-0.1, 0.5], [0.5, 10.0], [f64::NAN, 0.0], [f64::INFINITY, 0.0]] {
            assert_eq!(member_at(st).0, 0, "{st:?} is in none");
            assert_eq!(numbered(member_of(st)), (0, [0.0; 2]), "{st:?} is in none");
        }
        for st in [[0.5, 0.5], [9.5, 2.0], [0.0, 9.75], [9.0, 9.0]] {
            assert_eq!(numbered(member_of(st)), member_at(st), "{st:?}");
        }
    }
}
