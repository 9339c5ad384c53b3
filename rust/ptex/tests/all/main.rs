// SPDX-License-Identifier: Apache-2.0
//! Tests of the reader and the writer: files of the reference writer, files of this writer, and corrupt files.

#[cfg(test)]
mod hostile;
#[cfg(test)]
mod invalid_fields;
#[cfg(test)]
mod raw;
#[cfg(test)]
mod reference_files;
#[cfg(test)]
mod round_trip;
#[cfg(test)]
mod support;
#[cfg(test)]
mod tiles;
