// SPDX-License-Identifier: Apache-2.0
//! Flags and words that passes share among themselves and with native traversal, and those of materials: what a ray
//! waits for, how far a path is, references to nodes.
//!
//! Guarantees: numbers only. Any thread.

use super::{Features, FrameFlags, LightFlags, MaterialInput, MeshFlags, PatternGeometry, PatternOp, PushFlags};
use bitflags::{Flags, bitflags};

bitflags! {
    /// Of `Ray::flags` and `ShadowRay::flags`, with streaming; [`pack_waiting`] adds the length of the pending list. 0
    /// for a ray not yet traced.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct RayFlags: u32 {
        /// The pending list counts.
        const WAITED = 1;
        /// The hit record counts.
        const HIT = 2;
        /// There are more absent chunk instances than the list holds.
        const MORE = 4;
        /// The hit was found in this round.
        const CHANGED = 8;
        /// The question counts; cutouts.
        const ASKED = 128;
        /// Roulette has ended the ray: it goes on only to say so.
        const ENDED = 256;
    }
}

/// Where `Ray::flags` has the length of the pending list, three bits.
pub const RAY_COUNT_SHIFT: u32 = 4;

/// `Ray::flags` of a ray that waits for `count` units of its pending list (at most 7) or, with `more`, for others too;
/// 0 for a ray that waits for none. `pack_waiting` of the shaders.
#[must_use]
pub fn pack_waiting(count: u32, more: bool) -> u32 {
    match count {
        0 => 0,
        count => {
            let more = if more { RayFlags::MORE } else { RayFlags::empty() };
            (RayFlags::WAITED | more).bits() | (count & 7) << RAY_COUNT_SHIFT
        }
    }
}

/// Length of the pending list in `Ray::flags`. `waiting_count` of the shaders.
#[must_use]
pub const fn waiting_count(flags: u32) -> u32 {
    (flags >> RAY_COUNT_SHIFT) & 7
}

bitflags! {
    /// How far the rays of a path are (`StreamingPointers::progress`).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct PathProgress: u32 {
        /// The shadow ray has finished, or there is none.
        const SHADOW_DONE = 1;
        /// The closest ray has finished, or there is none.
        const CLOSEST_DONE = 2;
        /// It met something.
        const CLOSEST_HIT = 4;
        /// No closest ray: the path ends with its shadow ray.
        const PATH_ENDS = 8;
    }
}

/// Where `ShadowRay::bounce` has the category of the prims that are in its way, with `Features::LIGHT_LINKS`.
pub const SHADOW_LINK_SHIFT: u32 = 16;

/// Bounce and category of `ShadowRay::bounce`, with `Features::LIGHT_LINKS`. `shadow_bounce` and `shadow_link` of the
/// shaders.
#[must_use]
pub const fn unpack_shadow_bounce(word: u32) -> (u32, u32) {
    (word & ((1 << SHADOW_LINK_SHIFT) - 1), word >> SHADOW_LINK_SHIFT)
}

/// References of a walk: an inner node, or [`LEAF`] | (count - 1) << 28 | first, or [`ASK`], [`RETURN`], [`DONE`].
pub const LEAF: u32 = 1 << 31;
/// Of a chunk instance, which is never in a leaf with others: from the list of pending ones.
pub const LISTED: u32 = 1 << 28;
/// A candidate waits for its cutout to be looked up; never on the stack.
pub const ASK: u32 = 0xffff_fffd;
/// Back to the parent level.
pub const RETURN: u32 = 0xffff_fffe;
/// The end of the walk.
pub const DONE: u32 = 0xffff_ffff;
/// Reference of a child that is not there.
pub const ABSENT: u32 = 0xffff_ffff;

