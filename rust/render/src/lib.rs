// SPDX-License-Identifier: Apache-2.0
//! OocPT's renderer: a [`Session`] takes scene edits and requests, and commits and renders them on its own threads.
//!
//! The way of a ray through the code: `renderer` (the outline of a render) -> `engine` (decides what is submitted when)
//! -> `wavefront` (the passes: generate, intersect, shade, accumulate) -> `film` (images) -> the session's published
//! images. The straight line of a mesh: `oocpt_core::scene` -> `assets` (load, build, tables) -> traversal. Scenes that
//! do not fit: `streaming`, a path source of the engine.
//!
//! Modules use only those below them: `cargo xtask check` fails on a cycle.
#![forbid(unsafe_code)]

mod assets;
mod denoiser;
mod device;
mod engine;
mod error;
mod feedback;
mod film;
mod frame;
mod geometry_files;
mod host_memory;
mod job;
mod lights;
mod renderer;
mod report;
mod session;
mod streaming;
mod sync;
mod team;
pub mod textures;
mod wave;
mod wavefront;

pub use device::bsdf_tables;
pub use error::RenderError;
pub use film::picture;
pub use film::products::{naming_primvar, unknown_aov};
pub use host_memory::peak as host_peak_bytes;
pub use job::SessionOptions;
pub use job::aov::{AovKind, AovRequest};
pub use job::commits::CommitProgress;
pub use job::deep::DeepLimits;
pub use job::edits::SceneEdit;
pub use job::expression::ExpressionId;
#[cfg(feature = "faults")]
pub use job::faults::{CommitGate, FaultWitness, PlantedFaults};
pub use job::forced_features::ForcedFeatures;
pub use job::light_files::{LightFiles, LightPicture, NoFiles};
pub use job::product::{HeaderValue, ProductVar, RenderProduct};
pub use job::request::{MAX_PIXELS, MAX_SIDE, Message, RenderRequest, Severity};
pub use job::timings::{LeftMoment, LevelCounts, PassTime, RenderTimings};
pub use job::window::PixelWindow;
pub use report::{chunk_report, error_report, material_report};
pub use session::Session;
pub use session::early::EarlyEnd;
