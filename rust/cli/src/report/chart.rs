// SPDX-License-Identifier: Apache-2.0
//! A chart on logarithmic axes, as SVG and as a picture. Pure.

use super::paint;
use image::RgbImage;
use std::fmt::Write as _;

const WIDTH: u32 = 860;
const HEIGHT: u32 = 520;
/// Left, top, right, bottom.
const MARGINS: [f64; 4] = [86.0, 24.0, 24.0, 56.0];
const PAPER: [f64; 3] = [0.08, 0.08, 0.1];
const GRID: [f64; 3] = [0.2, 0.2, 0.24];
const INK: [f64; 3] = [0.9, 0.9, 0.9];
/// Distinct for most eyes (Okabe and Ito 2008).
const COLORS: [[f64; 3]; 6] = [
    [0.34, 0.71, 0.91],
    [0.90, 0.62, 0.0],
    [0.0, 0.62, 0.45],
    [0.80, 0.47, 0.65],
    [0.94, 0.89, 0.26],
    [0.84, 0.37, 0.0],
];

/// A curve with an interval at each point.
#[derive(Clone, Debug, Default)]
pub(crate) struct Curve {
    pub(crate) name: String,
    /// x, y, and the interval of y; all above 0, others are left out.
    pub(crate) points: Vec<[f64; 4]>,
    /// Drawn with dashes and without intervals.
    pub(crate) is_dashed: bool,
    /// Takes the colour of the curve this many before it.
    pub(crate) color_of: usize,
}

/// What is drawn, in pixels, y downwards.
enum Shape {
    Line { from: [f64; 2], to: [f64; 2], width: f64, color: [f64; 3] },
    Text { at: [f64; 2], text: String, color: [f64; 3], anchor: f64 },
}

/// See the module.
#[derive(Clone, Debug)]
pub(crate) struct Chart {
    pub(crate) curves: Vec<Curve>,
    pub(crate) x_title: &'static str,
    pub(crate) y_title: &'static str,
}

/// Decades that hold all values.
fn decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (low, high) = values
        .filter(|v| v.is_finite() && *v > 0.0)
        .map(f64::log10)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    if low > high {
        return (-1.0, 1.0);
    }
    // More decades than these are no chart.
    let (low, high) = (low.floor().max(high.ceil() - 24.0), high.ceil());
    (low, high.max(low + 1.0))
}

impl Chart {
    fn shapes(&self) -> Vec<Shape> {
        let solid = || self.curves.iter().filter(|curve| !curve.is_dashed).flat_map(|curve| &curve.points);
        let (x0, x1) = decades(solid().map(|p| p[0]));
        let (y0, y1) = decades(solid().map(|p| p[1]));
        let [left, top, right, bottom] = MARGINS;
        let (w, h) = (f64::from(WIDTH) - left - right, f64::from(HEIGHT) - top - bottom);
        let place = |x: f64, y: f64| {
            let at = [(x.log10() - x0) / (x1 - x0), (y.log10() - y0) / (y1 - y0)].map(|t| t.clamp(-50.0, 50.0));
            [left + w * at[0], top + h * (1.0 - at[1])]
        };
        let mut shapes = Vec::new();
        let mut axis = |low: f64, high: f64, is_x: bool| {
            let mut power = low;
            while power <= high + 0.5 {
                let value = 10_f64.powf(power);
                let (from, to) = if is_x {
                    (place(value, 10_f64.powf(y0)), place(value, 10_f64.powf(y1)))
                } else {
                    (place(10_f64.powf(x0), value), place(10_f64.powf(x1), value))
                };
                shapes.push(Shape::Line { from, to, width: 1.0, color: GRID });
                let text = format!("1e{power:.0}");
                let (at, anchor) =
                    if is_x { ([from[0], from[1] + 18.0], 0.5) } else { ([from[0] - 8.0, from[1] + 4.0], 1.0) };
                shapes.push(Shape::Text { at, text, color: INK, anchor });
                power += 1.0;
            }
        };
        axis(x0, x1, true);
        axis(y0, y1, false);
        let title = |at, text: &str, anchor| Shape::Text { at, text: text.into(), color: INK, anchor };
        shapes.push(title([left + 0.5 * w, f64::from(HEIGHT) - 12.0], self.x_title, 0.5));
        shapes.push(title([8.0, top - 8.0], self.y_title, 0.0));
        let inside =
            |p: [f64; 2]| p[0] >= left - 1.0 && p[0] <= left + w + 1.0 && p[1] >= top - 1.0 && p[1] <= top + h + 1.0;
        for (number, curve) in self.curves.iter().enumerate() {
            let color = COLORS[number.saturating_sub(curve.color_of) % COLORS.len()];
            let points: Vec<&[f64; 4]> = curve.points.iter().filter(|p| p[0] > 0.0 && p[1] > 0.0).collect();
            for pair in points.windows(2) {
                let (from, to) = (place(pair[0][0], pair[0][1]), place(pair[1][0], pair[1][1]));
                if curve.is_dashed {
                    dashes(&mut shapes, from, to, color, inside);
                } else {
                    shapes.push(Shape::Line { from, to, width: 2.0, color });
                }
            }
            for point in points.iter().filter(|p| !curve.is_dashed && p[2] > 0.0) {
                let [from, to] =
                    [point[2], point[3]].map(|y| place(point[0], y)).map(|[x, y]| [x, y.clamp(top, top + h)]);
                shapes.push(Shape::Line { from, to, width: 1.0, color });
            }
            #[expect(clippy::cast_precision_loss, reason = "a place in the picture")]
            let row = [left + w - 8.0, top + 18.0 + 18.0 * number as f64];
            shapes.push(Shape::Text { at: row, text: curve.name.clone(), color, anchor: 1.0 });
        }
        shapes
    }

