// SPDX-License-Identifier: Apache-2.0
//! Meshes that are lights by `MeshLightAPI`: gives their surfaces the emission of the light. Pure.
//!
//! The emission of such a mesh becomes that of its material, so it is sampled, seen and met as any emissive mesh is.
//! With `L` the light's radiance (`UsdLux`, as for other lights; normalised: over the mesh's area in the world):
//! - [`MaterialSync::NoResponse`], or no material: the surface emits `L` and reflects nothing;
//! - [`MaterialSync::Independent`]: it reflects as its material does, and emits `L`;
//! - [`MaterialSync::GlowTintsLight`]: it reflects as its material does and emits `L` times the material's emission, or
//!   `L` if the material emits nothing.
//!
//! Camera rays see the emission of the light, also where `UsdLux` would have them see the material's own emission.

use oocpt_abi::{MaterialFlags, MaterialInput};
use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;
use rustc_hash::FxHashMap;

use super::entries::MeshEntry;
use super::light;
use super::report::CommitReports;
use crate::desc::{LightDesc, LightKind, MaterialSync, MeshDesc};
use oocpt_materialx::program::Program;

use crate::material::{InputValue, Material, NEUTRAL};

/// Suffix that makes the path of a mesh's light from the path of the mesh. No prim has this name.
pub const MESH_LIGHT: &str = "/{light}";

/// A mesh's light.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct MeshLight {
    radiance: [f32; 3],
    sync: MaterialSync,
    /// Label in light path expressions.
    pub(crate) label: Option<Arc<str>>,
}

/// The mesh lights among `lights`, by the path of their meshes.
pub(crate) fn mesh_lights(
    lights: &BTreeMap<Arc<str>, LightDesc>,
    meshes: &BTreeMap<Arc<str>, MeshEntry>,
    reports: &mut CommitReports,
) -> FxHashMap<Arc<str>, MeshLight> {
    let mut found = FxHashMap::default();
    for (path, desc) in lights {
        let LightKind::Mesh { sync } = desc.kind else { continue };
        let Some((mesh, entry)) = path.strip_suffix(MESH_LIGHT).and_then(|mesh| meshes.get_key_value(mesh)) else {
            continue;
        };
        let scale = if desc.normalize { 1.0 / area(&entry.desc) } else { 1.0 };
        let Some(radiance) = light::radiance(desc, scale) else {
            reports.of(mesh).lights += 1;
            continue;
        };
        let left_out = unsupported(desc, !entry.desc.prim.instanced_by.is_empty());
        if !left_out.is_empty() {
            reports.note(mesh, format!("as a light it does not support {}", left_out.join(", ")));
        }
        found.insert(
            mesh.clone(),
            MeshLight { radiance, sync, label: desc.label.clone().filter(|label| !label.is_empty()) },
        );
    }
    found
}

/// Inputs of a light that a mesh light does not support.
fn unsupported(desc: &LightDesc, is_instanced: bool) -> Vec<&'static str> {
    let is_named = |link: &Option<Arc<str>>| link.as_ref().is_some_and(|name| !name.is_empty());
    let is_one = |value: f32| (value - 1.0).abs() <= 0.0;
    let parts = [
        (desc.shaping.is_some(), "shaping"),
        (is_named(&desc.light_link), "light linking"),
        (is_named(&desc.shadow_link), "shadow linking"),
        (!desc.shadow_enable || desc.shadow_color.iter().any(|&c| c > 0.0), "shadows that are off or have a colour"),
        (desc.shadow_reach.is_some(), "shadows of limited length"),
        (!is_one(desc.diffuse) || !is_one(desc.specular), "multipliers of diffuse and specular reflection"),
        (desc.normalize && is_instanced, "normalize by the area of each instance (that of the prototype counts)"),
    ];
    parts.into_iter().filter(|(asked, _)| *asked).map(|(_, name)| name).collect()
}

