// SPDX-License-Identifier: Apache-2.0
//! Emission of a prim's materials, as needed to build sampling weights of mesh lights. Render thread only.

use super::emission_map::{EmissionMap, TexelFinish};
use super::program::{EmissionCorner, EmissionProgram, primvar};
use super::{emission_weight, narrow};
use crate::textures::TextureCache;
use oocpt_abi::{MaterialFlags, MaterialInput, NO_MATERIAL, NO_VALUE};
use oocpt_core::Material;
use oocpt_core::material::InputValue;
use oocpt_core::mesh::{MeshAsset, MeshSummary};
use oocpt_core::scene::Snapshot;
use oocpt_core::texture::TextureRef;
use std::sync::Arc;

/// Emission above which a material is no light: weights stay finite.
const MAX_EMISSION: f32 = 1e30;
/// Most maps; what is beyond is taken as even.
const MAX_MAPS: usize = 1024;

/// What a slot emits.
#[derive(Clone, Debug)]
pub(super) enum EmittedPower {
    /// The same everywhere: what a unit of area counts for, 0: nothing.
    Even(f32),
    /// A primvar, by the number of its name, or the fallback where the mesh does not have it.
    Primvar(u32, [f32; 3]),
    /// A picture.
    Picture(EmissionPicture),
    /// A program.
    Program(Arc<EmissionProgram>),
}

/// See [`EmittedPower::Picture`].
#[derive(Clone, Debug)]
pub(super) struct EmissionPicture {
    map: Arc<EmissionMap>,
    /// Number of the name of its texture coordinates, if it has any.
    set: Option<u32>,
    /// Those of a mesh that does not have them.
    fallback: [f32; 2],
    rows: [[f32; 3]; 2],
}

/// The slots of a prim, and the weight that 1 stands for.
#[derive(Clone, Debug)]
pub(super) struct PrimEmission {
    pub(super) by_slot: Vec<EmittedPower>,
    pub(super) scale: f32,
}

/// What a prim emits at one of its placements.
#[derive(Clone, Debug)]
pub(super) struct PlacedEmission {
    pub(super) emission: PrimEmission,
    /// By slot; the first float has the bits of `NO_VALUE` where the instance says nothing.
    pub(super) emissions: Vec<[f32; 3]>,
}

/// Maps that are kept from snapshot to snapshot.
#[derive(Debug, Default)]
pub(super) struct EmissionMaps {
    known: Vec<(TextureRef, TexelFinish, Arc<EmissionMap>, bool)>,
    programs: Vec<(Arc<EmissionProgram>, bool)>,
    made: u64,
    /// [`SurfaceTables::most_lookups`](oocpt_core::scene::SurfaceTables::most_lookups) of the snapshot.
    most_lookups: usize,
}

impl EmissionMaps {
    /// What each material emits. Forgets the maps of others.
    pub(super) fn powers(&mut self, snapshot: &Snapshot, images: Option<&TextureCache>) -> Vec<Option<EmittedPower>> {
        self.most_lookups = snapshot.surfaces.most_lookups();
        let materials = snapshot.surfaces.materials.iter();
        let emission = materials.map(|material| emitted_power(snapshot, material, self, images)).collect();
        self.known.retain_mut(|(.., is_used)| std::mem::take(is_used));
        self.programs.retain_mut(|(.., is_used)| std::mem::take(is_used));
        emission
    }

    /// The program of a material's emission, if light can be asked for it.
    fn program(
        &mut self,
        snapshot: &Snapshot,
        material: &Material,
        images: Option<&TextureCache>,
    ) -> Option<Arc<EmissionProgram>> {
        self.made += 1;
        let program = EmissionProgram::new(material, self.most_lookups, self.made, |lookup| {
            let texture = snapshot.surfaces.textures.get(lookup.texture as usize).filter(|texture| !texture.is_ptex)?;
            let finish = TexelFinish { channel: None, scale: [1.0; 4], bias: [0.0; 4] };
            // Without images all of them are black.
            Some(self.get(texture, finish, images?))
        })?;
        if let Some((known, is_used)) = self.programs.iter_mut().find(|(known, _)| **known == program) {
            *is_used = true;
            return Some(Arc::clone(known));
        }
        if self.programs.len() >= MAX_MAPS {
            return None;
        }
        let program = Arc::new(program);
        self.programs.push((Arc::clone(&program), true));
        Some(program)
    }

