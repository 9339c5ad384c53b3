// SPDX-License-Identifier: Apache-2.0
//! The context of a frame: camera and frame block, the features that passes are compiled for, paths in flight and the
//! sizes of waves, progress. Path sources and passes use it; it uses none of them.

pub(crate) mod automaton_block;
pub(crate) mod block;
pub(crate) mod camera_blocks;
pub(crate) mod checkpoint;
pub(crate) mod context;
pub(crate) mod film_header;
pub(crate) mod film_part;
pub(crate) mod film_regions;
pub(crate) mod film_transfer;
pub(crate) mod in_core;
pub(crate) mod in_flight;
pub(crate) mod inventory;
pub(crate) mod kept_samples;
pub(crate) mod progress;
pub(crate) mod schedule;
pub(crate) mod specialise;
pub(crate) mod view;
