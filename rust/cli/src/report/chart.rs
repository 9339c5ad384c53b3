// SPDX-License-Identifier: Apache-2.0
//! A chart on logarithmic axes, as SVG and as a picture, drawn by `plotters`. Pure.

use super::letters::{self, FONT};
use anyhow::{Context, Result, anyhow};
use image::RgbImage;
use plotters::coord::Shift;
use plotters::prelude::*;

const SIZE: (u32, u32) = (860, 520);
pub(super) const PAPER: RGBColor = RGBColor(20, 20, 26);
pub(super) const GRID: RGBColor = RGBColor(51, 51, 61);
pub(super) const INK: RGBColor = RGBColor(230, 230, 230);
/// Colours that most eyes can tell apart (Okabe and Ito 2008).
pub(super) const COLORS: [RGBColor; 6] = [
    RGBColor(86, 180, 233),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(240, 228, 66),
    RGBColor(213, 94, 0),
];

/// A curve with an interval at each point.
#[derive(Clone, Debug, Default)]
pub(crate) struct ChartCurve {
    pub(crate) name: String,
    /// x, y, and the interval of y; points with values that are not above 0 are left out.
    pub(crate) points: Vec<[f64; 4]>,
    /// True if it is drawn with dashes and without intervals.
    pub(crate) is_dashed: bool,
    /// The number of curves before this one whose colour it takes.
    pub(crate) color_of: usize,
}

/// A chart with its axes and curves.
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    pub(crate) curves: Vec<ChartCurve>,
    pub(crate) x_title: &'static str,
    pub(crate) y_title: &'static str,
}

/// Values that a chart can have: powers of ten beyond them are not finite, or zero.
const VALUES: std::ops::Range<f64> = 1e-90..1e90;

/// The powers of ten that hold all values, as exponents.
fn decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| VALUES.contains(v))
        .map(f64::log10)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (-1.0, 1.0);
    }
    // A chart with more decades than these would not be readable.
    let (low, high) = (low.floor().max(high.ceil() - 24.0), high.ceil());
    (low, high.max(low + 1.0))
}

/// The part of a line between two points that is inside of a box, all in logarithms (Liang and Barsky 1984).
fn clipped(a: [f64; 2], b: [f64; 2], low: [f64; 2], high: [f64; 2]) -> Option<[[f64; 2]; 2]> {
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    for k in 0..2 {
        let along = b[k] - a[k];
        let [s, t] = [(low[k] - a[k]) / along, (high[k] - a[k]) / along];
        if along == 0.0 {
            if a[k] < low[k] || a[k] > high[k] {
                return None;
            }
        } else {
            (enter, leave) = (enter.max(s.min(t)), leave.min(s.max(t)));
        }
    }
    let at = |s: f64| [0, 1].map(|k| a[k] + s * (b[k] - a[k]));
    (enter < leave).then(|| [at(enter), at(leave)])
}

impl Chart {
    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Result<()>
    where
        B::ErrorType: 'static,
    {
        let solid = || self.curves.iter().filter(|curve| !curve.is_dashed).flat_map(|curve| &curve.points);
        let (x0, x1) = decades(solid().map(|p| p[0]));
        let (y0, y1) = decades(solid().map(|p| p[1]));
        // The range is slightly wider, because rounding would lose the labels of the ends.
        let range = |low: f64, high: f64| (10_f64.powf(low - 1e-6)..10_f64.powf(high + 1e-6)).log_scale();
        letters::register()?;
        area.fill(&PAPER)?;
        let mut chart = ChartBuilder::on(area)
            .margin(16)
            .x_label_area_size(42)
            .y_label_area_size(64)
            .build_cartesian_2d(range(x0, x1), range(y0, y1))?;
        let power = |v: &f64| format!("{v:.0e}");
        chart
            .configure_mesh()
            .x_desc(self.x_title)
            .y_desc(self.y_title)
            .x_label_formatter(&power)
            .y_label_formatter(&power)
            .label_style((FONT, 13, &INK))
            .axis_style(GRID)
            .bold_line_style(GRID)
            .light_line_style(TRANSPARENT)
            .draw()?;
        for (number, curve) in self.curves.iter().enumerate() {
            let color = COLORS[number.saturating_sub(curve.color_of) % COLORS.len()];
            let points: Vec<&[f64; 4]> =
                curve.points.iter().filter(|p| p[..2].iter().all(|v| VALUES.contains(v))).collect();
            let series = if curve.is_dashed {
                // The ideal line reaches far beyond the chart.
                let logs = |p: &[f64; 4]| [p[0].log10(), p[1].log10()];
                let pieces = points.windows(2).filter_map(|ab| clipped(logs(ab[0]), logs(ab[1]), [x0, y0], [x1, y1]));
                let line: Vec<(f64, f64)> = pieces.flatten().map(|[x, y]| (10_f64.powf(x), 10_f64.powf(y))).collect();
                chart.draw_series(DashedLineSeries::new(line, 6, 5, color.into()))?
            } else {
                chart.draw_series(LineSeries::new(points.iter().map(|p| (p[0], p[1])), color.stroke_width(2)))?
            };
            series.label(curve.name.as_str()).legend(move |(x, y)| PathElement::new([(x, y), (x + 14, y)], color));
            let intervals = points.iter().filter(|p| !curve.is_dashed && p[2] > 0.0);
            let (low, high) = (10_f64.powf(y0), 10_f64.powf(y1));
            chart
                .draw_series(intervals.map(|p| {
                    PathElement::new([(p[0], p[2].clamp(low, high)), (p[0], p[3].clamp(low, high))], color)
                }))?;
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .label_font((FONT, 13, &INK))
            .background_style(PAPER.mix(0.8))
            .draw()?;
        area.present()?;
        Ok(())
    }

    /// Draws the chart as SVG.
    pub(crate) fn svg(&self) -> Result<String> {
        let mut text = String::new();
        self.draw(&SVGBackend::with_string(&mut text, SIZE).into_drawing_area()).context("cannot draw the chart")?;
        Ok(text)
    }

    /// Draws the chart as a picture.
    pub(crate) fn picture(&self) -> Result<RgbImage> {
        let (width, height) = SIZE;
        let mut pixels = vec![0; width as usize * height as usize * 3];
        self.draw(&BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area())
            .context("cannot draw the chart")?;
        RgbImage::from_raw(width, height, pixels).ok_or_else(|| anyhow!("a chart of {width} x {height} pixels"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_clipped_to_the_chart() {
        let (low, high) = ([0.0, 0.0], [2.0, 1.0]);
        assert_eq!(clipped([-1.0, 0.5], [3.0, 0.5], low, high), Some([[0.0, 0.5], [2.0, 0.5]]), "level");
        assert_eq!(clipped([1.0, 9.0], [1.0, -9.0], low, high), Some([[1.0, 1.0], [1.0, 0.0]]), "upright");
        assert_eq!(clipped([-1.0, 2.0], [3.0, -2.0], low, high), Some([[0.0, 1.0], [1.0, 0.0]]), "across a corner");
        assert_eq!(clipped([-1.0, 1.5], [3.0, 1.5], low, high), None, "above");
        assert_eq!(clipped([3.0, 0.0], [4.0, 1.0], low, high), None, "beside");
    }
}