/// Area of a mesh in the world: all of its faces, as fans of triangles.
fn area(desc: &MeshDesc) -> f64 {
    let (counts, indices) = (desc.face_vertex_counts.view(), desc.face_vertex_indices.view());
    let corner = |at: usize| -> Option<DVec3> {
        let index = usize::try_from(indices.index(at)?).ok()?;
        Some(desc.prim.transform.transform_point3(desc.points.vec3(index)?))
    };
    let (mut sum, mut first) = (0.0, 0_usize);
    for face in 0..counts.len() {
        let Some(count) = counts.index(face).and_then(|count| usize::try_from(count).ok()) else { return sum };
        for k in 1..count.saturating_sub(1) {
            let (Some(a), Some(b), Some(c)) = (corner(first), corner(first + k), corner(first + k + 1)) else {
                continue;
            };
            let area = 0.5 * (b - a).cross(c - a).length();
            sum += if area.is_finite() { area } else { 0.0 };
        }
        first = first.saturating_add(count);
    }
    sum
}

impl MeshLight {
    /// The material of a slot whose own is `material`.
    pub(crate) fn dress(&self, mesh: &Arc<str>, material: Option<&Material>, reports: &mut CommitReports) -> Material {
        let [r, g, b] = self.radiance;
        let mut dressed = match material {
            Some(material) if self.sync != MaterialSync::NoResponse => material.clone(),
            _ => dark(),
        };
        let emission = &mut dressed.inputs[MaterialInput::EmissiveColor as usize];
        let is_tinted = self.sync == MaterialSync::GlowTintsLight && dressed.flags.contains(MaterialFlags::EMISSIVE);
        match emission {
            InputValue::Constant(value) if is_tinted => {
                *value = [r * value[0].max(0.0), g * value[1].max(0.0), b * value[2].max(0.0), value[3]];
            }
            InputValue::Texture { channel, scale, bias, .. } if is_tinted => {
                let is_grey = r.to_bits() == g.to_bits() && g.to_bits() == b.to_bits();
                if channel.is_some() && !is_grey {
                    reports.note(
                        mesh,
                        "its emission is one channel of a texture: the light's colour counts as grey".to_owned(),
                    );
                }
                let grey = (r + g + b) / 3.0;
                let factor = if channel.is_some() { [grey; 4] } else { [r, g, b, 1.0] };
                for k in 0..4 {
                    scale[k] *= factor[k];
                    bias[k] *= factor[k];
                }
            }
            InputValue::Primvar { .. } | InputValue::Register(_) if is_tinted => {
                if [r, g, b].iter().any(|v| (v - 1.0).abs() > 0.0) {
                    reports.note(
                        mesh,
                        "its emission is a primvar or a pattern, which its light's colour does not tint".to_owned(),
                    );
                }
            }
            _ => *emission = InputValue::Constant([r, g, b, 1.0]),
        }
        let is_finite = |input: &InputValue| match input {
            InputValue::Constant(value) => value.iter().all(|v| v.is_finite()),
            InputValue::Texture { scale, bias, .. } => scale.iter().chain(bias).all(|v| v.is_finite()),
            InputValue::Primvar { .. } | InputValue::Register(_) => true,
        };
        if !is_finite(emission) {
            reports.of(mesh).lights += 1;
            *emission = InputValue::Constant([0.0, 0.0, 0.0, 1.0]);
        }
        let emits = !matches!(emission, InputValue::Constant([r, g, b, _]) if *r <= 0.0 && *g <= 0.0 && *b <= 0.0);
        dressed.flags.set(MaterialFlags::EMISSIVE, emits);
        dressed
    }
}

/// A surface that reflects nothing.
fn dark() -> Material {
    let mut inputs = NEUTRAL;
    for (name, value) in [(MaterialInput::Roughness, 1.0), (MaterialInput::ClearcoatRoughness, 0.01)] {
        inputs[name as usize] = InputValue::Constant([value; 4]);
    }
    Material {
        flags: MaterialFlags::SPECULAR_WORKFLOW,
        inputs,
        opacity_threshold: 0.0,
        uv_sets: Vec::new(),
        primvars: Vec::new(),
        program: Program::default(),
        opacity_program: Program::default(),
        emission: None,
    }
}
