// SPDX-License-Identifier: Apache-2.0
//! Uploads the parts of the camera that the frame block points to: its motion, its clipping planes and the filter of
//! its pixels, as `shaders/camera` reads them. Render thread only.

use crate::assets::motion_key;
use crate::error::RenderError;
use crate::frame::context::FrameContext;
use oocpt_abi::{FILTER_INTERVALS, Features, FrameConstants, GpuCameraKey};
use oocpt_core::inventory::RenderInventory;
use oocpt_core::{CameraMotion, MotionKey};
use oocpt_gpu::{Buffer, BufferUsage};

/// Uploads motion, clipping planes and filter, if there are any, and writes their addresses into the block.
pub(crate) fn upload(
    context: &FrameContext<'_>,
    features: Features,
    block: &mut FrameConstants,
    listed: &mut RenderInventory,
) -> Result<[Option<Buffer>; 3], RenderError> {
    let mut upload = |name: &str, bytes: &[u8]| -> Result<Option<Buffer>, RenderError> {
        if bytes.is_empty() {
            return Ok(None);
        }
        let buffer = Buffer::new(&context.device.gpu, name, bytes.len() as u64, BufferUsage::Upload)?;
        buffer.write(0, bytes)?;
        listed.add(name, bytes.len() as u64);
        Ok(Some(buffer))
    };
    let motion = upload("camera motion", &context.camera_motion.map(encode).unwrap_or_default())?;
    let planes = upload("clipping planes", bytemuck::cast_slice(context.clip_planes))?;
    block.camera_motion = motion.as_ref().map_or(0, Buffer::address);
    block.clip_planes = planes.as_ref().map_or(0, Buffer::address);
    // At most MAX_CLIP_PLANES.
    block.clip_plane_count = u32::try_from(context.clip_planes.len()).unwrap_or(0);
    let filter =
        features.contains(Features::PIXEL_FILTER).then(|| context.job.settings.filter().table(FILTER_INTERVALS));
    let offsets = filter.as_ref().map_or(&[][..], |table| &table.offsets);
    let offsets = upload("pixel filter", bytemuck::cast_slice(offsets))?;
    block.pixel_filter = offsets.as_ref().map_or(0, Buffer::address);
    if let Some(table) = filter {
        (block.filter_weight, block.filter_negative_from) = (table.weight, table.negative_from);
    }
    Ok([motion, planes, offsets])
}

/// The header and the keys behind it.
fn encode(motion: &CameraMotion) -> Vec<u8> {
    let keys: Vec<GpuCameraKey> = motion.keys.iter().map(camera_key).collect();
    let mut bytes = bytemuck::bytes_of(&motion.rays).to_vec();
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
