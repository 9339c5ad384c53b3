// SPDX-License-Identifier: Apache-2.0
//! The partition into chunks: what it holds, what edits leave as it is.

mod bulk_moves;
pub(crate) mod cut;
pub(crate) mod edits;
mod known_cases;
