// SPDX-License-Identifier: Apache-2.0
//! How high a displacement is at the vertices of a mesh that was cut. Pure but for the textures that it reads.

use rustc_hash::FxHashMap;

use crate::array::{ArrayView, ElementType, TypedArray};
use crate::desc::{Interpolation, MeshDesc};
use crate::material::{Displacement, Input};
use crate::texture::{HeightLevel, Heights, TextureRef, member_at};

/// Values of a primvar of a mesh that was cut.
#[derive(Clone, Copy)]
pub(super) struct CutValues<'a> {
    interpolation: Interpolation,
    values: ArrayView<'a>,
    indices: Option<ArrayView<'a>>,
}

impl<'a> CutValues<'a> {
    /// The primvar of that name.
    pub(super) fn of(desc: &'a MeshDesc, name: &str) -> Option<Self> {
        let primvar = desc.authored_primvar(name)?;
        let indices = primvar.indices.as_ref().map(TypedArray::view);
        let is_usable = indices.is_none_or(|indices| indices.is_empty() || indices.element() == ElementType::I32);
        let values = primvar.values.view();
        is_usable.then_some(Self { interpolation: primvar.interpolation, values, indices })
    }

    fn position(&self, face: u32, vertex: u32) -> Option<usize> {
        let at = match self.interpolation {
            Interpolation::Constant => 0,
            Interpolation::Uniform => face as usize,
            Interpolation::Varying | Interpolation::Vertex => vertex as usize,
            Interpolation::FaceVarying | Interpolation::Instance => return None,
        };
        match self.indices {
            Some(indices) => usize::try_from(indices.index(at)?).ok(),
            None => Some(at),
        }
    }

    fn pair(&self, face: u32, vertex: u32) -> Option<[f64; 2]> {
        let at = self.position(face, vertex)?;
        let three = || self.values.vec3(at).map(|v| [v.x, v.y]);
        self.values.vec2(at).map(|v| v.to_array()).or_else(three)
    }

    fn number(&self, face: u32, vertex: u32) -> Option<f64> {
        self.values.scalar(self.position(face, vertex)?)
    }

    /// A vector.
    pub(super) fn vector(&self, face: u32, vertex: u32) -> Option<glam::DVec3> {
        self.values.vec3(self.position(face, vertex)?)
    }
}

/// The member of a set of files that a face looks at.
pub(super) type Member = (u32, [f64; 2]);

/// A displacement over a mesh that was cut.
pub(super) struct Relief<'a> {
    displacement: &'a Displacement,
    values: Option<CutValues<'a>>,
    /// Of the triangles that were measured.
    area: f64,
    triangles: f64,
    levels: FxHashMap<u32, Option<HeightLevel>>,
    /// What could not be read.
    pub(super) problem: Option<String>,
}

impl<'a> Relief<'a> {
    pub(super) fn new(displacement: &'a Displacement, desc: &'a MeshDesc) -> Self {
        let values = displacement.primvar_name().and_then(|name| CutValues::of(desc, name));
        Self { displacement, values, area: 0.0, triangles: 0.0, levels: FxHashMap::default(), problem: None }
    }

    /// Where a vertex looks in the texture.
    fn place(&self, face: u32, vertex: u32) -> [f64; 2] {
        let Input::Texture { transform, .. } = &self.displacement.amount else { return [0.0; 2] };
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

    /// Opens what a face looks at. All triangles were measured.
    pub(super) fn open(&mut self, heights: &Heights, face: u32, vertices: &[u32]) -> Member {
        let (Input::Texture { channel, .. }, Some(texture)) = (&self.displacement.amount, &self.displacement.texture)
        else {
            return (0, [0.0; 2]);
        };
        let (number, corner) = if texture.is_udim() { self.member(face, vertices) } else { (0, [0.0; 2]) };
        if texture.is_udim() && number == 0 {
            return (0, corner);
        }
        if !self.levels.contains_key(&number) {
            // A piece is two triangles.
            let area = 2.0 * self.area / self.triangles.max(1.0);
            let found = heights.level(texture, number, channel.unwrap_or(0), area);
            let level = found.unwrap_or_else(|error| {
                let TextureRef { prim, asset, .. } = texture;
                let text = format!("{prim}: texture {}: {error}; its fallback is used", asset.authored);
                self.problem.get_or_insert(text);
                None
            });
            self.levels.insert(number, level);
        }
        (number, corner)
    }

    /// The member that the middle of a face is in: its edges may lie between two.
    fn member(&self, face: u32, vertices: &[u32]) -> Member {
        let mut sum = [0.0; 2];
        for &vertex in vertices {
            let place = self.place(face, vertex);
            sum = [sum[0] + place[0], sum[1] + place[1]];
        }
        #[expect(clippy::cast_precision_loss, reason = "a mean")]
        let count = vertices.len().max(1) as f64;
        member_at(sum.map(|v| v / count))
    }

    /// How far a vertex of a face is moved.
    pub(super) fn height(&self, face: u32, vertex: u32, member: Member) -> f64 {
        match &self.displacement.amount {
            Input::Constant([value, ..]) => f64::from(*value),
            // Only surfaces have programs.
            Input::Register(_) => 0.0,
            Input::Primvar { fallback: [fallback, ..], .. } => {
                let value = self.values.and_then(|values| values.number(face, vertex));
                value.unwrap_or(f64::from(*fallback))
            }
            Input::Texture { channel, scale, bias, .. } => {
                let channel = usize::from(channel.unwrap_or(0)).min(3);
                let value = match self.levels.get(&member.0) {
                    Some(Some(level)) => {
                        let place = self.place(face, vertex);
                        level.at([place[0] - member.1[0], place[1] - member.1[1]])
                    }
                    _ => self.displacement.texture.as_ref().map_or(0.0, |t| f64::from(t.fallback[channel])),
                };
                value * f64::from(scale[channel]) + f64::from(bias[channel])
            }
        }
    }

    /// What could not be read, for the user.
    pub(super) fn into_problem(self) -> Option<String> {
        let lacks_all = !self.levels.is_empty() && self.levels.values().all(Option::is_none);
        let texture = self.displacement.texture.as_ref().filter(|texture| lacks_all && texture.is_udim());
        let none = |texture: &TextureRef| {
            format!("{}: texture {}: none of its tiles is there", texture.prim, texture.asset.authored)
        };
        self.problem.or_else(|| texture.map(none))
    }
}
