// SPDX-License-Identifier: Apache-2.0
//! The samples of a film by regions, when its window has moved: pixels that both windows have keep theirs, the others
//! have none. Pure.

use crate::job::publish::STRIP_ROWS;
use crate::job::window::PixelWindow;

/// Regions with samples that are kept, at most: those with the most. A host that drags a window leaves a strip behind
/// with each step.
const KEPT_REGIONS: usize = 4;

/// Pixels of a film with the same number of samples.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct FilmRegion {
    pub(crate) pixels: PixelWindow,
    pub(crate) samples: u32,
}

impl FilmRegion {
    fn paths(&self) -> u64 {
        self.pixels.pixels() * u64::from(self.samples)
    }
}

/// The regions of a film that has the first so many paths, one after the other in strips of rows. Pixels of the strip
/// in which the last sample ends have none: they would be regions of single pixels.
pub(crate) fn of_film(window: PixelWindow, paths: u64) -> Vec<FilmRegion> {
    let pixels = window.pixels().max(1);
    let samples = u32::try_from(paths / pixels).unwrap_or(u32::MAX);
    let strip = STRIP_ROWS * u64::from(window.width.max(1));
    let (strips, rest) = (paths % pixels / strip, paths % pixels % strip);
    // Fits: rows of the window.
    let rows = |strips: u64| u32::try_from(strips * STRIP_ROWS).unwrap_or(u32::MAX).min(window.height);
    let (below, above) = (rows(strips), rows(strips + u64::from(rest > 0)));
    let region = |first: u32, end: u32, samples: u32| FilmRegion {
        pixels: PixelWindow { y: window.y + first, height: end - first, ..window },
        samples,
    };
    let all = [region(0, below, samples + 1), region(below, above, 0), region(above, window.height, samples)];
    all.into_iter().filter(|region| !region.pixels.is_empty()).collect()
}

/// The regions of a film in another window.
pub(crate) fn moved(regions: &[FilmRegion], window: PixelWindow) -> Vec<FilmRegion> {
    let inside = |region: &FilmRegion| FilmRegion { pixels: region.pixels.overlap(window), ..*region };
    let mut kept: Vec<FilmRegion> = regions.iter().map(inside).filter(|region| region.paths() > 0).collect();
    kept.sort_by_key(|region| std::cmp::Reverse(region.paths()));
    kept.truncate(KEPT_REGIONS);
    let mut fresh = vec![window];
    for region in &kept {
        fresh = fresh.into_iter().flat_map(|part| part.without(region.pixels)).collect();
    }
    kept.extend(fresh.into_iter().map(|pixels| FilmRegion { pixels, samples: 0 }));
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(x: u32, y: u32, width: u32, height: u32) -> PixelWindow {
        PixelWindow { x, y, width, height }
    }

    #[test]
    fn a_film_has_a_sample_more_below_the_strip_where_the_last_one_ends() {
        let window = of(5, 3, 10, 30);
        let region = |y, height, samples| FilmRegion { pixels: of(5, y, 10, height), samples };
        assert_eq!(of_film(window, 900), [region(3, 30, 3)], "three samples of each");
        let parts = [region(3, 8, 4), region(11, 8, 0), region(19, 14, 3)];
        assert_eq!(of_film(window, 900 + 81), parts, "a path into the second strip");
        assert_eq!(of_film(window, 900 + 80), [region(3, 8, 4), region(11, 22, 3)], "between two strips");
        assert_eq!(of_film(window, 900 + 250), [region(3, 24, 4), region(27, 6, 0)], "the last strip has fewer rows");
    }

    #[test]
    fn a_moved_film_covers_its_window_once() {
        let window = of(0, 0, 40, 40);
        let mut regions = of_film(window, 1600 * 5 + 700);
        for (step, to) in
            [of(3, 2, 40, 40), of(8, 9, 40, 40), of(2, 0, 30, 52), of(20, 20, 40, 40)].into_iter().enumerate()
        {
            let before = regions.clone();
            regions = moved(&regions, to);
            assert_eq!(regions.iter().map(|region| region.pixels.pixels()).sum::<u64>(), to.pixels(), "step {step}");
            for (number, a) in regions.iter().enumerate() {
                assert!(regions[number + 1..].iter().all(|b| a.pixels.overlap(b.pixels).is_empty()), "step {step}");
                let had = |b: &FilmRegion| b.samples == a.samples && b.pixels.overlap(a.pixels) == a.pixels;
                assert!(a.samples == 0 || before.iter().any(had), "step {step}: {a:?} is of what was there");
            }
            assert!(regions.iter().filter(|region| region.samples > 0).count() <= KEPT_REGIONS);
            // What is new is rendered before the next step, but for a region.
            regions.iter_mut().filter(|region| region.samples == 0).skip(1).for_each(|region| region.samples = 1);
        }
        assert!(regions.iter().any(|region| region.samples >= 5), "the first samples are still there");
        assert_eq!(moved(&regions, of(90, 90, 5, 5)), [FilmRegion { pixels: of(90, 90, 5, 5), samples: 0 }]);
    }
}
