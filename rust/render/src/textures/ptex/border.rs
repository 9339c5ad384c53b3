// SPDX-License-Identifier: Apache-2.0
//! The texels beyond the edges and corners of a Ptex face: the border of its block. Pure.
//!
//! Edge 0 is v = 0, then counterclockwise: u = 1, v = 1, u = 0; edge `k` begins at corner `k`. Along a shared edge the
//! two faces go in opposite directions. A face of a quad mesh that meets an n-gon has two of its faces (subfaces) along
//! one edge: the file names the one at the first half of the edge, and the other one is next to that. Files may be
//! wrong: every number is checked, and walks are bounded.

use super::pyramid::{FaceEdges, FacePyramid};
use oocpt_core::texture::{FaceBlock, class_size};
use oocpt_ptex::{BorderMode, PtexFace};
use rustc_hash::FxHashMap;

/// Most faces around a corner that are visited.
const MAX_VALENCE: usize = 32;

/// The faces that the border of a face reads, itself included; with repetitions.
pub(super) fn neighbours(faces: &[PtexFace], face: u32) -> Vec<u32> {
    let mut all = Vec::new();
    for edge in 0..4 {
        for t in [0.25, 0.75] {
            all.extend(beyond(faces, face, edge, t).map(|(neighbour, ..)| neighbour));
        }
        all.extend(around(faces, face, edge).unwrap_or_default().into_iter().map(|(neighbour, _)| neighbour));
    }
    all
}

/// The neighbour at the place `t` (0 to 1) of an edge: face, its edge, the place there, and the length of our edge in
/// units of its edge.
fn beyond(faces: &[PtexFace], face: u32, edge: u8, t: f64) -> Option<(u32, u8, f64, f64)> {
    let own = faces.get(face as usize)?;
    let (other, other_edge) = (*own.adjacent.get(usize::from(edge))?)?;
    let neighbour = faces.get(other as usize)?;
    match (own.is_subface, neighbour.is_subface) {
        (false, true) if t < 0.5 => Some((other, other_edge, 1.0 - 2.0 * t, 2.0)),
        (false, true) => {
            let (second, second_edge) = (*neighbour.adjacent.get((usize::from(other_edge) + 3) % 4)?)?;
            Some((second, (second_edge + 3) % 4, 2.0 - 2.0 * t, 2.0))
        }
        (true, false) => {
            let back = (*neighbour.adjacent.get(usize::from(other_edge))?).map(|(face, _)| face);
            let begin = if back == Some(face) { 0.0 } else { 0.5 };
            Some((other, other_edge, begin + 0.5 * (1.0 - t), 0.5))
        }
        _ => Some((other, other_edge, 1.0 - t, 1.0)),
    }
}

/// The faces around a corner, with the numbers of their corners there, without the face itself; `None` if it lies on
/// the border of the mesh, or in the middle of a neighbour's edge.
fn around(faces: &[PtexFace], face: u32, corner: u8) -> Option<Vec<(u32, u8)>> {
    let mut found = Vec::new();
    let mut at = (face, corner);
    for _ in 0..MAX_VALENCE {
        let own = faces.get(at.0 as usize)?;
        let (other, edge) = (*own.adjacent.get(usize::from(at.1))?)?;
        let neighbour = faces.get(other as usize)?;
        // Corners 1 and 3 of a subface are the middle of an edge.
        if own.is_subface && !neighbour.is_subface && at.1 % 2 == 1 {
            return None;
        }
        at = (other, (edge + 1) % 4);
        if at == (face, corner) {
            return Some(found);
        }
        found.push(at);
    }
    None
}

/// The texel of a face at a corner, and those beyond the adjacent edges.
#[derive(Clone, Copy)]
struct CornerTexels<'a> {
    own: &'a [f32],
    before: &'a [f32],
    after: &'a [f32],
}

/// The data around faces from which blocks are made.
pub(super) struct FaceSurroundings<'a> {
    pub(super) faces: &'a [PtexFace],
    pub(super) channels: usize,
    pub(super) border_modes: [BorderMode; 2],
    /// The edges of faces, at least of the neighbours.
    pub(super) edges: &'a FxHashMap<u32, FaceEdges>,
}

