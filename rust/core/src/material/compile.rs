// SPDX-License-Identifier: Apache-2.0
//! The surface node of a network to a [`Material`]. Pure.

use oocpt_abi::{MaterialFlags, MaterialInput, SHARP_ROUGHNESS};
use std::sync::Arc;

use super::displacement::Displacement;
use super::materialx::{self, is_materialx};
use super::params::{NumberShape, ProblemList, connection, numbers, text};
use super::reader::READER;
use super::texture::is_texture;
use super::{InputValue, Material, PTEX_SET, PrimvarSlot, TextureRef, UvSet};
use crate::desc::{MaterialDesc, NodeDesc};
use oocpt_materialx::program::Program;

/// Most nodes of a network.
pub const MAX_NODES: usize = 4096;

/// What became of a network.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CompiledMaterial {
    /// The material; none where the surface cannot be understood: its meshes look as if they had none.
    pub material: Option<Material>,
    /// Textures by the numbers that the inputs have.
    pub textures: Vec<TextureRef>,
    /// How it displaces its surfaces, if it does.
    pub displacement: Option<Arc<Displacement>>,
    /// What was left out, one line each.
    pub problems: Vec<String>,
}

impl CompiledMaterial {
    /// One line about everything that was left out.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        (!self.problems.is_empty()).then(|| self.problems.join("; "))
    }
}

/// While a network is read.
pub(super) struct NetworkCompiler<'a> {
    pub(super) nodes: &'a [NodeDesc],
    pub(super) problems: ProblemList,
    pub(super) textures: Vec<TextureRef>,
    pub(super) uv_sets: Vec<UvSet>,
    pub(super) primvars: Vec<PrimvarSlot>,
}

/// Reads the network of `desc`.
#[must_use]
pub fn compile(desc: &MaterialDesc) -> CompiledMaterial {
    let mut problems = ProblemList::default();
    let [shaded, displaced] = [desc.surface, desc.displacement].map(|terminal| is_materialx(desc, terminal));
    let found = if shaded || displaced { materialx::compile(desc, &mut problems) } else { CompiledMaterial::default() };
    if shaded && (displaced || desc.displacement.is_none()) {
        return CompiledMaterial { problems: problems.lines(), ..found };
    }
    let mut compiler = NetworkCompiler {
        nodes: &desc.nodes,
        problems,
        textures: Vec::new(),
        uv_sets: Vec::new(),
        primvars: Vec::new(),
    };
    let displacement = if displaced { found.displacement } else { compiler.displacement(desc).map(Arc::new) };
    if shaded {
        return CompiledMaterial { displacement, problems: compiler.problems.lines(), ..found };
    }
    let material = compiler.surface(desc.surface);
    compiler.textures.iter_mut().for_each(|texture| texture.prim = desc.named(&texture.prim));
    let (textures, problems) = (compiler.textures, compiler.problems.lines());
    CompiledMaterial { material, textures, displacement, problems }
}

/// Name, shape and default of each input of a `UsdPreviewSurface`, by [`MaterialInput`].
const SURFACE: [(&str, NumberShape, [f32; 4]); 10] = [
    ("diffuseColor", NumberShape::Color, [0.18, 0.18, 0.18, 1.0]),
    ("emissiveColor", NumberShape::Color, [0.0, 0.0, 0.0, 1.0]),
    ("specularColor", NumberShape::Color, [0.0, 0.0, 0.0, 1.0]),
    ("metallic", NumberShape::Scalar, [0.0; 4]),
    ("roughness", NumberShape::Scalar, [0.5; 4]),
    ("clearcoat", NumberShape::Scalar, [0.0; 4]),
    ("clearcoatRoughness", NumberShape::Scalar, [0.01; 4]),
    ("opacity", NumberShape::Scalar, [1.0; 4]),
    ("ior", NumberShape::Scalar, [1.5; 4]),
    ("normal", NumberShape::Color, [0.0, 0.0, 1.0, 1.0]),
];

/// Inputs that say nothing. What `UsdPreviewSurface` has no name for keeps them.
pub(crate) const NEUTRAL: [InputValue; MaterialInput::COUNT] = {
    let mut inputs = [const { InputValue::Constant([0.0, 0.0, 0.0, 1.0]) }; MaterialInput::COUNT];
    inputs[MaterialInput::Opacity as usize] = InputValue::Constant([1.0; 4]);
    inputs[MaterialInput::Ior as usize] = InputValue::Constant([1.5; 4]);
    inputs[MaterialInput::Normal as usize] = InputValue::Constant([0.0, 0.0, 1.0, 1.0]);
    inputs[MaterialInput::TransmissionColor as usize] = InputValue::Constant([1.0; 4]);
    inputs[MaterialInput::CoatIor as usize] = InputValue::Constant([1.5; 4]);
    inputs[MaterialInput::SheenRoughness as usize] = InputValue::Constant([0.5; 4]);
    inputs[MaterialInput::Anisotropy as usize] = InputValue::Constant([1.0, 0.0, 1.0, 0.0]);
    inputs
};

impl<'a> NetworkCompiler<'a> {
    /// Notes that nodes of this kind are not understood. Hosts hand over no kind for nodes that they have no definition
    /// of, such as shaders in a language of a renderer.
    pub(super) fn unsupported(&mut self, node: &NodeDesc) {
        let (kind, path) = (&node.kind, &node.path);
        self.problems.add(if kind.is_empty() {
            format!("the host has no definition of {path}")
        } else {
            format!("nodes of kind `{kind}` ({path}) are not supported")
        });
    }

