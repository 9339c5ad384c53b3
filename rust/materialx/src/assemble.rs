// SPDX-License-Identifier: Apache-2.0
//! Assembles the inputs of a surface, and the program that computes those that are neither constants, textures nor
//! primvars, which `told` recognises.

use std::collections::HashMap;

use crate::eval::number;
use crate::expression::{ExpressionGraph, Val};
use crate::library::NodeLibrary;
use crate::network::{MAX_NODES, Network};
use crate::program::{
    Geometry, Instruction, MAX_CONSTANTS, MAX_INSTRUCTIONS, MAX_LOOKUPS, MAX_OPACITY_LOOKUPS, Op, Operand, Program,
    ProgramLookup, REGISTERS,
};
use crate::surface::{Input, LoweredSurface};
use crate::uses::{LookupUse, MaterialUses};
use crate::walk::NetworkWalker;

/// The source of an input of the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InputSource {
    /// A constant.
    Constant([f32; 4]),
    /// A texture, as [`ProgramLookup`] describes it; then one channel of it in all components, or all of it.
    Texture(ProgramLookup, Option<u8>),
    /// A primvar of [`MaterialUses::primvars`].
    Primvar(u8),
    /// A register of the program; for the opacity, of its own program.
    Register(u8),
}

/// A translated network.
#[derive(Clone, Debug)]
pub struct TranslatedNetwork {
    /// Sources by [`crate::surface::Input`]; `None` if the surface is not understood.
    pub inputs: Option<[InputSource; Input::COUNT]>,
    /// True if `specularColor` is the reflectance at normal incidence; otherwise metallic and index define it.
    pub specular_workflow: bool,
    /// 0 if the opacity is a probability; otherwise the surface is cut out where the opacity is below the threshold.
    pub opacity_threshold: f32,
    /// True if the surface is a sheet without an inside.
    pub thin_walled: bool,
    /// True if the index of glass depends on the channel: see [`Input::Absorption`].
    pub dispersive: bool,
    /// True if the surface is a fibre's: see [`Input`].
    pub hair: bool,
    /// True if the normal is given by [`Geometry::FrameX`] and [`Geometry::FrameY`], which every mesh has.
    pub framed_normal: bool,
    /// The program; empty if no input is a register.
    pub program: Program,
    /// The program for the opacity, if that is a register. It is separate because it is run before the hit is known.
    pub opacity_program: Program,
    /// The program for the emission alone, if that is a register and its meshes can be lights: [`MaterialEmission`].
    pub emission: Option<MaterialEmission>,
    /// Textures by number, sets of texture coordinates, primvars.
    pub uses: MaterialUses,
    /// Parts of the network that are not supported, one line each.
    pub problems: Vec<String>,
}

/// A program for the emission alone, for points of a mesh that no ray has met: texture coordinates, primvars, positions
/// and the direction are known there, the directions of the surface are not.
#[derive(Clone, Debug, PartialEq)]
pub struct MaterialEmission {
    /// The program that computes it.
    pub program: Program,
    /// The register that holds the result.
    pub register: u8,
}

impl TranslatedNetwork {
    /// A translation without a surface.
    fn nothing() -> Self {
        Self {
            inputs: None,
            specular_workflow: false,
            opacity_threshold: 0.0,
            thin_walled: false,
            dispersive: false,
            hair: false,
            framed_normal: false,
            program: Program::default(),
            opacity_program: Program::default(),
            emission: None,
            uses: MaterialUses::default(),
            problems: Vec::new(),
        }
    }
}

