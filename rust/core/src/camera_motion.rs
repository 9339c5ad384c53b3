// SPDX-License-Identifier: Apache-2.0
//! Camera motion while the shutter is open: the keys of a frame, and the rays within that frame. Pure; any thread.

use glam::{DAffine3, DVec3};
use oocpt_abi::GpuCameraMotion;

use crate::camera::{Camera, CameraError};
use crate::instancing::motion::{MotionKey, map_at, motion_keys};

/// A camera that moves, as keys in time.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraMotion {
    /// World, relative to the given origin, from the view's frame; two or more keys, in the order of time.
    pub keys: Vec<MotionKey>,
    /// Rays in the view's frame, as those of [`crate::CameraRays`] in the world.
    pub rays: GpuCameraMotion,
}

/// Reason why the motion of a camera is ignored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum CameraMotionError {
    /// A time is not finite, or not after the one before.
    #[error("the camera does not move: its samples are not in the order of time")]
    Times,
    /// A matrix is singular or not finite, or mirrors while the one before does not.
    #[error("the camera does not move: a sample of its transform is singular, not finite or inside out")]
    Transforms,
    /// The camera at a key cannot be used.
    #[error(transparent)]
    Camera(#[from] CameraError),
}

impl Camera {
    /// The camera at the middle of the shutter, with its motion relative to the world point `origin`; `None` if it does
    /// not move.
    ///
    /// # Errors
    /// See [`CameraMotionError`].
    pub fn in_motion(&self, origin: DVec3) -> Result<Option<(Self, CameraMotion)>, CameraMotionError> {
        if !self.motion.windows(2).any(|pair| pair[0].transform != pair[1].transform) {
            return Ok(None);
        }
        let shifted: Vec<_> = self
            .motion
            .iter()
            .map(|sample| {
                let mut map = DAffine3::from_mat4(sample.transform);
                map.translation -= origin;
                (sample.time, map)
            })
            .collect();
        let times = shifted.windows(2).all(|pair| pair[1].0 - pair[0].0 > 1e-6);
        if !(times && shifted.iter().all(|(time, _)| time.abs() < 1e6)) {
            return Err(CameraMotionError::Times);
        }
        let keys = motion_keys(&shifted).ok_or(CameraMotionError::Transforms)?;
        let mut middle = map_at(&keys, 0.5);
        middle.translation += origin;
        let still = Self { world_from_view: middle.into(), motion: Vec::new(), ..self.clone() };
        // The camera looks from the origin of the world, so its rays are those of the view.
        let view = Self { world_from_view: glam::DMat4::IDENTITY, ..still.clone() }.rays(DVec3::ZERO)?;
        let rays = GpuCameraMotion {
            o: view.o,
            key_count: u32::try_from(keys.len()).unwrap_or(0),
            o_x: view.o_x,
            lens_radius: view.lens_u[0],
            o_y: view.o_y,
            d: view.d,
            d_x: view.d_x,
            d_y: view.d_y,
            ..GpuCameraMotion::default()
        };
        Ok(Some((still, CameraMotion { keys, rays })))
    }
}
