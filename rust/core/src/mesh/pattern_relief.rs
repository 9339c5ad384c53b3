// SPDX-License-Identifier: Apache-2.0
//! Displaces the vertices of a mesh that was cut by a pattern program. Pure but for the textures that it reads.
//!
//! The program reads points, normals and tangents of the mesh's own frame, before anything is moved. The level of a
//! texture is chosen by the texture coordinates that the program looks up at the corners of triangles
//! ([`MAX_MEASURED`] of them, evenly chosen).

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use oocpt_materialx::eval::run_numbered;
use oocpt_materialx::program::{Geometry, MAX_LOOKUPS, ProgramLookup};
use oocpt_materialx::{DisplacementOffset, channels};
use rayon::prelude::*;
use rustc_hash::FxHashMap;

use super::cut_values::CutValues;
use super::preview_relief::{lacks_all, no_tile, unread};
use super::tangents::{TangentField, TangentFrame, at};
use crate::desc::MeshDesc;
use crate::material::{PatternDisplacement, TextureRef};
use crate::texture::{HeightCache, HeightLevel, member_of, numbered};

/// Half the largest number of triangles that are measured.
const MAX_MEASURED: usize = 1 << 15;

/// Members of sets of files that a face looks up, by lookup.
pub(super) type UdimMembers = [u8; MAX_LOOKUPS];

/// Positions and normals of a mesh that was cut.
#[derive(Clone, Copy)]
pub(super) struct DicedSurface<'a> {
    pub(super) positions: &'a [[f32; 3]],
    pub(super) normals: &'a [[f32; 3]],
}

/// A lookup of the program.
#[derive(Default)]
struct LookedUpLevels {
    channels: u8,
    /// Area of a piece in texture coordinates.
    area: f64,
    /// Levels by member of a set; member 0 for a texture that is not a set.
    levels: FxHashMap<u8, Option<HeightLevel>>,
}

/// A displacement over a mesh that was cut.
pub(super) struct PatternRelief<'a> {
    displacement: &'a PatternDisplacement,
    surface: DicedSurface<'a>,
    uv_sets: Vec<Option<CutValues<'a>>>,
    primvars: Vec<Option<CutValues<'a>>>,
    tangents: Option<TangentField>,
    has_sets: bool,
    /// Every `stride`th triangle, with its face.
    measured: Vec<(u32, [u32; 3])>,
    stride: usize,
    triangles: usize,
    lookups: Vec<LookedUpLevels>,
    /// Messages about textures that could not be read, by texture.
    problems: BTreeMap<u32, String>,
}

impl<'a> PatternRelief<'a> {
    pub(super) fn new(displacement: &'a PatternDisplacement, desc: &'a MeshDesc, surface: DicedSurface<'a>) -> Self {
        let PatternDisplacement { offset, is_vector, program, uv_sets, primvars, .. } = displacement;
        let masks = match offset {
            DisplacementOffset::Register(register) => channels(program, *register, if *is_vector { 3 } else { 1 }),
            DisplacementOffset::Constant(_) => Vec::new(),
        };
        let texture = |lookup: &ProgramLookup| displacement.textures.get(lookup.texture as usize);
        Self {
            displacement,
            surface,
            uv_sets: uv_sets.iter().map(|name| CutValues::of(desc, name)).collect(),
            primvars: primvars.iter().map(|(name, _)| CutValues::of(desc, name)).collect(),
            tangents: displacement.has_tangents.then(|| TangentField::new(surface.positions.len())),
            has_sets: program.lookups.iter().filter_map(texture).any(TextureRef::is_udim),
            measured: Vec::new(),
            stride: 1,
            triangles: 0,
            lookups: masks
                .into_iter()
                .map(|channels| LookedUpLevels { channels, ..LookedUpLevels::default() })
                .collect(),
            problems: BTreeMap::new(),
        }
    }

    pub(super) fn is_vector(&self) -> bool {
        self.displacement.is_vector
    }

    /// Texture coordinates of a vertex.
    fn st(&self, set: usize, face: u32, vertex: u32) -> [f64; 2] {
        let values = self.uv_sets.get(set).copied().flatten();
        values.and_then(|values| values.pair(face, vertex)).unwrap_or_default()
    }

