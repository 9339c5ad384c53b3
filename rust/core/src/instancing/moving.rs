// SPDX-License-Identifier: Apache-2.0
//! Placing what moves: a placer for each time of the shutter, and from them keys and boxes. Pure; any thread.

use glam::{DAffine3, DVec3};

use super::array_motion::VelocityMotion;
use super::motion::{KEY_ERROR, MotionKey, PlacementKeys};
use super::placement::{InstanceFootprint, InstancePlacer, MATRIX_ERROR, MAX_MAGNITUDE};
use crate::array::TypedArray;

/// A placer of one time of the shutter.
#[derive(Clone, Debug)]
pub(crate) struct KeyPlacer<'a> {
    pub(crate) time: f32,
    pub(crate) placer: InstancePlacer<'a>,
}

impl<'a> InstancePlacer<'a> {
    /// The same at another time, when the arrays are these and `drift` has gone on.
    pub(crate) fn at_time(&self, arrays: [Option<&'a TypedArray>; 4], drift: Option<VelocityMotion<'a>>) -> Self {
        let [translations, rotations, scales, transforms] = arrays.map(|array| array.map(TypedArray::view));
        Self { translations, rotations, scales, transforms, drift, keys: None, ..self.clone() }
    }

    /// The same when the frame is another one.
    pub(crate) fn framed(&self, before: DAffine3) -> Self {
        Self { before, keys: None, ..self.clone() }
    }

    /// What moves between `keys`.
    pub(crate) fn moving(self, keys: Vec<KeyPlacer<'a>>) -> Self {
        Self { keys: Some(keys.into()), ..self }
    }

    /// The keys of a placement of what moves, one for each time, and whether they move it: where
    /// one of them cannot be used, all are the placement as it is at the frame's own time.
    pub(crate) fn keys(&self, number: Option<usize>) -> Option<(PlacementKeys, bool)> {
        let all = self.keys.as_ref()?;
        let mut keys = PlacementKeys::new();
        let usable = all.iter().all(|key| {
            // Decided in the parent's frame, whichever this one is.
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

    /// Box of what moves, with what rounding adds; and what chunks need to know. `None` when it is too extreme.
    pub(super) fn swept(&self, number: Option<usize>) -> Option<([DVec3; 2], InstanceFootprint, bool)> {
        let (keys, _) = self.keys(number)?;
        let swept = keys.sweep(self.center, self.half);
        let center = 0.5 * (swept.min + swept.max);
        let half = 0.5 * (swept.max - swept.min);
        // Static placements count MATRIX_ERROR; the sum of what is here is larger than that of any frame's.
        let spread = swept.spread * (2.0 * KEY_ERROR / MATRIX_ERROR);
        let lever = swept.lever + half.max_element();
        let error = swept.spread * KEY_ERROR * ((center.abs() + half).max_element() + lever);
        let bounds = [swept.min - error, swept.max + error];
        let sound = bounds.iter().all(|v| v.abs().max_element() <= f64::from(self.limit));
        let footprint = InstanceFootprint { center, half, spread, lever };
        sound.then_some((bounds, footprint, swept.flips))
    }

    /// True for a placement of what moves that stays where it is, since its motion cannot be used.
    pub(crate) fn is_stuck(&self, number: Option<usize>) -> bool {
        self.keys.is_some() && self.keys(number).is_some_and(|(_, moves)| !moves)
    }
}
