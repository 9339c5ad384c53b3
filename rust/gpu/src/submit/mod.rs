// SPDX-License-Identifier: Apache-2.0
//! Submissions: recording, timing, the objects that they keep alive, and the open device, which takes back the objects
//! of finished submissions.

pub(crate) mod kept;
pub(crate) mod open_device;
pub(crate) mod queue;
pub(crate) mod recorder;
pub(crate) mod timer;
