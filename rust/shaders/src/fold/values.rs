// SPDX-License-Identifier: Apache-2.0
//! What is known of the values of 32-bit integers and booleans.

use super::{SpirvInstruction, op};
use std::collections::HashMap;

/// Known values by id; booleans are 0 and 1.
#[derive(Clone, Debug, Default)]
pub(crate) struct KnownValues {
    known: HashMap<u32, u32>,
}

impl KnownValues {
    /// Those of the global section, with specialisation constants `(id, value)`.
    pub(crate) fn of_globals(global: &[SpirvInstruction<'_>], spec: &[(u32, u32)]) -> Self {
        const SPEC_ID: u32 = 1;
        const WORD_BITS: u32 = 32;
        let decorated = |i: &&SpirvInstruction<'_>| i.op == op::DECORATE && i.word(2) == SPEC_ID;
        let spec_ids: HashMap<u32, u32> = global.iter().filter(decorated).map(|i| (i.word(1), i.word(3))).collect();
        let given = |id| spec_ids.get(&id).and_then(|spec_id| spec.iter().find(|(given, _)| given == spec_id));
        let integers: Vec<u32> =
            global.iter().filter(|i| i.op == op::TYPE_INT && i.word(2) == WORD_BITS).map(|i| i.word(1)).collect();
        let mut values = Self::default();
        for instruction in global {
            let id = instruction.word(2);
            let value = match instruction.op {
                op::CONSTANT_TRUE => Some(1),
                op::CONSTANT_FALSE => Some(0),
                op::CONSTANT if integers.contains(&instruction.word(1)) => Some(instruction.word(3)),
                op::SPEC_CONSTANT if integers.contains(&instruction.word(1)) => given(id).map(|(_, value)| *value),
                op::SPEC_CONSTANT_OP => {
                    values.result(instruction.word(3), &instruction.words[4.min(instruction.words.len())..])
                }
                _ => None,
            };
            values.note(id, value);
        }
        values
    }

    pub(crate) fn get(&self, id: u32) -> Option<u32> {
        self.known.get(&id).copied()
    }

    pub(crate) fn note(&mut self, id: u32, value: Option<u32>) {
        if let Some(value) = value {
            self.known.insert(id, value);
        }
    }

    /// What an operation gives, where that is known: those that conditions are made of.
    pub(crate) fn result(&self, operation: u32, operands: &[u32]) -> Option<u32> {
        let operand = |at: usize| self.get(*operands.get(at)?);
        let both = |f: fn(u32, u32) -> u32| Some(f(operand(0)?, operand(1)?));
        match operation {
            // LogicalEqual, LogicalNotEqual, LogicalOr, LogicalAnd, LogicalNot.
            164 => both(|a, b| u32::from(a == b)),
            165 => both(|a, b| u32::from(a != b)),
            166 => match (operand(0), operand(1)) {
                (Some(1), _) | (_, Some(1)) => Some(1),
                (Some(0), Some(0)) => Some(0),
                _ => None,
            },
            167 => match (operand(0), operand(1)) {
                (Some(0), _) | (_, Some(0)) => Some(0),
                (Some(1), Some(1)) => Some(1),
                _ => None,
            },
            168 => Some(1 - operand(0)?.min(1)),
            // Select.
            169 => operand(if operand(0)? == 1 { 1 } else { 2 }),
            // IEqual, INotEqual, UGreaterThan, UGreaterThanEqual, ULessThan, ULessThanEqual.
            170 => both(|a, b| u32::from(a == b)),
            171 => both(|a, b| u32::from(a != b)),
            172 => both(|a, b| u32::from(a > b)),
            174 => both(|a, b| u32::from(a >= b)),
            176 => both(|a, b| u32::from(a < b)),
            178 => both(|a, b| u32::from(a <= b)),
            // IAdd, ISub, IMul; BitwiseOr, BitwiseXor, BitwiseAnd.
            128 => both(u32::wrapping_add),
            130 => both(u32::wrapping_sub),
            132 => both(u32::wrapping_mul),
            197 => both(|a, b| a | b),
            198 => both(|a, b| a ^ b),
            199 => both(|a, b| a & b),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each operation by its number in the SPIR-V specification, at values that tell it from its neighbours.
    #[test]
    fn every_operation_gives_its_known_result() {
        let mut values = KnownValues::default();
        for (id, value) in [(1, 0), (2, 1), (3, 6), (4, 3)] {
            values.note(id, Some(value));
        }
        let [no, yes, six, three, unknown] = [1, 2, 3, 4, 5];
        for (operation, operands, expected) in [
            (164, vec![yes, yes], Some(1)),
            (164, vec![yes, no], Some(0)),
            (165, vec![yes, no], Some(1)),
            (166, vec![no, yes], Some(1)),
            (166, vec![unknown, yes], Some(1)),
            (166, vec![no, no], Some(0)),
            (166, vec![unknown, no], None),
            (167, vec![yes, yes], Some(1)),
            (167, vec![unknown, no], Some(0)),
            (167, vec![unknown, yes], None),
            (168, vec![no], Some(1)),
            (168, vec![yes], Some(0)),
            (169, vec![yes, six, three], Some(6)),
            (169, vec![no, six, three], Some(3)),
            (169, vec![yes, six, unknown], Some(6)),
            (169, vec![unknown, six, six], None),
            (170, vec![six, six], Some(1)),
            (171, vec![six, three], Some(1)),
            (172, vec![six, three], Some(1)),
            (172, vec![six, six], Some(0)),
            (174, vec![six, six], Some(1)),
            (176, vec![three, six], Some(1)),
            (176, vec![six, six], Some(0)),
            (178, vec![six, six], Some(1)),
            (128, vec![six, three], Some(9)),
            (130, vec![three, six], Some(u32::MAX - 2)),
            (132, vec![six, three], Some(18)),
            (197, vec![six, three], Some(7)),
            (198, vec![six, three], Some(5)),
            (199, vec![six, three], Some(2)),
            (199, vec![six, unknown], None),
            (999, vec![six, three], None),
        ] {
            assert_eq!(values.result(operation, &operands), expected, "operation {operation} of {operands:?}");
        }
    }
}
