// SPDX-License-Identifier: Apache-2.0
//! Compares camera rays with unprojection by the full matrices in f64.

use glam::{DMat4, DQuat, DVec3, DVec4, Vec3};
use oocpt_core::{Camera, CameraError, CameraRays};
use proptest::prelude::*;

fn camera(projection: DMat4) -> Camera {
    Camera {
        world_from_view: DMat4::from_rotation_translation(
            DQuat::from_euler(glam::EulerRot::YXZ, 0.4, -0.3, 0.1),
            DVec3::new(1.0e6, 2.0, -3.0e5),
        ),
        projection,
        display_window: [0.0, 0.0, 640.0, 360.0],
        data_window: [0, 0, 640, 360],
        lens_radius: 0.0,
        focus_distance: 0.0,
        clip_planes: Vec::new(),
        motion: Vec::new(),
        exposure_scale: 1.0,
    }
}

fn near(camera: &Camera) -> DVec3 {
    camera.world_from_view.w_axis.truncate() + DVec3::new(10.0, -20.0, 5.0)
}

/// World points at the near and far plane for a pixel position with y up from the data window's lower edge.
fn unproject(camera: &Camera, x: f64, y: f64) -> [DVec3; 2] {
    let [x0, y0, x1, y1] = camera.display_window.map(f64::from);
    let (window_x, window_y) = (f64::from(camera.data_window[0]) + x, f64::from(camera.data_window[3]) - y);
    let ndc = (2.0 * (window_x - x0) / (x1 - x0) - 1.0, 1.0 - 2.0 * (window_y - y0) / (y1 - y0));
    [-1.0, 1.0].map(|z| {
        let p = camera.projection.inverse() * DVec4::new(ndc.0, ndc.1, z, 1.0);
        camera.world_from_view.transform_point3(p.truncate() / p.w)
    })
}

fn ray(rays: &CameraRays, x: f32, y: f32) -> (DVec3, DVec3) {
    let eval = |c: [f32; 3], dx: [f32; 3], dy: [f32; 3]| {
        (Vec3::from(c).as_dvec3()) + Vec3::from(dx).as_dvec3() * f64::from(x) + Vec3::from(dy).as_dvec3() * f64::from(y)
    };
    let low = Vec3::from(rays.o_lo).as_dvec3();
    (eval(rays.o, rays.o_x, rays.o_y) + low, eval(rays.d, rays.d_x, rays.d_y))
}

/// The ray through the pixel passes both unprojected points, and runs from the near one to the far one.
fn assert_exact(camera: &Camera) {
    let origin = near(camera);
    let rays = camera.rays(origin).unwrap();
    let [left, top, right, bottom] = camera.data_window;
    let (w, h) = (f64::from(right - left), f64::from(bottom - top));
    for (u, v) in [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (0.31, 0.77), (0.5, 0.5)] {
        #[expect(clippy::cast_possible_truncation, reason = "pixel positions are small")]
        let (x, y) = ((u * w) as f32, (v * h) as f32);
        let (o, d) = ray(&rays, x, y);
        let [a, b] = unproject(camera, f64::from(x), f64::from(y)).map(|p| p - origin);
        assert!(d.dot(b - a) > 0.0, "the ray looks forward");
        for p in [a, b] {
            let distance = (p - o).cross(d.normalize()).length();
            assert!(distance < 1e-6 * (1.0 + (p - o).length() + o.length()), "({x}, {y}): off by {distance}");
        }
        // The parameter is the depth.
        let t = (b - o).dot(d) / d.length_squared();
        let view = camera.world_from_view.inverse().transform_point3(b + origin);
        assert!((t + view.z).abs() < 1e-5 * t.abs(), "{t} {}", view.z);
    }
}

/// Off-axis perspective as `GfFrustum` makes it.
fn frustum(left: f64, right: f64, bottom: f64, top: f64, near: f64, far: f64) -> DMat4 {
    DMat4::from_cols(
        DVec4::new(2.0 * near / (right - left), 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 * near / (top - bottom), 0.0, 0.0),
        DVec4::new(
            (right + left) / (right - left),
            (top + bottom) / (top - bottom),
            -(far + near) / (far - near),
            -1.0,
        ),
        DVec4::new(0.0, 0.0, -2.0 * far * near / (far - near), 0.0),
    )
}

