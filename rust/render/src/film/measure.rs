// SPDX-License-Identifier: Apache-2.0
//! The times at which the film measures its error, and the results.
//!
//! Samples are added to the film in pieces that end where every pixel has a power of two of them (`pieces`), so that an
//! octave is measured at exactly that many samples, wherever waves and segments are cut: the same render gives the same
//! error each time. Each measurement has a slot of its own and is read when its submission has ended. Render thread
//! only.

use crate::film::Film;
use crate::job::window::{PictureLayout, PixelWindow};
use oocpt_abi::ErrorSums;
use oocpt_core::convergence;
use oocpt_core::stats::WorstPixel;
use oocpt_gpu::GpuError;

/// Number of worst pixels that are reported.
const WORST: usize = 8;

/// One measurement of the film's error.
#[derive(Clone, Debug, Default)]
pub(crate) struct MeasuredError {
    pub(crate) sums: convergence::PictureErrorSums,
    /// Worst first.
    pub(crate) worst: Vec<WorstPixel>,
    /// Fewest samples of a pixel.
    pub(crate) fewest: u32,
    /// Most samples of a pixel.
    pub(crate) most: u32,
    /// Rays traced by then.
    pub(crate) rays: u64,
}

impl MeasuredError {
    /// Adds what was measured of other pixels of the same picture.
    pub(crate) fn add(&mut self, other: &Self) {
        let none = self.sums.pixels <= 0.0;
        self.sums.add(&other.sums);
        self.worst.extend_from_slice(&other.worst);
        self.worst.sort_by(|a, b| b.error.total_cmp(&a.error).then((a.y, a.x).cmp(&(b.y, b.x))));
        self.worst.truncate(WORST);
        self.fewest = if none { other.fewest } else { self.fewest.min(other.fewest) };
        self.most = self.most.max(other.most);
        self.rays += other.rays;
    }
}

/// Reads a slot, once its commands are done; `None` if the film has no colour. Of `layout` only what is inside counts.
pub(crate) fn read(film: &Film, slot: u32, layout: &PictureLayout) -> Result<Option<MeasuredError>, GpuError> {
    let Some((parts, counters)) = film.error(slot)? else { return Ok(None) };
    let PixelWindow { x, y, width, .. } = layout.window;
    let [columns, rows] = layout.inside.size();
    let sum = |of: fn(&ErrorSums) -> f32| parts.iter().map(|part| f64::from(of(part))).sum();
    let sums = convergence::PictureErrorSums {
        pixels: f64::from(columns) * f64::from(rows),
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
        x: x + part.worst_pixel % width.max(1),
        y: layout.size[1].saturating_sub(1).saturating_sub(y + part.worst_pixel / width.max(1)),
        error: f64::from(part.worst),
    };
    Ok(Some(MeasuredError {
        sums,
        worst: worst.iter().take(WORST).map(place).collect(),
        fewest: parts.iter().map(|part| part.fewest).min().unwrap_or(0),
        most: parts.iter().map(|part| part.most).max().unwrap_or(0),
        rays: counters.closest_rays + counters.shadow_rays,
    }))
}
