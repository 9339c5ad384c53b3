// SPDX-License-Identifier: Apache-2.0
//! OocPT's renderer: a [`Session`] takes scene edits and requests, and renders them on its own thread.
//!
//! The straight line of a ray: `frame` (what a render consists of) -> `waves` (what is submitted when) ->
//! `wavefront` (the passes of one wave: generate, intersect, shade, accumulate) -> `film` (images) -> the session's
//! published images. The straight line of a mesh: `oocpt_core::scene` -> `assets` (load,
//! build, tables) -> traversal. Scenes that do not fit: `streaming`.
#![forbid(unsafe_code)]

mod adaptive;
mod aov;
mod assets;
pub mod bsdf_tables;
pub mod chunk_report;
mod device;
mod error;
mod error_log;
pub mod error_report;
mod feedback;
mod film;
mod frame;
mod inventory;
mod lights;
mod measure;
pub mod picture;
mod progress;
mod progress_bar;
mod publish;
mod reference;
mod request;
mod schedule;
mod session;
mod specialise;
mod streaming;
mod sync;
pub mod textures;
mod thread;
mod tile_waves;
mod timings;
mod wavefront;
mod waves;

pub use aov::{AovKind, AovRequest};
pub use error::RenderError;
pub use lights::{LightFiles, LightPicture, NoFiles};
pub use request::{MAX_PIXELS, MAX_SIDE, Message, RenderRequest, Severity};
pub use session::{Session, SessionOptions};
pub use timings::{LeftMoment, PassTime, Timings};
