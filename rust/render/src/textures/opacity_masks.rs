// SPDX-License-Identifier: Apache-2.0
//! The masks of a snapshot's cutouts: how much of them is there, without their textures
//! (`oocpt_core::texture::OpacityMask`).
//!
//! Level 0 of each image is read once, when a scene has it first, through the cache that tiles come from. What has no
//! mask is asked of the texture: Ptex, programs, images that cannot be read. All masks of a scene are as fine as
//! [`LONGEST_SIDES`] allows. Render thread; reads on all cores.

use super::heights::{has_curve_of_device, read_channel_by_bands};
use super::set::TextureCache;
use super::tiles::TextureImage;
use oocpt_abi as abi;
use oocpt_abi::{GpuTexture, MaterialFlags, MaterialInput, NAME_PTEX};
use oocpt_core::material::{InputValue, Material};
use oocpt_core::scene::SurfaceTables;
use oocpt_core::texture::{OpacityMask, OpacityMaskMaker, OpacityQuery, TextureRef, Wrap, mask_bytes};
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Of all masks of a scene: they are always resident.
const MOST_BYTES: usize = 64 << 20;
/// Longest sides of levels of masks, texels, and what all masks may take with that. Lookups that are narrower than a
/// texel of the finest level that is kept read the texture where that is partly there.
const LONGEST_SIDES: [(u32, usize); 8] = [
    (4096, MOST_BYTES / 8),
    (2048, MOST_BYTES / 8),
    (1024, MOST_BYTES / 8),
    (512, MOST_BYTES),
    (256, MOST_BYTES),
    (128, MOST_BYTES),
    (64, MOST_BYTES),
    (32, MOST_BYTES),
];
/// Where no more than one in so many materials that have to be asked lacks a mask, what masks leave open is looked up
/// in passes of its own: a ray that comes to a candidate without a mask is walked again.
const LEAST_MASKED: usize = 4;
/// Words between places where a mask may begin.
const UNIT: usize = 4;
/// Words of the record of a set of files.
const SET_WORDS: usize = (2 + abi::UDIM_PARTS as usize).next_multiple_of(UNIT);

/// Image, channel, wrap modes, the longest side, and the bits of scale, bias, threshold and what is around the image.
type MaskKey = (u64, u8, [u32; 3], [u32; 4]);

/// Masks that were made; `None`: there is none.
pub(super) type MadeMasks = FxHashMap<MaskKey, Option<Arc<OpacityMask>>>;

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct OpacityMasks {
    /// All masks, each from a multiple of 16 bytes on.
    pub(crate) words: Vec<u32>,
    /// By material: the first word of its mask, or of the record of its set.
    first_words: Vec<Option<u32>>,
    /// By material: its surfaces are there everywhere.
    are_opaque: Vec<bool>,
    /// Whether some material has to be asked.
    pub(crate) has_cutouts: bool,
    /// Materials that have to be asked, and those of them that have no mask, or a part without one.
    asked: usize,
    unmasked: usize,
    /// What of them only the shaders look up, in words.
    pub(crate) of_shaders: Option<&'static str>,
}

impl OpacityMasks {
    /// The first word of a material's mask.
    pub(crate) fn first_word(&self, material: usize) -> Option<u32> {
        self.first_words.get(material).copied().flatten()
    }

    /// Whether masks answer for most materials, but for lookups that are near.
    pub(crate) fn answer_most(&self) -> bool {
        !self.words.is_empty() && LEAST_MASKED * self.unmasked <= self.asked
    }

    /// Whether a material's surfaces are there, whatever it says of opacity.
    pub(crate) fn is_opaque(&self, material: usize) -> bool {
        self.are_opaque.get(material).copied().unwrap_or(false)
    }

    /// Adds words, if there is room for them; where they begin.
    fn add(&mut self, words: &[u32]) -> Option<u32> {
        let begin = self.words.len().next_multiple_of(UNIT);
        if (begin + words.len()) * size_of::<u32>() > MOST_BYTES {
            return None;
        }
        self.words.resize(begin, 0);
        self.words.extend_from_slice(words);
        u32::try_from(begin).ok()
    }
}

/// A mask that a material wants.
struct WantedMask {
    key: MaskKey,
    query: OpacityQuery,
    image: Arc<TextureImage>,
}

/// What masks a material wants.
#[derive(Default)]
struct AllWanted {
    is_set: bool,
    /// By the number of the part, and 0 for one image.
    parts: Vec<(usize, WantedMask)>,
    /// There is another part, without a mask.
    lacks_part: bool,
}

/// Masks on their way into one array.
struct MaskPlacer<'a> {
    masks: OpacityMasks,
    made: &'a MadeMasks,
    first_words: FxHashMap<MaskKey, Option<u32>>,
    sets: FxHashMap<Vec<(usize, MaskKey)>, Option<u32>>,
}

