// SPDX-License-Identifier: Apache-2.0
//! What the operations of programs give, in f32: for folding of constants, and as the twin of what the device runs
//! (`shaders/material/pattern_ops.glsl`).
//!
//! Guarantees: results are normal numbers or +0; operands that are neither count as 0; no panic. Sums and products are
//! in the order of the twin, so operations without a division, a root or a function of the device have its bits,
//! but where a value in between is below 2^-126. Any thread.

use std::array::from_fn;

use crate::noise::{self, FractalOctaves, MAX_OCTAVES};
use crate::program::{Geometry, Instruction, Op, Operand, Program, ProgramLookup, REGISTERS};

type Vec4 = [f32; 4];

/// Numbers that are neither normal nor 0 are +0, and so is -0.
pub(crate) fn number(x: f32) -> f32 {
    if x.is_normal() { x } else { 0.0 }
}

/// What an operation gives. [`Op::Surface`] and [`Op::Texture`] are the caller's and give 0.
#[must_use]
pub fn evaluate(op: Op, operands: [[f32; 4]; 3], immediate: u16) -> [f32; 4] {
    let [a, b, c] = operands.map(|operand| operand.map(number));
    let each = |f: fn(f32, f32, f32) -> f32| from_fn(|k| f(a[k], b[k], c[k]));
    let result = match component(op) {
        Some(f) => each(f),
        None if op >= Op::Noise2 => noises(op, a, b, immediate),
        None => vector(op, a, b, immediate),
    };
    result.map(number)
}

/// Runs a program from registers of 0. `surface` says what the surface has, `lookup` what a texture lookup gives at a
/// place, scale and bias included; where there is none, the lookup knows it. Registers and constants that the program
/// does not have are 0.
pub fn run(
    program: &Program,
    surface: impl Fn(Geometry) -> [f32; 4],
    lookup: impl Fn(&ProgramLookup, Option<[f32; 2]>) -> [f32; 4],
) -> [[f32; 4]; REGISTERS] {
    run_numbered(program, surface, |_, found, place| lookup(found, place))
}

/// [`run`] for who has to know the number of a lookup.
pub fn run_numbered(
    program: &Program,
    surface: impl Fn(Geometry) -> [f32; 4],
    mut lookup: impl FnMut(usize, &ProgramLookup, Option<[f32; 2]>) -> [f32; 4],
) -> [[f32; 4]; REGISTERS] {
    let mut registers = [[0.0; 4]; REGISTERS];
    for &Instruction { op, to, operands, immediate } in &program.instructions {
        let operands = operands.map(|operand| {
            let found = match operand {
                Operand::Register(at) => registers.get(usize::from(at)),
                Operand::Constant(at) => program.constants.get(usize::from(at)),
            };
            found.copied().unwrap_or_default()
        });
        let at = usize::from(immediate);
        let result = match op {
            Op::Surface => GEOMETRY.get(at).map(|&geometry| surface(geometry)).unwrap_or_default(),
            Op::Texture => {
                let [u, v, ..] = operands[0].map(number);
                let place = (at & 256 == 0).then_some([u, v]);
                program.lookups.get(at & 255).map(|found| lookup(at & 255, found, place)).unwrap_or_default()
            }
            _ => evaluate(op, operands, immediate),
        };
        if let Some(register) = registers.get_mut(usize::from(to)) {
            *register = result.map(number);
        }
    }
    registers
}

/// By number.
const GEOMETRY: [Geometry; 14] = [
    Geometry::Uv0,
    Geometry::Uv1,
    Geometry::Primvar0,
    Geometry::Primvar1,
    Geometry::Position,
    Geometry::Normal,
    Geometry::Tangent,
    Geometry::Bitangent,
    Geometry::ViewDirection,
    Geometry::Random0,
    Geometry::Random1,
    Geometry::Random2,
    Geometry::FrameX,
    Geometry::FrameY,
];

fn truth(is: bool) -> f32 {
    f32::from(u8::from(is))
}

