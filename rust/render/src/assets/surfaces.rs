// SPDX-License-Identifier: Apache-2.0
//! The tables of materials and of who has them, and the sections of a mesh that materials read. Pure.

use crate::textures::OpacityMasks;
use bytemuck::Zeroable;
use oocpt_abi as abi;
use oocpt_abi::{
    GpuAttribute, GpuCutout, GpuInput, GpuMaterial, GpuPrim, MaterialFlags, MaterialInput, NAME_PTEX, NO_MATERIAL,
};
use oocpt_core::material::{InputValue, Material, UvSet};
use oocpt_core::materialx::program::{Program, ProgramLookup};
use oocpt_core::mesh::{MeshSummary, PrimvarSummary};
use oocpt_core::scene::{PrimRecord, SurfaceTables};

/// The tables of a snapshot as the shaders read them.
#[derive(Debug)]
pub(crate) struct SurfaceEntries {
    pub(crate) materials: Vec<GpuMaterial>,
    pub(crate) prims: Vec<GpuPrim>,
    pub(crate) slots: Vec<u32>,
    /// Programs of the materials, one behind the other.
    pub(crate) programs: Vec<[u32; 4]>,
}

impl SurfaceEntries {
    /// None when no mesh has a material.
    pub(crate) fn new(surfaces: &SurfaceTables) -> Option<Self> {
        if surfaces.materials.is_empty() {
            return None;
        }
        let mut programs = Vec::new();
        Some(Self {
            materials: surfaces.materials.iter().map(|m| material(m, &mut programs)).collect(),
            programs,
            prims: surfaces.prims.iter().map(prim).collect(),
            slots: surfaces.material_slots.iter().map(|&slot| slot_word(surfaces, slot)).collect(),
        })
    }

    /// The same with masks of what is known of cutouts, which lie at `address`.
    pub(crate) fn with_masks(mut self, masks: &OpacityMasks, address: u64) -> Self {
        for (number, material) in self.materials.iter_mut().enumerate() {
            if let Some(word) = masks.first_word(number) {
                material.cutout = cutout(material, masks, word, address);
            }
        }
        for slot in self.slots.iter_mut().filter(|slot| **slot != NO_MATERIAL) {
            if masks.is_opaque((*slot & !abi::SLOT_PRESENCE) as usize) {
                *slot &= !abi::SLOT_PRESENCE;
            }
        }
        self
    }

    /// Count and stride of each table of a snapshot; none without materials.
    pub(crate) fn sizes(surfaces: &SurfaceTables) -> impl Iterator<Item = (usize, usize)> {
        let sizes = [
            (surfaces.materials.len(), size_of::<GpuMaterial>()),
            (surfaces.prims.len(), size_of::<GpuPrim>()),
            (surfaces.material_slots.len(), size_of::<u32>()),
            (surfaces.materials.iter().map(|material| rows_of(material)).sum(), ROW),
        ];
        let has_materials = !surfaces.materials.is_empty();
        sizes.into_iter().filter(move |_| has_materials)
    }
}

/// Of a material whose mask begins at a word of those at `address`. Only what reads a texture at a set has a mask.
fn cutout(material: &GpuMaterial, masks: &OpacityMasks, word: u32, address: u64) -> GpuCutout {
    let GpuInput { row_s, row_t, kind, .. } = material.inputs[MaterialInput::Opacity as usize];
    let set = (kind >> abi::INPUT_SET_SHIFT & 1) as usize;
    let at = word as usize;
    let [size, modes] = [at, at + 1].map(|word| masks.words.get(word).copied().unwrap_or(0));
    GpuCutout {
        row_s,
        set: material.names[set],
        row_t,
        size,
        mask: address + size_of::<u32>() as u64 * u64::from(word),
        modes,
        is_chance: u32::from(material.opacity_threshold <= 0.0),
    }
}

fn prim(record: &PrimRecord) -> GpuPrim {
    let PrimRecord { first_slot, slot_count, category_set, .. } = *record;
    GpuPrim { first_slot, slot_count, link_set: category_set, pad: 0 }
}

fn slot_word(surfaces: &SurfaceTables, slot: u32) -> u32 {
    match surfaces.materials.get(slot as usize) {
        Some(material) if material.flags.contains(MaterialFlags::PRESENCE) => slot | abi::SLOT_PRESENCE,
        Some(_) => slot,
        None => NO_MATERIAL,
    }
}

/// Bytes of a row of the programs.
const ROW: usize = size_of::<[u32; 4]>();
/// Rows of a lookup.
const LOOKUP_ROWS: usize = size_of::<GpuInput>() / ROW;

/// Rows of 16 bytes of a program.
fn program_rows(program: &Program) -> usize {
    program.constants.len() + LOOKUP_ROWS * program.lookups.len() + program.instructions.len().div_ceil(2)
}

/// Rows of the programs of a material.
fn rows_of(material: &Material) -> usize {
    program_rows(&material.program) + own_program(material).map_or(0, |(own, _)| 1 + program_rows(own))
}

/// The program for one input alone, opacity or emission, and the register of the emission. What is not there everywhere
/// is not asked for light.
fn own_program(material: &Material) -> Option<(&Program, u8)> {
    if !material.opacity_program.instructions.is_empty() {
        return Some((&material.opacity_program, 0));
    }
    material.emission.as_ref().map(|emission| (&emission.program, emission.register))
}

/// Adds the programs of a material; `program` and `program_sizes` of its entry.
fn add_programs(material: &Material, rows: &mut Vec<[u32; 4]>) -> (u32, u32) {
    let begin = u32::try_from(rows.len()).unwrap_or(u32::MAX);
    let found = add_program(&material.program, rows);
    let Some((own, register)) = own_program(material) else { return found };
    let header = rows.len();
    rows.push([0, u32::from(register), 0, 0]);
    rows[header][0] = add_program(own, rows).1;
    (begin, found.1)
}