/// Translates a network.
#[must_use]
pub fn translate(network: &Network, library: &NodeLibrary) -> TranslatedNetwork {
    let mut nothing = TranslatedNetwork::nothing();
    if network.nodes.len() > MAX_NODES || network.surface >= network.nodes.len() {
        nothing.problems.push("there is no surface, or too many nodes".to_owned());
        return nothing;
    }
    let mut walker = NetworkWalker::new(network, library);
    let Some(slab) = walker.slab() else {
        nothing.problems = walker.problems;
        if nothing.problems.is_empty() {
            nothing.problems.push("its surface is mixed of what is not connected".to_owned());
        }
        return nothing;
    };
    let lowered = walker.lower(&slab);
    let framed_normal = !lowered.hair && walker.ask_for_tangents(&lowered.inputs);
    let NetworkWalker { expressions, uses, mut problems, .. } = walker;
    let mut assembler = ProgramAssembler::new(&expressions, &uses.lookups, MAX_LOOKUPS);
    let mut inputs: [Option<InputSource>; Input::COUNT] = [None; Input::COUNT];
    for ((val, name), input) in lowered.inputs.iter().zip(Input::ALL).zip(&mut inputs) {
        // Packed inputs are textures only by chance, and only a bounded number of lookups is allowed.
        let is_packed = (Input::Anisotropy..=Input::Absorption).contains(&name) && val.constant().is_none();
        *input = if is_packed { None } else { assembler.simple(*val, name.width()) };
    }
    let opacity_threshold = step_opacity(&lowered, &assembler, &mut inputs);
    let opacity_program = opacity(&lowered.inputs, &mut inputs, &expressions, &uses.lookups, &mut problems);
    let rest: Vec<Val> =
        lowered.inputs.iter().zip(&inputs).filter(|(_, known)| known.is_none()).map(|(v, _)| *v).collect();
    let textures = inputs.iter().flatten().filter(|input| matches!(input, InputSource::Texture(..))).count();
    assembler.most_lookups = MAX_LOOKUPS.min(MAX_TEXTURES.saturating_sub(textures));
    let registers = assembler.compile(&rest);
    if let Err(what) = &registers {
        problems.push(format!("the patterns have {what}: values in their middle stand for them"));
        assembler.program = Program::default();
    }
    let registers = registers.unwrap_or_default();
    let program = std::mem::take(&mut assembler.program);
    let inputs: [InputSource; Input::COUNT] = std::array::from_fn(|k| {
        inputs[k].unwrap_or_else(|| match (lowered.inputs[k], registers.get(&lowered.inputs[k].index())) {
            (_, Some(register)) => InputSource::Register(*register),
            (val, None) => InputSource::Constant(expressions.value(val, &|_| [0.5; 4], &|_| [0.5; 4])),
        })
    });
    TranslatedNetwork {
        inputs: Some(inputs),
        specular_workflow: lowered.specular_workflow,
        opacity_threshold,
        thin_walled: lowered.thin_walled,
        dispersive: lowered.dispersive,
        hair: lowered.hair,
        framed_normal,
        program,
        opacity_program,
        emission: emission(&inputs, &lowered.inputs, &expressions, &uses.lookups),
        uses,
        problems,
    }
}

impl NetworkWalker<'_> {
    /// Requests tangents. They follow the first set of texture coordinates: a network that reads them, or that defines
    /// a normal in their frame, reads `st` if it has no other set. Returns true if the normal is given in the frame
    /// that every mesh has.
    fn ask_for_tangents(&mut self, inputs: &[Val; Input::COUNT]) -> bool {
        let reads = |walker: &Self, roots: &[Val], asked: &[Geometry]| {
            let is_asked = |at: &u32| {
                let found = walker.expressions.get(*at).filter(|node| node.op == Op::Surface);
                found.is_some_and(|node| asked.iter().any(|geometry| node.immediate == *geometry as u16))
            };
            walker.expressions.needed(roots).iter().any(is_asked)
        };
        let normal = inputs[Input::Normal as usize];
        let is_framed = reads(self, &[normal], &[Geometry::FrameX, Geometry::FrameY]);
        let is_turned = normal.constant().is_none_or(|[x, y, ..]| x != 0.0 || y != 0.0);
        let tangents = [Geometry::Tangent, Geometry::Bitangent];
        if self.uses.uv_sets.is_empty() && (is_turned && !is_framed || reads(self, inputs, &tangents)) {
            self.texcoord("st");
        }
        is_framed
    }
}

/// The threshold of the opacity, which becomes a texture if one number of that decides it.
fn step_opacity(
    lowered: &LoweredSurface,
    assembler: &ProgramAssembler<'_>,
    inputs: &mut [Option<InputSource>; Input::COUNT],
) -> f32 {
    let (own, threshold) = (Input::Opacity as usize, lowered.opacity_threshold);
    if inputs[own].is_some() {
        return threshold;
    }
    let Some((texture, threshold)) = assembler.step(lowered.inputs[own], threshold) else { return threshold };
    inputs[own] = Some(texture);
    threshold
}

