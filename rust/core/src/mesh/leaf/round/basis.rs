// SPDX-License-Identifier: Apache-2.0
//! How control points make curves: segments of the bases of `UsdGeomBasisCurves`, and their weights. Pure.

use crate::desc::{CurveBasis, CurveWrap};

/// Four control points of a cubic segment, or two of a line (the last two of `vertices` are not used then): numbers
/// within the curve.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct CurveSegment {
    pub(super) vertices: [usize; 4],
    /// The first control point is the second one mirrored, `2 P0 - P1` (pinned ends).
    pub(super) mirrors_first: bool,
    /// The last one is.
    pub(super) mirrors_last: bool,
}

/// The segments of a curve of `count` vertices, in their order; none if there are too few.
pub(super) fn segments(basis: CurveBasis, wrap: CurveWrap, count: usize) -> Vec<CurveSegment> {
    let plain = |vertices: [usize; 4]| CurveSegment { vertices, mirrors_first: false, mirrors_last: false };
    let around = |first: usize| plain([0, 1, 2, 3].map(|k| (first + k) % count.max(1)));
    match (basis, wrap) {
        (CurveBasis::Linear, CurveWrap::Segmented) => (0..count / 2).map(|k| around(2 * k)).collect(),
        (CurveBasis::Linear, CurveWrap::Periodic) if count >= 3 => (0..count).map(around).collect(),
        (CurveBasis::Linear, _) => (0..count.saturating_sub(1)).map(around).collect(),
        (CurveBasis::Bezier, CurveWrap::Periodic) if count >= 3 => (0..count / 3).map(|k| around(3 * k)).collect(),
        (CurveBasis::Bezier, _) if count >= 4 => (0..(count - 1) / 3).map(|k| around(3 * k)).collect(),
        (CurveBasis::BSpline | CurveBasis::CatmullRom, CurveWrap::Periodic) if count >= 3 => {
            (0..count).map(around).collect()
        }
        (CurveBasis::BSpline | CurveBasis::CatmullRom, CurveWrap::Pinned) if count >= 2 => {
            let segment = |k: usize| CurveSegment {
                vertices: [k.saturating_sub(1), k, k + 1, (k + 2).min(count - 1)],
                mirrors_first: k == 0,
                mirrors_last: k + 2 == count,
            };
            (0..count - 1).map(segment).collect()
        }
        (CurveBasis::BSpline | CurveBasis::CatmullRom, _) if count >= 4 => (0..count - 3).map(around).collect(),
        _ => Vec::new(),
    }
}

/// Values at the ends of segments that a curve of `segments` segments has (`varying`).
pub(super) fn varying_count(basis: CurveBasis, wrap: CurveWrap, segments: usize, count: usize) -> usize {
    match (basis, wrap) {
        (CurveBasis::Linear, _) => count,
        (_, CurveWrap::Periodic) => segments,
        _ if segments == 0 => 0,
        _ => segments + 1,
    }
}

impl CurveSegment {
    /// Weights of the four control points at `t` in `[0, 1]`.
    pub(super) fn weights(&self, basis: CurveBasis, t: f64) -> [f64; 4] {
        let s = 1.0 - t;
        let (t2, t3) = (t * t, t * t * t);
        self.folded(match basis {
            CurveBasis::Linear => [s, t, 0.0, 0.0],
            CurveBasis::Bezier => [s * s * s, 3.0 * s * s * t, 3.0 * s * t2, t3],
            CurveBasis::BSpline => {
                [s * s * s, 3.0 * t3 - 6.0 * t2 + 4.0, -3.0 * t3 + 3.0 * t2 + 3.0 * t + 1.0, t3].map(|w| w / 6.0)
            }
            CurveBasis::CatmullRom => {
                [-t3 + 2.0 * t2 - t, 3.0 * t3 - 5.0 * t2 + 2.0, -3.0 * t3 + 4.0 * t2 + t, t3 - t2].map(|w| w / 2.0)
            }
        })
    }

    /// Weights of the first derivative by `t`.
    pub(super) fn slopes(&self, basis: CurveBasis, t: f64) -> [f64; 4] {
        let s = 1.0 - t;
        let t2 = t * t;
        self.folded(match basis {
            CurveBasis::Linear => [-1.0, 1.0, 0.0, 0.0],
            CurveBasis::Bezier => [-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t2, 3.0 * t2],
            CurveBasis::BSpline => {
                [-3.0 * s * s, 9.0 * t2 - 12.0 * t, -9.0 * t2 + 6.0 * t + 3.0, 3.0 * t2].map(|w| w / 6.0)
            }
            CurveBasis::CatmullRom => {
                [-3.0 * t2 + 4.0 * t - 1.0, 9.0 * t2 - 10.0 * t, -9.0 * t2 + 8.0 * t + 1.0, 3.0 * t2 - 2.0 * t]
                    .map(|w| w / 2.0)
            }
        })
    }

    /// Weights of the second derivative at the beginning and the end: in between it is linear.
    pub(super) fn bends(&self, basis: CurveBasis) -> [[f64; 4]; 2] {
        let bends = match basis {
            CurveBasis::Linear => [[0.0; 4]; 2],
            CurveBasis::Bezier => [[6.0, -12.0, 6.0, 0.0], [0.0, 6.0, -12.0, 6.0]],
            CurveBasis::BSpline => [[1.0, -2.0, 1.0, 0.0], [0.0, 1.0, -2.0, 1.0]],
            CurveBasis::CatmullRom => [[2.0, -5.0, 4.0, -1.0], [-1.0, 4.0, -5.0, 2.0]],
        };
        bends.map(|weights| self.folded(weights))
    }

