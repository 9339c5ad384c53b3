// SPDX-License-Identifier: Apache-2.0
//! What all cases do: render, compare with the f64 tracer, write rows. Whatever a render does wrong by itself (NaN,
//! hang, error) is a row too.

use std::time::Instant;

use oocpt_core::camera::Camera;

use crate::Options;
use crate::shot::{Bench, Shot, Stage, Way};
use crate::table::{Row, Table};
use crate::tracer::camera::Eye;
use crate::tracer::{Estimate, Tracer};

/// Distance between neighbouring floats, relative, at most.
pub(crate) const ULP: f64 = 1.0 / 8_388_608.0;

/// The run so far.
pub(crate) struct Lab<'a> {
    pub(crate) options: &'a Options,
    pub(crate) bench: Bench,
    pub(crate) table: Table,
    pub(crate) renders: u64,
    nonfinite: u64,
    hung: u64,
    errors: u64,
}

/// A quantity, before its verdict.
pub(crate) struct Found<'a> {
    pub(crate) quantity: &'a str,
    pub(crate) reference: f64,
    pub(crate) got: f64,
    pub(crate) error: f64,
    pub(crate) bound: f64,
}

/// A miss that is known: how large it may be, and why it is there.
pub(crate) type Known<'a> = Option<(f64, &'a str)>;

/// A case that is known to miss in what is compared with the f64 tracer: how far off it may be, and why.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Miss {
    pub(crate) ulps: f64,
    pub(crate) wrong_pixels: f64,
    pub(crate) sigmas: f64,
    pub(crate) why: &'static str,
}

/// How a picture of distances compares.
pub(crate) struct Distances {
    /// Largest error across the surface, in ulps of the distance.
    pub(crate) ulps: f64,
    /// Pixels that show what no ray near their centre meets.
    pub(crate) wrong: u32,
    /// Pixels that show something.
    pub(crate) hits: u32,
}

impl<'a> Lab<'a> {
    pub(crate) fn new(options: &'a Options) -> Self {
        let bench = Bench { device: options.device.clone(), validation: options.validation };
        Self { options, bench, table: Table::default(), renders: 0, nonfinite: 0, hung: 0, errors: 0 }
    }

    /// Whether the case is wanted; says on standard error that it begins.
    pub(crate) fn wants(&self, case: &str) -> bool {
        self.options.filter.as_deref().is_none_or(|part| case.contains(part))
    }

    /// Runs a case if it is wanted.
    #[expect(clippy::print_stderr, reason = "progress of a long run")]
    pub(crate) fn case(&mut self, name: &str, run: impl FnOnce(&mut Self, &str)) {
        if !self.wants(name) {
            return;
        }
        let started = Instant::now();
        run(self, name);
        eprintln!("{name}: {:.2} s", started.elapsed().as_secs_f64());
    }

    /// `few` by default, `many` where all was asked for.
    pub(crate) fn amount(&self, few: u32, many: u32) -> u32 {
        if self.options.full { many } else { few }
    }

    pub(crate) fn row(&mut self, case: &str, found: &Found<'_>, known: Known<'_>) {
        let row = Row {
            case: case.to_owned(),
            quantity: found.quantity.to_owned(),
            reference: found.reference,
            got: found.got,
            error: found.error,
            bound: found.bound,
            known: known.map(|known| known.0),
            note: known.map(|known| known.1.to_owned()).unwrap_or_default(),
        };
        self.table.rows.push(row);
    }

    /// A row about a number and what it should be, absolute error.
    pub(crate) fn number(&mut self, case: &str, quantity: &str, reference: f64, got: f64, bound: f64) {
        self.row(case, &Found { quantity, reference, got, error: (got - reference).abs(), bound }, None);
    }

    /// A row about something that should not happen, so many times.
    pub(crate) fn count(&mut self, case: &str, quantity: &str, got: f64, known: Known<'_>) {
        self.row(case, &Found { quantity, reference: 0.0, got, error: got.abs(), bound: 0.0 }, known);
    }

    /// A row about a mean radiance, error relative.
    pub(crate) fn mean(
        &mut self,
        case: &str,
        quantity: &str,
        reference: f64,
        shot: &Shot,
        bound: f64,
        known: Known<'_>,
    ) {
        let got = mean(shot);
        let error = (got / reference - 1.0).abs();
        let found = Found { quantity, reference, got, error, bound };
        self.row(case, &found, known.filter(|_| error > bound));
    }

