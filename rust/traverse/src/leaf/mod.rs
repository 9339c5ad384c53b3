// SPDX-License-Identifier: Apache-2.0
//! Leaf tests by kind (`oocpt_abi::LEAVES`): shaders/geometry, operation by operation. A kind is a module with
//! `hit(vertices, o, d)`: the distance, in units of `d`, at which a ray meets an item in front of its origin, and the
//! weights of the second and third corner there; `exit` is the same for the point where a ray leaves an item that it
//! enters in front of its origin. Triangles have a test of their own, which shares the work that is the same for all
//! triangles of a ray. Pure, any thread.

mod point;
mod round;
#[cfg(feature = "faults")]
mod toy_box;
pub(crate) mod triangle;

use crate::vector::V3;
use oocpt_abi::{Features, LEAVES, LeafType};

macro_rules! leaves {
    ($($(#[cfg($only:meta)])? $row:ident: $module:ident;)+) => {
        /// The hit of an item other than a triangle (`leaf_hit` of the shaders).
        #[inline(always)]
        pub(crate) fn hit(kind: u32, vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
            match kind {
                $($(#[cfg($only)])? kind if kind == LeafType::$row.number => $module::hit(vertices, o, d),)+
                _ => None,
            }
        }

        /// The exit of a ray from an item that it enters in front of its origin (`leaf_exit` of the shaders).
        pub(crate) fn exit(kind: u32, vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
            match kind {
                $($(#[cfg($only)])? kind if kind == LeafType::$row.number => $module::exit(vertices, o, d),)+
                _ => None,
            }
        }

        /// Vectors along which values by corner change (`leaf_edges` of the shaders).
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

/// Returns true if leaves may be made of anything but triangles (`HAS_LEAF_KINDS`).
pub(crate) fn has_kinds(features: Features) -> bool {
    LEAVES.iter().any(|leaf| *leaf != LeafType::TRIANGLE && features.contains(leaf.needs))
}

/// Number of a mesh's kind, if it is compiled in.
pub(crate) fn kind_of(flags: u32, features: Features) -> Option<u32> {
    let number = LeafType::number_of(flags);
    LEAVES.iter().any(|leaf| leaf.number == number && features.contains(leaf.needs)).then_some(number)
}
