// SPDX-License-Identifier: Apache-2.0
//! Forbids drivers to merge floating-point operations, so that one expression gives the same bits in every pass and
//! under every specialisation. Where a merged operation is wanted, the shaders call `fma`.
//!
//! Shared by `build.rs` and the tests. Pure; any thread. Source: SPIR-V 1.5, 2.3 (physical layout), 2.4 (logical
//! layout), 3.20 (`NoContraction`).

use std::collections::BTreeSet;

/// Words before the first instruction.
const HEADER: usize = 5;
const MAGIC: u32 = 0x0723_0203;
const OP_DECORATE: u32 = 71;
const NO_CONTRACTION: u32 = 42;
/// `OpTypeVoid` to `OpTypeForwardPointer`: the first of them ends the annotations.
const TYPES: std::ops::RangeInclusive<u32> = 19..=39;

/// Returns true if an instruction computes floats in a way that could be merged with another one.
fn is_float_arithmetic(opcode: u32) -> bool {
    // These are FNegate; FAdd, FSub, FMul, FDiv, FRem, FMod; VectorTimesScalar to OuterProduct; Dot.
    matches!(opcode, 127 | 129 | 131 | 133 | 136 | 140 | 141 | 142..=148)
}

/// One instruction: opcode and words, the first of which holds opcode and length.
fn instructions(words: &[u32]) -> impl Iterator<Item = Result<(u32, usize, &[u32]), String>> {
    let mut at = HEADER;
    std::iter::from_fn(move || {
        let first = *words.get(at)?;
        let length = (first >> 16) as usize;
        let Some(body) = words.get(at..at + length).filter(|body| !body.is_empty()) else {
            at = words.len();
            return Some(Err(format!("not a SPIR-V module: instruction of {length} words")));
        };
        let item = (first & 0xffff, at, body);
        at += length;
        Some(Ok(item))
    })
}

/// The module with `NoContraction` on the result of every floating-point operation, once each.
///
/// # Errors
/// Words that are no SPIR-V module.
pub(crate) fn without_contraction(words: &[u32]) -> Result<Vec<u32>, String> {
    if words.len() < HEADER || words[0] != MAGIC {
        return Err("not a SPIR-V module: no header".to_owned());
    }
    let mut results = BTreeSet::new();
    let mut decorated = BTreeSet::new();
    let mut end_of_annotations = None;
    for instruction in instructions(words) {
        let (opcode, at, body) = instruction?;
        if TYPES.contains(&opcode) && end_of_annotations.is_none() {
            end_of_annotations = Some(at);
        }
        match (opcode, body) {
            (OP_DECORATE, [_, id, NO_CONTRACTION]) => {
                decorated.insert(*id);
            }
            (opcode, [_, _, id, ..]) if is_float_arithmetic(opcode) => {
                results.insert(*id);
            }
            _ => {}
        }
    }
    let end = end_of_annotations.ok_or("not a SPIR-V module: no types")?;
    let mut exact = words[..end].to_vec();
    for id in results.difference(&decorated) {
        exact.extend([3 << 16 | OP_DECORATE, *id, NO_CONTRACTION]);
    }
    exact.extend(&words[end..]);
    Ok(exact)
}