    /// As SVG.
    pub(crate) fn svg(&self) -> String {
        let mut text = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" \
            font-size=\"13\">\n\
             <rect width=\"{WIDTH}\" height=\"{HEIGHT}\" fill=\"{}\"/>\n",
            hex(PAPER)
        );
        for shape in self.shapes() {
            // Writing to a string cannot fail.
            _ = match shape {
                Shape::Line { from: [x0, y0], to: [x1, y1], width, color } => writeln!(
                    text,
                    "<line x1=\"{x0:.2}\" y1=\"{y0:.2}\" x2=\"{x1:.2}\" y2=\"{y1:.2}\" stroke=\"{}\" \
                    stroke-width=\"{width}\"/>",
                    hex(color)
                ),
                Shape::Text { at: [x, y], text: words, color, anchor } => writeln!(
                    text,
                    "<text x=\"{x:.2}\" y=\"{y:.2}\" fill=\"{}\" text-anchor=\"{}\">{}</text>",
                    hex(color),
                    if anchor > 0.9 {
                        "end"
                    } else if anchor > 0.1 {
                        "middle"
                    } else {
                        "start"
                    },
                    words.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
                ),
            };
        }
        text.push_str("</svg>\n");
        text
    }

    /// As a picture; letters are capitals.
    pub(crate) fn picture(&self) -> RgbImage {
        let mut image = RgbImage::from_pixel(WIDTH, HEIGHT, paint::pixel(PAPER));
        for shape in self.shapes() {
            match shape {
                Shape::Line { from, to, width, color } => line(&mut image, from, to, width, color),
                Shape::Text { at, text, color, anchor } => {
                    let text = text.to_uppercase();
                    #[expect(clippy::cast_precision_loss, reason = "a place in the picture")]
                    let left = at[0] - anchor * 8.0 * text.chars().count() as f64;
                    #[expect(
                        clippy::cast_possible_truncation,
                        clippy::cast_sign_loss,
                        reason = "a place in the picture"
                    )]
                    let [x, y] = [left, at[1] - 10.0].map(|v| v.max(0.0) as u32);
                    paint::write_in(&mut image, x, y, &text, color);
                }
            }
        }
        image
    }
}

fn hex(color: [f64; 3]) -> String {
    let [r, g, b] = paint::pixel(color).0;
    format!("#{r:02x}{g:02x}{b:02x}")
}

fn dashes(shapes: &mut Vec<Shape>, from: [f64; 2], to: [f64; 2], color: [f64; 3], inside: impl Fn([f64; 2]) -> bool) {
    let length = (to[0] - from[0]).hypot(to[1] - from[1]).max(1.0);
    let at = |s: f64| [0, 1].map(|k: usize| from[k] + (to[k] - from[k]) * (s / length).min(1.0));
    let mut s = 0.0;
    while s < length {
        let ends = [at(s), at(s + 6.0)];
        if ends.iter().all(|end| inside(*end)) {
            shapes.push(Shape::Line { from: ends[0], to: ends[1], width: 1.5, color });
        }
        s += 11.0;
    }
}

/// A line with soft edges: pixels are covered by how near their centre is.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "places in the picture")]
fn line(image: &mut RgbImage, a: [f64; 2], b: [f64; 2], width: f64, color: [f64; 3]) {
    let reach = 0.5 * width + 1.0;
    let range = |k: usize, most: u32| {
        let low = (a[k].min(b[k]) - reach).max(0.0) as u32;
        let high = (a[k].max(b[k]) + reach).clamp(0.0, f64::from(most)) as u32;
        low..high
    };
    let along = [b[0] - a[0], b[1] - a[1]];
    let squared = along[0].mul_add(along[0], along[1] * along[1]).max(1e-9);
    for y in range(1, image.height()) {
        for x in range(0, image.width()) {
            let from = [f64::from(x) + 0.5 - a[0], f64::from(y) + 0.5 - a[1]];
            let t = (from[0].mul_add(along[0], from[1] * along[1]) / squared).clamp(0.0, 1.0);
            let distance = (from[0] - t * along[0]).hypot(from[1] - t * along[1]);
            let cover = (0.5 * width + 0.5 - distance).clamp(0.0, 1.0);
            if cover > 0.0 {
                let below = image.get_pixel(x, y).0.map(|v| f64::from(v) / 255.0);
                image.put_pixel(x, y, paint::pixel(paint::mix(below, color, cover)));
            }
        }
    }
}
