// SPDX-License-Identifier: Apache-2.0
//! Leaf tests by kind (`oocpt_abi::LEAVES`): shaders/geometry, operation by operation. A kind is a module with
//! `hit(vertices, o, d)`: the distance, in units of `d`, at which a ray meets an item in front of its origin, and the
//! weights of the second and third corner there; `exit` is the same where a ray leaves an item that it enters there.
//! Triangles have one of their own, for what is the same for all of them.
//! Pure, any thread.

mod point;
mod round;
#[cfg(feature = "faults")]
mod toy_box;
pub(crate) mod triangle;

use crate::vector::V3;
use oocpt_abi::{Features, LEAVES, LeafType};

macro_rules! leaves {
    ($($(#[cfg($only:meta)])? $row:ident: $module:ident;)+) => {
        /// The test of an item that is no triangle (`leaf_hit`).
        #[inline(always)]
        pub(crate) fn hit(kind: u32, vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
            match kind {
                $($(#[cfg($only)])? kind if kind == LeafType::$row.number => $module::hit(vertices, o, d),)+
                _ => None,
            }
        }

        /// Where a ray leaves an item that it enters in front of its origin (`leaf_exit`).
        pub(crate) fn exit(kind: u32, vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
            match kind {
                $($(#[cfg($only)])? kind if kind == LeafType::$row.number => $module::exit(vertices, o, d),)+
                _ => None,
            }
        }

        /// Along which values by corner change (`leaf_edges`).
        pub(crate) fn edges(kind: u32, vertices: [V3; 3]) -> [V3; 2] {
            match kind {
                $($(#[cfg($only)])? kind if kind == LeafType::$row.number => $module::edges(vertices),)+
                _ => [vertices[1] - vertices[0], vertices[2] - vertices[0]],
            }
        }
    };
}

leaves! {
    ROUND: round;
    POINT: point;
    #[cfg(feature = "faults")]
    TOY_BOX: toy_box;
}

/// Whether leaves may be made of anything but triangles (`HAS_LEAF_KINDS`).
pub(crate) fn has_kinds(features: Features) -> bool {
    LEAVES.iter().any(|leaf| *leaf != LeafType::TRIANGLE && features.contains(leaf.needs))
}

/// The number of a mesh's kind, if it is compiled in.
pub(crate) fn kind_of(flags: u32, features: Features) -> Option<u32> {
    let number = LeafType::number_of(flags);
    LEAVES.iter().any(|leaf| leaf.number == number && features.contains(leaf.needs)).then_some(number)
}
