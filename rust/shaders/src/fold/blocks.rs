// SPDX-License-Identifier: Apache-2.0
//! A function as blocks: which of them are reached, and what is written of them.

use super::values::KnownValues;
use super::{SpirvInstruction, head, op};
use std::collections::{HashMap, HashSet};

/// A block from its label to its terminator.
#[derive(Clone, Debug)]
struct BasicBlock<'w> {
    label: u32,
    /// Between the label and the end: no merge, no terminator.
    body: Vec<SpirvInstruction<'w>>,
    /// `OpSelectionMerge` or `OpLoopMerge`, if it is the header of something.
    merge: Option<SpirvInstruction<'w>>,
    end: BlockEnd<'w>,
}

/// How a block ends.
#[derive(Clone, Copy, Debug)]
enum BlockEnd<'w> {
    /// As it was.
    As(SpirvInstruction<'w>),
    /// With a jump, once with a choice.
    Jump(u32),
}

impl BasicBlock<'_> {
    /// Where it may go.
    fn targets(&self) -> Vec<u32> {
        match self.end {
            BlockEnd::Jump(to) => vec![to],
            BlockEnd::As(end) => match end.op {
                op::BRANCH => vec![end.word(1)],
                op::BRANCH_CONDITIONAL => vec![end.word(2), end.word(3)],
                // The selector's type is not known here: with 32 bits a case is a literal and a label.
                op::SWITCH => end.words.iter().skip(2).step_by(2).copied().collect(),
                _ => Vec::new(),
            },
        }
    }
}

/// What is left of a function.
#[derive(Debug)]
pub(crate) struct SpirvFunction<'w> {
    pub(crate) id: u32,
    /// `OpFunction` and its parameters.
    header: Vec<SpirvInstruction<'w>>,
    /// Those that are reached, in order.
    blocks: Vec<BasicBlock<'w>>,
    /// Blocks that only a merge instruction names: by label, where a continue target goes back to.
    stubs: Vec<(u32, Option<u32>)>,
    end: SpirvInstruction<'w>,
}

impl<'w> SpirvFunction<'w> {
    /// A function, from `OpFunction` to `OpFunctionEnd`, without what its known conditions leave unreachable. `None`
    /// if it is not as expected.
    pub(crate) fn folded(code: &[SpirvInstruction<'w>], mut values: KnownValues) -> Option<Self> {
        let (&end, code) = code.split_last().filter(|(end, _)| end.op == op::FUNCTION_END)?;
        let first = code.iter().position(|instruction| instruction.op == op::LABEL)?;
        let (header, code) = code.split_at(first);
        let id = header.first().filter(|function| function.op == op::FUNCTION)?.word(2);
        let mut blocks = split(code)?;
        let reached = reach(&mut blocks, &mut values)?;
        let stubs = stubs(&blocks, &reached);
        blocks.retain(|block| reached.contains(&block.label));
        let mut function = Self { id, header: header.to_vec(), blocks, stubs, end };
        function.has_all_it_names().then_some(())?;
        function.blocks.iter_mut().for_each(|block| block.body.retain(|instruction| instruction.op != op::LINE));
        Some(function)
    }

    /// Ids of the functions that it calls.
    pub(crate) fn calls(&self) -> impl Iterator<Item = u32> {
        let body = self.blocks.iter().flat_map(|block| &block.body);
        body.filter(|instruction| instruction.op == op::FUNCTION_CALL).map(|call| call.word(3))
    }

    /// Ids that it defines.
    pub(crate) fn results(&self) -> impl Iterator<Item = u32> {
        let labels = self.blocks.iter().map(|block| block.label).chain(self.stubs.iter().map(|stub| stub.0));
        let body = self.blocks.iter().flat_map(|block| &block.body);
        labels.chain(self.header.iter().chain(body).filter_map(SpirvInstruction::result))
    }

    /// Whether each loop that is left still has what a phi of its header takes from behind it: the shaders keep in
    /// variables what a loop changes, so there are no such phis.
    fn has_all_it_names(&self) -> bool {
        let loops = self.blocks.iter().filter(|block| block.merge.is_some_and(|merge| merge.op == op::LOOP_MERGE));
        loops.flat_map(|block| &block.body).all(|instruction| instruction.op != op::PHI)
    }

    pub(crate) fn write(&self, out: &mut Vec<u32>) {
        let mut from: HashMap<u32, HashSet<u32>> = HashMap::new();
        for block in &self.blocks {
            for target in block.targets() {
                from.entry(target).or_default().insert(block.label);
            }
        }
        self.header.iter().for_each(|instruction| out.extend_from_slice(instruction.words));
        for block in &self.blocks {
            out.extend([head(op::LABEL, 2), block.label]);
            for instruction in &block.body {
                if instruction.op == op::PHI {
                    write_phi(instruction, from.get(&block.label), out);
                } else {
                    out.extend_from_slice(instruction.words);
                }
            }
            match block.end {
                BlockEnd::Jump(to) => out.extend([head(op::BRANCH, 2), to]),
                BlockEnd::As(end) => {
                    block.merge.iter().for_each(|merge| out.extend_from_slice(merge.words));
                    out.extend_from_slice(end.words);
                }
            }
        }
        for (label, back) in &self.stubs {
            out.extend([head(op::LABEL, 2), *label]);
            match back {
                Some(header) => out.extend([head(op::BRANCH, 2), *header]),
                None => out.push(head(op::UNREACHABLE, 1)),
            }
        }
        out.extend_from_slice(self.end.words);
    }
}

/// A phi with the values of the blocks that are left before it.
fn write_phi(phi: &SpirvInstruction<'_>, from: Option<&HashSet<u32>>, out: &mut Vec<u32>) {
    let at = out.len();
    out.extend([0, phi.word(1), phi.word(2)]);
    for pair in phi.words[3..].chunks_exact(2) {
        if from.is_some_and(|from| from.contains(&pair[1])) {
            out.extend_from_slice(pair);
        }
    }
    let length = u32::try_from(out.len() - at).unwrap_or(u32::MAX);
    out[at] = head(op::PHI, length);
}

/// The blocks of a function's body.
fn split<'w>(code: &[SpirvInstruction<'w>]) -> Option<Vec<BasicBlock<'w>>> {
    let is_end = |op| matches!(op, op::BRANCH..=op::UNREACHABLE);
    let mut blocks = Vec::new();
    for block in code.split_inclusive(|instruction| is_end(instruction.op)) {
        let (&end, block) = block.split_last().filter(|(end, _)| is_end(end.op))?;
        let (label, block) = block.split_first().filter(|(label, _)| label.op == op::LABEL)?;
        let (merge, body) = match block.split_last() {
            Some((merge, body)) if matches!(merge.op, op::LOOP_MERGE | op::SELECTION_MERGE) => (Some(*merge), body),
            _ => (None, block),
        };
        blocks.push(BasicBlock { label: label.word(1), body: body.to_vec(), merge, end: BlockEnd::As(end) });
    }
    Some(blocks)
}