    fn get(&mut self, texture: &TextureRef, finish: TexelFinish, images: &TextureCache) -> Arc<EmissionMap> {
        let is_it = |entry: &&mut (TextureRef, TexelFinish, _, bool)| entry.0 == *texture && entry.1 == finish;
        if let Some((.., map, is_used)) = self.known.iter_mut().find(is_it) {
            *is_used = true;
            return Arc::clone(map);
        }
        self.made += 1;
        let map = Arc::new(self.make(texture, &finish, images));
        if self.known.len() < MAX_MAPS {
            self.known.push((texture.clone(), finish, Arc::clone(&map), true));
        }
        map
    }

    /// A file that cannot be read shows its fallback; the textures' own warning says why. Sets of files are taken as
    /// even.
    fn make(&self, texture: &TextureRef, finish: &TexelFinish, images: &TextureCache) -> EmissionMap {
        if texture.asset.resolved.contains("<UDIM>") || self.known.len() >= MAX_MAPS {
            return EmissionMap::even(1.0, self.made);
        }
        let fallback = || {
            EmissionMap::even(
                emission_weight(finish.color(texture.fallback.map(f64::from), texture.has_border)),
                self.made,
            )
        };
        if texture.asset.resolved.is_empty() {
            return fallback();
        }
        let Some(image) = images.image(texture, 0) else { return fallback() };
        // One that opens and cannot be read here may be read tile by tile.
        EmissionMap::of_image(&*image, texture, finish, self.made).unwrap_or_else(|error| {
            tracing::debug!(%error, file = &*texture.asset.authored, "emission is taken as even");
            EmissionMap::even(1.0, self.made)
        })
    }
}

impl PrimEmission {
    /// Those of a prim, if one of its slots emits; `materials` as [`EmissionMaps::powers`] gives them.
    pub(super) fn of_prim(snapshot: &Snapshot, prim_id: i64, materials: &[Option<EmittedPower>]) -> Option<Self> {
        let slots = snapshot.surfaces.slots(i32::try_from(prim_id).ok()?);
        let power = |&slot: &u32| materials.get(slot as usize).filter(|_| slot != NO_MATERIAL).cloned().flatten();
        Self::scaled(slots.iter().map(|slot| power(slot).unwrap_or(EmittedPower::Even(0.0))).collect())
    }

    fn scaled(mut by_slot: Vec<EmittedPower>) -> Option<Self> {
        let largest = by_slot.iter().map(EmittedPower::typical).fold(0.0, f32::max);
        // Weights that are no normal numbers would lose their meaning.
        if !largest.is_normal() {
            return None;
        }
        for power in &mut by_slot {
            if let EmittedPower::Even(weight) = power {
                *weight /= largest;
            }
        }
        Some(Self { by_slot, scale: largest })
    }

