// SPDX-License-Identifier: Apache-2.0
//! Motion of an instancer's arrays, by samples or by velocities. Checked once; pure; any thread.

use glam::{DQuat, DVec3};

use super::motion::{MAX_KEYS, thin_out};
use crate::array::{ArrayView, TypedArray};
use crate::desc::{InstancerMotion, InstancerSample, TransformSample};

/// Number of keys of an accelerated motion: a parabola in four pieces.
const ACCELERATED_KEYS: usize = 5;
/// Largest rotation from key to key, radians: less than half a turn, because otherwise the shorter arc is another one.
const MAX_TURN: f64 = 1.6;

/// Offsets of instances after some time, by their velocities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VelocityMotion<'a> {
    velocities: Option<ArrayView<'a>>,
    accelerations: Option<ArrayView<'a>>,
    angular: Option<ArrayView<'a>>,
    seconds: f64,
}

impl<'a> VelocityMotion<'a> {
    /// The offsets at a time of the shutter.
    pub(super) fn at(motion: &'a InstancerMotion, time: f64) -> Self {
        let view = |array: &'a Option<TypedArray>| array.as_ref().map(TypedArray::view);
        Self {
            velocities: view(&motion.velocities),
            accelerations: view(&motion.accelerations),
            angular: view(&motion.angular_velocities),
            seconds: motion.seconds[0] + time * (motion.seconds[1] - motion.seconds[0]),
        }
    }

    /// `v t + a t^2 / 2`; `None` if an array is too short.
    pub(crate) fn offset(&self, number: usize) -> Option<DVec3> {
        let Some(velocities) = &self.velocities else { return Some(DVec3::ZERO) };
        let mut offset = velocities.vec3(number)? * self.seconds;
        if let Some(accelerations) = &self.accelerations {
            offset += accelerations.vec3(number)? * (0.5 * self.seconds * self.seconds);
        }
        Some(offset)
    }

    /// Rotation about the parent's axes; `None` without an angular velocity.
    pub(crate) fn turn(&self, number: usize) -> Option<DQuat> {
        let rate = self.angular.as_ref()?.vec3(number).unwrap_or(DVec3::NAN);
        Some(DQuat::from_scaled_axis(rate * (self.seconds.to_radians())))
    }
}

/// The checked motion of an instancer.
#[derive(Clone, Debug)]
pub(crate) enum ArrayMotion {
    /// Arrays at times, in order.
    Samples(Vec<InstancerSample>),
    /// The arrays at the frame's own time, and their rates of change.
    Velocities { motion: InstancerMotion, keys: usize },
}

impl ArrayMotion {
    /// The checked `motion` of an instancer with `count` instances and these usable arrays; `None` if nothing moves; an
    /// error with the reason if it cannot be used.
    pub(crate) fn of(
        motion: &InstancerMotion,
        arrays: [Option<&TypedArray>; 4],
        count: usize,
    ) -> Result<Option<Self>, String> {
        let present = |array: &Option<TypedArray>| array.as_ref().is_some_and(|array| !array.is_empty());
        if present(&motion.velocities) || present(&motion.angular_velocities) {
            return Self::of_velocities(motion, count);
        }
        let mut samples = motion.samples.clone();
        if samples.len() < 2 {
            return Ok(None);
        }
        check_times(samples.iter().map(|sample| sample.time))?;
        thin_out(&mut samples);
        for sample in &mut samples {
            for array in [&mut sample.translations, &mut sample.rotations, &mut sample.scales, &mut sample.transforms] {
                *array = array.take().filter(|array| !array.is_empty());
            }
        }
        for sample in &samples {
            for (own, array) in arrays.into_iter().zip(sample.arrays()) {
                let alike = match (own, array) {
                    (None, None) => true,
                    (Some(own), Some(array)) => own.element() == array.element() && own.len() == array.len(),
                    _ => false,
                };
                if !alike {
                    return Err("its samples have other numbers of instances than its arrays".to_owned());
                }
            }
        }
        let moves = samples.windows(2).any(|pair| {
            let mut pairs = pair[0].arrays().into_iter().zip(pair[1].arrays());
            pairs.any(|(a, b)| !TypedArray::same_optional(a, b))
        });
        Ok(moves.then_some(Self::Samples(samples)))
    }

