// SPDX-License-Identifier: Apache-2.0
//! The table of features that a scene and a frame may need. The passes are compiled without the others.
//!
//! A row is the only declaration of a feature. Its position is its bit; the build writes `HAS_NAME` for the shaders
//! from it, the renderer takes its words for the stats and `oocpt doctor` from it.
//! `rust/render/src/frame/specialise.rs` decides when a frame needs it. Pure, any thread.

use bitflags::bitflags;

/// Specialisation constant: bits 0 to 31 of [`Features`].
pub const SPEC_FEATURES: u32 = 2;
/// Specialisation constant: bits 32 to 63 of [`Features`].
pub const SPEC_FEATURES_HIGH: u32 = 3;
/// Specialisation constant: bits 64 to 95 of [`Features`].
pub const SPEC_FEATURES_TOP: u32 = 5;

/// Whether a feature can be compiled in for a scene that does not need it without changing a bit of the
/// picture, as benches and tests do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CarryRule {
    /// It selects another estimator, or needs memory that only its scenes have.
    Never,
    /// It can be compiled in for every scene.
    Always,
    /// It can be compiled in for scenes whose light table allows it.
    Lights,
    /// It can be compiled in for scenes with materials.
    Materials,
    /// It can be compiled in for scenes with materials that are resident as a whole.
    MaterialsInCore,
}

/// A row of [`FEATURES`].
#[derive(Debug, Clone, Copy)]
pub struct FeatureRow {
    /// As in `HAS_NAME` of the shaders and in the stats.
    pub name: &'static str,
    /// Bit of the feature.
    pub bit: Features,
    /// Description in words, for the stats.
    pub what: &'static str,
    /// Features without all of which the shaders ignore the bit. They are rows above this one.
    pub needs: Features,
    /// Scenes that it can be compiled in for without need.
    pub carry: CarryRule,
}

