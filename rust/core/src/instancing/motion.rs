// SPDX-License-Identifier: Apache-2.0
//! Motion of placements: keys at times of the shutter, each a translation, a rotation and a stretch (Shoemake and Duff
//! 1992, "Matrix animation and polar decomposition"), and boxes that contain the motion between them. Pure; any thread.
//!
//! Times are parts of the shutter: it opens at 0 and closes at 1. Between keys translations and stretches are linear,
//! rotations go along the shorter arc at a constant rate (Shoemake 1985, slerp); before the first key and after the
//! last one nothing moves. `shaders/geometry/motion.glsl` does the same in single precision.

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::affine::is_regular;

/// Largest number of keys of a placement.
pub const MAX_KEYS: usize = 16;
/// Rotation between two positions at which a swept box is measured, radians.
const STEP: f64 = 0.1;
/// Rounding of a moving map in single precision and of its evaluation, in units of the magnitudes involved: 64 x 2^-24.
pub(crate) const KEY_ERROR: f64 = 64.0 / 16_777_216.0;
/// Number of steps of the polar decomposition: Newton's iteration converges quadratically after the scaling.
const POLAR_STEPS: usize = 48;

/// Transform at one time: `p' = translation + rotation * stretch * p`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionKey {
    /// Time as a part of the shutter.
    pub time: f32,
    /// Half the angle to the rotation of the next key, radians, in [0, pi/2]; 0 for the last one.
    pub half_angle: f64,
    /// Translation of the frame's origin.
    pub translation: DVec3,
    /// Unit quaternion, on the same side as those of its neighbours.
    pub rotation: DQuat,
    /// Symmetric matrix; definite, negative for a map that mirrors.
    pub stretch: DMat3,
}

impl MotionKey {
    const NONE: Self = Self {
        time: 0.0,
        half_angle: 0.0,
        translation: DVec3::ZERO,
        rotation: DQuat::IDENTITY,
        stretch: DMat3::IDENTITY,
    };

    /// The key of a map with independent columns; `None` if it cannot be decomposed.
    pub(crate) fn of(time: f32, m: &DAffine3) -> Option<Self> {
        if !(m.is_finite() && is_regular(&m.matrix3, m.matrix3.determinant())) {
            return None;
        }
        let rotation = rotation_of(&m.matrix3)?;
        let product = rotation.transpose() * m.matrix3;
        let stretch = (product + product.transpose()) * 0.5;
        let rotation = DQuat::from_mat3(&rotation).normalize();
        let key = Self { time, half_angle: 0.0, translation: m.translation, rotation, stretch };
        (rotation.is_finite() && stretch.is_finite()).then_some(key)
    }

    fn map(&self) -> DAffine3 {
        DAffine3 { matrix3: DMat3::from_quat(self.rotation) * self.stretch, translation: self.translation }
    }

    /// Returns true if the stretch is not along the axes of the moving object.
    pub(crate) fn is_sheared(&self) -> bool {
        let DMat3 { x_axis: x, y_axis: y, .. } = self.stretch;
        let off = x.y.abs().max(x.z.abs()).max(y.z.abs());
        off > 1e-6 * self.stretch.x_axis.x.abs().max(y.y.abs()).max(self.stretch.z_axis.z.abs())
    }
}

/// The rotation nearest to `m`, or to `-m` if `m` mirrors (Higham 1986, "Computing the polar decomposition").
fn rotation_of(m: &DMat3) -> Option<DMat3> {
    let size = m.x_axis.abs().max(m.y_axis.abs()).max(m.z_axis.abs()).max_element();
    let m = *m * if m.determinant() < 0.0 { -1.0 / size } else { 1.0 / size };
    let (x, y, z) = (m.x_axis.length_squared(), m.y_axis.length_squared(), m.z_axis.length_squared());
    let dots = [m.x_axis.dot(m.y_axis).powi(2), m.y_axis.dot(m.z_axis).powi(2), m.z_axis.dot(m.x_axis).powi(2)];
    let limit = 1e-28;
    if dots[0] <= limit * x * y && dots[1] <= limit * y * z && dots[2] <= limit * z * x {
        let unit = DMat3::from_cols(m.x_axis / x.sqrt(), m.y_axis / y.sqrt(), m.z_axis / z.sqrt());
        return unit.is_finite().then_some(unit);
    }
    let norm = |m: &DMat3| m.to_cols_array().iter().map(|v| v * v).sum::<f64>().sqrt();
    let mut q = m;
    for _ in 0..POLAR_STEPS {
        let inverse = q.inverse().transpose();
        let scale = (norm(&inverse) / norm(&q)).sqrt();
        let next = (q * scale + inverse * (1.0 / scale)) * 0.5;
        let moved = norm(&(next - q));
        q = next;
        if !q.is_finite() {
            return None;
        }
        if moved <= 1e-15 {
            break;
        }
    }
    Some(q)
}

