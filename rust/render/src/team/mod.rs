// SPDX-License-Identifier: Apache-2.0
//! Several devices that render one picture (`oocpt:devices`): a [`Renderer`] each, on a thread of its own, with its own
//! residency and budget of device memory. The scene, host memory and files are shared.
//!
//! A device renders blocks of samples ([`blocks`]) into exact sums, which are added to one film in host memory as they
//! come; the picture and its error are made of that film, and so have the same bits whatever device rendered what, if
//! the devices round alike. A device that fails gives back the samples that the film has not got from it. The render
//! thread adds up what blocks say, follows the error, and decides when it is enough.

mod blocks;
mod member;
mod picture;
mod plan;

use crate::error::RenderError;
use crate::frame::film_part::obstacle;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::request::Severity;
use crate::job::shared::{FrameGate, SharedState};
use crate::renderer::Renderer;
use crate::team::member::TeamMember;
use oocpt_core::settings::Settings;
use oocpt_gpu::{DeviceReport, devices_together};
use std::sync::atomic::Ordering;

/// The renderers of a session: one, or one for each of several devices. Render thread only.
#[derive(Debug, Default)]
pub(crate) struct RenderTeam {
    one: Renderer,
    members: Vec<TeamMember>,
}

impl RenderTeam {
    /// Renders `job`, on one device or on those that its settings name.
    pub(crate) fn render(&mut self, job: &RenderJob, gate: &FrameGate<'_>) -> Result<(), RenderError> {
        let settings = &job.settings;
        if settings.devices.trim().is_empty() || job.request.validate().is_err() || job.request.part().is_empty() {
            return self.render_on_one(job, gate);
        }
        let selector = (!settings.device.is_empty()).then_some(&*settings.device);
        let devices = devices_together(&settings.devices, selector)?;
        let first = devices.first().map_or_else(String::new, |device| device.index.to_string());
        if let Some(text) = obstacle(job).map(str::to_owned).or_else(|| image_obstacle(job)) {
            return self.render_on_first(job, gate, (first, &text));
        }
        warn(job, &devices, gate.shared());
        self.one = Renderer::default();
        if !self.members.iter().map(|member| member.device.index).eq(devices.iter().map(|device| device.index)) {
            self.members = TeamMember::of(devices);
        }
        match picture::render(job, gate, &mut self.members) {
            // One device alone needs no sums that merge, and renders a film that is too large in windows.
            Err(error @ (RenderError::Budget { .. } | RenderError::NoProgress { .. }))
                if settings.film_part.is_empty() =>
            {
                self.render_on_first(job, gate, (first, &format!("no device has the memory ({error})")))
            }
            result => result,
        }
    }

    /// Renders `job` on the device of this index alone, and tells why.
    fn render_on_first(
        &mut self,
        job: &RenderJob,
        gate: &FrameGate<'_>,
        (device, reason): (String, &str),
    ) -> Result<(), RenderError> {
        tell_obstacle(gate.shared(), &job.settings, reason);
        let settings = Settings { device, devices: String::new(), ..job.settings.clone() };
        self.render_on_one(&RenderJob { settings, ..job.clone() }, gate)
    }

    fn render_on_one(&mut self, job: &RenderJob, gate: &FrameGate<'_>) -> Result<(), RenderError> {
        self.members.clear();
        self.one.render(job, gate)
    }
}

/// What of the images of `job` forbids that several devices render it, in words: films have the colour alone. Images
/// through pixel centres are made by one device.
fn image_obstacle(job: &RenderJob) -> Option<String> {
    if !job.settings.chunk_report.is_empty() {
        return Some("oocpt:chunkReport is of one device".to_owned());
    }
    let kinds = job.request.kinds();
    if !kinds.contains(&AovKind::Color) {
        return Some("no colour is asked for".to_owned());
    }
    let is_of_samples = |kind: &AovKind| kind.is_of_light() || kind.is_of_samples(job.settings.filter_aovs);
    let kind = kinds.into_iter().find(|kind| *kind != AovKind::Color && is_of_samples(kind))?;
    Some(format!("films have no image {}", kind.name()))
}

/// Tells why one device renders the picture; once for a live view, which renders anew with each edit.
fn tell_obstacle(shared: &SharedState, settings: &Settings, text: &str) {
    if !settings.interactive || !shared.told_of_devices.swap(true, Ordering::Relaxed) {
        shared.report(Severity::Warning, format!("oocpt:devices: {text}: the picture is rendered on one device"));
    }
}

/// Tells what a picture of several devices has not.
fn warn(job: &RenderJob, devices: &[DeviceReport], shared: &SharedState) {
    if !job.settings.checkpoint.is_empty() {
        let text = "a picture that several devices render has no checkpoints; oocpt:filmPart keeps its samples";
        shared.report(Severity::Warning, format!("oocpt:checkpoint: {text}"));
    }
    if let [first, others @ ..] = devices
        && let Some(other) = others.iter().find(|other| (&other.name, &other.driver) != (&first.name, &first.driver))
    {
        let [first, other] = [first, other].map(|device| format!("{} ({})", device.name, device.driver));
        let text = "round differently: the last bits of the picture depend on which of them renders what";
        shared.report(Severity::Warning, format!("oocpt:devices: {first} and {other} {text}"));
    }
}
