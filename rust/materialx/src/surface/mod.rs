// SPDX-License-Identifier: Apache-2.0
//! Surface shaders as slabs of `OpenPBR` 1.1, and what the renderer's BSDF takes of them.
//!
//! What is an approximation: subsurface scattering is diffuse reflection in its colour; what is transmitted is tinted
//! by `transmission_color` at every interface where no depth is said, else by what is absorbed on the way (Beer and
//! Lambert); a coat's colour tints the base as seen from above; specular colours of metals (F82) do not count.
//! Scattering media are left out, with a note where a material asks for them.

mod closure;
mod hair;
mod input;
mod mixture;
mod models;

use std::sync::Arc;

pub(crate) use input::DEFAULTS;
pub use input::Input;

use crate::expression::Val;
use crate::program::{Geometry, Op};
use crate::slab::OpenPbrSlab;
use crate::walk::{NetworkWalker, NodeAddress};

/// Surface shaders one within the other, at most.
const MAX_SHADERS: usize = 16;

/// What the BSDF takes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoweredSurface {
    pub(crate) inputs: [Val; Input::COUNT],
    pub(crate) specular_workflow: bool,
    pub(crate) opacity_threshold: f32,
    pub(crate) thin_walled: bool,
    pub(crate) dispersive: bool,
    pub(crate) hair: bool,
}

