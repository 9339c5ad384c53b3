// SPDX-License-Identifier: Apache-2.0
//! What surface shaders and closures are reduced to: a slab of `OpenPBR`, or a fibre.

use crate::expression::Val;

/// A slab of `OpenPBR`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct OpenPbrSlab {
    pub(crate) base_color: Val,
    pub(crate) metalness: Val,
    pub(crate) specular_weight: Val,
    pub(crate) specular_color: Val,
    pub(crate) roughness: Val,
    pub(crate) ior: Val,
    pub(crate) transmission: Val,
    pub(crate) transmission_color: Val,
    pub(crate) subsurface: Val,
    pub(crate) subsurface_color: Val,
    pub(crate) coat: Val,
    pub(crate) coat_color: Val,
    pub(crate) coat_roughness: Val,
    pub(crate) coat_ior: Val,
    pub(crate) fuzz: Val,
    pub(crate) fuzz_roughness: Val,
    pub(crate) emission: Val,
    pub(crate) opacity: Val,
    /// 0: the opacity is a probability.
    pub(crate) opacity_threshold: f32,
    /// In the frame of the surface.
    pub(crate) normal: Val,
    /// Of the alphas, and of the tangent; `roughness` is that of the mean of their squares.
    pub(crate) ratio: Val,
    pub(crate) turn: Val,
    pub(crate) coat_ratio: Val,
    pub(crate) coat_turn: Val,
    pub(crate) film: Val,
    /// In nm.
    pub(crate) film_thickness: Val,
    pub(crate) film_ior: Val,
    pub(crate) absorption: Val,
    /// 1 / the Abbe number; 0: none.
    pub(crate) dispersion: Val,
    pub(crate) diffuse_roughness: Val,
    pub(crate) thin_walled: bool,
    /// The closure's, which is in its colours too: what it counts in a sum.
    pub(crate) weight: Val,
    /// A fibre: of the rest emission and opacity count.
    pub(crate) hair: Option<HairSlab>,
}

impl OpenPbrSlab {
    /// Black, and nothing else.
    pub(crate) const BLACK: Self = Self {
        base_color: Val::ZERO,
        metalness: Val::ZERO,
        specular_weight: Val::ZERO,
        specular_color: Val::ONE,
        roughness: Val::Constant([0.3; 4]),
        ior: Val::Constant([1.5; 4]),
        transmission: Val::ZERO,
        transmission_color: Val::ONE,
        subsurface: Val::ZERO,
        subsurface_color: Val::ZERO,
        coat: Val::ZERO,
        coat_color: Val::ONE,
        coat_roughness: Val::ZERO,
        coat_ior: Val::Constant([1.6; 4]),
        fuzz: Val::ZERO,
        fuzz_roughness: Val::Constant([0.5; 4]),
        emission: Val::ZERO,
        opacity: Val::ONE,
        opacity_threshold: 0.0,
        normal: Val::Constant([0.0, 0.0, 1.0, 1.0]),
        ratio: Val::ONE,
        turn: Val::ZERO,
        coat_ratio: Val::ONE,
        coat_turn: Val::ZERO,
        film: Val::ZERO,
        film_thickness: Val::ZERO,
        film_ior: Val::Constant([1.4; 4]),
        absorption: Val::ZERO,
        dispersion: Val::ZERO,
        diffuse_roughness: Val::ZERO,
        thin_walled: false,
        weight: Val::ONE,
        hair: None,
    };

    /// Whether its index depends on the channel.
    pub(crate) fn is_dispersive(&self) -> bool {
        !self.dispersion.is(0.0, 1)
    }

    pub(crate) fn values(&mut self) -> [&mut Val; 29] {
        [
            &mut self.base_color,
            &mut self.metalness,
            &mut self.specular_weight,
            &mut self.specular_color,
            &mut self.roughness,
            &mut self.ior,
            &mut self.transmission,
            &mut self.transmission_color,
            &mut self.subsurface,
            &mut self.subsurface_color,
            &mut self.coat,
            &mut self.coat_color,
            &mut self.coat_roughness,
            &mut self.coat_ior,
            &mut self.fuzz,
            &mut self.fuzz_roughness,
            &mut self.emission,
            &mut self.opacity,
            &mut self.normal,
            &mut self.ratio,
            &mut self.turn,
            &mut self.coat_ratio,
            &mut self.coat_turn,
            &mut self.film,
            &mut self.film_thickness,
            &mut self.film_ior,
            &mut self.absorption,
            &mut self.dispersion,
            &mut self.diffuse_roughness,
        ]
    }
}

/// A fibre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct HairSlab {
    /// Of R, TT, TRT.
    pub(crate) tints: [Val; 3],
    pub(crate) ior: Val,
    /// Variance along the fibre and scale of the logistic across it, of the same.
    pub(crate) roughnesses: [Val; 3],
    /// 0.5: none; 0 to 1 is half a turn.
    pub(crate) cuticle: Val,
    /// By the fibre's radius.
    pub(crate) absorption: Val,
}

impl HairSlab {
    pub(crate) fn values(&mut self) -> [&mut Val; 9] {
        let [r, tt, trt] = &mut self.tints;
        let [of_r, of_tt, of_trt] = &mut self.roughnesses;
        [r, tt, trt, of_r, of_tt, of_trt, &mut self.ior, &mut self.cuticle, &mut self.absorption]
    }
}
