// SPDX-License-Identifier: Apache-2.0
//! Reports: files with error, chunks and materials of a render, and what a terminal says of it. They read the state of
//! a frame and change none of it.

pub mod chunk_report;
pub(crate) mod closing_words;
pub(crate) mod error_log;
pub mod error_report;
pub mod material_report;
pub(crate) mod progress_bar;
pub(crate) mod window_rows;
