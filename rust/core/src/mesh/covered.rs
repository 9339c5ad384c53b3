// SPDX-License-Identifier: Apache-2.0
//! The boxes of triangles that are cut out: around what is there of them. A ray that meets nothing there need not come
//! to the triangle; one that does is decided as before, so a picture keeps its bits (decisions/0058).
//!
//! What is there is a polygon in the triangle's own coordinates, the same at all keys of what moves. Pure.

use oocpt_abi::AttributeRate;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use glam::DVec3;
use rayon::prelude::*;

use super::cover::CutoutCover;
use super::demand::BuildDemand;
use super::{Aabb, AnyAttribute, Attribute, LeafKind, MeshAsset, deform};
use crate::material::Cutout;
use crate::texture::{CoveredImage, UvRegion};

/// Of coordinates, and of opacities that are interpolated: what rounding may do, as a share of the largest of what is
/// summed.
const ROUNDING: f64 = 1.0 / (1 << 19) as f64;
/// Of the range over the triangle: what the place of a hit may be off.
const HIT: f64 = 1.0 / 512.0;

/// What is there of a triangle: corners of a convex polygon, as weights of the triangle's own.
#[derive(Clone, Copy, Debug)]
struct ClippedTriangle {
    corners: [[f64; 3]; 8],
    count: usize,
}

impl ClippedTriangle {
    const WHOLE: Self = {
        let mut corners = [[0.0; 3]; 8];
        corners[0][0] = 1.0;
        corners[1][1] = 1.0;
        corners[2][2] = 1.0;
        Self { corners, count: 3 }
    };

    fn corners(&self) -> &[[f64; 3]] {
        &self.corners[..self.count]
    }

    fn push(&mut self, corner: [f64; 3]) {
        if let Some(place) = self.corners.get_mut(self.count) {
            *place = corner;
            self.count += 1;
        }
    }

    /// What of it is where a function, given at the corners of the triangle, is not negative (Sutherland and Hodgman
    /// 1974).
    fn cut(&self, at: [f64; 3]) -> Self {
        let value = |corner: &[f64; 3]| (0..3).map(|i| corner[i] * at[i]).sum::<f64>();
        let mut cut = Self { count: 0, ..*self };
        for (i, corner) in self.corners().iter().enumerate() {
            let next = &self.corners()[(i + 1) % self.count];
            let (a, b) = (value(corner), value(next));
            if a >= 0.0 {
                cut.push(*corner);
            }
            if (a < 0.0) != (b < 0.0) {
                let share = a / (a - b);
                cut.push([0, 1, 2].map(|k| corner[k] + share * (next[k] - corner[k])));
            }
        }
        cut
    }

    /// Whether nothing was cut off.
    fn is_whole(&self) -> bool {
        self.corners() == Self::WHOLE.corners()
    }

    fn bounds(&self, vertices: &[[f32; 3]; 3]) -> Aabb {
        let vertices = vertices.map(|vertex| DVec3::from(vertex.map(f64::from)));
        self.corners().iter().fold(Aabb::EMPTY, |all, weights| {
            let at = (0..3).map(|i| weights[i] * vertices[i]).sum::<DVec3>().to_array();
            all.union(&Aabb { min: at.map(rounded_down), max: at.map(rounded_up) })
        })
    }
}

#[expect(clippy::cast_possible_truncation, reason = "rounded on purpose")]
fn rounded_down(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) > x { near.next_down() } else { near }
}

#[expect(clippy::cast_possible_truncation, reason = "rounded on purpose")]
fn rounded_up(x: f64) -> f32 {
    let near = x as f32;
    if f64::from(near) < x { near.next_up() } else { near }
}

/// A slot's cutout over a mesh.
enum CoverSlot<'a> {
    Texture { set: &'a Attribute<[f32; 2]>, transform: [[f64; 3]; 2], image: &'a CoveredImage },
    Primvar { values: &'a AnyAttribute, threshold: f64 },
}