fn perspective(fov: f64, aspect: f64, near: f64, far: f64) -> DMat4 {
    let top = near * (0.5 * fov).tan();
    frustum(-top * aspect, top * aspect, -top, top, near, far)
}

fn orthographic(left: f64, right: f64, bottom: f64, top: f64, near: f64, far: f64) -> DMat4 {
    DMat4::from_cols(
        DVec4::new(2.0 / (right - left), 0.0, 0.0, 0.0),
        DVec4::new(0.0, 2.0 / (top - bottom), 0.0, 0.0),
        DVec4::new(0.0, 0.0, -2.0 / (far - near), 0.0),
        DVec4::new(
            -(right + left) / (right - left),
            -(top + bottom) / (top - bottom),
            -(far + near) / (far - near),
            1.0,
        ),
    )
}

#[test]
fn perspective_rays_are_exact() {
    assert_exact(&camera(perspective(0.7, 16.0 / 9.0, 0.1, 1000.0)));
    assert_exact(&camera(frustum(-0.3, 0.9, -0.2, 0.4, 1.0, 500.0)));
}

#[test]
fn orthographic_rays_are_exact() {
    assert_exact(&camera(orthographic(-8.0, 8.0, -4.5, 4.5, 1.0, 100.0)));
    assert_exact(&camera(orthographic(-3.0, 9.0, 2.0, 7.0, 1.0, 100.0)));
}

#[test]
fn data_windows_crop_and_extend() {
    let mut cropped = camera(frustum(-0.3, 0.9, -0.2, 0.4, 1.0, 500.0));
    cropped.data_window = [100, 50, 420, 300];
    assert_exact(&cropped);
    cropped.data_window = [-10, -20, 700, 400];
    cropped.display_window = [10.5, 20.25, 500.0, 300.0];
    assert_exact(&cropped);
}

proptest! {
    #[test]
    fn any_frustum_is_exact(l in -2.0_f64..-0.1, r in 0.1_f64..2.0, b in -2.0_f64..-0.1, t in 0.1_f64..2.0, ortho: bool) {
        let projection =
            if ortho { orthographic(l, r, b, t, 0.5, 50.0) } else { frustum(l, r, b, t, 0.5, 50.0) };
        assert_exact(&camera(projection));
    }
}

/// Single precision steps by a metre at 10^7.
#[test]
fn rays_resolve_a_millimetre_at_ten_thousand_kilometres() {
    let mut camera = camera(perspective(0.7, 16.0 / 9.0, 0.1, 1000.0));
    let origin = DVec3::new(12.5, -7.0, 0.1);
    let at = |millimetres: f64| DVec3::new(1.0e7 + 0.001 * millimetres, -1.0e7, 3.0e6 - 0.001 * millimetres);
    for millimetres in 0..50 {
        let position = at(f64::from(millimetres));
        camera.world_from_view.w_axis = position.extend(1.0);
        let rays = camera.rays(origin).unwrap();
        let (high, low) = (Vec3::from(rays.o).as_dvec3(), Vec3::from(rays.o_lo).as_dvec3());
        let wanted = position - origin;
        assert_eq!(Vec3::from(rays.o), wanted.as_vec3(), "the first float is the rounded origin");
        let error = (high + low - wanted).abs();
        let bound = wanted.abs() * 2.0_f64.powi(-48);
        assert!(error.cmple(bound).all(), "{millimetres} mm: off by {error}, allowed {bound}");
        assert!(error.max_element() < 1e-7, "{millimetres} mm: off by {error}");
    }
}

