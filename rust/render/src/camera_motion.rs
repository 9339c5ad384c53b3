// SPDX-License-Identifier: Apache-2.0
//! The bytes of a camera that moves, as `shaders/include/camera.glsl` reads them. Pure.

use crate::assets::motion_key;
use oocpt_core::{CameraMotion, MotionKey};
use oocpt_shader_abi::{GpuCameraKey, GpuCameraMotion};

/// The header and the keys behind it.
pub(crate) fn encode(motion: &CameraMotion) -> Vec<u8> {
    let CameraMotion { keys, o, o_x, o_y, d, d_x, d_y, lens_radius } = motion;
    let header = GpuCameraMotion {
        o: *o,
        key_count: u32::try_from(keys.len()).unwrap_or(0),
        o_x: *o_x,
        lens_radius: *lens_radius,
        o_y: *o_y,
        d: *d,
        d_x: *d_x,
        d_y: *d_y,
        ..GpuCameraMotion::default()
    };
    let keys: Vec<GpuCameraKey> = keys.iter().map(camera_key).collect();
    let mut bytes = bytemuck::bytes_of(&header).to_vec();
    bytes.extend_from_slice(bytemuck::cast_slice(&keys));
    bytes
}

fn camera_key(key: &MotionKey) -> GpuCameraKey {
    let rounded = motion_key(key);
    let mut low = key.translation;
    let [x, y, z] = rounded.translation.map(f64::from);
    (low.x, low.y, low.z) = (low.x - x, low.y - y, low.z - z);
    GpuCameraKey { key: rounded, translation_lo: low.as_vec3().to_array(), pad: 0 }
}