/// Cutouts over a mesh whose attributes were read.
pub(super) struct CoveredMesh<'a> {
    mesh: &'a MeshAsset,
    slots: Vec<Option<CoverSlot<'a>>>,
}

impl<'a> CoveredMesh<'a> {
    /// None where nothing is cut out.
    fn new(mesh: &'a MeshAsset, demand: &BuildDemand<'a>) -> Option<Self> {
        if mesh.kind != LeafKind::Triangles {
            return None;
        }
        let values = |name: &Arc<str>| {
            let id = demand.wanted.iter().find(|wanted| wanted.name == *name)?.id;
            mesh.primvars.iter().find(|primvar| primvar.id == id).map(|primvar| &primvar.values)
        };
        let slot = |cover: &'a Option<CutoutCover>| {
            let CutoutCover { cutout, image } = cover.as_ref()?;
            match &**cutout {
                Cutout::Texture { set, transform, .. } => match values(set)? {
                    AnyAttribute::Two(set) => {
                        let transform = transform.map(|row| row.map(f64::from));
                        Some(CoverSlot::Texture { set, transform, image: image.as_deref()? })
                    }
                    _ => None,
                },
                Cutout::Primvar { name, threshold } => {
                    Some(CoverSlot::Primvar { values: values(name)?, threshold: f64::from(*threshold) })
                }
            }
        };
        let slots: Vec<Option<CoverSlot<'a>>> = demand.covers.iter().map(slot).collect();
        slots.iter().any(Option::is_some).then_some(Self { mesh, slots })
    }

    /// What is there of a triangle.
    fn polygon(&self, triangle: usize) -> ClippedTriangle {
        let slot = self.mesh.subsets.get(triangle).copied().unwrap_or(0);
        match self.slots.get(usize::from(slot)) {
            Some(Some(CoverSlot::Texture { set, transform, image })) => {
                let places = self.corners(set.rate, triangle).map(|at| {
                    let [s, t] = set.values.get(at).map_or([f64::NAN; 2], |st| st.map(f64::from));
                    transform.map(|[a, b, c]| [a * s, b * t, c])
                });
                in_image(image, places)
            }
            Some(Some(CoverSlot::Primvar { values, threshold })) => {
                let width = values.width() as usize;
                let value = |at: usize| values.floats().get(at * width).map_or(f64::NAN, |value| f64::from(*value));
                above(self.corners(values.rate(), triangle).map(value), *threshold)
            }
            _ => ClippedTriangle::WHOLE,
        }
    }

    /// Where an attribute has the values of a triangle's corners.
    fn corners(&self, rate: AttributeRate, triangle: usize) -> [usize; 3] {
        match rate {
            AttributeRate::Constant => [0; 3],
            AttributeRate::Uniform => [triangle; 3],
            AttributeRate::Vertex => {
                self.mesh.corner_indices.get(triangle).map_or([usize::MAX; 3], |points| points.map(|p| p as usize))
            }
            AttributeRate::FaceVarying => [0, 1, 2].map(|corner| 3 * triangle + corner),
        }
    }

    /// The box of what is there of a triangle while the shutter is open, where that is not all of it; empty where
    /// nothing is.
    fn clipped(&self, triangle: usize) -> Option<Aabb> {
        let polygon = self.polygon(triangle);
        let own = self.mesh.triangles.get(triangle).filter(|_| !polygon.is_whole())?;
        if polygon.count == 0 {
            return Some(Aabb::EMPTY);
        }
        let whole = self.mesh.item_bounds(triangle);
        let keys = &self.mesh.keys;
        let mut all = polygon.bounds(&own.vertices);
        if !keys.times.is_empty() {
            let later = keys.of(triangle, self.mesh.triangles.len());
            all = deform::padded(later.fold(all, |all, vertices| all.union(&polygon.bounds(vertices))), &whole);
        }
        let (min, max) =
            ([0, 1, 2].map(|k| all.min[k].max(whole.min[k])), [0, 1, 2].map(|k| all.max[k].min(whole.max[k])));
        let clipped = Aabb { min, max };
        // Numbers that are not usable: as if nothing were known.
        Some(clipped).filter(|clipped| !clipped.is_empty())
    }
}

