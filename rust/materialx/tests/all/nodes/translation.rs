// SPDX-License-Identifier: Apache-2.0
//! The results of our translation for a row of a table, in three ways: inputs that are set, which are folded; inputs
//! that a program reads, from texels and from the geometry; and inputs that are not set.

use oocpt_materialx::eval::run;
use oocpt_materialx::library::NodeLibrary;
use oocpt_materialx::network::{Network, NetworkNode};
use oocpt_materialx::program::{Geometry, ProgramLookup};
use oocpt_materialx::surface::Input;
use oocpt_materialx::uses::MaterialUses;
use oocpt_materialx::value::{FileRef, PortType, PortValue};
use oocpt_materialx::{InputSource, TranslatedNetwork, translate};

use super::table::{Block, Column, width};

/// The way in which a node gets its inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Way {
    Said,
    Read,
    /// Inputs are not set; only for rows of defaults.
    Unsaid,
}

/// Textures that a program can read, less those that a node has of its own.
const MAX_TEXTURES: usize = 9;
/// The texture of a node's own.
const TEXTURE: &str = "the texture";

/// Columns, and the offsets of their numbers in a row.
fn placed(block: &Block) -> Vec<(&Column, usize)> {
    let columns = block.inputs.iter().chain(&block.geometry);
    let starts = columns.clone().scan(0, |next, column| {
        let at = *next;
        *next += column.width;
        Some(at)
    });
    columns.zip(starts).collect()
}

fn value(kind: &str, numbers: &[f32]) -> PortValue {
    let side = match kind {
        "matrix33" => 3,
        "matrix44" => 4,
        _ if numbers.len() == 1 => return PortValue::Numbers([numbers[0]; 4]),
        _ => return PortValue::Numbers(std::array::from_fn(|k| numbers.get(k).copied().unwrap_or_default())),
    };
    let at = |row: usize, k: usize| if row.max(k) < side { numbers[row * side + k] } else { 0.0 };
    PortValue::Matrix(std::array::from_fn(|row| std::array::from_fn(|k| at(row, k))))
}

fn file(name: &str) -> PortValue {
    PortValue::File(FileRef {
        authored: name.into(),
        resolved: name.into(),
        color_space: None,
        node: "/m/image".into(),
    })
}

fn node(kind: &str) -> NetworkNode {
    NetworkNode { path: format!("/m/{kind}").into(), kind: kind.into(), values: Vec::new(), connections: Vec::new() }
}

/// The network of a row: its surface, the node, a node that selects `component` of its output, and the inputs.
fn network(block: &Block, row: &[f32], way: Way, component: Option<usize>, library: &NodeLibrary) -> Network {
    let mut surface = node("ND_open_pbr_surface_surfaceshader");
    surface.values.push(("base_weight".into(), PortValue::Numbers([1.0; 4])));
    let mut tested = node(&block.definition);
    tested
        .values
        .extend(block.texts.iter().map(|(name, text)| (name.as_str().into(), PortValue::Text(text.as_str().into()))));
    if let Some(definition) = library.definition(&block.definition) {
        let files = definition.inputs.iter().filter(|input| input.ty == PortType::File);
        tested.values.extend(files.map(|input| (input.name.clone(), file(TEXTURE))));
    }
    // The place of the lookup is not an affine map, so that a single texel is not a texture of the surface.
    let mut squared = node("ND_multiply_vector2");
    squared.connections = vec![("in1".into(), 3, "out".into()), ("in2".into(), 3, "out".into())];
    let mut nodes = vec![surface, tested, squared, node("ND_texcoord_vector2")];
    let said = if way == Way::Unsaid { 0 } else { block.inputs.len() };
    for (column, at) in placed(block).into_iter().take(said) {
        let name = column.name.as_str();
        let numbers = &row[at..at + column.width];
        let is_matrix = column.kind.starts_with("matrix");
        let is_read = way == Way::Read && !column.is_uniform && !is_matrix;
        if is_read && column.default.is_some() {
            continue;
        }
        if is_read && nodes.len() < 4 + MAX_TEXTURES {
            let kind = if column.width == 1 { "float" } else { &column.kind };
            let mut image = node(&format!("ND_image_{kind}"));
            image.values.push(("file".into(), file(name)));
            image.connections.push(("texcoord".into(), 2, "out".into()));
            let image_at = nodes.len();
            nodes[1].connections.push((name.into(), image_at, "out".into()));
            nodes.push(image);
        } else {
            nodes[1].values.push((name.into(), value(&column.kind, numbers)));
        }
    }
    let mut from = (1, block.output.as_str());
    if let Some(component) = component {
        let mut extract = node(&format!("ND_extract_{}", block.kind));
        extract.values.push(("index".into(), PortValue::Numbers([component as f32; 4])));
        extract.connections.push(("in".into(), 1, block.output.as_str().into()));
        from = (nodes.len(), "out");
        nodes.push(extract);
    }
    nodes[0].connections.push(("base_color".into(), from.0, from.1.into()));
    Network { nodes, ..Network::default() }
}

#[expect(clippy::cast_possible_truncation, reason = "rounding is meant")]
fn unit(v: [f32; 4]) -> [f32; 4] {
    let v = v.map(f64::from);
    let length = v.iter().take(3).map(|x| x * x).sum::<f64>().sqrt();
    if length == 0.0 { [0.0; 4] } else { v.map(|x| (x / length) as f32) }
}

