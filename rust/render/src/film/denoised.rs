// SPDX-License-Identifier: Apache-2.0
//! Which pictures are denoised, and the images that takes. Pure.

use crate::job::aov::{AovKind, AovRequest};
use crate::job::request::RenderRequest;
use oocpt_core::settings::{DenoiseMode, Settings};

/// Whether hosts see the denoised picture in place of the colour.
pub(crate) fn replaces_color(settings: &Settings) -> bool {
    settings.denoise != DenoiseMode::Off
}

/// Adds the images to a request that denoising it takes, if it is to be denoised.
pub(crate) fn add_guides(request: &mut RenderRequest, settings: &Settings) {
    if !is_wanted(&request.kinds(), settings) {
        return;
    }
    for kind in [AovKind::Color, AovKind::Albedo, AovKind::Normal, AovKind::Denoised] {
        if request.aovs.iter().all(|aov| aov.kind != kind) {
            request.aovs.push(AovRequest { kind, clear: kind.default_clear() });
        }
    }
}

/// Whether a picture with such images is to be denoised.
pub(crate) fn is_wanted(kinds: &[AovKind], settings: &Settings) -> bool {
    kinds.contains(&AovKind::Denoised) || replaces_color(settings) && kinds.contains(&AovKind::Color)
}