    /// Renders; NaN, hangs, errors, and warnings where none are expected, become rows.
    pub(crate) fn shoot(&mut self, case: &str, stage: &Stage, camera: &Camera, way: &Way) -> Shot {
        let shot = self.shoot_warned(case, stage, camera, way);
        if !shot.warnings.is_empty() {
            let note = shot.warnings.join("; ");
            self.row(
                case,
                &Found { quantity: "warnings", reference: 0.0, got: 1.0, error: 1.0, bound: 0.0 },
                Some((0.0, &note)),
            );
        }
        shot
    }

    /// The same, where warnings are expected.
    pub(crate) fn shoot_warned(&mut self, case: &str, stage: &Stage, camera: &Camera, way: &Way) -> Shot {
        let shot = stage.take(camera, way);
        self.renders += 1;
        self.nonfinite += shot.nonfinite;
        self.errors += shot.errors.len() as u64;
        self.hung += u64::from(shot.hung);
        #[expect(clippy::cast_precision_loss, reason = "a count for people")]
        let numbers = [("NaN or Inf", shot.nonfinite as f64), ("hangs", f64::from(u8::from(shot.hung)))];
        for (quantity, got) in numbers.into_iter().filter(|(_, got)| *got > 0.0) {
            self.count(case, quantity, got, None);
        }
        if !shot.errors.is_empty() {
            let note = shot.errors.join("; ");
            self.row(
                case,
                &Found { quantity: "errors", reference: 0.0, got: 1.0, error: 1.0, bound: 0.0 },
                Some((0.0, &note)),
            );
        }
        if self.table.device.is_empty() {
            self.table.device.clone_from(&shot.device);
        }
        shot
    }

    /// Totals of the whole run.
    #[expect(clippy::cast_precision_loss, reason = "counts for people")]
    pub(crate) fn finish(mut self) -> Table {
        let renders = self.renders as f64;
        let all = [("NaN or Inf in all renders", self.nonfinite), ("hangs", self.hung), ("errors", self.errors)];
        for (quantity, count) in all {
            self.count("all", quantity, count as f64, None);
        }
        self.number("all", "renders that came back", renders, renders - self.hung as f64, 0.0);
        self.table
    }

    /// Rows about distances and what is seen where, against the f64 tracer.
    pub(crate) fn distances(
        &mut self,
        case: &str,
        tracer: &Tracer,
        eye: &Eye,
        shot: &Shot,
        ulps: f64,
        miss: Option<Miss>,
    ) {
        let known = |of: fn(&Miss) -> f64| miss.map(|miss| (of(&miss), miss.why));
        let d = distances(tracer, eye, shot, ulps.max(16.0));
        let found = Found { quantity: "distance, ulps", reference: 0.0, got: d.ulps, error: d.ulps, bound: ulps };
        self.row(case, &found, known(|m| m.ulps).filter(|_| d.ulps > ulps));
        self.count(case, "wrong pixels", f64::from(d.wrong), known(|m| m.wrong_pixels).filter(|_| d.wrong > 0));
        let some = if d.hits > 0 { 0.0 } else { 1.0 };
        if some > 0.0 {
            self.row(
                case,
                &Found { quantity: "pixels that show it", reference: 1.0, got: 0.0, error: some, bound: 0.0 },
                known(|_| 1.0),
            );
        }
    }

    /// A row about light: the largest deviation of a block of 8 x 8 pixels from the f64 tracer, in standard deviations.
    pub(crate) fn light(
        &mut self,
        case: &str,
        reference: &Estimate,
        eye: &Eye,
        shot: &Shot,
        way: &Way,
        miss: Option<Miss>,
    ) {
        let known = miss.map(|miss| (miss.sigmas, miss.why));
        let (worst, expected, got) = worst_block(reference, eye, shot, way);
        let found = Found {
            quantity: "radiance of the worst block, sigmas",
            reference: expected,
            got,
            error: worst,
            bound: 5.0,
        };
        self.row(case, &found, known.filter(|_| worst > 5.0));
    }
}

