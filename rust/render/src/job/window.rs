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

    /// The pixels that are in both; without pixels if there are none.
    #[must_use]
    pub(crate) fn overlap(self, other: Self) -> Self {
        let span = |[a, a_size]: [u32; 2], [b, b_size]: [u32; 2]| {
            let first = a.max(b);
            (first, (a + a_size).min(b + b_size).saturating_sub(first))
        };
        let (x, width) = span([self.x, self.width], [other.x, other.width]);
        let (y, height) = span([self.y, self.height], [other.y, other.height]);
        let both = Self { x, y, width, height };
        if both.is_empty() { Self::default() } else { both }
    }

    /// The pixels of it that are not in `other`, as windows: at most four.
    pub(crate) fn without(self, other: Self) -> Vec<Self> {
        let hole = self.overlap(other);
        if hole.is_empty() {
            return vec![self];
        }
        let rows = |y: u32, end: u32| Self { y, height: end - y, ..self };
        let columns = |x: u32, end: u32| Self { x, width: end - x, ..Self { y: hole.y, height: hole.height, ..self } };
        let (right, top) = (hole.x + hole.width, hole.y + hole.height);
        let around = [
            rows(self.y, hole.y),
            columns(self.x, hole.x),
            columns(right, self.x + self.width),
            rows(top, self.y + self.height),
        ];
        around.into_iter().filter(|part| !part.is_empty()).collect()
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

/// Rows of a picture whose film is rendered window by window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FilmWindow {
    /// What is traced: the rows inside, and others beside them.
    pub(crate) traced: PixelWindow,
    /// What is shown and measured.
    pub(crate) inside: PixelWindow,
    /// What is rendered of the picture, in all its windows.
    pub(crate) picture: PixelWindow,
}

impl FilmWindow {
    /// Cuts `picture` into windows of whole rows, as few as take no more than `pixels` pixels each if three rows do.
    /// They have the same number of pixels, so that one film serves them all, and a row on either side that is not
    /// shown, unless it is outside of the picture: the error of a pixel depends on the pixels next to it. One window is
    /// the whole picture.
    pub(crate) fn cut(picture: PixelWindow, pixels: u64) -> Vec<Self> {
        let most = u32::try_from(pixels / u64::from(picture.width.max(1))).unwrap_or(u32::MAX).max(3);
        if picture.height <= most {
            return vec![Self { traced: picture, inside: picture, picture }];
        }
        // Two rows of the picture have no neighbour on one side.
        let count = (picture.height - 2).div_ceil(most - 2);
        let shown = (picture.height - 2).div_ceil(count);
        let (rows, top) = (shown + 2, picture.y + picture.height);
        let mut windows = Vec::new();
        let mut next = picture.y;
        while next < top {
            let first = next.saturating_sub(1).clamp(picture.y, top - rows);
            let end = if first + rows == top { top } else { first + rows - 1 };
            let rows_of = |y: u32, height: u32| PixelWindow { y, height, ..picture };
            windows.push(Self { traced: rows_of(first, rows), inside: rows_of(next, end - next), picture });
            next = end;
        }
        windows
    }

    /// The pixels inside among those that are traced: the first, and their number.
    pub(crate) fn measured(self) -> [u32; 2] {
        let width = self.traced.width;
        [(self.inside.y - self.traced.y) * width, self.inside.height * width]
    }
}

/// Where the pixels of a render go in the images that the host reads: these are of the whole picture, and have clear
/// values outside of what is rendered.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PictureLayout {
    /// Columns and rows of the picture.
    pub(crate) size: [u32; 2],
    /// What the film has.
    pub(crate) window: PixelWindow,
    /// Rows of it that are shown: all, unless it is one of several windows.
    pub(crate) inside: PixelWindow,
    /// What is rendered, in all windows.
    picture: PixelWindow,
    aovs: Vec<AovRequest>,
}

impl PictureLayout {
    pub(crate) fn new(size: [u32; 2], window: PixelWindow, aovs: &[AovRequest]) -> Self {
        Self { size, window, inside: window, picture: window, aovs: aovs.to_vec() }
    }

    /// The same where the film has one of several windows of the picture.
    #[must_use]
    pub(crate) fn of_window(self, window: Option<FilmWindow>) -> Self {
        match window {
            Some(FilmWindow { traced, inside, picture }) => Self { window: traced, inside, picture, ..self },
            None => self,
        }
    }

    /// Whether images of `other` are clear where those of this layout are.
    pub(crate) fn is_clear_as(&self, other: &Self) -> bool {
        self.size == other.size && self.picture == other.picture && self.aovs == other.aovs
    }

