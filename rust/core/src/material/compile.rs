// SPDX-License-Identifier: Apache-2.0
//! The surface node of a network to a [`Material`]. Pure.

use oocpt_abi::{MaterialFlags, MaterialInput, SHARP_ROUGHNESS};
use std::sync::Arc;

use super::compiled::CompiledMaterial;
use super::compiler::{MAX_NODES, NetworkCompiler};
use super::inputs::{NEUTRAL, needs};
use super::materialx::{self, is_materialx};
use super::params::{NumberShape, ProblemList, connection, numbers, text};
use super::{InputValue, Material, PTEX_SET, UvSet};
use crate::desc::MaterialDesc;
use oocpt_materialx::program::Program;

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

impl NetworkCompiler<'_> {
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
}
