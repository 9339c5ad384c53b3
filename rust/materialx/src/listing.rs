// SPDX-License-Identifier: Apache-2.0
//! Programs as text for people: their cost, their instructions, and their formulas.
//!
//! Text that comes from scenes (names of files and primvars) is given by the caller, who bounds it.

use std::fmt::Write as _;

use crate::program::{Geometry, Instruction, Op, Operand, Program, REGISTERS};

/// Longest formula that is written inside of another one, bytes; a longer one gets a line of its own.
const MAX_INLINE_BYTES: usize = 64;

/// The cost of a program for each hit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProgramCost {
    /// Instructions, all of which are run.
    pub instructions: usize,
    /// Noise operations among these: each costs some dozens of the others, fractal sums that for each octave.
    pub noises: usize,
    /// Registers that are written.
    pub registers: usize,
    /// Constants.
    pub constants: usize,
    /// Texture lookups.
    pub lookups: usize,
}

impl ProgramCost {
    /// The cost of a program.
    #[must_use]
    pub fn of(program: &Program) -> Self {
        let is_noise = |op: Op| (Op::Noise2..=Op::Fractal2).contains(&op);
        Self {
            instructions: program.instructions.len(),
            noises: program.instructions.iter().filter(|instruction| is_noise(instruction.op)).count(),
            registers: program
                .instructions
                .iter()
                .map(|instruction| usize::from(instruction.to) + 1)
                .max()
                .unwrap_or(0),
            constants: program.constants.len(),
            lookups: program.lookups.len(),
        }
    }
}

/// Names of the inputs of a program.
pub trait ListingNames {
    /// A set of texture coordinates of the material.
    fn uv_set(&self, set: usize) -> String;
    /// A primvar of the material.
    fn primvar(&self, slot: usize) -> String;
    /// A texture.
    fn texture(&self, texture: u32) -> String;
}

/// Each instruction as a line: the register that it writes, the operation, its operands.
#[must_use]
pub fn instructions(program: &Program, names: &dyn ListingNames) -> Vec<String> {
    let operand = |operand: Operand| match operand {
        Operand::Register(register) => format!("r{register}"),
        Operand::Constant(at) => constant(program, at),
    };
    let line = |instruction: &Instruction| {
        let operands = instruction.operands.map(operand);
        format!("r{} = {}", instruction.to, call(program, instruction, &operands, names))
    };
    program.instructions.iter().map(line).collect()
}

/// The contents of the registers in `roots` at the end, as formulas; also the lines `v1 = ...` before them, for values
/// that are read more than once or are long.
#[must_use]
pub fn formulas(program: &Program, roots: &[u8], names: &dyn ListingNames) -> (Vec<String>, Vec<String>) {
    // Number of readers by instruction. A register has the value of the last instruction that wrote it.
    let mut readers = vec![0_usize; program.instructions.len()];
    let mut writer: [Option<usize>; REGISTERS] = [None; REGISTERS];
    let mut sources: Vec<[Option<usize>; 3]> = Vec::new();
    for (at, instruction) in program.instructions.iter().enumerate() {
        let found = instruction.operands.map(|operand| match operand {
            Operand::Register(register) => writer.get(usize::from(register)).copied().flatten(),
            Operand::Constant(_) => None,
        });
        for source in found.iter().take(operands(instruction)).flatten() {
            readers[*source] += 1;
        }
        sources.push(found);
        if let Some(slot) = writer.get_mut(usize::from(instruction.to)) {
            *slot = Some(at);
        }
    }
    for source in roots.iter().filter_map(|root| writer.get(usize::from(*root)).copied().flatten()) {
        readers[source] += 1;
    }
    let mut texts: Vec<String> = Vec::new();
    let mut lines = Vec::new();
    for (at, (instruction, sources)) in program.instructions.iter().zip(&sources).enumerate() {
        let operands: [String; 3] = std::array::from_fn(|k| match (instruction.operands[k], sources[k]) {
            (Operand::Constant(number), _) => constant(program, number),
            (Operand::Register(_), Some(source)) => texts.get(source).cloned().unwrap_or_default(),
            (Operand::Register(_), None) => "0".to_owned(),
        });
        let text = call(program, instruction, &operands, names);
        let is_plain = instruction.op == Op::Surface;
        if is_plain || readers[at] <= 1 && text.len() <= MAX_INLINE_BYTES {
            texts.push(text);
        } else {
            lines.push(format!("v{} = {text}", lines.len() + 1));
            texts.push(format!("v{}", lines.len()));
        }
    }
    let root = |register: &u8| {
        let source = writer.get(usize::from(*register)).copied().flatten();
        source.and_then(|source| texts.get(source)).cloned().unwrap_or_else(|| "0".to_owned())
    };
    let roots = roots.iter().map(root).collect();
    (lines, roots)
}

