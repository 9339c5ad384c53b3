// SPDX-License-Identifier: Apache-2.0
//! The images the host can read, put there by the render thread: always whole pictures, of one generation.
//!
//! A picture that is not whole yet is shown over one of its own generation that is: the first picture of a change, at a
//! part of the resolution. Until there is one, the host keeps the picture of the generation before. Where only a window
//! of a picture is rendered, the rest of it has clear values.

use crate::job::aov::AovKind;
use crate::job::window::PictureLayout;
use rayon::prelude::*;

/// Rows of the strips in which pixels are traced, one strip after the other (`pixel_position` of the shaders).
pub(crate) const STRIP_ROWS: u64 = 8;
/// Bytes that a thread copies at a time.
const COPIED_AT_ONCE: usize = 1 << 20;

/// How much of a picture is there: so many of its pixels, in the order in which they are traced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PictureExtent {
    /// Of images traced through pixel centres.
    pub(crate) planes: u64,
    /// Of images made of samples.
    pub(crate) samples: u64,
}

impl PictureExtent {
    /// All of it.
    pub(crate) const WHOLE: Self = Self { planes: u64::MAX, samples: u64::MAX };

    /// Whether all of `pixels` are there.
    pub(crate) fn covers(self, pixels: u64) -> bool {
        self.planes.min(self.samples) >= pixels
    }

    /// The strips of it that are whole, in a picture of this width: these are rows from the first on.
    pub(crate) fn whole_strips(self, width: u32) -> Self {
        let strip = STRIP_ROWS * u64::from(width.max(1));
        let whole = |pixels: u64| if pixels == u64::MAX { pixels } else { pixels - pixels % strip };
        Self { planes: whole(self.planes), samples: whole(self.samples) }
    }
}

/// The latest images of a session.
#[derive(Debug, Default)]
pub(crate) struct PublishedImages {
    images: Vec<PublishedImage>,
    layout: PictureLayout,
    /// Of the job that they are of.
    generation: u64,
    /// Of the image that came last; they are counted from 1.
    version: u64,
    /// Hosts see the denoised picture in place of the colour.
    shows_denoised: bool,
}

#[derive(Debug)]
struct PublishedImage {
    kind: AovKind,
    version: u64,
    /// What is not rendered has its clear value.
    is_cleared: bool,
    bytes: Vec<u8>,
}

impl PublishedImages {
    /// Begins to replace the images by those of `generation`, of which `extent` is there: `kinds`, each with this
    /// layout. False, and nothing changes, if that would show no whole picture, or an older one.
    pub(crate) fn begin(
        &mut self,
        generation: u64,
        kinds: &[AovKind],
        layout: &PictureLayout,
        extent: PictureExtent,
    ) -> bool {
        let is_whole = extent.covers(layout.window.pixels());
        let is_newer = generation > self.generation && is_whole;
        if generation != self.generation && !is_newer {
            return false;
        }
        self.retain(kinds, layout.pixels());
        let has_all = kinds.iter().all(|kind| self.images.iter().any(|have| have.kind == *kind));
        if !has_all && !is_whole {
            return false;
        }
        if self.layout != *layout {
            if !self.layout.is_clear_as(layout) {
                self.images.iter_mut().for_each(|image| image.is_cleared = false);
            }
            self.layout = layout.clone();
        }
        self.generation = generation;
        true
    }

    /// Whether hosts and files get the denoised picture in place of the colour.
    pub(crate) fn show_denoised(&mut self, shows: bool) {
        self.shows_denoised = shows;
    }

    /// The image that stands for `kind`.
    fn shown(&self, kind: AovKind) -> AovKind {
        if kind == AovKind::Color && self.shows_denoised { AovKind::Denoised } else { kind }
    }

    /// The image that whoever asks for `kind` sees.
    pub(crate) fn shown_image(&self, kind: AovKind) -> Option<&[u8]> {
        self.image(self.shown(kind))
    }

    /// Takes the images of `generation` from where its windows were put together; it has this layout.
    pub(crate) fn take_over(&mut self, from: &mut Self, generation: u64, layout: &PictureLayout) {
        if generation < self.generation || from.images.is_empty() {
            return;
        }
        self.images = std::mem::take(&mut from.images);
        for image in &mut self.images {
            self.version += 1;
            image.version = self.version;
        }
        (self.generation, self.layout) = (generation, layout.clone());
    }

    /// The job whose picture is there.
    pub(crate) fn generation(&self) -> u64 {
        self.generation
    }

    /// Whether a whole picture of `generation` is there.
    pub(crate) fn shows(&self, generation: u64) -> bool {
        self.generation == generation && !self.images.is_empty()
    }

