// SPDX-License-Identifier: Apache-2.0
//! Reductions of one Ptex face, in linear values, and the texels along its edges. Pure.

/// All levels of a face, the finest first: each side is halved until it is 1.
#[derive(Debug)]
pub(super) struct FacePyramid {
    levels: Vec<([u32; 2], Vec<f32>)>,
}

impl FacePyramid {
    /// Of texels in rows of increasing v.
    pub(super) fn new(log2: [u8; 2], values: Vec<f32>, channels: usize) -> Self {
        let count = u32::from(log2[0].max(log2[1]));
        let mut levels = vec![(log2.map(|log2| 1_u32 << log2), values)];
        for _ in 0..count {
            let Some((size, fine)) = levels.last() else { break };
            let next = halved(*size, fine, channels);
            levels.push(next);
        }
        Self { levels }
    }

    /// Size and texels of a level.
    pub(super) fn level(&self, level: usize) -> Option<([u32; 2], &[f32])> {
        self.levels.get(level).map(|(size, values)| (*size, &values[..]))
    }

    /// Number of levels.
    pub(super) fn levels(&self) -> usize {
        self.levels.len()
    }

    /// The class of sizes of a level (`oocpt_core::texture::FaceLayout`).
    pub(super) fn class_of(&self, level: usize) -> u32 {
        u32::try_from(self.levels.len() - 1 - level.min(self.levels.len() - 1)).unwrap_or(0)
    }

    /// The texels along the edges of all levels.
    pub(super) fn edges(&self, channels: usize) -> FaceEdges {
        let strips = |(size, values): &([u32; 2], Vec<f32>)| {
            let [width, height] = size.map(|side| side as usize);
            let texel = |x: usize, y: usize| {
                let at = (y * width + x) * channels;
                values.get(at..at + channels).unwrap_or_default()
            };
            [
                (0..width).flat_map(|i| texel(i, 0)).copied().collect(),
                (0..height).flat_map(|i| texel(width - 1, i)).copied().collect(),
                (0..width).flat_map(|i| texel(width - 1 - i, height - 1)).copied().collect(),
                (0..height).flat_map(|i| texel(0, height - 1 - i)).copied().collect(),
            ]
        };
        FaceEdges { levels: self.levels.iter().map(strips).collect() }
    }
}

/// The mean of each 2 x 2 texels, or of two where a side is 1.
fn halved([width, height]: [u32; 2], fine: &[f32], channels: usize) -> ([u32; 2], Vec<f32>) {
    let size = [width, height].map(|side| (side / 2).max(1));
    let [step_x, step_y] = [usize::from(width > 1), usize::from(height > 1)];
    let stride = width as usize * channels;
    let [columns, rows] = size.map(|side| side as usize);
    let mut out = Vec::with_capacity(columns * rows * channels);
    for y in 0..rows {
        let below = fine.get(y * (step_y + 1) * stride..).unwrap_or_default();
        let above = below.get(step_y * stride..).unwrap_or_default();
        for x in 0..columns {
            let left = x * (step_x + 1) * channels;
            for k in left..left + channels {
                let right = k + step_x * channels;
                let four = [below.get(k), below.get(right), above.get(k), above.get(right)];
                out.push(four.iter().map(|value| value.copied().unwrap_or(0.0)).sum::<f32>() * 0.25);
            }
        }
    }
    (size, out)
}

/// The texels along the four edges of each level, counterclockwise: edge `k` begins at corner `k`.
#[derive(Debug)]
pub(super) struct FaceEdges {
    levels: Vec<[Vec<f32>; 4]>,
}

impl FaceEdges {
    pub(super) fn levels(&self) -> usize {
        self.levels.len()
    }

    /// Texels along an edge.
    pub(super) fn count(&self, level: usize, edge: u8, channels: usize) -> usize {
        self.strip(level, edge).len() / channels.max(1)
    }

    /// A texel; empty where there is none.
    pub(super) fn at(&self, level: usize, edge: u8, at: usize, channels: usize) -> &[f32] {
        self.strip(level, edge).get(at * channels..(at + 1) * channels).unwrap_or_default()
    }

    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        self.levels.iter().flatten().map(|strip| size_of_val(&strip[..]) + size_of::<Vec<f32>>()).sum()
    }

    fn strip(&self, level: usize, edge: u8) -> &[f32] {
        self.levels.get(level).and_then(|strips| strips.get(usize::from(edge))).map_or(&[], |strip| &strip[..])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_means_down_to_one_texel() {
        let values: Vec<f32> = (0..4 * 2 * 2).map(|k| k as f32).collect();
        let pyramid = FacePyramid::new([2, 1], values.clone(), 2);
        assert_eq!(pyramid.levels(), 3);
        assert_eq!(pyramid.level(0), Some(([4, 2], &values[..])));
        // Texels (0, 1) (2, 3) above them (8, 9) (10, 11).
        assert_eq!(pyramid.level(1), Some(([2, 1], &[5.0, 6.0, 9.0, 10.0][..])));
        assert_eq!(pyramid.level(2), Some(([1, 1], &[7.0, 8.0][..])));
        assert_eq!([0, 1, 2].map(|level| pyramid.class_of(level)), [2, 1, 0]);
    }

    #[test]
    fn ptex_edges_are_counterclockwise() {
        let values: Vec<f32> = (0..8).map(|k| k as f32).collect();
        let edges = FacePyramid::new([2, 1], values, 1).edges(1);
        let strip = |edge: u8| (0..edges.count(0, edge, 1)).map(|i| edges.at(0, edge, i, 1)[0]).collect::<Vec<_>>();
        assert_eq!([0, 1, 2, 3].map(strip), [vec![0., 1., 2., 3.], vec![3., 7.], vec![7., 6., 5., 4.], vec![4., 0.]]);
    }
}