    /// Measures the triangles of a face: they decide the tangents, and the levels of textures that are read.
    pub(super) fn measure(&mut self, face: u32, triangles: &[[u32; 3]]) {
        if let Some(mut tangents) = self.tangents.take() {
            for triangle in triangles {
                let corners = triangle.map(|vertex| at(self.surface.positions, vertex));
                tangents.add(triangle, corners, triangle.map(|vertex| DVec2::from(self.st(0, face, vertex))));
            }
            self.tangents = Some(tangents);
        }
        if self.lookups.is_empty() {
            return;
        }
        for triangle in triangles {
            if self.triangles.is_multiple_of(self.stride) {
                self.measured.push((face, *triangle));
            }
            self.triangles += 1;
            if self.measured.len() > 2 * MAX_MEASURED {
                self.stride *= 2;
                let mut number = 0_usize;
                self.measured.retain(|_| {
                    number += 1;
                    number % 2 == 1
                });
            }
        }
    }

    /// Ends the measurement after all triangles were given.
    pub(super) fn settle(&mut self) {
        let places = |(face, triangle): &(u32, [u32; 3])| triangle.map(|vertex| self.places(*face, vertex));
        let places: Vec<[[[f64; 2]; MAX_LOOKUPS]; 3]> = self.measured.par_iter().map(places).collect();
        #[expect(clippy::cast_precision_loss, reason = "a mean")]
        let count = places.len().max(1) as f64;
        for (number, lookup) in self.lookups.iter_mut().enumerate().take(MAX_LOOKUPS) {
            let area = |[a, b, c]: &[[[f64; 2]; MAX_LOOKUPS]; 3]| {
                let [a, b, c] = [a, b, c].map(|place| DVec2::from(place[number]));
                // A piece is two triangles.
                Some((b - a).perp_dot(c - a).abs()).filter(|area| area.is_finite()).unwrap_or(0.0)
            };
            lookup.area = places.iter().map(area).sum::<f64>() / count;
        }
        self.measured = Vec::new();
    }

    /// Texture coordinates of the lookups of a vertex. Texels that they depend on count as unreadable.
    fn places(&self, face: u32, vertex: u32) -> [[f64; 2]; MAX_LOOKUPS] {
        let mut places = [[0.0; 2]; MAX_LOOKUPS];
        self.run(face, vertex, |number, lookup, place| {
            if let Some(slot) = places.get_mut(number) {
                *slot = self.place(lookup, place, face, vertex);
            }
            self.fallback(lookup)
        });
        places
    }

    /// The members that the middle of a face is in.
    pub(super) fn members(&self, face: u32, vertices: impl Iterator<Item = u32>) -> UdimMembers {
        let mut members = UdimMembers::default();
        if !self.has_sets {
            return members;
        }
        let (mut sums, mut count) = ([DVec2::ZERO; MAX_LOOKUPS], 0.0_f64);
        for vertex in vertices {
            sums.iter_mut().zip(self.places(face, vertex)).for_each(|(sum, place)| *sum += DVec2::from(place));
            count += 1.0;
        }
        let lookups = self.displacement.program.lookups.iter();
        for ((member, lookup), sum) in members.iter_mut().zip(lookups).zip(sums) {
            if self.texture(lookup).is_some_and(TextureRef::is_udim) {
                *member = member_of((sum / count.max(1.0)).to_array());
            }
        }
        members
    }

    /// Opens the levels of textures that a face looks up.
    pub(super) fn open(&mut self, heights: &HeightCache, members: &UdimMembers) {
        let known = self.displacement.program.lookups.iter();
        for ((lookup, looked), &member) in known.zip(&mut self.lookups).zip(members) {
            let Some(texture) = self.displacement.textures.get(lookup.texture as usize) else { continue };
            if looked.channels == 0 || texture.is_udim() && member == 0 || looked.levels.contains_key(&member) {
                continue;
            }
            let found = heights.level(texture, numbered(member).0, looked.channels, looked.area);
            let level = found.unwrap_or_else(|error| {
                self.problems.entry(lookup.texture).or_insert_with(|| unread(texture, &error));
                None
            });
            looked.levels.insert(member, level);
        }
    }

    /// Displacement of a vertex of a face along its normal.
    pub(super) fn height(&self, face: u32, vertex: u32, members: &UdimMembers) -> f64 {
        let [height, ..] = self.value(face, vertex, members);
        f64::from(height)
    }

    /// Displacement of a vertex of a face as a vector.
    pub(super) fn vector(&self, face: u32, vertex: u32, members: &UdimMembers) -> DVec3 {
        let [x, y, z, _] = self.value(face, vertex, members).map(f64::from);
        let [tangent, bitangent, normal] = self.frame(vertex);
        tangent * x + bitangent * y + normal * z
    }

