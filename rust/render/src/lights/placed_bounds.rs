// SPDX-License-Identifier: Apache-2.0
//! Bounds of light that a placement takes into the world. Pure.

use super::emitter::{cross, dot};
use super::local::finite_power;
use super::tree::LightBounds;
use std::f64::consts::PI;

/// Bounds of a placement in the world.
pub(super) fn in_world(
    inside: &LightBounds,
    columns: [[f64; 3]; 3],
    at: [f64; 3],
    error: f64,
    scale: f64,
) -> LightBounds {
    let center = [0, 1, 2].map(|k| 0.5 * (inside.min[k] + inside.max[k]));
    let half = [0, 1, 2].map(|k| 0.5 * (inside.max[k] - inside.min[k]));
    let map = |v: [f64; 3]| [0, 1, 2].map(|k| (0..3).map(|c| columns[c][k] * v[c]).sum::<f64>());
    let middle = map(center);
    let reach = [0, 1, 2].map(|k| (0..3).map(|c| columns[c][k].abs() * half[c]).sum::<f64>() * (1.0 + 1e-6) + error);
    // Areas grow by cofactors; normals are covectors.
    let [x, y, z] = columns;
    let cofactors = [cross(y, z), cross(z, x), cross(x, y)];
    let grown = |n: [f64; 3]| [0, 1, 2].map(|k| (0..3).map(|c| cofactors[c][k] * n[c]).sum::<f64>());
    let length = |v: [f64; 3]| dot(v, v).sqrt();
    let axis = grown(inside.axis);
    let along = length(axis);
    let growth = if inside.spread < 1e-3 { along } else { cofactors.iter().map(|c| length(*c)).sum::<f64>() / 3.0 };
    let sizes = columns.map(length);
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let is_even = sizes.iter().all(|size| *size > 0.999 * largest)
        && [dot(x, y), dot(y, z), dot(z, x)].iter().all(|d| d.abs() < 1e-3 * largest * largest);
    // A mirroring map turns cofactors, and not the outside.
    let turn = if dot(x, cross(y, z)) < 0.0 { -1.0 } else { 1.0 };
    let is_direction = along > 0.0 && along.is_finite();
    let spread = match (is_direction, inside.spread < 1e-3, is_even) {
        (true, true, _) => inside.spread,
        (true, false, true) => (inside.spread + 1e-2).min(PI),
        _ => PI,
    };
    LightBounds {
        min: [0, 1, 2].map(|k| at[k] + middle[k] - reach[k]),
        max: [0, 1, 2].map(|k| at[k] + middle[k] + reach[k]),
        axis: if is_direction { axis.map(|v| turn * v / along) } else { [0.0, 0.0, 1.0] },
        spread,
        emission: inside.emission,
        back: inside.back,
        power: finite_power(scale * inside.power * growth),
    }
}
