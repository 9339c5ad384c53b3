// SPDX-License-Identifier: Apache-2.0
//! Films: sums of the samples of every pixel that do not depend on any order, the files that hold them, and what is
//! made of them: merged films, pictures, and their error.
//!
//! Guarantees: pure host code, no Vulkan. Parts of the same samples merge to the same bits, however they were cut and
//! whatever the number of threads, the error too. Files may come from strangers: lengths are checked before memory is
//! taken, and nothing panics. Any thread.

#![forbid(unsafe_code)]

mod combine;
mod container;
mod error;
mod exact;
mod film;
mod header;
mod identity;
mod measure;
mod picture;
mod ranges;
mod tiles;

pub use combine::merge;
pub use container::{FilmReader, FilmWriter, write_film};
pub use error::FilmError;
pub use exact::ExactSums;
pub use film::ExactFilm;
pub use header::{FilmHeader, FilmKind, FilmView, MAX_PIXELS};
pub use identity::{FilmIdentity, FilmRequest};
pub use measure::{OctaveError, estimates};
pub use oocpt_abi::ExactPixel;
pub use picture::{FilmPicture, picture};
pub use ranges::{MAX_SAMPLES, SampleRange, missing};
