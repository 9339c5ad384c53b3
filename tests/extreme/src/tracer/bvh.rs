// SPDX-License-Identifier: Apache-2.0
//! Triangles in f64 under a tree cut at the median, and the nearest one that a ray meets (Moeller and Trumbore 1997).

use glam::DVec3;

/// Most triangles of a leaf.
const LEAF: usize = 4;

/// A ray; distances are in units of its direction.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    pub(crate) o: DVec3,
    pub(crate) d: DVec3,
}

impl Ray {
    /// The point at a distance.
    pub(crate) fn at(&self, t: f64) -> DVec3 {
        self.o + self.d * t
    }
}

/// A node: its box, and either children or triangles.
struct Node {
    min: DVec3,
    max: DVec3,
    /// Right child, the left one follows the node; 0 for a leaf.
    right: usize,
    first: usize,
    count: usize,
}

/// The tree.
pub(crate) struct Bvh {
    nodes: Vec<Node>,
    order: Vec<usize>,
    corners: Vec<[DVec3; 3]>,
}

/// What a ray meets.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Crossing {
    pub(crate) t: f64,
    pub(crate) triangle: usize,
}

impl Bvh {
    /// A tree over `corners`.
    pub(crate) fn new(corners: Vec<[DVec3; 3]>) -> Self {
        let mut bvh = Self { nodes: Vec::new(), order: (0..corners.len()).collect(), corners };
        if !bvh.order.is_empty() {
            bvh.build(0, bvh.order.len());
        }
        bvh
    }

    /// Corners of a triangle.
    pub(crate) fn corners(&self, triangle: usize) -> [DVec3; 3] {
        self.corners[triangle]
    }

    fn build(&mut self, begin: usize, end: usize) {
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &triangle in &self.order[begin..end] {
            for p in self.corners[triangle] {
                (min, max) = (min.min(p), max.max(p));
            }
        }
        // A box is a little larger than what is in it: the slab test rounds.
        let pad = (max - min).max_element().max(min.abs().max(max.abs()).max_element()) * 1e-15;
        let at = self.nodes.len();
        let node = Node { min: min - pad, max: max + pad, right: 0, first: begin, count: end - begin };
        self.nodes.push(node);
        if end - begin <= LEAF {
            return;
        }
        let size = max - min;
        let axis = if size.x >= size.max_element() { 0 } else { 1 + usize::from(size.z > size.y) };
        let middle = begin + (end - begin) / 2;
        let corners = &self.corners;
        let place = |t: &usize| corners[*t].iter().map(|p| p[axis]).sum::<f64>();
        self.order[begin..end].select_nth_unstable_by(middle - begin, |a, b| place(a).total_cmp(&place(b)));
        self.build(begin, middle);
        self.nodes[at].right = self.nodes.len();
        self.build(middle, end);
    }

    /// The nearest crossing in front of the ray's origin and before `limit`; `without` is a triangle that does not
    /// count.
    pub(crate) fn nearest(&self, ray: &Ray, limit: f64, without: Option<usize>) -> Option<Crossing> {
        self.walk(ray, limit, without, false)
    }

    /// Whether anything is in the way.
    pub(crate) fn is_blocked(&self, ray: &Ray, limit: f64, without: Option<usize>) -> bool {
        self.walk(ray, limit, without, true).is_some()
    }

    fn walk(&self, ray: &Ray, mut limit: f64, without: Option<usize>, any: bool) -> Option<Crossing> {
        if self.nodes.is_empty() {
            return None;
        }
        let reciprocal = ray.d.recip();
        let mut best = None;
        let mut stack = [0_usize; 96];
        let mut top = 1;
        while top > 0 {
            top -= 1;
            let at = stack[top];
            let node = &self.nodes[at];
            if !enters(node, ray, reciprocal, limit) {
                continue;
            }
            if node.right != 0 && top + 2 <= stack.len() {
                stack[top] = node.right;
                stack[top + 1] = at + 1;
                top += 2;
                continue;
            }
            for &triangle in &self.order[node.first..node.first + node.count] {
                if Some(triangle) == without {
                    continue;
                }
                if let Some(t) = crossing(self.corners[triangle], ray).filter(|t| *t > 0.0 && *t < limit) {
                    limit = t;
                    best = Some(Crossing { t, triangle });
                    if any {
                        return best;
                    }
                }
            }
        }
        best
    }
}

fn enters(node: &Node, ray: &Ray, reciprocal: DVec3, limit: f64) -> bool {
    let (mut near, mut far) = (0.0_f64, limit);
    for k in 0..3 {
        let (min, max) = (node.min[k] - ray.o[k], node.max[k] - ray.o[k]);
        if reciprocal[k].is_infinite() {
            // Along the slab: in it or never.
            if min > 0.0 || max < 0.0 {
                return false;
            }
            continue;
        }
        let (a, b) = (min * reciprocal[k], max * reciprocal[k]);
        near = near.max(a.min(b));
        far = far.min(a.max(b));
    }
    near <= far * (1.0 + 1e-14)
}

fn crossing([a, b, c]: [DVec3; 3], ray: &Ray) -> Option<f64> {
    let (e, f) = (b - a, c - a);
    let p = ray.d.cross(f);
    let determinant = e.dot(p);
    if determinant == 0.0 {
        return None;
    }
    let s = ray.o - a;
    let u = s.dot(p) / determinant;
    let q = s.cross(e);
    let v = ray.d.dot(q) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0).then(|| f.dot(q) / determinant)
}
