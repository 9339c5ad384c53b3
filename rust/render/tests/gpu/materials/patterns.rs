// SPDX-License-Identifier: Apache-2.0
//! Operations of pattern programs on the device (`shaders/check/pattern.comp`) against their twin in Rust, whose values
//! are held to `MaterialX`'s definition by the tests of `oocpt-materialx`.

mod cases;

use cases::{Case, extreme, ops, ordinary};
use oocpt_abi::{Features, groups};
use oocpt_core::materialx::eval::evaluate;
use oocpt_core::materialx::program::Op;
use oocpt_gpu::{Buffer, BufferUsage, Gpu, OpenOptions, Pipeline};
use oocpt_shaders::checks;
use std::time::Duration;

/// Numbers below the normal ones may be 0 on a device; values in between, too.
const TINY: f64 = 2.0 * f32::MIN_POSITIVE as f64;
const ULP: f64 = f32::EPSILON as f64;

/// How far the device may be from the twin.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Error {
    /// The same bits.
    Exact,
    /// This much, and this much of the value.
    Within(f64, f64),
    /// Of the period b, this much of |a| and |b|.
    Period(f64),
    /// As `Within`; x has the period 1.
    Hue(f64, f64),
}

/// The stated errors. The build forbids merged operations, so sums and products are exact. What is not follows from the
/// precision that Vulkan asks for (1.3, "Precision and Operation of SPIR-V Instructions"): division 2.5 ULP, root 5,
/// e^x 3 + 2 |x|, logarithm 3 or 2^-21, arcs 4096; in the range of [`ordinary`] cases.
fn stated(case: &Case) -> Error {
    match case.op {
        Op::Divide | Op::Tan => Error::Within(0.0, 3.0 * ULP),
        Op::Modulo => Error::Period(2.0 * ULP),
        Op::Power => Error::Within(0.0, 6e-5),
        Op::Sqrt => Error::Within(0.0, 5.0 * ULP),
        Op::Ln => Error::Within(5e-7, 3.0 * ULP),
        Op::Exp => Error::Within(0.0, 2e-5),
        Op::Asin | Op::Acos | Op::Atan2 => Error::Within(4096.0 * ULP, 4096.0 * ULP),
        Op::Smoothstep => Error::Within(1e-6, 0.0),
        Op::Normalize | Op::Length => Error::Within(0.0, 8.0 * ULP),
        Op::RgbToHsv => Error::Hue(1e-6, 3.0 * ULP),
        Op::Worley2 | Op::Worley3 if case.immediate < 3 => Error::Within(0.0, 5.0 * ULP),
        _ => Error::Exact,
    }
}

/// What runs cases on the device.
fn run(cases: &[Case]) -> Vec<[f32; 4]> {
    let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
    let gpu = Gpu::open(&OpenOptions { selector, validation: true, ..OpenOptions::default() }).expect("a device");
    let module = &checks::CHECK_PATTERN;
    let constants = Features::empty().constants();
    let pipeline =
        Pipeline::new(&gpu, module.name, &module.specialised(&constants), &constants, 24).expect("the pass compiles");
    let words: Vec<u32> = cases.iter().flat_map(Case::words).collect();
    let bytes: &[u8] = bytemuck::cast_slice(&words);
    let input = Buffer::new(&gpu, "cases", bytes.len() as u64, BufferUsage::Upload).expect("small");
    input.write(0, bytes).expect("mapped");
    let size = 16 * cases.len() as u64;
    let results = Buffer::new(&gpu, "results", size, BufferUsage::Device).expect("small");
    let copy = Buffer::new(&gpu, "copy", size, BufferUsage::Readback).expect("small");
    let push = [input.address(), results.address(), cases.len() as u64];
    let mut commands = gpu.commands("patterns").expect("a list");
    commands.dispatch(&pipeline, bytemuck::cast_slice(&push), groups(cases.len() as u64));
    commands.copy(&results, 0, &copy, 0, size);
    assert!(commands.submit().expect("submitted").wait(Duration::from_secs(300)).expect("alive"), "did not end");
    let results = copy.map(|bytes| bytemuck::pod_collect_to_vec(bytes)).expect("mapped");
    let messages = gpu.take_validation_messages();
    assert!(messages.is_empty(), "Vulkan validation: {messages:?}");
    results
}