proptest! {
    #[test]
    fn a_pair_of_floats_holds_any_ray_origin(
        p in prop::array::uniform3(-1.0_f64..1.0),
        scale in prop::array::uniform3(-20_i32..20),
        ortho: bool,
    ) {
        let projection =
            if ortho { orthographic(-3.0, 9.0, 2.0, 7.0, 1.0, 100.0) } else { perspective(0.7, 1.5, 0.1, 1000.0) };
        let mut camera = camera(projection);
        let position = DVec3::from(p) * DVec3::from(scale.map(|e| 10.0_f64.powi(e)));
        camera.world_from_view.w_axis = position.extend(1.0);
        let rays = camera.rays(DVec3::ZERO).unwrap();
        // The origin at the corner of the image, in f64, as `unproject` has it: the near plane's point moved to the
        // eye.
        let corner = if ortho { camera.world_from_view.transform_vector3(DVec3::new(-3.0, 2.0, 0.0)) } else { DVec3::ZERO };
        let wanted = position + corner;
        let sum = Vec3::from(rays.o).as_dvec3() + Vec3::from(rays.o_lo).as_dvec3();
        // Besides 2^-48 of the sum itself, this is the loss of f64 on other ways to the same point.
        let slack = wanted.abs() * 2.0_f64.powi(-48) + DVec3::splat(1e-13 * corner.length() + 1e-30);
        prop_assert!((sum - wanted).abs().cmple(slack).all(), "{sum} for {wanted}");
    }
}

#[test]
fn depth_rows_give_window_and_camera_depth() {
    for projection in [perspective(0.7, 1.5, 0.1, 1000.0), orthographic(-8.0, 8.0, -4.5, 4.5, 1.0, 100.0)] {
        let camera = camera(projection);
        let origin = near(&camera);
        let rays = camera.rays(origin).unwrap();
        let p = camera.world_from_view.transform_point3(DVec3::new(0.3, -0.2, -7.0)) - origin;
        let start = [0, 1, 2].map(|k| f64::from(rays.o[k]) + f64::from(rays.o_lo[k]));
        let row = |r: [f32; 4]| DVec4::from(r.map(f64::from)).dot((p - DVec3::from(start)).extend(1.0));
        let eye = rays.view_from_world.map(row);
        let clip_of = |r: [f32; 4]| DVec4::from(r.map(f64::from)).dot(DVec3::from(eye).extend(1.0));
        let depth = 0.5 * clip_of(rays.clip_z) / clip_of(rays.clip_w) + 0.5;
        let clip = projection * DVec4::new(0.3, -0.2, -7.0, 1.0);
        assert!((depth - (0.5 * clip.z / clip.w + 0.5)).abs() < 1e-5, "{depth}");
        assert!((DVec3::from(eye) - DVec3::new(0.3, -0.2, -7.0)).length() < 1e-4, "{eye:?}");
        let normal = camera.world_from_view.transform_vector3(DVec3::Y).as_vec3();
        let back = rays.view_normal.map(|r| Vec3::from(r).dot(normal));
        assert!((Vec3::from(back) - Vec3::Y).length() < 1e-6, "{back:?}");
    }
}

#[test]
fn lens_rays_converge_in_the_focal_plane() {
    for projection in [frustum(-0.3, 0.9, -0.2, 0.4, 1.0, 500.0), orthographic(-8.0, 8.0, -4.5, 4.5, 1.0, 100.0)] {
        let mut camera = camera(projection);
        camera.lens_radius = 0.25;
        camera.focus_distance = 12.0;
        let rays = camera.rays(near(&camera)).unwrap();
        let (o, d) = ray(&rays, 123.5, 45.5);
        let focused = o + d * f64::from(rays.focus);
        let view = camera.world_from_view.inverse().transform_point3(focused + near(&camera));
        assert!((view.z + 12.0).abs() < 1e-4, "{view}");
        let axis = |v: [f32; 3]| camera.world_from_view.inverse().transform_vector3(Vec3::from(v).as_dvec3());
        assert!((axis(rays.lens_u) - DVec3::X * 0.25).length() < 1e-6);
        assert!((axis(rays.lens_v) - DVec3::Y * 0.25).length() < 1e-6);
    }
}

