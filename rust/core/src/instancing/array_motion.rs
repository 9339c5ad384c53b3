// SPDX-License-Identifier: Apache-2.0
//! How an instancer's arrays move: samples of them, or velocities. Checked once; pure; any thread.

use glam::{DQuat, DVec3};

use super::motion::MAX_KEYS;
use super::moving::KeyPlacer;
use super::placement::{InstanceArrays, InstancePlacer};
use crate::array::{ArrayView, TypedArray};
use crate::desc::{InstancerDesc, InstancerMotion, InstancerSample, TransformSample};

/// Keys of a motion that is accelerated: a parabola in four pieces.
const ACCELERATED_KEYS: usize = 5;
/// Most rotation from key to key, radians: less than half a turn, or the shorter arc is another one.
const MOST_TURN: f64 = 1.6;

/// Where instances have got to after some time by their velocities.
#[derive(Clone, Copy, Debug)]
pub(crate) struct VelocityMotion<'a> {
    velocities: Option<ArrayView<'a>>,
    accelerations: Option<ArrayView<'a>>,
    angular: Option<ArrayView<'a>>,
    seconds: f64,
}

impl VelocityMotion<'_> {
    /// `v t + a t^2 / 2`; `None` when an array is too short.
    pub(crate) fn offset(&self, number: usize) -> Option<DVec3> {
        let Some(velocities) = &self.velocities else { return Some(DVec3::ZERO) };
        let mut offset = velocities.vec3(number)? * self.seconds;
        if let Some(accelerations) = &self.accelerations {
            offset += accelerations.vec3(number)? * (0.5 * self.seconds * self.seconds);
        }
        Some(offset)
    }

    /// Rotation about the parent's axes; none where there is no angular velocity.
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
    /// The arrays themselves, and how fast they change.
    Velocities { motion: InstancerMotion, keys: usize },
}

impl ArrayMotion {
    /// The motion of usable `arrays`; none where nothing moves; or why it cannot be used.
    pub(crate) fn of(desc: &InstancerDesc, arrays: &InstanceArrays) -> Result<Option<Self>, String> {
        let motion = &desc.motion;
        let present = |array: &Option<TypedArray>| array.as_ref().is_some_and(|array| !array.is_empty());
        if present(&motion.velocities) || present(&motion.angular_velocities) {
            return Self::of_velocities(motion, arrays);
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
        let [_, own @ ..] = arrays.all();
        for sample in &samples {
            for (own, array) in own.into_iter().zip(sample.arrays()) {
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
            let pairs = pair[0].arrays().into_iter().zip(pair[1].arrays());
            pairs.into_iter().any(|arrays| !is_same(arrays))
        });
        Ok(moves.then_some(Self::Samples(samples)))
    }

    fn of_velocities(motion: &InstancerMotion, arrays: &InstanceArrays) -> Result<Option<Self>, String> {
        let [open, close] = motion.seconds;
        if !(open.is_finite() && close.is_finite() && open < close) {
            return Err("the shutter is open for no usable time".to_owned());
        }
        let taken = |array: &Option<TypedArray>| array.clone().filter(|array| !array.is_empty());
        let mut kept = InstancerMotion { samples: Vec::new(), ..motion.clone() };
        kept.velocities = taken(&motion.velocities);
        kept.accelerations = taken(&motion.accelerations).filter(|_| kept.velocities.is_some());
        kept.angular_velocities = taken(&motion.angular_velocities);
        for array in [&kept.velocities, &kept.accelerations, &kept.angular_velocities].into_iter().flatten() {
            if array.vec3(0).is_none() || array.len() != arrays.len() {
                return Err("its velocities are of the wrong length or type".to_owned());
            }
        }
        let mut keys = if kept.accelerations.is_some() { ACCELERATED_KEYS } else { 2 };
        if let Some(angular) = &kept.angular_velocities {
            let rate = (0..angular.len()).filter_map(|at| angular.vec3(at)).map(|rate| rate.length());
            let most = rate.filter(|rate| rate.is_finite()).fold(0.0, f64::max).to_radians() * (close - open);
            while keys < MAX_KEYS && most > MOST_TURN * (keys - 1) as f64 {
                keys += 1;
            }
        }
        Ok(Some(Self::Velocities { motion: kept, keys }))
    }

    pub(crate) fn same_contents(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Samples(a), Self::Samples(b)) => {
                let alike = |(a, b): (&InstancerSample, &InstancerSample)| {
                    a.time == b.time && a.arrays().into_iter().zip(b.arrays()).all(is_same)
                };
                a.len() == b.len() && a.iter().zip(b).all(alike)
            }
            (Self::Velocities { motion: a, keys }, Self::Velocities { motion: b, keys: other }) => {
                let arrays =
                    |m: &InstancerMotion| [m.velocities.clone(), m.accelerations.clone(), m.angular_velocities.clone()];
                let (a_arrays, b_arrays) = (arrays(a), arrays(b));
                let same = a_arrays.iter().zip(&b_arrays).all(|(a, b)| is_same((a.as_ref(), b.as_ref())));
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

    /// The placers of the keys, given that of the arrays themselves.
    #[expect(clippy::cast_possible_truncation, reason = "keys have times in single precision")]
    pub(crate) fn placers<'a>(&'a self, arrays: &'a InstanceArrays, placer: &InstancePlacer<'a>) -> Vec<KeyPlacer<'a>> {
        match self {
            Self::Samples(samples) => samples
                .iter()
                .map(|sample| KeyPlacer { time: sample.time as f32, placer: placer.at_time(sample.arrays(), None) })
                .collect(),
            Self::Velocities { motion, keys } => {
                let [_, own @ ..] = arrays.all();
                let own = own.map(Option::as_ref);
                let view = |array: &'a Option<TypedArray>| array.as_ref().map(TypedArray::view);
                (0..*keys)
                    .map(|key| {
                        let time = key as f64 / (*keys as f64 - 1.0);
                        let drift = VelocityMotion {
                            velocities: view(&motion.velocities),
                            accelerations: view(&motion.accelerations),
                            angular: view(&motion.angular_velocities),
                            seconds: motion.seconds[0] + time * (motion.seconds[1] - motion.seconds[0]),
                        };
                        KeyPlacer { time: time as f32, placer: placer.at_time(own, Some(drift)) }
                    })
                    .collect()
            }
        }
    }
}

impl InstancerSample {
    pub(crate) fn arrays(&self) -> [Option<&TypedArray>; 4] {
        [&self.translations, &self.rotations, &self.scales, &self.transforms].map(Option::as_ref)
    }
}

fn is_same((a, b): (Option<&TypedArray>, Option<&TypedArray>)) -> bool {
    match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => a.same_contents(b),
        _ => false,
    }
}

/// Times of samples: finite numbers, each larger than the one before, also in single precision.
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

/// Leaves at most [`MAX_KEYS`], the first and the last among them.
pub(crate) fn thin_out<T: Clone>(samples: &mut Vec<T>) {
    if samples.len() > MAX_KEYS {
        let last = samples.len() - 1;
        let pick = |at: usize| samples.get(at * last / (MAX_KEYS - 1)).cloned();
        *samples = (0..MAX_KEYS).filter_map(pick).collect();
    }
}

/// The samples of a prim's transform as its motion: in order, some of them different; `None` where it does not move.
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
