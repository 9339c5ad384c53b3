// SPDX-License-Identifier: Apache-2.0
//! Operations of programs with known answers, at any operands, and programs.

use oocpt_materialx::eval::{evaluate, run};
use oocpt_materialx::program::{Geometry, Instruction, Op, Operand, Program, ProgramLookup, REGISTERS};
use proptest::prelude::*;

fn of(op: Op, a: f32, b: f32, c: f32) -> f32 {
    let [x, y, z, w] = evaluate(op, [[a; 4], [b; 4], [c; 4]], 0);
    assert!(x == y && y == z && z == w, "{op:?}: components differ");
    x
}

#[test]
fn operation_codes_follow_the_table_order() {
    for (at, op) in Op::ALL.into_iter().enumerate() {
        assert_eq!(op as usize, at, "{op:?}");
    }
}

#[test]
fn components_have_known_values() {
    let table = [
        (Op::Move, [1.5, 9.0, 9.0], 1.5),
        (Op::Add, [1.5, 0.25, 9.0], 1.75),
        (Op::Subtract, [1.5, 0.25, 9.0], 1.25),
        (Op::Multiply, [1.5, -0.25, 9.0], -0.375),
        (Op::Divide, [1.5, -0.25, 9.0], -6.0),
        (Op::Divide, [1.5, 0.0, 9.0], 0.0),
        (Op::Divide, [1.5, -0.0, 9.0], 0.0),
        (Op::Modulo, [7.5, 2.0, 9.0], 1.5),
        (Op::Modulo, [-7.5, 2.0, 9.0], 0.5),
        (Op::Modulo, [7.5, -2.0, 9.0], -0.5),
        (Op::Modulo, [6.0, 2.0, 9.0], 0.0),
        (Op::Modulo, [6.0, 0.0, 9.0], 0.0),
        (Op::Absolute, [-1.5, 9.0, 9.0], 1.5),
        (Op::Sign, [-1.5, 9.0, 9.0], -1.0),
        (Op::Sign, [0.0, 9.0, 9.0], 0.0),
        (Op::Sign, [1e-30, 9.0, 9.0], 1.0),
        (Op::Floor, [-1.5, 9.0, 9.0], -2.0),
        (Op::Ceil, [-1.5, 9.0, 9.0], -1.0),
        (Op::Round, [2.5, 9.0, 9.0], 3.0),
        (Op::Round, [-2.5, 9.0, 9.0], -2.0),
        (Op::Round, [0.499_999_97, 9.0, 9.0], 0.0),
        (Op::Fract, [-1.25, 9.0, 9.0], 0.75),
        (Op::Power, [2.0, 3.0, 9.0], 8.0),
        (Op::Power, [-2.0, 3.0, 9.0], -8.0),
        (Op::Power, [-2.0, 2.0, 9.0], 4.0),
        (Op::Power, [-2.0, 0.5, 9.0], 0.0),
        (Op::Power, [0.0, -1.0, 9.0], 0.0),
        (Op::Power, [0.0, 0.0, 9.0], 1.0),
        (Op::Sqrt, [2.25, 9.0, 9.0], 1.5),
        (Op::Sqrt, [-2.25, 9.0, 9.0], 0.0),
        (Op::Ln, [1.0, 9.0, 9.0], 0.0),
        (Op::Ln, [-1.0, 9.0, 9.0], 0.0),
        (Op::Exp, [0.0, 9.0, 9.0], 1.0),
        (Op::Exp, [100.0, 9.0, 9.0], 0.0),
        (Op::Asin, [2.0, 9.0, 9.0], std::f32::consts::FRAC_PI_2),
        (Op::Acos, [-2.0, 9.0, 9.0], std::f32::consts::PI),
        (Op::Atan2, [1.0, 0.0, 9.0], std::f32::consts::FRAC_PI_2),
        (Op::Atan2, [0.0, -1.0, 9.0], std::f32::consts::PI),
        (Op::Min, [1.5, -2.0, 9.0], -2.0),
        (Op::Max, [1.5, -2.0, 9.0], 1.5),
        (Op::Mix, [1.0, 3.0, 0.25], 1.5),
        (Op::Clamp, [5.0, 1.0, 2.0], 2.0),
        (Op::Clamp, [0.0, 1.0, 2.0], 1.0),
        (Op::Smoothstep, [0.25, 0.0, 1.0], 0.15625),
        (Op::Smoothstep, [2.0, 2.0, 2.0], 1.0),
        (Op::Smoothstep, [1.0, 2.0, 3.0], 0.0),
        (Op::MultiplyAdd, [2.0, 3.0, 4.0], 10.0),
        (Op::Greater, [1.0, 1.0, 9.0], 0.0),
        (Op::GreaterEqual, [1.0, 1.0, 9.0], 1.0),
        (Op::Equal, [1.0, 1.0, 9.0], 1.0),
        (Op::Select, [1.0, 2.0, -3.0], 1.0),
        (Op::Select, [1.0, 2.0, 0.0], 2.0),
    ];
    for (op, [a, b, c], expected) in table {
        assert_eq!(of(op, a, b, c).to_bits(), f32::to_bits(expected), "{op:?} of {a}, {b}, {c}");
    }
}

