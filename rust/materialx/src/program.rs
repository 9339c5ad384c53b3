// SPDX-License-Identifier: Apache-2.0
//! Programs: what patterns of a material are compiled to. The twin that runs them on the device is
//! `shaders/material/pattern.glsl`.
//!
//! A program is a list of instructions without branches over [`REGISTERS`] registers of four f32 each. Integers and
//! booleans are floats (0 and 1). An operand is a register or a constant of the program.

pub use oocpt_abi::{PatternGeometry as Geometry, PatternOp as Op};

/// Registers of a program.
pub const REGISTERS: usize = oocpt_abi::PROGRAM_REGISTERS as usize;
/// Constants of a program, at most: an operand is a byte.
pub const MAX_CONSTANTS: usize = 256 - REGISTERS;
/// Instructions of a program, at most.
pub const MAX_INSTRUCTIONS: usize = 1024;
/// Texture lookups of a program, at most: what is kept of lookups under way has this many places.
pub const MAX_LOOKUPS: usize = 12;
/// Texture lookups of a program for opacity, at most.
pub const MAX_OPACITY_LOOKUPS: usize = oocpt_abi::CUTOUT_LOOKUPS as usize;

/// A texture lookup of a program.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProgramLookup {
    /// Number of the texture.
    pub texture: u32,
    /// Set of texture coordinates whose footprint the filter has; `None`: no filter.
    pub uv: Option<u8>,
    /// Rows of the affine map from that set to the place that is looked at, as far as it is one: for the filter only.
    pub transform: [[f32; 3]; 2],
    /// What multiplies a texel that was found, and what is added.
    pub scale: [f32; 4],
    /// See `scale`.
    pub bias: [f32; 4],
}

/// Where an instruction finds a value.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operand {
    /// A register, below [`REGISTERS`].
    Register(u8),
    /// A constant, below [`MAX_CONSTANTS`].
    Constant(u8),
}

/// An instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// What it does.
    pub op: Op,
    /// The register that it writes.
    pub to: u8,
    /// a, b, c.
    pub operands: [Operand; 3],
    /// See [`Op`].
    pub immediate: u16,
}

impl Operand {
    /// The byte of the packed form: registers first, then constants.
    #[expect(clippy::cast_possible_truncation, reason = "few registers")]
    fn byte(self) -> u32 {
        match self {
            Self::Register(at) => u32::from(at),
            Self::Constant(at) => REGISTERS as u32 + u32::from(at),
        }
    }
}

impl Instruction {
    /// The packed form that the device reads: op | to << 8 | a << 16 | b << 24, c | immediate << 8.
    #[must_use]
    pub fn pack(&self) -> [u32; 2] {
        let [a, b, c] = self.operands.map(Operand::byte);
        [self.op as u32 | u32::from(self.to) << 8 | a << 16 | b << 24, c | u32::from(self.immediate) << 8]
    }
}

/// A program.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Program {
    /// In order; at most [`MAX_INSTRUCTIONS`].
    pub instructions: Vec<Instruction>,
    /// At most [`MAX_CONSTANTS`].
    pub constants: Vec<[f32; 4]>,
    /// At most [`MAX_LOOKUPS`].
    pub lookups: Vec<ProgramLookup>,
}

impl Program {
    /// Whether it reads a random number of the hit.
    #[must_use]
    pub fn is_random(&self) -> bool {
        Geometry::RANDOM.into_iter().any(|random| self.reads(random))
    }

    /// Whether it reads this of the surface.
    #[must_use]
    pub fn reads(&self, geometry: Geometry) -> bool {
        self.instructions.iter().any(|step| step.op == Op::Surface && step.immediate == geometry as u16)
    }
}
