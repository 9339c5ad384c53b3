// SPDX-License-Identifier: Apache-2.0
//! The scene database: edits, bindings, links, lights, dicing, and invalid prims.

pub(crate) mod bindings;
mod dicing;
mod edits;
mod identity;
mod invalid_prims;
mod light;
mod linking;
mod mesh_lights;
mod mesh_placements;
mod patches;
mod primvar_uses;
mod refits;
