// SPDX-License-Identifier: Apache-2.0
//! The images the host can read: the latest complete set, replaced as a whole by the render thread.

use crate::aov::AovKind;

/// The latest images of a session.
#[derive(Debug, Default)]
pub(crate) struct PublishedImages {
    images: Vec<PublishedImage>,
    /// The version of the latest image; versions are counted from 1.
    version: u64,
}

#[derive(Debug)]
struct PublishedImage {
    kind: AovKind,
    version: u64,
    bytes: Vec<u8>,
}

impl PublishedImages {
    /// Replaces the image of `kind` in the memory that it had: fresh pages would take longer than the copy.
    pub(crate) fn put(&mut self, kind: AovKind, pixels: &[u8]) {
        self.version += 1;
        match self.images.iter_mut().find(|have| have.kind == kind) {
            Some(slot) => {
                slot.version = self.version;
                slot.bytes.clear();
                slot.bytes.extend_from_slice(pixels);
            }
            None => self.images.push(PublishedImage { kind, version: self.version, bytes: pixels.to_vec() }),
        }
    }

    /// Forgets every image but those of `kinds` that have exactly the given number of pixels.
    pub(crate) fn retain(&mut self, kinds: &[AovKind], pixels: u64) {
        self.images.retain(|have| {
            kinds.contains(&have.kind) && have.bytes.len() as u64 == pixels * have.kind.pixel_bytes() as u64
        });
    }

    /// Copies the image of `kind` to `out` if it has exactly `out.len()` bytes and is not the `known` version; returns
    /// its version, or 0 if there is no such image.
    pub(crate) fn copy(&self, kind: AovKind, known: u64, out: &mut [u8]) -> u64 {
        let Some(image) = self.images.iter().find(|have| have.kind == kind && have.bytes.len() == out.len()) else {
            return 0;
        };
        if image.version != known {
            out.copy_from_slice(&image.bytes);
        }
        image.version
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_images_of_the_right_size_are_copied() {
        let mut published = PublishedImages::default();
        published.put(AovKind::Depth, &[1; 8]);
        let mut out = [0_u8; 8];
        assert_ne!(published.copy(AovKind::Depth, 0, &mut out), 0, "the image is there");
        assert_eq!(out, [1; 8], "the pixels must arrive");
        assert_eq!(published.copy(AovKind::Depth, 0, &mut [0; 4]), 0, "another size must be refused");
        published.retain(&[AovKind::Depth], 3);
        assert_eq!(published.copy(AovKind::Depth, 0, &mut out), 0, "an image of another resolution must be forgotten");
    }

    #[test]
    fn an_image_that_is_known_is_not_copied_again_and_a_new_one_is() {
        let mut published = PublishedImages::default();
        published.put(AovKind::Depth, &[1; 8]);
        published.put(AovKind::PrimId, &[2; 8]);
        let mut out = [0_u8; 8];
        let known = published.copy(AovKind::Depth, 0, &mut out);
        out = [9; 8];
        assert_eq!(published.copy(AovKind::Depth, known, &mut out), known, "it is still there");
        assert_eq!(out, [9; 8], "and was not copied");
        published.put(AovKind::Depth, &[3; 8]);
        assert_ne!(published.copy(AovKind::Depth, known, &mut out), known, "another one");
        assert_eq!(out, [3; 8], "is copied");
    }
}
