// SPDX-License-Identifier: Apache-2.0
//! A placement of an opened assembly, and the values that it has. Plain data.

use glam::DAffine3;
use oocpt_abi::NO_ROW;

use crate::instancing::instance_primvars::InstanceColumn;

/// A value of a placement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlacedValue {
    pub(super) column: InstanceColumn,
    pub(super) value: [f32; 4],
}

impl PlacedValue {
    /// The number of its name, and all four components as materials see them: one is in all, else what is missing is 0,
    /// and alpha 1.
    pub(crate) fn expanded(&self) -> (u32, [f32; 4]) {
        let [x, y, z, w] = self.value;
        let value = match self.column.width {
            1 => [x; 4],
            2 => [x, y, 0.0, 1.0],
            3 => [x, y, z, 1.0],
            _ => [x, y, z, w],
        };
        (self.column.id, value)
    }
}

/// A placement of an opened assembly.
#[derive(Clone, Debug)]
pub(crate) struct OpenedPlacement {
    /// World frame from the assembly's frame.
    pub(crate) frame: DAffine3,
    /// Instance id so far.
    pub(crate) id: u32,
    /// Values of primvars so far, those of inner instancers in place of outer ones.
    pub(crate) values: Vec<PlacedValue>,
    /// Its row in [`super::PartitionedWorld::placed`], or `NO_ROW`.
    pub(crate) row: u32,
}

impl OpenedPlacement {
    /// That of the root.
    pub(crate) fn root() -> Self {
        Self { frame: DAffine3::IDENTITY, id: 0, values: Vec::new(), row: NO_ROW }
    }
}