/// The number of operands that count.
fn operands(instruction: &Instruction) -> usize {
    match instruction.op {
        Op::Surface => 0,
        Op::Texture if instruction.immediate & 256 != 0 => 0,
        Op::Move
        | Op::Absolute
        | Op::Sign
        | Op::Floor
        | Op::Ceil
        | Op::Round
        | Op::Fract
        | Op::Sqrt
        | Op::Ln
        | Op::Exp
        | Op::Sin
        | Op::Cos
        | Op::Tan
        | Op::Asin
        | Op::Acos
        | Op::Normalize
        | Op::Length
        | Op::Swizzle
        | Op::RgbToHsv
        | Op::HsvToRgb
        | Op::Noise2
        | Op::Noise2Vector
        | Op::Noise3
        | Op::Noise3Vector
        | Op::CellNoise2
        | Op::CellNoise3
        | Op::Texture => 1,
        Op::Mix | Op::Clamp | Op::Smoothstep | Op::MultiplyAdd | Op::Select => 3,
        _ => 2,
    }
}

/// A call with these operands.
fn call(program: &Program, instruction: &Instruction, operands: &[String; 3], names: &dyn ListingNames) -> String {
    let Instruction { op, immediate, .. } = *instruction;
    let [a, b, _] = operands;
    match op {
        Op::Surface => return geometry(immediate, names),
        Op::Swizzle => return format!("swizzle({a}, {})", swizzle(immediate)),
        Op::Texture => {
            let lookup = program.lookups.get(usize::from(immediate & 255));
            let file = lookup.map_or_else(|| "?".to_owned(), |lookup| names.texture(lookup.texture));
            let is_known = immediate & 256 != 0;
            let place = match lookup.and_then(|lookup| lookup.uv) {
                Some(set) if is_known => names.uv_set(usize::from(set)),
                _ if is_known => "a fixed place".to_owned(),
                _ => a.clone(),
            };
            return format!("texture({file}, {place})");
        }
        Op::Blend => {
            let taken: String =
                "xyzw".chars().enumerate().filter(|(k, _)| immediate >> k & 1 != 0).map(|(_, c)| c).collect();
            return format!("blend({a}, {b}.{taken})");
        }
        _ => {}
    }
    let mut text = format!("{op:?}").to_ascii_lowercase();
    if matches!(op, Op::Dot | Op::Normalize | Op::Length | Op::Worley2 | Op::Worley3 | Op::Fractal2 | Op::Fractal3) {
        // Writing to a String cannot fail.
        write!(text, "[{immediate}]").unwrap_or_default();
    }
    let count = self::operands(instruction);
    text.push('(');
    text.push_str(&operands.iter().take(count).map(String::as_str).collect::<Vec<_>>().join(", "));
    text.push(')');
    text
}

/// The name of a property of the surface.
fn geometry(immediate: u16, names: &dyn ListingNames) -> String {
    match immediate {
        at if at == Geometry::Uv0 as u16 => names.uv_set(0),
        at if at == Geometry::Uv1 as u16 => names.uv_set(1),
        at if at == Geometry::Primvar0 as u16 => names.primvar(0),
        at if at == Geometry::Primvar1 as u16 => names.primvar(1),
        at if at == Geometry::Position as u16 => "position".to_owned(),
        at if at == Geometry::Normal as u16 => "normal".to_owned(),
        at if at == Geometry::Tangent as u16 => "tangent".to_owned(),
        at if at == Geometry::Bitangent as u16 => "bitangent".to_owned(),
        at if at == Geometry::ViewDirection as u16 => "view direction".to_owned(),
        at if at == Geometry::FrameX as u16 => "any tangent".to_owned(),
        at if at == Geometry::FrameY as u16 => "any bitangent".to_owned(),
        at => format!("random {}", at.saturating_sub(Geometry::Random0 as u16)),
    }
}

fn swizzle(immediate: u16) -> String {
    let component = |k: u16| match immediate >> (3 * k) & 7 {
        0 => 'x',
        1 => 'y',
        2 => 'z',
        3 => 'w',
        4 => '0',
        _ => '1',
    };
    let all: String = (0..4).map(component).collect();
    let first = all.chars().next().unwrap_or('x');
    if all.chars().all(|c| c == first) { first.to_string() } else { all }
}

fn constant(program: &Program, at: u8) -> String {
    program.constants.get(usize::from(at)).map_or_else(|| "?".to_owned(), |value| numbers(value, 4))
}

/// The first `width` components of a value: one number if they are equal.
#[must_use]
pub fn numbers(value: &[f32; 4], width: usize) -> String {
    let shown = value.get(..width.clamp(1, 4)).unwrap_or(value);
    if shown.iter().all(|v| v.to_bits() == shown[0].to_bits()) {
        return number(shown[0]);
    }
    format!("({})", shown.iter().map(|v| number(*v)).collect::<Vec<_>>().join(", "))
}

/// The shortest text that is read back as this number.
fn number(value: f32) -> String {
    let text = format!("{value:?}");
    text.strip_suffix(".0").map(str::to_owned).unwrap_or(text)
}