/// The error of a result in units of the stated one; infinite where it has to be exact and is not.
fn error(case: &Case, result: [f32; 4], twin: [f32; 4]) -> f64 {
    let of = |k: usize| {
        let [x, t, a, b] = [result[k], twin[k], case.operands[0][k], case.operands[1][k]].map(f64::from);
        let off = (x - t).abs();
        let (off, allowed) = match stated(case) {
            Error::Exact => (off, 0.0),
            Error::Within(absolute, relative) => (off, absolute + relative * t.abs()),
            Error::Period(relative) => (off.min((b.abs() - off).abs()), relative * (a.abs() + b.abs())),
            Error::Hue(absolute, relative) => {
                (if k == 0 { off.min((1.0 - off).abs()) } else { off }, absolute + relative * t.abs())
            }
        };
        if off <= TINY {
            0.0
        } else if off.is_nan() {
            f64::INFINITY
        } else {
            off / allowed
        }
    };
    [0, 1, 2, 3].map(of).into_iter().fold(0.0, f64::max)
}

#[test]
fn every_device_operation_matches_its_host_twin() {
    let cases: Vec<Case> = ops().flat_map(|op| (0..1000).map(move |seed| ordinary(op, seed))).collect();
    let results = run(&cases);
    let mut wrong = Vec::new();
    for (cases, results) in cases.chunks(1000).zip(results.chunks(1000)) {
        let twin = |case: &Case| evaluate(case.op, case.operands, case.immediate);
        let errors = cases.iter().zip(results).map(|(case, &result)| (error(case, result, twin(case)), case, result));
        let (most, case, result) = errors.max_by(|a, b| a.0.total_cmp(&b.0)).expect("a thousand");
        println!("{:?}: {most:.3} of {:?}", case.op, stated(case));
        if most > 1.0 {
            wrong.push(format!("{case:?}: {result:?}, not {:?}", twin(case)));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn extreme_operands_give_finite_numbers() {
    let cases: Vec<Case> = ops().flat_map(|op| (0..1000).map(move |seed| extreme(op, seed))).collect();
    let results = run(&cases);
    for (case, result) in cases.iter().zip(results) {
        let good = |x: f32| x.is_normal() || x.to_bits() == 0;
        let twin = evaluate(case.op, case.operands, case.immediate);
        assert!(result.into_iter().all(good), "device, {case:?}: {result:?}");
        assert!(twin.into_iter().all(good), "twin, {case:?}: {twin:?}");
        if stated(case) == Error::Exact && case.operands.as_flattened().iter().all(|&x| good(x)) {
            assert!(error(case, result, twin) == 0.0, "{case:?}: {result:?}, not {twin:?}");
        }
    }
}

#[test]
fn an_error_beyond_the_stated_one_is_noticed() {
    for op in ops() {
        let case = (0..1000).map(|seed| ordinary(op, seed)).find(|case| {
            let [x, ..] = evaluate(op, case.operands, case.immediate);
            x.is_normal() && x.abs() > 1e-3 && (op != Op::Modulo || x.abs() > case.operands[0][0].abs() * 1e-3)
        });
        let Some(case) = case else { continue };
        let twin = evaluate(op, case.operands, case.immediate);
        assert!(error(&case, twin, twin) == 0.0, "{case:?}: the twin itself");
        let planted = match stated(&case) {
            Error::Exact => twin.map(|x| f32::from_bits(x.to_bits() + 1)),
            _ => twin.map(|x| x * 1.01 + 2e-3),
        };
        assert!(error(&case, planted, twin) > 1.0, "{case:?}: {planted:?}, not {twin:?}");
    }
}
