// SPDX-License-Identifier: Apache-2.0
//! Operands for operations of pattern programs.

use oocpt_core::materialx::program::Op;

/// Every operation except those that the caller evaluates.
pub(super) fn ops() -> impl Iterator<Item = Op> {
    Op::ALL.into_iter().filter(|op| !matches!(op, Op::Surface | Op::Texture))
}

/// An operation and its operands.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) op: Op,
    pub(super) immediate: u16,
    pub(super) operands: [[f32; 4]; 3],
}

impl Case {
    /// The case in the layout of the shader.
    pub(super) fn words(&self) -> [u32; 14] {
        let mut words = [self.op as u32, self.immediate.into(), 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        for (word, x) in words[2..].iter_mut().zip(self.operands.as_flattened()) {
            *word = x.to_bits();
        }
        words
    }
}

/// `SplitMix64` (Steele et al. 2014).
struct Random(u64);

impl Random {
    fn new(op: Op, seed: u32) -> Self {
        Self((op as u64) << 32 | u64::from(seed))
    }

    fn bits(&mut self) -> u32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ z >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ z >> 31) >> 32) as u32
    }

    fn below(&mut self, count: u32) -> u32 {
        self.bits() % count
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * ((self.bits() >> 8) as f32 / 16_777_216.0)
    }

    fn sign(&mut self) -> f32 {
        if self.below(2) == 0 { 1.0 } else { -1.0 }
    }

    /// A number of any size from 2^-20 to 2^20, or a small number of quarters, so that operands are often equal or 0.
    fn number(&mut self) -> f32 {
        if self.below(4) == 0 {
            self.sign() * self.below(9) as f32 / 4.0
        } else {
            self.sign() * self.between(1.0, 2.0) * self.between(-20.0, 20.0).floor().exp2()
        }
    }

    /// On a lattice: points of it, near ones, far ones.
    fn coordinate(&mut self) -> f32 {
        match self.below(8) {
            0 => self.between(-20.0, 20.0).floor(),
            1 => self.sign() * self.between(1.0, 20_000_000.0),
            _ => self.between(-100.0, 100.0),
        }
    }
}

fn immediate(op: Op, random: &mut Random) -> u16 {
    let choices = match op {
        Op::Dot | Op::Normalize | Op::Length | Op::Worley2 | Op::Worley3 => 5,
        Op::Swizzle => 1 << 12,
        Op::Blend => 16,
        Op::Fractal2 | Op::Fractal3 => 3,
        _ => 1,
    };
    u16::try_from(random.below(choices)).expect("few")
}

/// Operands in the range where the errors are stated.
pub(super) fn ordinary(op: Op, seed: u32) -> Case {
    let mut r = Random::new(op, seed);
    let immediate = immediate(op, &mut r);
    let operand = |f: &mut dyn FnMut() -> f32| std::array::from_fn(|_| f());
    let mut operands: [[f32; 4]; 3] = std::array::from_fn(|_| operand(&mut || r.number()));
    match op {
        Op::Power => {
            operands[0] = operand(&mut || r.sign() * r.between(-10.0, 10.0).exp2());
            operands[1] =
                operand(&mut || if r.below(2) == 0 { r.between(-8.0, 8.0) } else { r.between(-8.0, 8.0).round() });
        }
        Op::Exp => operands[0] = operand(&mut || r.between(-80.0, 80.0)),
        Op::Asin | Op::Acos => operands[0] = operand(&mut || r.between(-1.1, 1.1)),
        Op::RgbToHsv | Op::HsvToRgb => operands[0] = operand(&mut || r.between(-0.2, 1.5)),
        _ if op >= Op::Noise2 => {
            operands[0] = operand(&mut || r.coordinate());
            operands[1] = match op {
                Op::Fractal2 | Op::Fractal3 => {
                    [r.between(-1.0, 9.0), r.between(1.5, 3.0), r.between(0.3, 1.2), r.number()]
                }
                _ => operand(&mut || r.between(0.0, 1.5)),
            };
        }
        _ => {}
    }
    Case { op, immediate, operands }
}

/// Extreme operands: huge, tiny, not normal, not finite.
pub(super) fn extreme(op: Op, seed: u32) -> Case {
    const ODD: [f32; 16] = [
        0.0,
        -0.0,
        1.0,
        f32::NAN,
        f32::INFINITY,
        f32::MAX,
        f32::MIN_POSITIVE,
        1e-40,
        1e-45,
        1e-30,
        1e30,
        16_777_216.0,
        2_147_483_648.0,
        4_294_967_296.0,
        0.999_999_94,
        1e-7,
    ];
    let mut r = Random::new(op, seed);
    let immediate = if r.below(2) == 0 { immediate(op, &mut r) } else { (r.bits() >> 16) as u16 };
    // Half of the cases have operands for which the twin is specified.
    let normal = r.below(2) == 0;
    let mut number = || {
        let x = match r.below(4) {
            0 => f32::from_bits(r.bits()),
            1 => r.number(),
            _ => r.sign() * ODD[r.below(16) as usize],
        };
        if x.is_normal() || !normal { x } else { 0.0 }
    };
    Case { op, immediate, operands: std::array::from_fn(|_| std::array::from_fn(|_| number())) }
}
