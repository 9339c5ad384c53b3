// SPDX-License-Identifier: Apache-2.0
//! Requests to render.

use crate::ffi::RenderDesc;
use glam::DVec4;
use oocpt_core::array::column_matrix;
use oocpt_core::camera::Camera;
use oocpt_render::{AovKind, AovRequest, PixelWindow, RenderRequest};

/// A request as the renderer takes it.
pub(crate) fn render_request(desc: &RenderDesc) -> RenderRequest {
    let size = [desc.width, desc.height];
    let [right, bottom] = size.map(|side| i32::try_from(side).unwrap_or(i32::MAX));
    let is_whole = desc.data_window == [0, 0, right, bottom];
    RenderRequest {
        width: desc.width,
        height: desc.height,
        window: (!is_whole).then(|| PixelWindow::of_corners(desc.data_window, size)),
        camera: Camera {
            world_from_view: column_matrix(&desc.world_from_view),
            projection: column_matrix(&desc.projection),
            display_window: desc.display_window,
            data_window: [0, 0, right, bottom],
            lens_radius: desc.lens_radius,
            focus_distance: desc.focus_distance,
            clip_planes: desc.clip_planes.as_chunks().0.iter().map(|plane| DVec4::from_array(*plane)).collect(),
            motion: super::motion::transform_samples(&desc.camera_motion),
            exposure_scale: desc.exposure_scale,
        },
        aovs: desc
            .aovs
            .iter()
            .filter_map(|aov| {
                let kind = AovKind::from_token(&aov.name)?;
                Some(AovRequest { kind, clear: if aov.has_clear { aov.clear } else { kind.default_clear() } })
            })
            .collect(),
    }
}