macro_rules! material_flags {
    ($($(#[doc = $doc:literal])+ $name:ident: [$($feature:ident)?];)+) => {
        #[expect(non_camel_case_types, clippy::upper_case_acronyms, reason = "names of constants")]
        enum MaterialBit {
            $($name,)+
        }

        bitflags! {
            /// What a material needs: `GpuMaterial::flags`.
            #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
            pub struct MaterialFlags: u32 {
                $($(#[doc = $doc])+ const $name = 1 << (MaterialBit::$name as u32);)+
            }
        }

        impl MaterialFlags {
            /// What of the passes materials with these flags need.
            #[must_use]
            pub fn features(self) -> Features {
                let rows = [$((Self::$name, Features::empty()$(.union(Features::$feature))?)),+];
                rows.into_iter().filter(|(flag, _)| self.contains(*flag)).map(|(_, feature)| feature).collect()
            }
        }
    };
}

// A row is a flag, in the order of the bits, and the feature that the passes need for it.
material_flags! {
    /// `specularColor` is the reflectance at normal incidence; else metallic and ior give it.
    SPECULAR_WORKFLOW: [];
    /// Opacity is whether the surface is there, asked for in traversal (`opacityThreshold` or `opacityMode`
    /// presence).
    PRESENCE: [CUTOUTS];
    /// What opacity leaves is transmitted.
    TRANSMISSIVE: [TRANSMISSION];
    /// Emits light.
    EMISSIVE: [EMISSION];
    /// Has a clearcoat.
    COAT: [COAT];
    /// Has a normal other than (0, 0, 1).
    NORMAL_MAP: [];
    /// Reads a texture.
    TEXTURED: [TEXTURES];
    /// What is transmitted is, somewhere, by a rough surface.
    ROUGH_TRANSMISSION: [ROUGH_TRANSMISSION];
    /// Reads a Ptex texture.
    PTEX: [PTEX];
    /// Glass and coat have inputs of their own, as `OpenPBR` has them; opacity is whether the surface is there.
    OPEN_PBR: [OPEN_PBR];
    /// Has fuzz.
    SHEEN: [SHEEN];
    /// Some input is worked out by a program.
    PATTERNS: [PATTERNS];
    /// Opacity is.
    CUTOUT_PROGRAM: [CUTOUT_PROGRAMS];
    /// Some lobe is anisotropic.
    ANISOTROPIC: [ANISOTROPY];
    /// Has a thin film.
    THIN_FILM: [THIN_FILM];
    /// Absorbs light on its way inside.
    ABSORBING: [ABSORPTION];
    /// Has no inside.
    THIN_WALLED: [THIN_WALLS];
    /// Is a fibre: some inputs mean something else ([`crate::MaterialInput`]).
    HAIR: [HAIR];
    /// Has a rough diffuse lobe.
    ROUGH_DIFFUSE: [ROUGH_DIFFUSE];
    /// The index of what transmits depends on the channel.
    DISPERSIVE: [DISPERSION];
    /// Is one of several by chance: its program reads random numbers of the hit.
    MIXTURE: [MIXTURES];
    /// Its normal is worked out from one of the world: it counts where a mesh has no tangents, too.
    FRAMED_NORMAL: [];
}

/// Side of a tile of a texture, texels.
pub const TILE_SIDE: u32 = 128;
/// Largest side of a level that shares a tile with those below, texels.
pub const TAIL_SIDE: u32 = 64;
/// Rows of the energy tables: cosines.
pub const TABLE_COSINE: u32 = 64;
/// Rows of the energy tables: roughnesses.
pub const TABLE_ROUGHNESS: u32 = 48;

/// Name and value of every flag that the build writes for the shaders: `PREFIX_NAME`.
#[must_use]
pub fn flag_constants() -> Vec<(String, u32)> {
    fn named<F: Flags<Bits = u32>>(prefix: &str) -> impl Iterator<Item = (String, u32)> {
        F::FLAGS.iter().map(move |flag| (format!("{prefix}{}", flag.name()), flag.value().bits()))
    }
    named::<FrameFlags>("FLAG_")
        .chain(named::<PushFlags>("PUSH_"))
        .chain(named::<LightFlags>("LIGHT_"))
        .chain(named::<MeshFlags>("MESH_"))
        .chain(named::<RayFlags>("RAY_"))
        .chain(named::<PathProgress>(""))
        .chain(named::<MaterialFlags>("MATERIAL_"))
        .chain(MaterialInput::constants())
        .chain(PatternOp::constants())
        .chain(PatternGeometry::constants())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::FEATURES;

    #[test]
    fn packed_wait_counts_round_trip() {
        for (count, more) in (0..8).flat_map(|count| [(count, false), (count, true)]) {
            let flags = pack_waiting(count, more);
            assert_eq!(waiting_count(flags), count);
            assert_eq!(flags & RayFlags::WAITED.bits() != 0, count != 0);
            assert_eq!(flags & RayFlags::MORE.bits() != 0, more && count != 0, "more than none is none");
            let others = RayFlags::HIT | RayFlags::CHANGED | RayFlags::ASKED | RayFlags::ENDED;
            assert_eq!(flags & others.bits(), 0, "{count} reach into other flags");
        }
    }

    #[test]
    fn a_shadow_ray_has_bounce_and_category() {
        assert_eq!(unpack_shadow_bounce(0xffff), (0xffff, 0));
        assert_eq!(unpack_shadow_bounce(3 | 0xabcd << 16), (3, 0xabcd));
    }

    #[test]
    fn flags_of_materials_ask_for_features_of_materials() {
        let of_materials = |feature: Features| {
            let row = FEATURES.iter().find(|row| row.bit == feature).expect("a row");
            let mut needs = row.needs;
            // Rows need rows above them only.
            for above in FEATURES.iter().rev().filter(|above| above.bit.bits() < feature.bits()) {
                needs |= if needs.contains(above.bit) { above.needs } else { Features::empty() };
            }
            needs.contains(Features::MATERIALS)
        };
        let asking: Vec<_> = MaterialFlags::all().iter().map(MaterialFlags::features).collect();
        assert!(asking.iter().flat_map(Features::iter).all(of_materials), "{asking:?}");
        assert_eq!(asking.iter().filter(|features| features.is_empty()).count(), 3, "the others have one");
        let both = MaterialFlags::COAT | MaterialFlags::NORMAL_MAP | MaterialFlags::HAIR;
        assert_eq!(both.features(), Features::COAT | Features::HAIR);
    }

    #[test]
    fn no_two_constants_share_a_name() {
        let mut names: Vec<String> = flag_constants().into_iter().map(|(name, _)| name).collect();
        names.extend(crate::CONSTANTS.iter().map(|(name, _)| (*name).to_owned()));
        names.sort();
        let twice: Vec<_> = names.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| &pair[0]).collect();
        assert!(twice.is_empty(), "{twice:?}");
    }
}