    fn of_velocities(motion: &InstancerMotion, count: usize) -> Result<Option<Self>, String> {
        let [open, close] = motion.seconds;
        if !(open.is_finite() && close.is_finite() && open < close) {
            return Err("the shutter is open for no usable time".to_owned());
        }
        let taken = |array: &Option<TypedArray>| array.clone().filter(|array| !array.is_empty());
        let mut kept = InstancerMotion { samples: Vec::new(), ..motion.clone() };
        kept.velocities = taken(&motion.velocities);
        kept.accelerations = taken(&motion.accelerations).filter(|_| kept.velocities.is_some());
        kept.angular_velocities = taken(&motion.angular_velocities);
        for array in rates(&kept).into_iter().flatten() {
            if array.vec3(0).is_none() || array.len() != count {
                return Err("its velocities are of the wrong length or type".to_owned());
            }
        }
        let mut keys = if kept.accelerations.is_some() { ACCELERATED_KEYS } else { 2 };
        if let Some(angular) = &kept.angular_velocities {
            let rate = (0..angular.len()).filter_map(|at| angular.vec3(at)).map(|rate| rate.length());
            let most = rate.filter(|rate| rate.is_finite()).fold(0.0, f64::max).to_radians() * (close - open);
            while keys < MAX_KEYS && most > MAX_TURN * (keys - 1) as f64 {
                keys += 1;
            }
        }
        Ok(Some(Self::Velocities { motion: kept, keys }))
    }

    pub(crate) fn same_contents(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Samples(a), Self::Samples(b)) => {
                let alike = |(a, b): (&InstancerSample, &InstancerSample)| {
                    let mut pairs = a.arrays().into_iter().zip(b.arrays());
                    a.time == b.time && pairs.all(|(a, b)| TypedArray::same_optional(a, b))
                };
                a.len() == b.len() && a.iter().zip(b).all(alike)
            }
            (Self::Velocities { motion: a, keys }, Self::Velocities { motion: b, keys: other }) => {
                let mut pairs = rates(a).into_iter().zip(rates(b));
                let same = pairs.all(|(a, b)| TypedArray::same_optional(a, b));
                same && keys == other && a.seconds == b.seconds
            }
            _ => false,
        }
    }

    /// Number of its keys.
    pub(crate) fn key_count(&self) -> usize {
        match self {
            Self::Samples(samples) => samples.len(),
            Self::Velocities { keys, .. } => *keys,
        }
    }

    /// Times of its keys.
    pub(crate) fn times(&self) -> Vec<f64> {
        match self {
            Self::Samples(samples) => samples.iter().map(|sample| sample.time).collect(),
            Self::Velocities { keys, .. } => (0..*keys).map(|key| key as f64 / (*keys as f64 - 1.0)).collect(),
        }
    }
}

impl InstancerSample {
    pub(crate) fn arrays(&self) -> [Option<&TypedArray>; 4] {
        [&self.translations, &self.rotations, &self.scales, &self.transforms].map(Option::as_ref)
    }
}

fn rates(motion: &InstancerMotion) -> [Option<&TypedArray>; 3] {
    [&motion.velocities, &motion.accelerations, &motion.angular_velocities].map(Option::as_ref)
}

/// Times of samples: finite numbers, strictly increasing, also in single precision.
pub(crate) fn check_times(times: impl Iterator<Item = f64>) -> Result<(), String> {
    let mut last = f64::NEG_INFINITY;
    for time in times {
        if !(time.is_finite() && time.abs() < 1e6) {
            return Err("a sample has no usable time".to_owned());
        }
        if time - last <= 1e-6 {
            return Err("its samples are not in the order of time".to_owned());
        }
        last = time;
    }
    Ok(())
}

/// The samples of a prim's transform as its motion, in order of time; `None` if all are the same.
pub(crate) fn transform_motion(samples: &[TransformSample]) -> Result<Option<Vec<TransformSample>>, String> {
    let moves = samples.windows(2).any(|pair| pair[0].transform != pair[1].transform);
    if !moves {
        return Ok(None);
    }
    check_times(samples.iter().map(|sample| sample.time))?;
    let mut samples = samples.to_vec();
    thin_out(&mut samples);
    Ok(Some(samples))
}
