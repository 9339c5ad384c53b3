// SPDX-License-Identifier: Apache-2.0
//! Flags and words that passes share among themselves and with native traversal, and those of materials: the state of a
//! ray and of a path, references to nodes.
//!
//! Guarantees: numbers only. Any thread.

use super::{Features, FrameFlags, LightFlags, MaterialInput, MeshFlags, PatternGeometry, PatternOp, PushFlags};
use bitflags::{Flags, bitflags};

bitflags! {
    /// Flags in `Ray::flags` and `ShadowRay::flags`, with streaming; [`pack_waiting`] adds the length of the pending
    /// list. 0 for a ray not yet traced.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct RayFlags: u32 {
        /// The pending list is valid.
        const WAITED = 1;
        /// The hit record is valid.
        const HIT = 2;
        /// There are more absent chunk instances than the list holds.
        const MORE = 4;
        /// The hit was found in this round.
        const CHANGED = 8;
        /// The deferred alpha test is valid; cutouts.
        const ASKED = 128;
        /// Roulette has ended the ray: it continues only to report it.
        const ENDED = 256;
    }
}

/// Position of the length of the pending list in `Ray::flags`, three bits.
pub const RAY_COUNT_SHIFT: u32 = 4;

/// Packs `Ray::flags` of a ray that waits for `count` units of its pending list (at most 7) or, with `more`, for others
/// too; 0 for a ray that waits for none. As `pack_waiting` of the shaders.
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

/// Length of the pending list in `Ray::flags`. As `waiting_count` of the shaders.
#[must_use]
pub const fn waiting_count(flags: u32) -> u32 {
    (flags >> RAY_COUNT_SHIFT) & 7
}

bitflags! {
    /// Progress of the rays of a path (`StreamingPointers::progress`).
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct PathProgress: u32 {
        /// The shadow ray has finished, or there is none.
        const SHADOW_DONE = 1;
        /// The closest ray has finished, or there is none.
        const CLOSEST_DONE = 2;
        /// The closest ray met a surface.
        const CLOSEST_HIT = 4;
        /// There is no closest ray: the path ends with its shadow ray.
        const PATH_ENDS = 8;
    }
}

/// Position in `ShadowRay::bounce` of the category of the prims that block the ray, with `Features::LIGHT_LINKS`.
pub const SHADOW_LINK_SHIFT: u32 = 16;

/// Bounce and category of `ShadowRay::bounce`, with `Features::LIGHT_LINKS`. As `shadow_bounce` and `shadow_link` of
/// the shaders.
#[must_use]
pub const fn unpack_shadow_bounce(word: u32) -> (u32, u32) {
    (word & ((1 << SHADOW_LINK_SHIFT) - 1), word >> SHADOW_LINK_SHIFT)
}

/// References of a walk: an inner node, or [`LEAF`] | (count - 1) << 28 | first, or [`ASK`], [`RETURN`], [`DONE`].
pub const LEAF: u32 = 1 << 31;
/// Bit of a chunk instance, which never shares a leaf with others: it comes from the list of pending ones.
pub const LISTED: u32 = 1 << 28;
/// Entry of a candidate whose cutout has to be looked up; never on the stack.
pub const ASK: u32 = 0xffff_fffd;
/// Entry of a stack that returns to the parent level.
pub const RETURN: u32 = 0xffff_fffe;
/// Entry of a stack that ends the walk.
pub const DONE: u32 = 0xffff_ffff;
/// Reference of an absent child.
pub const ABSENT: u32 = 0xffff_ffff;

bitflags! {
    /// What a prim does without, 8 bits by prim id + 1 in `FrameConstants::prim_masks`: the kinds of rays that pass
    /// through it, and what the camera sees of it. None is a prim as all others are.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
    pub struct PrimMask: u32 {
        /// Camera rays pass.
        const NO_CAMERA = 1;
        /// Shadow rays pass.
        const NO_SHADOW = 2;
        /// Rays that a diffuse lobe has reflected pass.
        const NO_DIFFUSE = 4;
        /// Rays that another lobe has reflected pass.
        const NO_REFLECTION = 8;
        /// Rays that went through the surface before pass.
        const NO_TRANSMISSION = 16;
        /// Camera rays end there as if there were nothing, whatever is behind it.
        const MATTE = 32;
        /// Camera rays end there and see the shadow alone that it receives, as alpha; a matte is a matte first.
        const SHADOW_CATCHER = 64;
    }
}

impl PrimMask {
    /// The bits of rays that have left a surface, but for shadow rays.
    pub const INDIRECT: Self = Self::NO_DIFFUSE.union(Self::NO_REFLECTION).union(Self::NO_TRANSMISSION);

    /// Returns true if shadow rays and some other rays that leave surfaces do not see the same of the prim.
    #[must_use]
    pub fn parts_shadows(self) -> bool {
        let (shadow, indirect) = (self.contains(Self::NO_SHADOW), self & Self::INDIRECT);
        if shadow { indirect != Self::INDIRECT } else { !indirect.is_empty() }
    }
}

