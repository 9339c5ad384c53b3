// SPDX-License-Identifier: Apache-2.0
//! Mixtures and sums of slabs: one slab of mixed parameters where that is what is asked for, else one of the two by
//! chance.
//!
//! A BSDF is linear in a mixture, so a hit that takes the front with the probability of its share is right in the mean
//! (decisions/0046). Emission and opacity are mixed: nothing that is chosen is in them.

use crate::expression::Val;
use crate::program::{Geometry, Op};
use crate::slab::OpenPbrSlab;
use crate::value::PortType;
use crate::walk::{NetworkWalker, NodeAddress};

/// How much more than 1 the weights of a sum may be: rounding.
const WHOLE: f32 = 1.0001;

/// Which lobes a slab may have.
#[derive(Clone, Copy)]
struct SlabLobes {
    metal: bool,
    /// What is not metal.
    below: bool,
    glass: bool,
    diffuse: bool,
    /// Reflects by its index.
    dielectric: bool,
    film: bool,
    coat: bool,
    fuzz: bool,
}

impl SlabLobes {
    fn of(slab: &OpenPbrSlab) -> Self {
        let metal = !slab.metalness.is(0.0, 1);
        let below = !slab.metalness.is(1.0, 1);
        let glass = below && !slab.transmission.is(0.0, 1);
        let is_black = slab.base_color.is(0.0, 3) && (slab.subsurface.is(0.0, 1) || slab.subsurface_color.is(0.0, 3));
        let dielectric = below && (glass || !slab.specular_weight.is(0.0, 1));
        Self {
            metal,
            below,
            glass,
            diffuse: below && !slab.transmission.is(1.0, 1) && !is_black,
            dielectric,
            film: !slab.film.is(0.0, 1) && (metal || dielectric),
            coat: !slab.coat.is(0.0, 1),
            fuzz: !slab.fuzz.is(0.0, 3),
        }
    }

    /// Whether it has one of the base's roughness.
    fn has_interface(self) -> bool {
        self.metal || self.dielectric
    }

    /// Whether light is scattered at all.
    fn has_some(self) -> bool {
        self.has_interface() || self.diffuse || self.coat || self.fuzz
    }
}

/// What of a slab differs from another.
#[derive(Clone, Copy)]
struct SlabDifferences {
    /// Of the diffuse lobe and metal.
    color: bool,
    /// Of metal and glass.
    shares: bool,
    /// What the slab is not linear in.
    shape: bool,
}

impl OpenPbrSlab {
    /// What counts for a lobe that it does not have, as the other one has it: in a mixture it is that one's alone.
    fn borrowing(mut self, from: &Self) -> Self {
        let own = SlabLobes::of(&self);
        let base = Self { normal: self.normal, emission: self.emission, opacity: self.opacity, ..*from };
        if !own.has_interface() {
            (self.roughness, self.ratio, self.turn) = (base.roughness, base.ratio, base.turn);
        }
        if !own.film {
            (self.film_thickness, self.film_ior) = (base.film_thickness, base.film_ior);
            if !own.has_interface() {
                self.film = base.film;
            }
        }
        if !own.dielectric {
            self.ior = base.ior;
        }
        if !own.below {
            (self.specular_weight, self.specular_color) = (base.specular_weight, base.specular_color);
            (self.transmission, self.subsurface) = (base.transmission, base.subsurface);
        } else if self.specular_weight.is(0.0, 1) {
            self.specular_color = base.specular_color;
        }
        if !own.glass {
            self.transmission_color = base.transmission_color;
            (self.absorption, self.dispersion) = (base.absorption, base.dispersion);
        }
        if !own.metal && self.transmission.is(1.0, 1) {
            (self.base_color, self.subsurface) = (base.base_color, base.subsurface);
        }
        if self.subsurface.is(0.0, 1) || !own.below {
            self.subsurface_color = base.subsurface_color;
        }
        if !own.diffuse {
            self.diffuse_roughness = base.diffuse_roughness;
        }
        if !own.coat {
            (self.coat_color, self.coat_ior) = (base.coat_color, base.coat_ior);
            (self.coat_roughness, self.coat_ratio, self.coat_turn) =
                (base.coat_roughness, base.coat_ratio, base.coat_turn);
        }
        if !own.fuzz {
            self.fuzz_roughness = base.fuzz_roughness;
        }
        if !own.has_some() {
            self.normal = from.normal;
        }
        self
    }

