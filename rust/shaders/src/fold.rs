// SPDX-License-Identifier: Apache-2.0
//! Leaves out of a module what its specialisation constants make unreachable, before a driver sees it.
//!
//! A pass is one module for all scenes, most of which is dead for any one of them. Drivers fold specialisation
//! constants late: Mesa's software driver takes all of a module through its front end and inlines all functions first,
//! at every start of a process, since only what comes behind is kept on disk. Here branches on conditions that are
//! known become jumps, and blocks and functions that nothing reaches go. The global section stays but for names and
//! for decorations of what is gone, so the driver is given the same constants as before.
//!
//! Only selections are folded, never the tests of loops, and a module that is not as expected stays as it is. Sources:
//! SPIR-V 1.5, 2.3 (physical layout), 2.4 (logical layout), 2.11 (structured control flow). Pure; any thread.

mod blocks;
mod values;

use blocks::SpirvFunction;
use std::collections::{HashMap, HashSet};
use values::KnownValues;

/// Words before the first instruction.
const HEADER: usize = 5;

pub(crate) mod op {
    //! Opcodes, by their numbers in the specification.
    pub(crate) const NAME: u32 = 5;
    pub(crate) const MEMBER_NAME: u32 = 6;
    pub(crate) const LINE: u32 = 8;
    pub(crate) const ENTRY_POINT: u32 = 15;
    pub(crate) const CONSTANT_TRUE: u32 = 41;
    pub(crate) const CONSTANT_FALSE: u32 = 42;
    pub(crate) const CONSTANT: u32 = 43;
    pub(crate) const SPEC_CONSTANT: u32 = 50;
    pub(crate) const SPEC_CONSTANT_OP: u32 = 52;
    pub(crate) const TYPE_INT: u32 = 21;
    pub(crate) const FUNCTION: u32 = 54;
    pub(crate) const FUNCTION_END: u32 = 56;
    pub(crate) const FUNCTION_CALL: u32 = 57;
    pub(crate) const STORE: u32 = 62;
    pub(crate) const COPY_MEMORY: u32 = 63;
    pub(crate) const DECORATE: u32 = 71;
    pub(crate) const CONTROL_BARRIER: u32 = 224;
    pub(crate) const MEMORY_BARRIER: u32 = 225;
    pub(crate) const ATOMIC_STORE: u32 = 228;
    pub(crate) const PHI: u32 = 245;
    pub(crate) const LOOP_MERGE: u32 = 246;
    pub(crate) const SELECTION_MERGE: u32 = 247;
    pub(crate) const LABEL: u32 = 248;
    pub(crate) const BRANCH: u32 = 249;
    pub(crate) const BRANCH_CONDITIONAL: u32 = 250;
    pub(crate) const SWITCH: u32 = 251;
    pub(crate) const UNREACHABLE: u32 = 255;
}

/// An instruction: its opcode, and its words, the first of which holds opcode and length.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SpirvInstruction<'w> {
    pub(crate) op: u32,
    pub(crate) words: &'w [u32],
}

impl SpirvInstruction<'_> {
    /// A word of it, 0 where it has fewer.
    pub(crate) fn word(&self, at: usize) -> u32 {
        self.words.get(at).copied().unwrap_or(0)
    }

    /// What it defines, of instructions in functions.
    pub(crate) fn result(&self) -> Option<u32> {
        match self.op {
            op::LABEL => Some(self.word(1)),
            op::STORE | op::COPY_MEMORY | op::LINE | op::FUNCTION_END | op::LOOP_MERGE..=op::UNREACHABLE => None,
            op::CONTROL_BARRIER | op::MEMORY_BARRIER | op::ATOMIC_STORE => None,
            _ => self.words.get(2).copied(),
        }
    }
}

/// The first word of an instruction of `words` words.
pub(crate) const fn head(op: u32, words: u32) -> u32 {
    words << 16 | op
}

/// The instructions of a module; `None` if it is none.
fn instructions(words: &[u32]) -> Option<Vec<SpirvInstruction<'_>>> {
    let mut all = Vec::with_capacity(words.len() / 4);
    let mut at = HEADER;
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        let body = words.get(at..at + length).filter(|body| !body.is_empty())?;
        all.push(SpirvInstruction { op: words[at] & 0xffff, words: body });
        at += length;
    }
    Some(all)
}

/// `words` without what is unreachable when specialisation constants are `(id, value)`, as they have to be when the
/// driver is given the result. `None`: it is to be used as it is.
pub(crate) fn fold(words: &[u32], spec: &[(u32, u32)]) -> Option<Vec<u32>> {
    let all = instructions(words)?;
    let first = all.iter().position(|instruction| instruction.op == op::FUNCTION)?;
    let (global, code) = all.split_at(first);
    let values = KnownValues::of_globals(global, spec);
    let functions: Vec<SpirvFunction<'_>> = code
        .split_inclusive(|instruction| instruction.op == op::FUNCTION_END)
        .map(|function| SpirvFunction::folded(function, values.clone()))
        .collect::<Option<_>>()?;
    let mut entries = global.iter().filter(|instruction| instruction.op == op::ENTRY_POINT);
    let (entry, None) = (entries.next()?.word(2), entries.next()) else {
        return None;
    };
    let called = called(&functions, entry)?;
    let kept: Vec<&SpirvFunction<'_>> = functions.iter().filter(|function| called.contains(&function.id)).collect();

    // What decorations may be about: all that is global, and what is left of the functions.
    let gone: HashSet<u32> = code.iter().filter_map(SpirvInstruction::result).collect();
    let left: HashSet<u32> = kept.iter().flat_map(|function| function.results()).collect();
    let mut out = words[..HEADER].to_vec();
    for instruction in global {
        let about = instruction.word(1);
        let keep = match instruction.op {
            op::NAME | op::MEMBER_NAME | op::LINE => false,
            op::DECORATE => !gone.contains(&about) || left.contains(&about),
            _ => true,
        };
        if keep {
            out.extend_from_slice(instruction.words);
        }
    }
    for function in kept {
        function.write(&mut out);
    }
    Some(out)
}

/// The functions that the one of id `entry` may call, and itself.
fn called(functions: &[SpirvFunction<'_>], entry: u32) -> Option<HashSet<u32>> {
    let by_id: HashMap<u32, &SpirvFunction<'_>> = functions.iter().map(|function| (function.id, function)).collect();
    let mut known = HashSet::from([entry]);
    let mut waiting = vec![entry];
    while let Some(id) = waiting.pop() {
        for callee in by_id.get(&id)?.calls() {
            if known.insert(callee) {
                waiting.push(callee);
            }
        }
    }
    Some(known)
}
