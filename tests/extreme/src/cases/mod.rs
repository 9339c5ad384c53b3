// SPDX-License-Identifier: Apache-2.0
//! The cases, by subject.

mod backends;
mod camera;
mod geometry;
mod hair;
mod leaks;
mod light;
mod materials;
mod materialx;
mod motion;
mod place;
mod scale;
mod self_hits;
mod shapes;
mod textures;
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
    materialx::run(lab);
    hair::run(lab);
    textures::run(lab);
    camera::run(lab);
    motion::run(lab);
    shapes::run(lab);
    backends::run(lab);
    time::run(lab);
}
