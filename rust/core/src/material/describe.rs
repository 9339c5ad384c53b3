// SPDX-License-Identifier: Apache-2.0
//! A material as text, for people: its network as it arrived, what it was folded to, its programs and their cost, what
//! was left out. Pure.
//!
//! Names and texts come from scenes: each is shown without control characters, up to [`LONGEST_TEXT`] of it.

use oocpt_abi::{MaterialFlags, MaterialInput};
use oocpt_materialx::DisplacementOffset;
use oocpt_materialx::listing::{ListingNames, ProgramCost, formulas, instructions, numbers};
use oocpt_materialx::program::Program;
use serde::{Deserialize, Serialize};

use super::compile::{CompiledMaterial, MAX_NODES, NEUTRAL, compile};
use super::displacement::{Displacement, PatternDisplacement, PreviewDisplacement};
use super::materialx::is_materialx;
use super::{InputValue, Material, TextureRef};
use crate::desc::{MaterialDesc, NodeDesc, ParamValue};

/// Most characters of a text of the scene that are shown.
pub const LONGEST_TEXT: usize = 160;

/// A node of a network as it arrived.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct NodeText {
    /// Its path.
    pub path: String,
    /// Name of its definition.
    pub kind: String,
    /// What is authored and what is connected: `name = value`, `name <- /path.output`.
    pub inputs: Vec<String>,
}

/// What a program is and costs.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ProgramText {
    /// A line each; all are run for a hit.
    pub instructions: Vec<String>,
    /// Of these, noise.
    pub noises: usize,
    /// Registers of four floats that it writes.
    pub registers: usize,
    /// Constants.
    pub constants: usize,
    /// Texture lookups.
    pub lookups: usize,
}

/// A material as text.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct MaterialText {
    /// Path of the prim.
    pub path: String,
    /// Name of the definition of its surface; empty: there is none.
    pub surface: String,
    /// The surface is understood; else what shows it looks as if it had no material.
    pub is_understood: bool,
    /// The network.
    pub nodes: Vec<NodeText>,
    /// Values that several inputs read, `v1 = ...`, as formulas: before them.
    pub values: Vec<String>,
    /// Inputs of the BSDF that differ from what they are where nothing is said: name and constant, texture, primvar or
    /// formula.
    pub inputs: Vec<(String, String)>,
    /// How it displaces its surfaces; empty: not at all.
    pub displacement: String,
    /// Values that a displacement reads more than once, `v1 = ...`, as formulas.
    pub displacement_values: Vec<String>,
    /// What the renderer has to have for it.
    pub needs: Vec<String>,
    /// Works out the inputs that are formulas.
    pub program: ProgramText,
    /// Works out an opacity that is one; run for each candidate of a hit.
    pub opacity_program: ProgramText,
    /// Works out an emission that is one, for points of its meshes that light is asked for.
    pub emission_program: ProgramText,
    /// Works out a displacement that is one, for each vertex.
    pub displacement_program: ProgramText,
    /// Textures, and how they are read.
    pub textures: Vec<String>,
    /// Texture lookups of a hit, those of programs included.
    pub lookups: usize,
    /// What was left out, one line each.
    pub warnings: Vec<String>,
}

/// Compiles the network of `desc` and tells what became of it.
#[must_use]
pub fn describe(desc: &MaterialDesc) -> MaterialText {
    let compiled = compile(desc);
    let mut text = MaterialText {
        path: clean(&desc.path),
        surface: desc.surface.and_then(|at| desc.nodes.get(at)).map(|node| clean(&node.kind)).unwrap_or_default(),
        is_understood: compiled.material.is_some(),
        nodes: desc.nodes.iter().take(MAX_NODES).map(|node| node_text(desc, node)).collect(),
        textures: compiled.textures.iter().map(texture_text).collect(),
        warnings: compiled.problems.iter().map(|problem| clean_up_to(problem, 4 * LONGEST_TEXT)).collect(),
        ..MaterialText::default()
    };
    if let Some(material) = &compiled.material {
        fill(&mut text, material, &compiled, is_materialx(desc, desc.surface));
    }
    match compiled.displacement.as_deref() {
        Some(Displacement::Preview(preview)) => {
            text.displacement = input_text(&preview.amount, 1, &MaterialNames::displacing(preview));
        }
        Some(Displacement::Pattern(pattern)) => fill_displacement(&mut text, pattern),
        None => {}
    }
    text
}

