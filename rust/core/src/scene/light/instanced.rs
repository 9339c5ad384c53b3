// SPDX-License-Identifier: Apache-2.0
//! Lights inside prototypes: computes the position and the motion of each of their instances. Pure.
//!
//! The motions in a chain of instancers are composed at times of the shutter, at most [`MAX_KEYS`] of them. Where keys
//! cannot describe the result, as for a lamp on an arm that turns, the path between two times is straight: for a
//! quarter turn its error is at most 0.14 % of the arm's length.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{DAffine3, DMat4, DVec4};
use rustc_hash::FxHashSet;

use crate::array::ElementType;
use crate::desc::{PrimDesc, TransformSample};
use crate::instancing::affine::usable_affine;
use crate::instancing::array_motion::transform_motion;
use crate::instancing::motion::{MAX_KEYS, map_at, motion_keys, thin_out};
use crate::instancing::placement::InstancePlacer;
use crate::mesh::Aabb;
use crate::scene::entries::InstancerEntry;
use crate::scene::resolve::MAX_NESTING;

/// Largest number of placed lights in a scene.
pub(crate) const MAX_INSTANCED_LIGHTS: usize = 1 << 20;

/// Relative error up to which fewer keys replace a motion.
const SAME_MOTION: f64 = 1e-9;

/// A placement of a light prim.
#[derive(Clone, Debug)]
pub(crate) struct PlacedLight {
    /// World transform at the frame's own time.
    pub(crate) world: DAffine3,
    /// Transforms at times of the shutter; empty if it does not move.
    pub(crate) samples: Vec<TransformSample>,
}

/// World transforms of a prim: one, or one for each instance of the prototypes that it is in, in the order of the
/// instancers' arrays. Hidden instancers, unusable matrices and instancers inside themselves give none. At most `most`;
/// the flag is true if there are more.
pub(crate) fn placements(
    prim: &PrimDesc,
    instancers: &BTreeMap<Arc<str>, InstancerEntry>,
    most: usize,
) -> (Vec<PlacedLight>, bool) {
    let own = key_times(prim, instancers);
    let times = split(&own);
    let mut places = LightInstances { instancers, times: &times, most, steps: 0, is_cut: false };
    let mut worlds = Vec::new();
    places.of(prim, 0, &mut worlds);
    let placed = |ways: &TimedTransforms| PlacedLight { world: ways[0], samples: samples(&ways[1..], &times, &own) };
    (worlds.iter().map(placed).collect(), places.is_cut)
}

/// The times while the shutter is open at which a prim or something that contains it has a key, with its opening and
/// closing; none if nothing moves.
fn key_times(prim: &PrimDesc, instancers: &BTreeMap<Arc<str>, InstancerEntry>) -> Vec<f64> {
    let (mut times, mut moves) = (vec![0.0, 1.0], false);
    let (mut prims, mut seen) = (vec![prim], FxHashSet::default());
    while let Some(prim) = prims.pop() {
        if let Ok(Some(motion)) = transform_motion(&prim.motion) {
            moves = true;
            times.extend(motion.iter().map(|sample| sample.time));
        }
        for by in prim.instanced_by.iter().filter(|by| seen.insert(by.instancer.clone())) {
            let Some(entry) = instancers.get(&by.instancer) else { continue };
            if let Some(motion) = &entry.arrays.motion {
                moves = true;
                times.extend(motion.times());
            }
            prims.push(&entry.desc.prim);
        }
    }
    times.retain(|time| moves && (0.0..=1.0).contains(time));
    times.sort_by(f64::total_cmp);
    times.dedup_by(|next, time| *next - *time <= 1e-6);
    thin_out(&mut times);
    times
}

/// The times, with as many times between them as there may be: each gap is cut evenly, such that the longest piece is
/// as short as possible.
#[expect(clippy::cast_precision_loss, reason = "at most 16")]
fn split(own: &[f64]) -> Vec<f64> {
    let mut gaps: Vec<(f64, f64, usize)> = own.windows(2).map(|pair| (pair[0], pair[1] - pair[0], 1)).collect();
    for _ in own.len()..MAX_KEYS {
        let longest = gaps.iter_mut().max_by(|a, b| (a.1 / a.2 as f64).total_cmp(&(b.1 / b.2 as f64)));
        longest.into_iter().for_each(|gap| gap.2 += 1);
    }
    let pieces = |(begin, length, count): &(f64, f64, usize)| {
        let (begin, piece) = (*begin, length / *count as f64);
        (0..*count).map(move |k| begin + piece * k as f64)
    };
    gaps.iter().flat_map(pieces).chain(own.last().copied()).collect()
}

