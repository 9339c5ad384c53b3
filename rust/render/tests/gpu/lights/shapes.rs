// SPDX-License-Identifier: Apache-2.0
//! Shapes: closed forms, and sums over the surface in f64 for shapes that have none.

use super::{cylinder, disk, downwards, expect, irradiances, light, rect, sphere};
use glam::{DMat3, DMat4, DQuat, DVec3};
use oocpt_core::{LightDesc, LightKind};
use std::f64::consts::{PI, TAU};

/// Lambert's formula (1760; Arvo 1995, eq. 2.10): irradiance at the origin, facing up, of a polygon of radiance 1, seen
/// counterclockwise from its shining side.
pub(super) fn polygon(corners: &[DVec3]) -> f64 {
    let mut sum = 0.0;
    for (k, a) in corners.iter().enumerate() {
        let b = corners[(k + 1) % corners.len()];
        let (a, b) = (a.normalize(), b.normalize());
        sum += a.dot(b).acos() * a.cross(b).normalize().y;
    }
    0.5 * sum.abs()
}

/// Irradiance at the origin, facing up, of the surface `point(u, v)` of radiance 1, by midpoints: parts that face away,
/// and those below the floor, contribute nothing. `normal` need not be unit.
fn surface(m: &DMat3, at: DVec3, u: (f64, f64), point: impl Fn(f64, f64) -> (DVec3, DVec3, f64)) -> f64 {
    const STEPS: u32 = 1000;
    let cofactor = DMat3::from_cols(m.y_axis.cross(m.z_axis), m.z_axis.cross(m.x_axis), m.x_axis.cross(m.y_axis));
    let sign = m.determinant().signum();
    let (du, dv) = ((u.1 - u.0) / f64::from(STEPS), TAU / f64::from(STEPS));
    let mut sum = 0.0;
    for i in 0..STEPS {
        for j in 0..STEPS {
            let (q, n, jacobian) = point(u.0 + (f64::from(i) + 0.5) * du, (f64::from(j) + 0.5) * dv);
            let p = at + *m * q;
            let area = cofactor * n * sign;
            let distance = p.length();
            let w = p / distance;
            let cosine = -area.dot(w);
            if cosine > 0.0 && w.y > 0.0 {
                sum += w.y * cosine / (distance * distance) * jacobian;
            }
        }
    }
    sum * du * dv
}

fn cylinder_reference(m: &DMat3, at: DVec3) -> f64 {
    surface(m, at, (-1.0, 1.0), |x, phi| {
        let n = DVec3::new(0.0, phi.cos(), phi.sin());
        (DVec3::new(x, n.y, n.z), n, 1.0)
    })
}

fn ellipsoid_reference(m: &DMat3, at: DVec3) -> f64 {
    surface(m, at, (-1.0, 1.0), |z, phi| {
        let r = (1.0 - z * z).sqrt();
        let n = DVec3::new(r * phi.cos(), r * phi.sin(), z);
        (n, n, 1.0)
    })
}

#[test]
fn sphere_light_irradiance_matches_its_closed_form() {
    for (at, radius) in
        [(DVec3::new(0.0, 2.0, 0.0), 0.5), (DVec3::new(1.0, 2.0, -0.5), 0.75), (DVec3::new(0.0, 50.0, 0.0), 0.01)]
    {
        let d = at.length();
        let expected = PI * f64::from(radius).powi(2) / (d * d) * (at.y / d);
        let light = light(sphere(radius), DMat4::from_translation(at));
        expect(&format!("sphere at {at}"), 256, expected, 3e-3, &|db| db.upsert_light(light.clone()));
    }
}

#[test]
fn disk_light_irradiance_matches_its_closed_form() {
    for (height, radius) in [(2.0, 0.5), (0.5, 1.0), (1.0, 8.0)] {
        let expected = PI * radius * radius / (radius * radius + height * height);
        #[expect(clippy::cast_possible_truncation, reason = "small numbers")]
        let light = light(disk(radius as f32), downwards(DVec3::Y * height));
        expect(&format!("disk of {radius} at {height}"), 1024, expected, 5e-3, &|db| db.upsert_light(light.clone()));
    }
}

