// SPDX-License-Identifier: Apache-2.0
//! Compares the struct layouts in a SPIR-V module with the layouts of the Rust structs.
//!
//! Shared by `build.rs` and the tests. Pure; any thread.

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op};
use std::collections::{BTreeSet, HashMap};

/// Where a member is. As `oocpt_abi::MemberLayout`.
#[derive(Debug, Clone)]
pub(crate) struct HostMember {
    /// Name.
    pub(crate) name: String,
    /// Bytes from the start of the struct.
    pub(crate) offset: u64,
    /// Bytes of the member.
    pub(crate) size: u64,
}

/// How the host lays a struct out.
#[derive(Debug, Clone)]
pub(crate) struct HostLayout {
    /// Name.
    pub(crate) name: String,
    /// Bytes of the struct and stride of arrays of it.
    pub(crate) size: u64,
    /// Members in order.
    pub(crate) members: Vec<HostMember>,
}

/// What a module says about its types.
struct ModuleTypes<'m> {
    by_id: HashMap<u32, &'m Instruction>,
    names: HashMap<u32, &'m str>,
    member_names: HashMap<(u32, u32), &'m str>,
    offsets: HashMap<(u32, u32), u64>,
    strides: HashMap<u32, u64>,
    blocks: BTreeSet<u32>,
}

/// Compares every struct of `words` that has member offsets with the layout of the same name. Returns the names of the
/// structs compared.
///
/// # Errors
/// All differences, one per line: unknown structs, members that are missing, renamed, moved, or of another size, and
/// arrays with another stride.
pub(crate) fn check(words: &[u32], layouts: &[HostLayout]) -> Result<BTreeSet<String>, String> {
    let module = rspirv::dr::load_words(words).map_err(|error| format!("not a SPIR-V module: {error:?}"))?;
    let types = ModuleTypes::new(&module);
    let mut seen = BTreeSet::new();
    let mut errors = Vec::new();
    for instruction in &module.types_global_values {
        match (instruction.class.opcode, instruction.result_id) {
            (Op::TypeStruct, Some(id)) => types.check_struct(id, layouts, &mut seen, &mut errors),
            (Op::TypeArray | Op::TypeRuntimeArray, Some(id)) => types.check_stride(id, layouts, &mut errors),
            _ => {}
        }
    }
    if errors.is_empty() { Ok(seen) } else { Err(errors.join("\n")) }
}

impl<'m> ModuleTypes<'m> {
    fn new(module: &'m Module) -> Self {
        let mut types = Self {
            by_id: HashMap::new(),
            names: HashMap::new(),
            member_names: HashMap::new(),
            offsets: HashMap::new(),
            strides: HashMap::new(),
            blocks: BTreeSet::new(),
        };
        for instruction in &module.types_global_values {
            if let Some(id) = instruction.result_id {
                types.by_id.insert(id, instruction);
            }
        }
        for instruction in &module.debug_names {
            types.read_name(&instruction.operands, instruction.class.opcode);
        }
        for instruction in &module.annotations {
            types.read_decoration(&instruction.operands);
        }
        types
    }

    fn read_name(&mut self, operands: &'m [Operand], opcode: Op) {
        match (opcode, operands) {
            (Op::Name, [Operand::IdRef(id), Operand::LiteralString(name)]) => {
                self.names.insert(*id, name);
            }
            (Op::MemberName, [Operand::IdRef(id), Operand::LiteralBit32(index), Operand::LiteralString(name)]) => {
                self.member_names.insert((*id, *index), name);
            }
            _ => {}
        }
    }

