// SPDX-License-Identifier: Apache-2.0
//! What a material reads of its mesh, and its textures.

use std::sync::Arc;

use crate::expression::Val;
use crate::value::FileRef;

/// What a texture does outside the unit square.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AddressMode {
    /// [`MaterialTexture::fallback`] where that is a texel, else transparent black.
    Constant,
    /// The edge goes on.
    Clamp,
    /// Repeats.
    Periodic,
    /// Repeats, every second time mirrored.
    Mirror,
    /// As the file says (`useMetadata` of `UsdUVTexture`).
    UseMetadata,
}

/// A texture that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialTexture {
    /// The file.
    pub file: FileRef,
    /// In u and v.
    pub address: [AddressMode; 2],
    /// What it is where the file cannot be read.
    pub fallback: [f32; 4],
    /// The fallback is a texel as others are: it lies around the image in the mode `Constant`, and what is made of
    /// texels is made of it.
    pub has_border: bool,
    /// The colour space is told from the file where none is said; else it is linear.
    pub auto_color_space: bool,
}

/// A primvar that a material reads.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialPrimvar {
    /// Its name, or [`MaterialUses::POSITION`] or [`MaterialUses::NORMAL`].
    pub name: Arc<str>,
    /// Its value where the mesh does not have it.
    pub fallback: [f32; 4],
}

/// A lookup: a texture and where it looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct LookupUse {
    pub(crate) texture: u32,
    pub(crate) place: Val,
}

/// See the module.
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
    /// Sets of texture coordinates, and other primvars, at most.
    pub const MOST: usize = 2;
    /// Name of the point in the frame of the mesh, which every mesh has.
    pub const POSITION: &'static str = "object position";
    /// Name of the normal in the frame of the mesh, which every mesh has.
    pub const NORMAL: &'static str = "object normal";
    /// Names of the map that takes normals from the frame of the mesh to the world, up to a factor, which every mesh
    /// has: where (1, 0, 0) goes, where (0, 1, 0) goes, both over the length of where (0, 0, 1) goes. That direction is
    /// in the last components of the two, as an octahedral pair (Meyer et al. 2010).
    pub const OBJECT_FRAME: [&'static str; 2] = ["object frame x", "object frame y"];
    /// Name of where a ribbon is met across its width, -1 to 1; nothing else has it.
    pub const ACROSS: &'static str = "ribbon across";
    /// Most lookups before those that nothing reads are left out.
    const MOST_LOOKUPS: usize = 64;

    pub(crate) fn uv_set(&mut self, name: &str) -> Option<usize> {
        if let Some(known) = self.uv_sets.iter().position(|set| &**set == name) {
            return Some(known);
        }
        if self.uv_sets.len() >= Self::MOST {
            return None;
        }
        self.uv_sets.push(name.into());
        Some(self.uv_sets.len() - 1)
    }

    pub(crate) fn primvar(&mut self, name: &str, fallback: [f32; 4]) -> Option<usize> {
        if let Some(known) = self.primvars.iter().position(|primvar| &*primvar.name == name) {
            return Some(known);
        }
        if self.primvars.len() >= Self::MOST {
            return None;
        }
        self.primvars.push(MaterialPrimvar { name: name.into(), fallback });
        Some(self.primvars.len() - 1)
    }

    /// The number of a lookup; `None` when there are too many.
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
        if self.lookups.len() >= Self::MOST_LOOKUPS {
            return None;
        }
        self.lookups.push(lookup);
        u16::try_from(self.lookups.len() - 1).ok()
    }
}