/// The samples of a motion, without those that the others imply.
fn samples(maps: &[DAffine3], times: &[f64], own: &[f64]) -> Vec<TransformSample> {
    let all: Vec<(f64, DAffine3)> = times.iter().copied().zip(maps.iter().copied()).collect();
    let few: Vec<(f64, DAffine3)> = all.iter().filter(|(time, _)| own.contains(time)).copied().collect();
    let is_enough = motion_keys(&few).is_some_and(|keys| {
        all.iter().all(|(time, map)| {
            let (found, known) = (map_at(&keys, *time).to_cols_array(), map.to_cols_array());
            let size = known.iter().fold(0.0_f64, |size, v| size.max(v.abs()));
            found.iter().zip(known).all(|(a, b)| (a - b).abs() <= SAME_MOTION * size)
        })
    });
    let sample = |(time, map): (f64, DAffine3)| TransformSample { time, transform: DMat4::from(map) };
    if is_enough { few } else { all }.into_iter().map(sample).collect()
}

/// The world transform of a placement at the frame's own time, then at each of the times.
type TimedTransforms = Vec<DAffine3>;

/// The transform of a prim in its parent, with its motion.
struct LocalTransform {
    ways: TimedTransforms,
    moves: bool,
}

struct LightInstances<'a> {
    instancers: &'a BTreeMap<Arc<str>, InstancerEntry>,
    times: &'a [f64],
    most: usize,
    /// Number of prims visited: it bounds the cost of instancers that contain themselves.
    steps: usize,
    is_cut: bool,
}

/// Largest number of prims visited for one light.
const MAX_STEPS: usize = 1 << 16;

impl LightInstances<'_> {
    /// Appends the world transforms of `prim`. The depth is bounded, so the recursion is, and so are the results of an
    /// instancer inside itself.
    fn of(&mut self, prim: &PrimDesc, depth: u32, out: &mut Vec<TimedTransforms>) {
        let Some(local) = self.local(prim) else { return };
        if prim.instanced_by.is_empty() {
            self.push(local.ways, out);
            return;
        }
        self.steps += 1;
        if depth >= MAX_NESTING || self.steps > MAX_STEPS {
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
            for parent in &parents {
                for prototype in entry.desc.prototypes.iter().filter(|p| p.root == by.prototype_root) {
                    let unit = Aabb { min: [0.0; 3], max: [1.0; 3] };
                    let placer =
                        InstancePlacer::new(DAffine3::IDENTITY, DAffine3::IDENTITY, Some(&entry.arrays), &unit);
                    let moving = entry.arrays.motion.as_ref().map(|motion| {
                        // As in records: the placement of a prim at rest moves with the instances.
                        let after = if local.moves { DAffine3::IDENTITY } else { local.ways[0] };
                        let placer = InstancePlacer::new(DAffine3::IDENTITY, after, Some(&entry.arrays), &unit);
                        placer.clone().moving(placer.at_keys(motion, &entry.arrays))
                    });
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
                        let Some(own) = placer.matrix(Some(number)) else { continue };
                        let keys = moving.as_ref().and_then(|moving| moving.keys(Some(number)));
                        let keys = keys.map(|(keys, _)| keys);
                        let at = |k: usize| match (&keys, k.checked_sub(1).and_then(|k| self.times.get(k))) {
                            (Some(keys), Some(time)) if local.moves => parent[k] * keys.at(*time) * local.ways[k],
                            (Some(keys), Some(time)) => parent[k] * keys.at(*time),
                            _ => parent[k] * own * local.ways[k],
                        };
                        let ways: TimedTransforms = (0..parent.len()).map(at).collect();
                        if ways.iter().all(DAffine3::is_finite) {
                            self.push(ways, out);
                        }
                    }
                }
            }
        }
    }

    /// The transform of a prim; a motion that cannot be used is left out.
    fn local(&self, prim: &PrimDesc) -> Option<LocalTransform> {
        let own = affine(&prim.transform)?;
        let keys = transform_motion(&prim.motion).ok().flatten().and_then(|samples| {
            let maps: Vec<_> = samples.iter().map(|s| (s.time, DAffine3::from_mat4(s.transform))).collect();
            motion_keys(&maps)
        });
        let at = |time: &f64| keys.as_ref().map_or(own, |keys| map_at(keys, *time));
        let ways = [own].into_iter().chain(self.times.iter().map(at)).collect();
        Some(LocalTransform { ways, moves: keys.is_some() })
    }

    fn push(&mut self, ways: TimedTransforms, out: &mut Vec<TimedTransforms>) {
        if out.len() < self.most {
            out.push(ways);
        } else {
            self.is_cut = true;
        }
    }
}

/// The affine map of a matrix. Lights may be flat, unlike other prims.
fn affine(m: &DMat4) -> Option<DAffine3> {
    usable_affine(m).or_else(|| {
        let is_affine = (m.row(3) - DVec4::W).abs().max_element() <= 1e-9;
        (is_affine && m.is_finite()).then(|| DAffine3::from_mat4(*m))
    })
}
