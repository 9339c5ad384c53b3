// SPDX-License-Identifier: Apache-2.0
//! Heights made into normals: `heighttonormal` and `bump`.
//!
//! The height's program is worked out at places to either side (central differences): texture coordinates moved by
//! half of [`STEP`] along u and v, points by as much along tangent and bitangent. So a texture's slope is that of its
//! filtered texels, and a height of anything else is its own. The convention is `MaterialX`'s (1.39,
//! `mx_heighttonormal_vector3`): the normal is (-dh/du, -dh/dv, 1) with slopes times scale / 16, normalised.

use crate::expression::{Expression, Val};
use crate::program::{Geometry, Op};
use crate::uses::MaterialUses;
use crate::walk::{NetworkWalker, NodeAddress};
use std::collections::HashMap;

/// Between the two places of a difference: two texels of a file of 2048.
const STEP: f32 = 1.0 / 1024.0;
/// Of `MaterialX`: slopes as Sobel's filter has them.
const SOBEL: f32 = 1.0 / 16.0;

impl NetworkWalker<'_> {
    /// The vector in the frame of the surface that a height says, not normalised.
    pub(crate) fn height_normal(&mut self, at: NodeAddress, height: &str) -> Val {
        let height = self.number_or(at, height, 0.0);
        let scale = self.number_or(at, "scale", 1.0);
        let height = self.expressions.component(height, 0);
        let slopes = [0, 1].map(|axis| {
            let [above, below] = [0.5 * STEP, -0.5 * STEP].map(|by| self.moved(height, axis, by));
            let e = &mut self.expressions;
            // Below less above: the normal leans away from what rises.
            let fall = e.subtract(below, above);
            let slope = e.multiply(fall, Val::number(SOBEL / STEP));
            e.multiply(slope, scale)
        });
        self.expressions.combine(&[slopes[0], slopes[1], Val::ONE])
    }

    /// What a value is at a place that is moved along an axis of the surface.
    fn moved(&mut self, val: Val, axis: usize, by: f32) -> Val {
        let mut known: HashMap<u32, Val> = HashMap::new();
        let at = |known: &HashMap<u32, Val>, val: Val| match val {
            Val::Constant(_) => val,
            Val::Node(at) => known.get(&at).copied().unwrap_or(val),
        };
        for number in self.expressions.needed(&[val]) {
            let Some(&Expression { op, arguments, immediate }) = self.expressions.get(number) else { continue };
            let [a, b, c] = arguments.map(|argument| at(&known, argument));
            let moved = match op {
                Op::Surface => self.moved_leaf(Val::Node(number), immediate, axis, by),
                Op::Texture => self.moved_lookup(Val::Node(number), a, immediate),
                _ => self.expressions.op(op, [a, b, c], immediate),
            };
            known.insert(number, moved);
        }
        at(&known, val)
    }

    fn moved_leaf(&mut self, leaf: Val, immediate: u16, axis: usize, by: f32) -> Val {
        let is = |what: Geometry| immediate == what as u16;
        let slot = [Geometry::Primvar0, Geometry::Primvar1].into_iter().position(is);
        let is_point =
            |slot: usize| self.uses.primvars.get(slot).is_some_and(|found| &*found.name == MaterialUses::POSITION);
        if is(Geometry::Uv0) || is(Geometry::Uv1) {
            let mut step = [0.0; 4];
            step[axis] = by;
            return self.expressions.add(leaf, Val::Constant(step));
        }
        if is(Geometry::Position) || slot.is_some_and(is_point) {
            let e = &mut self.expressions;
            let along = e.geometry(if axis == 0 { Geometry::Tangent } else { Geometry::Bitangent });
            // The tangent is that of the first set.
            self.texcoord("st");
            return self.expressions.op(Op::MultiplyAdd, [along, Val::number(by), leaf], 0);
        }
        leaf
    }

    fn moved_lookup(&mut self, lookup: Val, place: Val, number: u16) -> Val {
        let Some(found) = self.uses.lookups.get(usize::from(number)).copied() else { return lookup };
        if found.place == place {
            return lookup;
        }
        let Some(texture) = self.uses.textures.get(found.texture as usize).cloned() else { return lookup };
        match self.uses.lookup(&texture, place) {
            Some(moved) => self.expressions.op(Op::Texture, [place, Val::ZERO, Val::ZERO], moved),
            None => {
                self.problem("too many texture lookups".to_owned());
                lookup
            }
        }
    }

    /// As a colour of a normal map.
    pub(super) fn height_to_normal(&mut self, at: NodeAddress) -> Val {
        let local = self.height_normal(at, "in");
        let e = &mut self.expressions;
        let unit = e.normalize(local, 3);
        e.op(Op::MultiplyAdd, [unit, Val::number(0.5), Val::Constant([0.5, 0.5, 0.5, 0.0])], 0)
    }

    /// In the world.
    pub(super) fn bump(&mut self, at: NodeAddress) -> Val {
        let local = self.height_normal(at, "height");
        self.in_world(at, local)
    }
}