/// What is told of a displacement by nodes of `MaterialX`.
fn fill_displacement(text: &mut MaterialText, pattern: &PatternDisplacement) {
    let reader = MaterialNames::of_pattern(pattern);
    let offset = match pattern.offset {
        DisplacementOffset::Constant(value) => numbers(&value, if pattern.is_vector { 3 } else { 1 }),
        DisplacementOffset::Register(register) => {
            let (values, roots) = formulas(&pattern.program, &[register], &reader);
            text.displacement_values = values;
            roots.into_iter().next().unwrap_or_default()
        }
    };
    let frame = if pattern.is_vector { " along tangent, bitangent and normal" } else { "" };
    text.displacement = format!("{offset}{frame}");
    text.displacement_program = program_text(&pattern.program, &reader);
    for told in pattern.textures.iter().map(texture_text) {
        if !text.textures.contains(&told) {
            text.textures.push(told);
        }
    }
}

/// What is told of a material that is understood.
fn fill(text: &mut MaterialText, material: &Material, compiled: &CompiledMaterial, is_slab: bool) {
    let reader = MaterialNames::new(material, compiled);
    text.needs = material.flags.iter_names().map(|(name, _)| name.to_owned()).collect();
    text.program = program_text(&material.program, &reader);
    text.opacity_program = program_text(&material.opacity_program, &reader);
    if let Some(emission) = &material.emission {
        text.emission_program = program_text(&emission.program, &reader);
    }
    let is_hair = material.flags.contains(MaterialFlags::HAIR);
    let by_program = |program, wanted: &dyn Fn(MaterialInput) -> bool| {
        let register = |name: &MaterialInput| match material.input(*name) {
            InputValue::Register(register) if wanted(*name) => Some((*name, *register)),
            _ => None,
        };
        let found: Vec<(MaterialInput, u8)> = MaterialInput::ALL.iter().filter_map(register).collect();
        let registers: Vec<u8> = found.iter().map(|(_, register)| *register).collect();
        let (values, roots) = formulas(program, &registers, &reader);
        (values, found.into_iter().map(|(name, _)| name).zip(roots).collect::<Vec<_>>())
    };
    let (values, mut roots) = by_program(&material.program, &|name| name != MaterialInput::Opacity);
    let (opacity_values, opacity_roots) = by_program(&material.opacity_program, &|name| name == MaterialInput::Opacity);
    text.values = values;
    // Of another program: their numbers are their own.
    let own = |line: &String| format!("opacity: {line}");
    text.values.extend(opacity_values.iter().map(own));
    roots.extend(opacity_roots);
    for name in MaterialInput::ALL {
        let Some(label) = label(name, is_hair) else { continue };
        let input = material.input(name);
        if is_neutral(input, name) && !(is_slab && is_basic(name)) {
            continue;
        }
        let formula = roots.iter().find(|(root, _)| *root == name).map(|(_, text)| text.clone());
        text.inputs.push((label, formula.unwrap_or_else(|| input_text(input, name.width(), &reader))));
    }
    if material.opacity_threshold > 0.0 {
        text.inputs.push(("opacity threshold".to_owned(), numbers(&[material.opacity_threshold; 4], 1)));
    }
    let direct = material.inputs.iter().filter(|input| matches!(input, InputValue::Texture { .. })).count();
    text.lookups = direct + text.program.lookups + text.opacity_program.lookups;
}

