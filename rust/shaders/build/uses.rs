// SPDX-License-Identifier: Apache-2.0
//! What of the specialisation constants a module reads, so that scenes which differ in something else share its
//! pipelines.
//!
//! Shared by `build.rs` and the tests. Pure; any thread. Source: SPIR-V 1.5, 2.4 (logical layout), 3.32.7
//! (`OpSpecConstantOp`).

use rspirv::dr::{Instruction, Module, Operand};
use rspirv::spirv::{Decoration, Op};
use std::collections::{BTreeSet, HashMap};

/// What a module reads.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct ModuleUses {
    /// Ids (`SpecId`) of the constants.
    pub(crate) constants: BTreeSet<u32>,
    /// Bits of those constants that are words of flags, by their ids.
    pub(crate) bits: HashMap<u32, u32>,
}

/// What the entry point, and all that it may call, reads of the specialisation constants; `flags` are those that are
/// words of flags, read bit by bit.
///
/// # Errors
/// If the words are no module with one entry point.
pub(crate) fn uses(words: &[u32], flags: &[u32]) -> Result<ModuleUses, String> {
    let module = rspirv::dr::load_words(words).map_err(|error| format!("not a SPIR-V module: {error:?}"))?;
    let mut seen =
        UseCollector { globals: globals(&module), spec_ids: spec_ids(&module), flags, uses: ModuleUses::default() };
    let mut waiting: Vec<u32> = reachable(&module)?;
    let mut known: BTreeSet<u32> = waiting.iter().copied().collect();
    while let Some(id) = waiting.pop() {
        for next in seen.read(id) {
            if known.insert(next) {
                waiting.push(next);
            }
        }
    }
    Ok(seen.uses)
}

/// Types, constants and variables by their ids.
fn globals(module: &Module) -> HashMap<u32, &Instruction> {
    module.types_global_values.iter().filter_map(|global| Some((global.result_id?, global))).collect()
}

/// `SpecId` of each constant that has one.
fn spec_ids(module: &Module) -> HashMap<u32, u32> {
    let decorated = |annotation: &Instruction| match annotation.operands.as_slice() {
        [Operand::IdRef(id), Operand::Decoration(Decoration::SpecId), Operand::LiteralBit32(spec)] => {
            Some((*id, *spec))
        }
        _ => None,
    };
    module.annotations.iter().filter_map(decorated).collect()
}

fn ids(instruction: &Instruction) -> impl Iterator<Item = u32> {
    instruction.result_type.into_iter().chain(instruction.operands.iter().filter_map(Operand::id_ref_any))
}

/// Every id that the functions name which the entry point may call.
fn reachable(module: &Module) -> Result<Vec<u32>, String> {
    let [entry] = module.entry_points.as_slice() else {
        return Err(format!("{} entry points", module.entry_points.len()));
    };
    let main = entry.operands.iter().find_map(|operand| match operand {
        Operand::IdRef(id) => Some(*id),
        _ => None,
    });
    let by_id: HashMap<u32, _> =
        module.functions.iter().filter_map(|function| Some((function.def_id()?, function))).collect();
    let mut waiting = vec![main.ok_or("an entry point without a function")?];
    let mut known: BTreeSet<u32> = waiting.iter().copied().collect();
    let mut named = BTreeSet::new();
    while let Some(function) = waiting.pop() {
        let function = by_id.get(&function).ok_or_else(|| format!("no function {function}"))?;
        for instruction in function.all_inst_iter() {
            named.extend(ids(instruction));
            if let (Op::FunctionCall, Some(Operand::IdRef(callee))) =
                (instruction.class.opcode, instruction.operands.first())
                && known.insert(*callee)
            {
                waiting.push(*callee);
            }
        }
    }
    Ok(named.into_iter().collect())
}

struct UseCollector<'m> {
    globals: HashMap<u32, &'m Instruction>,
    spec_ids: HashMap<u32, u32>,
    flags: &'m [u32],
    uses: ModuleUses,
}

impl UseCollector<'_> {
    /// Notes what the global of this id reads, and gives the ids that it names.
    fn read(&mut self, id: u32) -> Vec<u32> {
        let Some(&global) = self.globals.get(&id) else {
            return Vec::new();
        };
        if let Some(&spec) = self.spec_ids.get(&id) {
            // A word of flags that is not read by a mask is read as a whole.
            self.note(spec, u32::MAX);
        }
        if let Some((spec, mask)) = self.masked(global) {
            self.note(spec, mask);
            return Vec::new();
        }
        ids(global).collect()
    }

    fn note(&mut self, spec: u32, mask: u32) {
        self.uses.constants.insert(spec);
        if self.flags.contains(&spec) {
            *self.uses.bits.entry(spec).or_default() |= mask;
        }
    }

    /// The word of flags and the mask of `word & mask`.
    fn masked(&self, global: &Instruction) -> Option<(u32, u32)> {
        let [Operand::LiteralSpecConstantOpInteger(Op::BitwiseAnd), Operand::IdRef(a), Operand::IdRef(b)] =
            global.operands.as_slice()
        else {
            return None;
        };
        let word = |id: &u32| self.spec_ids.get(id).copied().filter(|spec| self.flags.contains(spec));
        let mask = |id: &u32| match self.globals.get(id).filter(|mask| mask.class.opcode == Op::Constant)?.operands[..]
        {
            [Operand::LiteralBit32(mask)] => Some(mask),
            _ => None,
        };
        Some((word(a)?, mask(b)?)).or_else(|| Some((word(b)?, mask(a)?)))
    }
}
