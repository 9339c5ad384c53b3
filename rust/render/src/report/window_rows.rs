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
    mine.gpu_bytes = mine.gpu_bytes.max(other.gpu_bytes);
    mine.samples = if is_first { other.samples } else { mine.samples.min(other.samples) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::film::measure::MeasuredError;

    fn row(octave: Option<u32>, samples: u32, s: f64) -> MeasuredRow {
        let sums = PictureErrorSums { pixels: 10.0, s, ..PictureErrorSums::default() };
        let measured = MeasuredError { sums, fewest: samples, most: samples, rays: 7, ..MeasuredError::default() };
        MeasuredRow { octave, measured, moment: RowMoment { seconds: 1.0, samples, ..RowMoment::default() } }
    }

    /// Octave, sum of `s`, samples, rays and seconds of each row.
    fn facts(rows: &[MeasuredRow]) -> Vec<(Option<u32>, f64, u32, u64, f64)> {
        let facts = |row: &MeasuredRow| {
            (row.octave, row.measured.sums.s, row.measured.fewest, row.measured.rays, row.moment.seconds)
        };
        rows.iter().map(facts).collect()
    }

    fn now(seconds: f64, rays: u64) -> (RowMoment, u64) {
        (RowMoment { seconds, ..RowMoment::default() }, rays)
    }

    #[test]
    fn an_octave_is_told_once_all_windows_have_it() {
        let mut rows = WindowRows::new(2);
        rows.add(0, vec![row(Some(3), 8, 2.0), row(Some(4), 16, 1.0)]);
        assert!(rows.take(false, now(0.0, 0)).is_empty(), "one of two windows");
        rows.add(1, vec![row(Some(3), 8, 3.0), row(Some(4), 16, 1.5)]);
        let told = facts(&rows.take(false, now(5.0, 100)));
        assert_eq!(told, [(Some(3), 5.0, 8, 14, 2.0), (Some(4), 2.5, 16, 14, 2.0)]);
        rows.add(0, vec![row(Some(5), 32, 0.5)]);
        rows.add(1, vec![row(Some(5), 32, 0.25)]);
        let told = facts(&rows.take(true, now(9.0, 200)));
        assert_eq!(told, [(Some(5), 0.75, 32, 114, 7.0)], "the next round goes on with clock and counters");
        assert_eq!(rows.last_sums().map(|sums| (sums.s, sums.pixels)), Some((0.75, 20.0)));
    }

    #[test]
    fn windows_that_end_at_other_samples_are_told_for_the_fewest() {
        let mut rows = WindowRows::new(2);
        rows.add(0, vec![row(Some(3), 8, 2.0), row(Some(4), 16, 1.0), row(None, 20, 0.8)]);
        rows.add(1, vec![row(Some(3), 8, 3.0), row(None, 9, 2.75)]);
        let told = facts(&rows.take(true, now(0.0, 0)));
        assert_eq!(told, [(Some(3), 5.0, 8, 14, 2.0), (None, 3.55, 9, 14, 2.0)]);
        assert!(rows.take(true, now(0.0, 0)).len() == 1, "the end is what it was");
    }

    #[test]
    fn an_end_at_an_octave_of_all_windows_is_told_once() {
        let mut rows = WindowRows::new(1);
        rows.add(0, vec![row(Some(3), 8, 2.0)]);
        assert_eq!(rows.take(false, now(0.0, 0)).len(), 1, "the round");
        assert!(rows.take(true, now(0.0, 0)).is_empty(), "no window has got more");
    }
}
