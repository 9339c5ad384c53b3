// SPDX-License-Identifier: Apache-2.0
//! Reduces graphs of closures (`surface` of BSDF and EDF nodes) to one slab: layers become a coat, a fuzz or the base;
//! mixtures and sums are handled in `mixture`.

use crate::expression::Val;
use crate::program::Op;
use crate::slab::OpenPbrSlab;
use crate::walk::{NetworkWalker, NodeAddress};

/// Most closures nested in each other.
const MAX_CLOSURES: usize = 32;

impl NetworkWalker<'_> {
    pub(super) fn closures(&mut self, at: NodeAddress) -> Option<OpenPbrSlab> {
        let mut slab = match self.source_node(at, "bsdf") {
            Some(bsdf) => self.bsdf(bsdf, 0)?,
            None => OpenPbrSlab::BLACK,
        };
        if let Some(edf) = self.source_node(at, "edf") {
            slab.emission = self.edf(edf, 0);
        }
        slab.opacity = self.number_or(at, "opacity", 1.0);
        Some(slab)
    }

    /// Emission of a node, which many may read: it is computed once, so the work is proportional to the nodes.
    fn edf(&mut self, at: NodeAddress, depth: usize) -> Val {
        match self.emissions.get(&at) {
            Some(Some(known)) => return *known,
            Some(None) => {
                let path = self.path(at);
                self.problem(format!("emission ({path}) is connected in a circle"));
                return Val::ZERO;
            }
            None => {}
        }
        self.emissions.insert(at, None);
        let found = self.edf_of(at, depth);
        self.emissions.insert(at, Some(found));
        found
    }

    fn edf_of(&mut self, at: NodeAddress, depth: usize) -> Val {
        let category = self.category(at);
        match &*category {
            "uniform_edf" | "conical_edf" | "measured_edf" => self.number_or(at, "color", 1.0),
            "generalized_schlick_edf" => {
                let base = self.source_node(at, "base");
                let color = self.number_or(at, "color0", 1.0);
                let below = base.filter(|_| depth < MAX_CLOSURES).map_or(Val::ONE, |base| self.edf(base, depth + 1));
                self.expressions.multiply(below, color)
            }
            "multiply" if depth < MAX_CLOSURES => {
                let inner = self.source_node(at, "in1").map_or(Val::ZERO, |inner| self.edf(inner, depth + 1));
                let factor = self.number_or(at, "in2", 1.0);
                self.expressions.multiply(inner, factor)
            }
            "add" | "mix" if depth < MAX_CLOSURES => {
                let names = if &*category == "add" { ["in1", "in2"] } else { ["bg", "fg"] };
                let [a, b] = names.map(|name| self.source_node(at, name));
                let [a, b] = [a, b].map(|inner| inner.map_or(Val::ZERO, |inner| self.edf(inner, depth + 1)));
                if &*category == "add" {
                    return self.expressions.add(a, b);
                }
                let share = self.number_or(at, "mix", 0.0);
                self.expressions.mix(a, b, share)
            }
            _ => match self.implementation(at) {
                Some(inner) if depth < MAX_CLOSURES => self.edf(inner, depth + 1),
                _ => {
                    self.unsupported(at, "emission by ");
                    Val::ZERO
                }
            },
        }
    }

    fn bsdf(&mut self, at: NodeAddress, depth: usize) -> Option<OpenPbrSlab> {
        self.once(at, depth > MAX_CLOSURES, |walker| walker.bsdf_of(at, depth))
    }

    /// Computes a slab once, however many read it: otherwise nodes whose inputs both read the next one would take twice
    /// as long with each. `None` if it is part of itself or too deep.
    pub(super) fn once(
        &mut self,
        at: NodeAddress,
        is_too_deep: bool,
        work: impl FnOnce(&mut Self) -> Option<OpenPbrSlab>,
    ) -> Option<OpenPbrSlab> {
        match self.slabs.get(&at) {
            Some(Some(known)) => return *known,
            None if !is_too_deep => {}
            _ => {
                let path = self.path(at);
                self.problem(format!("closures ({path}) are connected in a circle, or too deep"));
                return None;
            }
        }
        self.slabs.insert(at, None);
        let found = work(self);
        self.slabs.insert(at, Some(found));
        found
    }

    fn bsdf_of(&mut self, at: NodeAddress, depth: usize) -> Option<OpenPbrSlab> {
        let category = self.category(at);
        if let Some(slab) = self.lobe(at, &category) {
            return Some(slab);
        }
        let inner = |walker: &mut Self, name: &str| {
            let found = walker.source_node(at, name);
            found.and_then(|found| walker.bsdf(found, depth + 1))
        };
        match &*category {
            "layer" => {
                let base = inner(self, "base").unwrap_or(OpenPbrSlab::BLACK);
                if let Some(film) = self.source_node(at, "top").filter(|top| &*self.category(*top) == "thin_film_bsdf")
                {
                    return Some(self.filmed(film, base));
                }
                match inner(self, "top") {
                    Some(top) => Some(self.layered(at, &top, base)),
                    None => Some(base),
                }
            }
            "mix" => {
                let front = inner(self, "fg").unwrap_or(OpenPbrSlab::BLACK);
                let back = inner(self, "bg").unwrap_or(OpenPbrSlab::BLACK);
                let share = self.number_or(at, "mix", 0.0);
                Some(self.mixed(at, back, front, share))
            }
            "add" => {
                let (a, b) = (inner(self, "in1"), inner(self, "in2"));
                match (a, b) {
                    (Some(a), Some(b)) => Some(self.added(at, a, b)),
                    (a, b) => a.or(b),
                }
            }
            "multiply" => {
                let slab = inner(self, "in1")?;
                Some(self.multiplied(at, slab))
            }
            _ => match self.implementation(at) {
                Some(found) => self.bsdf(found, depth + 1),
                None => {
                    self.unsupported(at, "the closure ");
                    None
                }
            },
        }
    }

    /// A film of `MaterialX` 1.38, which is a closure on top of others: 1.39 has it as inputs of those.
    fn filmed(&mut self, film: NodeAddress, base: OpenPbrSlab) -> OpenPbrSlab {
        let thickness = self.number_or(film, "thickness", 550.0);
        let ior = self.number_or(film, "ior", 1.5);
        let weight = if thickness.is(0.0, 1) { Val::ZERO } else { Val::ONE };
        OpenPbrSlab { film_weight: weight, film_thickness: thickness, film_ior: ior, ..base }
    }

    /// A sheet of `MaterialX` 1.38, both sides of which have their own closures.
    pub(super) fn thin_surface(&mut self, at: NodeAddress) -> Option<OpenPbrSlab> {
        let mut slab = match self.source_node(at, "front_bsdf") {
            Some(bsdf) => self.bsdf(bsdf, 0)?,
            None => OpenPbrSlab::BLACK,
        };
        if let Some(edf) = self.source_node(at, "front_edf") {
            slab.emission = self.edf(edf, 0);
        }
        let is_other = ["bsdf", "edf"].into_iter().any(|of| {
            let [front, back] = ["front", "back"].map(|side| self.source_node(at, &format!("{side}_{of}")));
            back.is_some() && back != front
        });
        if is_other {
            let path = self.path(at);
            self.problem(format!("`thin_surface` ({path}): its back looks like its front"));
        }
        slab.opacity = self.number_or(at, "opacity", 1.0);
        slab.thin_walled = true;
        Some(slab)
    }

    /// One lobe.
    fn lobe(&mut self, at: NodeAddress, category: &str) -> Option<OpenPbrSlab> {
        let weight = self.number_or(at, "weight", 1.0);
        self.lobe_of(at, category, weight).map(|slab| OpenPbrSlab { weight, ..slab })
    }

    fn lobe_of(&mut self, at: NodeAddress, category: &str, weight: Val) -> Option<OpenPbrSlab> {
        let (roughness, alpha_ratio, rotation) = self.lobe_roughness(at);
        let film_thickness = self.number_or(at, "thinfilm_thickness", 0.0);
        let specular = OpenPbrSlab {
            roughness,
            alpha_ratio,
            rotation,
            film_weight: if film_thickness.is(0.0, 1) { Val::ZERO } else { Val::ONE },
            film_thickness,
            film_ior: self.number_or(at, "thinfilm_ior", 1.5),
            ..OpenPbrSlab::BLACK
        };
        Some(match category {
            "chiang_hair_bsdf" => OpenPbrSlab { hair: Some(self.hair(at)), ..OpenPbrSlab::BLACK },
            "oren_nayar_diffuse_bsdf" | "burley_diffuse_bsdf" | "subsurface_bsdf" | "translucent_bsdf" => {
                let color = self.number_or(at, "color", 0.18);
                let base_color = self.expressions.multiply(color, weight);
                let is_rough = category == "oren_nayar_diffuse_bsdf";
                let diffuse_roughness = if is_rough { self.number_or(at, "roughness", 0.0) } else { Val::ZERO };
                OpenPbrSlab { base_color, diffuse_roughness, normal: self.normal(at, "normal"), ..OpenPbrSlab::BLACK }
            }
            "sheen_bsdf" => {
                let color = self.number_or(at, "color", 1.0);
                let fuzz = self.expressions.multiply(color, weight);
                OpenPbrSlab { fuzz, fuzz_roughness: self.number_or(at, "roughness", 0.3), ..OpenPbrSlab::BLACK }
            }
            "dielectric_bsdf" => {
                let mode = self.text(at, "scatter_mode");
                let tint = self.number_or(at, "tint", 1.0);
                let transmission = if matches!(mode.as_deref(), Some("T" | "RT")) { weight } else { Val::ZERO };
                let reflects = mode.as_deref() != Some("T");
                OpenPbrSlab {
                    specular_weight: if reflects { weight } else { Val::ONE },
                    specular_color: if reflects && transmission == Val::ZERO { tint } else { Val::ONE },
                    transmission,
                    transmission_color: tint,
                    ior: self.number_or(at, "ior", 1.5),
                    normal: self.normal(at, "normal"),
                    ..specular
                }
            }
            "conductor_bsdf" => {
                let (index, extinction) = (self.number_or(at, "ior", 0.2), self.number_or(at, "extinction", 3.9));
                let base_color = self.conductor(index, extinction);
                let base_color = self.expressions.multiply(base_color, weight);
                OpenPbrSlab { base_color, metalness: Val::ONE, specular_weight: Val::ONE, ..specular }
            }
            "generalized_schlick_bsdf" => {
                let color = self.number_or(at, "color0", 1.0);
                let base_color = self.expressions.multiply(color, weight);
                OpenPbrSlab { base_color, metalness: Val::ONE, specular_weight: Val::ONE, ..specular }
            }
            _ => return None,
        })
    }

    /// Roughness, ratio and rotation of the two alphas that a lobe has. The roughness is the root of the root of the
    /// mean of their squares.
    fn lobe_roughness(&mut self, at: NodeAddress) -> (Val, Val, Val) {
        let alphas = self.number_or(at, "roughness", 0.05);
        let e = &mut self.expressions;
        let is_negative = alphas.constant().is_some_and(|[x, y, ..]| x.min(y) < 0.0);
        if is_negative || e.is_even(alphas) {
            let mean = e.dot(alphas, Val::number(0.5), 2);
            return (e.unary(Op::Sqrt, mean), Val::ONE, Val::ZERO);
        }
        let sum = e.dot(alphas, alphas, 2);
        let mean = e.multiply(sum, Val::number(0.5));
        let root = e.unary(Op::Sqrt, mean);
        let roughness = e.unary(Op::Sqrt, root);
        let [x, y] = [0, 1].map(|axis| e.component(alphas, axis));
        let (least, most) = (e.binary(Op::Min, x, y), e.binary(Op::Max, x, y));
        let is_across = e.binary(Op::Greater, y, x);
        let rotation = e.op(Op::Select, [Val::number(0.25), Val::ZERO, is_across], 0);
        (roughness, e.divide(least, most), rotation)
    }

    /// Computes ((n - 1)^2 + k^2) / ((n + 1)^2 + k^2).
    fn conductor(&mut self, index: Val, extinction: Val) -> Val {
        let e = &mut self.expressions;
        let square = e.multiply(extinction, extinction);
        let [above, below] = [-1.0, 1.0].map(|step| {
            let off = e.add(index, Val::number(step));
            e.op(Op::MultiplyAdd, [off, off, square], 0)
        });
        e.divide(above, below)
    }

    /// A layer over a slab: fuzz, the dielectric of the base, or a coat if there is a dielectric already.
    fn layered(&mut self, at: NodeAddress, top: &OpenPbrSlab, base: OpenPbrSlab) -> OpenPbrSlab {
        if top.hair.is_some() || base.hair.is_some() {
            return OpenPbrSlab { hair: self.shared_hair(at, &base, top, Val::ONE), ..base };
        }
        let base = OpenPbrSlab { weight: if top.weight == base.weight { base.weight } else { Val::ONE }, ..base };
        if !top.fuzz.is(0.0, 3) {
            return OpenPbrSlab { fuzz: top.fuzz, fuzz_roughness: top.fuzz_roughness, ..base };
        }
        let is_bare = base.specular_weight.is(0.0, 1) && base.metalness.is(0.0, 1) && base.transmission.is(0.0, 1);
        if is_bare {
            return OpenPbrSlab {
                specular_weight: top.specular_weight,
                specular_color: top.specular_color,
                roughness: top.roughness,
                ior: top.ior,
                normal: top.normal,
                alpha_ratio: top.alpha_ratio,
                rotation: top.rotation,
                film_weight: top.film_weight,
                film_thickness: top.film_thickness,
                film_ior: top.film_ior,
                ..base
            };
        }
        let (coat, coat_roughness, coat_ior) = (top.specular_weight, top.roughness, top.ior);
        OpenPbrSlab {
            coat,
            coat_roughness,
            coat_ior,
            coat_alpha_ratio: top.alpha_ratio,
            coat_rotation: top.rotation,
            ..base
        }
    }
}
