// SPDX-License-Identifier: Apache-2.0
//! The images the host can read: the latest complete set, replaced as a whole by the render thread.

use crate::aov::AovKind;

/// The latest images of a session.
#[derive(Debug, Default)]
pub(crate) struct Published {
    images: Vec<(AovKind, Vec<u8>)>,
}

impl Published {
    /// Replaces the image of `kind`.
    pub(crate) fn put(&mut self, kind: AovKind, pixels: Vec<u8>) {
        match self.images.iter_mut().find(|(have, _)| *have == kind) {
            Some(slot) => slot.1 = pixels,
            None => self.images.push((kind, pixels)),
        }
    }

    /// Forgets every image but those of `kinds` that have exactly the given number of pixels.
    pub(crate) fn retain(&mut self, kinds: &[AovKind], pixels: u64) {
        self.images
            .retain(|(kind, bytes)| kinds.contains(kind) && bytes.len() as u64 == pixels * kind.pixel_bytes() as u64);
    }

    /// Copies the image of `kind` if there is one of exactly `out.len()` bytes.
    pub(crate) fn copy(&self, kind: AovKind, out: &mut [u8]) -> bool {
        match self.images.iter().find(|(have, bytes)| *have == kind && bytes.len() == out.len()) {
            Some((_, bytes)) => {
                out.copy_from_slice(bytes);
                true
            }
            None => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_images_of_the_right_size_are_copied() {
        let mut published = Published::default();
        published.put(AovKind::Depth, vec![1; 8]);
        let mut out = [0_u8; 8];
        assert!(published.copy(AovKind::Depth, &mut out), "the image is there");
        assert_eq!(out, [1; 8], "the pixels must arrive");
        assert!(!published.copy(AovKind::Depth, &mut [0; 4]), "another size must be refused");
        published.retain(&[AovKind::Depth], 3);
        assert!(!published.copy(AovKind::Depth, &mut out), "an image of another resolution must be forgotten");
    }
}
