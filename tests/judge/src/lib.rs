// SPDX-License-Identifier: Apache-2.0
//! The judge: a plain f64 CPU renderer and the tests that compare OocPT's pictures with its own.
//!
//! It reads the same [`oocpt_core`] snapshot as the product, but shares no traversal, sampling or camera code with it:
//! every placement is multiplied out to world triangles, searched by a median-split BVH in f64, and camera rays come
//! from the inverse of the projection matrix. It is slow and holds everything in memory, on purpose. Test code only;
//! any thread.
//!
//! ```text
//! Snapshot -> World::flatten -> first_hits (depth, ids, normals; exact)      -> compare_exact
//!                            -> path_trace (mean and variance of every pixel) -> z_test
//! ```
#![forbid(unsafe_code)]

mod bvh;
mod camera;
mod compare;
mod first_hit;
mod image;
mod path_tracer;
mod random;
mod world;
mod z_test;

pub use camera::{PixelRays, Ray};
pub use compare::{Mismatch, compare_depth, compare_ids, compare_normals};
pub use first_hit::{FirstHit, first_hits};
pub use image::Image;
pub use path_tracer::{PathTracerOptions, Reference, path_trace};
pub use world::{Surface, World, WorldHit};
pub use z_test::{ZReport, z_test};

/// Why the judge could not judge. Every variant is a fault of the test's scene or of the product, never a verdict.
#[derive(Debug, thiserror::Error)]
pub enum JudgeError {
    /// The scene multiplies out to more triangles than the judge is willing to hold.
    #[error("the flattened scene has more than {0} triangles; give the judge a smaller one")]
    TooLarge(usize),
    /// An instance record points outside the snapshot's tables.
    #[error("instance record {record} of assembly {assembly} points at a {kind} that does not exist")]
    DanglingTarget {
        /// Index of the assembly in the snapshot.
        assembly: usize,
        /// Index of the record in the assembly.
        record: usize,
        /// `"mesh"` or `"assembly"`.
        kind: &'static str,
    },
    /// A matrix that must be invertible is not.
    #[error("{0} has no inverse")]
    Singular(&'static str),
    /// Two images that should have the same shape do not.
    #[error("image shapes differ: {0}x{1}x{2} against {3}x{4}x{5} (width x height x channels)")]
    Shape(usize, usize, usize, usize, usize, usize),
    /// A diagnostic image could not be written.
    #[error("cannot write {path}: {reason}")]
    Write {
        /// The file.
        path: String,
        /// What the EXR writer said.
        reason: String,
    },
}
