// SPDX-License-Identifier: Apache-2.0
//! Many samples in a pixel: errors keep falling as fast as they should.

use glam::{DMat4, DVec3};

use crate::build::{Body, Placed, World};
use crate::lab::{Found, Lab, mean};
use crate::shot::Way;
use crate::tracer::camera::Eye;

pub(crate) fn run(lab: &mut Lab<'_>) {
    lab.case("time/samples of one pixel", slope);
}

/// A white floor beside a black wall, as far from it as it is high: of the sky's light, that of (1 + cos 45 degrees) /
/// 2 is left.
fn slope(lab: &mut Lab<'_>, case: &str) {
    let long = 1e4;
    let floor = Placed { body: Body::square(1.0), place: DMat4::from_scale(DVec3::splat(long)) };
    let points = [(0.0, -1.0), (0.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
        .map(|(y, z)| crate::build::narrow(DVec3::new(-1.0, y, z * long)));
    let wall = Body { points: points.to_vec(), faces: vec![vec![0, 1, 2, 3]], albedo: 0.0 };
    let world = World { bodies: vec![floor, Placed { body: wall, place: DMat4::IDENTITY }], dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    let eye = Eye::parallel(DVec3::new(0.0, 0.5, 0.0), DVec3::ZERO, 1e-5, [8, 8]);
    let camera = Eye { up: DVec3::X, ..eye }.camera();
    let expected = 0.5 * (1.0 + 0.5_f64.sqrt());
    let last = lab.amount(13, 24);
    let (mut points, mut end) = (Vec::new(), (0.0, 0.0));
    for k in 4..=last {
        let shot = lab.shoot(case, &stage, &camera, &Way { samples: 1 << k, ..Way::default() });
        let squares: f64 = shot.color.iter().map(|c| (f64::from(c[0]) - expected).powi(2)).sum();
        let rms = (squares / 64.0).sqrt();
        points.push((f64::from(k), rms.log2()));
        end = (rms, mean(&shot));
    }
    #[expect(clippy::cast_precision_loss, reason = "few")]
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(x, y), p| (x + p.0 / n, y + p.1 / n));
    let (xy, xx) =
        points.iter().fold((0.0, 0.0), |(xy, xx), p| (xy + (p.0 - mx) * (p.1 - my), xx + (p.0 - mx).powi(2)));
    let slope = xy / xx;
    // Sobol points fall faster; what matters is that they do not stop.
    let error = (slope + 0.5).max(0.0);
    let quantity = format!("slope of the rms error from 2^4 to 2^{last} samples, at most");
    lab.row(case, &Found { quantity: &quantity, reference: -0.5, got: slope, error, bound: 0.02 }, None);
    let deviation = (expected * (1.0 - expected) / 2.0_f64.powf(f64::from(last))).sqrt();
    let quantity = format!("rms error after 2^{last} samples");
    lab.row(
        case,
        &Found { quantity: &quantity, reference: 0.0, got: end.0, error: end.0, bound: deviation + 2e-7 },
        None,
    );
    lab.number(case, "mean of 64 pixels then", expected, end.1, 3.0 * deviation / 8.0 + 2e-7);
}
