// SPDX-License-Identifier: Apache-2.0
//! Describes a material as text for users: its network as it arrived, its inputs after folding, its programs and their
//! cost, and the parts that were left out. Pure.
//!
//! Names and texts come from scenes: each is shown without control characters, up to [`MAX_TEXT_CHARS`] of it.

use oocpt_abi::{MaterialFlags, MaterialInput};
use oocpt_materialx::DisplacementOffset;
use oocpt_materialx::listing::{ListingNames, ProgramCost, formulas, instructions, numbers};
use oocpt_materialx::program::Program;
use serde::{Deserialize, Serialize};

use super::compile::compile;
use super::compiled::CompiledMaterial;
use super::compiler::MAX_NODES;
use super::displacement::{Displacement, PatternDisplacement, PreviewDisplacement};
use super::inputs::NEUTRAL;
use super::materialx::is_materialx;
use super::{InputValue, Material, TextureRef};
use crate::desc::{MaterialDesc, NodeDesc, ParamValue};

/// Most characters of a text of the scene that are shown.
pub const MAX_TEXT_CHARS: usize = 160;

/// A node of a network as it arrived.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct NodeText {
    /// Path of the node.
    pub path: String,
    /// Name of its definition.
    pub kind: String,
    /// Authored and connected inputs: `name = value`, `name <- /path.output`.
    pub inputs: Vec<String>,
}

/// Listing and cost of a program.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct ProgramText {
    /// Instructions, one line each; all are executed for a hit.
    pub instructions: Vec<String>,
    /// Number of noise instructions among these.
    pub noises: usize,
    /// Number of registers of four floats that it writes.
    pub registers: usize,
    /// Number of constants.
    pub constants: usize,
    /// Number of texture lookups.
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
    /// True if the surface was compiled; else prims are shown as if they had no material.
    pub is_understood: bool,
    /// Nodes of the network.
    pub nodes: Vec<NodeText>,
    /// Values that several inputs read, `v1 = ...`, as formulas; listed before the inputs.
    pub values: Vec<String>,
    /// Inputs of the BSDF that differ from their defaults: name and constant, texture, primvar or formula.
    pub inputs: Vec<(String, String)>,
    /// Description of its displacement; empty if there is none.
    pub displacement: String,
    /// Values that a displacement reads more than once, `v1 = ...`, as formulas.
    pub displacement_values: Vec<String>,
    /// Features that the renderer needs for it.
    pub needs: Vec<String>,
    /// Program that computes the inputs that are formulas.
    pub program: ProgramText,
    /// Program that computes the opacity, if that is a formula; it runs for each candidate of a hit.
    pub opacity_program: ProgramText,
    /// Program that computes the emission, if that is a formula, for points on its meshes that are sampled as lights.
    pub emission_program: ProgramText,
    /// Program that computes the displacement of each vertex, if the displacement is one.
    pub displacement_program: ProgramText,
    /// Textures and the way they are read.
    pub textures: Vec<String>,
    /// Number of texture lookups of a hit, those of programs included.
    pub lookups: usize,
    /// Parts that were left out, one line each.
    pub warnings: Vec<String>,
}

/// Compiles the network of `desc` and describes the result.
#[must_use]
pub fn describe(desc: &MaterialDesc) -> MaterialText {
    let compiled = compile(desc);
    let mut text = MaterialText {
        path: clean(&desc.path),
        surface: desc.surface.and_then(|at| desc.nodes.get(at)).map(|node| clean(&node.kind)).unwrap_or_default(),
        is_understood: compiled.material.is_some(),
        nodes: desc.nodes.iter().take(MAX_NODES).map(|node| node_text(desc, node)).collect(),
        textures: compiled.textures.iter().map(texture_text).collect(),
        warnings: compiled.problems.iter().map(|problem| clean_up_to(problem, 4 * MAX_TEXT_CHARS)).collect(),
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

/// Fills in the description of a displacement by nodes of `MaterialX`.
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
    for described in pattern.textures.iter().map(texture_text) {
        if !text.textures.contains(&described) {
            text.textures.push(described);
        }
    }
}

/// Fills in the description of a material that was compiled.
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
    // Names of another program: its numbers are its own.
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

/// Returns true if an input has its default value, as far as its components are used.
fn is_neutral(input: &InputValue, name: MaterialInput) -> bool {
    match (input, &NEUTRAL[name as usize]) {
        (InputValue::Constant(value), InputValue::Constant(neutral)) => {
            value.iter().zip(neutral).take(name.width()).all(|(value, neutral)| value.to_bits() == neutral.to_bits())
        }
        _ => false,
    }
}

/// Returns true for inputs that are described for every surface, whatever their values.
fn is_basic(name: MaterialInput) -> bool {
    matches!(
        name,
        MaterialInput::DiffuseColor | MaterialInput::Metallic | MaterialInput::Roughness | MaterialInput::Ior
    )
}

/// Label of an input; `None` if fibres do not have it.
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
    // Turns `DiffuseColor` into "diffuse color".
    let mut label = String::new();
    for letter in format!("{name:?}").chars() {
        if letter.is_ascii_uppercase() && !label.is_empty() {
            label.push(' ');
        }
        label.push(letter.to_ascii_lowercase());
    }
    Some(label)
}

/// Names of the primvars and textures that a material reads.
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

    /// The names of a displacement, which has a texture, coordinates or a primvar of its own.
    fn displacing(own: &'a PreviewDisplacement) -> Self {
        Self {
            uv_sets: own.uv.iter().map(|set| &*set.name).collect(),
            primvars: own.primvar.iter().map(|name| &**name).collect(),
            textures: own.texture.as_slice(),
        }
    }

    /// The names that a displacement program reads.
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
        // Only the name: the path is listed with the textures.
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
        // Every component is written, also equal ones, so that the type can be seen.
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
    clean_up_to(text, MAX_TEXT_CHARS)
}

/// Text of a scene without control characters, cut to `longest`.
fn clean_up_to(text: &str, longest: usize) -> String {
    let mut clean: String = text.chars().filter(|c| !c.is_control()).take(longest).collect();
    if text.chars().nth(longest).is_some() {
        clean.push_str("...");
    }
    clean
}
