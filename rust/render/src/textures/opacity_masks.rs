// SPDX-License-Identifier: Apache-2.0
//! The masks of a snapshot's cutouts: what is known of them without their textures
//! (`oocpt_core::texture::OpacityMask`).
//!
//! The levels that a mask is made of are read once, when a scene has it first, through the cache that tiles come from.
//! What has no mask is asked of the texture: sets of files, Ptex, programs, images that cannot be read, and whatever
//! would go beyond [`MOST_BYTES`]. Render thread; reads on all cores.

use super::heights::read_channel;
use super::set::TextureCache;
use super::tiles::TextureImage;
use oocpt_core::material::{Input, InputName, Material, MaterialFlags, PTEX_SET_ID};
use oocpt_core::scene::SurfaceTables;
use oocpt_core::texture::{OpacityMask, OpacityQuery, TexelFormat, Wrap, first_pair};
use oocpt_shader_abi as abi;
use oocpt_shader_abi::GpuTexture;
use rayon::prelude::*;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Of all masks of a scene: they are always resident.
const MOST_BYTES: usize = 64 << 20;

/// Share of what rays ask of cutouts that masks may not know, for the rest to be looked up in passes of its own: a ray
/// that comes to it twice is walked again.
const MOST_UNKNOWN: f32 = 0.25;

/// Image, channel, wrap modes, and the bits of scale, bias and threshold.
type MaskKey = (u64, u8, [u32; 2], [u32; 3]);

/// Masks that were made; `None`: there is none.
pub(super) type MadeMasks = FxHashMap<MaskKey, Option<Arc<OpacityMask>>>;

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct OpacityMasks {
    /// All masks, each from a multiple of 16 bytes on.
    pub(crate) words: Vec<u32>,
    /// By material: the first word of its mask.
    first_words: Vec<Option<u32>>,
    /// By material: its surfaces are there everywhere.
    are_opaque: Vec<bool>,
    /// Whether some material has to be asked.
    pub(crate) has_cutouts: bool,
    /// Materials that have to be asked, and the sum of the shares of their cells that say nothing; 1 without a mask.
    asked: u32,
    unknown: f32,
    /// What of them only the shaders look up, in words.
    pub(crate) of_shaders: Option<&'static str>,
}

impl OpacityMasks {
    /// The first word of a material's mask.
    pub(crate) fn first_word(&self, material: usize) -> Option<u32> {
        self.first_words.get(material).copied().flatten()
    }

    /// Whether masks know most of what rays ask, each material and each width taken as likely.
    pub(crate) fn know_most(&self) -> bool {
        #[expect(clippy::cast_precision_loss, reason = "a share")]
        let asked = self.asked as f32;
        !self.words.is_empty() && self.unknown <= MOST_UNKNOWN * asked
    }

    /// Whether a material's surfaces are there, whatever it says of opacity.
    pub(crate) fn is_opaque(&self, material: usize) -> bool {
        self.are_opaque.get(material).copied().unwrap_or(false)
    }
}

/// A mask that a material wants.
struct Wanted {
    key: MaskKey,
    query: OpacityQuery,
    image: Arc<TextureImage>,
}