/// The keys of a placement, in the order of time.
#[derive(Clone, Debug)]
pub(crate) struct PlacementKeys {
    all: [MotionKey; MAX_KEYS],
    count: usize,
}

/// The box of a moving object over its whole motion.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SweptBounds {
    pub(crate) min: DVec3,
    pub(crate) max: DVec3,
    /// Largest factor by which the maps magnify rounding (maximum norm of `|M| |M^-1|`), at any time.
    pub(crate) spread: f64,
    /// Largest distance (maximum norm) of the box's corners from the placed origin.
    pub(crate) lever: f64,
    /// True for a map that mirrors.
    pub(crate) flips: bool,
}

impl PlacementKeys {
    pub(crate) fn new() -> Self {
        Self { all: [MotionKey::NONE; MAX_KEYS], count: 0 }
    }

    pub(crate) fn as_slice(&self) -> &[MotionKey] {
        self.all.get(..self.count).unwrap_or_default()
    }

    /// Appends a key later than the last; returns false if there is no room, or if it mirrors and the last did not.
    pub(crate) fn push(&mut self, mut key: MotionKey) -> bool {
        if let Some(last) = self.count.checked_sub(1).and_then(|at| self.all.get_mut(at)) {
            let mirrors = |key: &MotionKey| key.stretch.x_axis.x < 0.0;
            if mirrors(last) != mirrors(&key) {
                return false;
            }
            let dot = last.rotation.dot(key.rotation);
            if dot < 0.0 {
                key.rotation = -key.rotation;
            }
            let across = (key.rotation - last.rotation * dot.abs()).length();
            last.half_angle = across.atan2(dot.abs());
        }
        match self.all.get_mut(self.count) {
            Some(slot) => *slot = key,
            None => return false,
        }
        self.count += 1;
        true
    }

    /// The map at a time.
    pub(crate) fn at(&self, time: f64) -> DAffine3 {
        map_at(self.as_slice(), time)
    }

    /// The box of `center +- half` while the shutter is open. Between two measured positions a point leaves its chord
    /// by at most `h^2 / 8` of its largest acceleration; only rotation accelerates: by `angle^2 * radius`, and with a
    /// stretch that changes by twice `angle * change` more.
    pub(crate) fn sweep(&self, center: DVec3, half: DVec3) -> SweptBounds {
        let keys = self.as_slice();
        let (mut min, mut max, mut lever) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0_f64);
        let corner = center.abs() + half;
        let mut measure = |time: f64| {
            let m = self.at(time);
            let arm = m.matrix3 * center;
            let size =
                m.matrix3.x_axis.abs() * half.x + m.matrix3.y_axis.abs() * half.y + m.matrix3.z_axis.abs() * half.z;
            min = min.min(arm + m.translation - size);
            max = max.max(arm + m.translation + size);
            lever = lever.max((arm.abs() + size).max_element());
        };
        let mut away = 0.0_f64;
        measure(0.0);
        for pair in keys.windows(2) {
            let [from, to] = [&pair[0], &pair[1]];
            let (begin, end) = (f64::from(from.time), f64::from(to.time));
            let (first, last) = (begin.clamp(0.0, 1.0), end.clamp(0.0, 1.0));
            if first >= last {
                continue;
            }
            let angle = 2.0 * from.half_angle * (last - first) / (end - begin);
            let steps = (angle / STEP).ceil().max(1.0);
            let radius = (from.stretch * corner).length().max(norm_of(&from.stretch) * corner.length());
            let radius = radius.max(norm_of(&to.stretch) * corner.length());
            let change = norm_of(&(to.stretch - from.stretch)) * corner.length() * (last - first) / (end - begin);
            let step = angle / steps;
            away = away.max(step * step * radius / 8.0 + step * change / steps / 4.0);
            let mut at = 1.0;
            while at <= steps {
                measure(first + (last - first) * at / steps);
                at += 1.0;
            }
        }
        measure(1.0);
        let sheared = keys.iter().any(MotionKey::is_sheared);
        let inverses = keys.iter().map(|key| norm_of(&key.stretch.inverse())).fold(0.0, f64::max);
        let condition = keys.iter().map(|key| norm_of(&key.stretch)).fold(0.0, f64::max) * inverses;
        let spread = 3.0 * if sheared { condition * condition } else { condition };
        let flips = keys.first().is_some_and(|key| key.stretch.x_axis.x < 0.0);
        SweptBounds { min: min - away, max: max + away, spread, lever, flips }
    }
}

