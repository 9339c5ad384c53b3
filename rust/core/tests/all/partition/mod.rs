// SPDX-License-Identifier: Apache-2.0
//! The partition into chunks: its contents, and the chunks that edits leave unchanged.

mod bulk_moves;
pub(crate) mod cut;
pub(crate) mod edits;
mod held;
mod known_cases;
