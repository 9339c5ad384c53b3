// SPDX-License-Identifier: Apache-2.0
//! Emission that a program computes, as needed to weight triangles of mesh lights: the host runs the program at a
//! lattice of points. Only choices depend on it; the emission of a chosen point is computed on the device
//! (`shaders/light/program.glsl`). Pure but for the maps of its textures.
//!
//! These emissions are left to BSDF rays, at full weight: programs that read the directions of the surface, the normal
//! in the mesh's frame or Ptex, those with more lookups than a path has places for beside its own, those that read
//! primvars of instances, and meshes that are black wherever the lattice samples them.

use super::emission_map::{EmissionMap, LATTICE, MAX_RADIANCE, lattice};
use super::{emission_weight, narrow};
use oocpt_abi::{AttributeRate, NAME_FRAME_X, NAME_FRAME_Y, NAME_NORMAL, NAME_POSITION, NAME_PTEX};
use oocpt_core::Material;
use oocpt_core::materialx::eval::run;
use oocpt_core::materialx::program::{Geometry, Op, Program, ProgramLookup};
use oocpt_core::mesh::{AnyAttribute, MeshAsset};
use std::sync::Arc;

/// Lookups that a path has places for, its material's and the light's together.
const MAX_LOOKUPS: usize = 16;
/// Most instructions that are run for a mesh.
const MAX_INSTRUCTIONS: usize = 1 << 24;
/// Share of the mean over the mesh that counts everywhere: light that the lattice does not show is found all the same.
const FLOOR: f64 = 0.05;

/// The values at a corner of a triangle: both sets of texture coordinates (u, v, u, v), and two primvars.
pub(super) type EmissionCorner = [[f32; 4]; 3];

/// A program and what it reads. Two are equal if they emit the same.
#[derive(Clone, Debug)]
pub(super) struct EmissionProgram {
    program: Program,
    register: u8,
    /// Numbers of the names that it reads, with their fallbacks.
    sets: [Option<(u32, [f32; 2])>; 2],
    primvars: [Option<(u32, [f32; 4])>; 2],
    /// Maps by lookup.
    maps: Vec<Arc<EmissionMap>>,
    /// True if the mesh alone determines what it reads, so that the host can weight by it.
    is_known: bool,
    /// A number that is different for each program ever made.
    pub(super) number: u64,
}

impl PartialEq for EmissionProgram {
    fn eq(&self, other: &Self) -> bool {
        let maps = |of: &Self| of.maps.iter().map(|map| map.number).collect::<Vec<_>>();
        self.program == other.program
            && self.register == other.register
            && self.sets == other.sets
            && self.primvars == other.primvars
            && maps(self) == maps(other)
    }
}

impl EmissionProgram {
    /// The program of a material, if it can be sampled as a light; `map` returns that of a lookup's texture, `None` if
    /// it cannot be weighted by. `most_lookups`: of a material of the scene.
    pub(super) fn new(
        material: &Material,
        most_lookups: usize,
        number: u64,
        mut map: impl FnMut(&ProgramLookup) -> Option<Arc<EmissionMap>>,
    ) -> Option<Self> {
        let emission = material.emission.as_ref()?;
        let program = &emission.program;
        if program.lookups.len() + most_lookups > MAX_LOOKUPS {
            return None;
        }
        let reads = |geometry: Geometry| {
            program.instructions.iter().any(|step| step.op == Op::Surface && step.immediate == geometry as u16)
        };
        let looks = |set: u8| program.lookups.iter().any(|lookup| lookup.uv == Some(set));
        let set = |at: u8, geometry| {
            let set = material.uv_sets.get(usize::from(at)).filter(|_| reads(geometry) || looks(at))?;
            Some((set.id, set.fallback))
        };
        let primvar = |at: usize, geometry| {
            let slot = material.primvars.get(at).filter(|_| reads(geometry))?;
            Some((slot.id, slot.fallback))
        };
        let sets = [set(0, Geometry::Uv0), set(1, Geometry::Uv1)];
        let primvars = [primvar(0, Geometry::Primvar0), primvar(1, Geometry::Primvar1)];
        let is_strange = sets.iter().flatten().any(|set| set.0 == NAME_PTEX)
            || primvars.iter().flatten().any(|slot| [NAME_NORMAL, NAME_FRAME_X, NAME_FRAME_Y].contains(&slot.0));
        if is_strange {
            return None;
        }
        Some(Self {
            program: program.clone(),
            register: emission.register,
            sets,
            primvars,
            maps: program.lookups.iter().map(&mut map).collect::<Option<_>>()?,
            is_known: !reads(Geometry::Position) && !reads(Geometry::ViewDirection),
            number,
        })
    }