/// Operations by component.
fn component(op: Op) -> Option<fn(f32, f32, f32) -> f32> {
    Some(match op {
        Op::Move => |a, _, _| a,
        Op::Add => |a, b, _| a + b,
        Op::Subtract => |a, b, _| a - b,
        Op::Multiply => |a, b, _| a * b,
        Op::Divide => |a, b, _| if b == 0.0 { 0.0 } else { a / b },
        Op::Modulo => |a, b, _| modulo(a, b),
        Op::Absolute => |a, _, _| a.abs(),
        Op::Sign => |a, _, _| truth(a > 0.0) - truth(a < 0.0),
        Op::Floor => |a, _, _| a.floor(),
        Op::Ceil => |a, _, _| a.ceil(),
        Op::Round => |a, _, _| a.floor() + truth(a - a.floor() >= 0.5),
        Op::Fract => |a, _, _| a - a.floor(),
        Op::Power => |a, b, _| power(a, b),
        Op::Sqrt => |a, _, _| a.max(0.0).sqrt(),
        Op::Ln => |a, _, _| if a > 0.0 { in_f64(a, f64::ln) } else { 0.0 },
        Op::Exp => |a, _, _| in_f64(a, f64::exp),
        Op::Sin => |a, _, _| sine(a),
        Op::Cos => |a, _, _| cosine(a),
        Op::Tan => |a, _, _| if cosine(a) == 0.0 { 0.0 } else { sine(a) / cosine(a) },
        Op::Asin => |a, _, _| in_f64(a.clamp(-1.0, 1.0), f64::asin),
        Op::Acos => |a, _, _| in_f64(a.clamp(-1.0, 1.0), f64::acos),
        Op::Atan2 => |a, b, _| narrow(f64::from(a).atan2(b.into())),
        Op::Min => |a, b, _| a.min(b),
        Op::Max => |a, b, _| a.max(b),
        Op::Mix => |a, b, c| a * (1.0 - c) + b * c,
        Op::Clamp => |a, b, c| a.max(b).min(c),
        Op::Smoothstep => |a, b, c| smoothstep(a, b, c),
        Op::MultiplyAdd => |a, b, c| a * b + c,
        Op::Greater => |a, b, _| truth(a > b),
        Op::GreaterEqual => |a, b, _| truth(a >= b),
        Op::Equal => |a, b, _| truth(a == b),
        Op::Select => |a, b, c| if c == 0.0 { b } else { a },
        _ => return None,
    })
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
fn narrow(x: f64) -> f32 {
    x as f32
}

/// A function of the device, correctly rounded but for ties.
fn in_f64(x: f32, f: fn(f64) -> f64) -> f32 {
    narrow(f(x.into()))
}

/// The quotient may be rounded to the other side of a whole number: the remainder then is put right.
fn modulo(a: f32, b: f32) -> f32 {
    let rest = a - b * (a / b).floor();
    let rest = if rest * b.signum() < 0.0 { rest + b } else { rest };
    let rest = if rest.abs() >= b.abs() { rest - b } else { rest };
    if rest.abs() < b.abs() { rest } else { 0.0 }
}

fn power(a: f32, b: f32) -> f32 {
    if b == 0.0 {
        1.0
    } else if a == 0.0 || (a < 0.0 && b.floor() != b) {
        0.0
    } else {
        let odd = b * 0.5 != (b * 0.5).floor();
        let size = narrow(f64::from(a.abs()).powf(b.into()));
        if a < 0.0 && odd { -size } else { size }
    }
}

fn smoothstep(a: f32, low: f32, high: f32) -> f32 {
    if a >= high {
        1.0
    } else if a <= low {
        0.0
    } else {
        let t = (a - low) / (high - low);
        t * t * (3.0 - 2.0 * t)
    }
}

/// (-1)^parity sin(x - halves pi), where that angle is within a quarter of a turn but for rounding. pi is in three
/// parts whose products with `halves` are exact up to 2^12; the polynomial is off by 4e-9.
fn reduced_sine(x: f32, halves: f32, parity: f32) -> f32 {
    let r = x - halves * 3.140_625 - halves * 0.000_967_502_6 - halves * 1.509_958e-7;
    let r = r.clamp(-1.58, 1.58);
    let u = r * r;
    let p = ((2.604_814e-6 * u - 0.000_198_088_9) * u + 0.008_333_049) * u - 0.166_666_58;
    let sine = r + r * u * p;
    if parity * 0.5 == (parity * 0.5).floor() { sine } else { -sine }
}

fn sine(x: f32) -> f32 {
    let halves = (x * std::f32::consts::FRAC_1_PI + 0.5).floor();
    reduced_sine(x, halves, halves).clamp(-1.0, 1.0)
}

fn cosine(x: f32) -> f32 {
    let halves = (x * std::f32::consts::FRAC_1_PI).floor();
    reduced_sine(x, halves + 0.5, halves + 1.0).clamp(-1.0, 1.0)
}

/// Sum of the products of the first `count` components.
fn dot(a: Vec4, b: Vec4, count: u16) -> f32 {
    (0..usize::from(count.min(4))).fold(0.0, |sum, k| sum + a[k] * b[k])
}

/// The first `count` components times a power of two that keeps squares in range; its inverse.
fn scaled(a: Vec4, count: u16) -> (Vec4, f32) {
    const BIG: f32 = 1.180_591_6e21; // 2^70
    let a: Vec4 = from_fn(|k| if k < usize::from(count) { a[k] } else { 0.0 });
    let most = a.iter().fold(0.0_f32, |most, x| most.max(x.abs()));
    let (factor, inverse) = if most > 1.152_921_5e18 {
        (1.0 / BIG, BIG)
    } else if most < 8.673_617_4e-19 {
        (BIG, 1.0 / BIG)
    } else {
        (1.0, 1.0)
    };
    (a.map(|x| x * factor), inverse)
}

/// Operations on all components.
fn vector(op: Op, a: Vec4, b: Vec4, immediate: u16) -> Vec4 {
    match op {
        Op::Dot => [dot(a, b, immediate); 4],
        Op::Cross => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0], 0.0],
        Op::Normalize => {
            let (v, _) = scaled(a, immediate);
            let length = dot(v, v, 4).sqrt();
            if length == 0.0 { [0.0; 4] } else { v.map(|x| x / length) }
        }
        Op::Length => {
            let (v, inverse) = scaled(a, immediate);
            [dot(v, v, 4).sqrt() * inverse; 4]
        }
        Op::Swizzle => from_fn(|k| match immediate >> (3 * k) & 7 {
            at @ 0..=3 => a[usize::from(at)],
            5 => 1.0,
            _ => 0.0,
        }),
        Op::Blend => from_fn(|k| if immediate >> k & 1 == 1 { b[k] } else { a[k] }),
        Op::RgbToHsv => rgb_to_hsv(a),
        Op::HsvToRgb => hsv_to_rgb(a),
        _ => [0.0; 4],
    }
}