/// The program of the opacity, if it needs one; the surface is opaque if no program is possible.
fn opacity(
    values: &[Val; Input::COUNT],
    inputs: &mut [Option<InputSource>; Input::COUNT],
    expressions: &ExpressionGraph,
    lookups: &[LookupUse],
    problems: &mut Vec<String>,
) -> Program {
    let at = Input::Opacity as usize;
    if inputs[at].is_some() {
        return Program::default();
    }
    let mut assembler = ProgramAssembler::new(expressions, lookups, MAX_OPACITY_LOOKUPS);
    let compiled = assembler.compile(&values[at..=at]);
    // Traversal has no random number of the hit, because there is no hit yet.
    let is_random = assembler.program.is_random();
    match compiled.and_then(|registers| if is_random { Err("a random number") } else { Ok(registers) }) {
        Ok(registers) => {
            inputs[at] = registers.get(&values[at].index()).map(|register| InputSource::Register(*register));
            assembler.program
        }
        Err(what) => {
            problems.push(format!("the pattern of the opacity has {what}: the surface is there"));
            inputs[at] = Some(InputSource::Constant([1.0; 4]));
            Program::default()
        }
    }
}

/// The program that computes the emission alone, for points sampled on a mesh light. `None` if the emission is not a
/// register, or reads a normal, a tangent or a random number: those are not known at such a point.
fn emission(
    sources: &[InputSource; Input::COUNT],
    values: &[Val; Input::COUNT],
    expressions: &ExpressionGraph,
    lookups: &[LookupUse],
) -> Option<MaterialEmission> {
    let value = values[Input::EmissiveColor as usize];
    if !matches!(sources[Input::EmissiveColor as usize], InputSource::Register(_)) {
        return None;
    }
    let mut assembler = ProgramAssembler::new(expressions, lookups, MAX_LOOKUPS);
    let register = assembler.compile_one(value).ok()?;
    let program = assembler.program;
    let unknown = [Geometry::Normal, Geometry::Tangent, Geometry::Bitangent, Geometry::FrameX, Geometry::FrameY];
    let is_known = !unknown.into_iter().any(|geometry| program.reads(geometry));
    (!program.is_random() && is_known).then_some(MaterialEmission { program, register })
}

impl Val {
    /// The number of the operation; `None` for a constant.
    fn index(self) -> Option<u32> {
        match self {
            Self::Node(at) => Some(at),
            Self::Constant(_) => None,
        }
    }
}

/// Most lookups of a material: a path keeps a bit for each of sixteen, and one is a light's.
const MAX_TEXTURES: usize = 15;

pub(crate) struct ProgramAssembler<'a> {
    /// Most lookups of the program.
    most_lookups: usize,
    pub(crate) expressions: &'a ExpressionGraph,
    pub(crate) lookups: &'a [LookupUse],
    pub(crate) program: Program,
}

impl<'a> ProgramAssembler<'a> {
    pub(crate) fn new(expressions: &'a ExpressionGraph, lookups: &'a [LookupUse], most_lookups: usize) -> Self {
        Self { most_lookups, expressions, lookups, program: Program::default() }
    }
}

