// SPDX-License-Identifier: Apache-2.0
//! Lights: radiance, areas, shaping, profiles, motion.

mod ies;
mod local;
mod motion;
mod radiance;