impl NetworkWalker<'_> {
    /// The slab of the network's surface; `None` where it is no surface that is understood.
    pub(crate) fn slab(&mut self) -> Option<OpenPbrSlab> {
        let at = self.surface();
        self.shader(at, 0)
    }

    /// The slab of a surface shader, through graphs and mixtures of shaders.
    fn shader(&mut self, at: NodeAddress, depth: usize) -> Option<OpenPbrSlab> {
        self.once(at, depth > MAX_SHADERS, |walker| walker.shader_of(at, depth))
    }

    fn shader_of(&mut self, at: NodeAddress, depth: usize) -> Option<OpenPbrSlab> {
        let category = self.category(at);
        if let Some(slab) = self.model(at, &category) {
            return Some(slab);
        }
        match &*category {
            "surface" => self.closures(at),
            "thin_surface" => self.thin_surface(at),
            "mix" => {
                let (front, back) = (self.source_node(at, "fg"), self.source_node(at, "bg"));
                let front = self.shader(front?, depth + 1)?;
                let back = self.shader(back?, depth + 1)?;
                let share = self.number_or(at, "mix", 0.0);
                Some(self.mixed(at, back, front, share))
            }
            _ => match self.implementation(at) {
                Some(inner) => self.shader(inner, depth + 1),
                None => {
                    self.unsupported(at, "the surface ");
                    None
                }
            },
        }
    }

    /// The normal that an input says in the world, in the frame of the surface. It is turned to the surface's own side,
    /// as `MaterialX`'s closures turn it; 0 says nothing.
    pub(crate) fn normal(&mut self, at: NodeAddress, name: &str) -> Val {
        if !self.is_said(at, name) {
            return OpenPbrSlab::BLACK.normal;
        }
        if let Some(source) = self.source_node(at, name) {
            match &*self.category(source) {
                "normalmap" if self.is_of_own_tangents(source) => return self.tangent_space_normal(source),
                "bump" if self.is_own_frame(source) => return self.height_normal(source, "height"),
                _ => {}
            }
        }
        let Some(normal) = self.number(at, name) else { return OpenPbrSlab::BLACK.normal };
        let e = &mut self.expressions;
        let own = e.geometry(Geometry::Normal);
        if normal == own || normal.is(0.0, 3) {
            return OpenPbrSlab::BLACK.normal;
        }
        let frame = [e.geometry(Geometry::FrameX), e.geometry(Geometry::FrameY), own];
        let parts = frame.map(|axis| e.dot(normal, axis, 3));
        let local = e.combine(&parts);
        let turned = e.subtract(Val::ZERO, local);
        let is_behind = e.binary(Op::Greater, Val::ZERO, parts[2]);
        e.op(Op::Select, [turned, local, is_behind], 0)
    }

    /// The normal of a `UsdPreviewSurface`, which is told in the frame of the surface. A normal map of "object space"
    /// is how files of `MaterialX` 1.38 decode a map for it: `MaterialX` turns it into 2 x - 1, and no more.
    pub(crate) fn preview_normal(&mut self, at: NodeAddress) -> Val {
        if !self.is_said(at, "normal") {
            return OpenPbrSlab::BLACK.normal;
        }
        if let Some(source) = self.source_node(at, "normal")
            && &*self.category(source) == "normalmap"
            && self.is_of_object(source)
        {
            return self.decoded_normal(source);
        }
        self.number(at, "normal").filter(|normal| !normal.is(0.0, 3)).unwrap_or(OpenPbrSlab::BLACK.normal)
    }

    /// The inputs that are several numbers: anisotropy, film, what is inside.
    fn packed(&mut self, slab: &OpenPbrSlab) -> [Val; 3] {
        if !slab.ratio.is(1.0, 1) || !slab.coat_ratio.is(1.0, 1) {
            // The tangent is that of the first set.
            self.texcoord("st");
        }
        let e = &mut self.expressions;
        [
            e.combine(&[slab.ratio, slab.turn, slab.coat_ratio, slab.coat_turn]),
            e.combine(&[slab.film, slab.film_thickness, slab.film_ior]),
            if slab.is_dispersive() { e.splice(slab.absorption, 3, slab.dispersion) } else { slab.absorption },
        ]
    }

    /// Colour of the base, emission, and roughness of the diffuse lobe.
    fn base(&mut self, slab: &OpenPbrSlab) -> [Val; 3] {
        let e = &mut self.expressions;
        let scattered = e.complement(slab.metalness);
        let scattered = e.multiply(slab.subsurface, scattered);
        let color = e.mix(slab.base_color, slab.subsurface_color, scattered);
        let tint = e.mix(Val::ONE, slab.coat_color, slab.coat);
        // What is scattered below the surface leaves it as from a smooth one.
        let roughness = e.mix(slab.diffuse_roughness, Val::ZERO, slab.subsurface);
        [e.multiply(color, tint), e.multiply(slab.emission, tint), roughness]
    }

    /// A slab as inputs of the BSDF.
    pub(crate) fn lower(&mut self, slab: &OpenPbrSlab) -> LoweredSurface {
        if let Some(hair) = &slab.hair {
            return self.lower_hair(slab, hair);
        }
        let [anisotropy, film, inside] = self.packed(slab);
        let [mut color, emission, diffuse_roughness] = self.base(slab);
        let e = &mut self.expressions;
        let is_plain = slab.specular_weight.is(1.0, 1) && slab.specular_color.is(1.0, 3);
        let is_metal = slab.metalness.is(1.0, 1);
        let mut ior = slab.ior;
        let mut specular = Val::ZERO;
        let mut metallic = slab.metalness;
        let mut specular_workflow = false;
        if !is_plain && !is_metal {
            let (above, below) = (e.subtract(ior, Val::ONE), e.add(ior, Val::ONE));
            let root = e.divide(above, below);
            let square = e.multiply(root, root);
            let reflectance = e.multiply(square, slab.specular_weight);
            if slab.specular_color.is(1.0, 3) && slab.transmission.is(0.0, 1) {
                // The index that reflects so much.
                let reflectance = e.op(Op::Clamp, [reflectance, Val::ZERO, Val::number(0.98)], 0);
                let root = e.unary(Op::Sqrt, reflectance);
                let (above, below) = (e.add(Val::ONE, root), e.complement(root));
                ior = e.divide(above, below);
            } else {
                specular_workflow = true;
                let dielectric = e.multiply(reflectance, slab.specular_color);
                specular = e.mix(dielectric, color, slab.metalness);
                let rest = e.complement(slab.metalness);
                color = e.multiply(color, rest);
                metallic = Val::ZERO;
            }
        }
        let mut transmission = slab.transmission;
        if specular_workflow {
            // There it is the share of all; metal has none.
            let rest = e.complement(slab.metalness);
            transmission = e.multiply(transmission, rest);
        }
        let mut inputs = DEFAULTS.map(Val::Constant);
        let mut set = |input: Input, val: Val| inputs[input as usize] = val;
        set(Input::DiffuseColor, color);
        set(Input::EmissiveColor, emission);
        set(Input::SpecularColor, specular);
        set(Input::Metallic, metallic);
        set(Input::Roughness, slab.roughness);
        set(Input::Clearcoat, slab.coat);
        set(Input::ClearcoatRoughness, slab.coat_roughness);
        set(Input::CoatIor, slab.coat_ior);
        set(Input::Opacity, slab.opacity);
        set(Input::Ior, ior);
        set(Input::Normal, slab.normal);
        set(Input::Transmission, transmission);
        set(Input::TransmissionColor, slab.transmission_color);
        set(Input::SheenColor, slab.fuzz);
        set(Input::SheenRoughness, slab.fuzz_roughness);
        set(Input::Anisotropy, anisotropy);
        set(Input::ThinFilm, film);
        set(Input::Absorption, inside);
        set(Input::DiffuseRoughness, diffuse_roughness);
        let dispersive = slab.is_dispersive();
        let OpenPbrSlab { opacity_threshold, thin_walled, .. } = *slab;
        LoweredSurface { inputs, specular_workflow, opacity_threshold, thin_walled, dispersive, hair: false }
    }

    /// Notes inputs that ask for what is not there: `(input, value where it asks for nothing, what)`.
    pub(crate) fn leave_out(&mut self, at: NodeAddress, asked: &[(&str, f32, &str)]) {
        let mut missing: Vec<&str> = Vec::new();
        for (name, nothing, what) in asked {
            let width = usize::from(self.input_type(at, name).width().max(1));
            if self.is_said(at, name)
                && self.number(at, name).is_some_and(|val| !val.is(*nothing, width))
                && !missing.contains(what)
            {
                missing.push(what);
            }
        }
        if !missing.is_empty() {
            let path: Arc<str> = self.path(at);
            self.problem(format!("{path}: not supported yet: {}", missing.join(", ")));
        }
    }
}
