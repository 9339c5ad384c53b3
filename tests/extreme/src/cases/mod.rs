// SPDX-License-Identifier: Apache-2.0
//! The cases, by subject.

mod geometry;
mod place;
mod scale;
mod transforms;
mod watertight;

use crate::lab::Lab;

/// Runs all of them.
pub(crate) fn run(lab: &mut Lab<'_>) {
    scale::run(lab);
    place::run(lab);
    transforms::run(lab);
    geometry::run(lab);
    watertight::run(lab);
}