#[test]
fn vectors_have_known_values() {
    let [a, b] = [[1.0, 2.0, 3.0, 4.0], [5.0, 6.0, 7.0, 8.0]];
    let vector = |op, a, immediate| evaluate(op, [a, b, [0.0; 4]], immediate);
    for (count, sum) in [(0, 0.0), (1, 5.0), (2, 17.0), (3, 38.0), (4, 70.0), (9, 70.0)] {
        assert_eq!(vector(Op::Dot, a, count), [sum; 4], "dot of {count}");
    }
    assert_eq!(vector(Op::Cross, a, 0), [-4.0, 8.0, -4.0, 0.0], "cross");
    for size in [1.0, 1e-37, 1e-25, 1e25, 1e37] {
        let [x, y, z, w] = vector(Op::Normalize, [3.0 * size, -4.0 * size, 9.0, 9.0], 2);
        assert!((x - 0.6).abs() < 1e-6 && (y + 0.8).abs() < 1e-6 && z == 0.0 && w == 0.0, "{size}: {x} {y} {z} {w}");
        let [length, ..] = vector(Op::Length, [3.0 * size, -4.0 * size, 9.0, 9.0], 2);
        assert!((length / size - 5.0).abs() < 1e-5, "{size}: {length}");
    }
    assert_eq!(vector(Op::Normalize, [0.0; 4], 3), [0.0; 4], "of nothing");
    let places = |of: [u16; 4]| of[0] | of[1] << 3 | of[2] << 6 | of[3] << 9;
    assert_eq!(vector(Op::Swizzle, a, places([3, 0, 5, 4])), [4.0, 1.0, 1.0, 0.0], "places and numbers");
    assert_eq!(vector(Op::Blend, a, 0b0101), [5.0, 2.0, 7.0, 4.0], "blend");
    assert_eq!(vector(Op::RgbToHsv, [0.25, 0.5, 0.25, 0.75], 0), [1.0 / 3.0, 0.5, 0.5, 0.75], "green");
    assert_eq!(vector(Op::HsvToRgb, [0.5, 0.5, 0.5, 0.75], 0), [0.25, 0.5, 0.5, 0.75], "cyan");
}

/// Of angles up to 10^4: within 2^-23.
#[test]
fn angles_are_exact_enough() {
    for step in -200_000_i32..=200_000 {
        let x = step as f32 * 0.05;
        for (op, exact) in [(Op::Sin, f64::from(x).sin()), (Op::Cos, f64::from(x).cos())] {
            let error = (f64::from(of(op, x, 0.0, 0.0)) - exact).abs();
            assert!(error < 1.2e-7, "{op:?} of {x}: {error:e}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 20_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_operands_give_finite_numbers(op in 0..52_usize, bits in any::<[[u32; 4]; 3]>(), immediate in any::<u16>()) {
        let operands = bits.map(|operand| operand.map(f32::from_bits));
        let result = evaluate(Op::ALL[op], operands, immediate);
        prop_assert!(result.iter().all(|x| x.is_normal() || x.to_bits() == 0), "{:?}: {result:?}", Op::ALL[op]);
    }
}

fn step(op: Op, to: u8, operands: [Operand; 3], immediate: u16) -> Instruction {
    Instruction { op, to, operands, immediate }
}

#[test]
fn programs_run_in_order() {
    let [r, c] = [Operand::Register, Operand::Constant];
    let lookup = ProgramLookup { texture: 7, uv: None, transform: [[0.0; 3]; 2], scale: [1.0; 4], bias: [0.0; 4] };
    let program = Program {
        instructions: vec![
            step(Op::Surface, 1, [r(0); 3], Geometry::Uv1 as u16),
            step(Op::MultiplyAdd, 1, [r(1), c(0), c(1)], 0),
            step(Op::Texture, 2, [r(1), r(0), r(0)], 0),
            step(Op::Add, 3, [r(2), c(1), r(0)], 0),
            step(Op::Texture, 4, [r(1), r(0), r(0)], 256),
        ],
        constants: vec![[2.0; 4], [0.5; 4]],
        lookups: vec![lookup],
    };
    let surface = |kind: Geometry| if kind == Geometry::Uv1 { [0.25, 0.75, 0.0, f32::NAN] } else { [9.0; 4] };
    let registers = run(&program, surface, |lookup, place| {
        place.map_or([3.0; 4], |[u, v]| [u, v, lookup.texture as f32, f32::INFINITY])
    });
    assert_eq!(registers[1], [1.0, 2.0, 0.5, 0.5], "what is no number counts as 0");
    assert_eq!(registers[2], [1.0, 2.0, 7.0, 0.0], "the lookup");
    assert_eq!(registers[3], [1.5, 2.5, 7.5, 0.5], "the sum");
    assert_eq!(registers[4], [3.0; 4], "a lookup that knows its place");
    assert_eq!(registers[5..], [[0.0; 4]; REGISTERS - 5], "the others");
}

#[test]
fn missing_registers_and_lookups_read_as_zero() {
    let program = Program {
        instructions: vec![
            step(Op::Add, 0, [Operand::Register(200), Operand::Constant(3), Operand::Register(0)], 0),
            step(Op::Surface, 1, [Operand::Register(0); 3], 99),
            step(Op::Texture, 2, [Operand::Register(0); 3], 99),
            step(Op::Exp, 255, [Operand::Register(0); 3], 0),
        ],
        ..Program::default()
    };
    let registers = run(&program, |_| [1.0; 4], |_, _| [1.0; 4]);
    assert_eq!(registers, [[0.0; 4]; REGISTERS], "nothing was written");
}
