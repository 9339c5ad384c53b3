// SPDX-License-Identifier: Apache-2.0
//! OocPT's renderer: a [`Session`] takes scene edits and requests, and renders them on its own thread.
//!
//! The straight line of a ray: `frame` (what a render consists of) -> `engine` (what is submitted when) ->
//! `wavefront` (the passes: generate, intersect, shade, accumulate) -> `film` (images) -> the session's published
//! images. The straight line of a mesh: `oocpt_core::scene` -> `assets` (load, build, tables) -> traversal. Scenes that
//! do not fit: `streaming`, a path source of the engine.
//!
//! Modules use those below them and no other: `cargo xtask check` finds a circle.
#![forbid(unsafe_code)]

mod adaptive;
mod aov;
mod assets;
mod block;
pub mod bsdf_tables;
mod cache_folder;
mod camera_blocks;
pub mod chunk_report;
mod closing_words;
mod compiled;
mod device;
mod early;
mod engine;
mod error;
mod error_log;
pub mod error_report;
#[cfg(feature = "faults")]
mod faults;
mod feedback;
mod film;
mod first_picture;
mod forced_features;
mod frame;
mod frame_context;
mod geometry_files;
mod host_memory;
mod in_core;
mod in_flight;
mod inventory;
mod job;
mod light_files;
mod lights;
mod loader;
pub mod material_report;
mod measure;
mod patience;
pub mod picture;
mod progress;
mod progress_bar;
mod publish;
mod reading;
mod reference;
mod request;
mod schedule;
mod session;
mod shared;
mod specialise;
mod streaming;
mod sync;
pub mod textures;
mod thread;
mod timings;
mod upload;
mod view;
mod wave;
mod wavefront;

pub use aov::{AovKind, AovRequest};
pub use early::EarlyEnd;
pub use error::RenderError;
#[cfg(feature = "faults")]
pub use faults::{FaultWitness, PlantedFaults};
pub use forced_features::ForcedFeatures;
pub use host_memory::peak as host_peak_bytes;
pub use job::SessionOptions;
pub use light_files::{LightFiles, LightPicture, NoFiles};
pub use request::{MAX_PIXELS, MAX_SIDE, Message, RenderRequest, Severity};
pub use session::Session;
pub use timings::{LeftMoment, PassTime, RenderTimings};
