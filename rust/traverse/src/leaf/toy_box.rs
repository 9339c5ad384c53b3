// SPDX-License-Identifier: Apache-2.0
//! The leaf test of the boxes that tests add: `geometry/toy_box.glsl`, operation by operation. Pure, any thread.

use crate::vector::V3;

/// Fraction of the way along x from the first corner to the second.
#[expect(clippy::manual_clamp, reason = "NaN becomes 0, as there")]
fn share(first: V3, second: V3, x: f32) -> f32 {
    let extent = second[0] - first[0];
    if extent == 0.0 { 0.0 } else { ((x - first[0]) / extent).max(0.0).min(1.0) }
}

/// Edges of the box, as `toy_box_edges` of the shaders.
pub(super) fn edges([v0, v1, _]: [V3; 3]) -> [V3; 2] {
    [V3([v1[0] - v0[0], 0.0, 0.0]), V3([0.0, v1[1] - v0[1], v1[2] - v0[2]])]
}

pub(super) fn hit(vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
    let (entry, exit) = span(vertices, o, d)?;
    let t = if entry > 0.0 { entry } else { exit };
    (t > 0.0).then(|| (t, [share(vertices[0], vertices[1], o[0] + t * d[0]), 0.0]))
}

/// Exit from the box, as `toy_box_exit` of the shaders.
pub(super) fn exit(vertices: [V3; 3], o: V3, d: V3) -> Option<(f32, [f32; 2])> {
    let (entry, exit) = span(vertices, o, d)?;
    (entry > 0.0).then(|| (exit, [share(vertices[0], vertices[1], o[0] + exit * d[0]), 0.0]))
}

/// Entry and exit of the ray's line, as `toy_box_span` of the shaders.
fn span([first, second, _]: [V3; 3], o: V3, d: V3) -> Option<(f32, f32)> {
    let (mut entry, mut exit) = (-3.0e38_f32, 3.0e38_f32);
    for axis in 0..3 {
        let (a, b) = (first[axis] - o[axis], second[axis] - o[axis]);
        if d[axis] == 0.0 {
            if (a < 0.0) == (b < 0.0) {
                return None;
            }
            continue;
        }
        let (a, b) = (a / d[axis], b / d[axis]);
        let (near, far) = if a < b { (a, b) } else { (b, a) };
        if near > entry {
            entry = near;
        }
        if far < exit {
            exit = far;
        }
    }
    (entry <= exit).then_some((entry, exit))
}