    /// Texture lookups of the program.
    pub(super) fn lookups(&self) -> usize {
        self.program.lookups.len()
    }

    /// Numbers of the names of all that it reads.
    pub(super) fn names(&self) -> impl Iterator<Item = u32> {
        let sets = self.sets.iter().flatten().map(|set| set.0);
        sets.chain(self.primvars.iter().flatten().map(|primvar| primvar.0))
    }

    /// The values at the corners of a triangle that the program reads.
    pub(super) fn corners(&self, mesh: &MeshAsset, triangle: usize) -> [EmissionCorner; 3] {
        let mut corners = [EmissionCorner::default(); 3];
        for (k, set) in self.sets.iter().enumerate() {
            let Some((name, [u, v])) = *set else { continue };
            let values = primvar(mesh, name, triangle).unwrap_or([[u, v, 0.0, 1.0]; 3]);
            for (corner, [u, v, ..]) in corners.iter_mut().zip(values) {
                corner[0][2 * k] = u;
                corner[0][2 * k + 1] = v;
            }
        }
        for (k, slot) in self.primvars.iter().enumerate() {
            let Some((name, fallback)) = *slot else { continue };
            let places = || mesh.triangles.get(triangle).map(|t| t.vertices.map(|[x, y, z]| [x, y, z, 0.0]));
            let found = if name == NAME_POSITION { places() } else { primvar(mesh, name, triangle) };
            for (corner, value) in corners.iter_mut().zip(found.unwrap_or([fallback; 3])) {
                corner[1 + k] = value;
            }
        }
        corners
    }

    /// Steps along an edge of the lattices over the triangles of a mesh; 0 if that is too much work, or the host cannot
    /// evaluate it.
    pub(super) fn steps(&self, triangles: usize) -> u32 {
        let points = MAX_INSTRUCTIONS / (triangles * self.program.instructions.len()).max(1);
        if self.is_known { u32::try_from(points.isqrt()).unwrap_or(LATTICE).min(LATTICE) } else { 0 }
    }

    /// Mean weight of a triangle over a lattice of so many steps; 1 for no steps.
    pub(super) fn weight(&self, mesh: &MeshAsset, triangle: usize, steps: u32) -> f64 {
        if steps == 0 {
            return 1.0;
        }
        let corners = self.corners(mesh, triangle);
        let count = f64::from(steps * steps);
        lattice(steps).map(|weights| self.weight_at(&corners, weights)).sum::<f64>() / count
    }

    fn weight_at(&self, [a, b, c]: &[EmissionCorner; 3], [v, w]: [f64; 2]) -> f64 {
        let mix = |row: usize, k: usize| {
            let [a, b, c] = [a, b, c].map(|corner| f64::from(corner[row][k]));
            narrow(a * (1.0 - v - w) + b * v + c * w)
        };
        let uv = [0, 1, 2, 3].map(|k| mix(0, k));
        let surface = |geometry: Geometry| match geometry {
            Geometry::Uv0 => [uv[0], uv[1], 0.0, 0.0],
            Geometry::Uv1 => [uv[2], uv[3], 0.0, 0.0],
            Geometry::Primvar0 => [0, 1, 2, 3].map(|k| mix(1, k)),
            Geometry::Primvar1 => [0, 1, 2, 3].map(|k| mix(2, k)),
            _ => [0.0; 4],
        };
        let texel = |lookup: &ProgramLookup, place: Option<[f32; 2]>| {
            let [s, t] = match lookup.uv {
                Some(set) => [uv[2 * usize::from(set & 1)], uv[2 * usize::from(set & 1) + 1]],
                None => [0.0; 2],
            };
            let place = place.unwrap_or_else(|| lookup.transform.map(|[x, y, z]| x * s + y * t + z));
            // Lookups of a program are in its order, and so are the maps.
            let at = self.program.lookups.iter().position(|known| std::ptr::eq(known, lookup));
            let value = at.and_then(|at| self.maps.get(at)).map_or(0.5, |map| map.at(place.map(f64::from)));
            [narrow(value), narrow(value), narrow(value), 1.0]
        };
        let registers = run(&self.program, surface, texel);
        let [r, g, b, _] = registers.get(usize::from(self.register)).copied().unwrap_or_default();
        emission_weight([r, g, b].map(|v| f64::from(v).clamp(0.0, MAX_RADIANCE)))
    }
}

