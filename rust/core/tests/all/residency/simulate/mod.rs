// SPDX-License-Identifier: Apache-2.0
//! A simulated device to compare policies on: rays that need units in order, a link that brings them, time that is
//! counted and never measured.
//!
//! Pure and deterministic. The model, after the renderer's: paths live in slots, slots in segments that are refilled in
//! order once all their paths are done; a round traces every ray that can go on; a ray visits whatever it needs that is
//! resident and waits when something before its hit is absent; loads cross one link one after the other while rounds
//! go on; the planner steps once a round, or when a load arrives and nothing can be traced.

mod device;
mod random;
mod rays;
mod scene;

pub(crate) use device::{Device, run};
pub(crate) use scene::{SceneOptions, Workload};
