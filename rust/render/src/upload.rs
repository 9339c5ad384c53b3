// SPDX-License-Identifier: Apache-2.0
//! Whether a scene that fits is uploaded before its picture, or rendered while it comes. Pure, one thread.
//!
//! Streaming traces while units come and loads what rays ask for alone, so the first picture of a large scene is there
//! earlier; but its rounds take longer than those of a scene that is all there. So it is right for pictures that take
//! less than the upload, and for these only until together they have cost what the upload would have.

/// Bytes that are missing, at least: below, compiling the passes of streaming takes what is won.
const LEAST: u64 = 4 << 30;
/// A path costs about as much more when streaming as the upload of so many bytes takes longer than streaming them
/// (decision 0047).
const BYTES_A_PATH: u64 = 100;

/// What was streamed of a scene that fits.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Upload {
    paths: u64,
}

impl Upload {
    /// Whether to stream a picture of so many paths, while so many bytes of a scene that fits are missing.
    pub(crate) fn streams(&mut self, missing: u64, paths: u64) -> bool {
        let paths = self.paths.saturating_add(paths);
        let streams = missing >= LEAST && paths <= missing / BYTES_A_PATH;
        self.paths = if streams { paths } else { 0 };
        streams
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GIB: u64 = 1 << 30;

    #[test]
    fn small_pictures_of_large_scenes_are_streamed() {
        let megapixel = 1 << 20;
        let streams = |missing, paths| Upload::default().streams(missing, paths);
        assert!(streams(12 * GIB, 64 * megapixel), "64 samples of 12 GiB");
        assert!(!streams(12 * GIB, 1024 * megapixel), "1024 samples trace longer than the upload takes");
        assert!(!streams(GIB, megapixel), "a GiB is there at once");
        assert!(!streams(0, 0), "nothing is missing");
    }

    #[test]
    fn many_small_pictures_pay_for_the_upload_once() {
        let mut upload = Upload::default();
        let paths = 20_000_000;
        let streamed = (0..100).take_while(|_| upload.streams(12 * GIB, paths)).count() as u64;
        assert_eq!(streamed, 12 * GIB / BYTES_A_PATH / paths, "as long as they cost less than the upload");
        assert!(upload.streams(12 * GIB, paths), "after the upload another scene begins anew");
    }
}
