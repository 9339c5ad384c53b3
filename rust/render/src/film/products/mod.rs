// SPDX-License-Identifier: Apache-2.0
//! Render products: from what a scene asks for to the files that are written.
//!
//! Scenes come from strangers: a product writes EXR files and nothing else, never over a file that is none, nor over
//! one that the scene reads.

mod channels;
mod cryptomatte;
mod deep;
mod deep_lines;
mod file;
mod frame_name;
mod header;
mod plan;
mod sources;
mod times;

pub(crate) use file::write;
pub(crate) use plan::{ProductPlan, add_kinds, plan};
pub use sources::{naming_primvar, unknown_aov};
pub(crate) use times::times;