/// The names of a property of the geometry: that of a default, and those that shaders have.
fn names(what: Geometry, uses: &MaterialUses) -> Vec<String> {
    let listed = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    let set = |slot: usize| match uses.uv_sets.get(slot).map(|name| &**name) {
        Some("st") => listed(&["UV0", "texcoord_0"]),
        Some(name) => vec![format!("i_geomprop_{name}")],
        None => Vec::new(),
    };
    let primvar = |slot: usize| match uses.primvars.get(slot).map(|primvar| &*primvar.name) {
        Some(MaterialUses::POSITION) => listed(&["Pobject", "positionObject"]),
        Some(MaterialUses::NORMAL) => listed(&["Nobject", "normalObject"]),
        Some("displayColor") => listed(&["color_0"]),
        Some(name) => vec![format!("i_geomprop_{name}")],
        None => Vec::new(),
    };
    match what {
        Geometry::Uv0 => set(0),
        Geometry::Uv1 => set(1),
        Geometry::Primvar0 => primvar(0),
        Geometry::Primvar1 => primvar(1),
        Geometry::Position => listed(&["Pworld", "positionWorld"]),
        Geometry::Normal => listed(&["Nworld", "normalWorld"]),
        Geometry::Tangent => listed(&["Tworld", "tangentWorld", "tangentObject"]),
        Geometry::Bitangent => listed(&["Bworld", "bitangentWorld", "bitangentObject"]),
        Geometry::ViewDirection => listed(&["Vworld", "positionWorld"]),
        _ => Vec::new(),
    }
}

/// The surface of a row.
fn seen(block: &Block, row: &[f32], way: Way, uses: &MaterialUses, what: Geometry) -> [f32; 4] {
    let names = names(what, uses);
    for (column, at) in placed(block) {
        let is_input = !column.kind.is_empty();
        if is_input && way == Way::Said {
            continue; // it is said, so that the surface must not be asked
        }
        let name = if is_input { column.default.as_ref() } else { Some(&column.name) };
        if !name.is_some_and(|name| names.contains(name)) {
            continue;
        }
        let numbers = &row[at..at + column.width];
        let found = std::array::from_fn(|k| numbers.get(k).copied().unwrap_or_default());
        // Shaders make unit vectors of directions that they are given, and the viewer is at the origin.
        let is_direction = ["normal", "tangent", "bitangent"].iter().any(|start| column.name.starts_with(start));
        return if !is_input && (is_direction || what == Geometry::ViewDirection) { unit(found) } else { found };
    }
    [0.375, -0.625, 0.875, 0.125] // nothing of the row
}

/// A texel of a row: an input, or the formula of `tests/reference/node_shaders.py`.
fn texel(
    block: &Block,
    row: &[f32],
    way: Way,
    uses: &MaterialUses,
    lookup: &ProgramLookup,
    place: Option<[f32; 2]>,
) -> [f32; 4] {
    let name = uses.textures.get(lookup.texture as usize).map_or("", |texture| &*texture.file.authored);
    let texel = if name == TEXTURE {
        let set = lookup
            .uv
            .map_or([0.0; 4], |set| seen(block, row, way, uses, if set == 0 { Geometry::Uv0 } else { Geometry::Uv1 }));
        let mapped = lookup.transform.map(|[a, b, c]| a * set[0] + b * set[1] + c);
        let [u, v] = place.unwrap_or(mapped);
        [u, v, u * v, u - v]
    } else {
        let found = placed(block).into_iter().find(|(column, _)| column.name == name);
        let (column, at) = found.expect("an input of the node");
        std::array::from_fn(|k| if k < column.width { row[at + k] } else { 0.0 })
    };
    std::array::from_fn(|k| texel[k] * lookup.scale[k] + lookup.bias[k])
}

fn color(block: &Block, row: &[f32], way: Way, translation: &TranslatedNetwork) -> Option<[f32; 4]> {
    let uses = &translation.uses;
    let surface = |what: Geometry| seen(block, row, way, uses, what);
    let look = |lookup: &ProgramLookup, place: Option<[f32; 2]>| texel(block, row, way, uses, lookup, place);
    Some(match translation.inputs?[Input::DiffuseColor as usize] {
        InputSource::Constant(value) => value,
        InputSource::Register(register) => run(&translation.program, surface, look)[usize::from(register)],
        InputSource::Primvar(0) => surface(Geometry::Primvar0),
        InputSource::Primvar(_) => surface(Geometry::Primvar1),
        InputSource::Texture(lookup, channel) => {
            let found = look(&lookup, None);
            channel.map_or(found, |channel| [found[usize::from(channel)]; 4])
        }
    })
}

/// The result of the node for a row, or the unsupported part.
pub(crate) fn value_of(block: &Block, row: &[f32], way: Way, library: &NodeLibrary) -> Result<Vec<f32>, String> {
    let one = |component: Option<usize>| {
        let translation = translate(&network(block, row, way, component, library), library);
        if let Some(problem) = translation.problems.first() {
            return Err(problem.clone());
        }
        color(block, row, way, &translation).ok_or_else(|| "no surface".to_owned())
    };
    let width = width(&block.kind);
    let mut value = one(None)?[..width.min(3)].to_vec();
    if width == 4 {
        value.push(one(Some(3))?[0]);
    }
    Ok(value)
}