/// The weight of a triangle among others of this mean.
pub(super) fn with_floor(weight: f64, mean: f64) -> f64 {
    (1.0 - FLOOR) * weight + FLOOR * mean
}

/// The values of a primvar at the corners of a triangle, as `primvar_corners` of the shaders returns them.
pub(super) fn primvar(mesh: &MeshAsset, name: u32, triangle: usize) -> Option<[[f32; 4]; 3]> {
    let values = &mesh.primvars.iter().find(|primvar| primvar.id == name)?.values;
    let at = match values.rate() {
        AttributeRate::Constant => [0; 3],
        AttributeRate::Uniform => [triangle; 3],
        AttributeRate::Vertex => mesh.corner_indices.get(triangle)?.map(|corner| corner as usize),
        AttributeRate::FaceVarying => [3 * triangle, 3 * triangle + 1, 3 * triangle + 2],
    };
    let value = |at: usize| {
        Some(match values {
            AnyAttribute::One(values) => [*values.values.get(at)?; 4],
            AnyAttribute::Two(values) => values.values.get(at).map(|[x, y]| [*x, *y, 0.0, 1.0])?,
            AnyAttribute::Three(values) => values.values.get(at).map(|[x, y, z]| [*x, *y, *z, 1.0])?,
            AnyAttribute::Four(values) => *values.values.get(at)?,
        })
    };
    let [a, b, c] = at.map(value);
    Some([a?, b?, c?])
}

#[cfg(test)]
mod tests {
    use super::super::emission::{EmittedPower, PrimEmission};
    use super::super::emitter::MeshEmitter;
    use super::*;
    use oocpt_abi::{MaterialFlags, MaterialInput};
    use oocpt_core::material::{InputValue, PrimvarSlot, UvSet};
    use oocpt_core::materialx::MaterialEmission;
    use oocpt_core::materialx::program::{Instruction, Operand};
    use oocpt_core::mesh::MeshAsset;
    use oocpt_core::scene::MeshDesc;
    use oocpt_core::{PrimDesc, SceneDb, TypedArray};

    /// A material that emits `base`, and 1 more where what it reads is above 1.
    fn above_one(geometry: Geometry, base: f32) -> Material {
        let (r, c) = (Operand::Register(0), Operand::Constant(0));
        let step = |op, operands, immediate| Instruction { op, to: 0, operands, immediate };
        let program = Program {
            instructions: vec![
                step(Op::Surface, [r; 3], geometry as u16),
                step(Op::Swizzle, [r; 3], 0),
                step(Op::Greater, [r, c, c], 0),
                step(Op::Add, [r, Operand::Constant(1), c], 0),
            ],
            constants: vec![[1.0; 4], [base; 4]],
            lookups: Vec::new(),
        };
        Material {
            flags: MaterialFlags::EMISSIVE | MaterialFlags::PATTERNS,
            inputs: [InputValue::Constant([0.0; 4]); MaterialInput::COUNT],
            opacity_threshold: 0.0,
            uv_sets: vec![UvSet { name: "st".into(), id: 7, fallback: [3.0, 0.0] }],
            primvars: vec![PrimvarSlot { name: "place".into(), id: NAME_POSITION, fallback: [0.0; 4] }],
            program: Program::default(),
            opacity_program: Program::default(),
            emission: Some(MaterialEmission { program, register: 0 }),
        }
    }

