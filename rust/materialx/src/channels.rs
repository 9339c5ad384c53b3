// SPDX-License-Identifier: Apache-2.0
//! Finds the channels of its textures that a program reads, by following its result backwards. Readers of textures on
//! the host decode only those.

use crate::program::{Instruction, Op, Operand, Program, REGISTERS};

/// The mask of all four components.
const ALL: u8 = 15;

/// For each lookup of a program, the channels (bit k: channel k) on which the first `width` components of a register
/// depend at the end. Works for any program, in time proportional to its instructions.
#[must_use]
pub fn channels(program: &Program, register: u8, width: usize) -> Vec<u8> {
    let mut found = vec![0; program.lookups.len()];
    // Components that are read later on, by register.
    let mut wanted = [0_u8; REGISTERS];
    if let Some(root) = wanted.get_mut(usize::from(register)) {
        *root = first(width.try_into().unwrap_or(4));
    }
    for step in program.instructions.iter().rev() {
        let Some(slot) = wanted.get_mut(usize::from(step.to)) else { continue };
        let result = std::mem::take(slot);
        if result == 0 {
            continue;
        }
        if step.op == Op::Texture
            && let Some(channels) = found.get_mut(usize::from(step.immediate & 255))
        {
            *channels |= result;
        }
        for (operand, read) in step.operands.into_iter().zip(operands(step, result)) {
            if let Operand::Register(at) = operand
                && let Some(slot) = wanted.get_mut(usize::from(at))
            {
                *slot |= read;
            }
        }
    }
    found
}

/// The mask of the first `count` components.
fn first(count: u16) -> u8 {
    ALL >> (4 - count.min(4))
}

/// The components of its operands that an instruction reads for these components of its result.
fn operands(step: &Instruction, result: u8) -> [u8; 3] {
    match step.op {
        Op::Dot => [first(step.immediate); 3],
        Op::Cross => [first(3); 3],
        Op::Normalize | Op::Length => [first(step.immediate), 0, 0],
        Op::Swizzle => {
            let of = |k: u16| if result >> k & 1 == 1 { step.immediate >> (3 * k) & 7 } else { 4 };
            [(0..4).map(of).filter(|at| *at < 4).fold(0, |read, at| read | 1 << at), 0, 0]
        }
        Op::Blend => {
            let second = first(4) & u8::try_from(step.immediate & 15).unwrap_or(ALL);
            [result & !second, result & second, 0]
        }
        Op::Texture => [first(2), 0, 0],
        Op::Surface => [0; 3],
        op if op >= Op::RgbToHsv => [ALL; 3],
        _ => [result; 3],
    }
}
