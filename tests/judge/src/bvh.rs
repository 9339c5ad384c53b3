// SPDX-License-Identifier: Apache-2.0
//! A median-split bounding box tree over world triangles in f64, and the Möller-Trumbore test (1997).
//!
//! Nothing clever: its one virtue is that it shares nothing with the product's traversal. Tested against brute force.

use glam::DVec3;

use crate::camera::Ray;

const LEAF_SIZE: usize = 4;

/// Where a ray meets a triangle: distance in units of the ray's direction, and the weights of corners 1 and 2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Crossing {
    pub(crate) t: f64,
    pub(crate) u: f64,
    pub(crate) v: f64,
    pub(crate) triangle: usize,
}

#[derive(Debug)]
enum Node {
    Leaf { first: usize, count: usize },
    Inner { left: usize, right: usize },
}

#[derive(Debug)]
pub(crate) struct Bvh {
    nodes: Vec<(DVec3, DVec3, Node)>,
    order: Vec<usize>,
}

pub(crate) fn intersect_triangle(ray: &Ray, corners: &[DVec3; 3]) -> Option<(f64, f64, f64)> {
    let (edge1, edge2) = (corners[1] - corners[0], corners[2] - corners[0]);
    let p = ray.direction.cross(edge2);
    let determinant = edge1.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = ray.origin - corners[0];
    let u = s.dot(p) / determinant;
    let q = s.cross(edge1);
    let v = ray.direction.dot(q) / determinant;
    let t = edge2.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 0.0).then_some((t, u, v))
}

impl Bvh {
    pub(crate) fn build(triangles: &[[DVec3; 3]]) -> Self {
        let mut bvh = Self { nodes: Vec::new(), order: (0..triangles.len()).collect() };
        if !triangles.is_empty() {
            let mut order = std::mem::take(&mut bvh.order);
            bvh.split(triangles, &mut order, 0);
            bvh.order = order;
        }
        bvh
    }

    fn split(&mut self, triangles: &[[DVec3; 3]], order: &mut [usize], offset: usize) -> usize {
        let corners = || order.iter().flat_map(|&i| triangles[i]);
        let min = corners().fold(DVec3::INFINITY, DVec3::min);
        let max = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let index = self.nodes.len();
        self.nodes.push((min, max, Node::Leaf { first: offset, count: order.len() }));
        if order.len() > LEAF_SIZE {
            let axis = (max - min).max_position();
            let middle = order.len() / 2;
            let centre = |i: &usize| triangles[*i].iter().map(|corner| corner[axis]).sum::<f64>();
            order.select_nth_unstable_by(middle, |a, b| centre(a).total_cmp(&centre(b)).then(a.cmp(b)));
            let (low, high) = order.split_at_mut(middle);
            let left = self.split(triangles, low, offset);
            let right = self.split(triangles, high, offset + middle);
            self.nodes[index].2 = Node::Inner { left, right };
        }
        index
    }

    /// Calls `visit` for triangles the ray crosses nearer than the returned bound; `visit` returns the new bound.
    pub(crate) fn visit(
        &self,
        triangles: &[[DVec3; 3]],
        ray: &Ray,
        limit: f64,
        mut visit: impl FnMut(Crossing) -> f64,
    ) -> f64 {
        let mut limit = limit;
        let mut stack = if self.nodes.is_empty() { Vec::new() } else { vec![0] };
        while let Some(index) = stack.pop() {
            let (min, max, node) = &self.nodes[index];
            if !enters_box(ray, *min, *max, limit) {
                continue;
            }
            match *node {
                Node::Inner { left, right } => stack.extend([left, right]),
                Node::Leaf { first, count } => {
                    for &triangle in &self.order[first..first + count] {
                        if let Some((t, u, v)) = intersect_triangle(ray, &triangles[triangle])
                            && t <= limit
                        {
                            limit = visit(Crossing { t, u, v, triangle });
                        }
                    }
                }
            }
        }
        limit
    }
}

/// Slab test with a margin far above f64 rounding, so that no crossing is lost at a box face.
fn enters_box(ray: &Ray, min: DVec3, max: DVec3, limit: f64) -> bool {
    let (mut near, mut far) = (0.0_f64, limit * (1.0 + 1e-12));
    for axis in 0..3 {
        let margin = 1e-12 * (min[axis].abs() + max[axis].abs() + ray.origin[axis].abs());
        let (low, high) = (min[axis] - margin - ray.origin[axis], max[axis] + margin - ray.origin[axis]);
        let slope = ray.direction[axis];
        if slope == 0.0 {
            if low > 0.0 || high < 0.0 {
                return false;
            }
            continue;
        }
        let (a, b) = (low / slope, high / slope);
        near = near.max(a.min(b) * (1.0 - 1e-12));
        far = far.min(a.max(b) * (1.0 + 1e-12));
    }
    near <= far
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Random;

    #[test]
    fn tree_finds_what_brute_force_finds() {
        let mut random = Random::new(7, 0, 0);
        let mut point = |scale: f64| (DVec3::new(random.uniform(), random.uniform(), random.uniform()) - 0.5) * scale;
        let triangles: Vec<[DVec3; 3]> = (0..500)
            .map(|_| {
                let centre = point(10.0);
                [centre + point(2.0), centre + point(2.0), centre + point(2.0)]
            })
            .collect();
        let bvh = Bvh::build(&triangles);
        let mut hits = 0;
        for _ in 0..2000 {
            let ray = Ray { origin: point(20.0), direction: point(2.0) };
            let nearest = triangles.iter().filter_map(|t| intersect_triangle(&ray, t)).map(|hit| hit.0);
            let brute = nearest.fold(f64::INFINITY, f64::min);
            let found = bvh.visit(&triangles, &ray, f64::INFINITY, |crossing| crossing.t);
            assert_eq!(brute.to_bits(), found.to_bits(), "ray {ray:?}");
            hits += usize::from(brute.is_finite());
        }
        assert!(hits > 200, "the rays of this test must hit something, only {hits} did");
    }
}
