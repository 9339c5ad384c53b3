// SPDX-License-Identifier: Apache-2.0
//! Displaces the vertices of a mesh that was cut by an input of a `UsdPreviewSurface`. Pure but for the textures that
//! it reads.

use rustc_hash::FxHashMap;

use super::cut_values::CutValues;
use crate::desc::MeshDesc;
use crate::material::{InputValue, PreviewDisplacement};
use crate::texture::{HeightCache, HeightLevel, TextureRef, member_of, numbered};

/// Size class of pieces where one is for all faces.
const SAME_SIZE: i16 = i16::MAX;

/// Triangles in texture coordinates.
#[derive(Clone, Copy, Default)]
struct MeasuredTriangles {
    area: f64,
    count: f64,
}

impl MeasuredTriangles {
    fn add(&mut self, area: f64) {
        self.area += area;
        self.count += 1.0;
    }

    /// Area of a piece, which is two triangles.
    fn piece(&self) -> f64 {
        2.0 * self.area / self.count.max(1.0)
    }
}

/// A displacement over a mesh that was cut.
pub(super) struct PreviewRelief<'a> {
    displacement: &'a PreviewDisplacement,
    values: Option<CutValues<'a>>,
    /// All triangles that were measured.
    measured: MeasuredTriangles,
    /// The triangles of each face, where the level of the texture follows from each face alone.
    by_face: Option<FxHashMap<u32, MeasuredTriangles>>,
    /// Levels by member of a set and size of pieces; member 0 for a texture that is not a set.
    levels: FxHashMap<(u8, i16), Option<HeightLevel>>,
    /// Message about a texture that could not be read.
    problem: Option<String>,
}

impl<'a> PreviewRelief<'a> {
    pub(super) fn new(displacement: &'a PreviewDisplacement, desc: &'a MeshDesc, by_face: bool) -> Self {
        let values = displacement.primvar_name().and_then(|name| CutValues::of(desc, name));
        let measured = MeasuredTriangles::default();
        let by_face = by_face.then(FxHashMap::default);
        Self { displacement, values, measured, by_face, levels: FxHashMap::default(), problem: None }
    }

    /// Texture coordinates of a vertex.
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

    /// Measures the triangles of a face: they decide the level of the texture that is read.
    pub(super) fn measure(&mut self, face: u32, triangles: &[[u32; 3]]) {
        if self.displacement.texture.is_none() {
            return;
        }
        for triangle in triangles {
            let [a, b, c] = triangle.map(|vertex| self.place(face, vertex));
            let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            let area = if area.is_finite() { 0.5 * area.abs() } else { 0.0 };
            match &mut self.by_face {
                Some(by_face) => by_face.entry(face).or_default().add(area),
                None => self.measured.add(area),
            }
        }
    }

    /// The class of sizes that the pieces of a face are in: powers of four, rounded down.
    fn size(&self, face: u32) -> i16 {
        let Some(by_face) = &self.by_face else { return SAME_SIZE };
        let octave = by_face.get(&face).map_or(0.0, |measured| (0.5 * measured.piece().log2()).floor());
        #[expect(clippy::cast_possible_truncation, reason = "-99 to 99; NaN is 0")]
        let octave = octave.clamp(-99.0, 99.0) as i16;
        octave
    }

    /// The member that contains the middle of a face, whose edges may lie between two. 0 if there are no members.
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

    /// Opens the level of the texture that a face looks up, after all triangles were measured.
    pub(super) fn open(&mut self, heights: &HeightCache, face: u32, member: u8) {
        let size = self.size(face);
        let (InputValue::Texture { channel, .. }, Some(texture)) =
            (&self.displacement.amount, &self.displacement.texture)
        else {
            return;
        };
        if texture.is_udim() && member == 0 || self.levels.contains_key(&(member, size)) {
            return;
        }
        let area = if size == SAME_SIZE { self.measured.piece() } else { 4.0_f64.powi(size.into()) };
        let found = heights.level(texture, numbered(member).0, 1 << channel.unwrap_or(0).min(3), area);
        let level = found.unwrap_or_else(|error| {
            self.problem.get_or_insert(unread(texture, &error));
            None
        });
        self.levels.insert((member, size), level);
    }

    /// Displacement of a vertex of a face along its normal.
    pub(super) fn height(&self, face: u32, vertex: u32, member: u8) -> f64 {
        match &self.displacement.amount {
            InputValue::Constant([value, ..]) => f64::from(*value),
            // Patterns are handled by another relief.
            InputValue::Register(_) => 0.0,
            InputValue::Primvar { fallback: [fallback, ..], .. } => {
                let value = self.values.and_then(|values| values.number(face, vertex));
                value.unwrap_or(f64::from(*fallback))
            }
            InputValue::Texture { channel, scale, bias, .. } => {
                let channel = usize::from(channel.unwrap_or(0)).min(3);
                let value = match self.levels.get(&(member, self.size(face))) {
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

    /// Message for the user about a texture that could not be read.
    pub(super) fn into_problem(self) -> Option<String> {
        let texture = self.displacement.texture.as_ref().filter(|texture| lacks_all(texture, &self.levels));
        self.problem.or_else(|| texture.map(no_tile))
    }
}

/// The message that a texture cannot be read.
pub(super) fn unread(texture: &TextureRef, error: &str) -> String {
    format!("{}: texture {}: {error}; its fallback is used", texture.prim, texture.asset.authored)
}

/// Returns true if a set of files has none of the members that were looked at.
pub(super) fn lacks_all<K>(texture: &TextureRef, levels: &FxHashMap<K, Option<HeightLevel>>) -> bool {
    texture.is_udim() && !levels.is_empty() && levels.values().all(Option::is_none)
}

/// The message that a set of files has no tile.
pub(super) fn no_tile(texture: &TextureRef) -> String {
    format!("{}: texture {}: none of its tiles is there", texture.prim, texture.asset.authored)
}
