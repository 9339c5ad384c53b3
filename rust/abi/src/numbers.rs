// SPDX-License-Identifier: Apache-2.0
//! Floating-point constants that the passes and the host share. The build writes a `const float` of each for the
//! shaders.

/// Length of the longest chain of instance records below a chunk instance.
pub const MAX_LEVELS: u32 = 16;

/// Set of samples whose first coordinate is the time of a path; those of bounces are numbered from 0.
pub const TIME_SET: u32 = 0x4000_0000;

/// Bit of the number of an item other than a triangle: its second surface.
pub const SECOND_SURFACE: u32 = 1 << 31;

/// Bit of `GpuCutout::modes`: the mask is of a set of files.
pub const MASK_SET: u32 = 1 << 7;

macro_rules! floats {
    ($($(#[doc = $doc:literal])+ $name:ident = $value:literal;)+) => {
        $($(#[doc = $doc])+ pub const $name: f32 = $value;)+

        /// Name and value of every `const float` that the build writes for the shaders.
        pub const FLOATS: &[(&str, f32)] = &[$((stringify!($name), $name),)+];
    };
}

floats! {
    /// The slab test multiplies the far distance by this (Ize 2013, "Robust BVH Ray Traversal"): 1 + 2 (gamma(5) + 2.5
    /// units in the last place), rounded up. The distance to a plane of a node rounds five times, and Vulkan allows
    /// reciprocals an error of as much as that. (Ize assumes planes in floats and correct rounding: 1 + 2 gamma(3).)
    SLAB_PAD = 1.000_001_2;
    /// Boxes are culled only this far behind the closest hit, so that rounding hides no equally close one.
    CULL_PAD = 1.000_003_8;
    /// A little more than 1 / [`CULL_PAD`].
    ENTRY_SCALE = 0.999_996_4;
    /// Factor of the largest component of an origin in the world: boxes are padded by this, which covers the origin's
    /// low part (2^-24) and the rounding of the padding itself.
    TOP_PAD = 1.8e-7;
    /// Factor of the largest coordinate of the ray's origin and of the mesh: the distance beside a triangle at which
    /// the rounding of its edge functions (14 units of 2^-24 of a corner's distance) can find a hit, and eight more for
    /// the planes of boxes (`shaders/traversal/node.glsl`). Boxes in meshes are padded by that: otherwise the triangle
    /// that takes a ray at a shared edge may be in a box that the ray misses (Woop et al. 2013, 3.1).
    MESH_PAD = 2.1e-6;
    /// Squared cosine below which a triangle counts as seen along its plane.
    GRAZING = 1.0e-4;
    /// Largest ratio of the length of a lookup's ellipse to the width of its filter.
    MAX_ANISOTROPY = 16.0;
    /// Surfaces with less roughness count as sharp.
    SHARP_ROUGHNESS = 0.01;
    /// Stands in place of the offset of a fibre, which is in -1..1: its normal gives the position.
    HAIR_BY_NORMAL = 2.0;
    /// What one pixel may count in the error of a picture: squares of it, and sums of those, are floats.
    MAX_PIXEL_ERROR = 1.0e15;
    /// Squared standard errors by which a pixel's mean has to differ from its neighbours' to be believed.
    MEAN_TRUST = 4.0;
    /// Depth of what is seen where nothing is met: finite, as some readers of deep images calculate with depths.
    DEEP_FAR = 1.0e30;
    /// Number of steps along u and v of a packed Ptex position: 17 bits each.
    PTEX_STEPS = 131_072.0;
}