    /// Those at a placement, where its instance has something to say; `values` by number of the name.
    pub(super) fn placed(&self, mesh: &MeshSummary, values: &[(u32, [f32; 4])]) -> Option<PlacedEmission> {
        let value = |name: u32| {
            let is_own = mesh.primvars.iter().any(|primvar| primvar.id == name);
            values.iter().find(|value| value.0 == name && !is_own).map(|value| value.1)
        };
        let has_value = |power: &EmittedPower| power.names().any(|name| value(name).is_some());
        if values.is_empty() || !self.by_slot.iter().any(has_value) {
            return None;
        }
        let (mut by_slot, mut emissions) = (Vec::new(), Vec::new());
        for power in &self.by_slot {
            let here = power.names().find_map(value);
            emissions.push([f32::from_bits(NO_VALUE); 3]);
            by_slot.push(match (power, here) {
                (EmittedPower::Even(weight), _) => EmittedPower::Even(weight * self.scale),
                (other, None) => other.clone(),
                // Places in a picture that an instance knows are left to rays, and so is all that a program reads.
                (EmittedPower::Picture(_) | EmittedPower::Program(_), Some(_)) => EmittedPower::Even(0.0),
                (EmittedPower::Primvar(..), Some([r, g, b, _])) => {
                    if let Some(emission) = emissions.last_mut() {
                        *emission = [r, g, b];
                    }
                    let usable = |v: f32| if v > 0.0 && v <= MAX_EMISSION { f64::from(v) } else { 0.0 };
                    EmittedPower::Even(narrow(emission_weight([r, g, b].map(usable))))
                }
            });
        }
        let emission = Self::scaled(by_slot).unwrap_or(Self { by_slot: Vec::new(), scale: 1.0 });
        Some(PlacedEmission { emission, emissions })
    }

    /// What tells emitters of one mesh apart.
    pub(super) fn key(&self) -> Vec<u32> {
        let mut key = Vec::new();
        for power in &self.by_slot {
            match power {
                EmittedPower::Even(weight) => key.extend([0, weight.to_bits()]),
                EmittedPower::Primvar(name, fallback) => {
                    key.extend([1, self.scale.to_bits(), *name]);
                    key.extend(fallback.map(f32::to_bits));
                }
                EmittedPower::Program(program) => {
                    let [low, high] = halves(program.number);
                    key.extend([3, self.scale.to_bits(), low, high]);
                }
                EmittedPower::Picture(EmissionPicture { map, set, fallback, rows }) => {
                    let [low, high] = halves(map.number);
                    key.extend([2, self.scale.to_bits(), low, high, set.unwrap_or(u32::MAX)]);
                    key.extend(fallback.iter().chain(rows.as_flattened()).map(|v| v.to_bits()));
                }
            }
        }
        key
    }
}

impl EmittedPower {
    /// A weight of its order of magnitude.
    fn typical(&self) -> f32 {
        match self {
            Self::Even(weight) => *weight,
            Self::Primvar(..) | Self::Program(_) => 1.0,
            Self::Picture(picture) => narrow(picture.map.mean()),
        }
    }

    /// The primvars that it reads.
    fn names(&self) -> impl Iterator<Item = u32> {
        let (one, program) = match self {
            Self::Even(_) => (None, None),
            Self::Primvar(name, _) => (Some(*name), None),
            Self::Picture(picture) => (picture.set, None),
            Self::Program(program) => (None, Some(program)),
        };
        one.into_iter().chain(program.into_iter().flat_map(|program| program.names()))
    }

    /// The program that works it out.
    pub(super) fn program(&self) -> Option<&EmissionProgram> {
        match self {
            Self::Program(program) => Some(program),
            _ => None,
        }
    }

    /// Textures that are looked up for a point.
    pub(super) fn lookups(&self) -> usize {
        match self {
            Self::Even(_) | Self::Primvar(..) => 0,
            Self::Picture(_) => 1,
            Self::Program(program) => program.lookups(),
        }
    }

    /// Whether points of a triangle may differ in what they emit, or their emission is not in the material.
    pub(super) fn varies(&self) -> bool {
        !matches!(self, Self::Even(_))
    }

    /// What the corners of a triangle have: colours, or texture coordinates in the first two.
    pub(super) fn corners(&self, mesh: &MeshAsset, triangle: usize) -> [[f32; 3]; 3] {
        match self {
            Self::Even(_) | Self::Program(_) => [[0.0; 3]; 3],
            Self::Primvar(name, fallback) => three(primvar(mesh, *name, triangle)).unwrap_or([*fallback; 3]),
            Self::Picture(picture) => {
                let [s, t] = picture.fallback;
                picture.set.and_then(|set| three(primvar(mesh, set, triangle))).unwrap_or([[s, t, 0.0]; 3])
            }
        }
    }

