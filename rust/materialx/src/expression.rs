// SPDX-License-Identifier: Apache-2.0
//! Expressions: patterns as a graph of operations, in which equal ones occur once and constants are folded.

use std::collections::HashMap;

use crate::eval::evaluate;
use crate::program::{Geometry, Op};

/// Most operations of a material, before those that nothing reads are left out.
pub(crate) const MAX_EXPRESSIONS: usize = 1 << 14;

/// A value: known, or the result of an operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Val {
    Constant([f32; 4]),
    Node(u32),
}

impl Val {
    pub(crate) const ZERO: Self = Self::Constant([0.0; 4]);
    pub(crate) const ONE: Self = Self::Constant([1.0; 4]);

    /// A number in all components; 0 if it is not finite, as results of operations are.
    pub(crate) fn number(value: f32) -> Self {
        Self::Constant([if value.is_finite() { value } else { 0.0 }; 4])
    }

    pub(crate) fn constant(self) -> Option<[f32; 4]> {
        match self {
            Self::Constant(value) => Some(value),
            Self::Node(_) => None,
        }
    }

    /// Returns true if the value is this constant, in the first `width` components.
    pub(crate) fn is(self, value: f32, width: usize) -> bool {
        self.constant().is_some_and(|numbers| numbers.iter().take(width).all(|number| *number == value))
    }

    fn key(self) -> [u32; 5] {
        match self {
            Self::Constant(v) => [u32::MAX, v[0].to_bits(), v[1].to_bits(), v[2].to_bits(), v[3].to_bits()],
            Self::Node(at) => [at, 0, 0, 0, 0],
        }
    }
}

/// An operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Expression {
    pub(crate) op: Op,
    pub(crate) arguments: [Val; 3],
    /// For [`Op::Texture`] the number of the lookup's use of a texture.
    pub(crate) immediate: u16,
}

type ExpressionKey = (Op, [[u32; 5]; 3], u16);

/// All operations of a material: each after its arguments.
#[derive(Debug, Default)]
pub(crate) struct ExpressionGraph {
    nodes: Vec<Expression>,
    known: HashMap<ExpressionKey, u32>,
    /// True if there were more than [`MAX_EXPRESSIONS`].
    pub(crate) is_full: bool,
}

/// The inputs that an expression depends on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ExpressionInputs {
    /// Bits by [`Geometry`].
    pub(crate) geometry: u32,
    /// Bits by number of the lookup.
    pub(crate) lookups: u64,
}

impl ExpressionGraph {
    pub(crate) fn get(&self, at: u32) -> Option<&Expression> {
        self.nodes.get(at as usize)
    }

    /// The result of an operation.
    pub(crate) fn op(&mut self, op: Op, arguments: [Val; 3], immediate: u16) -> Val {
        if let Some(known) = simpler(op, arguments) {
            return known;
        }
        if let ([Val::Constant(a), Val::Constant(b), Val::Constant(c)], false) =
            (arguments, matches!(op, Op::Surface | Op::Texture))
        {
            return Val::Constant(evaluate(op, [a, b, c], immediate));
        }
        let key = (op, arguments.map(Val::key), immediate);
        if let Some(at) = self.known.get(&key) {
            return Val::Node(*at);
        }
        let Ok(at) = u32::try_from(self.nodes.len()) else { return Val::ZERO };
        if self.nodes.len() >= MAX_EXPRESSIONS {
            self.is_full = true;
            return Val::ZERO;
        }
        self.nodes.push(Expression { op, arguments, immediate });
        self.known.insert(key, at);
        Val::Node(at)
    }

    pub(crate) fn unary(&mut self, op: Op, a: Val) -> Val {
        self.op(op, [a, Val::ZERO, Val::ZERO], 0)
    }

    pub(crate) fn binary(&mut self, op: Op, a: Val, b: Val) -> Val {
        self.op(op, [a, b, Val::ZERO], 0)
    }

