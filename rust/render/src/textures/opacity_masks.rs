// SPDX-License-Identifier: Apache-2.0
//! The opacity masks of a snapshot: they answer alpha tests without the texture where its coverage is certain
//! (`oocpt_core::texture::OpacityMask`).
//!
//! Level 0 of each image is read once, when a scene first has it, through the cache of tiles. Ptex, programs and images
//! that cannot be read have no mask: their alpha tests read the texture. All masks of a scene are at the finest level
//! for which all of them fit ([`MAX_SIDES`]). Render thread; reads on all cores.

use super::heights::{has_curve_of_device, read_channel_by_bands};
use super::mask_key::{MadeMasks, MaskKey};
use super::set::TextureCache;
use super::tiles::TextureImage;
use oocpt_abi as abi;
use oocpt_abi::{GpuTexture, MaterialFlags, MaterialInput, NAME_PTEX};
use oocpt_core::material::{InputValue, Material};
use oocpt_core::scene::SurfaceTables;
use oocpt_core::texture::{OpacityMask, OpacityMaskMaker, OpacityQuery, TextureRef, Wrap, mask_bytes};
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};
use std::sync::Arc;

/// Limit of all masks of a scene, which are always resident.
const MAX_BYTES: usize = 64 << 20;
/// The longest side of a mask in texels, and the bytes that all masks may take to have that: the first row that fits
/// counts. A lookup that is narrower than a texel of the mask reads the texture where coverage is partial.
const MAX_SIDES: [(u32, usize); 8] = [
    (4096, MAX_BYTES / 8),
    (2048, MAX_BYTES / 8),
    (1024, MAX_BYTES / 8),
    (512, MAX_BYTES),
    (256, MAX_BYTES),
    (128, MAX_BYTES),
    (64, MAX_BYTES),
    (32, MAX_BYTES),
];
/// Alpha tests that masks leave open go to passes of their own if at most one in so many alpha-tested materials lacks a
/// mask: a ray that meets a material without one is traversed again.
const MATERIALS_PER_UNMASKED: usize = 4;
/// Alignment of a mask in words; offsets in records of UDIM sets are in this unit.
const ALIGNMENT: usize = 4;
/// Words of the record of a UDIM set.
const SET_WORDS: usize = (2 + abi::UDIM_PARTS as usize).next_multiple_of(ALIGNMENT);

/// The masks of a snapshot, in the array that the passes read.
#[derive(Debug, Default)]
pub(crate) struct OpacityMasks {
    /// All masks, each aligned to 16 bytes.
    pub(crate) words: Vec<u32>,
    /// By material: the first word of its mask, or of the record of its UDIM set.
    first_words: Vec<Option<u32>>,
    /// By material: the mask says that every alpha test passes.
    are_opaque: Vec<bool>,
    /// True if some material has an alpha test.
    pub(crate) has_cutouts: bool,
    /// Number of materials with an alpha test.
    alpha_tested: usize,
    /// Number of those without a mask, or with a UDIM tile without one.
    unmasked: usize,
    /// A kind of cutout in the scene that native traversal does not support, for the message.
    pub(crate) not_native: Option<&'static str>,
}

impl OpacityMasks {
    /// The first word of a material's mask.
    pub(crate) fn first_word(&self, material: usize) -> Option<u32> {
        self.first_words.get(material).copied().flatten()
    }

    /// True if most alpha-tested materials have masks.
    pub(crate) fn answer_most(&self) -> bool {
        !self.words.is_empty() && MATERIALS_PER_UNMASKED * self.unmasked <= self.alpha_tested
    }

    /// True if every alpha test of a material passes.
    pub(crate) fn is_opaque(&self, material: usize) -> bool {
        self.are_opaque.get(material).copied().unwrap_or(false)
    }

    /// Appends words if there is room, and returns the first one's index.
    fn add(&mut self, words: &[u32]) -> Option<u32> {
        let begin = self.words.len().next_multiple_of(ALIGNMENT);
        if (begin + words.len()) * size_of::<u32>() > MAX_BYTES {
            return None;
        }
        self.words.resize(begin, 0);
        self.words.extend_from_slice(words);
        u32::try_from(begin).ok()
    }
}

/// A mask that a material needs for one image.
struct WantedMask {
    key: MaskKey,
    query: OpacityQuery,
    image: Arc<TextureImage>,
}