    fn made(material: &Material) -> Option<EmissionProgram> {
        EmissionProgram::new(material, 0, 1, |_| None)
    }

    /// Two unit squares side by side, of 0 to 2 in x.
    fn squares() -> MeshAsset {
        let mut db = SceneDb::new();
        let points: Vec<[f32; 3]> = [0.0, 1.0, 2.0_f32].iter().flat_map(|&x| [[x, 0.0, 0.0], [x, 1.0, 0.0]]).collect();
        db.upsert_mesh(MeshDesc {
            prim: PrimDesc { path: "/m".into(), ..PrimDesc::default() },
            face_vertex_counts: TypedArray::of(vec![4, 4]),
            face_vertex_indices: TypedArray::of(vec![0, 2, 3, 1, 2, 4, 5, 3]),
            points: TypedArray::of(points),
            ..MeshDesc::default()
        });
        db.commit().snapshot.meshes[0].asset().expect("in memory").as_ref().clone()
    }

    fn weights(material: &Material) -> Option<Vec<f32>> {
        let power = EmittedPower::Program(Arc::new(made(material).expect("light can be asked for it")));
        let emission = PrimEmission { by_slot: vec![power], scale: 1.0 };
        MeshEmitter::new(&squares(), &emission).map(|emitter| emitter.face_weights)
    }

    #[test]
    fn face_weights_follow_the_emission_program() {
        let found = weights(&above_one(Geometry::Primvar0, 0.0)).expect("it emits");
        for (found, known) in found.iter().zip([0.05 * 0.5, 0.95 + 0.05 * 0.5]) {
            assert!((found - known).abs() < 1e-6, "{found}, not {known}");
        }
        // The mesh has no such set: the fallback is above 1 everywhere.
        assert_eq!(weights(&above_one(Geometry::Uv0, 0.5)), Some(vec![1.5; 2]));
        // The host does not know positions in the world.
        assert_eq!(weights(&above_one(Geometry::Position, 0.0)), Some(vec![1.0; 2]));
        assert_eq!(weights(&above_one(Geometry::Uv1, 0.0)), None, "black wherever it is looked at");
    }

    #[test]
    fn programs_reading_normals_or_many_textures_are_not_sampled() {
        let mut by_normal = above_one(Geometry::Primvar0, 0.0);
        by_normal.primvars[0].id = NAME_NORMAL;
        assert!(made(&by_normal).is_none(), "the normal in the mesh's frame");
        let mut of_ptex = above_one(Geometry::Uv0, 0.0);
        assert!(made(&of_ptex).is_some(), "texture coordinates");
        of_ptex.uv_sets[0].id = NAME_PTEX;
        assert!(made(&of_ptex).is_none(), "Ptex");
        let mut textured = above_one(Geometry::Uv0, 0.0);
        let lookup =
            ProgramLookup { texture: 0, uv: Some(0), transform: [[0.0; 3]; 2], scale: [1.0; 4], bias: [0.0; 4] };
        if let Some(emission) = &mut textured.emission {
            emission.program.lookups = vec![lookup; 4];
        }
        let map = |_: &ProgramLookup| Some(Arc::new(EmissionMap::even(1.0, 1)));
        assert!(EmissionProgram::new(&textured, 12, 1, map).is_some(), "as many as there are places");
        assert!(EmissionProgram::new(&textured, 13, 1, map).is_none(), "one more");
    }

    #[test]
    fn emission_program_evaluations_are_bounded() {
        let program = made(&above_one(Geometry::Primvar0, 0.0)).expect("light can be asked for it");
        assert_eq!(program.steps(1), LATTICE);
        assert!((1..LATTICE).contains(&program.steps(MAX_INSTRUCTIONS / 64)), "fewer points for many triangles");
        assert_eq!(program.steps(MAX_INSTRUCTIONS), 0, "too many");
    }
}