/// Whether it is what it is where nothing is said, as far as its components count.
fn is_neutral(input: &InputValue, name: MaterialInput) -> bool {
    match (input, &NEUTRAL[name as usize]) {
        (InputValue::Constant(value), InputValue::Constant(neutral)) => {
            value.iter().zip(neutral).take(name.width()).all(|(value, neutral)| value.to_bits() == neutral.to_bits())
        }
        _ => false,
    }
}

/// Told of every surface, whatever they are.
fn is_basic(name: MaterialInput) -> bool {
    matches!(
        name,
        MaterialInput::DiffuseColor | MaterialInput::Metallic | MaterialInput::Roughness | MaterialInput::Ior
    )
}

/// What an input is called; `None`: fibres do not have it.
fn label(name: MaterialInput, is_hair: bool) -> Option<String> {
    if is_hair {
        let label = match name {
            MaterialInput::DiffuseColor => "tint of R",
            MaterialInput::SpecularColor => "tint of TT",
            MaterialInput::TransmissionColor => "tint of TRT",
            MaterialInput::Anisotropy => "variance and scale of R, of TT",
            MaterialInput::ThinFilm => "variance and scale of TRT, tilt",
            MaterialInput::Absorption => "absorption by radius",
            MaterialInput::Ior => "ior",
            MaterialInput::EmissiveColor => "emissive color",
            MaterialInput::Opacity => "opacity",
            _ => return None,
        };
        return Some(label.to_owned());
    }
    // `DiffuseColor` is "diffuse color".
    let mut label = String::new();
    for letter in format!("{name:?}").chars() {
        if letter.is_ascii_uppercase() && !label.is_empty() {
            label.push(' ');
        }
        label.push(letter.to_ascii_lowercase());
    }
    Some(label)
}

/// Names of what a material reads.
struct MaterialNames<'a> {
    uv_sets: Vec<&'a str>,
    primvars: Vec<&'a str>,
    textures: &'a [TextureRef],
}

impl<'a> MaterialNames<'a> {
    fn new(material: &'a Material, compiled: &'a CompiledMaterial) -> Self {
        Self {
            uv_sets: material.uv_sets.iter().map(|set| &*set.name).collect(),
            primvars: material.primvars.iter().map(|slot| &*slot.name).collect(),
            textures: &compiled.textures,
        }
    }

    /// Of what displaces surfaces, which has a texture, coordinates or a primvar of its own.
    fn displacing(own: &'a PreviewDisplacement) -> Self {
        Self {
            uv_sets: own.uv.iter().map(|set| &*set.name).collect(),
            primvars: own.primvar.iter().map(|name| &**name).collect(),
            textures: own.texture.as_slice(),
        }
    }

    /// The same of a program.
    fn of_pattern(own: &'a PatternDisplacement) -> Self {
        Self {
            uv_sets: own.uv_sets.iter().map(|name| &**name).collect(),
            primvars: own.primvars.iter().map(|(name, _)| &**name).collect(),
            textures: &own.textures,
        }
    }
}

impl ListingNames for MaterialNames<'_> {
    fn uv_set(&self, set: usize) -> String {
        format!("uv \"{}\"", clean(self.uv_sets.get(set).copied().unwrap_or("?")))
    }

    fn primvar(&self, slot: usize) -> String {
        format!("primvar \"{}\"", clean(self.primvars.get(slot).copied().unwrap_or("?")))
    }

    fn texture(&self, texture: u32) -> String {
        // The name alone: where it is stands with the textures.
        let file = self.textures.get(texture as usize).map_or("?", |texture| &*texture.asset.authored);
        format!("\"{}\"", clean(file.rsplit('/').next().unwrap_or(file)))
    }
}