/// Reduces samples to at most [`MAX_KEYS`], including the first and the last.
pub(crate) fn thin_out<T: Clone>(samples: &mut Vec<T>) {
    if samples.len() > MAX_KEYS {
        let last = samples.len() - 1;
        let pick = |at: usize| samples.get(at * last / (MAX_KEYS - 1)).cloned();
        *samples = (0..MAX_KEYS).filter_map(pick).collect();
    }
}

/// The keys of maps at times, which are in order; at most [`MAX_KEYS`] of them. `None` if a map cannot be decomposed,
/// or mirrors while the one before does not.
pub(crate) fn motion_keys(maps: &[(f64, DAffine3)]) -> Option<Vec<MotionKey>> {
    let mut maps = maps.to_vec();
    thin_out(&mut maps);
    let mut keys = PlacementKeys::new();
    #[expect(clippy::cast_possible_truncation, reason = "keys have times in single precision")]
    let key = |(time, map): &(f64, DAffine3)| MotionKey::of(*time as f32, map);
    maps.iter().all(|map| key(map).is_some_and(|key| keys.push(key))).then(|| keys.as_slice().to_vec())
}

/// The box of `center +- half` of an object that moves by `keys` while the shutter is open, including the rounding of
/// its box at any time.
pub(crate) fn swept_box(keys: &[MotionKey], center: DVec3, half: DVec3) -> (DVec3, DVec3) {
    let mut all = PlacementKeys::new();
    for (slot, key) in all.all.iter_mut().zip(keys) {
        *slot = *key;
    }
    all.count = keys.len().min(MAX_KEYS);
    let swept = all.sweep(center, half);
    let slack = KEY_ERROR * swept.spread * swept.lever + 1e-6 * swept.min.abs().max(swept.max.abs());
    (swept.min - slack, swept.max + slack)
}

