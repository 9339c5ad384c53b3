// SPDX-License-Identifier: Apache-2.0
//! Renders small scenes on whatever Vulkan device there is, with the validation layer on, and compares the images with
//! answers that are known: closed forms, the judge's f64 renderer, another way to say the same scene.
#![forbid(unsafe_code)]

mod adaptive;
mod agreement;
mod bsdf;
mod calibration;
mod clipping;
mod control;
mod convergence;
mod counts;
mod deform;
mod determinism;
mod edits;
mod failures;
mod features;
mod first_use;
mod furnace;
mod glass;
mod last_bounce;
mod lights;
mod materials;
mod motion;
mod motion_vectors;
mod native;
mod passes;
mod round;
mod scenes;
mod streaming;
mod support;
mod target;
mod textures;
mod toys;
