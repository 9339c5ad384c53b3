// SPDX-License-Identifier: Apache-2.0
//! What becomes a mesh in authored order. Plain data.

use super::pose::PointsPose;
use super::topology::MeshTopology;
use super::{LeafKind, WantedPrimvar};
use crate::desc::MeshDesc;

/// What becomes a mesh in authored order, without a hierarchy.
#[derive(Clone, Copy)]
pub(super) struct UnsortedMesh<'a> {
    pub(super) desc: &'a MeshDesc,
    pub(super) wanted: &'a [WantedPrimvar],
    pub(super) key: u128,
    pub(super) topology: &'a MeshTopology,
    /// What its items are.
    pub(super) kind: LeafKind,
    /// By point, where they have some; else empty.
    pub(super) radii: &'a [f32],
    /// At the keys of what moves.
    pub(super) poses: &'a [PointsPose],
}