    fn differences(&self, other: &Self) -> SlabDifferences {
        let (a, b) = (self, other);
        SlabDifferences {
            color: a.base_color != b.base_color
                || a.subsurface != b.subsurface
                || a.subsurface_color != b.subsurface_color,
            shares: a.metalness != b.metalness || a.transmission != b.transmission,
            shape: [a.roughness, a.ior, a.ratio, a.turn, a.normal] != [b.roughness, b.ior, b.ratio, b.turn, b.normal]
                || [a.film_thickness, a.film_ior] != [b.film_thickness, b.film_ior]
                || [a.coat_roughness, a.coat_ior, a.coat_ratio, a.coat_turn]
                    != [b.coat_roughness, b.coat_ior, b.coat_ratio, b.coat_turn]
                || [a.fuzz_roughness, a.diffuse_roughness] != [b.fuzz_roughness, b.diffuse_roughness]
                || [a.absorption, a.dispersion] != [b.absorption, b.dispersion],
        }
    }

    /// Whether the slab of mixed parameters is the mixture: no roughness, index or normal differs, and no two factors
    /// of one product. What a layer takes from the ones below does not count.
    fn mixes_exactly(&self, other: &Self) -> bool {
        let (a, b) = (self, other);
        let SlabDifferences { color, shares, shape } = a.differences(b);
        let weight = a.specular_weight != b.specular_weight;
        let coat = a.coat != b.coat;
        let coat_color = a.coat_color != b.coat_color;
        let is_tinted = !(a.coat_color.is(1.0, 3) && b.coat_color.is(1.0, 3));
        let has_metal = !(a.metalness.is(0.0, 1) && b.metalness.is(0.0, 1));
        let products = [
            color && shares,
            a.metalness != b.metalness && (weight || a.transmission != b.transmission),
            a.specular_color != b.specular_color && (weight || shares),
            a.transmission_color != b.transmission_color && shares,
            a.film != b.film && (shares || weight || color && has_metal),
            coat && coat_color,
            is_tinted && (coat || coat_color) && (color || shares),
        ];
        !shape && !products.contains(&true)
    }

    /// Its reflection and what it transmits, so much more of it.
    pub(super) fn multiplied(mut self, walker: &mut NetworkWalker<'_>, factor: Val) -> Self {
        for color in [&mut self.base_color, &mut self.specular_weight, &mut self.fuzz, &mut self.subsurface_color] {
            *color = walker.expressions.multiply(*color, factor);
        }
        self
    }
}

/// Two slabs with what counts only for lobes of the other one as that has it, and what counts for none the same.
fn one_for_the_other(back: &OpenPbrSlab, front: &OpenPbrSlab) -> [OpenPbrSlab; 2] {
    let back = back.borrowing(front);
    [back, front.borrowing(&back)]
}

