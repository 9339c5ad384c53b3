// SPDX-License-Identifier: Apache-2.0
//! Materials: compiles networks of `UsdPreviewSurface` or `MaterialX` nodes to flat tables.
//!
//! Guarantees: pure; never panics on any network; work is bounded by the number of nodes and connections; every number
//! of a [`Material`] is finite. Colours are linear Rec. 709.
//!
//! What leads to nodes of `MaterialX` (`ND_...`) goes through the crate `oocpt-materialx` (`materialx`). Of the rest
//! `compile` reads the surface node, `source` follows its connections (`texture`, `reader`, `spaces`), `displacement`
//! says what displaces it; `params` reads authored values. Rules and defaults: the specification of
//! `UsdPreviewSurface` 2.5.

mod compile;
mod compiled;
mod compiler;
mod cutout;
mod describe;
mod displacement;
mod inputs;
mod materialx;
mod params;
mod reader;
mod source;
mod spaces;
mod texture;

use oocpt_abi::{MaterialFlags, MaterialInput, NAME_FRAME_X, NAME_FRAME_Y, NAME_NORMAL, NAME_POSITION, NAME_PTEX};
use std::sync::Arc;

use oocpt_materialx::MaterialEmission;
use oocpt_materialx::program::{Program, ProgramLookup};

use crate::desc::AssetRef;

pub use compile::compile;
pub use compiled::CompiledMaterial;
pub use compiler::MAX_NODES;
pub use cutout::{Cutout, CutoutImage};
pub use describe::{MAX_TEXT_CHARS, MaterialText, NodeText, ProgramText, describe};
pub use displacement::{Displacement, PatternDisplacement, PreviewDisplacement};
pub(crate) use inputs::NEUTRAL;
pub use spaces::linear_from_srgb;
pub use texture::is_ptex_name;

/// Largest number of texture coordinate sets that a material may read.
pub const MAX_UV_SETS: usize = 2;
/// Largest number of other primvars that a material may read.
pub const MAX_PRIMVARS: usize = 2;

/// The source of an input's value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputValue {
    /// A constant; scalars are in all four components.
    Constant([f32; 4]),
    /// `texel(transform * uv) * scale + bias`, then all of it or one channel in all components.
    Texture {
        /// Index into [`crate::SurfaceTables::textures`]; of [`CompiledMaterial::textures`] before a commit.
        texture: u32,
        /// Channel; `None`: all.
        channel: Option<u8>,
        /// Factor of the texel.
        scale: [f32; 4],
        /// Summand after the factor.
        bias: [f32; 4],
        /// Texture coordinate set of the material; `None`: (0, 0), so that the last column of `transform` is the
        /// position.
        uv: Option<u8>,
        /// Rows of the affine map from the set to the position in the texture.
        transform: [[f32; 3]; 2],
    },
    /// A primvar of the mesh.
    Primvar {
        /// Index of the primvar in the material.
        slot: u8,
        /// Value if the mesh does not have it.
        fallback: [f32; 4],
    },
    /// A register of the material's program; for the opacity, of its own program.
    Register(u8),
}

/// Name of the set of Ptex coordinates: face and position in it, computed from the topology and not from a primvar.
pub const PTEX_SET: &str = "Ptex face";

/// Name of the point in the mesh's frame, which is computed from the hit and not from a primvar.
pub const POSITION_NAME: &str = oocpt_materialx::uses::MaterialUses::POSITION;
/// Name of the shading normal in the mesh's frame.
pub const NORMAL_NAME: &str = oocpt_materialx::uses::MaterialUses::NORMAL;
/// Names of the map of normals from the mesh's frame to the world.
pub const FRAME_NAMES: [&str; 2] = oocpt_materialx::uses::MaterialUses::OBJECT_FRAME;

/// Name of the position across the width of a ribbon, from 1 at the left to -1; only ribbons have it.
pub const ACROSS_NAME: &str = oocpt_materialx::uses::MaterialUses::ACROSS;

/// Number of a name that is built in and no primvar.
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
    /// Coordinates if the mesh does not have it.
    pub fallback: [f32; 2],
}

/// A primvar that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimvarSlot {
    /// Name of the primvar.
    pub name: Arc<str>,
    /// Number of the name; 0 before a commit.
    pub id: u32,
    /// Value for programs if the mesh does not have it; an [`InputValue::Primvar`] has its own.
    pub fallback: [f32; 4],
}

/// A compiled material, with defaults filled in.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Features that it needs.
    pub flags: MaterialFlags,
    /// Inputs, indexed by [`MaterialInput`].
    pub inputs: [InputValue; MaterialInput::COUNT],
    /// Threshold with [`MaterialFlags::PRESENCE`]: 0 = the opacity is a probability, else a surface of less opacity
    /// does not exist.
    pub opacity_threshold: f32,
    /// Texture coordinate sets, at most [`MAX_UV_SETS`].
    pub uv_sets: Vec<UvSet>,
    /// Primvars, at most [`MAX_PRIMVARS`].
    pub primvars: Vec<PrimvarSlot>,
    /// Program that computes the inputs that are registers; its lookups refer to textures as [`InputValue::Texture`]
    /// does.
    pub program: Program,
    /// Program that computes the opacity if that is a register, which traversal runs.
    pub opacity_program: Program,
    /// Program that computes the emission alone, for points sampled as lights: its lookups refer to the same textures.
    pub emission: Option<MaterialEmission>,
}

impl Material {
    /// An input.
    #[must_use]
    pub fn input(&self, name: MaterialInput) -> &InputValue {
        &self.inputs[name as usize]
    }

    /// Number of texture lookups where it is shaded.
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

/// Continuation of a texture outside the unit square.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// The file decides; black if it has no value.
    #[default]
    UseMetadata,
    /// The outside is transparent black.
    Black,
    /// The texels of the edge continue.
    Clamp,
    /// The texture repeats.
    Repeat,
    /// The texture repeats, every second time mirrored.
    Mirror,
}

/// Encoding of the numbers of a texture.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// The file decides: its own metadata, else sRGB for 8 bits with 3 or 4 channels, else raw.
    #[default]
    Auto,
    /// Linear values.
    Raw,
    /// Values with the sRGB curve; alpha is linear.
    Srgb,
    /// The colour space of that name, which `OpenColorIO` may know; never one of the names of the spaces above.
    Named(Arc<str>),
}

/// A texture that materials read. Two are equal if they read the same file in the same way.
#[derive(Clone, Debug)]
pub struct TextureRef {
    /// The first prim that uses it, for messages.
    pub prim: Arc<str>,
    /// The file. `<UDIM>` in its resolved name stands for the tiles 1001 to 1100.
    pub asset: AssetRef,
    /// Continuation in s and t.
    pub wrap: [Wrap; 2],
    /// Encoding of its numbers.
    pub color_space: ColorSpace,
    /// Value if the file cannot be read. Neither scale nor bias apply, unless [`Self::has_border`].
    pub fallback: [f32; 4],
    /// True if the fallback is a texel as others are: it lies where [`Wrap::Black`] has black, and scale and bias apply
    /// to it (`MaterialX`'s `image`).
    pub has_border: bool,
    /// True if the file is Ptex, which is looked up by face and not by st.
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
    /// Returns true if the name stands for many files.
    #[must_use]
    pub fn is_udim(&self) -> bool {
        !self.is_ptex && self.asset.resolved.contains("<UDIM>")
    }
}
