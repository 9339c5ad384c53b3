// SPDX-License-Identifier: Apache-2.0
//! Networks of `MaterialX` nodes made into materials, through the crate `oocpt-materialx`.
//!
//! The definitions of nodes come from `MaterialX`'s data libraries, which are read once for a process
//! ([`oocpt_materialx::library::standard`]), and from files that nodes name, which are read when they change
//! ([`definitions`]); but for that, pure.

mod definitions;

use oocpt_abi::{MaterialFlags, MaterialInput, SHARP_ROUGHNESS};
use std::sync::Arc;

use oocpt_materialx::library::standard;
use oocpt_materialx::network::{Network, NetworkNode};
use oocpt_materialx::uses::{AddressMode, MaterialTexture};
use oocpt_materialx::value::{FileRef, PortValue};
use oocpt_materialx::{DisplacementOffset, InputSource, TranslatedNetwork, translate, translate_displacement};

use super::compile::{CompiledMaterial, MAX_NODES, needs};
use super::displacement::{Displacement, PatternDisplacement};
use super::params::ProblemList;
use super::spaces::{linear_from_srgb, named};
use super::{ColorSpace, InputValue, Material, PrimvarSlot, TextureRef, UvSet, Wrap};
use crate::desc::{AssetRef, MaterialDesc, NodeDesc, ParamValue};

/// What the kinds of `MaterialX` nodes begin with, in their namespace.
const PREFIX: &str = "ND_";

/// Whether a terminal of a network is a node of `MaterialX`.
pub(super) fn is_materialx(desc: &MaterialDesc, terminal: Option<usize>) -> bool {
    let Some(node) = terminal.and_then(|at| desc.nodes.get(at)) else { return false };
    let name = node.kind.rsplit(':').next().unwrap_or_default();
    // Who defines a node of one's own may call it otherwise.
    name.starts_with(PREFIX)
        || definitions::of_node(node).is_some()
        || !node.kind.is_empty() && !node.kind.starts_with("Usd") && standard().definition(&node.kind).is_some()
}

/// Reads the terminals of a network that are such nodes.
pub(super) fn compile(desc: &MaterialDesc, problems: &mut ProblemList) -> CompiledMaterial {
    let library = standard();
    if library.is_empty() {
        problems.add("MaterialX's data libraries were not found (PXR_MTLX_STDLIB_SEARCH_PATHS)".to_owned());
        return CompiledMaterial::default();
    }
    if desc.nodes.len() > MAX_NODES {
        problems.add(format!("{} nodes are more than the {MAX_NODES} that are supported", desc.nodes.len()));
        return CompiledMaterial::default();
    }
    let network = Network {
        nodes: desc.nodes.iter().map(node).collect(),
        surface: desc.surface.unwrap_or(usize::MAX),
        displacement: desc.displacement,
    };
    let own = definitions::own(desc, library);
    let library = match &own {
        Some(own) => {
            own.problems().iter().for_each(|problem| problems.add(format!("node definitions: {problem}")));
            own
        }
        None => library,
    };
    let mut compiled = CompiledMaterial::default();
    if is_materialx(desc, desc.surface) {
        let translation = translate(&network, library);
        translation.problems.iter().for_each(|problem| problems.add(problem.clone()));
        compiled.textures = translation.uses.textures.iter().map(texture).collect();
        compiled.material = material(&translation);
    }
    if is_materialx(desc, desc.displacement) {
        let (found, notes) = translate_displacement(&network, library);
        notes.into_iter().for_each(|problem| problems.add(problem));
        compiled.displacement = found.map(|found| Arc::new(displacement(found)));
    }
    compiled
}

fn displacement(found: oocpt_materialx::DisplacementProgram) -> Displacement {
    let has_tangents = found.has_tangents();
    let oocpt_materialx::DisplacementProgram { offset, is_vector, program, uses } = found;
    match offset {
        DisplacementOffset::Constant(value) if !is_vector => Displacement::along_normals(value),
        _ => Displacement::Pattern(PatternDisplacement {
            offset,
            is_vector,
            has_tangents,
            program,
            textures: uses.textures.iter().map(texture).collect(),
            uv_sets: uses.uv_sets,
            primvars: uses.primvars.into_iter().map(|primvar| (primvar.name, primvar.fallback)).collect(),
        }),
    }
}

