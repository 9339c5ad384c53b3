// SPDX-License-Identifier: Apache-2.0
//! Sharp edges and points of a subdivision surface, checked. Pure.

use crate::array::{ArrayView, TypedArray};
use crate::desc::{DroppedData, SubdivisionTags};

/// OpenSubdiv's infinite sharpness (`Sdc::Crease::SHARPNESS_INFINITE`).
const INFINITE: f64 = 10.0;

/// Usable creases and corners.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct CreaseSharpness {
    /// Two points for each edge.
    pub(crate) crease_pairs: Vec<i32>,
    pub(crate) crease_weights: Vec<f32>,
    pub(crate) corner_points: Vec<i32>,
    pub(crate) corner_weights: Vec<f32>,
}

impl CreaseSharpness {
    /// Reads what makes sense of `tags`, for a mesh with so many points.
    pub(crate) fn read(tags: &SubdivisionTags, point_count: usize, dropped: &mut DroppedData) -> Self {
        let mut sharpness = Self::default();
        dropped.creases += sharpness.read_creases(tags, point_count);
        dropped.creases += sharpness.read_corners(tags, point_count);
        sharpness
    }

    /// Adds the edges of creases; how many creases and edges are not usable.
    fn read_creases(&mut self, tags: &SubdivisionTags, point_count: usize) -> u64 {
        let [indices, lengths, weights, ..] = tags.arrays();
        let (Some(indices), Some(lengths), Some(weights)) = (view(indices), view(lengths), view(weights)) else {
            return u64::from(view(lengths).is_some());
        };
        let count = |crease: usize| lengths.index(crease).and_then(|length| usize::try_from(length).ok());
        let edges: usize = (0..lengths.len()).filter_map(count).map(|length| length.saturating_sub(1)).sum();
        // A sharpness for each crease, or for each edge of all of them; where both are as many, it is the same.
        let by_edge = weights.len() != lengths.len() && weights.len() >= edges;
        let (mut bad, mut first, mut edge) = (0, 0_usize, 0_usize);
        for crease in 0..lengths.len() {
            let Some(length) = count(crease).filter(|length| *length >= 2) else {
                bad += 1;
                first += count(crease).unwrap_or(0);
                continue;
            };
            for at in first..first.saturating_add(length - 1) {
                if at >= indices.len() {
                    bad += 1;
                    break;
                }
                let weight = weight(&weights, if by_edge { edge } else { crease });
                edge += 1;
                match (point(&indices, at, point_count), point(&indices, at + 1, point_count), weight) {
                    (Some(a), Some(b), Some(weight)) if a != b => {
                        self.crease_pairs.extend([a, b]);
                        self.crease_weights.push(weight);
                    }
                    _ => bad += 1,
                }
            }
            first = first.saturating_add(length);
        }
        bad
    }

    /// Adds sharp points; how many are not usable.
    fn read_corners(&mut self, tags: &SubdivisionTags, point_count: usize) -> u64 {
        let [.., indices, weights] = tags.arrays();
        let Some(indices) = view(indices) else { return 0 };
        let mut bad = 0;
        for at in 0..indices.len() {
            let weight = view(weights).and_then(|weights| weight(&weights, at));
            match (point(&indices, at, point_count), weight) {
                (Some(point), Some(weight)) => {
                    self.corner_points.push(point);
                    self.corner_weights.push(weight);
                }
                _ => bad += 1,
            }
        }
        bad
    }
}

fn view(array: Option<&TypedArray>) -> Option<ArrayView<'_>> {
    array.map(TypedArray::view).filter(|view| !view.is_empty())
}

fn point(indices: &ArrayView<'_>, at: usize, point_count: usize) -> Option<i32> {
    indices.index(at).filter(|&point| usize::try_from(point).is_ok_and(|point| point < point_count))
}

#[expect(clippy::cast_possible_truncation, reason = "between 0 and 10")]
fn weight(weights: &ArrayView<'_>, at: usize) -> Option<f32> {
    let weight = weights.scalar(at)?;
    (!weight.is_nan()).then(|| weight.clamp(0.0, INFINITE) as f32)
}
