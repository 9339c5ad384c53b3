// SPDX-License-Identifier: Apache-2.0
//! Decides whether a scene that fits the device is uploaded before it is rendered, or streamed while it is uploaded.
//! Pure, one thread.
//!
//! Streaming traces while chunks are loaded, and loads only what rays ask for, so the first image of a large scene
//! appears earlier. But a streamed picture takes longer to trace than one in core. So small pictures are streamed until
//! together they have cost as much as the upload would have (the ski rental problem).

/// Scenes of which fewer bytes are missing are uploaded first: compiling the streaming passes would take the time that
/// streaming saves.
const MIN_STREAMED_BYTES: u64 = 4 << 30;
/// The number of missing bytes for which one path may be streamed: more than it costs (decisions/0050).
const BYTES_A_PATH: u64 = 100;

/// Counts the paths that were streamed since a scene was last uploaded.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct UploadDecision {
    paths: u64,
}

impl UploadDecision {
    /// Returns true if the next picture, which has `paths` paths, is to be streamed. `missing`: bytes that are not on
    /// the device yet.
    pub(crate) fn streams(&mut self, missing: u64, paths: u64) -> bool {
        let paths = self.paths.saturating_add(paths);
        let streams = missing >= MIN_STREAMED_BYTES && paths <= missing / BYTES_A_PATH;
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
        let streams = |missing, paths| UploadDecision::default().streams(missing, paths);
        assert!(streams(12 * GIB, 64 * megapixel), "64 samples of 12 GiB");
        assert!(!streams(12 * GIB, 1024 * megapixel), "1024 samples trace longer than the upload takes");
        assert!(!streams(GIB, megapixel), "a GiB is there at once");
        assert!(!streams(0, 0), "nothing is missing");
    }

    #[test]
    fn many_small_pictures_pay_for_the_upload_once() {
        let mut upload = UploadDecision::default();
        let paths = 20_000_000;
        let streamed = (0..100).take_while(|_| upload.streams(12 * GIB, paths)).count() as u64;
        assert_eq!(streamed, 12 * GIB / BYTES_A_PATH / paths, "as long as they cost less than the upload");
        assert!(upload.streams(12 * GIB, paths), "after the upload another scene begins anew");
    }
}