/// The masks that a material needs.
#[derive(Default)]
struct AllWanted {
    /// The image is a UDIM set.
    is_set: bool,
    /// With the index of the UDIM tile; 0 for a single image.
    parts: Vec<(usize, WantedMask)>,
    /// Another UDIM tile has no mask.
    lacks_part: bool,
}

/// Lays the masks out in one array, each once.
struct MaskPlacer<'a> {
    masks: OpacityMasks,
    made: &'a MadeMasks,
    first_words: FxHashMap<MaskKey, Option<u32>>,
    sets: FxHashMap<Vec<(usize, MaskKey)>, Option<u32>>,
}

impl TextureCache {
    /// The masks of the materials of a snapshot whose textures [`Self::sync`] has loaded. Keeps the masks for the next
    /// snapshot.
    pub(crate) fn opacity_masks(&mut self, surfaces: &SurfaceTables, records: &[GpuTexture]) -> Arc<OpacityMasks> {
        let mut wanted: Vec<AllWanted> =
            surfaces.materials.iter().map(|material| self.masks_of(material, surfaces, records)).collect();
        let side = longest_side(&wanted);
        wanted.iter_mut().flat_map(|wanted| &mut wanted.parts).for_each(|(_, wanted)| wanted.key.side = side);
        let all = || wanted.iter().flat_map(|wanted| &wanted.parts).map(|(_, wanted)| wanted);
        let mut made = std::mem::take(&mut self.masks);
        let missing: FxHashMap<MaskKey, &WantedMask> =
            all().filter(|w| !made.contains_key(&w.key)).map(|w| (w.key, w)).collect();
        let new: Vec<_> = missing.into_par_iter().map(|(key, wanted)| (key, build(wanted).map(Arc::new))).collect();
        made.extend(new);
        let (masks, first_words, sets) = (OpacityMasks::default(), FxHashMap::default(), FxHashMap::default());
        let mut placer = MaskPlacer { masks, made: &made, first_words, sets };
        for (material, wanted) in surfaces.materials.iter().zip(&wanted) {
            placer.place(material, wanted, not_native(material, records));
        }
        let masks = placer.masks;
        let keys: FxHashSet<MaskKey> = all().map(|wanted| wanted.key).collect();
        made.retain(|key, _| keys.contains(key));
        self.masks = made;
        Arc::new(masks)
    }

    /// The masks that a material needs; none if its opacity is no texture.
    fn masks_of(&self, material: &Material, surfaces: &SurfaceTables, records: &[GpuTexture]) -> AllWanted {
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
        let mut masks = AllWanted { is_set, ..none };
        for (part, record) in records.iter().skip(first as usize).take(count as usize).enumerate() {
            let member = if is_set { u32::try_from(1001 + part).unwrap_or(0) } else { 0 };
            match self.mask_of(material, file, member, record) {
                Some(wanted) => masks.parts.push((part, wanted)),
                None => masks.lacks_part |= record.levels > 0,
            }
        }
        masks
    }

    /// The mask that a material needs for an image; none if the image is one whose alpha test reads the texture. The
    /// side is set later, when all masks are known.
    fn mask_of(&self, material: &Material, file: &TextureRef, member: u32, record: &GpuTexture) -> Option<WantedMask> {
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
        let bits = [scale, bias, threshold, outside].map(f32::to_bits);
        let key = MaskKey { image: image.id(), channel, wrap: modes, side: 0, query: bits };
        Some(WantedMask { key, query, image })
    }
}

/// The longest side of [`MAX_SIDES`] for which all masks fit, else the shortest one.
fn longest_side(wanted: &[AllWanted]) -> u32 {
    let images = wanted.iter().flat_map(|wanted| &wanted.parts).map(|(_, wanted)| (wanted.key, wanted.image.layout()));
    let layouts: FxHashMap<MaskKey, _> = images.collect();
    // Each mask may be a UDIM set of one, and needs padding.
    let overhead = size_of::<u32>() * (SET_WORDS + ALIGNMENT);
    let bytes = |side: u32| layouts.values().map(|layout| mask_bytes(layout, side) + overhead).sum::<usize>();
    let fitting = MAX_SIDES.into_iter().find(|(side, limit)| bytes(*side) <= *limit);
    fitting.unwrap_or(MAX_SIDES[MAX_SIDES.len() - 1]).0
}