    fn surface(&mut self, surface: Option<usize>) -> Option<Material> {
        if self.nodes.len() > MAX_NODES {
            self.problems.add(format!("{} nodes are more than the {MAX_NODES} that are supported", self.nodes.len()));
            return None;
        }
        let Some(node) = surface.and_then(|at| self.nodes.get(at)) else {
            self.problems.add("there is no surface that is read (UsdPreviewSurface or MaterialX)".to_owned());
            return None;
        };
        if &*node.kind != "UsdPreviewSurface" {
            self.unsupported(node);
            return None;
        }
        let mut inputs = NEUTRAL;
        for (input, (name, shape, default)) in inputs.iter_mut().zip(SURFACE) {
            *input = self.input(node, name, shape, default);
        }
        let workflow = numbers(node, "useSpecularWorkflow", NumberShape::Scalar, [0.0; 4], &mut self.problems)[0];
        for name in ["useSpecularWorkflow", "opacityThreshold", "opacityMode"] {
            if connection(node, name).is_some() {
                self.problems.add(format!("`{name}` is connected, which is not supported"));
            }
        }
        let [threshold, ..] = numbers(node, "opacityThreshold", NumberShape::Scalar, [0.0; 4], &mut self.problems);
        let is_presence = match text(node, "opacityMode", &mut self.problems) {
            None | Some("transparent") => false,
            Some("presence") => true,
            Some(other) => {
                self.problems.add(format!("`opacityMode` cannot be `{other}`"));
                false
            }
        };
        let threshold = threshold.max(0.0);
        let opacity = &mut inputs[MaterialInput::Opacity as usize];
        if let (InputValue::Constant([value, ..]), true) = (&opacity, threshold > 0.0) {
            *opacity = InputValue::Constant([if *value < threshold { 0.0 } else { 1.0 }; 4]);
        }
        let is_clear = !matches!(opacity, InputValue::Constant([value, ..]) if *value >= 1.0);
        let mut flags = needs(&inputs);
        // A normal is told about the tangents of a set: of the first one, or of this.
        if flags.contains(MaterialFlags::NORMAL_MAP) && self.uv_sets.is_empty() {
            self.uv_sets.push(UvSet { name: "st".into(), id: 0, fallback: [0.0; 2] });
        }
        flags.set(MaterialFlags::PTEX, self.uv_sets.iter().any(|set| &*set.name == PTEX_SET));
        flags.set(MaterialFlags::SPECULAR_WORKFLOW, workflow != 0.0);
        flags.set(MaterialFlags::PRESENCE, is_clear && (is_presence || threshold > 0.0));
        flags.set(MaterialFlags::TRANSMISSIVE, is_clear && !is_presence && threshold <= 0.0);
        let is_rough = |name: MaterialInput| !matches!(&inputs[name as usize], InputValue::Constant([value, ..]) if *value < SHARP_ROUGHNESS);
        let rough = is_rough(MaterialInput::Roughness)
            || flags.contains(MaterialFlags::COAT) && is_rough(MaterialInput::ClearcoatRoughness);
        flags.set(MaterialFlags::ROUGH_TRANSMISSION, flags.contains(MaterialFlags::TRANSMISSIVE) && rough);
        Some(Material {
            flags,
            inputs,
            opacity_threshold: threshold,
            uv_sets: std::mem::take(&mut self.uv_sets),
            primvars: std::mem::take(&mut self.primvars),
            program: Program::default(),
            opacity_program: Program::default(),
            emission: None,
        })
    }

    /// One input: what it is connected to, else what is authored, else the default.
    pub(super) fn input(
        &mut self,
        node: &'a NodeDesc,
        name: &str,
        shape: NumberShape,
        default: [f32; 4],
    ) -> InputValue {
        if let Some(source) = connection(node, name) {
            let found = match self.nodes.get(source.node) {
                Some(next) if is_texture(next) => self.texture(next, &source.output),
                Some(next) if next.kind.starts_with(READER) => self.reader(next),
                Some(next) => {
                    self.unsupported(next);
                    None
                }
                None => {
                    self.problems.add(format!("`{name}` is connected to nothing"));
                    None
                }
            };
            if let Some(input) = found {
                return input;
            }
        }
        InputValue::Constant(numbers(node, name, shape, default, &mut self.problems))
    }
}

/// What can be told from the inputs alone.
pub(super) fn needs(inputs: &[InputValue; MaterialInput::COUNT]) -> MaterialFlags {
    let differs = |name: MaterialInput, from: [f32; 3]| match &inputs[name as usize] {
        InputValue::Constant([x, y, z, _]) => [*x, *y, *z] != from,
        _ => true,
    };
    let emits = match &inputs[MaterialInput::EmissiveColor as usize] {
        InputValue::Constant([r, g, b, _]) => *r > 0.0 || *g > 0.0 || *b > 0.0,
        _ => true,
    };
    let coated = match &inputs[MaterialInput::Clearcoat as usize] {
        InputValue::Constant([value, ..]) => *value > 0.0,
        _ => true,
    };
    let mut flags = MaterialFlags::empty();
    flags.set(MaterialFlags::EMISSIVE, emits);
    flags.set(MaterialFlags::COAT, coated);
    flags.set(MaterialFlags::NORMAL_MAP, differs(MaterialInput::Normal, [0.0, 0.0, 1.0]));
    flags.set(MaterialFlags::TEXTURED, inputs.iter().any(|input| matches!(input, InputValue::Texture { .. })));
    flags
}
