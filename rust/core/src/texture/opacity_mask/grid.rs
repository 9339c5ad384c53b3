// SPDX-License-Identifier: Apache-2.0
//! A mask's cells, each the mean of the finer ones in it by area. Pure; any thread.

use super::cells::OpacityCell;

/// A level's cells, row by row.
#[derive(Clone, Debug)]
pub(super) struct OpacityGrid {
    pub(super) size: [u32; 2],
    pub(super) cells: Vec<OpacityCell>,
}

/// A grid that is made of the rows of a finer one, in any order.
#[derive(Clone, Debug)]
pub(super) struct GridReduction {
    from: [u32; 2],
    pub(super) grid: OpacityGrid,
}

impl GridReduction {
    pub(super) fn new(from: [u32; 2], size: [u32; 2]) -> Self {
        let count = size[0] as usize * size[1] as usize;
        Self { from, grid: OpacityGrid { size, cells: vec![OpacityCell::default(); count] } }
    }

    /// Adds row `y`; each once.
    pub(super) fn push(&mut self, y: usize, row: &[OpacityCell]) {
        let [width, height] = self.grid.size;
        if y >= self.from[1] as usize {
            return;
        }
        let across: Vec<OpacityCell> = match self.from[0] == width {
            true => row.to_vec(),
            false => (0..width)
                .map(|x| {
                    let mut cell = OpacityCell::default();
                    for at in covered(self.from[0], width, x) {
                        let part = row.get(at as usize).copied().unwrap_or_default();
                        cell.add(part, weight(self.from[0], width, x, at));
                    }
                    cell
                })
                .collect(),
        };
        #[expect(clippy::cast_possible_truncation, reason = "a row of the grid")]
        let y = y as u32;
        for row in covered(height, self.from[1], y) {
            let weight = weight(self.from[1], height, row, y);
            let begin = row as usize * width as usize;
            let cells = self.grid.cells.iter_mut().skip(begin);
            cells.zip(&across).for_each(|(cell, part)| cell.add(*part, weight));
        }
    }
}

/// Of `fine` cells along a side those that lie in cell `at` of `coarse`, or the other way round.
fn covered(fine: u32, coarse: u32, at: u32) -> std::ops::Range<u32> {
    let [fine, coarse, at] = [fine, coarse, at].map(u64::from);
    #[expect(clippy::cast_possible_truncation, reason = "at most the cells of a side")]
    let [begin, end] = [at * fine / coarse, ((at + 1) * fine).div_ceil(coarse)].map(|cell| cell as u32);
    begin..end
}

/// What share of cell `at` of `coarse` along a side is of cell `part` of `fine`.
fn weight(fine: u32, coarse: u32, at: u32, part: u32) -> f32 {
    let [fine, coarse, at, part] = [fine, coarse, at, part].map(u64::from);
    let [begin, end] = [(at * fine).max(part * coarse), ((at + 1) * fine).min((part + 1) * coarse)];
    end.saturating_sub(begin) as f32 / fine as f32
}
