// SPDX-License-Identifier: Apache-2.0
//! Reduces the surface models of `MaterialX` to a slab of `OpenPBR` each: `open_pbr_surface` 1.1, `standard_surface`
//! 1.0.1, `gltf_pbr` 2.0.1, `disney_principled`, `UsdPreviewSurface` 2.6, `surface_unlit`.

use crate::expression::Val;
use crate::program::Op;
use crate::slab::OpenPbrSlab;
use crate::walk::{NetworkWalker, NodeAddress};

impl NetworkWalker<'_> {
    /// The slab of a node, if its category is a surface model.
    pub(super) fn model(&mut self, at: NodeAddress, category: &str) -> Option<OpenPbrSlab> {
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
    fn product(&mut self, at: NodeAddress, [a, b]: [&str; 2]) -> Val {
        let (a, b) = (self.number_or(at, a, 1.0), self.number_or(at, b, 1.0));
        self.expressions.multiply(a, b)
    }

    fn open_pbr(&mut self, at: NodeAddress) -> OpenPbrSlab {
        self.report_unsupported(at, &[("transmission_scatter", 0.0, "scattering inside")]);
        let scale = self.number_or(at, "transmission_dispersion_scale", 0.0);
        let abbe = self.number_or(at, "transmission_dispersion_abbe_number", 20.0);
        let [alpha_ratio, coat_alpha_ratio] =
            ["specular_roughness_anisotropy", "coat_roughness_anisotropy"].map(|name| {
                let anisotropy = self.number_or(at, name, 0.0);
                self.expressions.complement(anisotropy)
            });
        let depth = self.number_or(at, "transmission_depth", 0.0);
        let color = self.number_or(at, "transmission_color", 1.0);
        let (transmission_color, absorption) = self.tint_and_absorption(color, depth);
        let thickness = self.number_or(at, "thin_film_thickness", 0.5);
        OpenPbrSlab {
            base_color: self.product(at, ["base_weight", "base_color"]),
            metalness: self.number_or(at, "base_metalness", 0.0),
            specular_weight: self.number_or(at, "specular_weight", 1.0),
            specular_color: self.number_or(at, "specular_color", 1.0),
            roughness: self.number_or(at, "specular_roughness", 0.3),
            ior: self.number_or(at, "specular_ior", 1.5),
            transmission: self.number_or(at, "transmission_weight", 0.0),
            transmission_color,
            absorption,
            dispersion: self.expressions.divide(scale, abbe),
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
            alpha_ratio,
            coat_alpha_ratio,
            film_weight: self.number_or(at, "thin_film_weight", 0.0),
            film_thickness: self.expressions.multiply(thickness, Val::number(1000.0)),
            film_ior: self.number_or(at, "thin_film_ior", 1.4),
            diffuse_roughness: self.number_or(at, "base_diffuse_roughness", 0.0),
            thin_walled: self.is_constant_true(at, "geometry_thin_walled"),
            ..OpenPbrSlab::BLACK
        }
    }

    /// True if an input is authored as a constant that is not 0.
    fn is_constant_true(&mut self, at: NodeAddress, name: &str) -> bool {
        self.is_authored(at, name) && self.number_or(at, name, 0.0).constant().is_some_and(|value| value[0] != 0.0)
    }

    /// Tint of the interface and absorption coefficient of the interior, from a transmission colour and the depth at
    /// which it is reached. Without a depth the interface has the whole tint; else the coefficient is -ln(color) /
    /// depth.
    fn tint_and_absorption(&mut self, color: Val, depth: Val) -> (Val, Val) {
        if depth.is(0.0, 1) {
            return (color, Val::ZERO);
        }
        let e = &mut self.expressions;
        let positive = e.binary(Op::Max, color, Val::number(1.0e-4));
        let logarithm = e.unary(Op::Ln, positive);
        let negative = e.subtract(Val::ZERO, logarithm);
        let absorption = e.divide(negative, depth);
        let is_deep = e.binary(Op::Greater, depth, Val::ZERO);
        (e.op(Op::Select, [Val::ONE, color, is_deep], 0), absorption)
    }

    /// Roughness and ratio of the alphas that `MaterialX`'s `roughness_anisotropy` gives: r^2 / a and r^2 a with
    /// a^2 = 1 - anisotropy.
    fn materialx_anisotropy(
        &mut self,
        at: NodeAddress,
        [roughness, anisotropy]: [&str; 2],
        default: f32,
    ) -> (Val, Val) {
        let roughness = self.number_or(at, roughness, default);
        let anisotropy = self.number_or(at, anisotropy, 0.0);
        if anisotropy.is(0.0, 1) {
            return (roughness, Val::ONE);
        }
        let e = &mut self.expressions;
        let limited = e.op(Op::Clamp, [anisotropy, Val::ZERO, Val::number(0.98)], 0);
        let alpha_ratio = e.complement(limited);
        // The root mean square of the alphas is r^2 ((1 / ratio + ratio) / 2)^(1/2); the slab wants its root.
        let inverse = e.divide(Val::ONE, alpha_ratio);
        let sum = e.add(inverse, alpha_ratio);
        let mean = e.multiply(sum, Val::number(0.5));
        let root = e.unary(Op::Sqrt, mean);
        let root = e.unary(Op::Sqrt, root);
        let mean_roughness = e.multiply(roughness, root);
        (e.binary(Op::Min, mean_roughness, Val::ONE), alpha_ratio)
    }

    /// Roughness and ratio of the alphas of glTF (`KHR_materials_anisotropy`): alphas mix(r^2, 1, strength^2) and r^2.
    fn gltf_anisotropy(&mut self, at: NodeAddress) -> (Val, Val) {
        let roughness = self.number_or(at, "roughness", 1.0);
        let strength = self.number_or(at, "anisotropy_strength", 0.0);
        if strength.is(0.0, 1) {
            return (roughness, Val::ONE);
        }
        let e = &mut self.expressions;
        let across = e.multiply(roughness, roughness);
        let square = e.multiply(strength, strength);
        let along = e.mix(across, Val::ONE, square);
        let alphas = e.combine(&[along, across]);
        let sum = e.dot(alphas, alphas, 2);
        let mean = e.multiply(sum, Val::number(0.5));
        let root = e.unary(Op::Sqrt, mean);
        let mean_roughness = e.unary(Op::Sqrt, root);
        (mean_roughness, e.divide(across, along))
    }

    fn standard_surface(&mut self, at: NodeAddress) -> OpenPbrSlab {
        self.report_unsupported(
            at,
            &[
                ("transmission_scatter", 0.0, "scattering inside"),
                ("transmission_extra_roughness", 0.0, "another roughness of what is transmitted"),
            ],
        );
        let opacity = self.number_or(at, "opacity", 1.0);
        let base_color = self.product(at, ["base", "base_color"]);
        let (roughness, alpha_ratio) =
            self.materialx_anisotropy(at, ["specular_roughness", "specular_anisotropy"], 0.2);
        let (coat_roughness, coat_alpha_ratio) =
            self.materialx_anisotropy(at, ["coat_roughness", "coat_anisotropy"], 0.1);
        let depth = self.number_or(at, "transmission_depth", 0.0);
        let color = self.number_or(at, "transmission_color", 1.0);
        let (transmission_color, absorption) = self.tint_and_absorption(color, depth);
        let film_thickness = self.number_or(at, "thin_film_thickness", 0.0);
        // The Abbe number; 0 means none.
        let abbe = self.number_or(at, "transmission_dispersion", 0.0);
        OpenPbrSlab {
            base_color,
            metalness: self.number_or(at, "metalness", 0.0),
            specular_weight: self.number_or(at, "specular", 1.0),
            specular_color: self.number_or(at, "specular_color", 1.0),
            roughness,
            alpha_ratio,
            rotation: self.number_or(at, "specular_rotation", 0.0),
            ior: self.number_or(at, "specular_IOR", 1.5),
            transmission: self.number_or(at, "transmission", 0.0),
            transmission_color,
            absorption,
            dispersion: self.expressions.divide(Val::ONE, abbe),
            subsurface: self.number_or(at, "subsurface", 0.0),
            subsurface_color: self.number_or(at, "subsurface_color", 1.0),
            coat: self.number_or(at, "coat", 0.0),
            coat_color: self.number_or(at, "coat_color", 1.0),
            coat_roughness,
            coat_alpha_ratio,
            coat_rotation: self.number_or(at, "coat_rotation", 0.0),
            coat_ior: self.number_or(at, "coat_IOR", 1.5),
            fuzz: self.product(at, ["sheen", "sheen_color"]),
            fuzz_roughness: self.number_or(at, "sheen_roughness", 0.3),
            emission: self.product(at, ["emission", "emission_color"]),
            opacity: self.mean_or_red(opacity),
            opacity_threshold: 0.0,
            normal: self.normal(at, "normal"),
            film_weight: if film_thickness.is(0.0, 1) { Val::ZERO } else { Val::ONE },
            film_thickness,
            film_ior: self.number_or(at, "thin_film_IOR", 1.5),
            diffuse_roughness: self.number_or(at, "diffuse_roughness", 0.0),
            thin_walled: self.is_constant_true(at, "thin_walled"),
            ..OpenPbrSlab::BLACK
        }
    }

    /// The mean of a constant colour, else the red channel: opacity maps are grey, and traversal can look up one
    /// channel of a texture.
    fn mean_or_red(&mut self, color: Val) -> Val {
        match color {
            Val::Constant([r, g, b, _]) => Val::number((r + g + b) / 3.0),
            Val::Node(_) => self.expressions.component(color, 0),
        }
    }

    fn gltf(&mut self, at: NodeAddress) -> OpenPbrSlab {
        // `KHR_materials_dispersion` is 20 / V, the slab wants 1 / V (V: the Abbe number).
        let dispersion = self.number_or(at, "dispersion", 0.0);
        let dispersion = self.expressions.multiply(dispersion, Val::number(0.05));
        let mode = self.number_or(at, "alpha_mode", 0.0).constant().map_or(0.0, |mode| mode[0]);
        let cutoff = self.number_or(at, "alpha_cutoff", 0.5).constant().map_or(0.5, |cutoff| cutoff[0]);
        let is_mask = (0.5..1.5).contains(&mode);
        let sheen = self.number_or(at, "sheen_color", 0.0);
        let attenuation = self.number_or(at, "attenuation_color", 1.0);
        let distance = self.number_or(at, "attenuation_distance", 0.0);
        // Without a thickness there is no volume.
        let is_solid = self.is_authored(at, "thickness") && !self.number_or(at, "thickness", 0.0).is(0.0, 1);
        let depth = if is_solid { distance } else { Val::ZERO };
        let (tint, absorption) = self.tint_and_absorption(attenuation, depth);
        let color = self.number_or(at, "base_color", 1.0);
        let (roughness, alpha_ratio) = self.gltf_anisotropy(at);
        // Radians to turns.
        let rotation = self.number_or(at, "anisotropy_rotation", 0.0);
        let rotation = self.expressions.multiply(rotation, Val::number(0.5 * std::f32::consts::FRAC_1_PI));
        OpenPbrSlab {
            base_color: self.number_or(at, "base_color", 1.0),
            metalness: self.number_or(at, "metallic", 1.0),
            specular_weight: self.number_or(at, "specular", 1.0),
            specular_color: self.number_or(at, "specular_color", 1.0),
            roughness,
            alpha_ratio,
            rotation,
            ior: self.number_or(at, "ior", 1.5),
            transmission: self.number_or(at, "transmission", 0.0),
            // glTF tints transmitted light by the base.
            transmission_color: self.expressions.multiply(color, tint),
            absorption,
            dispersion,
            film_weight: self.number_or(at, "iridescence", 0.0),
            film_thickness: self.number_or(at, "iridescence_thickness", 100.0),
            film_ior: self.number_or(at, "iridescence_ior", 1.3),
            coat: self.number_or(at, "clearcoat", 0.0),
            coat_roughness: self.number_or(at, "clearcoat_roughness", 0.0),
            coat_ior: Val::number(1.5),
            fuzz: sheen,
            fuzz_roughness: self.number_or(at, "sheen_roughness", 0.0),
            emission: self.product(at, ["emissive", "emissive_strength"]),
            opacity: if mode >= 1.5 || is_mask && cutoff > 0.0 { self.number_or(at, "alpha", 1.0) } else { Val::ONE },
            opacity_threshold: if is_mask { cutoff.max(0.0) } else { 0.0 },
            normal: self.normal(at, "normal"),
            ..OpenPbrSlab::BLACK
        }
    }

    /// Burley (2012, 2015) without flatness, diffuse transmission and the tint of specular reflection.
    fn disney(&mut self, at: NodeAddress) -> OpenPbrSlab {
        self.report_unsupported(
            at,
            &[
                ("specularTint", 0.0, "tinted reflection"),
                ("flatness", 0.0, "flatness"),
                ("diffTrans", 0.0, "diffuse transmission"),
            ],
        );
        let gloss = self.number_or(at, "clearcoatGloss", 1.0);
        let specular = self.number_or(at, "specular", 0.5);
        let color = self.number_or(at, "baseColor", 0.16);
        let e = &mut self.expressions;
        // Burley (2012): the alpha of the clearcoat goes from 0.1 to 0.001 with the gloss.
        let alpha = e.mix(Val::number(0.1), Val::number(0.001), gloss);
        let coat_roughness = e.unary(Op::Sqrt, alpha);
        // F0 is 0.08 `specular`; the slab has 0.04 times the weight, at an index of refraction of 1.5.
        let specular_weight = e.multiply(specular, Val::number(2.0));
        let transmission_color = e.unary(Op::Sqrt, color);
        let (sheen, sheen_tint) = (self.number_or(at, "sheen", 0.0), self.number_or(at, "sheenTint", 0.5));
        let e = &mut self.expressions;
        let sheen_color = e.mix(Val::ONE, color, sheen_tint);
        let fuzz = e.multiply(sheen, sheen_color);
        let coat = self.number_or(at, "clearcoat", 0.0);
        let transmission = self.number_or(at, "specTrans", 0.0);
        // `ior` belongs to transmission; reflection without it is by `specular` alone.
        let authored_ior = self.number_or(at, "ior", 1.5);
        let ior = if transmission.is(0.0, 1) { Val::number(1.5) } else { authored_ior };
        let (roughness, alpha_ratio) = self.materialx_anisotropy(at, ["roughness", "anisotropic"], 0.5);
        OpenPbrSlab {
            base_color: color,
            metalness: self.number_or(at, "metallic", 0.0),
            specular_weight: if transmission.is(0.0, 1) { specular_weight } else { Val::ONE },
            specular_color: Val::ONE,
            roughness,
            alpha_ratio,
            thin_walled: self.is_constant_true(at, "thinSurface") || self.is_constant_true(at, "thin"),
            ior,
            transmission,
            transmission_color,
            subsurface: self.number_or(at, "subsurface", 0.0),
            subsurface_color: color,
            // Burley (2012): the clearcoat counts a quarter.
            coat: self.expressions.multiply(coat, Val::number(0.25)),
            coat_roughness,
            coat_ior: Val::number(1.5),
            fuzz,
            normal: self.normal(at, "normal"),
            ..OpenPbrSlab::BLACK
        }
    }

    fn preview_surface(&mut self, at: NodeAddress) -> OpenPbrSlab {
        let threshold = self.number_or(at, "opacityThreshold", 0.0).constant().map_or(0.0, |value| value[0]);
        let workflow = self.number_or(at, "useSpecularWorkflow", 0.0);
        let is_specular = !workflow.is(0.0, 1);
        let opacity = self.number_or(at, "opacity", 1.0);
        // Values of opacityMode: 0 transparent, 1 presence.
        let is_presence = threshold > 0.0 || !self.number_or(at, "opacityMode", 0.0).is(0.0, 1);
        let specular = self.number_or(at, "specularColor", 0.0);
        let transmission = if is_presence { Val::ZERO } else { self.expressions.complement(opacity) };
        let slab = OpenPbrSlab {
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
            normal: self.preview_normal(at),
            ..OpenPbrSlab::BLACK
        };
        if !is_specular {
            return slab;
        }
        // The slab multiplies its colour by the F0 of the index, and F0 is to be `specularColor`.
        let e = &mut self.expressions;
        let (above, below) = (e.subtract(slab.ior, Val::ONE), e.add(slab.ior, Val::ONE));
        let root = e.divide(above, below);
        let reflectance = e.multiply(root, root);
        OpenPbrSlab { specular_color: e.divide(specular, reflectance), ..slab }
    }

    /// Light that is transmitted goes on as if nothing were there: its share counts as what is not opaque.
    fn unlit(&mut self, at: NodeAddress) -> OpenPbrSlab {
        let (opacity, transmission) = (self.number_or(at, "opacity", 1.0), self.number_or(at, "transmission", 0.0));
        if !transmission.is(0.0, 1) {
            self.report_unsupported(at, &[("transmission_color", 1.0, "tinted transmission of `surface_unlit`")]);
        }
        let e = &mut self.expressions;
        let transmission = e.op(Op::Clamp, [transmission, Val::ZERO, Val::ONE], 0);
        let rest = e.complement(transmission);
        OpenPbrSlab {
            opacity: e.multiply(opacity, rest),
            emission: self.product(at, ["emission", "emission_color"]),
            ior: Val::ONE,
            ..OpenPbrSlab::BLACK
        }
    }
}
