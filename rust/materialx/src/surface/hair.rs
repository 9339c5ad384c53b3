// SPDX-License-Identifier: Apache-2.0
//! A fibre (`chiang_hair_bsdf`): what it says, mixtures of fibres, and where its numbers go among the inputs.

use super::{DEFAULTS, Input, LoweredSurface};
use crate::expression::Val;
use crate::program::Op;
use crate::slab::{HairSlab, OpenPbrSlab};
use crate::uses::MaterialUses;
use crate::walk::{NetworkWalker, NodeAddress};
use oocpt_abi::HAIR_BY_NORMAL;

impl HairSlab {
    /// The same fibre, brighter or darker.
    pub(super) fn multiplied(mut self, walker: &mut NetworkWalker<'_>, factor: Val) -> Self {
        self.tints = self.tints.map(|tint| walker.expressions.multiply(tint, factor));
        self
    }
}

impl NetworkWalker<'_> {
    pub(super) fn hair(&mut self, at: NodeAddress) -> HairSlab {
        // A curve's own are what they should be: of a tube there is no other.
        for name in ["normal", "curve_direction"] {
            if self.is_said(at, name) {
                let path = self.path(at);
                self.problem(format!("{path}: `{name}` of hair is that of the curve"));
            }
        }
        HairSlab {
            tints: ["tint_R", "tint_TT", "tint_TRT"].map(|name| self.number_or(at, name, 1.0)),
            ior: self.number_or(at, "ior", 1.55),
            roughnesses: [("roughness_R", 0.1), ("roughness_TT", 0.05), ("roughness_TRT", 0.2)]
                .map(|(name, default)| self.number_or(at, name, default)),
            cuticle: self.number_or(at, "cuticle_angle", 0.5),
            absorption: self.number_or(at, "absorption_coefficient", 0.0),
        }
    }

    /// Two slabs of which one is a fibre, or both: a mixture of fibres is the fibre of mixed numbers; of a fibre and
    /// something else the fibre is left.
    pub(super) fn shared_hair(
        &mut self,
        at: NodeAddress,
        back: &OpenPbrSlab,
        front: &OpenPbrSlab,
        share: Val,
    ) -> Option<HairSlab> {
        match (back.hair, front.hair) {
            (Some(mut a), Some(mut b)) => {
                let mut whole = a;
                for ((to, a), b) in whole.values().into_iter().zip(a.values()).zip(b.values()) {
                    *to = self.expressions.mix(*a, *b, share);
                }
                Some(whole)
            }
            (Some(one), None) | (None, Some(one)) => {
                let path = self.path(at);
                self.problem(format!("{path}: hair is mixed with or layered on what is no hair: hair alone is left"));
                Some(one)
            }
            (None, None) => None,
        }
    }

    /// See [`Input`]: tints are colours of the slab, roughnesses and the tilt are packed where anisotropy and the film
    /// are.
    pub(super) fn lower_hair(&mut self, slab: &OpenPbrSlab, hair: &HairSlab) -> LoweredSurface {
        let slot = self.uses.primvar(MaterialUses::ACROSS, [HAIR_BY_NORMAL; 4]);
        let across = match slot {
            Some(_) => self.primvar(MaterialUses::ACROSS, [HAIR_BY_NORMAL; 4]),
            // Two other primvars are read: ribbons are seen as if they were tubes.
            None => Val::number(HAIR_BY_NORMAL),
        };
        let e = &mut self.expressions;
        let parts = |e: &mut crate::expression::ExpressionGraph, val: Val| [0, 1].map(|k| e.component(val, k));
        let [of_r, of_tt, of_trt] = hair.roughnesses.map(|val| parts(e, val));
        // 0..1 is -pi / 2..pi / 2.
        let half_turn = [Val::number(std::f32::consts::PI), Val::number(-std::f32::consts::FRAC_PI_2)];
        let cuticle = e.op(Op::Clamp, [hair.cuticle, Val::ZERO, Val::ONE], 0);
        let tilt = if cuticle.is(0.5, 1) {
            Val::ZERO
        } else {
            e.op(Op::MultiplyAdd, [cuticle, half_turn[0], half_turn[1]], 0)
        };
        let both = e.combine(&[of_r[0], of_r[1], of_tt[0], of_tt[1]]);
        let last = e.combine(&[of_trt[0], of_trt[1], tilt]);
        let mut inputs = DEFAULTS.map(Val::Constant);
        let mut set = |input: Input, val: Val| inputs[input as usize] = val;
        set(Input::DiffuseColor, hair.tints[0]);
        set(Input::SpecularColor, hair.tints[1]);
        set(Input::TransmissionColor, hair.tints[2]);
        set(Input::Ior, hair.ior);
        set(Input::Normal, across);
        set(Input::Anisotropy, both);
        set(Input::ThinFilm, last);
        set(Input::Absorption, hair.absorption);
        set(Input::EmissiveColor, slab.emission);
        set(Input::Opacity, slab.opacity);
        LoweredSurface {
            inputs,
            specular_workflow: false,
            opacity_threshold: slab.opacity_threshold,
            thin_walled: false,
            dispersive: false,
            hair: true,
        }
    }
}
