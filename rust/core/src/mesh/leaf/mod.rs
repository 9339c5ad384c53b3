// SPDX-License-Identifier: Apache-2.0
//! Kinds of leaves: what the items in the leaves of a mesh's tree are. A kind is a module and a row of [`LeafKind`];
//! names its row of `oocpt_abi::LEAVES`. Of a kind:
//! - `bounds(vertices)`: the box around an item;
//! - `vertices(points, radii)`: an item of its corners' points, and the radii there, where points have some.
//!
//! A shape that is not made of triangles has a reader, which says what the corners of its items are ([`read_items`]).
//! Pure.

mod point;
pub(super) mod round;
#[cfg(feature = "faults")]
mod toy_box;
mod triangle;

use oocpt_abi::LeafType;
use serde::{Deserialize, Serialize};

use super::deform::PointsPose;
use super::dicing::DicingRate;
use super::topology::{MAX_COORDINATE, MeshTopology};
use super::{Aabb, WantedPrimvar};
use crate::array::ArrayView;
use crate::desc::{DroppedData, MeshDesc, PrimShape};

/// Of an item: what they mean is the kind's.
type ItemVertices = [[f32; 3]; 3];

macro_rules! leaf_kinds {
    ($(
        $(#[doc = $doc:literal])+
        $(#[cfg($only:meta)])?
        $kind:ident: $module:ident, $row:ident;
    )+) => {
        /// What the items of an asset are.
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

            /// The item with these points, and radii where points have some, at its corners.
            pub(super) fn vertices(self, points: ItemVertices, radii: [f32; 3]) -> ItemVertices {
                match self {
                    $($(#[cfg($only)])? Self::$kind => $module::vertices(points, radii),)+
                }
            }
        }
    };
}

leaf_kinds! {
    /// Triangles.
    Triangles: triangle, TRIANGLE;
    /// Hulls of two balls: `vertices[0]` and `vertices[1]` are the centres, `vertices[2]` has both radii and 0. Corners
    /// 0 and 2 are the first centre, corner 1 the second one.
    Rounds: round, ROUND;
    /// Balls: [`Self::Rounds`] of which both balls are the same. Eight to a leaf of the tree, and 16 bytes each on the
    /// device.
    Points: point, POINT;
    /// Boxes along the axes: `vertices[0]` and `vertices[1]` are opposite corners. Tests alone have it.
    #[cfg(feature = "faults")]
    ToyBoxes: toy_box, TOY_BOX;
}

/// A shape that is not made of polygons, ready to be items of an asset.
pub(super) struct LeafItems {
    /// A face of three corners for each item.
    pub(super) topology: MeshTopology,
    /// The description with values for these.
    pub(super) desc: MeshDesc,
    /// What they are.
    pub(super) kind: LeafKind,
    /// Radius at each of the topology's points; empty where they have none.
    pub(super) radii: Vec<f32>,
    /// At the keys of what moves.
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
fn point(view: &ArrayView<'_>, at: usize) -> Option<[f32; 3]> {
    let point = view.vec3(at)?;
    (point.abs().max_element() <= MAX_COORDINATE && point.is_finite()).then(|| point.to_array().map(|v| v as f32))
}
