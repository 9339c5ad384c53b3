// SPDX-License-Identifier: Apache-2.0
//! The triangles of one mesh that emit light, with the weights that its materials have for one prim: leaves of a few
//! faces each and a tree over them, all in the mesh's frame. Shared by all placements that weigh the same. Pure.

use super::emission::{EmittedPower, PrimEmission, halves};
use super::narrow;
use super::program::{EmissionCorner, with_floor};
use super::tree::{self, LightBounds, NOTHING};
use oocpt_abi::{GpuLightLeaf, GpuLightNode, GpuLightTriangle};
use oocpt_core::mesh::MeshAsset;
use rustc_hash::FxHashMap;
use std::f64::consts::FRAC_PI_2;

/// Most leaves of a mesh; larger ones get more faces to a leaf.
const MAX_LEAVES: usize = 4096;
/// How much is thought of the inside of a closed mesh.
const INSIDE: f64 = 0.05;

/// See the module. Indices count from 0 in each table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MeshEmitter {
    pub(super) nodes: Vec<GpuLightNode>,
    pub(super) leaves: Vec<GpuLightLeaf>,
    pub(super) triangles: Vec<GpuLightTriangle>,
    /// Face and leaf, by face.
    pub(super) faces: Vec<[u32; 2]>,
    /// Weight of a unit of area, by place in `faces`.
    pub(super) face_weights: Vec<f32>,
    /// What `triangles` have at their corners, and their weight.
    pub(super) values: Vec<([[f32; 3]; 3], f32)>,
    /// What `triangles` have at their corners that a program reads; `None` of other emissions.
    pub(super) corners: Vec<Option<[EmissionCorner; 3]>>,
    /// Some of it varies, or is not in the material.
    pub(super) varies: bool,
    /// All of it in the mesh's frame; the power is the sum of areas times weights.
    pub(super) bounds: LightBounds,
}

/// A triangle that emits.
#[derive(Clone, Copy)]
struct EmittingTriangle {
    triangle: usize,
    face: u32,
    slot: u16,
    weight: f64,
    varies: bool,
    area: f64,
    corners: [[f32; 3]; 3],
    bounds: LightBounds,
}

type Point = [f64; 3];

pub(super) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

impl MeshEmitter {
    /// `None` where nothing emits.
    pub(super) fn new(mesh: &MeshAsset, emission: &PrimEmission) -> Option<Self> {
        let mut parts: Vec<EmittingTriangle> =
            (0..mesh.triangles.len()).filter_map(|at| part(mesh, emission, at)).collect();
        if parts.iter().any(|part| part.varies) {
            weigh_programs(&mut parts, mesh, emission);
            parts.sort_by_key(|part| part.face);
            for face in parts.chunk_by_mut(|a, b| a.face == b.face).filter(|face| face[0].varies) {
                even_out(face);
            }
            parts.retain(|part| part.bounds.power > 0.0);
        }
        let closed = if parts.len() == mesh.triangles.len() { closed(mesh) } else { None };
        if let Some(turn) = closed {
            for part in &mut parts {
                part.bounds.axis = part.bounds.axis.map(|x| turn * x);
                part.bounds.back = INSIDE;
            }
        }
        let total: f64 = parts.iter().map(|part| part.bounds.power).sum();
        if !(total > 0.0 && total.is_finite()) {
            return None;
        }
        parts.sort_by_key(|part| part.face);
        let mut groups: Vec<&[EmittingTriangle]> = parts.chunk_by(|a, b| a.face == b.face).collect();
        // Faces that are near each other come to one leaf.
        let bounds = parts.iter().fold(NOTHING, |sum, part| sum.union(&part.bounds));
        groups.sort_by_cached_key(|group| (morton(&bounds, group), group[0].face));
        let size = groups.len().div_ceil(MAX_LEAVES).max(1);
        let mut emitter = Self {
            nodes: Vec::new(),
            leaves: Vec::new(),
            triangles: Vec::new(),
            faces: Vec::new(),
            face_weights: Vec::new(),
            values: Vec::new(),
            corners: Vec::new(),
            varies: parts.iter().any(|part| part.varies),
            bounds,
        };
        let mut leaf_bounds = Vec::new();
        for groups in groups.chunks(size) {
            leaf_bounds.push(emitter.add_leaf(mesh, emission, groups, total));
        }
        emitter.nodes = tree::build(&leaf_bounds);
        let trails = tree::trails(&emitter.nodes, emitter.leaves.len());
        for (leaf, trail) in emitter.leaves.iter_mut().zip(trails) {
            leaf.trail = halves(trail);
        }
        let mut faces: Vec<_> = emitter.faces.iter().copied().zip(emitter.face_weights.iter().copied()).collect();
        faces.sort_unstable_by_key(|(face, _)| *face);
        (emitter.faces, emitter.face_weights) = faces.into_iter().unzip();
        emitter.is_sound().then_some(emitter)
    }

    /// Whether all numbers that shaders divide by and multiply with mean something.
    fn is_sound(&self) -> bool {
        self.leaves.iter().all(|leaf| leaf.total > 0.0 && leaf.total.is_finite())
            && self.face_weights.iter().all(|weight| weight.is_finite())
    }

