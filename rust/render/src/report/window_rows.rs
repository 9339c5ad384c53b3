// SPDX-License-Identifier: Apache-2.0
//! The error of a picture whose film is rendered window by window: what windows measured of their pixels, added up to
//! what a film of the whole picture would have measured. Pure.

use crate::report::error_log::{MeasuredRow, RowMoment};
use oocpt_core::convergence::PictureErrorSums;
use std::collections::BTreeMap;

/// Measurements of windows, by octave.
#[derive(Debug)]
pub(crate) struct WindowRows {
    windows: usize,
    /// Octaves that were measured, in so many windows.
    octaves: BTreeMap<u32, (usize, MeasuredRow)>,
    /// The last measurement of each window.
    ends: Vec<Option<MeasuredRow>>,
    /// The last octave that all windows have.
    fed: Option<u32>,
    /// Clock and counters of the picture before the windows that are under way, and its rays.
    base: (RowMoment, u64),
    /// What was measured last of the picture.
    last: Option<PictureErrorSums>,
}

impl WindowRows {
    /// Of a picture in so many windows.
    pub(crate) fn new(windows: usize) -> Self {
        let base = (RowMoment::default(), 0);
        Self { windows, octaves: BTreeMap::new(), ends: vec![None; windows], fed: None, base, last: None }
    }

    /// Adds the measurements of window `number` (from 0), octaves ascending.
    pub(crate) fn add(&mut self, number: usize, rows: Vec<MeasuredRow>) {
        for row in rows {
            if let Some(octave) = row.octave {
                let (count, sum) = self.octaves.entry(octave).or_default();
                *count += 1;
                join(sum, &row);
            }
            if let Some(end) = self.ends.get_mut(number) {
                *end = Some(row);
            }
        }
    }

    /// The measurements of the picture since the last call: the octaves that all windows have and, at the end, what
    /// they have then if that is something else. `now`: clock and counters, and rays, of the picture.
    pub(crate) fn take(&mut self, is_end: bool, now: (RowMoment, u64)) -> Vec<MeasuredRow> {
        let windows = self.windows;
        let all: Vec<u32> =
            self.octaves.iter().filter(|(_, (count, _))| *count == windows).map(|(octave, _)| *octave).collect();
        self.fed = all.last().copied().or(self.fed);
        let last = self.fed;
        let mut rows: Vec<MeasuredRow> =
            all.into_iter().filter_map(|octave| self.octaves.remove(&octave)).map(|(_, row)| row).collect();
        let is_elsewhere = |end: &Option<MeasuredRow>| {
            let octave = end.as_ref().and_then(|end| end.octave);
            octave.is_none() || octave != last
        };
        if is_end && self.ends.iter().any(is_elsewhere) && self.ends.iter().all(Option::is_some) {
            let mut sum = MeasuredRow::default();
            self.ends.iter().flatten().for_each(|end| join(&mut sum, end));
            rows.push(MeasuredRow { octave: None, ..sum });
        }
        let (base, rays) = std::mem::replace(&mut self.base, now);
        for row in &mut rows {
            row.moment.seconds += base.seconds;
            row.moment.seconds_tracing += base.seconds_tracing;
            row.moment.bytes_paged += base.bytes_paged;
            row.measured.rays += rays;
        }
        self.last = rows.last().map(|row| row.measured.sums).or(self.last);
        rows
    }

    /// What was measured last of the picture.
    pub(crate) fn last_sums(&self) -> Option<PictureErrorSums> {
        self.last
    }
}

/// Adds the measurement of other pixels. Windows come one after the other, so times add up.
fn join(sum: &mut MeasuredRow, row: &MeasuredRow) {
    let is_first = sum.measured.sums.pixels <= 0.0;
    sum.octave = row.octave;
    sum.measured.add(&row.measured);
    let (mine, other) = (&mut sum.moment, row.moment);
    mine.seconds += other.seconds;
    mine.seconds_tracing += other.seconds_tracing;
    mine.bytes_paged += other.bytes_paged;
    mine.samples = if is_first { other.samples } else { mine.samples.min(other.samples) };
}
