// SPDX-License-Identifier: Apache-2.0
//! Ranges of paths, and where they are cut.
//!
//! Path `p` of an image of `n` pixels is sample `p / n` of pixel `p % n`. Samples are added to the film in pieces that
//! end where every pixel has a power of two of them, so that an octave is measured at exactly that many, wherever waves
//! and segments are cut. Pure.

/// Slots for what `measure_error` says: octaves 0 to 24 of the samples, and the end.
pub(crate) const ERROR_SLOTS: u32 = 26;
/// The slot of what is measured at the end.
pub(crate) const LAST_SLOT: u32 = ERROR_SLOTS - 1;

/// A contiguous range of paths.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Wave {
    pub(crate) first: u64,
    pub(crate) count: u32,
}

/// A part of a wave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct WavePiece {
    /// Its paths.
    pub(crate) wave: Wave,
    /// Paths of the whole wave before it.
    pub(crate) offset: u32,
    /// With it every pixel has two to the power of this many samples.
    pub(crate) completes: Option<u32>,
}

/// Cuts a wave where the samples of all `pixels` are a power of two, and leaves out paths from `end` on.
pub(crate) fn pieces(wave: Wave, pixels: u64, end: u64) -> Vec<WavePiece> {
    let end = end.min(wave.first + u64::from(wave.count));
    let mut pieces = Vec::new();
    let mut first = wave.first;
    while first < end {
        let (octave, boundary) = next_boundary(first, pixels);
        let stop = boundary.min(end);
        // Both fit: a wave has fewer than 2^32 paths.
        let [count, offset] = [stop - first, first - wave.first].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
        let completes = (stop == boundary && octave < LAST_SLOT).then_some(octave);
        pieces.push(WavePiece { wave: Wave { first, count }, offset, completes });
        first = stop;
    }
    pieces
}

/// The octave that is completed next after `paths` paths, and the paths that do.
pub(crate) fn next_boundary(paths: u64, pixels: u64) -> (u32, u64) {
    let pixels = pixels.max(1);
    let octave = (paths / pixels).checked_ilog2().map_or(0, |octave| octave + 1);
    (octave, pixels.checked_shl(octave).unwrap_or(u64::MAX).max(pixels))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_end_at_powers_of_two_and_cover_the_wave() {
        let wave = Wave { first: 5, count: 95 };
        let pieces = pieces(wave, 10, u64::MAX);
        let mut next = 5;
        for piece in &pieces {
            assert_eq!(piece.wave.first, next, "without gaps");
            assert_eq!(u64::from(piece.offset), next - 5, "places follow the paths");
            next += u64::from(piece.wave.count);
            match piece.completes {
                Some(octave) => assert_eq!(next, 10 << octave, "an octave is all pixels times a power of two"),
                None => assert_eq!(next, 100, "only the last piece completes nothing"),
            }
        }
        let octaves: Vec<u32> = pieces.iter().filter_map(|piece| piece.completes).collect();
        assert_eq!((octaves, next), (vec![0, 1, 2, 3], 100), "1, 2, 4 and 8 samples lie in the wave");
    }

    #[test]
    fn paths_beyond_the_end_are_omitted() {
        let pieces = pieces(Wave { first: 70, count: 30 }, 10, 80);
        assert_eq!(pieces.len(), 1, "nothing beyond the end");
        assert_eq!((pieces[0].wave.count, pieces[0].completes), (10, Some(3)), "and the end may be an octave");
    }
}
