// SPDX-License-Identifier: Apache-2.0
//! No driver may merge floating-point operations of a pass.

#[path = "../../build/exact.rs"]
mod exact;

use oocpt_shaders::{ALL, SCENE};
use rspirv::dr::{Instruction, Operand, load_words};
use rspirv::spirv::{Decoration, Op};
use std::collections::BTreeMap;

/// Times that each id carries `NoContraction`.
fn decorated(module: &rspirv::dr::Module) -> BTreeMap<u32, u32> {
    let mut counts = BTreeMap::new();
    for annotation in &module.annotations {
        if let [Operand::IdRef(id), Operand::Decoration(Decoration::NoContraction)] = annotation.operands.as_slice() {
            *counts.entry(*id).or_insert(0) += 1;
        }
    }
    counts
}

/// Ids of the results of additions, multiplications and the like of floats.
fn results(module: &rspirv::dr::Module) -> Vec<u32> {
    let arithmetic = |instruction: &&Instruction| {
        matches!(
            instruction.class.opcode,
            Op::FAdd | Op::FSub | Op::FMul | Op::FDiv | Op::FNegate | Op::VectorTimesScalar | Op::Dot
        )
    };
    module.all_inst_iter().filter(arithmetic).filter_map(|instruction| instruction.result_id).collect()
}

#[test]
fn every_operation_of_every_pass_is_exact() {
    let mut total = 0;
    for module in ALL.iter().chain(SCENE) {
        let loaded = load_words(module.words).expect(module.name);
        let decorated = decorated(&loaded);
        for id in results(&loaded) {
            assert_eq!(decorated.get(&id), Some(&1), "{}: result {id}", module.name);
            total += 1;
        }
    }
    assert!(total > 300, "only {total} operations were looked at");
}

#[test]
fn the_no_contraction_pass_is_idempotent_and_repairs_stripped_modules() {
    let words = oocpt_shaders::passes::SHADE_SURFACE.words;
    assert!(exact::without_contraction(words).expect("a module") == words, "all was decorated already");
    let mut stripped = load_words(words).expect("a module");
    let mut dropped = 0;
    stripped.annotations.retain(|annotation| {
        let is_it = annotation.operands.get(1) == Some(&Operand::Decoration(Decoration::NoContraction));
        dropped += usize::from(is_it);
        !is_it
    });
    let assembled = rspirv::binary::Assemble::assemble(&stripped);
    let mended = load_words(exact::without_contraction(&assembled).expect("a module")).expect("a module");
    assert!(dropped > 0, "there was something to strip");
    assert_eq!(decorated(&mended), decorated(&load_words(words).expect("a module")), "the same decorations");
}

#[test]
fn an_invalid_module_is_an_error() {
    exact::without_contraction(&[]).expect_err("empty");
    exact::without_contraction(&[0x0723_0203, 0, 0, 0, 0, 0x0010_0013]).expect_err("instruction past the end");
    exact::without_contraction(&[0x0723_0203, 0, 0, 0, 0, 0x0000_0013]).expect_err("instruction of no words");
}
