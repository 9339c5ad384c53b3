// SPDX-License-Identifier: Apache-2.0
//! Blocks of faces put together: vertices at the places that blocks share become one, where they are alike.

use crate::{Error, LimitFacets, ffi};

/// No vertex.
const NONE: u32 = u32::MAX;
/// Normals with a larger cosine are one normal. As in C++, within blocks.
const SAME_NORMAL: f64 = 1.0 - 1e-4;
/// Values that differ by less than this share of their size are one value.
const SAME_VALUE: f32 = 1e-4;

/// What was put together so far.
pub(crate) struct SeamJoiner {
    pub(crate) facets: LimitFacets,
    /// First vertex at each place that faces share.
    heads: Vec<u32>,
    /// The next vertex at the same place.
    next: Vec<u32>,
    /// Face-varying floats of a vertex.
    width: usize,
}

impl SeamJoiner {
    pub(crate) fn new(site_count: usize, width: usize) -> Self {
        Self { facets: LimitFacets::default(), heads: vec![NONE; site_count], next: Vec::new(), width }
    }

    /// Adds a block. Blocks come in the order of their faces.
    pub(crate) fn add(&mut self, block: &ffi::Facets) -> Result<(), Error> {
        let mut vertices = Vec::with_capacity(block.sites().len());
        for (at, site) in block.sites().iter().enumerate() {
            let site = usize::try_from(*site).ok();
            let head = site.and_then(|site| self.heads.get(site).copied()).unwrap_or(NONE);
            let mut vertex = head;
            while vertex != NONE && !self.is_like(vertex as usize, block, at) {
                vertex = self.next.get(vertex as usize).copied().unwrap_or(NONE);
            }
            if vertex == NONE {
                vertex = self.push(block, at, head)?;
                match site.and_then(|site| self.heads.get_mut(site)) {
                    Some(slot) if head == NONE => *slot = vertex,
                    Some(_) => self.link(head, vertex),
                    None => {}
                }
            }
            vertices.push(vertex);
        }
        let vertex = |local: &i32| usize::try_from(*local).ok().and_then(|at| vertices.get(at).copied()).unwrap_or(0);
        self.facets.triangles.extend(block.triangles().iter().map(vertex));
        self.facets.faces.extend(block.faces().iter().map(|face| face.cast_unsigned()));
        Ok(())
    }

    /// Puts a vertex behind the first one at its place, whose position is everybody's.
    fn link(&mut self, head: u32, vertex: u32) {
        let behind = self.next.get_mut(head as usize).map(|next| std::mem::replace(next, vertex));
        if let (Some(behind), Some(slot)) = (behind, self.next.get_mut(vertex as usize)) {
            *slot = behind;
        }
    }

    fn is_like(&self, vertex: usize, block: &ffi::Facets, at: usize) -> bool {
        let normal = |normals: &[f32], at: usize| {
            let [x, y, z] = normals.as_chunks::<3>().0.get(at).copied().unwrap_or_default();
            [x, y, z].map(f64::from)
        };
        let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
        let (own, other) = (normal(&self.facets.normals, vertex), normal(block.normals(), at));
        let has_normal = dot(other, other) > 0.0;
        if has_normal != (dot(own, own) > 0.0) || (has_normal && dot(own, other) < SAME_NORMAL) {
            return false;
        }
        let own = values(&self.facets.face_varying, self.width, vertex);
        let other = values(block.face_varying(), self.width, at);
        // NaN is like nothing.
        own.iter().zip(other).all(|(a, b)| (a - b).abs() <= SAME_VALUE * (1.0 + a.abs()))
    }

    /// A new vertex like that of the block, where `head` is if there is one.
    fn push(&mut self, block: &ffi::Facets, at: usize, head: u32) -> Result<u32, Error> {
        let count = self.facets.places.len();
        let vertex = u32::try_from(count).ok().filter(|vertex| *vertex != NONE);
        let vertex = vertex.ok_or(Error::Invalid("more vertices than can be numbered"))?;
        let total = block.sites().len().max(1);
        let facets = &mut self.facets;
        let position = match head {
            NONE => values(block.positions(), 3, at).try_into(),
            head => values(&facets.positions, 3, head as usize).try_into(),
        };
        let position: [f32; 3] = position.unwrap_or_default();
        facets.positions.extend(position);
        facets.normals.extend(values(block.normals(), 3, at));
        facets.vertex.extend(values(block.vertex(), block.vertex().len() / total, at));
        facets.varying.extend(values(block.varying(), block.varying().len() / total, at));
        facets.face_varying.extend(values(block.face_varying(), self.width, at));
        facets.places.push(if head == NONE { vertex } else { head });
        self.next.push(NONE);
        Ok(vertex)
    }
}

/// The values of a vertex, `width` of them.
fn values(all: &[f32], width: usize, at: usize) -> &[f32] {
    all.get(at * width..(at + 1) * width).unwrap_or_default()
}