impl FaceSurroundings<'_> {
    /// The block of one level of a face, with its border, row by row.
    pub(super) fn block(&self, face: u32, level: usize, pyramid: &FacePyramid, own: &FaceEdges) -> Vec<f32> {
        let Some((size, inside)) = pyramid.level(level) else { return Vec::new() };
        let [width, height] = size.map(|side| side as usize);
        let (channels, stride) = (self.channels, (width + 2) * self.channels);
        let mut block = vec![0.0; stride * (height + 2)];
        let rows = block.chunks_exact_mut(stride).skip(1);
        for (row, inside) in rows.zip(inside.chunks_exact(width * channels)) {
            row[channels..channels + width * channels].copy_from_slice(inside);
        }
        let mut put = |x: usize, y: usize, texel: &[f32]| {
            let at = y * stride + x * channels;
            if let Some(out) = block.get_mut(at..at + channels) {
                out.copy_from_slice(texel);
            }
        };
        let mut strips: [Vec<f32>; 4] = std::array::from_fn(|_| Vec::new());
        for (edge, strip) in (0_u8..).zip(&mut strips) {
            let count = if edge.is_multiple_of(2) { width } else { height };
            for i in 0..count {
                let texel = self.beyond_edge(face, edge, (i, count), level, own);
                let (x, y) = match edge {
                    0 => (i + 1, 0),
                    1 => (width + 1, i + 1),
                    2 => (width - i, height + 1),
                    _ => (0, height - i),
                };
                put(x, y, &texel);
                strip.extend(texel);
            }
        }
        let class = pyramid.class_of(level);
        for (corner, (x, y)) in (0_u8..).zip([(0, 0), (width + 1, 0), (width + 1, height + 1), (0, height + 1)]) {
            let before = strips[(usize::from(corner) + 3) % 4].rchunks_exact(channels).next().unwrap_or_default();
            let after = strips[usize::from(corner)].chunks_exact(channels).next().unwrap_or_default();
            let own = own.at(level, corner, 0, channels);
            let texel = self.beyond_corner((face, corner), class, CornerTexels { own, before, after });
            put(x, y, &texel);
        }
        block
    }

    /// The texel beyond number `i` of `count` along an edge.
    fn beyond_edge(&self, face: u32, edge: u8, (i, count): (usize, usize), level: usize, own: &FaceEdges) -> Vec<f32> {
        let t = (i as f64 + 0.5) / count as f64;
        let found = beyond(self.faces, face, edge, t);
        let Some((edges, (_, other_edge, place, share))) =
            found.and_then(|found| Some((self.edges.get(&found.0)?, found)))
        else {
            // Along edges 0 and 2 only u varies.
            let is_black =
                self.border_modes[usize::from(edge.is_multiple_of(2))] == BorderMode::Black && found.is_none();
            return if is_black { vec![0.0; self.channels] } else { own.at(level, edge, i, self.channels).to_vec() };
        };
        let fine = edges.count(0, other_edge, self.channels) as u64;
        // The level of the neighbour at which its texels are as long as ours.
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "small and positive")]
        let wanted = ((count as f64 / share).ceil() as u64).max(1);
        let level = (fine / wanted).max(1).ilog2() as usize;
        let level = level.min(edges.levels().saturating_sub(1));
        let texels = edges.count(level, other_edge, self.channels);
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "within the edge")]
        let at = ((place * texels as f64) as usize).min(texels.saturating_sub(1));
        edges.at(level, other_edge, at, self.channels).to_vec()
    }

    /// The texel beyond a corner, such that all faces around agree on the value at the corner, the mean of their texels
    /// there. With four faces it is the texel of the opposite one.
    fn beyond_corner(&self, (face, corner): (u32, u8), class: u32, at: CornerTexels<'_>) -> Vec<f32> {
        let CornerTexels { own, before, after } = at;
        let mean = |k: usize| 0.5 * (before.get(k).unwrap_or(&0.0) + after.get(k).unwrap_or(&0.0));
        let all = around(self.faces, face, corner).filter(|all| !all.is_empty());
        let texel = |&(other, corner): &(u32, u8)| {
            let edges = self.edges.get(&other)?;
            let level = edges.levels().saturating_sub(1 + class as usize);
            Some(edges.at(level, corner, 0, self.channels))
        };
        let texels: Option<Vec<&[f32]>> = all.as_ref().and_then(|all| all.iter().map(texel).collect());
        let Some(texels) = texels else { return (0..self.channels).map(mean).collect() };
        if let (Some([_, across, _]), 3) = (texels.get(0..3), texels.len()) {
            return across.to_vec();
        }
        let value = |k: usize| {
            let own = own.get(k).copied().unwrap_or(0.0);
            let sum: f32 = texels.iter().filter_map(|texel| texel.get(k)).sum();
            let corner = (own + sum) / (texels.len() + 1) as f32;
            (4.0 * corner - own - 2.0 * mean(k)).max(0.0)
        };
        (0..self.channels).map(value).collect()
    }
}

/// Checks that a level of a pyramid is what a block of the layout holds.
pub(super) fn fits(block: &FaceBlock, log2: [u8; 2], class: u32) -> bool {
    class_size(log2, class) == Some(block.size)
}