#[test]
fn rect_lights_match_polygon_irradiance_under_any_affine_map() {
    let shear =
        DMat4::from_cols_array(&[1.0, 0.2, 0.1, 0.0, 0.5, 1.0, 0.0, 0.0, 0.0, 0.3, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let stretch = DMat4::from_scale(DVec3::new(2.0, 0.5, -3.0));
    let places = [
        downwards(DVec3::Y * 2.0),
        downwards(DVec3::new(0.5, 1.0, 0.3)) * DMat4::from_rotation_y(0.4),
        downwards(DVec3::new(-0.5, 1.5, 0.0)) * DMat4::from_scale(DVec3::new(3.0, 0.4, 1.0)),
        downwards(DVec3::new(0.2, 1.5, 0.0)) * shear,
        downwards(DVec3::new(0.2, 1.5, 0.0)) * DMat4::from_rotation_x(PI) * stretch,
    ];
    for (k, place) in places.into_iter().enumerate() {
        let corner = |x: f64, y: f64| place.transform_point3(DVec3::new(0.5 * x, 0.75 * y, 0.0));
        let expected = polygon(&[corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)]);
        expect(&format!("rect {k}"), 1024, expected, 5e-3, &|db| db.upsert_light(light(rect(1.0, 1.5), place)));
    }
}

#[test]
fn cylinders_agree_with_a_sum_over_their_surface() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.4);
    for (scale, at) in [(DVec3::ONE, DVec3::new(0.0, 1.0, 0.0)), (DVec3::new(1.5, 0.5, 2.0), DVec3::new(0.5, 1.2, 0.3))]
    {
        let place = DMat4::from_scale_rotation_translation(scale, turn, at);
        let m = DMat3::from_mat4(place) * DMat3::from_diagonal(DVec3::new(1.0, 0.25, 0.25));
        let expected = cylinder_reference(&m, at);
        let kind = cylinder(2.0, 0.25);
        expect("cylinder", 1024, expected, 5e-3, &|db| db.upsert_light(light(kind.clone(), place)));
    }
}

#[test]
fn ellipsoids_agree_with_a_sum_over_their_surface() {
    let turn = DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 0.5, 0.4);
    for scale in [DVec3::new(2.0, 0.5, 1.0), DVec3::new(-1.0, 0.2, 1.5)] {
        let at = DVec3::new(0.4, 1.5, -0.2);
        let place = DMat4::from_scale_rotation_translation(scale, turn, at);
        let expected = ellipsoid_reference(&(DMat3::from_mat4(place) * 0.5), at);
        expect("ellipsoid", 1024, expected, 5e-3, &|db| db.upsert_light(light(sphere(0.5), place)));
    }
}

#[test]
fn normalised_lights_are_divided_by_their_area() {
    let scale = DMat4::from_scale(DVec3::new(2.0, 3.0, 1.0));
    for (kind, area) in [(rect(1.0, 1.5), 9.0), (disk(0.5), PI * 1.5), (sphere(0.5), 0.0)] {
        let uniform = matches!(kind, LightKind::Sphere { .. });
        let place = downwards(DVec3::Y * 4.0) * if uniform { DMat4::from_scale(DVec3::splat(2.0)) } else { scale };
        let area = if uniform { 4.0 * PI } else { area };
        let plain = light(kind, place);
        let normalized = LightDesc { normalize: true, ..plain.clone() };
        let [a, b] = [plain, normalized].map(|light| irradiances(256, &|db| db.upsert_light(light.clone()))[1][0]);
        assert!((a / b / area - 1.0).abs() < 1e-3, "the ratio is {}, not {area}", a / b);
    }
}