macro_rules! features {
    ($(
        $(#[doc = $doc:literal])+
        $(#[cfg($only:meta)])?
        $name:ident: $what:literal, [$($needs:ident),*], $carry:ident;
    )+) => {
        #[expect(non_camel_case_types, clippy::upper_case_acronyms, reason = "names of constants")]
        enum FeatureBit {
            $($(#[cfg($only)])? $name,)+
        }

        bitflags! {
            /// The features that the scene and the frame need; the passes are compiled without the rest (specialisation
            /// constants from [`SPEC_FEATURES`] to [`SPEC_FEATURES_TOP`]).
            #[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
            pub struct Features: u128 {
                $($(#[doc = $doc])+ $(#[cfg($only)])? const $name = 1 << (FeatureBit::$name as u32);)+
            }
        }

        /// Rows of all features, by bit.
        pub const FEATURES: &[FeatureRow] = &[$($(#[cfg($only)])? FeatureRow {
            name: stringify!($name),
            bit: Features::$name,
            what: $what,
            needs: Features::empty()$(.union(Features::$needs))*,
            carry: CarryRule::$carry,
        },)+];
    };
}

features! {
    /// There is a dome light.
    DOME: "dome light", [], Always;
    /// There is a distant light.
    DISTANT: "distant lights", [], Always;
    /// Some mesh has opacities: traversal decides per hit, stochastically.
    OPACITY: "opacity in traversal", [], Always;
    /// Some mesh has normals to interpolate; without it all shading is flat.
    NORMALS: "interpolated normals", [], Always;
    /// Some mesh has colours; without it every surface is `FrameConstants::default_albedo`.
    COLORS: "colours", [], Always;
    /// The camera has an open lens: `lens_u`, `lens_v`, `focus` are used.
    LENS: "lens", [], Always;
    /// Some instance record points to an assembly (needed when `MAX_LEVELS` > 1).
    INSTANCING: "nested instance levels", [], Always;
    /// Some dome has no texture: shadow rays towards it are sampled by the BSDF.
    DOME_SHADOW_RAYS: "shadow rays to constant domes", [DOME], Never;
    /// Chunks may be absent: rays wait for them, paths are in segments. `FrameConstants::streaming` is used.
    STREAMING: "streaming of what does not fit", [], Never;
    /// `StreamingPointers::unit_rays` counts the rays that entered each chunk and mesh.
    CHUNK_COUNTS: "counts of rays by chunk and mesh", [STREAMING], Never;
    /// Rays that wait for a load that is too expensive for their contribution may end (`StreamingPointers::roulette`).
    ROULETTE: "roulette on loads for stragglers", [STREAMING], Never;
    /// Some mesh has a material: `FrameConstants::materials`, `prims` and `material_slots` are used.
    MATERIALS: "materials, and tables of them", [], Never;
    /// Some material reads a texture: `FrameConstants::textures` and `texture_pages` are used.
    TEXTURES: "textures, and ray cones for them", [MATERIALS], MaterialsInCore;
    /// Some texture is Ptex.
    PTEX: "Ptex", [TEXTURES], MaterialsInCore;
    /// Some material's opacity has to be evaluated in traversal.
    CUTOUTS: "cutouts in traversal", [MATERIALS], MaterialsInCore;
    /// Some material lets light through.
    TRANSMISSION: "transmission", [MATERIALS], Materials;
    /// Some material lets light through a rough surface.
    ROUGH_TRANSMISSION: "rough transmission, and tables of what it loses", [TRANSMISSION], Materials;
    /// Some material has a coat.
    COAT: "coats", [MATERIALS], Materials;
    /// Some material is one of `OpenPBR`: glass and coat with inputs of their own.
    OPEN_PBR: "OpenPBR: tinted glass, coats of another index", [MATERIALS], Materials;
    /// `Shading::sheen_color` is used.
    SHEEN: "sheen, and tables of it", [MATERIALS], Never;
    /// Some material has an anisotropic lobe.
    ANISOTROPY: "anisotropy", [OPEN_PBR], Materials;
    /// Some material has a thin film.
    THIN_FILM: "thin films", [OPEN_PBR], Materials;
    /// Some material is a thin wall, without an inside.
    THIN_WALLS: "thin walls", [OPEN_PBR, TRANSMISSION], Materials;
    /// Some material absorbs light inside.
    ABSORPTION: "absorption inside", [OPEN_PBR, TRANSMISSION], Materials;
    /// The index of some glass depends on the channel: a path that meets it continues with one channel.
    DISPERSION: "dispersion of glass", [OPEN_PBR, TRANSMISSION], Materials;
    /// Some material is a fibre's. The choice of local lights then ignores normals, as with `TRANSMISSION`.
    HAIR: "hair", [OPEN_PBR], Never;
    /// Some material has a rough diffuse lobe.
    ROUGH_DIFFUSE: "rough diffuse reflection", [OPEN_PBR], Materials;
    /// Some material has a program: `FrameConstants::programs` is used.
    PATTERNS: "programs of patterns", [MATERIALS], Materials;
    /// Some material is chosen from several at random: programs read random numbers of the hit.
    MIXTURES: "mixtures by chance", [PATTERNS], Materials;
    /// Some material's opacity is computed by a program.
    CUTOUT_PROGRAMS: "cutouts by programs", [CUTOUTS, PATTERNS], MaterialsInCore;
    /// Some cutout by textures has an opacity mask: `GpuMaterial::cutout` is used.
    OPACITY_MASKS: "masks of what is known of cutouts", [CUTOUTS, TEXTURES], Never;
    /// Trace passes ask masks only; rays whose hit the masks cannot decide have passes of their own:
    /// `FrameConstants::settle_queue` is used.
    DEFERRED_CUTOUTS: "cutouts that no mask knows in passes of their own", [OPACITY_MASKS], Never;
    /// Some material emits light.
    EMISSION: "emission of surfaces", [MATERIALS], Materials;
    /// Some primvar has a value per instance: `primvars` of chunks and assemblies, and `FrameConstants::placed_values`,
    /// are used.
    INSTANCE_PRIMVARS: "primvars with a value per instance", [], Always;
    /// Some displayOpacity at instance rate is below 1.
    INSTANCE_OPACITY: "opacity with a value per instance", [INSTANCE_PRIMVARS, OPACITY], Always;
    /// Local lights: rectangles, spheres, disks, cylinders; and the light tree.
    LOCAL_LIGHTS: "local lights and light tree", [], Lights;
    /// Some light is shaped.
    SHAPING: "light shaping", [], Lights;
    /// Some light has an IES profile.
    IES: "IES profiles", [SHAPING], Lights;
    /// The dome has a texture.
    DOME_TEXTURE: "dome textures", [DOME], Lights;
    /// Some local light has a texture.
    LIGHT_TEXTURE: "textures of rect lights", [LOCAL_LIGHTS], Lights;
    /// Some light lights or shadows only some prims.
    LIGHT_LINKS: "light linking", [], Lights;
    /// Some light has one multiplier for diffuse and another for specular reflection.
    LIGHT_LOBES: "lights' own multipliers for diffuse and specular", [], Lights;
    /// Some mesh that emits light is sampled as a light.
    MESH_LIGHTS: "emissive meshes sampled as lights", [EMISSION], Lights;
    /// The emission of some such mesh is a texture's or a primvar's.
    MESH_LIGHT_VALUES: "emission of lights by textures and primvars", [MESH_LIGHTS], Lights;
    /// The emission of some such mesh is a program's: `LightTablePointers::light_corners` is used.
    MESH_LIGHT_PROGRAMS: "emission of lights by programs", [PATTERNS, MESH_LIGHT_VALUES], Never;
    /// Some light moves while the shutter is open: `LightTablePointers::light_keys` is used.
    MOVING_LIGHTS: "motion of lights", [], Never;
    /// Some mesh that is sampled as a light moves while the shutter is open: `LightTablePointers::mesh_motion` is used.
    MOVING_MESH_LIGHTS: "motion of meshes sampled as lights", [MESH_LIGHTS], Never;
    /// Some mesh is made of hulls of two balls: curves.
    ROUND: "curves", [], Always;
    /// Some placement moves while the shutter is open: paths have a time.
    MOTION: "motion of placements", [], Always;
    /// The points of some mesh move while the shutter is open: paths have a time.
    DEFORMATION: "motion of points", [], Always;
    /// The camera moves: `FrameConstants::camera_motion` is used.
    CAMERA_MOTION: "motion of the camera", [], Never;
    /// The camera has clipping planes: `FrameConstants::clip_planes` is used.
    CLIPPING: "clipping planes", [], Never;
    /// The image `motion` is wanted, and something may move: `AovTargets::motion` is used.
    MOTION_VECTORS: "motion over the image", [], Never;
    /// An image of the shading of surfaces is wanted: `normal`, `Neye`, `albedo` or a primvar.
    SHADED_AOVS: "images of normals, albedo and primvars", [], Never;
    /// Shares of pixels by object or material are wanted: `FrameConstants::id_slots` is used.
    ID_RANKS: "ids ranked by coverage", [], Never;
    /// A deep image is wanted: `FrameConstants::deep_slots` is used.
    DEEP: "deep samples", [], Never;
    /// Pixels have two streams of samples, with different numbers of them: `FrameConstants::adaptive` is used.
    ADAPTIVE: "adaptive sampling: lists of samples, the second stream of the film", [], Never;
    /// Some mesh is made of balls: points.
    POINTS: "points", [], Always;
    /// The shadows of some light end at a distance.
    SHADOW_REACH: "shadows that end", [], Never;
    /// Some kind of bounce has a limit of its own: `FrameConstants::bounce_kinds` is used.
    BOUNCE_KINDS: "limits of bounces by kind", [], Never;
    /// The filter of the pixels is another than their square: `FrameConstants::pixel_filter` is used.
    PIXEL_FILTER: "pixel filter", [], Never;
    /// Light is kept apart by light path expressions: `FrameConstants::automaton` is used.
    PATH_EXPRESSIONS: "light path expressions", [], Never;
    /// It is summed how much of the light that shadow rays ask for arrives: shadows, shadow catchers.
    SHADOW_SUMS: "sums of shadowed light", [], Never;
    /// Some prim is not seen by all rays, or is a matte: `FrameConstants::prim_masks` is used, and rays have a kind.
    PRIM_MASKS: "visibility by kind of ray, mattes", [], Never;
    /// It is counted how often each path waits for loads.
    LOAD_WAITS: "counts of waits for loads", [], Never;
    /// Some material has the lobe that tests add.
    #[cfg(feature = "faults")]
    TOY_LOBE: "toy lobe", [MATERIALS], Never;
    /// Some mesh is made of the boxes that tests add.
    #[cfg(feature = "faults")]
    TOY_BOX: "toy boxes", [], Never;
}

impl Features {
    /// The specialisation constants of [`Features`] with their values.
    #[must_use]
    #[allow(clippy::cast_possible_truncation, reason = "each constant holds 32 of the bits")]
    pub fn constants(self) -> [(u32, u32); 3] {
        let words = [(SPEC_FEATURES, 0), (SPEC_FEATURES_HIGH, 32), (SPEC_FEATURES_TOP, 64)];
        words.map(|(spec, first)| (spec, (self.bits() >> first) as u32))
    }
}