impl TextureCache {
    /// The masks of the materials of a snapshot, of which [`Self::sync`] has the textures.
    pub(crate) fn opacity_masks(&mut self, surfaces: &SurfaceTables, records: &[GpuTexture]) -> Arc<OpacityMasks> {
        let wanted: Vec<Option<Wanted>> =
            surfaces.materials.iter().map(|material| self.wanted(material, surfaces, records)).collect();
        let mut made = std::mem::take(&mut self.masks);
        let missing: FxHashMap<MaskKey, &Wanted> =
            wanted.iter().flatten().filter(|w| !made.contains_key(&w.key)).map(|w| (w.key, w)).collect();
        let new: Vec<_> = missing.into_par_iter().map(|(key, wanted)| (key, make(wanted).map(Arc::new))).collect();
        made.extend(new);
        let mut masks = OpacityMasks::default();
        let mut first_words: FxHashMap<MaskKey, u32> = FxHashMap::default();
        for (material, wanted) in surfaces.materials.iter().zip(&wanted) {
            let mask = wanted.as_ref().and_then(|wanted| Some((wanted.key, made.get(&wanted.key)?.as_ref()?)));
            let is_opaque = mask.is_some_and(|(_, mask)| mask.is_opaque);
            let first = mask.filter(|_| !is_opaque).and_then(|(key, mask)| {
                if let Some(first) = first_words.get(&key) {
                    return Some(*first);
                }
                let begin = masks.words.len().next_multiple_of(4);
                if (begin + mask.words.len()) * size_of::<u32>() > MOST_BYTES {
                    return None;
                }
                masks.words.resize(begin, 0);
                masks.words.extend_from_slice(&mask.words);
                let begin = u32::try_from(begin).ok()?;
                first_words.insert(key, begin);
                Some(begin)
            });
            let is_asked = material.flags.contains(MaterialFlags::PRESENCE) && !is_opaque;
            masks.has_cutouts |= is_asked;
            if is_asked {
                masks.asked += 1;
                masks.unknown += mask.filter(|_| first.is_some()).map_or(1.0, |(_, mask)| mask.unknown);
            }
            masks.of_shaders = masks.of_shaders.or(only_shaders(material, records).filter(|_| is_asked));
            masks.first_words.push(first);
            masks.are_opaque.push(is_opaque);
        }
        let keys: rustc_hash::FxHashSet<MaskKey> = wanted.iter().flatten().map(|wanted| wanted.key).collect();
        made.retain(|key, _| keys.contains(key));
        self.masks = made;
        Arc::new(masks)
    }

    /// What mask a material wants; none where its cutouts are no plain texture.
    fn wanted(&self, material: &Material, surfaces: &SurfaceTables, records: &[GpuTexture]) -> Option<Wanted> {
        if !material.flags.contains(MaterialFlags::PRESENCE) {
            return None;
        }
        let Input::Texture { texture, channel, scale, bias, uv: Some(set), .. } = *material.input(InputName::Opacity)
        else {
            return None;
        };
        let record = records.get(texture as usize)?;
        let has_set = material.uv_sets.get(usize::from(set)).is_some_and(|set| set.id != PTEX_SET_ID);
        let is_plain = record.levels > 0 && record.flags & (abi::TEXTURE_UDIM | abi::TEXTURE_PTEX) == 0;
        if !has_set || !is_plain {
            return None;
        }
        let image = self.image(surfaces.textures.get(texture as usize)?)?;
        // The curve of floats is worked out by the device, which may round otherwise.
        if image.is_srgb() && image.info().format != TexelFormat::U8 {
            return None;
        }
        let channel = channel.unwrap_or(0) & 3;
        let (scale, bias) = (scale[usize::from(channel)], bias[usize::from(channel)]);
        let modes = [abi::TEXTURE_WRAP_S_SHIFT, abi::TEXTURE_WRAP_T_SHIFT].map(|shift| record.flags >> shift & 3);
        // Masks know black around an image, and nothing else.
        if record.flags & abi::TEXTURE_BORDER != 0 && modes.contains(&abi::WRAP_BLACK) {
            return None;
        }
        let threshold = material.opacity_threshold;
        let query = OpacityQuery { wrap: modes.map(wrap_of), scale, bias, threshold };
        let key = (image.id(), channel, modes, [scale, bias, threshold].map(f32::to_bits));
        Some(Wanted { key, query, image })
    }
}

/// What of a material's opacity native traversal does not look up, in words: Ptex, and floats through the sRGB curve,
/// which is the device's own function.
fn only_shaders(material: &Material, records: &[GpuTexture]) -> Option<&'static str> {
    let Input::Texture { texture, channel, .. } = *material.input(InputName::Opacity) else { return None };
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

fn make(wanted: &Wanted) -> Option<OpacityMask> {
    let Wanted { key: (_, channel, ..), query, image } = wanted;
    let layout = image.layout();
    let first = first_pair(layout);
    // Said first: one decoding serves all levels.
    image.expect(layout.first_tile(first));
    let values: Result<Vec<_>, _> =
        (first..layout.levels()).map(|level| read_channel(image, level, *channel)).collect();
    // Whoever looks at its tiles tells what is wrong with it.
    let values = values.map_err(|error| tracing::debug!("no opacity mask: {error}")).ok()?;
    OpacityMask::new(layout, &values, query)
}
