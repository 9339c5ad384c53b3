// SPDX-License-Identifier: Apache-2.0
//! Cryptomatte (Friedman and Jones 2015, specification 1.2.0): the objects, materials or assets in each pixel by the
//! hashes of their names, with their shares, and the names of those hashes. Pure.

use crate::job::product::{CryptomatteKind, MatteLayer};
use oocpt_abi::{ID_RANKS, IdSlot};
use oocpt_core::scene::PrimNames;
use rayon::prelude::*;
use rustc_hash::{FxHashMap, FxHashSet};

/// Channels of a pixel: a hash and a share for each rank.
pub(super) const CHANNELS: usize = 2 * ID_RANKS as usize;
/// Most names of a manifest: readers load it with the header.
const MAX_NAMES: usize = 1 << 16;
/// Most characters of a name that a primvar gives.
const MAX_TEXT: usize = 1024;

/// The channels of a Cryptomatte layer, and what its header says.
#[derive(Debug)]
pub(super) struct CryptomatteLayer {
    /// [`CHANNELS`] of each pixel.
    pub(super) pixels: Vec<f32>,
    /// Names and values of attributes.
    pub(super) attributes: Vec<(String, String)>,
    /// Names that the manifest has no room for.
    pub(super) unnamed: usize,
}

/// `MurmurHash3_x86_32` with seed 0 (Appleby, public domain).
fn murmur3(text: &[u8]) -> u32 {
    const C: [u32; 2] = [0xcc9e_2d51, 0x1b87_3593];
    let mixed = |k: u32| k.wrapping_mul(C[0]).rotate_left(15).wrapping_mul(C[1]);
    let (blocks, tail) = text.as_chunks::<4>();
    let mut hash = blocks.iter().fold(0_u32, |hash, block| {
        (hash ^ mixed(u32::from_le_bytes(*block))).rotate_left(13).wrapping_mul(5).wrapping_add(0xe654_6b64)
    });
    if !tail.is_empty() {
        hash ^= mixed(tail.iter().rev().fold(0, |k, byte| k << 8 | u32::from(*byte)));
    }
    #[expect(clippy::cast_possible_truncation, reason = "the hash takes the length modulo 2^32")]
    let length = text.len() as u32;
    hash ^= length;
    hash = (hash ^ hash >> 16).wrapping_mul(0x85eb_ca6b);
    hash = (hash ^ hash >> 13).wrapping_mul(0xc2b2_ae35);
    hash ^ hash >> 16
}

/// The hash of a name as it is stored: no bits of a zero, a denormal number, an infinity or a NaN.
fn id_of(name: &str) -> u32 {
    let hash = murmur3(name.as_bytes());
    let exponent = hash >> 23 & 255;
    if exponent == 0 || exponent == 255 { hash ^ 1 << 23 } else { hash }
}

/// The name of what a slot is of.
fn name_of(layer: &MatteLayer, names: &PrimNames, slot: &IdSlot) -> Option<String> {
    let number = slot.id.checked_sub(1)?;
    let prim = || i32::try_from(number).ok();
    let text = layer.naming.as_ref().and_then(|naming| names.text(prim()?, slot.instance, naming));
    if let Some(text) = text {
        return Some(text.chars().take(MAX_TEXT).collect());
    }
    match layer.kind {
        CryptomatteKind::Object => names.object(prim()?, slot.instance),
        CryptomatteKind::Asset => names.asset(prim()?, slot.instance),
        CryptomatteKind::Material => names.material(number).map(str::to_owned),
    }
}

/// What an image shows, by the hashes of names.
#[derive(Debug, Default)]
pub(super) struct NamedThings {
    /// Hashes by the two words of ids.
    pub(super) ids: FxHashMap<(u32, u32), u32>,
    /// Names and values of attributes of the layer.
    pub(super) attributes: Vec<(String, String)>,
    /// Names that the manifest has no room for.
    pub(super) unnamed: usize,
}

/// The names of what a layer shows, of which some ids may be 0, nothing.
pub(super) fn named(layer: &MatteLayer, names: &PrimNames, seen: FxHashSet<(u32, u32)>) -> NamedThings {
    let mut seen: Vec<(u32, u32)> = seen.into_iter().collect();
    seen.sort_unstable();
    let named = seen.par_iter().filter_map(|&(id, instance)| {
        let name = name_of(layer, names, &IdSlot { id, instance, weight: 0.0 })?;
        Some(((id, instance), id_of(&name), name))
    });
    let named: Vec<_> = named.collect();
    let ids: FxHashMap<(u32, u32), u32> = named.iter().map(|(key, id, _)| (*key, *id)).collect();
    let mut manifest: Vec<(String, u32)> = named.into_iter().map(|(_, id, name)| (name, id)).collect();
    manifest.sort_unstable();
    manifest.dedup();
    let unnamed = manifest.len().saturating_sub(MAX_NAMES);
    manifest.truncate(MAX_NAMES);
    NamedThings { ids, attributes: attributes(&layer.name, &manifest), unnamed }
}

