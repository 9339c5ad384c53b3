// SPDX-License-Identifier: Apache-2.0
//! One request to render, and the messages that come back.

use crate::error::RenderError;
use crate::job::aov::{AovKind, AovRequest};
use crate::job::deep::DeepLimits;
use crate::job::expression::fit_together;
use crate::job::window::{PictureLayout, PixelWindow};
use oocpt_abi::MAX_SHOWN_PRIMVARS;
use oocpt_core::camera::Camera;

/// Longest side of an image, pixels.
pub const MAX_SIDE: u32 = 1 << 16;
/// Largest image area, pixels: 4 GiB of colour.
pub const MAX_PIXELS: u64 = oocpt_film::MAX_PIXELS;

/// Everything a render depends on besides scene and settings.
#[derive(Clone, Debug, PartialEq)]
pub struct RenderRequest {
    /// Width of every image, pixels.
    pub width: u32,
    /// Height of every image, pixels.
    pub height: u32,
    /// The camera, in f64 world space.
    pub camera: Camera,
    /// The images wanted; may be empty (nothing is rendered then).
    pub aovs: Vec<AovRequest>,
    /// The part of the picture that is rendered, and nothing else; none: all of it. Its pixels are those of the whole
    /// picture, bit for bit, unless samples are adaptive. Outside of it images have their clear values.
    pub window: Option<PixelWindow>,
}

impl RenderRequest {
    /// Checks the image size against the limits of the renderer.
    pub fn validate(&self) -> Result<(), RenderError> {
        let (width, height) = (self.width, self.height);
        let area = u64::from(width) * u64::from(height);
        if width == 0 || height == 0 || width > MAX_SIDE || height > MAX_SIDE || area > MAX_PIXELS {
            return Err(RenderError::ImageSize { width, height, max: MAX_SIDE, max_pixels: MAX_PIXELS });
        }
        Ok(())
    }

    /// What is rendered: the window as far as it is in the picture.
    pub fn part(&self) -> PixelWindow {
        let size = [self.width, self.height];
        self.window.map_or(PixelWindow::whole(size), |window| window.within(size))
    }

    /// Pixels that are rendered.
    pub fn pixels(&self) -> u64 {
        self.part().pixels()
    }

    /// Pixels of each image.
    pub fn image_pixels(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// The kinds of its images, each once, in order.
    pub(crate) fn kinds(&self) -> Vec<AovKind> {
        let mut kinds: Vec<AovKind> = self.aovs.iter().map(|aov| aov.kind).collect();
        kinds.sort_unstable();
        kinds.dedup();
        kinds
    }

    /// Whether samples of `have` are samples of this request too: other images may be wanted of the same view, but the
    /// same ones that are summed with the samples (`filters`: filtered ones are), and light of both or of neither.
    pub(crate) fn has_samples_of(&self, have: &Self, filters: bool) -> bool {
        let view = |of: &Self| Self { aovs: Vec::new(), ..of.clone() };
        let has_light = |of: &Self| of.aovs.iter().any(|aov| aov.kind.is_of_light());
        let is_filtered = |aov: &&AovRequest| aov.kind.is_of_samples(filters);
        view(self) == view(have)
            && has_light(self) == has_light(have)
            && self.aovs.iter().filter(is_filtered).eq(have.aovs.iter().filter(is_filtered))
    }

    /// Leaves out images of light path expressions beyond those that one automaton has room for, and primvars beyond
    /// those that a frame can show; returns them.
    pub(crate) fn keep_shown(&mut self) -> Vec<AovKind> {
        let (mut kept, mut left) = (Vec::new(), Vec::new());
        let mut primvars: Vec<AovKind> = Vec::new();
        self.aovs.retain(|aov| {
            if aov.kind.primvar().is_some() && !primvars.contains(&aov.kind) {
                let fits = primvars.len() < MAX_SHOWN_PRIMVARS as usize;
                if fits {
                    primvars.push(aov.kind)
                } else {
                    left.push(aov.kind)
                }
                return fits;
            }
            let Some(expression) = aov.kind.expression().filter(|expression| !kept.contains(expression)) else {
                return true;
            };
            kept.push(expression);
            let fits = fit_together(&kept).is_ok();
            if !fits {
                kept.pop();
                left.push(aov.kind);
            }
            fits
        });
        left
    }

    /// Asks for a deep image that has all that one of these limits has: a request has one at most.
    pub(crate) fn add_deep(&mut self, limits: DeepLimits) {
        let limits = self.deep().map_or(limits, |have| have.finer(limits));
        self.aovs.retain(|aov| aov.kind.deep().is_none());
        self.aovs.push(AovRequest { kind: AovKind::Deep(limits), clear: [0.0; 4] });
    }

    /// The limits of its deep image.
    pub(crate) fn deep(&self) -> Option<DeepLimits> {
        self.aovs.iter().filter_map(|aov| aov.kind.deep()).reduce(DeepLimits::finer)
    }

    /// Where the pixels go in the images.
    pub(crate) fn layout(&self) -> PictureLayout {
        PictureLayout::new([self.width, self.height], self.part(), &self.aovs)
    }
}

/// The severity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Severity {
    /// The outcome of a picture.
    Status,
    /// Something was dropped or is not supported; the render goes on.
    Warning,
    /// The render ended early.
    Error,
}

/// One message for the user; each problem is reported once.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// The severity of the message.
    pub severity: Severity,
    /// One line, with the prim path where there is one.
    pub text: String,
}