#[test]
fn points_and_lines_have_the_power_of_small_bodies() {
    let at = DVec3::new(0.3, 2.0, 0.0);
    let point = light(LightKind::Sphere { radius: 0.5, treat_as_point: true }, DMat4::from_translation(at));
    let d = at.length();
    expect("point", 16, PI * 0.25 / (d * d) * at.y / d, 1e-4, &|db| db.upsert_light(point.clone()));
    // A line along x at height h: 2 r L times the integral of sin(alpha) cos(theta) / d^2 = h^2 / (x^2 + h^2)^2.
    let line = light(
        LightKind::Cylinder { length: 2.0, radius: 0.05, treat_as_line: true },
        DMat4::from_translation(DVec3::Y),
    );
    let primitive = |x: f64| 0.5 * (x / (x * x + 1.0) + x.atan());
    expect("line", 256, 0.1 * 2.0 * primitive(1.0), 2e-3, &|db| db.upsert_light(line.clone()));
}

#[test]
fn lights_shine_to_one_side_and_outwards_only() {
    let upwards = |y: f64| DMat4::from_translation(DVec3::Y * y) * DMat4::from_rotation_x(PI / 2.0);
    for (what, kind, place) in [
        ("a rect that looks away", rect(1.0, 1.0), upwards(1.0)),
        ("a disk that looks away", disk(1.0), upwards(1.0)),
        ("a rect below the floor", rect(1.0, 1.0), downwards(DVec3::NEG_Y)),
        // The light is not in the middle, where every direction is along the normal.
        ("inside a sphere", sphere(2.0), DMat4::from_translation(DVec3::new(0.5, 0.7, -0.3))),
        ("inside a cylinder", cylinder(4.0, 2.0), DMat4::from_translation(DVec3::new(0.5, 0.7, -0.3))),
    ] {
        expect(what, 16, 0.0, 0.0, &|db| db.upsert_light(light(kind.clone(), place)));
    }
}

#[test]
fn lights_far_from_the_origin_stay_exact() {
    let far = DVec3::new(3.0e6, -1.0e6, 2.0e6);
    let session = crate::support::session(crate::support::settings(64, 1));
    session.with_scene(|db| {
        db.upsert_mesh(crate::scenes::square(
            crate::scenes::prim("/floor", DMat4::from_translation(far)),
            1,
            super::ALBEDO,
        ));
        db.upsert_light(light(sphere(0.01), DMat4::from_translation(far + DVec3::Y * 0.2)));
        // Another mesh is as far on the other side, so that the scene cannot be moved to the light.
        let other = DMat4::from_translation(-far);
        db.upsert_mesh(crate::scenes::square(crate::scenes::prim("/other", other), 2, super::ALBEDO));
    });
    let eye = far + DVec3::new(0.0, 5.0, 3.0);
    let request = crate::support::color_request(crate::support::orthographic(eye, far, 0.002, [8, 8]));
    crate::support::render(&session, &request);
    let colors: Vec<[f32; 4]> = crate::support::read(&session, &request, oocpt_render::AovKind::Color);
    let mean = colors.iter().map(|c| f64::from(c[0])).sum::<f64>() / 64.0;
    let expected = f64::from(super::ALBEDO) * 0.01 * 0.01 / 0.04;
    assert!((mean / expected - 1.0).abs() < 5e-3, "{mean}, not {expected}");
}

/// The surface of a light that rays meet decides its shadows: a black wall inside of a ball is behind its surface from
/// everywhere.
#[test]
fn a_wall_inside_a_sphere_light_casts_no_shadow() {
    let (distance, expected) = (1.5, PI / (1.5 * 1.5));
    expect("a ball with a wall in it", 256, expected, 5e-3, &|db| {
        db.upsert_light(light(sphere(1.0), DMat4::from_translation(DVec3::Y * distance)));
        let wall = DMat4::from_translation(DVec3::Y * 0.65) * DMat4::from_scale(DVec3::splat(0.3));
        db.upsert_mesh(crate::scenes::square(crate::scenes::prim("/wall", wall), 2, 0.0));
    });
}
