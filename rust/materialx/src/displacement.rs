// SPDX-License-Identifier: Apache-2.0
//! The displacement terminal of a network: `displacement` nodes, and mixtures of them through graphs, as a constant or
//! as a program for the vertices of a mesh.
//!
//! What a program reads there: [`Geometry::Position`] and the vectors are those of the mesh's own frame, before it is
//! displaced. The view and random numbers are not known: who reads them is refused. It has sets of texture coordinates,
//! primvars and textures of its own.

use std::collections::HashMap;

use crate::assemble::ProgramAssembler;
use crate::eval::number;
use crate::expression::Val;
use crate::library::NodeLibrary;
use crate::network::{MAX_NODES, Network};
use crate::program::{Geometry, Instruction, MAX_LOOKUPS, Op, Program};
use crate::uses::MaterialUses;
use crate::value::PortType;
use crate::walk::{NetworkWalker, NodeAddress};

/// Displacement shaders one within the other, at most.
const MAX_SHADERS: usize = 16;
/// The type of what may be at the terminal.
const SHADER: &str = "displacementshader";
/// The set of texture coordinates that tangents follow where no other is read.
const DEFAULT_SET: &str = "st";

/// How far, and where to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DisplacementOffset {
    /// The same everywhere.
    Constant([f32; 4]),
    /// A register of the program.
    Register(u8),
}

/// What the displacement terminal says.
#[derive(Clone, Debug, PartialEq)]
pub struct DisplacementProgram {
    /// The first component counts, or the first three.
    pub offset: DisplacementOffset,
    /// Along tangent, bitangent and normal, which are unit vectors at right angles to each other; else along the normal
    /// alone.
    pub is_vector: bool,
    /// Empty of what is constant.
    pub program: Program,
    /// Textures by number, sets of texture coordinates, primvars. Tangents follow the first set.
    pub uses: MaterialUses,
}

impl DisplacementProgram {
    /// Whether tangent or bitangent matter.
    #[must_use]
    pub fn has_tangents(&self) -> bool {
        let tangents = [Geometry::Tangent, Geometry::Bitangent].map(|geometry| geometry as u16);
        let reads = |step: &Instruction| step.op == Op::Surface && tangents.contains(&step.immediate);
        self.is_vector || self.program.instructions.iter().any(reads)
    }
}

/// Translates what the displacement terminal of a network says; `None` where it moves nothing or is not understood.
/// Beside it what is not understood, one line each.
#[must_use]
pub fn translate_displacement(network: &Network, library: &NodeLibrary) -> (Option<DisplacementProgram>, Vec<String>) {
    let Some(node) = network.displacement else { return (None, Vec::new()) };
    if network.nodes.len() > MAX_NODES || node >= network.nodes.len() {
        return (None, vec!["there is no displacement, or too many nodes".to_owned()]);
    }
    let mut walker = NetworkWalker::new(network, library);
    walker.is_displacing = true;
    let mut reader = DisplacementReader { walker, shaders: HashMap::new() };
    let shift = reader.shader(NetworkWalker::terminal(node), 0);
    let NetworkWalker { expressions, mut uses, mut problems, .. } = reader.walker;
    let Some(DisplacementShader { value, is_vector }) = shift else { return (None, problems) };
    let width = if is_vector { 3 } else { 1 };
    if value.is(0.0, width) {
        return (None, problems);
    }
    let mut assembler = ProgramAssembler::new(&expressions, &uses.lookups, MAX_LOOKUPS);
    let offset = match value.constant() {
        Some(value) => Ok(DisplacementOffset::Constant(value.map(number))),
        None => assembler.compile_one(value).map(DisplacementOffset::Register),
    };
    let program = assembler.program;
    let offset = match offset {
        // The line about it is there.
        Ok(_) if reads_the_unknown(&program) => return (None, problems),
        Ok(offset) => offset,
        Err(what) => {
            problems.push(format!("the patterns of the displacement have {what}: there is none"));
            return (None, problems);
        }
    };
    let mut found = DisplacementProgram { offset, is_vector, program, uses: MaterialUses::default() };
    if found.has_tangents() && uses.uv_sets.is_empty() {
        uses.uv_sets.push(DEFAULT_SET.into());
    }
    found.uses = uses;
    (Some(found), problems)
}