fn node(desc: &NodeDesc) -> NetworkNode {
    NetworkNode {
        path: Arc::clone(&desc.path),
        kind: Arc::clone(&desc.kind),
        values: desc
            .params
            .iter()
            .filter_map(|param| Some((Arc::clone(&param.name), value_of(desc, &param.name, &param.value)?)))
            .collect(),
        connections: desc.connections.iter().map(|c| (Arc::clone(&c.input), c.node, Arc::clone(&c.output))).collect(),
    }
}

/// The value of an input; a colour in the sRGB curve is made linear.
fn value_of(node: &NodeDesc, name: &str, value: &ParamValue) -> Option<PortValue> {
    let space = || {
        let wanted = format!("colorSpace:{name}");
        node.params.iter().find_map(|param| match &param.value {
            ParamValue::Text(text) if *param.name == *wanted => Some(Arc::clone(text)),
            _ => None,
        })
    };
    #[expect(clippy::cast_possible_truncation, reason = "rounded to single precision")]
    let linear = |v: f32| linear_from_srgb(f64::from(v)) as f32;
    #[expect(clippy::cast_precision_loss, reason = "integers of nodes are small")]
    let mut numbers = match value {
        ParamValue::Bool(flag) => [f32::from(u8::from(*flag)); 4],
        ParamValue::Int(number) => [*number as f32; 4],
        ParamValue::Float(number) => [*number; 4],
        ParamValue::Vec2([x, y]) => [*x, *y, 0.0, 0.0],
        ParamValue::Vec3([x, y, z]) => [*x, *y, *z, 0.0],
        ParamValue::Vec4(v) => *v,
        ParamValue::Text(text) => return Some(PortValue::Text(Arc::clone(text))),
        ParamValue::Asset(asset) => {
            return Some(PortValue::File(FileRef {
                authored: Arc::clone(&asset.authored),
                resolved: Arc::clone(&asset.resolved),
                color_space: space(),
                node: Arc::clone(&node.path),
            }));
        }
    };
    if !numbers.iter().all(|number| number.is_finite()) {
        return None;
    }
    if matches!(value, ParamValue::Vec3(_) | ParamValue::Vec4(_))
        && space().is_some_and(|s| named(&s) == ColorSpace::Srgb)
    {
        numbers.iter_mut().take(3).for_each(|v| *v = linear(*v));
    }
    Some(PortValue::Numbers(numbers))
}

fn texture(texture: &MaterialTexture) -> TextureRef {
    let MaterialTexture { file, address, fallback, has_border, auto_color_space } = texture;
    let wrap = address.map(|mode| match mode {
        AddressMode::Constant => Wrap::Black,
        AddressMode::Clamp => Wrap::Clamp,
        AddressMode::Periodic => Wrap::Repeat,
        AddressMode::Mirror => Wrap::Mirror,
        AddressMode::UseMetadata => Wrap::UseMetadata,
    });
    // A file that says nothing is linear: the working space of a document is.
    let default = if *auto_color_space { ColorSpace::Auto } else { ColorSpace::Raw };
    let color_space = match file.color_space.as_deref().map(named) {
        None | Some(ColorSpace::Auto) => default,
        Some(space) => space,
    };
    TextureRef {
        prim: Arc::clone(&file.node),
        asset: AssetRef { authored: Arc::clone(&file.authored), resolved: Arc::clone(&file.resolved) },
        wrap,
        color_space,
        fallback: *fallback,
        has_border: *has_border,
        is_ptex: false,
    }
}

/// Anisotropy, a film, and what is inside of what transmits.
fn inside(
    inputs: &[InputValue; MaterialInput::COUNT],
    transmits: bool,
    translation: &TranslatedNetwork,
) -> MaterialFlags {
    let is_thin = translation.thin_walled;
    let constant = |name: MaterialInput| match inputs[name as usize] {
        InputValue::Constant(value) => Some(value),
        _ => None,
    };
    let is_even = constant(MaterialInput::Anisotropy).is_some_and(|[a, _, b, _]| a >= 1.0 && b >= 1.0);
    // Without a weight or a thickness there is none.
    let is_bare =
        constant(MaterialInput::ThinFilm).is_some_and(|[weight, thickness, ..]| weight <= 0.0 || thickness <= 0.0);
    let is_clear = constant(MaterialInput::Absorption).is_some_and(|value| value.iter().take(3).all(|a| *a <= 0.0));
    let mut flags = MaterialFlags::empty();
    flags.set(MaterialFlags::ANISOTROPIC, !is_even);
    flags.set(MaterialFlags::THIN_FILM, !is_bare);
    flags.set(MaterialFlags::THIN_WALLED, transmits && is_thin);
    flags.set(MaterialFlags::ABSORBING, transmits && !is_thin && !is_clear);
    flags.set(MaterialFlags::DISPERSIVE, transmits && !is_thin && translation.dispersive);
    flags
}