    /// Replaces the first so many pixels of the film in the image of `kind`, in the memory that it had: fresh pages
    /// would take longer than the copy.
    pub(crate) fn put(&mut self, kind: AovKind, pixels: &[u8], there: u64) {
        let bytes = usize::try_from(there).unwrap_or(usize::MAX).saturating_mul(kind.pixel_bytes());
        let pixels = &pixels[..bytes.min(pixels.len())];
        self.change(kind, |image, layout| {
            if layout.is_whole() {
                return copy_by_all(&mut image[..pixels.len()], pixels);
            }
            let mut rest = pixels.get(layout.hidden() * kind.pixel_bytes()..).unwrap_or_default();
            for row in layout.rows(kind) {
                let (from, after) = rest.split_at(row.len().min(rest.len()));
                image[row][..from.len()].copy_from_slice(from);
                rest = after;
            }
        });
    }

    /// Changes the window in the image of `kind`.
    pub(crate) fn change(&mut self, kind: AovKind, change: impl FnOnce(&mut [u8], &PictureLayout)) {
        self.version += 1;
        let at = self.images.iter().position(|have| have.kind == kind).unwrap_or_else(|| {
            self.images.push(PublishedImage { kind, version: 0, is_cleared: false, bytes: Vec::new() });
            self.images.len() - 1
        });
        if let Some(image) = self.images.get_mut(at) {
            image.version = self.version;
            // Fits: the image was allocated on the device, in its parts at least.
            let pixels = usize::try_from(self.layout.pixels()).unwrap_or(usize::MAX);
            image.bytes.resize(pixels.saturating_mul(kind.pixel_bytes()), 0);
            if !image.is_cleared && !self.layout.is_whole() {
                self.layout.clear(kind, &mut image.bytes);
            }
            image.is_cleared = true;
            change(&mut image.bytes, &self.layout);
        }
    }

    /// The window of the image of `kind`, which is one of floats.
    pub(crate) fn window_of(&self, kind: AovKind) -> Option<Vec<f32>> {
        let image = self.image(kind)?;
        let rows = self.layout.rows(kind).map(|row| image.get(row).map(bytemuck::pod_collect_to_vec::<u8, f32>));
        Some(rows.collect::<Option<Vec<_>>>()?.concat())
    }

    /// The image of `kind`.
    pub(crate) fn image(&self, kind: AovKind) -> Option<&[u8]> {
        self.images.iter().find(|have| have.kind == kind).map(|have| &*have.bytes)
    }

    /// Forgets every image but those of `kinds` that have exactly the given number of pixels.
    fn retain(&mut self, kinds: &[AovKind], pixels: u64) {
        self.images.retain(|have| {
            kinds.contains(&have.kind) && have.bytes.len() as u64 == pixels * have.kind.pixel_bytes() as u64
        });
    }

    /// Copies the image of `kind` to `out` if it has exactly `out.len()` bytes and is not the `known` version; returns
    /// its version, or 0 if there is no such image.
    pub(crate) fn copy(&self, kind: AovKind, known: u64, out: &mut [u8]) -> u64 {
        let kind = self.shown(kind);
        let Some(image) = self.images.iter().find(|have| have.kind == kind && have.bytes.len() == out.len()) else {
            return 0;
        };
        if image.version != known {
            out.copy_from_slice(&image.bytes);
        }
        image.version
    }
}