impl TextureCache {
    /// The masks of the materials of a snapshot, of which [`Self::sync`] has the textures.
    pub(crate) fn opacity_masks(&mut self, surfaces: &SurfaceTables, records: &[GpuTexture]) -> Arc<OpacityMasks> {
        let mut wanted: Vec<AllWanted> =
            surfaces.materials.iter().map(|material| self.all_wanted(material, surfaces, records)).collect();
        let side = longest_side(&wanted);
        wanted.iter_mut().flat_map(|wanted| &mut wanted.parts).for_each(|(_, wanted)| wanted.key.2[2] = side);
        let all = || wanted.iter().flat_map(|wanted| &wanted.parts).map(|(_, wanted)| wanted);
        let mut made = std::mem::take(&mut self.masks);
        let missing: FxHashMap<MaskKey, &WantedMask> =
            all().filter(|w| !made.contains_key(&w.key)).map(|w| (w.key, w)).collect();
        let new: Vec<_> = missing.into_par_iter().map(|(key, wanted)| (key, make(wanted).map(Arc::new))).collect();
        made.extend(new);
        let (masks, first_words, sets) = (OpacityMasks::default(), FxHashMap::default(), FxHashMap::default());
        let mut placing = MaskPlacer { masks, made: &made, first_words, sets };
        for (material, wanted) in surfaces.materials.iter().zip(&wanted) {
            placing.place(material, wanted, only_shaders(material, records));
        }
        let masks = placing.masks;
        let keys: rustc_hash::FxHashSet<MaskKey> = all().map(|wanted| wanted.key).collect();
        made.retain(|key, _| keys.contains(key));
        self.masks = made;
        Arc::new(masks)
    }

    /// What masks a material wants; none where its cutouts are no textures.
    fn all_wanted(&self, material: &Material, surfaces: &SurfaceTables, records: &[GpuTexture]) -> AllWanted {
        let none = AllWanted::default();
        if !material.flags.contains(MaterialFlags::PRESENCE) {
            return none;
        }
        let InputValue::Texture { texture, uv: Some(set), .. } = *material.input(MaterialInput::Opacity) else {
            return none;
        };
        let has_set = material.uv_sets.get(usize::from(set)).is_some_and(|set| set.id != NAME_PTEX);
        let (record, file) = (records.get(texture as usize), surfaces.textures.get(texture as usize));
        let (Some(record), Some(file)) = (record.filter(|record| has_set && record.levels > 0), file) else {
            return none;
        };
        let is_set = record.flags & abi::TEXTURE_UDIM != 0;
        let (first, count) = if is_set { (record.first_page, abi::UDIM_PARTS) } else { (texture, 1) };
        let mut all = AllWanted { is_set, ..none };
        for (part, record) in records.iter().skip(first as usize).take(count as usize).enumerate() {
            let member = if is_set { u32::try_from(1001 + part).unwrap_or(0) } else { 0 };
            match self.wanted(material, file, member, record) {
                Some(wanted) => all.parts.push((part, wanted)),
                None => all.lacks_part |= record.levels > 0,
            }
        }
        all
    }

    /// What mask a material wants of an image.
    fn wanted(&self, material: &Material, file: &TextureRef, member: u32, record: &GpuTexture) -> Option<WantedMask> {
        let InputValue::Texture { channel, scale, bias, .. } = *material.input(MaterialInput::Opacity) else {
            return None;
        };
        if record.levels == 0 || record.flags & abi::TEXTURE_PTEX != 0 {
            return None;
        }
        let image = self.image(file, member)?;
        let channel = channel.unwrap_or(0) & 3;
        if has_curve_of_device(&image, channel) {
            return None;
        }
        let at = usize::from(channel);
        let (scale, bias) = (scale[at], bias[at]);
        let modes = [abi::TEXTURE_WRAP_S_SHIFT, abi::TEXTURE_WRAP_T_SHIFT].map(|shift| record.flags >> shift & 3);
        let has_border = record.flags & abi::TEXTURE_BORDER != 0;
        let outside = if has_border { record.fallback[at] } else { 0.0 };
        let threshold = material.opacity_threshold;
        let query = OpacityQuery { wrap: modes.map(wrap_of), outside, scale, bias, threshold };
        let key = (image.id(), channel, [modes[0], modes[1], 0], [scale, bias, threshold, outside].map(f32::to_bits));
        Some(WantedMask { key, query, image })
    }
}