    /// Pixels of the whole picture.
    pub(crate) fn pixels(&self) -> u64 {
        u64::from(self.size[0]) * u64::from(self.size[1])
    }

    /// Whether all of the picture is shown.
    pub(crate) fn is_whole(&self) -> bool {
        self.inside == PixelWindow::whole(self.size)
    }

    /// Pixels of the film before the first one that is shown.
    pub(crate) fn hidden(&self) -> usize {
        (self.inside.y - self.window.y) as usize * self.window.width as usize
    }

    /// Fills an image of `kind` with its clear value.
    pub(crate) fn clear(&self, kind: AovKind, image: &mut [u8]) {
        if kind.is_list() {
            return image.fill(0); // nothing has no entry
        }
        let clear = self.aovs.iter().find(|aov| aov.kind == kind).map_or([0.0; 4], |aov| aov.clear);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "clear values of ids are given as floats; the cast saturates"
        )]
        let value = match kind {
            kind if kind.is_id() => [clear[0].round() as i32; 4].map(i32::to_ne_bytes),
            _ => clear.map(f32::to_ne_bytes),
        };
        let value = &value.as_flattened()[..kind.pixel_bytes()];
        image.chunks_exact_mut(value.len()).for_each(|pixel| pixel.copy_from_slice(value));
    }

    /// The rows that are shown in an image of `kind`.
    pub(crate) fn rows(&self, kind: AovKind) -> impl Iterator<Item = std::ops::Range<usize>> {
        self.inside.rows(self.size[0], kind.pixel_bytes())
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
    fn what_is_outside_of_another_window_is_covered_once() {
        let of = |x, y, width, height| PixelWindow { x, y, width, height };
        let all = of(3, 2, 6, 5);
        for hole in [of(4, 3, 2, 2), of(0, 0, 5, 9), of(5, 0, 9, 4), all, of(0, 0, 20, 20), of(9, 2, 4, 4)] {
            let (both, around) = (all.overlap(hole), all.without(hole));
            let holds = |w: &PixelWindow, [x, y]: [u32; 2]| {
                (w.x..w.x + w.width).contains(&x) && (w.y..w.y + w.height).contains(&y)
            };
            for at in (0..12).flat_map(|x| (0..12).map(move |y| [x, y])) {
                let outside = around.iter().filter(|part| holds(part, at)).count();
                assert_eq!(holds(&both, at), holds(&all, at) && holds(&hole, at), "{hole:?}, {at:?}");
                assert_eq!(outside, usize::from(holds(&all, at) && !holds(&hole, at)), "{hole:?}, {at:?}");
            }
        }
    }

    #[test]
    fn windows_are_cut_at_the_picture() {
        let window = PixelWindow { x: 3, y: 4, width: 20, height: 1 };
        assert_eq!(window.within([8, 8]), PixelWindow { width: 5, ..window });
        assert!(window.within([8, 4]).is_empty() && window.within([3, 8]).is_empty(), "nothing is left");
    }

    #[test]
    fn windows_of_a_film_cover_the_picture_once_and_have_their_neighbours() {
        for (height, pixels) in [(37, 40), (37, 400), (37, 369), (37, 370), (3, 1), (8640, 900), (4, 30), (5, 49)] {
            let picture = PixelWindow { x: 4, y: 6, width: 10, height };
            let windows = FilmWindow::cut(picture, pixels);
            let (top, mut next) = (picture.y + height, picture.y);
            for FilmWindow { traced, inside, picture: of } in &windows {
                assert_eq!((of, inside.y), (&picture, next), "{height}, {pixels}: without gaps");
                assert_eq!(traced.size(), windows[0].traced.size(), "one film serves all");
                assert!(traced.pixels() <= pixels.max(30), "{height}, {pixels}: {traced:?}");
                let end = inside.y + inside.height;
                let below = traced.y < inside.y || inside.y == picture.y && traced.y == picture.y;
                let above = traced.y + traced.height > end || end == top && traced.y + traced.height == top;
                assert!(below && above && inside.height > 0, "{height}, {pixels}: {traced:?}, {inside:?}");
                next = end;
            }
            assert_eq!(next, top, "{height}, {pixels}: all rows are there");
            assert!(windows.len() > 1 || picture.pixels() <= pixels.max(30), "cut");
        }
        let [first, second] = FilmWindow::cut(PixelWindow::whole([10, 6]), 40)[..] else { panic!("two windows") };
        assert_eq!((first.measured(), second.measured()), ([0, 30], [10, 30]), "where they are measured");
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