impl NetworkWalker<'_> {
    /// A mixture of two surfaces or closures: `share` of the front.
    pub(super) fn mixed(&mut self, at: NodeAddress, back: OpenPbrSlab, front: OpenPbrSlab, share: Val) -> OpenPbrSlab {
        let within = self.share_of_what_is_there(&back, &front, share);
        if back.hair.is_some() || front.hair.is_some() {
            let hair = self.shared_hair(at, &back, &front, share);
            return OpenPbrSlab { hair, ..self.means([back, front], [share, within]) };
        }
        if back.thin_walled != front.thin_walled {
            let solid = if back.thin_walled { &front } else { &back };
            if SlabLobes::of(solid).glass {
                let path = self.path(at);
                self.problem(format!("{path}: a thin wall is mixed with solid glass: all of it is a thin wall"));
            }
        }
        if within.is(0.0, 1) || within.is(1.0, 1) {
            return self.means([back, front], [share, within]);
        }
        let slabs = one_for_the_other(&back, &front);
        if !slabs[0].mixes_exactly(&slabs[1])
            && let Some(random) = self.random(at)
        {
            let takes_front = self.expressions.binary(Op::Greater, within, random);
            return self.chosen(slabs, takes_front, [share, within]);
        }
        self.means(slabs, [share, within])
    }

    /// Of a hit, the surface is there: with opacities that differ that tells something of which it is.
    fn share_of_what_is_there(&mut self, back: &OpenPbrSlab, front: &OpenPbrSlab, share: Val) -> Val {
        let is_chance = back.opacity_threshold == 0.0 && front.opacity_threshold == 0.0;
        if back.opacity == front.opacity || !is_chance {
            return share;
        }
        let e = &mut self.expressions;
        let opacity = e.mix(back.opacity, front.opacity, share);
        let part = e.multiply(share, front.opacity);
        e.divide(part, opacity)
    }

    /// The slab of mixed parameters.
    fn means(&mut self, mut slabs: [OpenPbrSlab; 2], [share, within]: [Val; 2]) -> OpenPbrSlab {
        if self.choices > 0 {
            slabs = slabs.map(|slab| self.tinted(slab));
        }
        let [mut back, mut front] = slabs;
        let mut whole = back;
        let pairs: Vec<(Val, Val)> = back.values().into_iter().zip(front.values()).map(|(a, b)| (*a, *b)).collect();
        for (to, (a, b)) in whole.values().into_iter().zip(pairs) {
            *to = self.expressions.mix(a, b, within);
        }
        self.finish(whole, [&back, &front], share)
    }

    /// What is of the whole of a mixture, however the rest is found.
    fn finish(&mut self, whole: OpenPbrSlab, [back, front]: [&OpenPbrSlab; 2], share: Val) -> OpenPbrSlab {
        OpenPbrSlab {
            opacity: self.expressions.mix(back.opacity, front.opacity, share),
            weight: self.expressions.mix(back.weight, front.weight, share),
            opacity_threshold: back.opacity_threshold.max(front.opacity_threshold),
            thin_walled: back.thin_walled || front.thin_walled,
            ..whole
        }
    }

    /// One of two slabs; emission and opacity are mixed.
    fn chosen(&mut self, [back, front]: [OpenPbrSlab; 2], takes_front: Val, [share, within]: [Val; 2]) -> OpenPbrSlab {
        let [mut back, mut front] = [back, front].map(|slab| self.tinted(slab));
        let mut whole = back;
        let pairs: Vec<(Val, Val)> = back.values().into_iter().zip(front.values()).map(|(a, b)| (*a, *b)).collect();
        for (to, (a, b)) in whole.values().into_iter().zip(pairs) {
            *to = self.expressions.op(Op::Select, [b, a, takes_front], 0);
        }
        whole.emission = self.expressions.mix(back.emission, front.emission, within);
        self.finish(whole, [&back, &front], share)
    }

    /// The same slab under a coat without a colour. A coat may be chosen by chance, and its tint is in what emits.
    fn tinted(&mut self, slab: OpenPbrSlab) -> OpenPbrSlab {
        let e = &mut self.expressions;
        let tint = e.mix(Val::ONE, slab.coat_color, slab.coat);
        OpenPbrSlab {
            base_color: e.multiply(slab.base_color, tint),
            subsurface_color: e.multiply(slab.subsurface_color, tint),
            emission: e.multiply(slab.emission, tint),
            coat_color: Val::ONE,
            ..slab
        }
    }

    /// A random number of the hit that no other choice of the material has; says where there is none left.
    fn random(&mut self, at: NodeAddress) -> Option<Val> {
        let Some(which) = Geometry::RANDOM.get(self.choices) else {
            let path = self.path(at);
            let most = Geometry::RANDOM.len() + 1;
            self.problem(format!("{path}: more than {most} sets of lobes are mixed: the means of two stand for them"));
            return None;
        };
        self.choices += 1;
        Some(self.expressions.geometry(*which))
    }

    /// A sum of closures: colours add, the rest is the first's where it has any; or one of the two by its weight.
    pub(super) fn added(&mut self, at: NodeAddress, a: OpenPbrSlab, b: OpenPbrSlab) -> OpenPbrSlab {
        if let Some(chosen) = self.added_by_chance(at, &a, &b) {
            return chosen;
        }
        let mut whole = if a.specular_weight.is(0.0, 1) { b } else { a };
        whole.base_color = self.expressions.add(a.base_color, b.base_color);
        whole.fuzz = self.expressions.add(a.fuzz, b.fuzz);
        whole.transmission = self.expressions.add(a.transmission, b.transmission);
        whole.weight = self.expressions.add(a.weight, b.weight);
        if let (Some(one), Some(_)) = (a.hair, b.hair) {
            let path = self.path(at);
            self.problem(format!("{path}: fibres are added: the first one is left"));
            whole.hair = Some(one);
        } else {
            whole.hair = self.shared_hair(at, &a, &b, Val::ZERO);
        }
        whole
    }

    /// a + b = p (a / p) + (1 - p) (b / (1 - p)), where p is a's share of the weights. `None` where one slab is both,
    /// or one of them would have to reflect more than all.
    fn added_by_chance(&mut self, at: NodeAddress, a: &OpenPbrSlab, b: &OpenPbrSlab) -> Option<OpenPbrSlab> {
        if a.hair.is_some() || b.hair.is_some() {
            return None;
        }
        let [mut one, mut other] = one_for_the_other(a, b);
        let is_one_slab = !one.differences(&other).shape && one.metalness == other.metalness;
        let both = SlabLobes::of(a).has_some() && SlabLobes::of(b).has_some();
        if is_one_slab || !both || a.weight.is(0.0, 1) || b.weight.is(0.0, 1) {
            return None;
        }
        let e = &mut self.expressions;
        let sum = e.add(a.weight, b.weight);
        if let Some([sum, ..]) = sum.constant()
            && !(0.0..=WHOLE).contains(&sum)
        {
            let path = self.path(at);
            self.problem(format!(
                "{path}: what is added weighs {sum}, more than 1: its roughness is that of the first"
            ));
            return None;
        }
        let part = e.divide(b.weight, sum);
        let factors = [a.weight, b.weight].map(|weight| e.divide(sum, weight));
        let random = self.random(at)?;
        for (slab, factor) in [&mut one, &mut other].into_iter().zip(factors) {
            *slab = slab.multiplied(self, factor);
            slab.transmission = self.expressions.multiply(slab.transmission, factor);
        }
        let takes_other = self.expressions.binary(Op::Greater, part, random);
        Some(OpenPbrSlab { weight: sum, ..self.chosen([one, other], takes_other, [part, part]) })
    }

    /// `multiply`: a closure and a number or a colour.
    pub(super) fn multiplied(&mut self, at: NodeAddress, slab: OpenPbrSlab) -> OpenPbrSlab {
        let factor = self.number_or(at, "in2", 1.0);
        let hair = slab.hair.map(|hair| hair.multiplied(self, factor));
        let is_number = self.input_type(at, "in2") == PortType::Float;
        let weight = if is_number { self.expressions.multiply(slab.weight, factor) } else { slab.weight };
        OpenPbrSlab { hair, weight, ..slab.multiplied(self, factor) }
    }
}