/// Mean of the red channel.
pub(crate) fn mean(shot: &Shot) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "pixels of a small image")]
    let pixels = shot.color.len() as f64;
    shot.color.iter().map(|color| f64::from(color[0])).sum::<f64>() / pixels
}

/// Rays this far beside a pixel's centre, in pixels, tell whether it is on an edge; farther where distances may be off
/// by more.
const BESIDE: f64 = 0.02;

/// Compares distances through pixel centres. `edge`: pixels that are off by more than so many ulps are looked at for
/// edges.
pub(crate) fn distances(tracer: &Tracer, eye: &Eye, shot: &Shot, edge: f64) -> Distances {
    let mut result = Distances { ulps: 0.0, wrong: 0, hits: 0 };
    let beside = BESIDE.max(2.0 * edge * ULP / eye.pixel());
    for (pixel, (&distance, &prim)) in (0_u32..).zip(shot.distance.iter().zip(&shot.prim)) {
        let (x, y) = (f64::from(pixel % eye.size[0]) + 0.5, f64::from(pixel / eye.size[0]) + 0.5);
        let met = tracer.first(&eye.ray(x, y));
        let seen = prim >= 0;
        result.hits += u32::from(seen);
        let off = match met {
            Some(met) if seen => (f64::from(distance) / met.t - 1.0).abs() * met.cosine / ULP,
            None if !seen => 0.0,
            _ => f64::INFINITY,
        };
        if off <= edge {
            result.ulps = result.ulps.max(off);
            continue;
        }
        // What is seen a little beside it: nothing, or distances between these.
        let (mut nothing, mut least, mut most) = (met.is_none(), f64::INFINITY, f64::NEG_INFINITY);
        for (dx, dy) in [(beside, 0.0), (-beside, 0.0), (0.0, beside), (0.0, -beside)] {
            match tracer.first(&eye.ray(x + dx, y + dy)) {
                Some(near) => (least, most) = (least.min(near.t), most.max(near.t)),
                None => nothing = true,
            }
        }
        let jump = nothing || most - least > 1e-2 * most;
        // At a silhouette the surface runs away from the eye.
        let slack = if nothing { 0.05 } else { 1e-5 };
        let between = (least * (1.0 - slack)..=most * (1.0 + slack)).contains(&f64::from(distance));
        if seen && !jump && off.is_finite() {
            // No edge: just wrong by that much.
            result.ulps = result.ulps.max(off);
        } else if seen && !between || !seen && !nothing {
            result.wrong += 1;
        }
    }
    result
}

/// The largest |z| of blocks of 8 x 8 pixels, what the block should be and what it is.
fn worst_block(reference: &Estimate, eye: &Eye, shot: &Shot, way: &Way) -> (f64, f64, f64) {
    let [width, height] = eye.size;
    let mut worst = (0.0, 0.0, 0.0);
    for top in (0..height).step_by(8) {
        for left in (0..width).step_by(8) {
            let (mut expected, mut got, mut variance, mut pixels, mut squares) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for y in top..height.min(top + 8) {
                for x in left..width.min(left + 8) {
                    // Images of cases are small.
                    let at = (y * width + x) as usize;
                    let (Some(mean), Some(own), Some(color)) =
                        (reference.mean.get(at), reference.variance.get(at), shot.color.get(at))
                    else {
                        continue;
                    };
                    expected += mean;
                    got += f64::from(color[0]);
                    squares += (f64::from(color[0]) - mean).powi(2);
                    // The renderer chooses one light at a time, the tracer asks all: up to three times the variance.
                    variance += own * (1.0 / f64::from(reference.samples) + 3.0 / f64::from(way.samples));
                    pixels += 1.0;
                }
            }
            let least = 1e-5 * expected;
            // Where each light alone has no noise, all there is comes from that choice: the pixels tell how much.
            let scatter = (squares - (got - expected).powi(2) / pixels) * pixels / (pixels - 1.0_f64).max(1.0);
            let z = (got - expected).abs() / (variance.max(scatter) + least * least).sqrt().max(f64::MIN_POSITIVE);
            if z > worst.0 || z.is_nan() {
                worst = (z, expected / pixels, got / pixels);
            }
        }
    }
    worst
}
