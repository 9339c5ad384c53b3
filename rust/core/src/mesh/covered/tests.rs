// SPDX-License-Identifier: Apache-2.0
//! Checks that every part of a triangle that a ray can meet lies in its box, with the arithmetic of the shaders.

#![expect(clippy::cast_possible_truncation, reason = "single precision, as the shaders")]

use super::*;
use crate::texture::tests_of_covered::{Files, Random, any_cut, any_picture};

fn vertices(random: &mut Random) -> [[f32; 3]; 3] {
    let is_flat = random.one_of([true, false]);
    let mut vertex = || [0, 1, 2].map(|k| if is_flat && k == 2 { 0.25 } else { random.between(-3.0, 3.0) as f32 });
    [vertex(), vertex(), vertex()]
}

/// Barycentric weights in a triangle, corners and edges too.
fn weights(random: &mut Random) -> [f32; 2] {
    let inner = [random.between(0.0, 1.0), random.between(0.0, 1.0)];
    let u = random.one_of([0.0, 1.0, inner[0]]);
    let v = random.one_of([0.0, 1.0, inner[1]]) * (1.0 - u);
    [u as f32, v as f32]
}

fn holds(bounds: &Aabb, vertices: &[[f32; 3]; 3], [u, v]: [f32; 2]) -> bool {
    let weights = [1.0 - f64::from(u) - f64::from(v), u.into(), v.into()];
    (0..3).all(|k| {
        let at = (0..3).map(|i| weights[i] * f64::from(vertices[i][k])).sum::<f64>();
        f64::from(bounds.min[k]) - 1.0e-6 <= at && at <= f64::from(bounds.max[k]) + 1.0e-6
    })
}

#[test]
fn boxes_hold_what_a_texture_leaves_of_triangles() {
    let mut random = Random(2);
    let (mut met, mut smaller, mut nothing) = (0, 0, 0);
    for _ in 0..400 {
        let (image, picture) = (any_cut(&mut random, "a"), any_picture(&mut random));
        let Some(covered) = CoveredImage::read(&image, &Files(vec![(0, picture.clone())])) else { continue };
        let query = image.query(image.texture.wrap);
        for _ in 0..12 {
            let far = random.one_of([0.1, 0.5, 30.0]);
            let near = random.one_of([0.0, 0.02, 0.5, 1.0, 4.0]);
            let from = [random.between(-far, far), random.between(-far, far)];
            let corner = [(); 3].map(|()| from.map(|at| (at + random.between(0.0, near)) as f32));
            let rows = [(); 2].map(|()| [(); 3].map(|()| random.between(-2.0, 2.0) as f32));
            let rows = random.one_of([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], rows]);
            let places = corner.map(|[s, t]| rows.map(|[a, b, c]| [a * s, b * t, c].map(f64::from)));
            let (polygon, vertices) = (in_image(&covered, places), vertices(&mut random));
            let bounds = polygon.bounds(&vertices);
            nothing += i32::from(polygon.count == 0);
            smaller += i32::from(!polygon.is_whole());
            for _ in 0..60 {
                let [u, v] = weights(&mut random);
                let st = [0, 1].map(|k| corner[0][k] * (1.0 - u - v) + corner[1][k] * u + corner[2][k] * v);
                let place = rows.map(|[a, b, c]| f64::from(a * st[0] + b * st[1] + c));
                if picture.share(&query, place) > 0.0 {
                    met += 1;
                    assert!(holds(&bounds, &vertices, [u, v]), "{image:?} {corner:?} {rows:?} {u} {v}: {polygon:?}");
                }
            }
        }
    }
    assert!(met > 20_000 && smaller > 800 && nothing > 300, "all of it was tried: {met} {smaller} {nothing}");
}

#[test]
fn boxes_hold_what_a_primvar_leaves_of_triangles() {
    let mut random = Random(3);
    let (mut met, mut smaller, mut nothing) = (0, 0, 0);
    for _ in 0..4000 {
        let high = random.one_of([0.0, 0.4, 1.0, 1.0e6]);
        let inner = [(); 3].map(|()| random.between(-high, high));
        let values = inner.map(|inner| random.one_of([0.0, 0.5, inner]) as f32);
        let threshold = random.one_of([0.0, 0.0, 0.5, 0.2, 0.5001]) as f32;
        let (polygon, vertices) = (above(values.map(f64::from), threshold.into()), vertices(&mut random));
        nothing += i32::from(polygon.count == 0);
        smaller += i32::from(!polygon.is_whole());
        for _ in 0..20 {
            let [u, v] = weights(&mut random);
            let value = values[0] * (1.0 - u - v) + values[1] * u + values[2] * v;
            if (threshold > 0.0 && value >= threshold) || (threshold <= 0.0 && value > 0.0) {
                met += 1;
                let bounds = polygon.bounds(&vertices);
                assert!(holds(&bounds, &vertices, [u, v]), "{values:?} {threshold} {u} {v}: {polygon:?}");
            }
        }
    }
    assert!(met > 10_000 && smaller > 1000 && nothing > 300, "all of it was tried: {met} {smaller} {nothing}");
}

#[test]
fn what_is_not_known_is_whole() {
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    for values in [[nan, 0.0, 0.0], [0.0, inf, 0.0], [0.0, 0.0, -inf]] {
        assert!(above(values, 0.5).is_whole(), "{values:?}");
    }
    let picture = crate::texture::tests_of_covered::Picture::new([16, 16], |[s, _]| f64::from(u8::from(s < 0.2)));
    let image = crate::texture::tests_of_covered::cut("a", [crate::texture::Wrap::Repeat; 2], [1.0, 0.0, 0.5], 0.0);
    let covered = CoveredImage::read(&image, &Files(vec![(0, picture)])).expect("something is cut out");
    for bad in [nan, inf, -inf, 1.0e30, 3.0e38, 1.0e6, 40.0] {
        let places = [[[bad, 0.0, 0.0], [0.0; 3]], [[0.0; 3], [0.0; 3]], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]];
        assert!(in_image(&covered, places).is_whole(), "{bad}");
    }
    // All of the triangle is at one position.
    for (s, count) in [(0.1, 3), (0.7, 0)] {
        assert_eq!(in_image(&covered, [[[s, 0.0, 0.0], [0.0, 0.3, 0.0]]; 3]).count, count, "{s}");
    }
    assert_eq!((above([0.4; 3], 0.5).count, above([0.5; 3], 0.5).count, above([0.0; 3], 0.0).count), (0, 3, 0));
}