/// The boxes of a mesh's triangles, empty ones of those of which nothing is there; none where nothing is cut off, or
/// nothing is left.
pub(super) fn covered_boxes(mesh: &MeshAsset, demand: &BuildDemand<'_>) -> Option<Vec<Aabb>> {
    let covered = CoveredMesh::new(mesh, demand)?;
    let is_cut = AtomicBool::new(false);
    let bounds = |triangle: usize| match covered.clipped(triangle) {
        Some(clipped) => {
            is_cut.store(true, Ordering::Relaxed);
            clipped
        }
        None => mesh.item_bounds(triangle),
    };
    let boxes: Vec<Aabb> = (0..mesh.triangles.len()).into_par_iter().map(bounds).collect();
    // A mesh has one triangle at least.
    (is_cut.into_inner() && boxes.iter().any(|bounds| !bounds.is_empty())).then_some(boxes)
}

/// What of a triangle lies where an image has something. `places`: of its corners, for each coordinate what is summed.
fn in_image(image: &CoveredImage, places: [[[f64; 3]; 2]; 3]) -> ClippedTriangle {
    let at = |axis: usize| places.map(|place| place[axis].iter().sum::<f64>());
    let axes = [at(0), at(1)];
    let low = axes.map(|values| values.into_iter().fold(f64::INFINITY, f64::min));
    let high = axes.map(|values| values.into_iter().fold(f64::NEG_INFINITY, f64::max));
    let summed = |axis: usize| places.iter().map(|place| place[axis].iter().map(|x| x.abs()).sum()).fold(1.0, f64::max);
    let rounding = [0, 1].map(|axis| ROUNDING * summed(axis));
    if !axes.as_flattened().iter().chain(&rounding).all(|x| x.is_finite()) {
        return ClippedTriangle::WHOLE;
    }
    let grown = |[low, high]: UvRegion, by: [f64; 2]| [[0, 1].map(|i| low[i] - by[i]), [0, 1].map(|i| high[i] + by[i])];
    let Some(there) = image.within(grown([low, high], rounding), rounding.map(|by| 2.0 * by)) else {
        return ClippedTriangle { count: 0, ..ClippedTriangle::WHOLE };
    };
    let by = [0, 1].map(|i| rounding[i] + HIT * (high[i] - low[i]));
    let [from, to] = grown(there, by);
    (0..2).fold(ClippedTriangle::WHOLE, |polygon, axis| {
        polygon.cut(axes[axis].map(|x| x - from[axis])).cut(axes[axis].map(|x| to[axis] - x))
    })
}

/// What of a triangle may have an interpolated value that is at or above a threshold, or above 0.
fn above(values: [f64; 3], threshold: f64) -> ClippedTriangle {
    let largest = values.iter().fold(threshold.abs(), |largest, value| largest.max(value.abs()));
    if !values.iter().all(|value| value.is_finite()) {
        return ClippedTriangle::WHOLE;
    }
    let [low, high] =
        [values.iter().fold(f64::INFINITY, |a, b| a.min(*b)), values.iter().fold(f64::NEG_INFINITY, |a, b| a.max(*b))];
    // Weights of a hit may be a little less than 0: only what is 0 at all corners is so everywhere.
    if threshold <= 0.0 && largest <= 0.0 {
        return ClippedTriangle { count: 0, ..ClippedTriangle::WHOLE };
    }
    let margin = ROUNDING * largest + HIT * (high - low);
    ClippedTriangle::WHOLE.cut(values.map(|value| value - threshold + margin))
}

#[cfg(test)]
mod tests;
