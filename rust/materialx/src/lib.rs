// SPDX-License-Identifier: Apache-2.0
//! `MaterialX` networks: definitions of nodes, translation of surfaces to `OpenPBR`, patterns as programs.
//!
//! [`translate`] takes a [`network::Network`] and the [`library::NodeLibrary`] of definitions. It walks from the
//! surface's inputs upwards (`walk`), through the graphs that implement nodes, and makes expressions of what it finds
//! (`nodes`, `expression`). The surface model becomes a slab of `OpenPBR` (`surface`), the slab the inputs of the
//! renderer's BSDF. An input is a constant, a texture, a primvar, or else a register of the material's program
//! (`assemble`). [`translate_displacement`] does the same for what the displacement terminal says.
//!
//! Guarantees: no unsafe code; no network or library file makes this crate panic or loop without end; work and memory
//! are bounded by the limits that each module names. Any thread.

#![forbid(unsafe_code)]

mod assemble;
mod channels;
mod displacement;
pub mod eval;
mod expression;
pub mod library;
pub mod listing;
pub mod network;
mod nodes;
mod noise;
pub mod program;
mod slab;
mod step;
pub mod surface;
mod told;
pub mod uses;
pub mod value;
mod walk;

pub use assemble::{InputSource, MaterialEmission, TranslatedNetwork, translate};
pub use channels::channels;
pub use displacement::{DisplacementOffset, DisplacementProgram, translate_displacement};