    fn value(&self, face: u32, vertex: u32, members: &UdimMembers) -> [f32; 4] {
        let register = match self.displacement.offset {
            DisplacementOffset::Constant(value) => return value,
            DisplacementOffset::Register(register) => usize::from(register),
        };
        let registers = self.run(face, vertex, |number, lookup, place| {
            let member = members.get(number).copied().unwrap_or(0);
            let looked = self.lookups.get(number).and_then(|looked| looked.levels.get(&member));
            let Some(Some(level)) = looked else { return self.fallback(lookup) };
            let (place, (_, corner)) = (self.place(lookup, place, face, vertex), numbered(member));
            scaled(lookup, level.at([place[0] - corner[0], place[1] - corner[1]]).map(single))
        });
        registers.get(register).copied().unwrap_or_default()
    }

    fn run(
        &self,
        face: u32,
        vertex: u32,
        lookup: impl FnMut(usize, &ProgramLookup, Option<[f32; 2]>) -> [f32; 4],
    ) -> [[f32; 4]; oocpt_materialx::program::REGISTERS] {
        let vector = |v: DVec3| [single(v.x), single(v.y), single(v.z), 0.0];
        let set = |set: usize| {
            let [u, v] = self.st(set, face, vertex).map(single);
            [u, v, 0.0, 0.0]
        };
        let primvar = |slot: usize| {
            let values = self.primvars.get(slot).copied().flatten();
            let fallback = self.displacement.primvars.get(slot).map_or([0.0; 4], |(_, fallback)| *fallback);
            values.and_then(|values| values.four(face, vertex)).map_or(fallback, |value| value.map(single))
        };
        let geometry = |what: Geometry| match what {
            Geometry::Uv0 => set(0),
            Geometry::Uv1 => set(1),
            Geometry::Primvar0 => primvar(0),
            Geometry::Primvar1 => primvar(1),
            Geometry::Position => vector(at(self.surface.positions, vertex)),
            Geometry::Normal => vector(at(self.surface.normals, vertex)),
            Geometry::Tangent => vector(self.frame(vertex)[0]),
            Geometry::Bitangent => vector(self.frame(vertex)[1]),
            // Programs that read these are not compiled as displacements.
            Geometry::ViewDirection
            | Geometry::Random0
            | Geometry::Random1
            | Geometry::Random2
            | Geometry::FrameX
            | Geometry::FrameY => [0.0; 4],
        };
        run_numbered(&self.displacement.program, geometry, lookup)
    }

    fn frame(&self, vertex: u32) -> TangentFrame {
        let normal = at(self.surface.normals, vertex).try_normalize().unwrap_or(DVec3::Z);
        let any = || normal.any_orthonormal_pair();
        self.tangents.as_ref().map_or_else(|| [any().0, any().1, normal], |tangents| tangents.frame(vertex, normal))
    }

    fn texture(&self, lookup: &ProgramLookup) -> Option<&TextureRef> {
        self.displacement.textures.get(lookup.texture as usize)
    }

    fn fallback(&self, lookup: &ProgramLookup) -> [f32; 4] {
        scaled(lookup, self.texture(lookup).map_or([0.0; 4], |texture| texture.fallback))
    }

    /// Texture coordinates of a lookup: those that the program gives, or else the lookup's own.
    fn place(&self, lookup: &ProgramLookup, place: Option<[f32; 2]>, face: u32, vertex: u32) -> [f64; 2] {
        if let Some(place) = place {
            return place.map(f64::from);
        }
        let [s, t] = lookup.uv.map_or([0.0; 2], |set| self.st(usize::from(set), face, vertex));
        lookup.transform.map(|row| {
            let [x, y, offset] = row.map(f64::from);
            x * s + y * t + offset
        })
    }

    /// Messages for the user about textures that could not be read.
    pub(super) fn into_problems(mut self) -> Vec<String> {
        for (lookup, looked) in self.displacement.program.lookups.iter().zip(&self.lookups) {
            let texture = self.displacement.textures.get(lookup.texture as usize);
            if let Some(texture) = texture.filter(|texture| lacks_all(texture, &looked.levels)) {
                self.problems.entry(lookup.texture).or_insert_with(|| no_tile(texture));
            }
        }
        self.problems.into_values().collect()
    }
}

fn scaled(lookup: &ProgramLookup, texel: [f32; 4]) -> [f32; 4] {
    [0, 1, 2, 3].map(|k: usize| texel[k] * lookup.scale[k] + lookup.bias[k])
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what programs have")]
fn single(value: f64) -> f32 {
    value as f32
}