    pub(crate) fn add(&mut self, a: Val, b: Val) -> Val {
        self.binary(Op::Add, a, b)
    }

    pub(crate) fn subtract(&mut self, a: Val, b: Val) -> Val {
        self.binary(Op::Subtract, a, b)
    }

    pub(crate) fn multiply(&mut self, a: Val, b: Val) -> Val {
        self.binary(Op::Multiply, a, b)
    }

    pub(crate) fn divide(&mut self, a: Val, b: Val) -> Val {
        self.binary(Op::Divide, a, b)
    }

    /// Computes a (1 - share) + b share.
    pub(crate) fn mix(&mut self, a: Val, b: Val, share: Val) -> Val {
        self.op(Op::Mix, [a, b, share], 0)
    }

    /// Computes 1 - a.
    pub(crate) fn complement(&mut self, a: Val) -> Val {
        self.subtract(Val::ONE, a)
    }

    pub(crate) fn geometry(&mut self, what: Geometry) -> Val {
        self.op(Op::Surface, [Val::ZERO; 3], what as u16)
    }

    /// Components of a; 4 is the number 0, 5 the number 1.
    pub(crate) fn swizzle(&mut self, a: Val, [x, y, z, w]: [u16; 4]) -> Val {
        if [x, y, z, w] == [0, 1, 2, 3] {
            return a;
        }
        self.op(Op::Swizzle, [a, Val::ZERO, Val::ZERO], x | y << 3 | z << 6 | w << 9)
    }

    /// A component of a in all components.
    pub(crate) fn component(&mut self, a: Val, at: u16) -> Val {
        self.swizzle(a, [at.min(3); 4])
    }

    /// Joins numbers (each in all components).
    pub(crate) fn combine(&mut self, parts: &[Val]) -> Val {
        let mut whole = parts.first().copied().unwrap_or(Val::ZERO);
        for (at, part) in parts.iter().enumerate().skip(1).take(3) {
            let mask = (at..4).fold(0, |mask, k| mask | 1 << k);
            whole = self.op(Op::Blend, [whole, *part, Val::ZERO], mask);
        }
        whole
    }

    /// The first `width` components of a, then those of b.
    pub(crate) fn splice(&mut self, a: Val, width: usize, b: Val) -> Val {
        let mask = (width..4).fold(0, |mask, k| mask | 1 << k);
        self.op(Op::Blend, [a, b, Val::ZERO], mask)
    }

    pub(crate) fn dot(&mut self, a: Val, b: Val, width: u16) -> Val {
        self.op(Op::Dot, [a, b, Val::ZERO], width)
    }

    pub(crate) fn normalize(&mut self, a: Val, width: u16) -> Val {
        self.op(Op::Normalize, [a, Val::ZERO, Val::ZERO], width)
    }

    /// The operations that `val` consists of, in order; those at or below a texture lookup only if `through`.
    fn reach(&self, val: Val, through: bool) -> Vec<u32> {
        let mut reached = vec![];
        let mut seen = vec![false; self.nodes.len()];
        let mut rest = vec![val];
        while let Some(next) = rest.pop() {
            let Val::Node(at) = next else { continue };
            let Some(node) = self.get(at) else { continue };
            if std::mem::replace(&mut seen[at as usize], true) {
                continue;
            }
            reached.push(at);
            if through || node.op != Op::Texture {
                rest.extend(node.arguments);
            }
        }
        reached.sort_unstable();
        reached
    }

    /// All operations that these values consist of, in order.
    pub(crate) fn needed(&self, roots: &[Val]) -> Vec<u32> {
        let mut all: Vec<u32> = roots.iter().flat_map(|root| self.reach(*root, true)).collect();
        all.sort_unstable();
        all.dedup();
        all
    }

