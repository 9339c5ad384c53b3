// SPDX-License-Identifier: Apache-2.0
//! The common form of surface shaders and closures: a slab of `OpenPBR`, or a fibre.

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
    /// The threshold of cutouts; 0 if the opacity is a probability.
    pub(crate) opacity_threshold: f32,
    /// The normal in the frame of the surface.
    pub(crate) normal: Val,
    /// The smaller by the larger alpha of the microfacet distribution. `roughness` is that of the mean of their
    /// squares.
    pub(crate) alpha_ratio: Val,
    /// Of the tangent, in turns.
    pub(crate) rotation: Val,
    pub(crate) coat_alpha_ratio: Val,
    pub(crate) coat_rotation: Val,
    pub(crate) film_weight: Val,
    /// In nm.
    pub(crate) film_thickness: Val,
    pub(crate) film_ior: Val,
    pub(crate) absorption: Val,
    /// 1 / the Abbe number; 0: no dispersion.
    pub(crate) dispersion: Val,
    pub(crate) diffuse_roughness: Val,
    pub(crate) thin_walled: bool,
    /// The closure's weight in a sum; its colours contain it too.
    pub(crate) weight: Val,
    /// The parameters of a fibre: of the rest only emission and opacity count.
    pub(crate) hair: Option<HairSlab>,
}

impl OpenPbrSlab {
    /// A black slab.
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
        alpha_ratio: Val::ONE,
        rotation: Val::ZERO,
        coat_alpha_ratio: Val::ONE,
        coat_rotation: Val::ZERO,
        film_weight: Val::ZERO,
        film_thickness: Val::ZERO,
        film_ior: Val::Constant([1.4; 4]),
        absorption: Val::ZERO,
        dispersion: Val::ZERO,
        diffuse_roughness: Val::ZERO,
        thin_walled: false,
        weight: Val::ONE,
        hair: None,
    };

    /// Returns true if the index depends on the channel.
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
            &mut self.alpha_ratio,
            &mut self.rotation,
            &mut self.coat_alpha_ratio,
            &mut self.coat_rotation,
            &mut self.film_weight,
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
    /// Tints of R, TT, TRT.
    pub(crate) tints: [Val; 3],
    pub(crate) ior: Val,
    /// Variance along the fibre and scale of the logistic across it, for R, TT, TRT.
    pub(crate) roughnesses: [Val; 3],
    /// Tilt of the cuticle: 0.5 is none; 0 to 1 is half a turn.
    pub(crate) cuticle: Val,
    /// Absorption by the fibre's radius.
    pub(crate) absorption: Val,
}

impl HairSlab {
    pub(crate) fn values(&mut self) -> [&mut Val; 9] {
        let [r, tt, trt] = &mut self.tints;
        let [of_r, of_tt, of_trt] = &mut self.roughnesses;
        [r, tt, trt, of_r, of_tt, of_trt, &mut self.ior, &mut self.cuticle, &mut self.absorption]
    }
}