impl MaskPlacer<'_> {
    /// Adds the next material. Its masks share words with those of other materials.
    fn place(&mut self, material: &Material, wanted: &AllWanted, not_native: Option<&'static str>) {
        let single = wanted.parts.first().filter(|_| !wanted.is_set).map(|(_, wanted)| wanted.key);
        let is_opaque = single.and_then(|key| self.made.get(&key)?.as_ref()).is_some_and(|mask| mask.is_opaque);
        let first = match single {
            _ if is_opaque => None,
            None => self.place_set(wanted.parts.iter().map(|(part, wanted)| (*part, wanted.key)).collect()),
            Some(key) => self.place_mask(key),
        };
        if material.flags.contains(MaterialFlags::PRESENCE) && !is_opaque {
            self.masks.has_cutouts = true;
            self.masks.alpha_tested += 1;
            self.masks.unmasked += usize::from(first.is_none() || wanted.lacks_part);
            self.masks.not_native = self.masks.not_native.or(not_native);
        }
        self.masks.first_words.push(first);
        self.masks.are_opaque.push(is_opaque);
    }

    /// Adds a mask unless it is there already, and returns its first word; none if it does not exist or does not fit.
    fn place_mask(&mut self, key: MaskKey) -> Option<u32> {
        if let Some(first) = self.first_words.get(&key) {
            return *first;
        }
        let first = self.made.get(&key).and_then(Option::as_ref).and_then(|mask| self.masks.add(&mask.words));
        self.first_words.insert(key, first);
        first
    }

    /// Adds a UDIM set and its masks, and returns the first word of its record, which has an offset for each tile.
    /// None for no tiles, and where the record does not fit.
    fn place_set(&mut self, keys: Vec<(usize, MaskKey)>) -> Option<u32> {
        if keys.is_empty() {
            return None;
        }
        if let Some(first) = self.sets.get(&keys) {
            return *first;
        }
        let mut words = vec![0; SET_WORDS];
        words[1] = abi::MASK_SET;
        let first = self.masks.add(&words);
        // Without a record nothing would find its masks.
        for (set, (part, key)) in first.into_iter().flat_map(|set| keys.iter().map(move |key| (set, key))) {
            let Some(first) = self.place_mask(*key) else { continue };
            // Negative for a mask that another material has placed before.
            let offset = (i64::from(first) - i64::from(set)) / i64::try_from(ALIGNMENT).unwrap_or(1);
            let at = set as usize + 2 + part;
            if let (Some(word), Ok(offset)) = (self.masks.words.get_mut(at), i32::try_from(offset)) {
                *word = offset.cast_unsigned();
            }
        }
        self.sets.insert(keys, first);
        first
    }
}

/// The kind of a material's cutouts if native traversal does not support it: Ptex, and floats through the sRGB curve,
/// which is a function of the device.
fn not_native(material: &Material, records: &[GpuTexture]) -> Option<&'static str> {
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

/// Builds a mask from level 0 of its image; none if the image cannot be read.
fn build(wanted: &WantedMask) -> Option<OpacityMask> {
    let WantedMask { key: MaskKey { channel, side, .. }, query, image } = wanted;
    let mut maker = OpacityMaskMaker::new(image.layout(), query, *side)?;
    // Announces that the whole level will be read.
    image.expect(image.layout().first_tile(0));
    // An error is not shown here: the cache of tiles shows it when it reads the image.
    read_channel_by_bands(image, 0, *channel, &mut |band| maker.push(band))
        .map_err(|error| tracing::debug!("no opacity mask: {error}"))
        .ok()?;
    maker.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_whose_record_does_not_fit_leaves_no_masks() {
        let key = MaskKey { image: 1, channel: 0, wrap: [0; 2], side: 32, query: [0; 4] };
        let mask = OpacityMask { words: vec![7; 2 * ALIGNMENT], is_opaque: false };
        let made = MadeMasks::from_iter([(key, Some(Arc::new(mask)))]);
        let free_words = 3 * ALIGNMENT;
        assert!(free_words < SET_WORDS, "room for the mask alone");
        let masks = OpacityMasks { words: vec![0; MAX_BYTES / 4 - free_words], ..OpacityMasks::default() };
        let (first_words, sets) = (FxHashMap::default(), FxHashMap::default());
        let mut placer = MaskPlacer { masks, made: &made, first_words, sets };
        assert_eq!(placer.place_set(vec![(0, key)]), None);
        assert_eq!(placer.masks.words.len(), MAX_BYTES / 4 - free_words, "nothing would read it");
        assert!(placer.place_mask(key).is_some(), "another material may have it");
    }
}