/// The longest side for which all masks fit.
fn longest_side(wanted: &[AllWanted]) -> u32 {
    let images = wanted.iter().flat_map(|wanted| &wanted.parts).map(|(_, wanted)| (wanted.key, wanted.image.layout()));
    let layouts: FxHashMap<MaskKey, _> = images.collect();
    let beside = size_of::<u32>() * (SET_WORDS + UNIT);
    let bytes = |side: u32| layouts.values().map(|layout| mask_bytes(layout, side) + beside).sum::<usize>();
    let (fitting, least) = (LONGEST_SIDES.into_iter().find(|(side, most)| bytes(*side) <= *most), LONGEST_SIDES[7]);
    fitting.unwrap_or(least).0
}

impl MaskPlacer<'_> {
    /// Adds what there is of a material's masks.
    fn place(&mut self, material: &Material, wanted: &AllWanted, only_shaders: Option<&'static str>) {
        let one = wanted.parts.first().filter(|_| !wanted.is_set).map(|(_, wanted)| wanted.key);
        let is_opaque = one.and_then(|key| self.made.get(&key)?.as_ref()).is_some_and(|mask| mask.is_opaque);
        let first = match one {
            _ if is_opaque => None,
            None => self.set(wanted),
            Some(key) => self.first_word(key),
        };
        if material.flags.contains(MaterialFlags::PRESENCE) && !is_opaque {
            self.masks.has_cutouts = true;
            self.masks.asked += 1;
            self.masks.unmasked += usize::from(first.is_none() || wanted.lacks_part);
            self.masks.of_shaders = self.masks.of_shaders.or(only_shaders);
        }
        self.masks.first_words.push(first);
        self.masks.are_opaque.push(is_opaque);
    }

    fn first_word(&mut self, key: MaskKey) -> Option<u32> {
        if let Some(first) = self.first_words.get(&key) {
            return *first;
        }
        let first = self.made.get(&key).and_then(Option::as_ref).and_then(|mask| self.masks.add(&mask.words));
        self.first_words.insert(key, first);
        first
    }

    /// The record of a set of files.
    fn set(&mut self, wanted: &AllWanted) -> Option<u32> {
        if wanted.parts.is_empty() {
            return None;
        }
        let keys: Vec<(usize, MaskKey)> = wanted.parts.iter().map(|(part, wanted)| (*part, wanted.key)).collect();
        if let Some(first) = self.sets.get(&keys) {
            return *first;
        }
        let mut words = vec![0; SET_WORDS];
        words[1] = abi::MASK_SET;
        let first = self.masks.add(&words);
        for (part, key) in &keys {
            let (Some(set), Some(first)) = (first, self.first_word(*key)) else { continue };
            // Backwards for a mask that another material has as well.
            let away = (i64::from(first) - i64::from(set)) / i64::try_from(UNIT).unwrap_or(1);
            let at = set as usize + 2 + part;
            if let (Some(word), Ok(away)) = (self.masks.words.get_mut(at), i32::try_from(away)) {
                *word = away.cast_unsigned();
            }
        }
        self.sets.insert(keys, first);
        first
    }
}

/// What of a material's opacity native traversal does not look up, in words: Ptex, and floats through the sRGB curve,
/// which is the device's own function.
fn only_shaders(material: &Material, records: &[GpuTexture]) -> Option<&'static str> {
    let InputValue::Texture { texture, channel, .. } = *material.input(MaterialInput::Opacity) else { return None };
    let record = records.get(texture as usize)?;
    if record.flags & abi::TEXTURE_PTEX != 0 {
        return Some("cutouts by Ptex");
    }
    let is_curved = |record: &GpuTexture| {
        let format = record.flags >> abi::TEXTURE_FORMAT_SHIFT & 3;
        record.levels > 0 && record.flags & abi::TEXTURE_SRGB != 0 && format != abi::TEXTURE_U8
    };
    let parts = match record.flags & abi::TEXTURE_UDIM {
        0 => std::slice::from_ref(record),
        _ => records.get(record.first_page as usize..).unwrap_or_default(),
    };
    let has_curve = channel != Some(3) && parts.iter().take(abi::UDIM_PARTS as usize).any(is_curved);
    has_curve.then_some("cutouts by floats through the sRGB curve")
}

fn wrap_of(mode: u32) -> Wrap {
    match mode {
        abi::WRAP_CLAMP => Wrap::Clamp,
        abi::WRAP_REPEAT => Wrap::Repeat,
        abi::WRAP_MIRROR => Wrap::Mirror,
        _ => Wrap::Black,
    }
}

fn make(wanted: &WantedMask) -> Option<OpacityMask> {
    let WantedMask { key: (_, channel, [_, _, side], _), query, image } = wanted;
    let mut maker = OpacityMaskMaker::new(image.layout(), query, *side)?;
    // Said first: all of it is wanted.
    image.expect(image.layout().first_tile(0));
    // Whoever looks at its tiles tells what is wrong with it.
    read_channel_by_bands(image, 0, *channel, &mut |band| maker.push(band))
        .map_err(|error| tracing::debug!("no opacity mask: {error}"))
        .ok()?;
    maker.finish()
}
