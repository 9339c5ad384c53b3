// SPDX-License-Identifier: Apache-2.0
//! Materials: networks of `UsdPreviewSurface` or `MaterialX` nodes worked out to flat tables.
//!
//! Guarantees: pure; never panics on any network; work is bounded by the number of nodes and connections; every number
//! of a [`Material`] is finite. Colours are linear Rec. 709.
//!
//! What leads to nodes of `MaterialX` (`ND_...`) goes through the crate `oocpt-materialx` (`materialx`). Of the rest
//! `compile` reads the surface node and follows its connections (`texture`, `reader`, `spaces`), `displacement` what
//! displaces it; `params` reads authored values. Rules and defaults: the specification of `UsdPreviewSurface` 2.5.

mod compile;
mod cutout;
mod describe;
mod displacement;
mod materialx;
mod params;
mod reader;
mod spaces;
mod texture;

use oocpt_abi::{MaterialFlags, MaterialInput, NAME_FRAME_X, NAME_FRAME_Y, NAME_NORMAL, NAME_POSITION, NAME_PTEX};
use std::sync::Arc;

use oocpt_materialx::MaterialEmission;
use oocpt_materialx::program::{Program, ProgramLookup};

use crate::desc::AssetRef;

pub(crate) use compile::NEUTRAL;
pub use compile::{CompiledMaterial, MAX_NODES, compile};
pub use cutout::{Cutout, CutoutImage};
pub use describe::{LONGEST_TEXT, MaterialText, NodeText, ProgramText, describe};
pub use displacement::{Displacement, PatternDisplacement, PreviewDisplacement};
pub use spaces::linear_from_srgb;
pub use texture::is_ptex_name;

/// Texture coordinate sets that a material may read.
pub const MAX_UV_SETS: usize = 2;
/// Other primvars that a material may read.
pub const MAX_PRIMVARS: usize = 2;

/// Where a value comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputValue {
    /// The value; scalars in all four components.
    Constant([f32; 4]),
    /// `texel(transform * uv) * scale + bias`, then all of it or one channel in all components.
    Texture {
        /// Index into [`crate::SurfaceTables::textures`]; of [`CompiledMaterial::textures`] before a commit.
        texture: u32,
        /// The channel; `None`: all.
        channel: Option<u8>,
        /// Factor.
        scale: [f32; 4],
        /// Summand.
        bias: [f32; 4],
        /// Texture coordinate set of the material; `None`: (0, 0), the last column of `transform` is the place.
        uv: Option<u8>,
        /// Rows of the affine map from the set to the place in the texture.
        transform: [[f32; 3]; 2],
    },
    /// A primvar of the mesh.
    Primvar {
        /// Primvar of the material.
        slot: u8,
        /// Value where the mesh does not have it.
        fallback: [f32; 4],
    },
    /// A register of the material's program; of the opacity, of its own program.
    Register(u8),
}

/// Name of the set of Ptex coordinates: face and place in it, made of the topology and not of a primvar.
pub const PTEX_SET: &str = "Ptex face";

/// Name of the point in the mesh's frame, which is made of the hit and not of a primvar.
pub const POSITION_NAME: &str = oocpt_materialx::uses::MaterialUses::POSITION;
/// Name of the shading normal in the mesh's frame.
pub const NORMAL_NAME: &str = oocpt_materialx::uses::MaterialUses::NORMAL;
/// Names of the map of normals from the mesh's frame to the world.
pub const FRAME_NAMES: [&str; 2] = oocpt_materialx::uses::MaterialUses::OBJECT_FRAME;

/// Name of where a ribbon is met across its width, from 1 at the left to -1; what is no ribbon does not have it.
pub const ACROSS_NAME: &str = oocpt_materialx::uses::MaterialUses::ACROSS;

/// Number of a name that is no primvar.
#[must_use]
pub fn built_in(name: &str) -> Option<u32> {
    match name {
        PTEX_SET => Some(NAME_PTEX),
        POSITION_NAME => Some(NAME_POSITION),
        NORMAL_NAME => Some(NAME_NORMAL),
        _ => FRAME_NAMES
            .into_iter()
            .zip([NAME_FRAME_X, NAME_FRAME_Y])
            .find(|(known, _)| *known == name)
            .map(|(_, id)| id),
    }
}

/// A texture coordinate set that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct UvSet {
    /// Name of the primvar.
    pub name: Arc<str>,
    /// Number of the name, see [`crate::MeshAsset::primvars`]; 0 before a commit.
    pub id: u32,
    /// Coordinates where the mesh does not have it.
    pub fallback: [f32; 2],
}

