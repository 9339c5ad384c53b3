// SPDX-License-Identifier: Apache-2.0
//! Control meshes.
#![allow(clippy::cast_possible_truncation, reason = "small numbers")]

use oocpt_subdiv::{ControlMesh, SubdivisionRules};

pub(crate) struct Shape {
    pub(crate) points: Vec<[f32; 3]>,
    pub(crate) counts: Vec<i32>,
    pub(crate) corners: Vec<i32>,
}

impl Shape {
    pub(crate) fn positions(&self) -> &[f32] {
        self.points.as_flattened()
    }

    pub(crate) fn control(&self, rules: SubdivisionRules) -> ControlMesh<'_> {
        ControlMesh {
            rules,
            point_count: self.points.len(),
            face_counts: &self.counts,
            face_points: &self.corners,
            ..ControlMesh::default()
        }
    }

    /// Both points of every edge, each edge once.
    pub(crate) fn edges(&self) -> Vec<i32> {
        let (mut edges, mut first) = (Vec::new(), 0);
        for &count in &self.counts {
            let count = usize::try_from(count).unwrap();
            for k in 0..count {
                let (a, b) = (self.corners[first + k], self.corners[first + (k + 1) % count]);
                if a < b {
                    edges.extend([a, b]);
                }
            }
            first += count;
        }
        edges
    }

    pub(crate) fn split_into_triangles(&self) -> Self {
        let quads = self.corners.chunks(4);
        let corners: Vec<i32> = quads.flat_map(|q| [q[0], q[1], q[2], q[0], q[2], q[3]]).collect();
        Self { points: self.points.clone(), counts: vec![3; corners.len() / 3], corners }
    }
}

/// From -1 to 1.
pub(crate) fn cube() -> Shape {
    let coordinate = |k: usize, bit: usize| if k >> bit & 1 == 1 { 1.0 } else { -1.0 };
    Shape {
        points: (0..8).map(|k| [coordinate(k, 0), coordinate(k, 1), coordinate(k, 2)]).collect(),
        counts: vec![4; 6],
        corners: vec![0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5],
    }
}

pub(crate) fn octahedron() -> Shape {
    Shape {
        points: vec![
            [1.0, 0.0, 0.0],
            [-1.0, 0.0, 0.0],
            [0.0, 1.0, 0.0],
            [0.0, -1.0, 0.0],
            [0.0, 0.0, 1.0],
            [0.0, 0.0, -1.0],
        ],
        counts: vec![3; 8],
        corners: vec![0, 2, 4, 2, 1, 4, 1, 3, 4, 3, 0, 4, 2, 0, 5, 1, 2, 5, 3, 1, 5, 0, 3, 5],
    }
}

/// `side` times `side` points at whole numbers, moved.
pub(crate) fn grid(side: usize, place: impl Fn(f64, f64) -> [f64; 3]) -> Shape {
    let at = |k: usize| place((k % side) as f64, (k / side) as f64).map(|v| v as f32);
    let quad = |k: usize| {
        let (x, y) = (k % (side - 1), k / (side - 1));
        [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)].map(|(x, y)| i32::try_from(y * side + x).unwrap())
    };
    let faces = (side - 1) * (side - 1);
    Shape {
        points: (0..side * side).map(at).collect(),
        counts: vec![4; faces],
        corners: (0..faces).flat_map(quad).collect(),
    }
}
