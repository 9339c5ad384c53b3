// SPDX-License-Identifier: Apache-2.0
//! The table of leaf kinds: what the items in the leaves of a mesh's tree may be. The build writes from it what goes
//! through all of them but triangles (`generated/leaves.glsl`).
//!
//! A row is all there is to declare; the kind itself is `shaders/geometry/NAME.glsl`, and `shaders/geometry/leaf.glsl`
//! says which functions it has. `oocpt_traverse` has its test and `oocpt_core::mesh::LeafKind` its boxes, under the
//! same name. Pure, any thread.

use super::Features;

/// A row of [`LEAVES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LeafType {
    /// Of its files and its functions.
    pub name: &'static str,
    /// What `GpuMesh::flags` says of a mesh of it, below [`LEAF_KINDS`].
    pub number: u32,
    /// Without all of these it is not compiled in.
    pub needs: Features,
    /// It is a piece of a tube around its first edge, which fibres go along.
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
    /// Triangles: what leaves are made of where nothing else is said.
    TRIANGLE = 0: triangle, [], false;
    /// Hulls of two balls: `v0` and `v1` are the centres, `v2.x` and `v2.y` the radii. Curves.
    ROUND = 1: round, [ROUND], true;
    /// Balls: to the functions a hull of two that are the same, in memory [`super::GpuPoint`] and a radius.
    POINT = 3: point, [POINTS], true;
    /// The kind that tests add: a box along the axes, of which `v0` and `v1` are opposite corners.
    #[cfg(feature = "faults")]
    TOY_BOX = 2: toy_box, [TOY_BOX], false;
}

/// How many numbers there are for kinds.
pub const LEAF_KINDS: u32 = 16;
/// Where `GpuMesh::flags` keeps the number of a kind.
pub const MESH_LEAF_SHIFT: u32 = 24;
/// The bits of `GpuMesh::flags` that are that number.
pub const MESH_LEAF_MASK: u32 = (LEAF_KINDS - 1) << MESH_LEAF_SHIFT;

impl LeafType {
    /// Its bits of `GpuMesh::flags`.
    #[must_use]
    pub const fn flags(self) -> u32 {
        self.number << MESH_LEAF_SHIFT
    }

    /// The number that `GpuMesh::flags` has.
    #[must_use]
    pub const fn number_of(flags: u32) -> u32 {
        (flags & MESH_LEAF_MASK) >> MESH_LEAF_SHIFT
    }
}
