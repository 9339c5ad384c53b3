// SPDX-License-Identifier: Apache-2.0
//! From rows to tiles: decodes an image once and makes the tiles of all its levels in that one pass.
//!
//! One thread decodes, another makes coarser levels and tiles, a few bands apart; where other files keep the cores
//! busy, one does both. Memory: [`BANDS`] bands of rows, and for each level one row of tiles and two rows of sums
//! (`oocpt_core::texture::TexturePyramid`); no level is ever whole.

use super::image::{ColorTransform, ImageError, SourceImage};
use super::texels::StoredTexels;
use crossbeam_channel::bounded;
use oocpt_abi::TILE_SIDE;
use oocpt_core::texture::{TexturePyramid, TileLayout};
use std::sync::atomic::{AtomicUsize, Ordering};

/// Bands between the two threads.
const BANDS: usize = 4;

/// Takes tiles, in any order.
pub(super) trait TileSink {
    /// The tile whose lowest left texel is `at` of a level; rows from the bottom up, in the file's channels.
    fn tile(&mut self, level: u32, at: [u32; 2], size: [u32; 2], texels: &[u8]) -> Result<(), ImageError>;
}

/// What is decoded, and into what.
pub(super) struct ImageDecoding<'a> {
    pub(super) image: &'a dyn SourceImage,
    /// How tiles are stored.
    pub(super) texels: &'a StoredTexels,
    /// How the image's texels are stored, if not so, and what makes them linear.
    pub(super) transform: Option<(&'a StoredTexels, &'a dyn ColorTransform)>,
    pub(super) layout: &'a TileLayout,
    /// The finest level that is wanted.
    pub(super) first: u32,
}

/// Gives `sink` every tile of the levels that are wanted.
pub(super) fn convert(decoding: &ImageDecoding<'_>, sink: &mut dyn TileSink) -> Result<(), ImageError> {
    let image = decoding.image;
    let from = decoding.transform.map_or(decoding.texels, |(from, _)| from);
    let row_bytes = decoding.layout.size()[0] as usize * from.file_bytes();
    let (send, bands) = bounded::<(u32, Vec<u8>)>(BANDS);
    let (give_back, used) = bounded::<Vec<u8>>(BANDS + 1);
    let mut maker = PyramidMaker::new(decoding);
    let busy = BusyFiles::new();
    if busy.has_cores() {
        // On this thread, without copies of rows.
        let mut made = Ok(());
        image.decode(0, &mut |top, rows| {
            made = maker.band(top, row_bytes, rows, sink);
            made.is_ok()
        })?;
        made?;
        return maker.finish();
    }
    let (decoded, made) = std::thread::scope(|scope| {
        let decoder = scope.spawn(move || {
            image.decode(0, &mut |top, rows| {
                let mut band: Vec<u8> = used.try_recv().unwrap_or_default();
                band.clear();
                band.extend_from_slice(rows);
                send.send((top, band)).is_ok()
            })
        });
        let mut made = Ok(());
        for (top, band) in &bands {
            made = maker.band(top, row_bytes, &band, sink);
            if made.is_err() {
                break;
            }
            if give_back.try_send(band).is_err() {
                continue; // The decoder has enough of them.
            }
        }
        drop(bands);
        let panicked = |_panic| Err(ImageError("cannot be decoded: its reader panicked".into()));
        (decoder.join().unwrap_or_else(panicked), made)
    });
    decoded?;
    made?;
    maker.finish()
}

/// Files that are converted at the moment, this one included.
struct BusyFiles(usize);

static BUSY: AtomicUsize = AtomicUsize::new(0);

impl BusyFiles {
    fn new() -> Self {
        Self(BUSY.fetch_add(1, Ordering::Relaxed) + 1)
    }

    /// Whether a second thread for each would be more than there are cores.
    fn has_cores(&self) -> bool {
        std::thread::available_parallelism().is_ok_and(|cores| 2 * self.0 > cores.get())
    }
}

impl Drop for BusyFiles {
    fn drop(&mut self) {
        BUSY.fetch_sub(1, Ordering::Relaxed);
    }
}

/// One row of tiles of a level, filled from its top row down.
#[derive(Debug)]
struct TileRow {
    size: [u32; 2],
    /// Rows of the level that came in, from the top.
    taken: u32,
    /// Rows of the tiles, the lowest first.
    rows: Vec<u8>,
}

/// Cuts rows into tiles.
struct PyramidMaker<'a> {
    from: &'a StoredTexels,
    transform: Option<&'a dyn ColorTransform>,
    pyramid: TexturePyramid,
    /// Rows of the image that came in.
    taken: u32,
    cutter: TileCutter<'a>,
    values: Vec<f32>,
    /// Two rows of bytes make one of level 1, which goes on from there.
    halves: bool,
    /// The first of the two.
    upper: Vec<u8>,
}

struct TileCutter<'a> {
    texels: &'a StoredTexels,
    first: u32,
    levels: Vec<TileRow>,
    encoded: Vec<u8>,
    tile: Vec<u8>,
}

/// Puts 0 in place of what is no number and the largest half in place of what is infinite: one such texel would be all
/// that is left of
/// the coarser levels. Whether there were any.
pub(super) fn make_finite(values: &mut [f32]) -> bool {
    if values.iter().all(|value| value.is_finite()) {
        return false;
    }
    for value in values {
        if !value.is_finite() {
            *value = if value.is_nan() { 0.0 } else { 65504.0_f32.copysign(*value) };
        }
    }
    true
}