/// Whether it reads what no vertex has.
fn reads_the_unknown(program: &Program) -> bool {
    let view = Geometry::ViewDirection as u16;
    let is_view = |step: &Instruction| step.op == Op::Surface && step.immediate == view;
    program.is_random() || program.instructions.iter().any(is_view)
}

/// A displacement shader.
#[derive(Clone, Copy)]
struct DisplacementShader {
    value: Val,
    is_vector: bool,
}

struct DisplacementReader<'a> {
    walker: NetworkWalker<'a>,
    /// Each is worked out once, however many read it; `None`: it is being worked out.
    shaders: HashMap<NodeAddress, Option<Option<DisplacementShader>>>,
}

impl DisplacementReader<'_> {
    /// A displacement shader, through graphs and mixtures.
    fn shader(&mut self, at: NodeAddress, depth: usize) -> Option<DisplacementShader> {
        match self.shaders.get(&at) {
            Some(Some(known)) => return *known,
            None if depth <= MAX_SHADERS => {}
            _ => {
                let path = self.walker.path(at);
                self.walker.problem(format!("displacements ({path}) are connected in a circle, or too deep"));
                return None;
            }
        }
        self.shaders.insert(at, None);
        let found = self.shader_of(at, depth);
        self.shaders.insert(at, Some(found));
        found
    }

    fn shader_of(&mut self, at: NodeAddress, depth: usize) -> Option<DisplacementShader> {
        let category = self.walker.category(at);
        let is_shader = |(.., name): &(_, _, std::sync::Arc<str>)| &**name == SHADER;
        let definition = self.walker.definition(at);
        if definition.is_some_and(|definition| definition.outputs.first().is_some_and(is_shader)) {
            match &*category {
                "displacement" => return Some(self.displacement(at)),
                "mix" => return self.mixed(at, depth),
                "dot" => return self.input(at, "in", depth),
                _ => {
                    if let Some(inner) = self.walker.implementation(at) {
                        return self.shader(inner, depth + 1);
                    }
                }
            }
        }
        let path = self.walker.path(at);
        self.walker.problem(format!("displacement by nodes of kind `{category}` ({path}) is not supported"));
        None
    }

    fn input(&mut self, at: NodeAddress, name: &str, depth: usize) -> Option<DisplacementShader> {
        let source = self.walker.source_node(at, name)?;
        self.shader(source, depth + 1)
    }

    fn displacement(&mut self, at: NodeAddress) -> DisplacementShader {
        let is_vector = self.walker.input_type(at, "displacement") == PortType::Vector3;
        let amount = self.walker.number_or(at, "displacement", 0.0);
        let scale = self.walker.number_or(at, "scale", 1.0);
        DisplacementShader { value: self.walker.expressions.multiply(amount, scale), is_vector }
    }

    /// A side that is not connected, or not understood, moves nothing. A number is a vector along the normal.
    fn mixed(&mut self, at: NodeAddress, depth: usize) -> Option<DisplacementShader> {
        let [back, front] = ["bg", "fg"].map(|name| self.input(at, name, depth));
        let is_vector = [back, front].iter().flatten().any(|shift| shift.is_vector);
        let e = &mut self.walker.expressions;
        let [back, front] = [back, front].map(|shift| match shift {
            Some(shift) if is_vector && !shift.is_vector => e.combine(&[Val::ZERO, Val::ZERO, shift.value]),
            shift => shift.map_or(Val::ZERO, |shift| shift.value),
        });
        let share = self.walker.number_or(at, "mix", 0.0);
        Some(DisplacementShader { value: self.walker.expressions.mix(back, front, share), is_vector })
    }
}
