// SPDX-License-Identifier: Apache-2.0
//! The table of leaf kinds: the kinds of items in the leaves of a mesh's tree. From it the build writes the code that
//! dispatches on all kinds but triangles (`generated/leaves.glsl`).
//!
//! A row is the only declaration of a kind in the tables; its code is `shaders/geometry/NAME.glsl`, and
//! `shaders/geometry/leaf.glsl` lists the functions that it has. `oocpt_traverse` has its test and
//! `oocpt_core::mesh::LeafKind` its boxes, under the same name. Pure, any thread.

use super::Features;

/// A row of [`LEAVES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LeafType {
    /// Name of its files and its functions.
    pub name: &'static str,
    /// Number in `GpuMesh::flags` of a mesh of this kind, below [`LEAF_KINDS`].
    pub number: u32,
    /// Features without all of which it is not compiled in.
    pub needs: Features,
    /// True if it is a piece of a tube around its first edge, which is the direction of fibres.
    pub is_tube: bool,
}

macro_rules! leaves {
    ($(
        $(#[doc = $doc:literal])+
        $(#[cfg($only:meta)])?
        $constant:ident = $number:literal: $name:ident, [$($needs:ident),*], $is_tube:literal;
    )+) => {
        impl LeafType {
            $($(#[doc = $doc])+ $(#[cfg($only)])? pub const $constant: Self = Self {
                name: stringify!($name),
                number: $number,
                needs: Features::empty()$(.union(Features::$needs))*,
                is_tube: $is_tube,
            };)+
        }

        /// Every kind of leaf.
        pub const LEAVES: &[LeafType] = &[$($(#[cfg($only)])? LeafType::$constant,)+];
    };
}

leaves! {
    /// Triangles, the default kind.
    TRIANGLE = 0: triangle, [], false;
    /// Hulls of two balls: `v0` and `v1` are the centres, `v2.x` and `v2.y` the radii. Curves.
    ROUND = 1: round, [ROUND], true;
    /// Balls: for the functions a hull of two equal balls, in memory a [`super::GpuPoint`] and a radius.
    POINT = 3: point, [POINTS], true;
    /// The kind that tests add: an axis-aligned box, of which `v0` and `v1` are opposite corners.
    #[cfg(feature = "faults")]
    TOY_BOX = 2: toy_box, [TOY_BOX], false;
}

/// Number of values that the number of a kind may have.
pub const LEAF_KINDS: u32 = 16;
/// Position of the number of a kind in `GpuMesh::flags`.
pub const MESH_LEAF_SHIFT: u32 = 24;
/// Mask of the number of a kind in `GpuMesh::flags`.
pub const MESH_LEAF_MASK: u32 = (LEAF_KINDS - 1) << MESH_LEAF_SHIFT;

impl LeafType {
    /// Bits of its number in `GpuMesh::flags`.
    #[must_use]
    pub const fn flags(self) -> u32 {
        self.number << MESH_LEAF_SHIFT
    }

    /// The number of the kind in `flags` of a `GpuMesh`.
    #[must_use]
    pub const fn number_of(flags: u32) -> u32 {
        (flags & MESH_LEAF_MASK) >> MESH_LEAF_SHIFT
    }
}
