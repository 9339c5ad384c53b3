// SPDX-License-Identifier: Apache-2.0
//! The inputs of a frame beside its scene. Render thread only.

use crate::device::Device;
use crate::error::RenderError;
use crate::film::Film;
use crate::frame::in_flight::InFlight;
use crate::job::RenderJob;
use crate::job::forced_features::ForcedFeatures;
use crate::lights::{LightTable, LightTables};
use oocpt_abi::{ClipPlane, Features};
use oocpt_core::CameraMotion;
use oocpt_core::camera::CameraRays;
use oocpt_core::residency::PolicyKind;
use oocpt_core::settings::{HostMapped, Settings};
use oocpt_gpu::{DeviceKind, GpuError};
use std::sync::Arc;

/// The inputs of a frame beside its scene: job, camera, lights, film and device.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FrameContext<'a> {
    pub(crate) device: &'a Arc<Device>,
    pub(crate) job: &'a RenderJob,
    pub(crate) rays: &'a CameraRays,
    /// The motion of the camera, if it moves.
    pub(crate) camera_motion: Option<&'a CameraMotion>,
    /// The clipping planes of the camera.
    pub(crate) clip_planes: &'a [ClipPlane],
    pub(crate) lights: &'a LightTable,
    /// Address of the light table on the device.
    pub(crate) lighting: u64,
    pub(crate) film: &'a Film,
    pub(crate) tables: &'a LightTables,
    /// Features that are compiled in although the scene does not need them.
    pub(crate) carry: &'a ForcedFeatures,
    /// The part of `carry` that these lights allow.
    pub(crate) allowed_by_lights: Features,
    /// Paths a second that were traced last, where images are shown on the way.
    pub(crate) pace: Option<f64>,
    /// Memory is short.
    pub(crate) is_frugal: bool,
    /// True if tiles of the scene's textures found no room when it was rendered without streaming.
    pub(crate) has_outgrown: bool,
}

/// Calls `make` with `wanted`, then with half as much each time memory runs out, down to `least`.
pub(crate) fn shrinking<T>(
    wanted: u64,
    least: u64,
    make: impl Fn(u32) -> Result<T, GpuError>,
) -> Result<T, RenderError> {
    let mut capacity = wanted;
    loop {
        match make(u32::try_from(capacity).unwrap_or(u32::MAX)) {
            Err(GpuError::OutOfMemory { .. }) if capacity / 2 >= least => capacity /= 2,
            result => return Ok(result?),
        }
    }
}

/// The cap on geometry that the user sets, bytes.
pub(crate) fn geometry_cap(job: &RenderJob) -> Option<u64> {
    (job.settings.geometry_budget_kib > 0).then(|| u64::from(job.settings.geometry_budget_kib) << 10)
}

/// Paths of the whole render.
pub(crate) fn paths(job: &RenderJob) -> u64 {
    job.request.pixels() * u64::from(job.settings.samples_per_pixel)
}

/// How many of them a scene in core has in flight, `path_bytes` each.
pub(crate) fn in_flight(context: &FrameContext<'_>, path_bytes: u64) -> InFlight {
    let FrameContext { device, job, film, .. } = *context;
    // First hits alone take one through each pixel.
    let paths = if film.has_color() { paths(job) } else { job.request.pixels() };
    let device_bytes = device.gpu.report().device_bytes();
    InFlight { is_cpu: is_cpu(device), device_bytes, paths, path_bytes, asked: job.options.in_flight }
}

/// What lights and what is carried with them have compiled in.
fn light_features(context: &FrameContext<'_>) -> Features {
    context.lights.features | (context.carry.features & context.allowed_by_lights)
}

/// Whether some light asks for shadow rays.
pub(crate) fn has_shadow_rays(context: &FrameContext<'_>) -> bool {
    let any = Features::DOME | Features::DISTANT | Features::LOCAL_LIGHTS | Features::MESH_LIGHTS;
    light_features(context).intersects(any)
}

/// Whether paths keep what lights ask of the surface that a ray left (`HAS_PREVIOUS_VERTICES` of the shaders).
pub(crate) fn has_light_paths(context: &FrameContext<'_>) -> bool {
    let near = Features::LOCAL_LIGHTS | Features::MESH_LIGHTS;
    light_features(context).intersects(near | Features::LIGHT_LINKS | Features::LIGHT_LOBES | Features::PRIM_MASKS)
}

/// Most bounces of each kind: diffuse, specular, transmission.
pub(crate) fn kind_limits(settings: &Settings) -> [u32; 3] {
    [settings.max_diffuse_bounces, settings.max_specular_bounces, settings.max_transmission_bounces]
}

/// Returns true if some kind of bounce may end paths before `max_bounces` does.
pub(crate) fn limits_kinds(settings: &Settings) -> bool {
    kind_limits(settings).iter().any(|limit| *limit < settings.max_bounces)
}

/// Returns true if rays may read geometry in host memory where the device has no room for it.
pub(crate) fn maps_host(device: &Device, settings: &Settings) -> bool {
    let is_wanted = match settings.host_mapped {
        HostMapped::On => true,
        HostMapped::Off => false,
        HostMapped::Auto => !device.gpu.is_unified(),
    };
    // Other policies see only waiting rays.
    is_wanted && settings.policy == PolicyKind::Benefit
}

pub(crate) fn is_cpu(device: &Device) -> bool {
    device.gpu.report().kind == DeviceKind::Cpu
}