/// What its programs ask for.
fn by_programs(translation: &TranslatedNetwork) -> MaterialFlags {
    let TranslatedNetwork { program, opacity_program, .. } = translation;
    let is_cut_out = !opacity_program.instructions.is_empty();
    let mut flags = MaterialFlags::empty();
    flags.set(MaterialFlags::PATTERNS, is_cut_out || !program.instructions.is_empty());
    flags.set(MaterialFlags::CUTOUT_PROGRAM, is_cut_out);
    flags.set(MaterialFlags::MIXTURE, program.is_random());
    flags.set(MaterialFlags::TEXTURED, !program.lookups.is_empty() || !opacity_program.lookups.is_empty());
    flags
}

fn material(translation: &TranslatedNetwork) -> Option<Material> {
    let sources = translation.inputs?;
    let inputs = sources.map(|source| match source {
        InputSource::Constant(value) => InputValue::Constant(value),
        InputSource::Texture(lookup, channel) => InputValue::Texture {
            texture: lookup.texture,
            channel,
            scale: lookup.scale,
            bias: lookup.bias,
            uv: lookup.uv,
            transform: lookup.transform,
        },
        InputSource::Primvar(slot) => {
            let fallback =
                translation.uses.primvars.get(usize::from(slot)).map_or([0.0; 4], |primvar| primvar.fallback);
            InputValue::Primvar { slot, fallback }
        }
        InputSource::Register(register) => InputValue::Register(register),
    });
    let input = |name: MaterialInput| &inputs[name as usize];
    let is_more = |name: MaterialInput, than: f32| match input(name) {
        InputValue::Constant([x, y, z, _]) => *x > than || *y > than || *z > than,
        _ => true,
    };
    let is_clear = !matches!(input(MaterialInput::Opacity), InputValue::Constant([value, ..]) if *value >= 1.0);
    let transmits = is_more(MaterialInput::Transmission, 0.0);
    let rough = is_more(MaterialInput::Roughness, SHARP_ROUGHNESS)
        || is_more(MaterialInput::Clearcoat, 0.0) && is_more(MaterialInput::ClearcoatRoughness, SHARP_ROUGHNESS);
    let mut flags = needs(&inputs) | inside(&inputs, transmits, translation) | MaterialFlags::OPEN_PBR;
    flags.set(MaterialFlags::SPECULAR_WORKFLOW, translation.specular_workflow);
    flags.set(MaterialFlags::PRESENCE, is_clear);
    flags.set(MaterialFlags::TRANSMISSIVE, transmits);
    flags.set(MaterialFlags::ROUGH_TRANSMISSION, transmits && rough);
    flags.set(MaterialFlags::SHEEN, is_more(MaterialInput::SheenColor, 0.0));
    flags.set(MaterialFlags::ROUGH_DIFFUSE, is_more(MaterialInput::DiffuseRoughness, 0.0));
    flags.set(MaterialFlags::FRAMED_NORMAL, translation.framed_normal);
    if translation.hair {
        // Its inputs of these names mean something else.
        flags -= MaterialFlags::ANISOTROPIC | MaterialFlags::THIN_FILM | MaterialFlags::NORMAL_MAP;
        flags |= MaterialFlags::HAIR;
    }
    flags |= by_programs(translation);
    let set = |name: &Arc<str>| UvSet { name: Arc::clone(name), id: 0, fallback: [0.0; 2] };
    Some(Material {
        flags,
        inputs,
        opacity_threshold: translation.opacity_threshold,
        uv_sets: translation.uses.uv_sets.iter().map(set).collect(),
        primvars: translation
            .uses
            .primvars
            .iter()
            .map(|primvar| PrimvarSlot { name: Arc::clone(&primvar.name), id: 0, fallback: primvar.fallback })
            .collect(),
        program: translation.program.clone(),
        opacity_program: translation.opacity_program.clone(),
        emission: translation.emission.clone(),
    })
}
