// SPDX-License-Identifier: Apache-2.0
//! The motion of a placement: the motions of everything that contains it, composed in the order of traversal, so that
//! the result is exactly where rays find the placement, also where rotations are nested. Pure; any thread.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DVec3};

use crate::instancing::motion::{MotionKey, PlacementKeys, map_at, norm_of, swept_box};

/// Largest turn of a normal from one sampled time to the next, radians.
const STEP: f64 = 0.1;
/// Largest number of sampled times between two keys.
const MAX_STEPS: f64 = 64.0;
/// Relative difference up to which stretches count as the same.
const SAME_STRETCH: f64 = 1e-6;

/// The motions of the frames that contain a placement, composed as traversal does.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlacementMotion {
    /// Maps from each frame to the one around it, the outermost first: two keys or more, in the order of time. Empty if
    /// nothing moves. A frame at rest between two that move has two equal keys.
    pub levels: Vec<Arc<[MotionKey]>>,
}

impl PlacementMotion {
    /// Returns true if it does not move.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.levels.is_empty()
    }

    /// The motion with an inner frame added, which is at rest at `place` and moves there by `keys`; `None` if `place`
    /// cannot be decomposed.
    pub(crate) fn within(&self, place: &DAffine3, keys: &[MotionKey]) -> Option<Self> {
        let mut levels = self.levels.clone();
        let mut keys: Arc<[MotionKey]> = keys.into();
        if place.matrix3 == DMat3::IDENTITY {
            for key in Arc::make_mut(&mut keys) {
                key.translation += place.translation;
            }
        } else {
            levels.push([MotionKey::of(0.0, place)?, MotionKey::of(1.0, place)?].into());
        }
        levels.push(keys);
        Some(Self { levels })
    }

    /// The map to the world at a time of the shutter, from inside of the first `count` levels.
    pub(crate) fn outer_at(&self, count: usize, time: f64) -> DAffine3 {
        let levels = self.levels.iter().take(count);
        levels.fold(DAffine3::IDENTITY, |map, keys| map * map_at(keys, time))
    }

    /// The map to the world at a time of the shutter.
    #[must_use]
    pub fn at(&self, time: f64) -> DAffine3 {
        self.outer_at(self.levels.len(), time)
    }

    /// The box in the world of `center +- half` while the shutter is open.
    pub(crate) fn swept(&self, center: DVec3, half: DVec3) -> (DVec3, DVec3) {
        self.levels.iter().rev().fold((center - half, center + half), |(min, max), keys| {
            swept_box(keys, 0.5 * (min + max), 0.5 * (max - min))
        })
    }

    /// The opening of the shutter, its closing, and the times of all keys between.
    pub(crate) fn key_times(&self) -> Vec<f64> {
        let keys = self.levels.iter().flat_map(|keys| keys.iter().map(|key| f64::from(key.time)));
        let mut times: Vec<f64> = keys.filter(|time| (0.0..1.0).contains(time)).chain([0.0, 1.0]).collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        times
    }

    /// Times from the opening of the shutter to its closing, and the largest angle by which a normal turns between two
    /// consecutive ones: half a circle if it is not known, as for a stretch that changes its shape.
    #[must_use]
    pub fn times(&self) -> (Vec<f64>, f64) {
        let own = self.key_times();
        let mut times = own.first().copied().into_iter().collect::<Vec<_>>();
        let mut most = 0.0_f64;
        for pair in own.windows(2) {
            let (begin, end) = (pair[0], pair[1]);
            let angle: f64 = self.levels.iter().map(|keys| turn(keys, begin, end)).sum();
            let steps = (angle / STEP).ceil().clamp(1.0, MAX_STEPS);
            most = most.max(angle / steps);
            let mut at = 1.0;
            while at <= steps {
                times.push(begin + (end - begin) * at / steps);
                at += 1.0;
            }
        }
        (times, if self.only_turns() { most } else { PI })
    }

    /// Returns true if normals turn by no more than the rotations of all levels.
    fn only_turns(&self) -> bool {
        let mut has_turned = false;
        self.levels.iter().rev().all(|keys| {
            let is_fit = is_steady(keys) && (is_even(keys) || !has_turned);
            has_turned |= keys.iter().any(|key| key.half_angle > 0.0);
            is_fit
        })
    }

    /// The least magnitude of the map's determinant at any time, and an upper bound of the factor by which it stretches
    /// lengths. For a sum of two definite stretches the root of the determinant is at least the sum of their roots
    /// (Minkowski), so the keys bound it.
    pub(crate) fn extent(&self) -> (f64, f64) {
        self.levels.iter().fold((1.0, 1.0), |(least, most), keys| {
            let determinants = keys.iter().map(|key| key.stretch.determinant().abs());
            let norms = keys.iter().map(|key| norm_of(&key.stretch));
            (least * determinants.fold(f64::INFINITY, f64::min), most * norms.fold(0.0, f64::max))
        })
    }

    /// Factor by which rounding grows where single precision inverts the maps. Along axes each number of an inverse has
    /// its own rounding only; others are differences of products.
    pub(crate) fn magnification(&self) -> f64 {
        let of = |keys: &Arc<[MotionKey]>| {
            if !keys.iter().any(MotionKey::is_sheared) {
                return 1.0;
            }
            let norms = keys.iter().map(|key| norm_of(&key.stretch)).fold(0.0, f64::max);
            (norms * keys.iter().map(|key| norm_of(&key.stretch.inverse())).fold(0.0, f64::max)).powi(2)
        };
        self.levels.iter().map(of).fold(1.0, f64::max)
    }
}

/// The keys of a record as the device has them, with the position in single precision.
pub(crate) fn as_rounded(keys: &PlacementKeys) -> Arc<[MotionKey]> {
    keys.as_slice().iter().map(|key| MotionKey { translation: key.translation.as_vec3().as_dvec3(), ..*key }).collect()
}

/// Angle of rotation between two times that have no key between them.
fn turn(keys: &[MotionKey], begin: f64, end: f64) -> f64 {
    let pair = keys.windows(2).find(|pair| {
        let middle = 0.5 * (begin + end);
        f64::from(pair[0].time) <= middle && middle < f64::from(pair[1].time)
    });
    pair.map_or(0.0, |pair| {
        2.0 * pair[0].half_angle * (end - begin) / (f64::from(pair[1].time) - f64::from(pair[0].time))
    })
}

fn trace(m: &DMat3) -> f64 {
    m.x_axis.x + m.y_axis.y + m.z_axis.z
}

/// Returns true if stretches differ in size only.
fn is_steady(keys: &[MotionKey]) -> bool {
    let Some(first) = keys.first().map(|key| key.stretch) else { return true };
    let first = first * (1.0 / trace(&first));
    keys.iter().all(|key| {
        let own = key.stretch * (1.0 / trace(&key.stretch));
        norm_of(&(own - first)) <= SAME_STRETCH * norm_of(&first)
    })
}

/// Returns true if stretches are the same in all directions.
fn is_even(keys: &[MotionKey]) -> bool {
    keys.iter().all(|key| {
        let even = DMat3::from_diagonal(DVec3::splat(trace(&key.stretch) / 3.0));
        norm_of(&(key.stretch - even)) <= SAME_STRETCH * norm_of(&even)
    })
}
