// SPDX-License-Identifier: Apache-2.0
//! The properties of its mesh and the textures that a material reads.

use std::sync::Arc;

use crate::expression::Val;
use crate::value::FileRef;

/// The behaviour of a texture outside the unit square.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AddressMode {
    /// [`MaterialTexture::fallback`] if that is a texel, else transparent black.
    Constant,
    /// The edge is continued.
    Clamp,
    /// The image is repeated.
    Periodic,
    /// The image is repeated, every second time mirrored.
    Mirror,
    /// The file decides (`useMetadata` of `UsdUVTexture`).
    UseMetadata,
}

/// A texture that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTexture {
    /// The file.
    pub file: FileRef,
    /// Address modes in u and v.
    pub address: [AddressMode; 2],
    /// The value if the file cannot be read.
    pub fallback: [f32; 4],
    /// True if the fallback is a texel as others are: it lies around the image in the mode `Constant`, and the
    /// operations on texels apply to it.
    pub has_border: bool,
    /// True if the colour space comes from the file if none is set; otherwise it is linear.
    pub auto_color_space: bool,
}

/// A primvar that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPrimvar {
    /// Its name, or [`MaterialUses::POSITION`] or [`MaterialUses::NORMAL`].
    pub name: Arc<str>,
    /// The value for a mesh that does not have it.
    pub fallback: [f32; 4],
}

/// A lookup: a texture and its place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LookupUse {
    pub(crate) texture: u32,
    pub(crate) place: Val,
}

/// Texture coordinates, primvars and textures of a material, by number.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialUses {
    /// Names of sets of texture coordinates.
    pub uv_sets: Vec<Arc<str>>,
    /// Other primvars.
    pub primvars: Vec<MaterialPrimvar>,
    /// Textures.
    pub textures: Vec<MaterialTexture>,
    pub(crate) lookups: Vec<LookupUse>,
}

impl MaterialUses {
    /// Most sets of texture coordinates, and most other primvars.
    pub const MAX_SETS: usize = 2;
    /// Name of the point in the frame of the mesh, which every mesh has.
    pub const POSITION: &'static str = "object position";
    /// Name of the normal in the frame of the mesh, which every mesh has.
    pub const NORMAL: &'static str = "object normal";
    /// Names of the map that takes normals from the frame of the mesh to the world, up to a factor, which every mesh
    /// has: the images of (1, 0, 0) and (0, 1, 0), both over the length of the image of (0, 0, 1). The direction of the
    /// latter is in the last components of the two, as an octahedral pair (Meyer et al. 2010).
    pub const OBJECT_FRAME: [&'static str; 2] = ["object frame x", "object frame y"];
    /// Name of the position of a hit across a ribbon's width, -1 to 1; nothing else has it.
    pub const ACROSS: &'static str = "ribbon across";
    /// Most lookups before unused ones are left out.
    const MAX_LOOKUPS: usize = 64;

    pub(crate) fn uv_set(&mut self, name: &str) -> Option<usize> {
        if let Some(known) = self.uv_sets.iter().position(|set| &**set == name) {
            return Some(known);
        }
        if self.uv_sets.len() >= Self::MAX_SETS {
            return None;
        }
        self.uv_sets.push(name.into());
        Some(self.uv_sets.len() - 1)
    }

    pub(crate) fn primvar(&mut self, name: &str, fallback: [f32; 4]) -> Option<usize> {
        if let Some(known) = self.primvars.iter().position(|primvar| &*primvar.name == name) {
            return Some(known);
        }
        if self.primvars.len() >= Self::MAX_SETS {
            return None;
        }
        self.primvars.push(MaterialPrimvar { name: name.into(), fallback });
        Some(self.primvars.len() - 1)
    }

    /// The number of a lookup; `None` if there are too many.
    pub(crate) fn lookup(&mut self, texture: &MaterialTexture, place: Val) -> Option<u16> {
        let known = self.textures.iter().position(|known| known == texture);
        let at = known.unwrap_or_else(|| {
            self.textures.push(texture.clone());
            self.textures.len() - 1
        });
        let lookup = LookupUse { texture: u32::try_from(at).ok()?, place };
        if let Some(known) = self.lookups.iter().position(|known| *known == lookup) {
            return u16::try_from(known).ok();
        }
        if self.lookups.len() >= Self::MAX_LOOKUPS {
            return None;
        }
        self.lookups.push(lookup);
        u16::try_from(self.lookups.len() - 1).ok()
    }
}