    /// Weights of mirrored ends, given to the points that they are made of.
    fn folded(&self, [mut a, mut b, mut c, mut d]: [f64; 4]) -> [f64; 4] {
        if self.mirrors_first {
            (a, b, c) = (0.0, b + 2.0 * a, c - a);
        }
        if self.mirrors_last {
            (b, c, d) = (b - d, c + 2.0 * d, 0.0);
        }
        [a, b, c, d]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BASES: [CurveBasis; 4] =
        [CurveBasis::Linear, CurveBasis::Bezier, CurveBasis::BSpline, CurveBasis::CatmullRom];

    fn at(weights: [f64; 4], points: [f64; 4]) -> f64 {
        weights.iter().zip(points).map(|(w, p)| w * p).sum()
    }

    #[test]
    fn basis_weights_match_known_curve_points() {
        let segment = CurveSegment { vertices: [0, 1, 2, 3], mirrors_first: false, mirrors_last: false };
        let points = [1.0, 3.0, 4.0, 8.0];
        let ends = |basis| [0.0, 1.0].map(|t| at(segment.weights(basis, t), points));
        assert_eq!(ends(CurveBasis::Linear), [1.0, 3.0], "from the first point to the second");
        assert_eq!(ends(CurveBasis::Bezier), [1.0, 8.0], "from the first to the last");
        assert_eq!(ends(CurveBasis::CatmullRom), [3.0, 4.0], "through the inner two");
        let [a, b] = ends(CurveBasis::BSpline);
        assert!((a - 17.0 / 6.0).abs() < 1e-12 && (b - 27.0 / 6.0).abs() < 1e-12, "(1, 4, 1) / 6");
        for basis in BASES {
            for t in [0.0, 0.3, 1.0] {
                let h = 1e-5;
                let value = |t| at(segment.weights(basis, t), points);
                assert!((segment.weights(basis, t).iter().sum::<f64>() - 1.0).abs() < 1e-12, "{basis:?} sums to 1");
                let slope = (value(t + h) - value(t - h)) / (2.0 * h);
                assert!((at(segment.slopes(basis, t), points) - slope).abs() < 1e-6, "{basis:?}: slope at {t}");
                let bend = (value(t + h) - 2.0 * value(t) + value(t - h)) / (h * h);
                let [from, to] = segment.bends(basis).map(|weights| at(weights, points));
                assert!((from * (1.0 - t) + to * t - bend).abs() < 1e-3, "{basis:?}: second derivative at {t}");
            }
        }
    }

    #[test]
    fn pinned_curves_reach_their_end_points() {
        for basis in [CurveBasis::BSpline, CurveBasis::CatmullRom] {
            for count in 2..6_usize {
                let points: Vec<f64> = (0..count).map(|k| (k * k) as f64 + 1.0).collect();
                let segments = segments(basis, CurveWrap::Pinned, count);
                assert_eq!(segments.len(), count - 1, "as many as there are gaps");
                let value =
                    |segment: &CurveSegment, t| at(segment.weights(basis, t), segment.vertices.map(|v| points[v]));
                let (first, last) = (segments.first().unwrap(), segments.last().unwrap());
                assert!((value(first, 0.0) - 1.0).abs() < 1e-12, "{basis:?} begins at the first point");
                assert!((value(last, 1.0) - points[count - 1]).abs() < 1e-9, "{basis:?} ends at the last one");
                for pair in segments.windows(2) {
                    assert!((value(&pair[0], 1.0) - value(&pair[1], 0.0)).abs() < 1e-9, "{basis:?} has no gap");
                }
            }
        }
    }

    #[test]
    fn segment_counts_follow_usd_geom_basis_curves() {
        use CurveWrap::{Nonperiodic, Periodic, Pinned, Segmented};
        for (basis, wrap, count, expected, varying) in [
            (CurveBasis::Linear, Nonperiodic, 5, 4, 5),
            (CurveBasis::Linear, Periodic, 5, 5, 5),
            (CurveBasis::Linear, Segmented, 6, 3, 6),
            (CurveBasis::Linear, Nonperiodic, 1, 0, 1),
            (CurveBasis::Bezier, Nonperiodic, 7, 2, 3),
            (CurveBasis::Bezier, Pinned, 7, 2, 3),
            (CurveBasis::Bezier, Periodic, 6, 2, 2),
            (CurveBasis::Bezier, Nonperiodic, 3, 0, 0),
            (CurveBasis::BSpline, Nonperiodic, 7, 4, 5),
            (CurveBasis::BSpline, Periodic, 7, 7, 7),
            (CurveBasis::CatmullRom, Pinned, 7, 6, 7),
            (CurveBasis::CatmullRom, Nonperiodic, 3, 0, 0),
            (CurveBasis::BSpline, Periodic, 2, 0, 0),
        ] {
            let segments = segments(basis, wrap, count);
            assert_eq!(segments.len(), expected, "{basis:?} {wrap:?} of {count}");
            assert_eq!(varying_count(basis, wrap, segments.len(), count), varying, "{basis:?} {wrap:?} of {count}");
            assert!(segments.iter().flat_map(|s| s.vertices).all(|v| v < count), "{basis:?} {wrap:?}: in range");
        }
    }
}