/// Folds what is known, and gives the labels of the blocks that are reached. `None` if a block is first reached from
/// one behind it: what was taken for known before may not be.
fn reach(blocks: &mut [BasicBlock<'_>], values: &mut KnownValues) -> Option<HashSet<u32>> {
    let mut reached: HashSet<u32> = blocks.first().map(|block| block.label).into_iter().collect();
    // Edges that may be taken, and blocks that were looked at.
    let mut edges: HashSet<(u32, u32)> = HashSet::new();
    let mut done: HashSet<u32> = HashSet::new();
    for block in &mut *blocks {
        done.insert(block.label);
        if !reached.contains(&block.label) {
            continue;
        }
        for instruction in &block.body {
            let value = match instruction.op {
                op::PHI => phi_value(instruction, block.label, values, &edges, &done),
                _ => values.result(instruction.op, instruction.words.get(3..).unwrap_or_default()),
            };
            values.note(instruction.word(2), value.filter(|_| instruction.result().is_some()));
        }
        let is_selection = block.merge.is_some_and(|merge| merge.op == op::SELECTION_MERGE);
        if let BlockEnd::As(end) = block.end
            && end.op == op::BRANCH_CONDITIONAL
            && is_selection
            && let Some(condition) = values.get(end.word(1))
        {
            block.end = BlockEnd::Jump(if condition == 1 { end.word(2) } else { end.word(3) });
            block.merge = None;
        }
        for target in block.targets() {
            edges.insert((block.label, target));
            let is_new = reached.insert(target);
            if is_new && done.contains(&target) {
                return None;
            }
        }
    }
    Some(reached)
}

/// The value of a phi, if all edges that lead to it are known and bring the same.
fn phi_value(
    phi: &SpirvInstruction<'_>,
    label: u32,
    values: &KnownValues,
    edges: &HashSet<(u32, u32)>,
    done: &HashSet<u32>,
) -> Option<u32> {
    let mut common = None;
    for pair in phi.words.get(3..)?.chunks_exact(2) {
        if !done.contains(&pair[1]) {
            return None;
        }
        if !edges.contains(&(pair[1], label)) {
            continue;
        }
        let value = values.get(pair[0])?;
        if common.is_some_and(|common| common != value) {
            return None;
        }
        common = Some(value);
    }
    common
}

/// Blocks that are not reached, but named by merges of those that are.
fn stubs(blocks: &[BasicBlock<'_>], reached: &HashSet<u32>) -> Vec<(u32, Option<u32>)> {
    let mut stubs: Vec<(u32, Option<u32>)> = Vec::new();
    for block in blocks.iter().filter(|block| reached.contains(&block.label)) {
        let Some(merge) = block.merge else { continue };
        if merge.op == op::LOOP_MERGE && !reached.contains(&merge.word(2)) {
            stubs.push((merge.word(2), Some(block.label)));
        }
        if !reached.contains(&merge.word(1)) {
            stubs.push((merge.word(1), None));
        }
    }
    stubs
}
