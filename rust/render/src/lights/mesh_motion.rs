// SPDX-License-Identifier: Apache-2.0
//! Mesh lights that move: the tables of their motion (`LightTablePointers::mesh_motion`, `mesh_keys`), and bounds that
//! hold them while the shutter is open. Pure.

use super::local::{finite_power, light_key};
use super::mesh::in_world;
use super::tree::{LightBounds, NOTHING};
use super::{count, narrow};
use oocpt_abi::GpuLightKey;
use oocpt_core::scene::{MeshPlacement, MotionKey, PlacementMotion};
use rustc_hash::FxHashMap;
use std::f64::consts::PI;
use std::sync::Arc;

/// Most keys of a scene's mesh lights: 84 MB on the device.
pub(super) const MAX_KEYS: usize = 1 << 20;

/// The tables while they are made.
#[derive(Debug, Default)]
pub(super) struct MotionTables {
    /// First of `levels` and how many, of each light.
    places: Vec<[u32; 2]>,
    /// First of `keys` and how many.
    levels: Vec<[u32; 2]>,
    keys: Vec<GpuLightKey>,
    /// Where the keys of a frame are: what instances share is there once. Held, so that no other has its address.
    known: FxHashMap<*const MotionKey, (u32, Arc<[MotionKey]>)>,
}

impl MotionTables {
    /// Adds the motion of the next light; false, and nothing, when there is no room for it.
    pub(super) fn add(&mut self, motion: &PlacementMotion) -> bool {
        let is_new = |keys: &&Arc<[MotionKey]>| !self.known.contains_key(&keys.as_ptr());
        let more: usize = motion.levels.iter().filter(is_new).map(|keys| keys.len()).sum();
        if self.keys.len() + more > MAX_KEYS {
            return false;
        }
        // Far fewer than 2^32: levels are as many as records are nested, and as many again.
        let number = |n: usize| u32::try_from(n).unwrap_or_default();
        let first = if motion.is_empty() { 0 } else { number(self.levels.len()) };
        self.places.push([first, number(motion.levels.len())]);
        for keys in &motion.levels {
            let (first, _) = self.known.entry(keys.as_ptr()).or_insert_with(|| {
                let first = number(self.keys.len());
                self.keys.extend(keys.iter().map(|key| light_key(key, 1.0)));
                (first, Arc::clone(keys))
            });
            self.levels.push([*first, number(keys.len())]);
        }
        true
    }

    /// The two tables; empty where nothing moves.
    pub(super) fn finish(mut self) -> (Vec<[u32; 2]>, Vec<GpuLightKey>) {
        if self.levels.is_empty() {
            return (Vec::new(), Vec::new());
        }
        let behind = u32::try_from(self.places.len()).unwrap_or_default();
        for place in self.places.iter_mut().filter(|[_, levels]| *levels != 0) {
            place[0] += behind;
        }
        self.places.append(&mut self.levels);
        (self.places, self.keys)
    }
}

/// Whether single precision holds the map at any time, and what areas grow by.
pub(super) fn has_usable_size(placement: &MeshPlacement) -> bool {
    if placement.motion.is_empty() {
        return narrow(placement.outer_from_object.matrix3.determinant()).is_normal();
    }
    let (determinant, size) = placement.extent();
    narrow(determinant).is_normal() && narrow(size.powi(3)).is_normal()
}

/// Bounds while the shutter is open: the box of all places, the cone around all cones, the mean power.
pub(super) fn swept(inside: &LightBounds, placement: &MeshPlacement, error: f64, scale: f64) -> LightBounds {
    let (times, turn) = placement.motion.times();
    let (mut all, mut power) = (NOTHING, 0.0);
    for &time in &times {
        let map = placement.world_at(time);
        let columns = [map.matrix3.x_axis, map.matrix3.y_axis, map.matrix3.z_axis].map(|column| column.to_array());
        let bounds = in_world(inside, columns, map.translation.to_array(), error, scale);
        all = all.union(&LightBounds { power: 1.0, ..bounds });
        power += bounds.power / count(times.len());
    }
    let (min, max) = placement.swept(inside.min, inside.max);
    // Between two times a normal is no more than half the way from one of them.
    let spread = if all.spread < PI { (all.spread + 0.5 * turn + 1e-6).min(PI) } else { PI };
    let (min, max) = (min.map(|low| low - error), max.map(|high| high + error));
    LightBounds { min, max, spread, power: finite_power(power), ..all }
}

#[cfg(test)]
mod tests;
