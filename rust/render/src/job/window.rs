// SPDX-License-Identifier: Apache-2.0
//! The part of a picture that is rendered, and where its pixels go in images of the whole picture. Pure.

use crate::job::aov::{AovKind, AovRequest};

/// A rectangle of pixels, from the lower left corner of a picture, whose rows go up as those of its images.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PixelWindow {
    /// First column.
    pub x: u32,
    /// First row, from the bottom.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl PixelWindow {
    /// All of a picture.
    pub fn whole([width, height]: [u32; 2]) -> Self {
        Self { x: 0, y: 0, width, height }
    }

    /// The window from x0, y0 to x1, y1, with y down and ends exclusive as Hydra's windows, as far as it is in a
    /// picture of this size; without pixels if none of it is.
    pub fn of_corners([x0, y0, x1, y1]: [i32; 4], [width, height]: [u32; 2]) -> Self {
        let within = |at: i32, size: u32| u32::try_from(at).unwrap_or(0).min(size);
        let ([left, right], [top, bottom]) = ([x0, x1].map(|x| within(x, width)), [y0, y1].map(|y| within(y, height)));
        let inside =
            Self { x: left, y: height - bottom, width: right.saturating_sub(left), height: bottom.saturating_sub(top) };
        if inside.is_empty() { Self::default() } else { inside }
    }

    /// The part of it that is in a picture of this size.
    #[must_use]
    pub fn within(self, [width, height]: [u32; 2]) -> Self {
        let inside = Self {
            width: self.width.min(width.saturating_sub(self.x)),
            height: self.height.min(height.saturating_sub(self.y)),
            ..self
        };
        if inside.is_empty() { Self::default() } else { inside }
    }

    /// x0, y0, x1, y1 with y down and ends exclusive, in a picture so many rows high.
    pub(crate) fn corners(self, rows: u32) -> [u32; 4] {
        [self.x, rows - self.y - self.height, self.x + self.width, rows - self.y]
    }

    /// Whether it has no pixels.
    pub fn is_empty(self) -> bool {
        self.width == 0 || self.height == 0
    }

    /// Its number of pixels.
    pub fn pixels(self) -> u64 {
        u64::from(self.width) * u64::from(self.height)
    }

    /// Columns and rows.
    pub fn size(self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// The rows of the window in an image of a picture so many columns wide, each pixel `bytes` long: where they are.
    pub(crate) fn rows(self, columns: u32, bytes: usize) -> impl DoubleEndedIterator<Item = std::ops::Range<usize>> {
        let at = move |row: u32| (row as usize * columns as usize + self.x as usize) * bytes;
        let length = self.width as usize * bytes;
        (self.y..self.y + self.height).map(move |row| at(row)..at(row) + length)
    }
}

/// Where the pixels of a render go in the images that the host reads: these are of the whole picture, and have clear
/// values outside of what is rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PictureLayout {
    /// Columns and rows of the picture.
    pub(crate) size: [u32; 2],
    /// What is rendered.
    pub(crate) window: PixelWindow,
    aovs: Vec<AovRequest>,
}

impl PictureLayout {
    pub(crate) fn new(size: [u32; 2], window: PixelWindow, aovs: &[AovRequest]) -> Self {
        Self { size, window, aovs: aovs.to_vec() }
    }

    /// Pixels of the whole picture.
    pub(crate) fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// Whether all of the picture is rendered.
    pub(crate) fn is_whole(&self) -> bool {
        self.window == PixelWindow::whole(self.size)
    }

    /// Fills an image of `kind` with its clear value.
    pub(crate) fn clear(&self, kind: AovKind, image: &mut [u8]) {
        let clear = self.aovs.iter().find(|aov| aov.kind == kind).map_or([0.0; 4], |aov| aov.clear);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "clear values of ids are given as floats; the cast saturates"
        )]
        let value = match kind {
            AovKind::PrimId | AovKind::InstanceId | AovKind::ElementId => {
                [clear[0].round() as i32; 4].map(i32::to_ne_bytes)
            }
            _ => clear.map(f32::to_ne_bytes),
        };
        let value = &value.as_flattened()[..kind.pixel_bytes()];
        image.chunks_exact_mut(value.len()).for_each(|pixel| pixel.copy_from_slice(value));
    }

    /// The rows of the window in an image of `kind`.
    pub(crate) fn rows(&self, kind: AovKind) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.window.rows(self.size[0], kind.pixel_bytes())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_count_from_the_top_and_are_cut_at_the_picture() {
        let size = [10, 6];
        let of = |corners| PixelWindow::of_corners(corners, size);
        assert_eq!(of([0, 0, 10, 6]), PixelWindow::whole(size), "all of it");
        assert_eq!(of([2, 1, 5, 3]), PixelWindow { x: 2, y: 3, width: 3, height: 2 }, "rows go up");
        assert_eq!(of([2, 1, 5, 3]).corners(6), [2, 1, 5, 3], "and down again");
        assert_eq!(of([-4, -4, 99, i32::MAX]), PixelWindow::whole(size), "overscan that no pixel is for");
        for outside in [[3, 3, 3, 5], [5, 2, 4, 3], [10, 0, 20, 6], [-9, 0, 0, 6], [0, 6, 10, 9]] {
            assert_eq!(of(outside), PixelWindow::default(), "{outside:?} has no pixels");
        }
    }

    #[test]
    fn windows_are_cut_at_the_picture() {
        let window = PixelWindow { x: 3, y: 4, width: 20, height: 1 };
        assert_eq!(window.within([8, 8]), PixelWindow { width: 5, ..window });
        assert!(window.within([8, 4]).is_empty() && window.within([3, 8]).is_empty(), "nothing is left");
    }

    #[test]
    fn ids_are_cleared_with_whole_numbers() {
        let aovs = [(AovKind::PrimId, -1.0), (AovKind::Depth, 1.0)].map(|(kind, x)| AovRequest { kind, clear: [x; 4] });
        let layout = PictureLayout::new([1, 1], PixelWindow::default(), &aovs);
        let cleared = |kind: AovKind| {
            let mut image = vec![7; kind.pixel_bytes()];
            layout.clear(kind, &mut image);
            image
        };
        assert_eq!(cleared(AovKind::PrimId), (-1_i32).to_ne_bytes());
        assert_eq!(cleared(AovKind::Depth), 1.0_f32.to_ne_bytes());
        assert_eq!(cleared(AovKind::Normal), [0; 12], "not asked for");
    }
}
