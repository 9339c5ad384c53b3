// SPDX-License-Identifier: Apache-2.0
//! The camera of a job, ready for the passes.

use crate::error::RenderError;
use crate::job::RenderJob;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use oocpt_abi::ClipPlane;
use oocpt_core::CameraMotion;
use oocpt_core::camera::CameraRays;

/// The view of a job, as rays.
#[derive(Debug)]
pub(crate) struct CameraView {
    pub(crate) rays: CameraRays,
    /// How the camera moves, if it does.
    pub(crate) motion: Option<CameraMotion>,
    pub(crate) clip_planes: Vec<ClipPlane>,
}

impl CameraView {
    /// The rays of `job`; `shared` hears of a motion that cannot be used.
    pub(crate) fn of(job: &RenderJob, shared: &SharedState) -> Result<Self, RenderError> {
        let origin = job.snapshot.origin;
        let in_motion = job.request.camera.in_motion(origin).unwrap_or_else(|why| {
            shared.report(Severity::Warning, why.to_string());
            None
        });
        let still = in_motion.as_ref().map_or(&job.request.camera, |(still, _)| still);
        let (rays, clip_planes) = (still.rays(origin)?, still.planes_along_rays()?);
        Ok(Self { rays, clip_planes, motion: in_motion.map(|(_, motion)| motion) })
    }
}
