// SPDX-License-Identifier: Apache-2.0
//! The cases, by subject.

mod camera;
mod geometry;
mod leaks;
mod light;
mod materials;
mod motion;
mod place;
mod scale;
mod self_hits;
mod shapes;
mod time;
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
    leaks::run(lab);
    self_hits::run(lab);
    light::run(lab);
    materials::run(lab);
    camera::run(lab);
    motion::run(lab);
    shapes::run(lab);
    time::run(lab);
}