    fn read_decoration(&mut self, operands: &[Operand]) {
        match operands {
            [
                Operand::IdRef(id),
                Operand::LiteralBit32(index),
                Operand::Decoration(Decoration::Offset),
                Operand::LiteralBit32(offset),
            ] => {
                self.offsets.insert((*id, *index), u64::from(*offset));
            }
            [Operand::IdRef(id), Operand::Decoration(Decoration::ArrayStride), Operand::LiteralBit32(stride)] => {
                self.strides.insert(*id, u64::from(*stride));
            }
            [Operand::IdRef(id), Operand::Decoration(Decoration::Block)] => {
                self.blocks.insert(*id);
            }
            _ => {}
        }
    }

    fn operands(&self, id: u32) -> &[Operand] {
        self.by_id.get(&id).map_or(&[], |instruction| &instruction.operands)
    }

    fn check_struct(&self, id: u32, layouts: &[HostLayout], seen: &mut BTreeSet<String>, errors: &mut Vec<String>) {
        let members = self.operands(id);
        if !self.offsets.contains_key(&(id, 0)) || (self.blocks.contains(&id) && members.len() == 1) {
            return; // A copy in registers, or the wrapper that GLSL puts around every buffer.
        }
        let name = self.name(id);
        let Some(layout) = layouts.iter().find(|layout| layout.name == name) else {
            errors.push(format!("{name}: in memory, but Rust does not know it"));
            return;
        };
        seen.insert(name.to_owned());
        if members.len() != layout.members.len() {
            errors.push(format!("{name}: {} members in GLSL, {} in Rust", members.len(), layout.members.len()));
        }
        for (index, (operand, member)) in (0_u32..).zip(members.iter().zip(&layout.members)) {
            let glsl = HostMember {
                name: self.member_names.get(&(id, index)).copied().unwrap_or_default().to_owned(),
                offset: self.offsets.get(&(id, index)).copied().unwrap_or(u64::MAX),
                size: operand.id_ref_any().and_then(|member| self.size(member)).unwrap_or(u64::MAX),
            };
            if (&glsl.name, glsl.offset, glsl.size) != (&member.name, member.offset, member.size) {
                errors.push(format!("{name}: GLSL has {glsl:?}, Rust has {member:?}"));
            }
        }
    }

    fn check_stride(&self, id: u32, layouts: &[HostLayout], errors: &mut Vec<String>) {
        let Some(element) = self.operands(id).first().and_then(Operand::id_ref_any) else {
            return;
        };
        let name = self.name(element);
        let (Some(stride), Some(layout)) = (self.strides.get(&id), layouts.iter().find(|layout| layout.name == name))
        else {
            return;
        };
        if *stride != layout.size {
            errors.push(format!("{name}: array stride {stride} in GLSL, size {} in Rust", layout.size));
        }
    }

    fn name(&self, id: u32) -> &str {
        self.names.get(&id).copied().unwrap_or_default()
    }

    /// Bytes of a type in memory; None for types that have no place there.
    fn size(&self, id: u32) -> Option<u64> {
        let instruction = self.by_id.get(&id)?;
        let operands = &instruction.operands;
        match (instruction.class.opcode, operands.as_slice()) {
            (Op::TypeInt | Op::TypeFloat, [Operand::LiteralBit32(bits), ..]) => Some(u64::from(*bits) / 8),
            (Op::TypeVector, [Operand::IdRef(element), Operand::LiteralBit32(count)]) => {
                Some(self.size(*element)? * u64::from(*count))
            }
            (Op::TypeArray, [Operand::IdRef(_), Operand::IdRef(count)]) => {
                Some(self.strides.get(&id)? * self.constant(*count)?)
            }
            (Op::TypeStruct, members) => {
                let last = u32::try_from(members.len()).ok()?.checked_sub(1)?;
                Some(self.offsets.get(&(id, last))? + self.size(members.last()?.id_ref_any()?)?)
            }
            (Op::TypePointer, _) => Some(8),
            _ => None,
        }
    }

    fn constant(&self, id: u32) -> Option<u64> {
        match self.by_id.get(&id)?.operands.as_slice() {
            [Operand::LiteralBit32(value)] => Some(u64::from(*value)),
            _ => None,
        }
    }
}