fn input_text(input: &InputValue, width: usize, reader: &MaterialNames<'_>) -> String {
    match input {
        InputValue::Constant(value) => numbers(value, width),
        InputValue::Texture { texture, channel, scale, bias, uv, transform } => {
            let mut text = format!("texture {}", reader.texture(*texture));
            if let Some(channel) = channel {
                text.push('.');
                text.push(char::from(*b"rgba".get(usize::from(*channel)).unwrap_or(&b'?')));
            }
            if scale.iter().take(width).any(|v| *v != 1.0) {
                text += &format!(" * {}", numbers(scale, width));
            }
            if bias.iter().take(width).any(|v| *v != 0.0) {
                text += &format!(" + {}", numbers(bias, width));
            }
            match uv {
                Some(set) => text += &format!(" at {}", reader.uv_set(usize::from(*set))),
                None => text += " at a fixed place",
            }
            if *transform != [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] && uv.is_some() {
                let row = |row: &[f32; 3]| numbers(&[row[0], row[1], row[2], 0.0], 3);
                text += &format!(" mapped by {} {}", row(&transform[0]), row(&transform[1]));
            }
            text
        }
        InputValue::Primvar { slot, fallback } => {
            format!("{}, else {}", reader.primvar(usize::from(*slot)), numbers(fallback, width))
        }
        InputValue::Register(register) => format!("r{register}"),
    }
}

fn program_text(program: &Program, reader: &MaterialNames<'_>) -> ProgramText {
    let ProgramCost { noises, registers, constants, lookups, .. } = ProgramCost::of(program);
    ProgramText { instructions: instructions(program, reader), noises, registers, constants, lookups }
}

fn texture_text(texture: &TextureRef) -> String {
    let TextureRef { prim, asset, wrap: [s, t], color_space, is_ptex, .. } = texture;
    let place = if *is_ptex { "by face".to_owned() } else { format!("{s:?}, {t:?}").to_ascii_lowercase() };
    let space = clean(&format!("{color_space:?}")).to_ascii_lowercase();
    let found = if asset.resolved.is_empty() { "; not found" } else { "" };
    format!("\"{}\" of {}, {place}, {space}{found}", clean(&asset.authored), clean(prim))
}

fn node_text(desc: &MaterialDesc, node: &NodeDesc) -> NodeText {
    let params = node.params.iter().map(|param| format!("{} = {}", clean(&param.name), value_text(&param.value)));
    let connections = node.connections.iter().map(|connection| {
        let from = desc.nodes.get(connection.node).map_or_else(|| "?".to_owned(), |node| clean(&node.path));
        format!("{} <- {from}.{}", clean(&connection.input), clean(&connection.output))
    });
    NodeText { path: clean(&node.path), kind: clean(&node.kind), inputs: params.chain(connections).collect() }
}

fn value_text(value: &ParamValue) -> String {
    match value {
        ParamValue::Bool(flag) => flag.to_string(),
        ParamValue::Int(number) => number.to_string(),
        ParamValue::Float(number) => numbers(&[*number; 4], 1),
        // Each component, also where they are the same: the type is seen.
        ParamValue::Vec2(v) => components(v),
        ParamValue::Vec3(v) => components(v),
        ParamValue::Vec4(v) => components(v),
        ParamValue::Text(text) => format!("\"{}\"", clean(text)),
        ParamValue::Asset(asset) => format!("@{}@", clean(&asset.authored)),
    }
}

fn components(values: &[f32]) -> String {
    let numbers: Vec<String> = values.iter().map(|v| numbers(&[*v; 4], 1)).collect();
    format!("({})", numbers.join(", "))
}

fn clean(text: &str) -> String {
    clean_up_to(text, LONGEST_TEXT)
}

/// Text of a scene as it may be shown.
fn clean_up_to(text: &str, longest: usize) -> String {
    let mut clean: String = text.chars().filter(|c| !c.is_control()).take(longest).collect();
    if text.chars().nth(longest).is_some() {
        clean.push_str("...");
    }
    clean
}