impl ProgramAssembler<'_> {
    /// The operations in the order of evaluation: each as late as its reader allows.
    fn order(&self, roots: &[Val], places: &HashMap<u16, (ProgramLookup, bool)>) -> Vec<u32> {
        let mut order = Vec::new();
        let mut state: HashMap<u32, bool> = HashMap::new(); // true: done
        for root in roots {
            let mut stack: Vec<u32> = root.index().into_iter().collect();
            while let Some(&at) = stack.last() {
                if state.get(&at) == Some(&true) {
                    stack.pop();
                    continue;
                }
                let arguments = self.arguments(at, places);
                let open = arguments.iter().filter_map(|val| val.index()).filter(|at| !state.contains_key(at));
                let before = stack.len();
                stack.extend(open.collect::<Vec<_>>());
                if stack.len() == before {
                    stack.pop();
                    state.insert(at, true);
                    order.push(at);
                }
            }
        }
        order
    }

    /// The operands of an operation; none for a lookup with a known place.
    fn arguments(&self, at: u32, places: &HashMap<u16, (ProgramLookup, bool)>) -> [Val; 3] {
        match self.expressions.get(at) {
            Some(node) if node.op == Op::Texture && places.get(&node.immediate).is_none_or(|(_, known)| *known) => {
                [Val::ZERO; 3]
            }
            Some(node) => node.arguments,
            None => [Val::ZERO; 3],
        }
    }

    /// Compiles a value that is not a constant; returns its register.
    pub(crate) fn compile_one(&mut self, value: Val) -> Result<u8, &'static str> {
        let registers = self.compile(&[value])?;
        registers.get(&value.index()).copied().ok_or("a value that is not there")
    }

    /// Compiles these values; returns the register of each.
    fn compile(&mut self, roots: &[Val]) -> Result<HashMap<Option<u32>, u8>, &'static str> {
        let mut places: HashMap<u16, (ProgramLookup, bool)> = HashMap::new();
        for at in self.expressions.needed(roots) {
            if let Some(node) = self.expressions.get(at).filter(|node| node.op == Op::Texture)
                && let Some(found) = self.lookup(u32::from(node.immediate))
            {
                places.insert(node.immediate, found);
            }
        }
        let order = self.order(roots, &places);
        if order.len() > MAX_INSTRUCTIONS {
            return Err("more operations than a program may have");
        }
        let mut last: HashMap<u32, usize> = HashMap::new();
        for (time, at) in order.iter().enumerate() {
            for argument in self.arguments(*at, &places).iter().filter_map(|val| val.index()) {
                last.insert(argument, time);
            }
        }
        for root in roots.iter().filter_map(|root| root.index()) {
            last.insert(root, usize::MAX);
        }
        let mut free: Vec<u8> = (0..u8::try_from(REGISTERS).unwrap_or(u8::MAX)).rev().collect();
        let mut registers: HashMap<Option<u32>, u8> = HashMap::new();
        for (time, at) in order.iter().enumerate() {
            let arguments = self.arguments(*at, &places);
            let mut operands = [Operand::Constant(0); 3];
            for (operand, argument) in operands.iter_mut().zip(arguments) {
                *operand = match argument {
                    Val::Constant(value) => self.constant(value)?,
                    node => Operand::Register(*registers.get(&node.index()).ok_or("a value before it is known")?),
                };
            }
            let mut ended: Vec<u32> = arguments.iter().filter_map(|val| val.index()).collect();
            ended.sort_unstable();
            ended.dedup();
            for argument in ended.into_iter().filter(|argument| last.get(argument) == Some(&time)) {
                if let Some(register) = registers.remove(&Some(argument)) {
                    free.push(register);
                }
            }
            let to = free.pop().ok_or("more values at a time than there are registers")?;
            registers.insert(Some(*at), to);
            let node = *self.expressions.get(*at).ok_or("an operation that is not there")?;
            let immediate = if node.op == Op::Texture { self.place(node.immediate, &places)? } else { node.immediate };
            self.program.instructions.push(Instruction { op: node.op, to, operands, immediate });
        }
        Ok(registers)
    }

    /// The number of a lookup in the program; bit 8: its place is known without the operand.
    fn place(&mut self, number: u16, places: &HashMap<u16, (ProgramLookup, bool)>) -> Result<u16, &'static str> {
        let (lookup, known) = *places.get(&number).ok_or("a texture that is not there")?;
        if self.program.lookups.len() >= self.most_lookups {
            return Err("more texture lookups than a program may have");
        }
        self.program.lookups.push(lookup);
        let at = u16::try_from(self.program.lookups.len() - 1).unwrap_or(0);
        Ok(at | if known { 256 } else { 0 })
    }

    fn constant(&mut self, value: [f32; 4]) -> Result<Operand, &'static str> {
        let value = value.map(number);
        let same = |known: &[f32; 4]| known.map(f32::to_bits) == value.map(f32::to_bits);
        let at = match self.program.constants.iter().position(same) {
            Some(at) => at,
            None => {
                self.program.constants.push(value);
                self.program.constants.len() - 1
            }
        };
        if at >= MAX_CONSTANTS {
            return Err("more constants than a program may have");
        }
        u8::try_from(at).map(Operand::Constant).or(Err("more constants than a program may have"))
    }
}