    /// The inputs that a value depends on directly: coordinates of lookups do not count.
    pub(crate) fn leaves(&self, val: Val) -> ExpressionInputs {
        let mut leaves = ExpressionInputs::default();
        for at in self.reach(val, false) {
            let Some(node) = self.get(at) else { continue };
            match node.op {
                Op::Surface => leaves.geometry |= 1 << node.immediate.min(31),
                Op::Texture => leaves.lookups |= 1 << node.immediate.min(63),
                _ => {}
            }
        }
        leaves
    }

    /// Returns true if the first two components of a value are surely the same.
    pub(crate) fn is_even(&self, val: Val) -> bool {
        let mut known: HashMap<u32, bool> = HashMap::new();
        let lookup = |known: &HashMap<u32, bool>, val: Val| match val {
            Val::Constant([x, y, ..]) => x == y,
            Val::Node(at) => known.get(&at).copied().unwrap_or(false),
        };
        for at in self.reach(val, true) {
            let Some(node) = self.get(at) else { continue };
            let [a, b, c] = node.arguments.map(|argument| lookup(&known, argument));
            let (first, second) = (node.immediate & 7, node.immediate >> 3 & 7);
            let is_even = match node.op {
                Op::Dot | Op::Length | Op::Noise2 | Op::Noise3 | Op::CellNoise2 | Op::CellNoise3 => true,
                Op::Worley2 | Op::Worley3 | Op::Fractal2 | Op::Fractal3 => node.immediate == 0,
                Op::Swizzle => first == second || a && first.max(second) < 2,
                Op::Blend => match node.immediate & 3 {
                    0 => a,
                    3 => b,
                    _ => a && node.arguments[0] == node.arguments[1],
                },
                Op::Surface | Op::Texture | Op::Cross | Op::Normalize => false,
                Op::RgbToHsv | Op::HsvToRgb | Op::Noise2Vector | Op::Noise3Vector => false,
                _ => a && b && c,
            };
            known.insert(at, is_even);
        }
        lookup(&known, val)
    }

    /// The number that a value has if leaves have the values of these functions.
    pub(crate) fn value(
        &self,
        val: Val,
        geometry: &dyn Fn(u16) -> [f32; 4],
        texel: &dyn Fn(u16) -> [f32; 4],
    ) -> [f32; 4] {
        let mut known: HashMap<u32, [f32; 4]> = HashMap::new();
        for at in self.reach(val, false) {
            let Some(node) = self.get(at) else { continue };
            let argument = |val: Val| match val {
                Val::Constant(value) => value,
                Val::Node(at) => known.get(&at).copied().unwrap_or_default(),
            };
            let value = match node.op {
                Op::Surface => geometry(node.immediate),
                Op::Texture => texel(node.immediate),
                op => evaluate(op, node.arguments.map(argument), node.immediate),
            };
            known.insert(at, value);
        }
        match val {
            Val::Constant(value) => value,
            Val::Node(at) => known.get(&at).copied().unwrap_or_default(),
        }
    }
}

/// Simplifies an operation without evaluating it.
fn simpler(op: Op, [a, b, c]: [Val; 3]) -> Option<Val> {
    match op {
        Op::Move => Some(a),
        Op::Add if a.is(0.0, 4) => Some(b),
        Op::Add | Op::Subtract if b.is(0.0, 4) => Some(a),
        Op::Multiply if a.is(1.0, 4) => Some(b),
        Op::Multiply | Op::Divide if b.is(1.0, 4) => Some(a),
        Op::Multiply if a.is(0.0, 4) || b.is(0.0, 4) => Some(Val::ZERO),
        Op::Mix if c.is(0.0, 4) || a == b => Some(a),
        Op::Mix if c.is(1.0, 4) => Some(b),
        Op::Select if a == b => Some(a),
        Op::Select => match c.constant()? {
            v if v.iter().all(|v| *v != 0.0) => Some(a),
            v if v.iter().all(|v| *v == 0.0) => Some(b),
            _ => None,
        },
        _ => None,
    }
}
