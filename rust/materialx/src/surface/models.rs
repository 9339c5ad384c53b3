// SPDX-License-Identifier: Apache-2.0
//! The surface models of `MaterialX`, each as a slab: `open_pbr_surface` 1.1, `standard_surface` 1.0.1, `gltf_pbr`
//! 2.0.1, `disney_principled`, `UsdPreviewSurface` 2.6, `surface_unlit`.

use super::Slab;
use crate::expression::Val;
use crate::program::Op;
use crate::walk::{At, Walker};

impl Walker<'_> {
    pub(super) fn model(&mut self, at: At, category: &str) -> Option<Slab> {
        Some(match category {
            "open_pbr_surface" => self.open_pbr(at),
            "standard_surface" => self.standard_surface(at),
            "gltf_pbr" => self.gltf(at),
            "disney_principled" => self.disney(at),
            "UsdPreviewSurface" => self.preview_surface(at),
            "surface_unlit" => self.unlit(at),
            _ => return None,
        })
    }

    /// The product of two inputs.
    fn product(&mut self, at: At, [a, b]: [&str; 2]) -> Val {
        let (a, b) = (self.number_or(at, a, 1.0), self.number_or(at, b, 1.0));
        self.expressions.multiply(a, b)
    }

    fn open_pbr(&mut self, at: At) -> Slab {
        self.leave_out(
            at,
            &[
                ("base_diffuse_roughness", 0.0, "diffuse roughness"),
                ("specular_roughness_anisotropy", 0.0, "anisotropy"),
                ("coat_roughness_anisotropy", 0.0, "anisotropy"),
                ("transmission_dispersion_scale", 0.0, "dispersion"),
                ("transmission_scatter", 0.0, "scattering inside"),
                ("thin_film_weight", 0.0, "thin films"),
                ("geometry_thin_walled", 0.0, "thin walls"),
            ],
        );
        Slab {
            base_color: self.product(at, ["base_weight", "base_color"]),
            metalness: self.number_or(at, "base_metalness", 0.0),
            specular_weight: self.number_or(at, "specular_weight", 1.0),
            specular_color: self.number_or(at, "specular_color", 1.0),
            roughness: self.number_or(at, "specular_roughness", 0.3),
            ior: self.number_or(at, "specular_ior", 1.5),
            transmission: self.number_or(at, "transmission_weight", 0.0),
            transmission_color: self.number_or(at, "transmission_color", 1.0),
            subsurface: self.number_or(at, "subsurface_weight", 0.0),
            subsurface_color: self.number_or(at, "subsurface_color", 0.8),
            coat: self.number_or(at, "coat_weight", 0.0),
            coat_color: self.number_or(at, "coat_color", 1.0),
            coat_roughness: self.number_or(at, "coat_roughness", 0.0),
            coat_ior: self.number_or(at, "coat_ior", 1.6),
            fuzz: self.product(at, ["fuzz_weight", "fuzz_color"]),
            fuzz_roughness: self.number_or(at, "fuzz_roughness", 0.5),
            emission: self.product(at, ["emission_luminance", "emission_color"]),
            opacity: self.number_or(at, "geometry_opacity", 1.0),
            opacity_threshold: 0.0,
            normal: self.normal(at, "geometry_normal"),
        }
    }

    fn standard_surface(&mut self, at: At) -> Slab {
        self.leave_out(
            at,
            &[
                ("diffuse_roughness", 0.0, "diffuse roughness"),
                ("specular_anisotropy", 0.0, "anisotropy"),
                ("coat_anisotropy", 0.0, "anisotropy"),
                ("transmission_dispersion", 0.0, "dispersion"),
                ("transmission_scatter", 0.0, "scattering inside"),
                ("transmission_extra_roughness", 0.0, "another roughness of what is transmitted"),
                ("thin_film_thickness", 0.0, "thin films"),
                ("thin_walled", 0.0, "thin walls"),
            ],
        );
        let opacity = self.number_or(at, "opacity", 1.0);
        Slab {
            base_color: self.product(at, ["base", "base_color"]),
            metalness: self.number_or(at, "metalness", 0.0),
            specular_weight: self.number_or(at, "specular", 1.0),
            specular_color: self.number_or(at, "specular_color", 1.0),
            roughness: self.number_or(at, "specular_roughness", 0.2),
            ior: self.number_or(at, "specular_IOR", 1.5),
            transmission: self.number_or(at, "transmission", 0.0),
            transmission_color: self.number_or(at, "transmission_color", 1.0),
            subsurface: self.number_or(at, "subsurface", 0.0),
            subsurface_color: self.number_or(at, "subsurface_color", 1.0),
            coat: self.number_or(at, "coat", 0.0),
            coat_color: self.number_or(at, "coat_color", 1.0),
            coat_roughness: self.number_or(at, "coat_roughness", 0.1),
            coat_ior: self.number_or(at, "coat_IOR", 1.5),
            fuzz: self.product(at, ["sheen", "sheen_color"]),
            fuzz_roughness: self.number_or(at, "sheen_roughness", 0.3),
            emission: self.product(at, ["emission", "emission_color"]),
            opacity: self.grey(opacity),
            opacity_threshold: 0.0,
            normal: self.normal(at, "normal"),
        }
    }

    /// The mean of a colour's components if it is known; else red: maps of opacity are grey, and one channel of a
    /// texture is what traversal can ask for.
    fn grey(&mut self, color: Val) -> Val {
        match color {
            Val::Constant([r, g, b, _]) => Val::number((r + g + b) / 3.0),
            Val::Node(_) => self.expressions.component(color, 0),
        }
    }

    fn gltf(&mut self, at: At) -> Slab {
        self.leave_out(
            at,
            &[
                ("iridescence", 0.0, "thin films"),
                ("anisotropy_strength", 0.0, "anisotropy"),
                ("dispersion", 0.0, "dispersion"),
            ],
        );
        let mode = self.number_or(at, "alpha_mode", 0.0).constant().map_or(0.0, |mode| mode[0]);
        let cutoff = self.number_or(at, "alpha_cutoff", 0.5).constant().map_or(0.5, |cutoff| cutoff[0]);
        let is_mask = (0.5..1.5).contains(&mode);
        let sheen = self.number_or(at, "sheen_color", 0.0);
        Slab {
            base_color: self.number_or(at, "base_color", 1.0),
            metalness: self.number_or(at, "metallic", 1.0),
            specular_weight: self.number_or(at, "specular", 1.0),
            specular_color: self.number_or(at, "specular_color", 1.0),
            roughness: self.number_or(at, "roughness", 1.0),
            ior: self.number_or(at, "ior", 1.5),
            transmission: self.number_or(at, "transmission", 0.0),
            // glTF tints what is transmitted by the base.
            transmission_color: self.product(at, ["base_color", "attenuation_color"]),
            coat: self.number_or(at, "clearcoat", 0.0),
            coat_roughness: self.number_or(at, "clearcoat_roughness", 0.0),
            coat_ior: Val::number(1.5),
            fuzz: sheen,
            fuzz_roughness: self.number_or(at, "sheen_roughness", 0.0),
            emission: self.product(at, ["emissive", "emissive_strength"]),
            opacity: if mode >= 1.5 || is_mask && cutoff > 0.0 { self.number_or(at, "alpha", 1.0) } else { Val::ONE },
            opacity_threshold: if is_mask { cutoff.max(0.0) } else { 0.0 },
            normal: self.normal(at, "normal"),
            ..Slab::BLACK
        }
    }

    /// Burley (2012, 2015); its flatness, diffuse transmission and tints are left out.
    fn disney(&mut self, at: At) -> Slab {
        self.leave_out(
            at,
            &[
                ("anisotropic", 0.0, "anisotropy"),
                ("specularTint", 0.0, "tinted reflection"),
                ("flatness", 0.0, "flatness"),
                ("diffTrans", 0.0, "diffuse transmission"),
                ("thinSurface", 0.0, "thin walls"),
            ],
        );
        let gloss = self.number_or(at, "clearcoatGloss", 1.0);
        let specular = self.number_or(at, "specular", 0.5);
        let color = self.number_or(at, "baseColor", 0.16);
        let e = &mut self.expressions;
        // Alpha from 0.1 to 0.001.
        let alpha = e.mix(Val::number(0.1), Val::number(0.001), gloss);
        let coat_roughness = e.unary(Op::Sqrt, alpha);
        // F0 is 0.08 of `specular`, which is 0.04 times the weight.
        let specular_weight = e.multiply(specular, Val::number(2.0));
        let transmission_color = e.unary(Op::Sqrt, color);
        let coat = self.number_or(at, "clearcoat", 0.0);
        let ior = self.number_or(at, "ior", 1.5);
        let transmission = self.number_or(at, "specTrans", 0.0);
        Slab {
            base_color: color,
            metalness: self.number_or(at, "metallic", 0.0),
            specular_weight: if transmission.is(0.0, 1) { specular_weight } else { Val::ONE },
            specular_color: Val::ONE,
            roughness: self.number_or(at, "roughness", 0.5),
            ior,
            transmission,
            transmission_color,
            subsurface: self.number_or(at, "subsurface", 0.0),
            subsurface_color: color,
            // A coat of Disney's reflects a quarter.
            coat: self.expressions.multiply(coat, Val::number(0.25)),
            coat_roughness,
            coat_ior: Val::number(1.5),
            fuzz: self.number_or(at, "sheen", 0.0),
            normal: self.normal(at, "normal"),
            ..Slab::BLACK
        }
    }

    fn preview_surface(&mut self, at: At) -> Slab {
        let threshold = self.number_or(at, "opacityThreshold", 0.0).constant().map_or(0.0, |value| value[0]);
        let workflow = self.number_or(at, "useSpecularWorkflow", 0.0);
        let is_specular = !workflow.is(0.0, 1);
        let opacity = self.number_or(at, "opacity", 1.0);
        // opacityMode: 0 transparent, 1 presence.
        let is_presence = threshold > 0.0 || !self.number_or(at, "opacityMode", 0.0).is(0.0, 1);
        let specular = self.number_or(at, "specularColor", 0.0);
        let transmission = if is_presence { Val::ZERO } else { self.expressions.complement(opacity) };
        let slab = Slab {
            base_color: self.number_or(at, "diffuseColor", 0.18),
            metalness: if is_specular { Val::ZERO } else { self.number_or(at, "metallic", 0.0) },
            specular_weight: Val::ONE,
            roughness: self.number_or(at, "roughness", 0.5),
            ior: self.number_or(at, "ior", 1.5),
            transmission,
            coat: self.number_or(at, "clearcoat", 0.0),
            coat_roughness: self.number_or(at, "clearcoatRoughness", 0.01),
            coat_ior: self.number_or(at, "ior", 1.5),
            emission: self.number_or(at, "emissiveColor", 0.0),
            opacity: if is_presence { opacity } else { Val::ONE },
            opacity_threshold: threshold.max(0.0),
            normal: if self.is_said(at, "normal") {
                self.number(at, "normal").unwrap_or(Slab::BLACK.normal)
            } else {
                Slab::BLACK.normal
            },
            ..Slab::BLACK
        };
        if !is_specular {
            return slab;
        }
        // F0 = specularColor: its colour is that over what the index reflects.
        let e = &mut self.expressions;
        let (above, below) = (e.subtract(slab.ior, Val::ONE), e.add(slab.ior, Val::ONE));
        let root = e.divide(above, below);
        let reflectance = e.multiply(root, root);
        Slab { specular_color: e.divide(specular, reflectance), ..slab }
    }

    fn unlit(&mut self, at: At) -> Slab {
        Slab {
            emission: self.product(at, ["emission", "emission_color"]),
            opacity: self.number_or(at, "opacity", 1.0),
            ior: Val::ONE,
            ..Slab::BLACK
        }
    }
}
