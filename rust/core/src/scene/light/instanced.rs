// SPDX-License-Identifier: Apache-2.0
//! Lights inside prototypes: where each of their instances is. Pure.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DAffine3;

use crate::array::ElementType;
use crate::desc::PrimDesc;
use crate::mesh::Aabb;
use crate::scene::entries::InstancerEntry;
use crate::scene::placement::{Placer, usable_affine};
use crate::scene::resolve::MAX_LEVELS;

/// Most places of lights in a scene.
pub(crate) const MAX_INSTANCED_LIGHTS: usize = 1 << 20;

/// World transforms of a prim: one, or one for each instance of the prototypes that it is in, in the order of the
/// instancers' arrays. Hidden instancers, unusable matrices and instancers inside themselves give none. Not more than
/// `most`; the flag tells that there would be.
pub(crate) fn placements(
    prim: &PrimDesc,
    instancers: &BTreeMap<Arc<str>, InstancerEntry>,
    most: usize,
) -> (Vec<DAffine3>, bool) {
    let mut places = Places { instancers, most, steps: 0, is_cut: false };
    let mut worlds = Vec::new();
    places.of(prim, 0, &mut worlds);
    (worlds, places.is_cut)
}

struct Places<'a> {
    instancers: &'a BTreeMap<Arc<str>, InstancerEntry>,
    most: usize,
    /// Prims looked at: bounds what instancers that meet themselves cost.
    steps: usize,
    is_cut: bool,
}

/// Most prims looked at for one light.
const MAX_STEPS: usize = 1 << 16;

impl Places<'_> {
    /// Appends the world transforms of `prim`. Depth is bounded, so the recursion is; so is what an instancer inside
    /// itself gives.
    fn of(&mut self, prim: &PrimDesc, depth: u32, out: &mut Vec<DAffine3>) {
        let Some(local) = affine(&prim.transform) else { return };
        if prim.instanced_by.is_empty() {
            self.push(local, out);
            return;
        }
        self.steps += 1;
        if depth >= MAX_LEVELS || self.steps > MAX_STEPS {
            return;
        }
        for (k, by) in prim.instanced_by.iter().enumerate() {
            let instancer =
                self.instancers.get(&by.instancer).filter(|entry| entry.is_usable && entry.desc.prim.visible);
            let Some(entry) = instancer.filter(|_| !prim.instanced_by[..k].contains(by)) else {
                continue;
            };
            let mut parents = Vec::new();
            self.of(&entry.desc.prim, depth + 1, &mut parents);
            for parent in parents {
                for prototype in entry.desc.prototypes.iter().filter(|p| p.root == by.prototype_root) {
                    let unit = Aabb { min: [0.0; 3], max: [1.0; 3] };
                    let placer = Placer::new(parent, local, Some(&entry.arrays), &unit);
                    let indices = prototype.indices.view();
                    if indices.element() != ElementType::I32 {
                        continue;
                    }
                    let shown =
                        |n: usize| entry.arrays.mask.as_ref().is_none_or(|mask| mask.boolean(n).unwrap_or(true));
                    let numbers =
                        (0..indices.len()).filter_map(|i| indices.index(i)).filter_map(|n| usize::try_from(n).ok());
                    for number in numbers.filter(|&n| n < entry.arrays.len() && shown(n)) {
                        if self.is_cut {
                            return;
                        }
                        let world = placer.matrix(Some(number)).filter(DAffine3::is_finite);
                        if let Some(world) = world {
                            self.push(world, out);
                        }
                    }
                }
            }
        }
    }

    fn push(&mut self, world: DAffine3, out: &mut Vec<DAffine3>) {
        if out.len() < self.most {
            out.push(world);
        } else {
            self.is_cut = true;
        }
    }
}

/// Lights may be flat, which other prims may not.
fn affine(m: &glam::DMat4) -> Option<DAffine3> {
    usable_affine(m).or_else(|| {
        let is_affine = (m.row(3) - glam::DVec4::W).abs().max_element() <= 1e-9;
        (is_affine && m.is_finite()).then(|| DAffine3::from_mat4(*m))
    })
}