/// Foley and van Dam, "Computer Graphics", as `MaterialX` has it: grey has the hue 0, black the saturation 0.
fn rgb_to_hsv([r, g, b, alpha]: Vec4) -> Vec4 {
    let most = r.max(g.max(b));
    let range = most - r.min(g.min(b));
    let saturation = if most > 0.0 { range / most } else { 0.0 };
    if saturation <= 0.0 {
        return [0.0, 0.0, most, alpha];
    }
    let sixth = if r >= most {
        (g - b) / range
    } else if g >= most {
        2.0 + (b - r) / range
    } else {
        4.0 + (r - g) / range
    };
    let hue = sixth * (1.0 / 6.0);
    [if hue < 0.0 { hue + 1.0 } else { hue }, saturation, most, alpha]
}

/// The inverse; colours of a saturation below 0.0001 are grey.
fn hsv_to_rgb([hue, s, v, alpha]: Vec4) -> Vec4 {
    if s < 0.0001 {
        return [v, v, v, alpha];
    }
    let hue = 6.0 * (hue - hue.floor());
    let sector = hue.floor();
    let f = hue - sector;
    let [p, q, t] = [v * (1.0 - s), v * (1.0 - s * f), v * (1.0 - s * (1.0 - f))];
    let [r, g, b] = if sector < 1.0 {
        [v, t, p]
    } else if sector < 2.0 {
        [q, v, p]
    } else if sector < 3.0 {
        [p, v, t]
    } else if sector < 4.0 {
        [p, q, v]
    } else if sector < 5.0 {
        [t, p, v]
    } else {
        [v, p, q]
    };
    [r, g, b, alpha]
}

/// Operations on a lattice.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "limited before")]
fn noises(op: Op, a: Vec4, b: Vec4, immediate: u16) -> Vec4 {
    let [x, y, z, _] = a;
    let octaves =
        || FractalOctaves { count: b[0].clamp(0.0, MAX_OCTAVES as f32) as u32, lacunarity: b[1], diminish: b[2] };
    match op {
        Op::Noise2 => sums([x, y], [0.0; 2], FractalOctaves::ONE, 0),
        Op::Noise2Vector => sums([x, y], [19.0, 73.0], FractalOctaves::ONE, 1),
        Op::Noise3 => sums([x, y, z], [0.0; 3], FractalOctaves::ONE, 0),
        Op::Noise3Vector => sums([x, y, z], [19.0, 73.0, 29.0], FractalOctaves::ONE, 1),
        Op::Fractal2 => sums([x, y], [19.0, 193.0], octaves(), immediate),
        Op::Fractal3 => sums([x, y, z], [19.0, 193.0, 17.0], octaves(), immediate),
        Op::CellNoise2 => [noise::cell_noise([x, y]); 4],
        Op::CellNoise3 => [noise::cell_noise([x, y, z]); 4],
        Op::Worley2 => cellular([x, y], b[0], immediate),
        Op::Worley3 => cellular([x, y, z], b[0], immediate),
        _ => [0.0; 4],
    }
}

/// Fractal sums by the `immediate` of [`Op::Fractal3`]; `offset` is that of the last component.
fn sums<const N: usize>(p: [f32; N], offset: [f32; N], octaves: FractalOctaves, immediate: u16) -> Vec4 {
    let here = noise::fractal(p, octaves);
    if immediate == 0 {
        return [here[0]; 4];
    }
    let there = noise::fractal::<N>(from_fn(|axis| p[axis] + offset[axis]), octaves)[0];
    if immediate == 1 { [here[0], here[1], here[2], there] } else { [here[0], there, 0.0, 0.0] }
}

/// Cellular noise by the `immediate` of [`Op::Worley2`].
fn cellular<const N: usize>(p: [f32; N], jitter: f32, immediate: u16) -> Vec4 {
    let found = noise::worley(p, jitter);
    let [f1, f2, f3] = found.distances;
    match immediate {
        0 => [f1; 4],
        1 => [f1, f2, 0.0, 0.0],
        2 => [f1, f2, f3, 0.0],
        3 => [noise::cell_noise(found.nearest); 4],
        _ => {
            let [x, y, z] = noise::cell_noise_vector(found.nearest);
            [x, y, z, 0.0]
        }
    }
}