/// Adds a program; where it begins, and its sizes (`GpuMaterial::program_sizes`).
fn add_program(program: &Program, rows: &mut Vec<[u32; 4]>) -> (u32, u32) {
    let [constants, lookups, instructions] =
        [program.constants.len(), program.lookups.len(), program.instructions.len()]
            .map(|n| u32::try_from(n).unwrap_or(0));
    if instructions == 0 {
        return (0, 0);
    }
    let first = u32::try_from(rows.len()).unwrap_or(u32::MAX);
    rows.extend(program.constants.iter().map(|value| value.map(f32::to_bits)));
    for lookup in &program.lookups {
        let ProgramLookup { texture, uv, transform, scale, bias } = *lookup;
        let whole = input(&InputValue::Texture { texture, channel: None, scale, bias, uv, transform }, &[]);
        rows.extend_from_slice(bytemuck::cast_slice::<GpuInput, [u32; 4]>(&[whole]));
    }
    for pair in program.instructions.chunks(2) {
        let [a, b] = pair[0].pack();
        let [c, d] = pair.get(1).map_or([0; 2], |second| second.pack());
        rows.push([a, b, c, d]);
    }
    (first, constants | lookups << 8 | instructions << 16)
}

fn material(material: &Material, programs: &mut Vec<[u32; 4]>) -> GpuMaterial {
    let mut names = [abi::NO_NAME; 4];
    let mut set_fallback = [[0.0; 2]; 2];
    for (k, set) in material.uv_sets.iter().take(2).enumerate() {
        names[k] = set.id;
        set_fallback[k] = set.fallback;
    }
    let mut primvar_fallback = [[0.0; 4]; 2];
    for ((name, fallback), slot) in names.iter_mut().skip(2).zip(&mut primvar_fallback).zip(&material.primvars) {
        *name = slot.id;
        *fallback = slot.fallback;
    }
    let (program, program_sizes) = add_programs(material, programs);
    GpuMaterial {
        inputs: material.inputs.map(|i| input(&i, &material.uv_sets)),
        flags: material.flags.bits(),
        opacity_threshold: material.opacity_threshold,
        names,
        set_fallback,
        program,
        program_sizes,
        primvar_fallback,
        cutout: GpuCutout::zeroed(),
    }
}

/// `material_sets`: the sets of texture coordinates of its material.
fn input(input: &InputValue, material_sets: &[UvSet]) -> GpuInput {
    let plain = |kind: u32, value: [f32; 4]| GpuInput {
        value,
        bias: [0.0; 4],
        row_s: [0.0; 3],
        kind,
        row_t: [0.0; 3],
        texture: 0,
    };
    match *input {
        InputValue::Constant(value) => plain(abi::INPUT_CONSTANT, value),
        InputValue::Primvar { slot, fallback } => {
            plain(abi::INPUT_PRIMVAR | u32::from(slot & 1) << abi::INPUT_SET_SHIFT, fallback)
        }
        InputValue::Register(register) => {
            GpuInput { texture: u32::from(register), ..plain(abi::INPUT_REGISTER, [0.0; 4]) }
        }
        InputValue::Texture { texture, channel, scale, bias, uv, transform } => {
            let is_ptex =
                uv.is_some_and(|uv| material_sets.get(usize::from(uv)).is_some_and(|set| set.id == NAME_PTEX));
            let channel = channel.map_or(0, |c| u32::from(c & 3) + 1);
            let set = uv.map_or(abi::INPUT_NO_SET, |uv| u32::from(uv & 1));
            let kind = abi::INPUT_TEXTURE | channel << abi::INPUT_CHANNEL_SHIFT | set << abi::INPUT_SET_SHIFT;
            let kind = if is_ptex { kind | abi::INPUT_PTEX } else { kind };
            GpuInput { bias, row_s: transform[0], row_t: transform[1], texture, ..plain(kind, scale) }
        }
    }
}

/// The table of a mesh's primvars: offsets of their values count from the table on and are in `offsets`.
pub(crate) fn attributes(mesh: &MeshSummary, table: u64, offsets: &[u64]) -> Vec<GpuAttribute> {
    let entry = |(primvar, offset): (&PrimvarSummary, &u64)| GpuAttribute {
        values: offset.saturating_sub(table),
        name: primvar.id,
        rate_and_width: primvar.values.rate as u32 | primvar.values.width << 8,
    };
    mesh.primvars.iter().zip(offsets).map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_keep_their_kind_channel_and_set() {
        let made = input(
            &InputValue::Texture {
                texture: 7,
                channel: Some(3),
                scale: [1.0, 2.0, 3.0, 4.0],
                bias: [5.0; 4],
                uv: Some(1),
                transform: [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
            },
            &[],
        );
        assert_eq!(made.kind, 1 | 4 << 2 | 1 << 5);
        assert_eq!((made.texture, made.value, made.bias), (7, [1.0, 2.0, 3.0, 4.0], [5.0; 4]));
        assert_eq!((made.row_s, made.row_t), ([1.0, 2.0, 3.0], [4.0, 5.0, 6.0]));
        let placed = InputValue::Texture {
            texture: 0,
            channel: None,
            scale: [1.0; 4],
            bias: [0.0; 4],
            uv: None,
            transform: [[0.0; 3]; 2],
        };
        assert_eq!(input(&placed, &[]).kind, 1 | 2 << 5);
        assert_eq!(input(&InputValue::Primvar { slot: 1, fallback: [0.5; 4] }, &[]).kind, 2 | 1 << 5);
        assert_eq!(input(&InputValue::Constant([0.5; 4]), &[]).kind, 0);
    }
}
