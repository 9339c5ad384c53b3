// SPDX-License-Identifier: Apache-2.0
//! The leaves of meshes: runs the test of each kind, and decides which candidate is the hit.

use super::RayTraversal;
use crate::leaf;
use crate::leaf::triangle::hit_triangle;
use crate::simd::{PortableSimd, Simd};
use crate::vector::{V3, dot3};
use oocpt_abi::{CULL_PAD, ENTRY_SCALE, Features, GpuTriangle, LeafType, MESH_PAD, POINT_BUNDLE, SECOND_SURFACE};

/// A candidate surface that a walk reaches.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CandidateSurface {
    /// Index of the item in the mesh.
    pub(crate) item: u32,
    /// Number that the hash for opacity uses.
    pub(crate) number: u32,
    pub(crate) subset_and_sides: u32,
}

/// Result of testing a candidate for the hit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CandidateOutcome {
    /// A nearer hit is known.
    Behind,
    /// Its surface does not exist for the ray, or that is not known yet.
    Absent,
    /// It is the closest hit so far.
    Closest,
    /// It is a hit that ends the walk.
    Ends,
}

/// Number of points of a leaf.
const BUNDLE: usize = POINT_BUNDLE as usize;

impl<const ANY_HIT: bool> RayTraversal<'_, '_, ANY_HIT> {
    #[inline(always)]
    pub(super) fn visit_triangles(&mut self, simd: impl Simd, begin: u32, end: u32) -> bool {
        for index in begin..end {
            let Some(triangle) = self.pose.triangles.get::<GpuTriangle>(index as usize) else { return false };
            let mut corners: [[f32; 4]; 3] = bytemuck::cast(triangle);
            if self.pose.moves {
                let vertices = [V3(triangle.v0), V3(triangle.v1), V3(triangle.v2)];
                corners = self.pose.posed(vertices, index).map(|V3([x, y, z])| [x, y, z, 0.0]);
            }
            if let Some((t, uv)) = hit_triangle(simd, &corners, self.at.ray.origin(), self.at.d, &self.shear)
                && self.take(
                    CandidateSurface { item: index, number: index, subset_and_sides: triangle.subset_and_sides },
                    t,
                    uv,
                ) == CandidateOutcome::Ends
            {
                return true;
            }
        }
        false
    }

    #[inline(never)]
    pub(super) fn visit_others(&mut self, begin: u32, end: u32) -> bool {
        let features = self.scene.special.features;
        if !leaf::has_kinds(features) {
            return self.visit_triangles(PortableSimd, begin, end);
        }
        let Some(kind) = leaf::kind_of(self.mesh.flags, features) else { return false };
        let near = if self.pose.of_points { self.points_near(begin, end) } else { u32::MAX };
        for index in (begin..end).filter(|index| near >> (index - begin) & 1 != 0) {
            let Some((vertices, subset_and_sides)) = self.pose.item(index) else { return false };
            let (o, d) = (self.at.ray.origin(), self.at.d);
            let Some((t, uv)) = leaf::hit(kind, vertices, o, d) else { continue };
            let number = self.surface_number(kind, index);
            let first = CandidateSurface { item: index, number, subset_and_sides };
            let mut taken = self.take(first, t, uv);
            // A closed item has a second surface behind the first one, if that one does not exist.
            if taken == CandidateOutcome::Absent
                && let Some((exit, uv)) = leaf::exit(kind, vertices, o, d)
            {
                let t = self.reached(t);
                let second = CandidateSurface { number: number | SECOND_SURFACE, ..first };
                taken = self.take(second, if t > exit { t } else { exit }, uv);
            }
            if taken == CandidateOutcome::Ends {
                return true;
            }
        }
        false
    }

    /// Mask of the points of a leaf that the ray may meet, one bit each, as `points_near` of the shaders.
    fn points_near(&self, begin: u32, end: u32) -> u32 {
        let (o, d) = (self.at.ray.origin(), self.at.d);
        let dd = dot3(d, d);
        if !(1.0e-30..1.0e30).contains(&dd) {
            return u32::MAX;
        }
        let inverse = 1.0 / dd;
        let pad = 2.0 * MESH_PAD * (o.largest() + self.mesh.reach);
        // The loop is written so that the compiler vectorises it.
        let mut from = [[0.0; BUNDLE]; 3];
        let mut radii = [0.0; BUNDLE];
        for (lane, index) in (begin..end).take(BUNDLE).enumerate() {
            let Some((center, radius)) = self.pose.ball(index as usize) else { return u32::MAX };
            for axis in 0..3 {
                from[axis][lane] = o[axis] - center[axis];
            }
            radii[lane] = radius + pad;
        }
        let mut is_far = [false; BUNDLE];
        for lane in 0..BUNDLE {
            let c = V3([from[0][lane], from[1][lane], from[2][lane]]);
            let across = c - (dot3(c, d) * inverse) * d;
            is_far[lane] = dot3(across, across) > radii[lane] * radii[lane];
        }
        is_far.iter().rev().fold(0, |near, &far| near << 1 | u32::from(!far))
    }

    /// Number of the first surface of an item, as `surface_number` of the shaders: all pieces of a curve have the same.
    fn surface_number(&self, kind: u32, index: u32) -> u32 {
        let is_asked = self.scene.special.features.intersects(Features::OPACITY | Features::CUTOUTS);
        if !is_asked || kind != LeafType::ROUND.number {
            return index;
        }
        self.pose.triangles.get::<GpuTriangle>(index as usize).map_or(index, |item| item.face)
    }

    /// Distance of a surface, but at least that at which the boxes above are entered.
    #[inline(always)]
    fn reached(&self, t: f32) -> f32 {
        let entered = self.entry * ENTRY_SCALE;
        if !ANY_HIT && entered > t { entered } else { t }
    }

    /// Tests a candidate, and stores it if it is the hit.
    #[inline(always)]
    fn take(&mut self, surface: CandidateSurface, t: f32, uv: [f32; 2]) -> CandidateOutcome {
        let triangle = surface.item;
        let t = self.reached(t);
        if ANY_HIT {
            #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "as the shader")]
            if !(t < self.world.t_max) {
                return CandidateOutcome::Behind;
            }
        } else {
            let has_hit = self.hit || self.hit_before;
            if !(t < self.found.t || (has_hit && t == self.found.t && self.precedes(triangle))) {
                return CandidateOutcome::Behind;
            }
        }
        if self.scene.has(Features::OPACITY) && !self.is_opaque(surface, uv) {
            return CandidateOutcome::Absent;
        }
        if self.scene.has(Features::CUTOUTS) && !self.is_cut_in(surface, t, uv) {
            return CandidateOutcome::Absent;
        }
        self.hit = true;
        if !ANY_HIT {
            let depth = self.level_index();
            for (found, &record) in self.found.chain.iter_mut().zip(&self.chain).take(depth + 1) {
                *found = record;
            }
            (self.found.t, self.found.uv) = (t, uv);
            (self.found.triangle, self.found.chunk_instance) = (triangle, self.chunk_instance);
            self.limit = t * CULL_PAD;
        }
        if ANY_HIT { CandidateOutcome::Ends } else { CandidateOutcome::Closest }
    }

    /// Returns true if the candidate comes before the closest hit in the order of ids.
    fn precedes(&self, triangle: u32) -> bool {
        let depth = self.level_index();
        let ids = (self.chunk_instance, &self.chain[..=depth], triangle);
        ids < (self.found.chunk_instance, &self.found.chain[..=depth], self.found.triangle)
    }
}
