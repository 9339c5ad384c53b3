// SPDX-License-Identifier: Apache-2.0
//! When the film is asked for its error, and what it answers.
//!
//! Samples are added to the film in pieces that end where every pixel has a power of two of them (`pieces`), so that an octave is
//! measured at exactly that many, wherever waves and segments are cut: the same render says the same of its error each time. What is
//! measured goes to a slot of its own and is read when its submission has ended. Render thread only.

use crate::film::{ERROR_SLOTS, Film, error_groups};
use crate::schedule::Wave;
use crate::wavefront::Passes;
use oocpt_core::convergence;
use oocpt_core::stats::WorstPixel;
use oocpt_gpu::{Buffer, Commands, GpuError};
use oocpt_shader_abi::{ErrorSums, Push, groups};

/// The slot of what is measured at the end.
pub(crate) const LAST_SLOT: u32 = ERROR_SLOTS - 1;
/// Worst pixels that are told.
const WORST: usize = 8;

/// A part of a wave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Piece {
    /// Its paths.
    pub(crate) wave: Wave,
    /// Paths of the whole wave before it.
    pub(crate) offset: u32,
    /// With it every pixel has two to the power of this many samples.
    pub(crate) completes: Option<u32>,
}

/// Cuts a wave where the samples of all `pixels` are a power of two, and leaves out paths from `end` on.
pub(crate) fn pieces(wave: Wave, pixels: u64, end: u64) -> Vec<Piece> {
    let end = end.min(wave.first + u64::from(wave.count));
    let mut pieces = Vec::new();
    let mut first = wave.first;
    while first < end {
        let (octave, boundary) = next_boundary(first, pixels);
        let stop = boundary.min(end);
        // Both fit: a wave has fewer than 2^32 paths.
        let [count, offset] = [stop - first, first - wave.first].map(|n| u32::try_from(n).unwrap_or(u32::MAX));
        let completes = (stop == boundary && octave < LAST_SLOT).then_some(octave);
        pieces.push(Piece { wave: Wave { first, count }, offset, completes });
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

/// Adds the samples of a wave to the film, measuring on the way; `push` is the wave's, `arg0` its first place. Gives the octaves measured.
pub(crate) fn accumulate(
    commands: &mut Commands,
    (passes, film, counters): (&Passes, &Film, &Buffer),
    push: Push,
    wave: Wave,
    (pixels, end): (u32, u64),
) -> Vec<u32> {
    let mut octaves = Vec::new();
    for piece in film.pieces(wave, end) {
        let (q, apart) = film.push(push.frame, piece.wave);
        let q = Push { flags: push.flags, ..q }.with(push.round, push.arg0 + piece.offset);
        let threads = u64::from(piece.wave.count.min(apart));
        commands.dispatch(&passes.accumulate, bytemuck::bytes_of(&q), groups(threads));
        if let Some(octave) = piece.completes {
            measure(commands, (passes, film, counters), push, octave, pixels);
            octaves.push(octave);
        }
    }
    octaves
}

/// Asks the film for its error.
pub(crate) fn measure(
    commands: &mut Commands,
    (passes, film, counters): (&Passes, &Film, &Buffer),
    push: Push,
    slot: u32,
    pixels: u32,
) {
    let q = Push::wave(push.frame, 0, 0, pixels);
    commands.dispatch(&passes.measure_error, bytemuck::bytes_of(&q), [error_groups(u64::from(pixels)), 1, 1]);
    film.copy_error(commands, counters, slot);
}

/// What the film said of its error.
#[derive(Clone, Debug, Default)]
pub(crate) struct Measured {
    pub(crate) sums: convergence::ErrorSums,
    /// Worst first.
    pub(crate) worst: Vec<WorstPixel>,
    /// Fewest samples of a pixel.
    pub(crate) fewest: u32,
    /// Most.
    pub(crate) most: u32,
    /// Rays traced by then.
    pub(crate) rays: u64,
}

/// Reads a slot, once its commands are done; none without colour.
pub(crate) fn read(film: &Film, slot: u32, [width, height]: [u32; 2]) -> Result<Option<Measured>, GpuError> {
    let Some((parts, counters)) = film.error(slot)? else { return Ok(None) };
    let sum = |of: fn(&ErrorSums) -> f32| parts.iter().map(|part| f64::from(of(part))).sum();
    let sums = convergence::ErrorSums {
        pixels: f64::from(width) * f64::from(height),
        s: sum(|p| p.s),
        d: sum(|p| p.d),
        ss: sum(|p| p.ss),
        sd: sum(|p| p.sd),
        dd: sum(|p| p.dd),
        doubt: sum(|p| p.doubt),
    };
    let mut worst: Vec<&ErrorSums> = parts.iter().filter(|part| part.worst > 0.0).collect();
    worst.sort_by(|a, b| b.worst.total_cmp(&a.worst).then(a.worst_pixel.cmp(&b.worst_pixel)));
    let place = |part: &&ErrorSums| WorstPixel {
        x: part.worst_pixel % width.max(1),
        y: height.saturating_sub(1).saturating_sub(part.worst_pixel / width.max(1)),
        error: f64::from(part.worst),
    };
    Ok(Some(Measured {
        sums,
        worst: worst.iter().take(WORST).map(place).collect(),
        fewest: parts.iter().map(|part| part.fewest).min().unwrap_or(0),
        most: parts.iter().map(|part| part.most).max().unwrap_or(0),
        rays: counters.closest_rays + counters.shadow_rays,
    }))
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
    fn what_is_beyond_the_end_is_left_out() {
        let pieces = pieces(Wave { first: 70, count: 30 }, 10, 80);
        assert_eq!(pieces.len(), 1, "nothing beyond the end");
        assert_eq!((pieces[0].wave.count, pieces[0].completes), (10, Some(3)), "and the end may be an octave");
    }
}
