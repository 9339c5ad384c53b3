// SPDX-License-Identifier: Apache-2.0
//! Places moving instances: one placer for each time of the shutter, from which keys and boxes follow. Pure; any
//! thread.

use glam::{DAffine3, DVec3};

use super::{InstanceFootprint, InstancePlacer, KeyPlacer};
use crate::array::TypedArray;
use crate::instancing::affine::{MATRIX_ERROR, MAX_MAGNITUDE};
use crate::instancing::array_motion::{ArrayMotion, VelocityMotion};
use crate::instancing::arrays::InstanceArrays;
use crate::instancing::motion::{KEY_ERROR, MotionKey, PlacementKeys};

impl<'a> InstancePlacer<'a> {
    /// The placers of the keys of `arrays` that move.
    #[expect(clippy::cast_possible_truncation, reason = "keys have times in single precision")]
    pub(crate) fn at_keys(&self, motion: &'a ArrayMotion, arrays: &'a InstanceArrays) -> Vec<KeyPlacer<'a>> {
        match motion {
            ArrayMotion::Samples(samples) => samples
                .iter()
                .map(|sample| KeyPlacer { time: sample.time as f32, placer: self.at_time(sample.arrays(), None) })
                .collect(),
            ArrayMotion::Velocities { motion: rates, .. } => {
                let key = |time: f64| {
                    let drift = VelocityMotion::at(rates, time);
                    KeyPlacer { time: time as f32, placer: self.at_time(arrays.transforming(), Some(drift)) }
                };
                motion.times().into_iter().map(key).collect()
            }
        }
    }

    /// The same placer at another time, with these arrays and with `drift` advanced.
    fn at_time(&self, arrays: [Option<&'a TypedArray>; 4], drift: Option<VelocityMotion<'a>>) -> Self {
        let [translations, rotations, scales, transforms] = arrays.map(|array| array.map(TypedArray::view));
        Self { translations, rotations, scales, transforms, drift, keys: None, ..self.clone() }
    }

    /// The same placer with another frame.
    pub(crate) fn framed(&self, before: DAffine3) -> Self {
        Self { before, keys: None, ..self.clone() }
    }

    /// The placer of an object that moves between `keys`.
    pub(crate) fn moving(self, keys: Vec<KeyPlacer<'a>>) -> Self {
        Self { keys: Some(keys.into()), ..self }
    }

    /// The keys of a moving placement, one for each time, and true if they move it: if one of them cannot be used, all
    /// are the placement as it is at the frame's own time.
    pub(crate) fn keys(&self, number: Option<usize>) -> Option<(PlacementKeys, bool)> {
        let all = self.keys.as_ref()?;
        let mut keys = PlacementKeys::new();
        let usable = all.iter().all(|key| {
            // Usability is decided in the parent's frame, whatever this frame is.
            let map = key.placer.matrix(number).filter(|m| {
                let farthest = (m.translation + self.origin).abs() + m.matrix3 * self.center.abs() + self.half;
                m.is_finite() && farthest.max_element() <= f64::from(MAX_MAGNITUDE)
            });
            map.and_then(|m| MotionKey::of(key.time, &m)).is_some_and(|key| keys.push(key))
        });
        if usable {
            return Some((keys, true));
        }
        let map = self.matrix(number)?;
        let mut still = PlacementKeys::new();
        for key in all.iter() {
            still.push(MotionKey::of(key.time, &map)?);
        }
        Some((still, false))
    }

    /// The box of a moving placement, including rounding, and its footprint for chunks. `None` if it is too large.
    pub(super) fn swept(&self, number: Option<usize>) -> Option<([DVec3; 2], InstanceFootprint, bool)> {
        let (keys, _) = self.keys(number)?;
        let swept = keys.sweep(self.center, self.half);
        let center = 0.5 * (swept.min + swept.max);
        let half = 0.5 * (swept.max - swept.min);
        // Static placements count MATRIX_ERROR; this sum is larger than that of any single frame.
        let spread = swept.spread * (2.0 * KEY_ERROR / MATRIX_ERROR);
        let lever = swept.lever + half.max_element();
        let error = swept.spread * KEY_ERROR * ((center.abs() + half).max_element() + lever);
        let bounds = [swept.min - error, swept.max + error];
        let sound = bounds.iter().all(|v| v.abs().max_element() <= f64::from(self.limit));
        let footprint = InstanceFootprint { center, half, spread, lever };
        sound.then_some((bounds, footprint, swept.flips))
    }

    /// Returns true for a moving placement that stays where it is, because its motion cannot be used.
    pub(crate) fn is_stuck(&self, number: Option<usize>) -> bool {
        self.keys.is_some() && self.keys(number).is_some_and(|(_, moves)| !moves)
    }
}
