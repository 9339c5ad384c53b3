// SPDX-License-Identifier: Apache-2.0
//! The boxes of chunk instances, seen from the render's camera: the nearest few per pixel, front to back.

use glam::{DVec3, Vec3};
use oocpt_core::mesh::{Aabb, Bvh2, build_box_bvh};
use oocpt_render::chunk_report::{ChunkReport, ReportCamera};

/// Boxes that one pixel blends.
pub(crate) const LAYERS: usize = 6;

/// Where a ray enters a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct BoxEntry {
    /// Number of the chunk instance.
    pub(crate) instance: u32,
    /// Distance in ray directions.
    pub(crate) t: f64,
    /// Axis of the face entered.
    pub(crate) axis: usize,
    /// The ray passes within a pixel of an edge of the face.
    pub(crate) is_edge: bool,
    /// Size of the box as a part of the picture's width, at the distance of entry.
    pub(crate) size: f64,
}

/// Boxes under a hierarchy.
#[derive(Debug)]
pub(crate) struct BoxHierarchy {
    boxes: Vec<Aabb>,
    bvh: Bvh2,
    camera: ReportCamera,
    /// Pixels of the picture, from left to right.
    width: f64,
}

/// A ray and the size of its pixel, which may grow with the distance.
struct PixelRay {
    origin: DVec3,
    inverse: DVec3,
    direction: DVec3,
    /// At distance 0, and its growth to distance 1.
    pixel: [f64; 2],
}

impl BoxHierarchy {
    pub(crate) fn new(report: &ChunkReport) -> Self {
        let boxes: Vec<Aabb> = report.instances.iter().map(|i| Aabb { min: i.bounds[0], max: i.bounds[1] }).collect();
        let bvh = build_box_bvh(&boxes);
        Self { boxes, bvh, camera: report.camera, width: f64::from(report.width.max(1)) }
    }

    /// The nearest boxes that the ray through `(x, y)`, in pixels from the lower left corner, enters from outside, near
    /// to far. Boxes around the camera are left out: they would cover everything.
    pub(crate) fn enter(&self, x: f64, y: f64) -> Vec<BoxEntry> {
        let at =
            |base: [f64; 3], dx: [f64; 3], dy: [f64; 3]| DVec3::from(base) + x * DVec3::from(dx) + y * DVec3::from(dy);
        let ReportCamera { o, o_x, o_y, d, d_x, d_y } = self.camera;
        let direction = at(d, d_x, d_y);
        let ray = PixelRay {
            origin: at(o, o_x, o_y),
            inverse: direction.recip(),
            direction,
            pixel: [[o_x, o_y], [d_x, d_y]].map(|[x, y]| DVec3::from(x).length().max(DVec3::from(y).length())),
        };
        let mut found: Vec<BoxEntry> = Vec::with_capacity(LAYERS + 1);
        let mut open = vec![0_u32];
        while let Some(node) = open.pop().and_then(|node| self.bvh.nodes.get(node as usize)) {
            for side in 0..2 {
                let bounds = node.bounds(side);
                let limit = if found.len() < LAYERS { f64::INFINITY } else { found[LAYERS - 1].t };
                match (node.count[side], ray.hit(&bounds)) {
                    (0, Some((enter, exit, _))) if exit >= 0.0 && enter <= limit && !bounds.is_empty() => {
                        // Child 0 of an absent side is the root, but an absent side has an empty box.
                        open.push(node.child[side]);
                    }
                    (1.., Some(_)) => self.try_box(node.child[side], &ray, &mut found),
                    _ => {}
                }
            }
        }
        found
    }

    /// Sorts a box into `found` if it is among the nearest.
    fn try_box(&self, instance: u32, ray: &PixelRay, found: &mut Vec<BoxEntry>) {
        let Some(bounds) = self.boxes.get(instance as usize) else { return };
        let Some((t, exit, axis)) = ray.hit(bounds) else { return };
        if t <= 0.0 || exit < t {
            return;
        }
        let extent = (Vec3::from(bounds.max) - Vec3::from(bounds.min)).max_element();
        let size = f64::from(extent) / (self.width * ray.pixel_at(t)).max(1e-30);
        let entry = BoxEntry { instance, t, axis, is_edge: ray.is_at_edge(bounds, t, axis), size };
        // Ties by number, so that the picture does not depend on the walk.
        let place = found.partition_point(|other| (other.t, other.instance) < (t, instance));
        found.insert(place, entry);
        found.truncate(LAYERS);
    }
}

impl PixelRay {
    /// Entry, exit and axis of entry.
    fn hit(&self, bounds: &Aabb) -> Option<(f64, f64, usize)> {
        let (min, max) = (Vec3::from(bounds.min).as_dvec3(), Vec3::from(bounds.max).as_dvec3());
        let (a, b) = ((min - self.origin) * self.inverse, (max - self.origin) * self.inverse);
        let (near, far) = (a.min(b), a.max(b));
        let (enter, exit) = (near.max_element(), far.min_element());
        (enter <= exit).then(|| (enter, exit, near.max_position()))
    }

    /// Size of the ray's pixel at `t`.
    fn pixel_at(&self, t: f64) -> f64 {
        self.pixel[0] + self.pixel[1] * t
    }

    /// Whether the point at `t` on the face of `axis` is within a pixel of the face's border.
    fn is_at_edge(&self, bounds: &Aabb, t: f64, axis: usize) -> bool {
        let point = self.origin + self.direction * t;
        let width = self.pixel_at(t);
        (0..3).filter(|&k| k != axis).any(|k| {
            let (low, high) = (f64::from(bounds.min[k]), f64::from(bounds.max[k]));
            // Seen at an angle a pixel covers more, but thin lines are what is wanted.
            (point[k] - low).min(high - point[k]) < width
        })
    }
}
