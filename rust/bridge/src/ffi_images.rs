// SPDX-License-Identifier: Apache-2.0
//! The boundary's images: the facts of the host's files from C++, and Rust's requests for texels. Guarantees and
//! threads are those of `bridge/heldImage.h`.

use oocpt_render::textures::ImageError;
use std::panic::{AssertUnwindSafe, catch_unwind};
use xxhash_rust::xxh3::Xxh3;

pub(crate) use ffi::{HeldFile, HeldImage, HeldTransform, ImageFacts, ImageSource, TexelBox, TexelTag, WrapTag};

/// Takes the rows of an image that C++ decodes.
pub(crate) struct RowSink<'a>(pub(crate) &'a mut dyn FnMut(u32, &[u8]) -> bool);

impl RowSink<'_> {
    /// Passes rows on. Called by C++, so it must not unwind.
    pub(crate) fn take(&mut self, top: u32, rows: &[u8]) -> Result<bool, ImageError> {
        catch_unwind(AssertUnwindSafe(|| (self.0)(top, rows)))
            .map_err(|_panic| ImageError("is decoded for one who panicked".to_owned()))
    }
}

/// Takes the bytes of a file that C++ reads.
pub(crate) struct ByteSink<'a>(pub(crate) &'a mut Xxh3);

impl ByteSink<'_> {
    /// Passes bytes on. Called by C++. Never fails; cxx ends the process on unwinding, and hashing does not unwind.
    #[expect(clippy::unnecessary_wraps, reason = "the rule of the boundary")]
    pub(crate) fn take(&mut self, bytes: &[u8]) -> Result<(), ImageError> {
        self.0.update(bytes);
        Ok(())
    }
}

/// Declarations that cxx turns into both sides of the boundary.
#[allow(
    unsafe_code,
    missing_docs,
    missing_debug_implementations,
    unreachable_pub,
    unused_qualifications,
    clippy::multiple_unsafe_ops_per_block,
    clippy::undocumented_unsafe_blocks,
    clippy::use_self,
    reason = "cxx expands this module into extern blocks and shims"
)]
#[cxx::bridge(namespace = "oocpt")]
mod ffi {
    /// The type of a channel of a texel.
    #[repr(u8)]
    #[derive(Debug)]
    enum TexelTag {
        UInt8,
        Half,
        Float,
    }

    /// The wrap mode that a file states.
    #[repr(u8)]
    #[derive(Debug)]
    enum WrapTag {
        Unknown,
        Black,
        Clamp,
        Repeat,
        Mirror,
    }

    /// The facts of an image. `levels`: width and height of each, finest first; `is_srgb`: 1, 0, or -1 if the file does
    /// not state it.
    #[derive(Debug, Clone)]
    struct ImageFacts {
        levels: Vec<u32>,
        channels: u32,
        format: TexelTag,
        is_tiled: bool,
        is_srgb: i8,
        wrap_s: WrapTag,
        wrap_t: WrapTag,
    }

    /// Texels of a level; (0, 0) is the lowest left one.
    struct TexelBox {
        level: u32,
        x: u32,
        y: u32,
        width: u32,
        height: u32,
    }

    /// The facts of a file without opening it. If it is not plain, only the host's resolver knows the file, and the
    /// rest is empty.
    struct FileFacts {
        is_plain: bool,
        /// The absolute path, without links.
        canonical: String,
        size: u64,
        modified_ns: i64,
    }

    extern "Rust" {
        type RowSink<'a>;

        /// Takes rows from the top of the image down; returns false to stop.
        fn take(self: &mut RowSink<'_>, top: u32, rows: &[u8]) -> Result<bool>;

        type ByteSink<'a>;

        /// Takes the next bytes of a file.
        fn take(self: &mut ByteSink<'_>, bytes: &[u8]) -> Result<()>;
    }

    unsafe extern "C++" {
        include!("bridge/heldImage.h");

        type HeldImage;

        fn facts(self: &HeldImage) -> Result<ImageFacts>;
        fn read(self: &HeldImage, texels: &TexelBox, destination: &mut [u8]) -> Result<()>;
        fn decode(self: &HeldImage, level: u32, sink: &mut RowSink<'_>) -> Result<()>;

        type HeldFile;

        fn size(self: &HeldFile) -> u64;
        #[cxx_name = "read"]
        fn read_bytes(self: &HeldFile, offset: u64, destination: &mut [u8]) -> Result<()>;

        type HeldTransform;

        fn apply(self: &HeldTransform, texels: &mut [f32], channels: u32) -> Result<()>;

        type ImageSource;

        fn open(self: &ImageSource, resolved: &str) -> Result<UniquePtr<HeldImage>>;
        fn exists(self: &ImageSource, resolved: &str) -> Result<bool>;
        fn file_facts(self: &ImageSource, resolved: &str) -> Result<FileFacts>;
        fn open_file(self: &ImageSource, resolved: &str) -> Result<UniquePtr<HeldFile>>;
        fn stream_file(self: &ImageSource, resolved: &str, sink: &mut ByteSink<'_>) -> Result<u64>;
        fn color_transform(self: &ImageSource, name: &str) -> Result<UniquePtr<HeldTransform>>;
        fn read_file(self: &ImageSource, resolved: &str, limit: u64) -> Result<Vec<u8>>;
    }

    impl UniquePtr<ImageSource> {}
}