    fn add_leaf(
        &mut self,
        mesh: &MeshAsset,
        emission: &PrimEmission,
        groups: &[&[EmittingTriangle]],
        whole: f64,
    ) -> LightBounds {
        let number = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        let leaf = number(self.leaves.len());
        let first = self.triangles.len();
        let parts = || groups.iter().copied().flatten();
        let total: f64 = parts().map(|part| part.bounds.power).sum();
        let mut sum = 0.0;
        for part in parts() {
            sum += part.bounds.power;
            let [v0, v1, v2] = mesh.triangles[part.triangle].vertices;
            let cumulative = narrow(sum / total);
            let (subset, face) = (u32::from(part.slot), part.face);
            self.triangles.push(GpuLightTriangle { v0, cumulative, v1, subset, v2, face });
            self.values.push((part.corners, narrow(part.weight)));
            let power = emission.by_slot.get(usize::from(part.slot));
            self.corners.push(power.and_then(|power| power.program_corners(mesh, part.triangle)));
        }
        if let Some(last) = self.triangles.last_mut() {
            last.cumulative = 1.0;
        }
        self.faces.extend(groups.iter().map(|group| [group[0].face, leaf]));
        self.face_weights.extend(groups.iter().map(|group| narrow(group[0].weight)));
        let count = number(self.triangles.len() - first);
        self.leaves.push(GpuLightLeaf { first: number(first), count, total: narrow(total), pad: 0, trail: [0; 2] });
        let bounds = parts().fold(NOTHING, |sum, part| sum.union(&part.bounds));
        LightBounds { power: bounds.power / whole, ..bounds }
    }
}

/// Weighs what programs emit, slot by slot.
fn weigh_programs(parts: &mut [EmittingTriangle], mesh: &MeshAsset, emission: &PrimEmission) {
    for (slot, power) in (0_u16..).zip(&emission.by_slot) {
        let Some(program) = power.program() else { continue };
        let own = |part: &&mut EmittingTriangle| part.slot == slot;
        let steps = program.steps(parts.iter().filter(|part| part.slot == slot).count());
        let (mut sum, mut area) = (0.0, 0.0);
        for part in parts.iter_mut().filter(own) {
            part.weight = program.weight(mesh, part.triangle, steps) / f64::from(emission.scale);
            sum += part.area * part.weight;
            area += part.area;
        }
        for part in parts.iter_mut().filter(own) {
            part.weight = with_floor(part.weight, sum / area);
            part.bounds.power = part.area * part.weight;
        }
    }
}

/// Gives the triangles of a face one weight for a unit of area: a hit knows its face, and no more.
fn even_out(face: &mut [EmittingTriangle]) {
    let power: f64 = face.iter().map(|part| part.bounds.power).sum();
    let area: f64 = face.iter().map(|part| part.area).sum();
    // As the shaders have it.
    let weight = f64::from(narrow(power / area));
    for part in face {
        part.weight = weight;
        part.bounds.power = part.area * weight;
    }
}

/// A triangle, if its slot emits.
fn part(mesh: &MeshAsset, emission: &PrimEmission, at: usize) -> Option<EmittingTriangle> {
    let triangle = mesh.triangles.get(at)?;
    let slot = mesh.subsets.get(at).copied().unwrap_or(0);
    let emitted: &EmittedPower = emission.by_slot.get(usize::from(slot))?;
    let corners = emitted.corners(mesh, at);
    let weight = emitted.weight(&corners, emission.scale);
    let [a, b, c] = triangle.vertices.map(|v| v.map(f64::from));
    let normal = cross(sub(b, a), sub(c, a));
    let length = dot(normal, normal).sqrt();
    let power = 0.5 * length * weight;
    let varies = emitted.varies();
    // What is black at one place of a face may not be at another.
    if !(length > 0.0 && power.is_finite() && (power > 0.0 || varies)) {
        return None;
    }
    let [min, max] = [f64::min, f64::max].map(|f: fn(f64, f64) -> f64| [0, 1, 2].map(|k| f(f(a[k], b[k]), c[k])));
    let axis = normal.map(|x| x / length);
    let bounds = LightBounds { min, max, axis, spread: 0.0, emission: FRAC_PI_2, back: 1.0, power };
    Some(EmittingTriangle {
        triangle: at,
        face: triangle.face,
        slot,
        weight,
        varies,
        area: 0.5 * length,
        corners,
        bounds,
    })
}

/// Place of a face on a curve through the box, ten bits an axis.
fn morton(all: &LightBounds, group: &[EmittingTriangle]) -> u32 {
    let bounds = group.iter().fold(NOTHING, |sum, part| sum.union(&part.bounds));
    let mut code = 0;
    for k in 0..3 {
        let at = 0.5 * (bounds.min[k] + bounds.max[k]) - all.min[k];
        let extent = all.max[k] - all.min[k];
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to ten bits")]
        let cell = if extent > 0.0 { (at / extent * 1024.0).clamp(0.0, 1023.0) as u32 } else { 0 };
        for bit in 0..10 {
            code |= (cell >> bit & 1) << (3 * bit + k);
        }
    }
    code
}

/// For a mesh without edges of its own: 1 where its corners go round counterclockwise as seen from outside, else -1.
fn closed(mesh: &MeshAsset) -> Option<f64> {
    // How often an edge is gone along, less how often against; corners are told by their positions.
    let mut edges: FxHashMap<[[u32; 3]; 2], i32> = FxHashMap::default();
    let mut volume = 0.0;
    for triangle in &mesh.triangles {
        // 0 and -0 are one place.
        let bits = triangle.vertices.map(|v| v.map(|x| (x + 0.0).to_bits()));
        for k in 0..3 {
            let (from, to) = (bits[k], bits[(k + 1) % 3]);
            let (edge, turn) = if from < to { ([from, to], 1) } else { ([to, from], -1) };
            *edges.entry(edge).or_default() += turn;
        }
        let [a, b, c] = triangle.vertices.map(|v| v.map(f64::from));
        volume += dot(a, cross(b, c));
    }
    (edges.values().all(|&sum| sum == 0) && volume != 0.0).then(|| volume.signum())
}