    /// What they have that a program reads.
    pub(super) fn program_corners(&self, mesh: &MeshAsset, triangle: usize) -> Option<[EmissionCorner; 3]> {
        self.program().map(|program| program.corners(mesh, triangle))
    }

    /// What a unit of a triangle's area counts for; `corners` as they are given by [`EmittedPower::corners`], `scale`
    /// of the prim. Not of a program.
    pub(super) fn weight(&self, corners: &[[f32; 3]; 3], scale: f32) -> f64 {
        match self {
            Self::Program(_) => 0.0,
            Self::Even(weight) => f64::from(*weight),
            Self::Primvar(..) => {
                let usable = |v: f32| if v > 0.0 { f64::from(v.min(MAX_EMISSION)) } else { 0.0 };
                let sum: f64 = corners.iter().map(|color| emission_weight(color.map(usable))).sum();
                sum / 3.0 / f64::from(scale)
            }
            Self::Picture(picture) => picture.map.over(corners.map(|st| picture.place(st))) / f64::from(scale),
        }
    }
}

impl EmissionPicture {
    fn place(&self, st: [f32; 3]) -> [f64; 2] {
        let [s, t] = if self.set.is_some() { [st[0], st[1]].map(f64::from) } else { [0.0; 2] };
        self.rows.map(|[x, y, z]| f64::from(x) * s + f64::from(y) * t + f64::from(z))
    }
}

/// What a material emits; `None` if it is none that lights are made of: those that are not there everywhere, and Ptex,
/// which shines on what rays that are reflected find it.
fn emitted_power(
    snapshot: &Snapshot,
    material: &Material,
    maps: &mut EmissionMaps,
    images: Option<&TextureCache>,
) -> Option<EmittedPower> {
    if !material.flags.contains(MaterialFlags::EMISSIVE) || material.flags.contains(MaterialFlags::PRESENCE) {
        return None;
    }
    match material.input(MaterialInput::EmissiveColor) {
        InputValue::Constant([r, g, b, _]) => {
            let emission = [*r, *g, *b].map(|c| c.max(0.0));
            let usable = emission.iter().all(|c| *c <= MAX_EMISSION);
            Some(EmittedPower::Even(if usable { narrow(emission_weight(emission.map(f64::from))) } else { 0.0 }))
        }
        InputValue::Primvar { slot, fallback: [r, g, b, _] } => {
            Some(EmittedPower::Primvar(material.primvars.get(usize::from(*slot))?.id, [*r, *g, *b]))
        }
        InputValue::Register(_) => maps.program(snapshot, material, images).map(EmittedPower::Program),
        InputValue::Texture { texture, channel, scale, bias, uv, transform } => {
            let texture = snapshot.surfaces.textures.get(*texture as usize)?;
            if texture.is_ptex {
                return None;
            }
            let finish = TexelFinish { channel: *channel, scale: *scale, bias: *bias };
            // Without images all of them are black.
            let map = maps.get(texture, finish, images?);
            let set = match uv {
                Some(set) => Some(material.uv_sets.get(usize::from(*set))?),
                None => None,
            };
            let fallback = set.map_or([0.0; 2], |set| set.fallback);
            Some(EmittedPower::Picture(EmissionPicture { map, set: set.map(|set| set.id), fallback, rows: *transform }))
        }
    }
}

fn three(corners: Option<[[f32; 4]; 3]>) -> Option<[[f32; 3]; 3]> {
    corners.map(|corners| corners.map(|[x, y, z, _]| [x, y, z]))
}

/// Low and high half.
#[expect(clippy::cast_possible_truncation, reason = "halves")]
pub(super) fn halves(x: u64) -> [u32; 2] {
    [x as u32, (x >> 32) as u32]
}
