// SPDX-License-Identifier: Apache-2.0
//! Lights that move while the shutter is open: keys of what the device has of them. Pure; any thread.

use glam::{DAffine3, DMat3, DMat4, DVec3};

use super::{Light, LightEmitter, orthonormal};
use crate::desc::{LightDesc, TransformSample};
use crate::instancing::array_motion::transform_motion;
use crate::instancing::motion::{MAX_KEYS, MotionKey, PlacementKeys, key_at, map_at, motion_keys, swept_box};

/// Turn of a light between two of the times at which it is asked where it points, radians.
const STEP: f64 = 0.1;

/// How a light moves.
#[derive(Clone, Debug, PartialEq)]
pub struct LightMotion {
    /// World from the unit shape; of a light at infinity from its frame. Two or more, in the order of time.
    pub keys: Vec<MotionKey>,
    /// Radiance at each key, relative to the light's own: that of a normalised light falls as it grows.
    pub radiance: Vec<f64>,
    /// The light's own axes (columns) where the rotation of the keys is none.
    pub frame: DMat3,
}

impl LightMotion {
    /// Of a light that moves by `samples` of its transform and shows it; `None` of others; or why it has to stay.
    pub(crate) fn new(desc: &LightDesc, light: &Light, samples: &[TransformSample]) -> Result<Option<Self>, String> {
        if matches!(light.emitter, LightEmitter::Dome { texture: None }) {
            return Ok(None);
        }
        let Some(samples) = transform_motion(samples)? else { return Ok(None) };
        let motion = Self::of(desc, light, &samples)?;
        let changes = motion.radiance.windows(2).any(|pair| (pair[1] / pair[0] - 1.0).abs() > 1e-6);
        // Radiance is linear between keys, which that of a light that grows is not: as many as there may be.
        let finer = if changes { dense(&samples) } else { None };
        Ok(Some(finer.map_or(Ok(motion), |samples| Self::of(desc, light, &samples))?))
    }

    fn of(desc: &LightDesc, light: &Light, samples: &[TransformSample]) -> Result<Self, String> {
        let unusable = || "a sample of its transform is singular or not finite".to_owned();
        let brightest = |light: &Light| light.radiance.iter().map(|&c| f64::from(c)).fold(0.0, f64::max);
        let mut motion = Self { keys: Vec::new(), radiance: Vec::new(), frame: DMat3::IDENTITY };
        let mut keys = PlacementKeys::new();
        for sample in samples {
            let transform = DAffine3::from_mat4(sample.transform);
            let placed = Light::placed(desc, &transform).ok_or_else(unusable)?;
            let (map, frame) = match &placed.emitter {
                LightEmitter::Local(local) => (local.world_from_unit, local.frame),
                LightEmitter::Dome { .. } | LightEmitter::Distant { .. } => {
                    let frame = orthonormal(&transform.matrix3).ok_or_else(unusable)?;
                    (DAffine3 { matrix3: frame, translation: DVec3::ZERO }, frame)
                }
            };
            #[expect(clippy::cast_possible_truncation, reason = "keys have times in single precision")]
            let key = MotionKey::of(sample.time as f32, &map).ok_or_else(unusable)?;
            if motion.radiance.is_empty() {
                motion.frame = DMat3::from_quat(key.rotation).transpose() * frame;
            }
            motion.radiance.push(brightest(&placed) / brightest(light));
            if !keys.push(key) {
                return Err("its transform is turned inside out between two samples".to_owned());
            }
        }
        motion.keys = keys.as_slice().to_vec();
        let is_finite = motion.radiance.iter().all(|factor| factor.is_finite());
        if is_finite { Ok(motion) } else { Err(unusable()) }
    }

    /// The box of the part `+-half` of the unit shape while the shutter is open.
    #[must_use]
    pub fn swept(&self, half: [f64; 3]) -> ([f64; 3], [f64; 3]) {
        let (min, max) = swept_box(&self.keys, DVec3::ZERO, DVec3::from_array(half));
        (min.to_array(), max.to_array())
    }

    /// Where the light points (unit) at times while the shutter is open, and by what angle at most it turns between
    /// two of them that follow each other.
    #[must_use]
    pub fn axes(&self) -> (Vec<[f64; 3]>, f64) {
        let axis = |time: f64| DMat3::from_quat(key_at(&self.keys, time).rotation) * -self.frame.z_axis;
        let mut axes = vec![axis(0.0).to_array()];
        let mut most = 0.0_f64;
        for pair in self.keys.windows(2) {
            let [begin, end] = [&pair[0], &pair[1]].map(|key| f64::from(key.time).clamp(0.0, 1.0));
            // At most half a circle: some 30 steps.
            let angle = 2.0 * pair[0].half_angle;
            let steps = (angle / STEP).ceil().max(1.0);
            most = most.max(angle / steps);
            let mut at = 1.0;
            while at <= steps && end > begin {
                axes.push(axis(begin + (end - begin) * at / steps).to_array());
                at += 1.0;
            }
        }
        (axes, most)
    }

    /// Of a distant light: the direction towards it where the rotation of the keys is none, unit.
    #[must_use]
    pub fn direction(&self) -> [f32; 3] {
        self.frame.z_axis.as_vec3().to_array()
    }

    /// Of a dome: rows of the map to it from there.
    #[must_use]
    pub fn rows(&self) -> [[f32; 3]; 3] {
        // The transpose of a rotation is its inverse.
        [self.frame.x_axis, self.frame.y_axis, self.frame.z_axis].map(|axis| axis.as_vec3().to_array())
    }
}

/// The same motion as [`MAX_KEYS`] samples while the shutter is open, evenly spread.
fn dense(samples: &[TransformSample]) -> Option<Vec<TransformSample>> {
    let maps: Vec<(f64, DAffine3)> =
        samples.iter().map(|sample| (sample.time, DAffine3::from_mat4(sample.transform))).collect();
    let keys = motion_keys(&maps)?;
    let (first, last) = (maps.first()?.0.clamp(0.0, 1.0), maps.last()?.0.clamp(0.0, 1.0));
    if first >= last {
        return None;
    }
    #[expect(clippy::cast_precision_loss, reason = "16")]
    let time = |at: usize| first + (last - first) * at as f64 / (MAX_KEYS - 1) as f64;
    let sample = |at| TransformSample { time: time(at), transform: DMat4::from(map_at(&keys, time(at))) };
    Some((0..MAX_KEYS).map(sample).collect())
}