impl<'a> PyramidMaker<'a> {
    fn new(decoding: &ImageDecoding<'a>) -> Self {
        let ImageDecoding { texels, transform, layout, first, .. } = *decoding;
        let level = |level| {
            let size = layout.level_size(level);
            let bytes = if level < first { 0 } else { size[0] as usize * TILE_SIDE.min(size[1]) as usize };
            TileRow { size, taken: 0, rows: vec![0; bytes * texels.file_bytes()] }
        };
        let cutter = TileCutter {
            texels,
            first,
            levels: (0..layout.levels()).map(level).collect(),
            encoded: Vec::new(),
            tile: Vec::new(),
        };
        let values = vec![0.0; layout.size()[0] as usize * texels.channels()];
        let (from, transform) = transform.map_or((texels, None), |(from, transform)| (from, Some(transform)));
        let halves =
            from.is_bounded() && transform.is_none() && layout.size().iter().all(|side| side.is_multiple_of(2));
        let pyramid = TexturePyramid::new(layout, texels.channels());
        Self { from, transform, pyramid, taken: 0, cutter, values, halves, upper: Vec::new() }
    }

    fn band(&mut self, top: u32, row_bytes: usize, band: &[u8], sink: &mut dyn TileSink) -> Result<(), ImageError> {
        if top != self.taken || !band.len().is_multiple_of(row_bytes) {
            return Err(ImageError("cannot be decoded: its rows come in no order".into()));
        }
        for row in band.chunks_exact(row_bytes) {
            self.taken += 1;
            if self.halves {
                self.halve(row, sink)?;
                continue;
            }
            self.from.decode(row, &mut self.values);
            let is_changed = !self.from.is_bounded() && make_finite(&mut self.values);
            if let Some(transform) = self.transform {
                // At most 4 channels.
                transform.apply(&mut self.values, u32::try_from(self.from.channels()).unwrap_or(4))?;
                make_finite(&mut self.values);
            }
            if is_changed || self.transform.is_some() {
                self.cutter.values(0, &self.values, sink)?;
            } else {
                self.cutter.row(0, row, sink)?;
            }
            let (cutter, mut result) = (&mut self.cutter, Ok(()));
            // The filter is symmetric: from the top down it gives what it gives from the bottom up.
            self.pyramid.push(&self.values, &mut |level, _, values| {
                if result.is_ok() {
                    result = cutter.values(level, values, sink);
                }
            });
            result?;
        }
        Ok(())
    }

    /// The next row, two of which make one of level 1: most of the work is in the finest level.
    fn halve(&mut self, row: &[u8], sink: &mut dyn TileSink) -> Result<(), ImageError> {
        self.cutter.row(0, row, sink)?;
        if self.taken % 2 == 1 {
            self.upper.clear();
            self.upper.extend_from_slice(row);
            return Ok(());
        }
        let Self { from, pyramid, cutter, values, upper, .. } = self;
        from.halve(upper, row, values);
        let mut result = Ok(());
        pyramid.push_halved(values, &mut |level, _, values| {
            if result.is_ok() {
                result = cutter.values(level, values, sink);
            }
        });
        result
    }

    fn finish(&self) -> Result<(), ImageError> {
        let is_done = |level: &TileRow| level.taken == level.size[1];
        if self.cutter.levels.iter().all(is_done) {
            return Ok(());
        }
        Err(ImageError("cannot be decoded: it ends early".into()))
    }
}

impl TileCutter<'_> {
    /// The next row of a level, as values.
    fn values(&mut self, level: u32, values: &[f32], sink: &mut dyn TileSink) -> Result<(), ImageError> {
        if level < self.first {
            return self.row(level, &[], sink);
        }
        let mut encoded = std::mem::take(&mut self.encoded);
        self.texels.encode(values, &mut encoded);
        let result = self.row(level, &encoded, sink);
        self.encoded = encoded;
        result
    }

    /// The next row of a level from the top, as stored.
    fn row(&mut self, level: u32, row: &[u8], sink: &mut dyn TileSink) -> Result<(), ImageError> {
        let Some(tiles) = self.levels.get_mut(level as usize) else { return Ok(()) };
        tiles.taken += 1;
        if level < self.first {
            return Ok(());
        }
        let Some(y) = tiles.size[1].checked_sub(tiles.taken) else {
            return Err(ImageError("cannot be decoded: it has more rows than it says".into()));
        };
        let begin = (y % TILE_SIDE) as usize * row.len();
        let Some(to) = tiles.rows.get_mut(begin..begin + row.len()) else {
            return Err(ImageError("cannot be decoded: its rows are too long".into()));
        };
        to.copy_from_slice(row);
        if y.is_multiple_of(TILE_SIDE) {
            self.cut(level, y, sink)?;
        }
        Ok(())
    }

    /// Cuts a row of tiles that is there.
    fn cut(&mut self, level: u32, bottom: u32, sink: &mut dyn TileSink) -> Result<(), ImageError> {
        let Some(TileRow { size, rows, .. }) = self.levels.get(level as usize) else { return Ok(()) };
        let texel = self.texels.file_bytes();
        let stride = size[0] as usize * texel;
        let height = TILE_SIDE.min(size[1] - bottom);
        for left in (0..size[0]).step_by(TILE_SIDE as usize) {
            let width = TILE_SIDE.min(size[0] - left);
            let (from, length) = (left as usize * texel, width as usize * texel);
            self.tile.clear();
            for row in rows.chunks_exact(stride).take(height as usize) {
                self.tile.extend_from_slice(&row[from..from + length]);
            }
            sink.tile(level, [left, bottom], [width, height], &self.tile)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
