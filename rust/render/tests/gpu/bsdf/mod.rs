// SPDX-License-Identifier: Apache-2.0
//! The BSDF by itself (`shaders/check/bsdf.comp`): against its definition in f64, energy, reciprocity, sampling, and
//! strange input.
#![expect(clippy::print_stdout, reason = "what was measured is worth reading")]

pub(crate) mod cases;
mod device;
mod energy;
mod eon;
mod glass;
pub(crate) mod hair;
mod reference;
mod sampling;
mod sheen;
mod slab;
mod values;