/// Position in `Ray::bounce` of the bit of [`PrimMask`] that lets the ray pass, with `Features::PRIM_MASKS`; 0 there: a
/// camera ray.
pub const RAY_KIND_SHIFT: u32 = 16;

/// Bounce of `Ray::bounce`, and the bit that lets the ray pass, with `Features::PRIM_MASKS`. As `ray_bounce` and
/// `passing_bit` of the shaders.
#[must_use]
pub const fn unpack_ray_bounce(word: u32) -> (u32, u32) {
    let bit = word >> RAY_KIND_SHIFT;
    (word & ((1 << RAY_KIND_SHIFT) - 1), if bit == 0 { PrimMask::NO_CAMERA.bits() } else { bit })
}

macro_rules! material_flags {
    ($($(#[doc = $doc:literal])+ $name:ident: [$($feature:ident)?];)+) => {
        #[expect(non_camel_case_types, clippy::upper_case_acronyms, reason = "names of constants")]
        enum MaterialBit {
            $($name,)+
        }

        bitflags! {
            /// Features of a material: `GpuMaterial::flags`.
            #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
            pub struct MaterialFlags: u32 {
                $($(#[doc = $doc])+ const $name = 1 << (MaterialBit::$name as u32);)+
            }
        }

        impl MaterialFlags {
            /// The features that the passes need for materials with these flags.
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
    /// Opacity decides if the surface exists, in traversal (`opacityThreshold` or `opacityMode` presence).
    PRESENCE: [CUTOUTS];
    /// The part that opacity leaves is transmitted.
    TRANSMISSIVE: [TRANSMISSION];
    /// It emits light.
    EMISSIVE: [EMISSION];
    /// It has a clearcoat.
    COAT: [COAT];
    /// It has a normal other than (0, 0, 1).
    NORMAL_MAP: [];
    /// It reads a texture.
    TEXTURED: [TEXTURES];
    /// It transmits, somewhere, through a rough surface.
    ROUGH_TRANSMISSION: [ROUGH_TRANSMISSION];
    /// It reads a Ptex texture.
    PTEX: [PTEX];
    /// Glass and coat have inputs of their own, as in `OpenPBR`; opacity decides if the surface exists.
    OPEN_PBR: [OPEN_PBR];
    /// It has fuzz.
    SHEEN: [SHEEN];
    /// Some input is computed by a program.
    PATTERNS: [PATTERNS];
    /// The opacity is computed by a program.
    CUTOUT_PROGRAM: [CUTOUT_PROGRAMS];
    /// Some lobe is anisotropic.
    ANISOTROPIC: [ANISOTROPY];
    /// It has a thin film.
    THIN_FILM: [THIN_FILM];
    /// It absorbs light inside.
    ABSORBING: [ABSORPTION];
    /// It has no inside.
    THIN_WALLED: [THIN_WALLS];
    /// It is a fibre: some inputs have another meaning ([`crate::MaterialInput`]).
    HAIR: [HAIR];
    /// It has a rough diffuse lobe.
    ROUGH_DIFFUSE: [ROUGH_DIFFUSE];
    /// The index of refraction depends on the channel.
    DISPERSIVE: [DISPERSION];
    /// It is chosen from several at random: its program reads random numbers of the hit.
    MIXTURE: [MIXTURES];
    /// Its normal is computed from one in world space, so it is used for meshes without tangents too.
    FRAMED_NORMAL: [];
}

/// Side of a texture tile, texels.
pub const TILE_SIDE: u32 = 128;
/// Largest side of a level that shares a tile with those below, texels.
pub const TAIL_SIDE: u32 = 64;
/// Number of cosines in the energy tables.
pub const TABLE_COSINE: u32 = 64;
/// Number of roughnesses in the energy tables.
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
        .chain(named::<PrimMask>("PRIM_"))
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
    fn a_ray_has_bounce_and_kind() {
        assert_eq!(unpack_ray_bounce(0), (0, PrimMask::NO_CAMERA.bits()), "a camera ray");
        assert_eq!(unpack_ray_bounce(0xffff | 8 << 16), (0xffff, PrimMask::NO_REFLECTION.bits()));
    }

    #[test]
    fn shadows_part_where_some_rays_alone_are_let_through() {
        let all = PrimMask::INDIRECT | PrimMask::NO_SHADOW;
        for same in [PrimMask::empty(), PrimMask::NO_CAMERA, PrimMask::MATTE, all, PrimMask::all()] {
            assert!(!same.parts_shadows(), "{same:?}");
        }
        let parted = [PrimMask::NO_SHADOW, PrimMask::INDIRECT, PrimMask::NO_DIFFUSE, all - PrimMask::NO_REFLECTION];
        assert!(parted.iter().all(|mask| mask.parts_shadows()), "{parted:?}");
    }

    #[test]
    fn flags_of_materials_ask_for_features_of_materials() {
        let of_materials = |feature: Features| {
            let row = FEATURES.iter().find(|row| row.bit == feature).expect("a row");
            let mut needs = row.needs;
            // Rows need only rows above them.
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
