// SPDX-License-Identifier: Apache-2.0
//! Kinds of leaves: the kinds of items in the leaves of a mesh's tree. A kind is a module and a row of [`LeafKind`],
//! which names its row of `oocpt_abi::LEAVES`. A kind has these functions:
//! - `bounds(vertices)`: the box around an item;
//! - `vertices(points, radii)`: an item of its corners' points, and the radii there, where points have some.
//!
//! A shape that is not made of triangles has a reader, which gives the corners of its items ([`read_items`]). Pure.

mod point;
pub(super) mod round;
#[cfg(feature = "faults")]
mod toy_box;
mod triangle;

use oocpt_abi::LeafType;
use serde::{Deserialize, Serialize};

use super::dicing::DicingRate;
use super::pose::PointsPose;
use super::topology::{MAX_COORDINATE, MeshTopology};
use super::{Aabb, WantedPrimvar};
use crate::array::ArrayView;
use crate::desc::{DroppedData, MeshDesc, PrimShape};

/// The vertices of an item; their meaning depends on the kind.
type ItemVertices = [[f32; 3]; 3];

macro_rules! leaf_kinds {
    ($(
        $(#[doc = $doc:literal])+
        $(#[cfg($only:meta)])?
        $kind:ident: $module:ident, $row:ident;
    )+) => {
        /// The kind of the items of an asset.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
        pub enum LeafKind {
            $($(#[doc = $doc])+ $(#[cfg($only)])? $kind,)+
        }

        impl LeafKind {
            /// Every kind.
            pub const ALL: &[Self] = &[$($(#[cfg($only)])? Self::$kind,)+];

            /// Its row in the table of the shaders.
            #[must_use]
            pub fn row(self) -> LeafType {
                match self {
                    $($(#[cfg($only)])? Self::$kind => LeafType::$row,)+
                }
            }

            /// The box around an item.
            pub(super) fn bounds(self, vertices: &ItemVertices) -> Aabb {
                match self {
                    $($(#[cfg($only)])? Self::$kind => $module::bounds(vertices),)+
                }
            }

            /// The item with these points at its corners, and these radii for kinds that have radii.
            pub(super) fn vertices(self, points: ItemVertices, radii: [f32; 3]) -> ItemVertices {
                match self {
                    $($(#[cfg($only)])? Self::$kind => $module::vertices(points, radii),)+
                }
            }
        }
    };
}

leaf_kinds! {
    /// Triangles with three corners.
    Triangles: triangle, TRIANGLE;
    /// Hulls of two balls: `vertices[0]` and `vertices[1]` are the centres, `vertices[2]` has both radii and 0. Corners
    /// 0 and 2 are the first centre, corner 1 is the second one.
    Rounds: round, ROUND;
    /// Balls: [`Self::Rounds`] with two equal balls. Eight are in a leaf of the tree, and each has 16 bytes on the
    /// device.
    Points: point, POINT;
    /// Axis-aligned boxes: `vertices[0]` and `vertices[1]` are opposite corners. Only tests have it.
    #[cfg(feature = "faults")]
    ToyBoxes: toy_box, TOY_BOX;
}

/// A shape that is not made of polygons, ready to be items of an asset.
pub(super) struct LeafItems {
    /// Topology with a face of three corners for each item.
    pub(super) topology: MeshTopology,
    /// Description with values for these faces.
    pub(super) desc: MeshDesc,
    /// Kind of the items.
    pub(super) kind: LeafKind,
    /// Radius at each of the topology's points; empty for kinds without radii.
    pub(super) radii: Vec<f32>,
    /// Poses at the keys of a moving prim.
    pub(super) poses: Vec<PointsPose>,
}

/// The items of `desc`; `None` for a mesh.
pub(super) fn read_items(
    desc: &MeshDesc,
    wanted: &[WantedPrimvar],
    dicing: &DicingRate,
    poses: &[PointsPose],
    dropped: &mut DroppedData,
) -> Option<LeafItems> {
    match &desc.shape {
        PrimShape::Mesh => None,
        PrimShape::Curves(curves) => Some(round::read_curves(desc, curves, wanted, dicing, poses, dropped)),
        PrimShape::Points => Some(round::read_points(desc, dicing, poses, dropped)),
        #[cfg(feature = "faults")]
        PrimShape::ToyBoxes => Some(toy_box::read(desc, poses, dropped)),
    }
}

/// A usable point in single precision.
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn point_at(view: &ArrayView<'_>, at: usize) -> Option<[f32; 3]> {
    let point = view.vec3(at)?;
    (point.abs().max_element() <= MAX_COORDINATE && point.is_finite()).then(|| point.to_array().map(|v| v as f32))
}
