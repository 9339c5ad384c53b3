// SPDX-License-Identifier: Apache-2.0
//! Tests of the reader and the writer: files of the reference writer, files of ours, and files that lie.

mod extremes;
mod hostile;
mod raw;
mod reference;
mod round_trip;
mod support;
mod tiles;
