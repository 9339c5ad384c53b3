// SPDX-License-Identifier: Apache-2.0
//! Renders small scenes on any Vulkan device, with the validation layer on, and compares the images with known answers:
//! closed forms, the judge's f64 renderer, another description of the same scene.
#![forbid(unsafe_code)]

mod adaptive;
mod against_judge;
mod bounce_kinds;
mod bsdf;
mod checkpoints;
mod clipping;
mod commits;
mod control;
mod curves_and_points;
mod deep_images;
mod deformation;
mod denoised;
mod determinism;
mod edits;
mod error_calibration;
mod error_estimate;
mod extending;
mod failures;
mod features;
mod film_parts;
mod film_windows;
mod filtered_images;
mod first_picture;
mod furnace;
mod glass_furnace;
mod going_on;
mod last_bounce;
mod lights;
mod load_waits;
mod materials;
mod motion;
mod motion_vectors;
mod moved_windows;
mod native_traversal;
mod passes;
mod path_expressions;
mod pixel_filter;
mod prim_masks;
mod ranked_ids;
mod refitted;
mod sample_counts;
mod scenes;
mod several_devices;
mod shadows;
mod streaming;
mod support;
mod target_error;
mod textures;
mod warm_up;
mod windows;
