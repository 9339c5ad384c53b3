// SPDX-License-Identifier: Apache-2.0
//! Submissions: what they keep alive, how they are recorded and timed, and the open device, which takes back what they
//! are done with.

pub(crate) mod kept;
pub(crate) mod open_device;
pub(crate) mod queue;
pub(crate) mod recorder;
pub(crate) mod timer;
