// SPDX-License-Identifier: Apache-2.0
//! The interface of host and compute shaders, declared once: structs and the table of their layouts, flags, features,
//! constants, the tables of lobes, leaf kinds and light shapes, and the sampler.
//!
//! Guarantees: plain data and pure functions. No Vulkan, no shader compiler, no state: every crate may use it, the
//! build of the shaders too, which writes GLSL from it and compares the structs with the SPIR-V. Any thread.

#![forbid(unsafe_code)]

#[macro_use]
mod layout;

mod constants;
mod features;
mod film;
mod flags;
mod frame;
mod leaves;
mod light;
mod light_shapes;
mod lobes;
mod material;
mod node;
mod numbers;
mod path;
mod path_events;
mod pattern;
mod placing;
mod push;
pub mod sampler;
mod scene;
mod stream;
mod texture;

pub use constants::*;
pub use features::*;
pub use film::*;
pub use flags::*;
pub use frame::*;
pub use layout::*;
pub use leaves::*;
pub use light::*;
pub use light_shapes::*;
pub use lobes::*;
pub use material::*;
pub use node::*;
pub use numbers::*;
pub use path::*;
pub use path_events::*;
pub use pattern::*;
pub use placing::*;
pub use push::*;
pub use scene::*;
pub use stream::*;
pub use texture::*;
