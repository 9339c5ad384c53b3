// SPDX-License-Identifier: Apache-2.0
//! What tells the films of two renders apart: scene, camera, size, settings, version.

use crate::frame::block::error_floor;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use oocpt_core::camera::Camera;
use oocpt_film::{FilmHeader, FilmIdentity, FilmRequest, FilmView};
use oocpt_gpu::DeviceReport;
use std::sync::LazyLock;
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// The version of the renderer, and a hash of its shaders: those of another build may give other samples.
static VERSION: LazyLock<String> = LazyLock::new(|| {
    let mut hasher = Xxh3::new();
    for module in oocpt_shaders::ALL {
        hasher.update(module.name.as_bytes());
        hasher.update(bytemuck::cast_slice(module.words));
    }
    format!("{} ({:016x})", env!("CARGO_PKG_VERSION"), hasher.digest())
});

/// A camera in words that tell it from others: where it is, and a hash of all of it but the exposure, which samples do
/// not depend on.
fn camera_text(camera: &Camera) -> String {
    let [x, y, z, _] = camera.world_from_view.w_axis.to_array();
    let plain = Camera { exposure_scale: 1.0, ..camera.clone() };
    format!("at {x}, {y}, {z} ({:016x})", xxh3_64(format!("{plain:?}").as_bytes()))
}

/// A device in words.
pub(crate) fn device_text(device: &DeviceReport) -> String {
    format!("{} ({})", device.name, device.driver)
}

/// What the film of a job says of itself before it has samples.
pub(crate) fn film_header(job: &RenderJob, device: &DeviceReport) -> FilmHeader {
    let (request, part) = (&job.request, job.request.part());
    let identity = FilmIdentity {
        scene: job.scene.map_or_else(String::new, |hash| format!("{hash:032x}")),
        request: FilmRequest {
            camera: camera_text(&request.camera),
            size: [request.width, request.height],
            window: [part.x, part.y, part.width, part.height],
        },
        settings: job.settings.of_samples(),
        version: VERSION.clone(),
    };
    let clear = request.aovs.iter().find(|aov| aov.kind == AovKind::Color);
    let exposure = request.camera.exposure();
    let view =
        FilmView { exposure, clear_color: clear.map_or([0.0; 4], |aov| aov.clear), error_floor: error_floor(exposure) };
    let devices = [device_text(device)].into();
    FilmHeader { identity, view, devices, ..FilmHeader::default() }
}