/// Frobenius norm of a matrix.
pub(crate) fn norm_of(m: &DMat3) -> f64 {
    (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
}

/// The map at a time of the shutter, given keys in the order of time; the identity without any.
#[must_use]
pub fn map_at(keys: &[MotionKey], time: f64) -> DAffine3 {
    key_at(keys, time).map()
}

/// The transform between two keys at a time, as a key; its `time` and `half_angle` are those of an earlier key.
pub(crate) fn key_at(keys: &[MotionKey], time: f64) -> MotionKey {
    let Some(first) = keys.first() else { return MotionKey::NONE };
    let next = keys.iter().skip(1).position(|key| f64::from(key.time) > time);
    let at = next.unwrap_or(keys.len().saturating_sub(2));
    let (Some(a), Some(b)) = (keys.get(at), keys.get(at + 1)) else { return *first };
    let f = ((time - f64::from(a.time)) / (f64::from(b.time) - f64::from(a.time))).clamp(0.0, 1.0);
    let sine = a.half_angle.sin();
    let (p, q) = if sine > 1e-12 {
        (((1.0 - f) * a.half_angle).sin() / sine, (f * a.half_angle).sin() / sine)
    } else {
        (1.0 - f, f)
    };
    let rotation = (a.rotation * p + b.rotation * q).normalize();
    MotionKey {
        rotation,
        translation: a.translation.lerp(b.translation, f),
        stretch: a.stretch * (1.0 - f) + b.stretch * f,
        ..*a
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat4;

    fn keys(maps: &[(f32, DAffine3)]) -> PlacementKeys {
        let mut keys = PlacementKeys::new();
        for (time, map) in maps {
            assert!(keys.push(MotionKey::of(*time, map).expect("regular")), "they belong together");
        }
        keys
    }

    #[test]
    fn a_decomposition_recomposes_to_the_matrix() {
        let turn = DMat3::from_euler(glam::EulerRot::XYZ, 0.3, -1.2, 2.9);
        let sheared =
            DMat3::from_cols(DVec3::new(1.0, 0.2, 0.0), DVec3::new(0.5, 2.0, 0.1), DVec3::new(0.0, 0.3, 1e-3));
        for matrix3 in [turn, turn * 1e-6, turn * DMat3::from_diagonal(DVec3::new(1e9, 2.0, 3.0)), sheared, -sheared] {
            let map = DAffine3 { matrix3, translation: DVec3::new(1.0, -2.0, 1e6) };
            let back = MotionKey::of(0.0, &map).expect("regular").map();
            let size = norm_of(&matrix3);
            assert!(norm_of(&(back.matrix3 - matrix3)) <= 1e-12 * size, "{matrix3:?} against {:?}", back.matrix3);
        }
        let flat = DAffine3::from_scale(DVec3::new(1.0, 0.0, 1.0));
        assert!(MotionKey::of(0.0, &flat).is_none(), "nothing that is flat");
        assert!(MotionKey::of(0.0, &DAffine3::from_mat4(DMat4::NAN)).is_none(), "nor NaN");
    }

    #[test]
    fn rotations_go_along_arcs_at_a_constant_rate() {
        let quarter = DAffine3::from_rotation_z(std::f64::consts::FRAC_PI_2);
        let turning = keys(&[(0.0, DAffine3::IDENTITY), (1.0, quarter)]);
        for (time, degrees) in [(-1.0, 0.0), (0.25, 22.5), (0.5, 45.0), (0.75, 67.5), (2.0, 90.0_f64)] {
            let at = turning.at(time).transform_point3(DVec3::X);
            let angle = degrees.to_radians();
            assert!(at.distance(DVec3::new(angle.cos(), angle.sin(), 0.0)) < 1e-12, "{time}: {at:?}");
        }
    }

    #[test]
    fn a_swept_box_holds_every_place_and_is_little_larger() {
        let far = DAffine3::from_rotation_z(3.0) * DAffine3::from_scale(DVec3::new(2.0, 0.5, 1.0));
        let far = DAffine3 { translation: DVec3::new(4.0, 1.0, -2.0), ..far };
        let slower = DAffine3::from_rotation_y(0.4) * DAffine3::from_translation(DVec3::X);
        for (times, last) in [([0.0, 1.0], far), ([-0.5, 2.0], far), ([0.25, 0.5], slower)] {
            let moving = keys(&[(times[0], DAffine3::IDENTITY), (times[1], last)]);
            let (center, half) = (DVec3::new(1.0, 2.0, 0.0), DVec3::new(0.5, 0.25, 1.0));
            let swept = moving.sweep(center, half);
            let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
            for step in 0..=4000 {
                let map = moving.at(f64::from(step) / 4000.0);
                for corner in 0..8 {
                    let side = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                    let p = map.transform_point3(center + half * DVec3::new(side(0), side(1), side(2)));
                    (min, max) = (min.min(p), max.max(p));
                }
            }
            assert!(swept.min.cmple(min).all() && swept.max.cmpge(max).all(), "{swept:?} for {min:?} {max:?}");
            let spare = (min - swept.min).max(swept.max - max).max_element();
            assert!(spare < 0.05 * (max - min).max_element(), "{spare} is too much for {min:?} {max:?}");
        }
    }

    #[test]
    fn motion_through_a_mirrored_transform_is_refused() {
        let mut keys = PlacementKeys::new();
        assert!(keys.push(MotionKey::of(0.0, &DAffine3::IDENTITY).expect("regular")));
        let mirrored = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
        assert!(!keys.push(MotionKey::of(1.0, &mirrored).expect("regular")), "it would be flat on the way");
    }
}
