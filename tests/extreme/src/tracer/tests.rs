// SPDX-License-Identifier: Apache-2.0
//! The tracer against closed forms.

use super::bvh::{Bvh, Ray};
use super::camera::Eye;
use super::random::Random;
use super::{Sun, Tracer};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_3, PI};

/// A square of half side `r` in y = 0.
fn square(r: f64, y: f64, albedo: f64) -> Vec<([DVec3; 3], f64)> {
    let p = |x: f64, z: f64| DVec3::new(x * r, y, z * r);
    let (a, b, c, d) = (p(-1.0, 1.0), p(1.0, 1.0), p(1.0, -1.0), p(-1.0, -1.0));
    vec![([a, b, c], albedo), ([a, c, d], albedo)]
}

/// A box of half side 1, seen from inside or outside.
fn cube(albedo: f64) -> Vec<([DVec3; 3], f64)> {
    let corner = |i: usize| DVec3::from_array([0, 1, 2].map(|k| if i >> k & 1 == 1 { 1.0 } else { -1.0 }));
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = |f: [usize; 4]| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]];
    faces.into_iter().flat_map(triangles).map(|t| (t.map(corner), albedo)).collect()
}

fn mean(values: &[f64]) -> f64 {
    #[expect(clippy::cast_precision_loss, reason = "few")]
    let count = values.len() as f64;
    values.iter().sum::<f64>() / count
}

#[test]
fn a_tree_finds_what_trying_all_finds() {
    let mut random = Random::new(3, 1);
    let mut point = |size: f64| DVec3::from_array([0; 3].map(|_| size * (random.uniform() - 0.5)));
    let mut corners = Vec::new();
    for _ in 0..300 {
        let at = point(4.0);
        corners.push([0; 3].map(|_| at + point(1.5)));
    }
    let bvh = Bvh::new(corners.clone());
    let mut hits = 0;
    for _ in 0..2000 {
        let ray = Ray { o: point(6.0), d: point(2.0) };
        let each = corners.iter().map(|c| Bvh::new(vec![*c]).nearest(&ray, f64::INFINITY, None));
        let expected = each.flatten().map(|hit| hit.t).fold(f64::INFINITY, f64::min);
        let found = bvh.nearest(&ray, f64::INFINITY, None).map_or(f64::INFINITY, |hit| hit.t);
        assert_eq!(found.to_bits(), expected.to_bits(), "{ray:?}");
        hits += u32::from(found.is_finite());
    }
    assert!(hits > 500, "rays that meet nothing show nothing: {hits}");
}

#[test]
fn distances_match_planes() {
    let tracer = Tracer::new(square(10.0, 0.0, 1.0));
    let eye = Eye::at(DVec3::new(0.0, 3.0, 4.0), DVec3::ZERO, 0.5, [8, 8]);
    for (x, y) in [(0.5, 0.5), (4.0, 4.0), (7.0, 2.0)] {
        let ray = eye.ray(x, y);
        let hit = tracer.first(&ray).expect("the plane is in view");
        assert!((hit.t + 3.0 / ray.d.y).abs() < 1e-13, "plane y = 0 from height 3: {}", hit.t);
        assert!((hit.cosine + ray.d.normalize().y).abs() < 1e-13, "cosine to the normal");
    }
}

#[test]
fn a_floor_under_a_dome_and_a_sun() {
    let mut tracer = Tracer::new(square(1e6, 0.0, 0.5));
    let eye = Eye::at(DVec3::new(0.0, 2.0, 1.0), DVec3::ZERO, 0.2, [4, 4]);
    tracer.dome = 2.0;
    let values = tracer.render(&eye, 16, 4, true).mean;
    assert!(values.iter().all(|v| (v - 1.0).abs() < 1e-12), "albedo times dome: {values:?}");
    tracer.dome = 0.0;
    let direction = DVec3::new(0.0, FRAC_PI_3.cos(), FRAC_PI_3.sin());
    tracer.suns = vec![Sun { direction, irradiance: 3.0, one_minus_cos: 0.0 }];
    let values = tracer.render(&eye, 4, 4, true).mean;
    assert!(values.iter().all(|v| (v - 0.5 / PI * 3.0 * 0.5).abs() < 1e-12), "E cos / pi: {values:?}");
    // A cone of half angle 20 degrees: irradiance is that of its axis exactly while it is above the horizon.
    tracer.suns[0].one_minus_cos = 1.0 - 20.0_f64.to_radians().cos();
    let value = mean(&tracer.render(&eye, 4096, 4, true).mean);
    assert!((value - 0.5 / PI * 1.5).abs() < 1e-3 * value, "{value}");
}

#[test]
fn inside_a_box_light_is_a_geometric_series() {
    // A dome does not get in: a closed box is black, and a white one in white is gone.
    let mut tracer = Tracer::new(cube(0.7));
    tracer.dome = 1.0;
    let inside = Eye::at(DVec3::ZERO, DVec3::new(0.3, -0.2, -1.0), 1.5, [8, 8]);
    let black = tracer.render(&inside, 64, 100, true).mean;
    assert!(black.iter().all(|v| *v <= 0.0), "light got into a closed box: {black:?}");
    let mut white = Tracer::new(cube(1.0));
    white.dome = 1.0;
    let outside = Eye::at(DVec3::new(3.0, 2.0, 4.0), DVec3::ZERO, 0.8, [8, 8]);
    let values = white.render(&outside, 64, 100, true).mean;
    assert!(values.iter().all(|v| (v - 1.0).abs() < 1e-12), "a white box in white: {values:?}");
}

#[test]
fn a_wall_hides_half_of_the_sky() {
    // Beside an endless wall a floor sees half of the sky: with a black wall, half of the light.
    let mut triangles = square(1e6, 0.0, 1.0);
    let p = |y: f64, z: f64| DVec3::new(-1e-3, y * 1e6, z * 1e6);
    triangles.push(([p(0.0, -1.0), p(0.0, 1.0), p(1.0, 1.0)], 0.0));
    triangles.push(([p(0.0, -1.0), p(1.0, 1.0), p(1.0, -1.0)], 0.0));
    let mut tracer = Tracer::new(triangles);
    tracer.dome = 1.0;
    let eye = Eye { up: DVec3::X, ..Eye::parallel(DVec3::Y * 0.5, DVec3::ZERO, 1e-4, [4, 4]) };
    let estimate = tracer.render(&eye, 4096, 0, true);
    let value = mean(&estimate.mean);
    assert!((value - 0.5).abs() < 1e-2, "{value}");
    assert!((mean(&estimate.variance) - 0.25).abs() < 1e-2, "a coin's variance: {:?}", estimate.variance);
}