/// The layer of the slots of an image, [`ID_RANKS`] a pixel.
pub(super) fn layer(layer: &MatteLayer, names: &PrimNames, slots: &[IdSlot]) -> CryptomatteLayer {
    let seen = slots.iter().filter(|slot| slot.id != 0).map(|slot| (slot.id, slot.instance)).collect();
    let NamedThings { ids, attributes, unnamed } = named(layer, names, seen);
    let mut pixels = vec![0.0; slots.len() / ID_RANKS as usize * CHANNELS];
    let by_pixel = pixels.par_chunks_exact_mut(CHANNELS).zip(slots.par_chunks_exact(ID_RANKS as usize));
    by_pixel.for_each(|(out, slots)| rank(out, slots, &ids));
    CryptomatteLayer { pixels, attributes, unnamed }
}

/// Hashes and shares of a pixel, those of the same name together, largest first.
fn rank(out: &mut [f32], slots: &[IdSlot], ids: &FxHashMap<(u32, u32), u32>) {
    let mut shares: Vec<(u32, f32)> = Vec::with_capacity(slots.len());
    for slot in slots {
        let Some(&id) = ids.get(&(slot.id, slot.instance)) else { continue };
        match shares.iter_mut().find(|(have, _)| *have == id) {
            Some((_, share)) => *share += slot.weight,
            None => shares.push((id, slot.weight)),
        }
    }
    shares.sort_by(|a, b| b.1.total_cmp(&a.1).then(a.0.cmp(&b.0)));
    for (out, (id, share)) in out.chunks_exact_mut(2).zip(shares) {
        out.copy_from_slice(&[f32::from_bits(id), share]);
    }
}

/// What the header says of the layer.
fn attributes(name: &str, manifest: &[(String, u32)]) -> Vec<(String, String)> {
    let key = format!("{:08x}", murmur3(name.as_bytes()));
    let of = |what: &str, value: &str| (format!("cryptomatte/{}/{what}", &key[..7]), value.to_owned());
    vec![
        of("name", name),
        of("hash", "MurmurHash3_32"),
        of("conversion", "uint32_to_float32"),
        of("manifest", &manifest_of(manifest)),
    ]
}

/// The names with their hashes, as JSON.
fn manifest_of(names: &[(String, u32)]) -> String {
    // A name is always text.
    let quoted = |name: &str| serde_json::to_string(name).unwrap_or_default();
    let entries: Vec<String> = names.iter().map(|(name, id)| format!("{}:\"{id:08x}\"", quoted(name))).collect();
    format!("{{{}}}", entries.join(","))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_murmurs() {
        // Vectors of the reference implementation (SMHasher) and of the specification.
        for (text, hash) in [("", 0), ("a", 0x3c25_69b2), ("abc", 0xb3dd_93fa), ("hello", 0x248b_fa47)] {
            assert_eq!(murmur3(text.as_bytes()), hash, "{text}");
        }
        assert_eq!(murmur3(b"The quick brown fox jumps over the lazy dog"), 0x2e4f_f723);
    }

    #[test]
    fn no_hash_is_a_zero_a_denormal_or_no_number() {
        let names = (0..20_000).map(|number| format!("/name{number}"));
        let changed = names.filter(|name| id_of(name) != murmur3(name.as_bytes()));
        for name in changed.collect::<Vec<_>>() {
            assert!(f32::from_bits(id_of(&name)).is_normal(), "{name}");
        }
        assert!((0..20_000).all(|number| f32::from_bits(id_of(&format!("/name{number}"))).is_normal()));
    }

    #[test]
    fn shares_of_one_name_are_one_and_largest_first() {
        let slot = |id, instance, weight| IdSlot { id, instance, weight };
        let slots = [slot(5, 0, 0.4), slot(6, 0, 0.3), slot(5, 1, 0.2), slot(9, 9, 0.1), IdSlot::default()];
        let ids = [((5, 0), 100), ((5, 1), 300), ((6, 0), 300)].into_iter().collect();
        let mut out = [0.0; CHANNELS];
        rank(&mut out, &slots, &ids);
        let expected = [f32::from_bits(300), 0.3 + 0.2, f32::from_bits(100), 0.4, 0.0, 0.0];
        assert_eq!(out[..6], expected, "what has no name is left out");
    }

    #[test]
    fn names_of_strangers_are_json() {
        let text = manifest_of(&[("a\"b\\\u{7}".into(), 0x12), ("/\u{e9}".into(), u32::MAX)]);
        let read: std::collections::BTreeMap<String, String> = serde_json::from_str(&text).expect("JSON");
        assert_eq!(read.get("a\"b\\\u{7}").map(String::as_str), Some("00000012"));
        assert_eq!(read.get("/\u{e9}").map(String::as_str), Some("ffffffff"));
        assert_eq!(manifest_of(&[]), "{}");
    }
}