#[test]
fn unusable_cameras_are_refused() {
    let good = camera(perspective(0.7, 1.5, 0.1, 1000.0));
    let with = |change: &dyn Fn(&mut Camera)| {
        let mut camera = good.clone();
        change(&mut camera);
        camera.rays(DVec3::ZERO).unwrap_err()
    };
    assert!(good.rays(DVec3::ZERO).is_ok());
    assert!(matches!(with(&|c| c.world_from_view.x_axis.x = f64::NAN), CameraError::NotFinite(_)));
    assert!(matches!(with(&|c| c.world_from_view = DMat4::ZERO), CameraError::Singular(_)));
    assert!(matches!(with(&|c| c.world_from_view.x_axis = c.world_from_view.y_axis), CameraError::Singular(_)));
    assert!(matches!(with(&|c| c.projection = DMat4::ZERO), CameraError::Singular(_)));
    assert!(matches!(with(&|c| c.projection.x_axis.w = 0.1), CameraError::Unsupported));
    assert!(matches!(with(&|c| c.projection.y_axis.y = f64::INFINITY), CameraError::NotFinite(_)));
    assert!(matches!(with(&|c| c.display_window[2] = 0.0), CameraError::Singular(_)));
    assert!(matches!(with(&|c| c.display_window[0] = f32::NAN), CameraError::NotFinite(_)));
    assert!(matches!(with(&|c| c.lens_radius = f64::NAN), CameraError::NotFinite(_)));
    assert!(matches!(with(&|c| c.lens_radius = 1.0), CameraError::Singular(_)));
    assert!(matches!(with(&|c| c.world_from_view.w_axis.x = 1e300), CameraError::NotFinite(_)));
}

#[test]
fn clipping_intervals_along_rays_match_view_space_planes() {
    let plane = DVec4::new(0.4, -0.3, -2.0, -5.0);
    for projection in [frustum(-0.3, 0.9, -0.2, 0.4, 1.0, 500.0), orthographic(-8.0, 8.0, -4.5, 4.5, 1.0, 100.0)] {
        // The scale of a plane changes nothing; planes that are not finite or cut nothing are left out.
        let odd = [DVec4::new(f64::NAN, 0.0, 0.0, 1.0), DVec4::new(0.0, f64::INFINITY, 0.0, 1.0), DVec4::W];
        let scaled = [plane, plane * 1e200, plane * 1e-200];
        let clip_planes = odd.into_iter().chain(scaled).collect();
        let camera = Camera { clip_planes, lens_radius: 0.25, focus_distance: 12.0, ..camera(projection) };
        let planes = camera.planes_along_rays().unwrap();
        assert_eq!(planes.len(), scaled.len());
        assert!(planes.iter().all(|other| *other == planes[0]), "{planes:?}");
        let rays = camera.rays(near(&camera)).unwrap();
        let (x, y, lens) = (123.5_f32, 45.5_f32, [0.6_f32, -0.7_f32]);
        let along = |f: [f32; 3]| f64::from(f[0]) + f64::from(f[1]) * f64::from(x) + f64::from(f[2]) * f64::from(y);
        let aside = f64::from(planes[0].lens_x * lens[0] + planes[0].lens_y * lens[1]);
        let (o, d) = ray(&rays, x, y);
        let lens_point = (Vec3::from(rays.lens_u) * lens[0] + Vec3::from(rays.lens_v) * lens[1]).as_dvec3();
        let (o, d) = (o + lens_point, d - lens_point / f64::from(rays.focus));
        for t in [0.0, 3.0, 40.0] {
            let view = camera.world_from_view.inverse().transform_point3(o + t * d + near(&camera));
            let known = plane.dot(view.extend(1.0)) / plane.truncate().length();
            let said = along(planes[0].begins) + aside + t * (along(planes[0].slope) - aside / f64::from(rays.focus));
            assert!((said - known).abs() < 2e-5, "{said} for {known} at {t}");
        }
    }
    let many = Camera { clip_planes: vec![plane; 40], ..camera(perspective(0.7, 1.5, 0.1, 1000.0)) };
    assert_eq!(many.planes_along_rays().unwrap().len(), oocpt_core::MAX_CLIP_PLANES);
    let all = Camera { clip_planes: vec![-DVec4::W], ..many };
    assert_eq!(all.planes_along_rays().unwrap()[0].begins[0], -1.0, "a plane that keeps nothing");
}