/// A primvar that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimvarSlot {
    /// Name of the primvar.
    pub name: Arc<str>,
    /// Number of the name; 0 before a commit.
    pub id: u32,
    /// Value where the mesh does not have it, for programs; an [`InputValue::Primvar`] has its own.
    pub fallback: [f32; 4],
}

/// A material, defaults filled in.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// What it needs.
    pub flags: MaterialFlags,
    /// By [`MaterialInput`].
    pub inputs: [InputValue; MaterialInput::COUNT],
    /// With [`MaterialFlags::PRESENCE`]: 0 = the opacity is a probability, else a surface of less opacity is not there.
    pub opacity_threshold: f32,
    /// At most [`MAX_UV_SETS`].
    pub uv_sets: Vec<UvSet>,
    /// At most [`MAX_PRIMVARS`].
    pub primvars: Vec<PrimvarSlot>,
    /// Works out the inputs that are registers; its lookups have textures as [`InputValue::Texture`] has.
    pub program: Program,
    /// Works out the opacity where that is a register: a program of its own, which traversal runs.
    pub opacity_program: Program,
    /// Works out the emission alone, where light can be asked for it: its lookups are textures as the others.
    pub emission: Option<MaterialEmission>,
}

impl Material {
    /// An input.
    #[must_use]
    pub fn input(&self, name: MaterialInput) -> &InputValue {
        &self.inputs[name as usize]
    }

    /// Texture lookups where it is shaded.
    #[must_use]
    pub fn lookups(&self) -> usize {
        let inputs = self.inputs.iter().filter(|input| matches!(input, InputValue::Texture { .. })).count();
        inputs + self.program.lookups.len()
    }

    /// The lookups of all its programs.
    pub fn program_lookups(&self) -> impl Iterator<Item = &ProgramLookup> {
        let emission = self.emission.iter().flat_map(|emission| &emission.program.lookups);
        self.program.lookups.iter().chain(&self.opacity_program.lookups).chain(emission)
    }

    /// Names of all primvars that it reads, texture coordinates first.
    pub fn primvar_names(&self) -> impl Iterator<Item = &Arc<str>> {
        self.uv_sets.iter().map(|set| &set.name).chain(self.primvars.iter().map(|slot| &slot.name))
    }
}

/// What a texture does outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// As the file says; black if it says nothing.
    #[default]
    UseMetadata,
    /// Transparent black.
    Black,
    /// The edge goes on.
    Clamp,
    /// Repeats.
    Repeat,
    /// Repeats, every second time mirrored.
    Mirror,
}

/// How the numbers of a texture are meant.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// Told from the file: what it says, else sRGB for 8 bits with 3 or 4 channels, else raw.
    #[default]
    Auto,
    /// Linear.
    Raw,
    /// The sRGB curve; alpha is linear.
    Srgb,
    /// The colour space of that name, which `OpenColorIO` knows or not; none of the names that mean one of the above.
    Named(Arc<str>),
}

/// A texture that materials read. Two are equal when they read the same the same way, whoever asks.
#[derive(Clone, Debug)]
pub struct TextureRef {
    /// A prim that asks for it: the first one that was seen. For messages.
    pub prim: Arc<str>,
    /// The file. `<UDIM>` in its resolved name stands for the tiles 1001 to 1100.
    pub asset: AssetRef,
    /// In s and t.
    pub wrap: [Wrap; 2],
    /// Meaning of its numbers.
    pub color_space: ColorSpace,
    /// What it gives where the file cannot be read. Neither scale nor bias apply, unless [`Self::has_border`].
    pub fallback: [f32; 4],
    /// The fallback is a texel as others are: it lies where [`Wrap::Black`] has black, and scale and bias apply to it
    /// (`MaterialX`'s `image`).
    pub has_border: bool,
    /// The file is Ptex: looked up by face, not by st.
    pub is_ptex: bool,
}

impl PartialEq for TextureRef {
    fn eq(&self, other: &Self) -> bool {
        let Self { prim: _, asset, wrap, color_space, fallback, has_border, is_ptex } = self;
        *asset == other.asset
            && *wrap == other.wrap
            && *color_space == other.color_space
            && *fallback == other.fallback
            && *has_border == other.has_border
            && *is_ptex == other.is_ptex
    }
}

impl TextureRef {
    /// True when the name stands for many files.
    #[must_use]
    pub fn is_udim(&self) -> bool {
        !self.is_ptex && self.asset.resolved.contains("<UDIM>")
    }
}
