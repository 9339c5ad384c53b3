// SPDX-License-Identifier: Apache-2.0
//! How high a displacement by an input of a `UsdPreviewSurface` is at the vertices of a mesh that was cut. Pure but for
//! the textures that it reads.

use rustc_hash::FxHashMap;

use super::cut_values::CutValues;
use crate::desc::MeshDesc;
use crate::material::{InputValue, PreviewDisplacement};
use crate::texture::{HeightCache, HeightLevel, TextureRef, member_of, numbered};

/// A displacement over a mesh that was cut.
pub(super) struct PreviewRelief<'a> {
    displacement: &'a PreviewDisplacement,
    values: Option<CutValues<'a>>,
    /// Of the triangles that were measured.
    area: f64,
    triangles: f64,
    /// By member of a set; 0 of what is none.
    levels: FxHashMap<u8, Option<HeightLevel>>,
    /// What could not be read.
    problem: Option<String>,
}

impl<'a> PreviewRelief<'a> {
    pub(super) fn new(displacement: &'a PreviewDisplacement, desc: &'a MeshDesc) -> Self {
        let values = displacement.primvar_name().and_then(|name| CutValues::of(desc, name));
        Self { displacement, values, area: 0.0, triangles: 0.0, levels: FxHashMap::default(), problem: None }
    }

    /// Where a vertex looks in the texture.
    fn place(&self, face: u32, vertex: u32) -> [f64; 2] {
        let InputValue::Texture { transform, .. } = &self.displacement.amount else { return [0.0; 2] };
        let Some(uv) = &self.displacement.uv else {
            return transform.map(|[_, _, offset]| f64::from(offset));
        };
        let st = self.values.and_then(|values| values.pair(face, vertex)).unwrap_or(uv.fallback.map(f64::from));
        transform.map(|row| {
            let [x, y, offset] = row.map(f64::from);
            x * st[0] + y * st[1] + offset
        })
    }

    /// Counts the triangles of a face: they decide which level of the texture is read.
    pub(super) fn measure(&mut self, face: u32, triangles: &[[u32; 3]]) {
        if self.displacement.texture.is_none() {
            return;
        }
        for triangle in triangles {
            let [a, b, c] = triangle.map(|vertex| self.place(face, vertex));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            self.area += if area.is_finite() { 0.5 * area.abs() } else { 0.0 };
            self.triangles += 1.0;
        }
    }

    /// The member that the middle of a face is in: its edges may lie between two. 0 where there are no members.
    pub(super) fn member(&self, face: u32, vertices: impl Iterator<Item = u32>) -> u8 {
        if !self.displacement.texture.as_ref().is_some_and(TextureRef::is_udim) {
            return 0;
        }
        let (mut sum, mut count) = ([0.0; 2], 0.0_f64);
        for vertex in vertices {
            let place = self.place(face, vertex);
            sum = [sum[0] + place[0], sum[1] + place[1]];
            count += 1.0;
        }
        member_of(sum.map(|v| v / count.max(1.0)))
    }

    /// Opens what a face looks at. All triangles were measured.
    pub(super) fn open(&mut self, heights: &HeightCache, member: u8) {
        let (InputValue::Texture { channel, .. }, Some(texture)) =
            (&self.displacement.amount, &self.displacement.texture)
        else {
            return;
        };
        if texture.is_udim() && member == 0 || self.levels.contains_key(&member) {
            return;
        }
        // A piece is two triangles.
        let area = 2.0 * self.area / self.triangles.max(1.0);
        let found = heights.level(texture, numbered(member).0, 1 << channel.unwrap_or(0).min(3), area);
        let level = found.unwrap_or_else(|error| {
            self.problem.get_or_insert(unread(texture, &error));
            None
        });
        self.levels.insert(member, level);
    }

    /// How far a vertex of a face is moved.
    pub(super) fn height(&self, face: u32, vertex: u32, member: u8) -> f64 {
        match &self.displacement.amount {
            InputValue::Constant([value, ..]) => f64::from(*value),
            // Patterns are another relief.
            InputValue::Register(_) => 0.0,
            InputValue::Primvar { fallback: [fallback, ..], .. } => {
                let value = self.values.and_then(|values| values.number(face, vertex));
                value.unwrap_or(f64::from(*fallback))
            }
            InputValue::Texture { channel, scale, bias, .. } => {
                let channel = usize::from(channel.unwrap_or(0)).min(3);
                let value = match self.levels.get(&member) {
                    Some(Some(level)) => {
                        let (place, (_, corner)) = (self.place(face, vertex), numbered(member));
                        level.at([place[0] - corner[0], place[1] - corner[1]])[channel]
                    }
                    _ => self.displacement.texture.as_ref().map_or(0.0, |t| f64::from(t.fallback[channel])),
                };
                value * f64::from(scale[channel]) + f64::from(bias[channel])
            }
        }
    }

    /// What could not be read, for the user.
    pub(super) fn into_problem(self) -> Option<String> {
        let texture = self.displacement.texture.as_ref().filter(|texture| lacks_all(texture, &self.levels));
        self.problem.or_else(|| texture.map(no_tile))
    }
}

/// A texture cannot be read.
pub(super) fn unread(texture: &TextureRef, error: &str) -> String {
    format!("{}: texture {}: {error}; its fallback is used", texture.prim, texture.asset.authored)
}

/// Whether a set of files has none of the members that were looked at.
pub(super) fn lacks_all(texture: &TextureRef, levels: &FxHashMap<u8, Option<HeightLevel>>) -> bool {
    texture.is_udim() && !levels.is_empty() && levels.values().all(Option::is_none)
}

/// It does not.
pub(super) fn no_tile(texture: &TextureRef) -> String {
    format!("{}: texture {}: none of its tiles is there", texture.prim, texture.asset.authored)
}