/// Copies on all threads: a host that reads images waits for the lock meanwhile.
fn copy_by_all(to: &mut [u8], from: &[u8]) {
    to.par_chunks_mut(COPIED_AT_ONCE).zip(from.par_chunks(COPIED_AT_ONCE)).for_each(|(to, from)| {
        to.copy_from_slice(from);
    });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::aov::AovRequest;
    use crate::job::window::PixelWindow;

    fn layout(size: [u32; 2], window: Option<PixelWindow>) -> PictureLayout {
        let aovs = [AovKind::Depth, AovKind::SampleCount].map(|kind| AovRequest { kind, clear: [8.0; 4] });
        PictureLayout::new(size, window.unwrap_or(PixelWindow::whole(size)), &aovs)
    }

    /// Pixels of an image in a picture of this extent.
    fn there(kind: AovKind, extent: PictureExtent) -> u64 {
        if kind == AovKind::SampleCount { extent.samples } else { extent.planes }
    }

    /// Images of so many pixels, each byte `value`.
    fn put(published: &mut PublishedImages, generation: u64, pixels: usize, value: u8, extent: PictureExtent) -> bool {
        let kinds = [AovKind::Depth, AovKind::SampleCount];
        let layout = layout([u32::try_from(pixels).unwrap(), 1], None);
        let shown = published.begin(generation, &kinds, &layout, extent);
        if shown {
            kinds.iter().for_each(|kind| published.put(*kind, &vec![value; 4 * pixels], there(*kind, extent)));
        }
        shown
    }

    #[test]
    fn only_images_of_the_right_size_are_copied() {
        let mut published = PublishedImages::default();
        assert!(put(&mut published, 1, 2, 1, PictureExtent::WHOLE), "the first one");
        let mut out = [0_u8; 8];
        assert_ne!(published.copy(AovKind::Depth, 0, &mut out), 0, "the image is there");
        assert_eq!(out, [1; 8], "the pixels must arrive");
        assert_eq!(published.copy(AovKind::Depth, 0, &mut [0; 4]), 0, "another size must be refused");
        assert!(put(&mut published, 2, 3, 1, PictureExtent::WHOLE), "another resolution");
        assert_eq!(published.copy(AovKind::Depth, 0, &mut out), 0, "an image of another resolution must be forgotten");
    }

    #[test]
    fn an_image_that_is_known_is_not_copied_again_and_a_new_one_is() {
        let mut published = PublishedImages::default();
        put(&mut published, 1, 2, 1, PictureExtent::WHOLE);
        let mut out = [0_u8; 8];
        let known = published.copy(AovKind::Depth, 0, &mut out);
        out = [9; 8];
        assert_eq!(published.copy(AovKind::Depth, known, &mut out), known, "it is still there");
        assert_eq!(out, [9; 8], "and was not copied");
        put(&mut published, 1, 2, 3, PictureExtent::WHOLE);
        assert_ne!(published.copy(AovKind::Depth, known, &mut out), known, "another one");
        assert_eq!(out, [3; 8], "is copied");
    }

    #[test]
    fn a_window_is_put_into_the_picture_and_leaves_no_trace_where_it_was() {
        let mut published = PublishedImages::default();
        let kinds = [AovKind::Depth];
        let (size, extent) = ([4, 3], PictureExtent::WHOLE);
        let mut show = |generation: u64, window: PixelWindow, values: &[f32], extent: PictureExtent| {
            assert!(published.begin(generation, &kinds, &layout(size, Some(window)), extent));
            published.put(AovKind::Depth, bytemuck::cast_slice(values), extent.planes);
            bytemuck::pod_collect_to_vec::<u8, f32>(published.image(AovKind::Depth).expect("put"))
        };
        let first = PixelWindow { x: 1, y: 1, width: 2, height: 2 };
        let c = 8.0;
        assert_eq!(show(1, first, &[1.0, 2.0, 3.0, 4.0], extent), [c, c, c, c, c, 1.0, 2.0, c, c, 3.0, 4.0, c]);
        let part = PictureExtent { planes: 2, samples: 2 };
        assert_eq!(show(1, first, &[5.0, 6.0, 7.0, 8.0], part)[5..11], [5.0, 6.0, c, c, 3.0, 4.0], "a part of it");
        let moved = PixelWindow { x: 3, y: 0, width: 1, height: 1 };
        assert_eq!(show(2, moved, &[9.0], extent), [c, c, c, 9.0, c, c, c, c, c, c, c, c], "moved");
        assert_eq!(show(3, PixelWindow::default(), &[], extent), [c; 12], "nothing is rendered");
    }

    #[test]
    fn parts_of_a_picture_are_whole_strips() {
        let extent = PictureExtent { planes: 8 * 10 * 3 + 79, samples: 79 };
        assert_eq!(extent.whole_strips(10), PictureExtent { planes: 240, samples: 0 });
        assert_eq!(PictureExtent::WHOLE.whole_strips(10), PictureExtent::WHOLE, "all of it");
    }

    #[test]
    fn a_picture_that_is_not_whole_is_shown_over_a_whole_one_of_its_generation_alone() {
        let mut published = PublishedImages::default();
        let part = PictureExtent { planes: 2, samples: 1 };
        let images = |published: &PublishedImages| {
            [AovKind::Depth, AovKind::SampleCount].map(|kind| published.image(kind).map(<[u8]>::to_vec))
        };
        assert!(!put(&mut published, 1, 2, 1, part), "nothing to show it over");
        assert_eq!(images(&published), [None, None], "so nothing is there");
        assert!(put(&mut published, 1, 2, 1, PictureExtent::WHOLE), "a whole one");
        assert!(!put(&mut published, 2, 2, 2, part), "a part of the next one");
        assert_eq!(images(&published), [Some(vec![1; 8]), Some(vec![1; 8])], "leaves the one before");
        assert!(put(&mut published, 2, 2, 2, PictureExtent::WHOLE), "a whole one of the next");
        assert!(put(&mut published, 2, 2, 3, part), "a part over it");
        assert_eq!(images(&published), [Some(vec![3; 8]), Some([[3; 4], [2; 4]].concat())], "as far as it is there");
        assert!(!put(&mut published, 1, 2, 4, PictureExtent::WHOLE), "an older one");
        assert!(published.shows(2) && !published.shows(1), "is not shown");
    }

    #[test]
    fn an_image_that_was_not_asked_for_is_forgotten_and_a_new_one_waits_until_it_is_whole() {
        let mut published = PublishedImages::default();
        put(&mut published, 1, 2, 1, PictureExtent::WHOLE);
        let layout = layout([2, 1], None);
        assert!(published.begin(2, &[AovKind::Depth], &layout, PictureExtent::WHOLE), "one image is asked for");
        assert_eq!(published.image(AovKind::SampleCount), None, "the other is forgotten");
        let part = PictureExtent { planes: 2, samples: 1 };
        let both = [AovKind::Depth, AovKind::SampleCount];
        assert!(!published.begin(2, &both, &layout, part), "a part has nothing to be shown over");
        assert!(published.begin(2, &both, &layout, PictureExtent::WHOLE), "all of it needs nothing");
    }
}
