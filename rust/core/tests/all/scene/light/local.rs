// SPDX-License-Identifier: Apache-2.0
//! Lights at places: areas, normalisation, frames, shaping, instances, links.

use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{InstancedBy, LightEmitter, LinkTable, LocalLight, LocalShape};
use oocpt_core::{AssetRef, Light, LightDesc, LightKind, SceneDb, ShapingCone};

use crate::support::{committed, prim, scatter};

fn desc(kind: LightKind, transform: DMat4) -> LightDesc {
    let mut desc = LightDesc { prim: prim("/light"), kind, ..LightDesc::default() };
    desc.prim.transform = transform;
    desc
}

fn rect(width: f32, height: f32) -> LightKind {
    LightKind::Rect { width, height, texture: None }
}

fn sphere(radius: f32) -> LightKind {
    LightKind::Sphere { radius, treat_as_point: false }
}

fn cylinder(length: f32, radius: f32) -> LightKind {
    LightKind::Cylinder { length, radius, treat_as_line: false }
}

fn local(light: &Light) -> Arc<LocalLight> {
    let local = if let LightEmitter::Local(local) = &light.emitter { Some(local) } else { None };
    Arc::clone(local.expect("a local light"))
}

/// Complete elliptic integrals are beside the point: the perimeter by Ramanujan's second formula, 1e-6 at this ratio.
fn perimeter(a: f64, b: f64) -> f64 {
    let h = ((a - b) / (a + b)).powi(2);
    PI * (a + b) * (1.0 + 3.0 * h / (10.0 + (4.0 - 3.0 * h).sqrt()))
}

/// Surface of a spheroid with semi-axes (a, a, c), c > a: 2 pi a^2 (1 + c / (a e) asin e).
fn prolate(a: f64, c: f64) -> f64 {
    let e = (1.0 - a * a / (c * c)).sqrt();
    2.0 * PI * a * a * (1.0 + c / (a * e) * e.asin())
}

#[test]
fn normalisation_divides_by_the_area_in_the_world() {
    let scaled = |x, y, z| DMat4::from_rotation_y(0.3) * DMat4::from_scale(DVec3::new(x, y, z));
    let cases = [
        (rect(2.0, 3.0), scaled(1.0, 1.0, 1.0), 6.0),
        (rect(2.0, 3.0), scaled(2.0, 0.5, 7.0), 6.0),
        (LightKind::Disk { radius: 0.5 }, scaled(2.0, 3.0, 1.0), PI * 1.5),
        (sphere(0.5), scaled(3.0, 3.0, 3.0), 4.0 * PI * 2.25),
        (sphere(1.0), scaled(1.0, 1.0, 2.5), prolate(1.0, 2.5)),
        (cylinder(4.0, 0.5), scaled(1.0, 1.0, 1.0), 4.0 * PI),
        (cylinder(4.0, 1.0), scaled(0.5, 2.0, 1.0), 2.0 * perimeter(2.0, 1.0)),
    ];
    for (kind, transform, area) in cases {
        let plain = desc(kind.clone(), transform);
        let normalized = LightDesc { normalize: true, ..plain.clone() };
        let [plain, normalized] = [plain, normalized].map(|desc| Light::from_desc(&desc).expect("a light"));
        assert!((local(&plain).area / area - 1.0).abs() < 2e-6, "{kind:?}: area {} not {area}", local(&plain).area);
        let ratio = f64::from(plain.radiance[1]) / f64::from(normalized.radiance[1]);
        assert!((ratio / area - 1.0).abs() < 2e-6, "{kind:?}: normalised by {ratio}, not {area}");
    }
}

/// Cauchy: a convex body's mean shadow is a quarter of its surface, so far away all agree.
#[test]
fn point_and_line_lights_keep_the_power_of_their_shape() {
    let point = |radius, normalize| LightDesc {
        normalize,
        ..desc(LightKind::Sphere { radius, treat_as_point: true }, DMat4::IDENTITY)
    };
    let intensity = |desc: &LightDesc| Light::from_desc(desc).expect("a light").radiance[0];
    assert!((f64::from(intensity(&point(2.0, false))) / (PI * 4.0) - 1.0).abs() < 1e-6, "pi r^2 L");
    assert!((intensity(&point(2.0, true)) - 0.25).abs() < 1e-6, "power of L = 1 / (4 pi r^2)");
    assert!((intensity(&point(0.0, true)) - 0.25).abs() < 1e-6, "and so without a size");
    let nothing = Light::from_desc(&point(0.0, false)).expect("a light");
    assert!(nothing.is_black() && local(&nothing).shape == LocalShape::Point, "no size, no light");
    let line = |radius, normalize| LightDesc {
        normalize,
        ..desc(LightKind::Cylinder { length: 3.0, radius, treat_as_line: true }, DMat4::IDENTITY)
    };
    assert!((intensity(&line(0.25, false)) - 0.5).abs() < 1e-6, "2 r L for each length");
    assert!((f64::from(intensity(&line(0.0, true))) * PI * 3.0 - 1.0).abs() < 1e-5, "without a radius");
}

#[test]
fn lights_without_area_are_black_and_bad_numbers_are_refused() {
    for kind in [rect(0.0, 1.0), LightKind::Disk { radius: 0.0 }, cylinder(0.0, 1.0), sphere(0.0), sphere(-1.0)] {
        for normalize in [false, true] {
            let light = Light::from_desc(&LightDesc { normalize, ..desc(kind.clone(), DMat4::IDENTITY) });
            let light = light.unwrap_or_else(|| panic!("{kind:?} is a light"));
            assert!(light.radiance.iter().all(|c| c.is_finite()), "{kind:?}: {:?}", light.radiance);
            let has_power = matches!(kind, LightKind::Sphere { .. }) && normalize;
            assert_eq!(light.is_black(), !has_power, "{kind:?} {normalize}");
        }
    }
    for kind in [rect(f32::NAN, 1.0), sphere(f32::INFINITY), cylinder(1.0, f32::NAN)] {
        assert_eq!(Light::from_desc(&desc(kind.clone(), DMat4::IDENTITY)), None, "{kind:?}");
    }
    for intensity in [1e-30, 1e30] {
        let light = Light::from_desc(&LightDesc { intensity, ..desc(sphere(1.0), DMat4::IDENTITY) }).expect("a light");
        assert!((light.radiance[0] / intensity - 1.0).abs() < 1e-6, "{:?}", light.radiance);
    }
}

#[test]
fn plane_lights_point_along_minus_z_even_without_a_z_axis() {
    let turn = DMat4::from_quat(DQuat::from_rotation_x(-FRAC_PI_2));
    for scale in [DVec3::ONE, DVec3::new(2.0, 3.0, 0.0), DVec3::new(-1.0, 1.0, 1.0)] {
        let light = Light::from_desc(&desc(rect(1.0, 1.0), turn * DMat4::from_scale(scale))).expect("a light");
        let axis = DVec3::from(local(&light).axis().map(f64::from));
        // -z turned about x by -90 degrees is -y.
        assert!((axis - DVec3::NEG_Y).length() < 1e-6, "{scale}: {axis}");
        let unit = local(&light).world_from_unit.matrix3;
        assert!(unit.determinant().abs() > 1e-3, "{scale}: a regular frame");
        // The unit square reaches from -1 to 1.
        for (axis, size) in [(unit.x_axis, scale.x), (unit.y_axis, scale.y)] {
            assert!((axis.length() - 0.5 * size.abs()).abs() < 1e-6, "{scale}: {} of {size}", axis.length());
        }
    }
    let sheared = Light::from_desc(&desc(rect(1.0, 1.0), DMat4::from_scale(DVec3::new(0.0, 1.0, 1.0))));
    assert_eq!(sheared, None, "no plane, no light");
}

#[test]
fn shaping_is_checked_and_left_out_where_it_does_nothing() {
    let with = |shaping: ShapingCone| {
        let light = Light::from_desc(&LightDesc { shaping: Some(shaping), ..desc(sphere(1.0), DMat4::IDENTITY) });
        light.map(|light| local(&light).shaping.clone())
    };
    let wide = ShapingCone { cone_angle_degrees: 180.0, ..ShapingCone::default() };
    assert_eq!(with(wide.clone()), Some(None), "everywhere is no shape");
    let soft =
        with(ShapingCone { cone_angle_degrees: 60.0, cone_softness: 0.5, ..wide.clone() }).flatten().expect("shaped");
    assert!(
        (f64::from(soft.cone_angle) - PI / 3.0).abs() < 1e-6
            && (soft.smooth_start * 2.0 - soft.cone_angle).abs() < 1e-6
    );
    let hard =
        with(ShapingCone { cone_softness: 7.0, focus: -1.0, ..ShapingCone::default() }).flatten().expect("shaped");
    assert!(hard.smooth_start.abs() < 1e-6 && hard.focus.abs() < 1e-6, "clamped: {hard:?}");
    assert_eq!(with(ShapingCone { focus: f32::NAN, ..wide.clone() }), None, "not a number");
    assert!(with(ShapingCone::default()).flatten().is_some(), "90 degrees of a sphere are a half");
    let flat = |shaping: ShapingCone| {
        let light = Light::from_desc(&LightDesc { shaping: Some(shaping), ..desc(rect(1.0, 1.0), DMat4::IDENTITY) });
        local(&light.expect("a light")).shaping.clone()
    };
    assert_eq!(flat(ShapingCone::default()), None, "90 degrees of a rectangle are all that it has");
    let profile = ShapingCone { ies: Some(AssetRef { authored: "a.ies".into(), resolved: "".into() }), ..wide };
    let profiled = with(ShapingCone { cone_angle_degrees: 20.0, cone_softness: 0.5, ..profile }).flatten();
    let profiled = profiled.expect("a file that is missing is still named");
    let whole = [profiled.cone_angle, profiled.smooth_start].iter().all(|angle| (f64::from(*angle) - PI).abs() < 1e-6);
    assert!(profiled.ies.is_some() && whole, "the cone is not the profile's: {profiled:?}");
}

#[test]
fn lights_in_prototypes_are_multiplied_out() {
    let mut db = SceneDb::new();
    let instancer = |path: &str, root: &str, at: &[[f32; 3]], by: Option<(&str, &str)>| {
        let numbers: Vec<i32> = (0..i32::try_from(at.len()).unwrap()).collect();
        let mut desc = scatter(path, at, &[(root, &numbers)]);
        if let Some((instancer, prototype_root)) = by {
            desc.prim.instanced_by =
                vec![InstancedBy { instancer: instancer.into(), prototype_root: prototype_root.into() }];
        }
        desc
    };
    db.upsert_instancer(instancer("/outer", "/outer/p", &[[10.0, 0.0, 0.0], [20.0, 0.0, 0.0]], None));
    db.upsert_instancer(instancer(
        "/inner",
        "/inner/p",
        &[[0.0, 1.0, 0.0], [0.0, 2.0, 0.0], [0.0, 3.0, 0.0]],
        Some(("/outer", "/outer/p")),
    ));
    let mut lamp = desc(sphere(0.5), DMat4::from_translation(DVec3::Z));
    lamp.prim.instanced_by = vec![InstancedBy { instancer: "/inner".into(), prototype_root: "/inner/p".into() }];
    db.upsert_light(lamp);
    let snapshot = committed(&mut db);
    let mut places: Vec<_> = snapshot.lights.iter().map(|l| local(l).world_from_unit.translation.to_array()).collect();
    places.sort_by(|a, b| a.partial_cmp(b).unwrap());
    let expected: Vec<_> = [10.0, 20.0].iter().flat_map(|&x| [1.0, 2.0, 3.0].map(|y| [x, y, 1.0])).collect();
    assert_eq!(places, expected);
}

#[test]
fn instancers_inside_themselves_give_no_lights_and_end() {
    let mut db = SceneDb::new();
    for (path, other) in [("/a", "/b"), ("/b", "/a")] {
        let mut desc = scatter(path, &[[0.0; 3]; 2], &[("/p", &[0, 1])]);
        desc.prim.instanced_by =
            ["/p", "/q"].map(|root| InstancedBy { instancer: other.into(), prototype_root: root.into() }).to_vec();
        db.upsert_instancer(desc);
    }
    let mut lamp = desc(sphere(0.5), DMat4::IDENTITY);
    lamp.prim.instanced_by = vec![InstancedBy { instancer: "/a".into(), prototype_root: "/p".into() }];
    db.upsert_light(lamp);
    assert!(db.commit().snapshot.lights.is_empty(), "nowhere");
}

#[test]
fn link_sets_hold_the_categories_that_lights_name() {
    let mut links = LinkTable::default();
    let name = |text: &str| -> Arc<str> { text.into() };
    assert_eq!((links.category(None), links.category(Some(&name("")))), (0, 0), "all prims");
    let numbers: Vec<u32> = (0..40).map(|i| links.category(Some(&name(&format!("c{i}"))))).collect();
    assert_eq!(numbers, (1..=40).collect::<Vec<_>>());
    assert_eq!(links.category(Some(&name("c7"))), 8, "known");
    assert_eq!(links.words(), 2, "category 40 is in the second word");
    let some = links.bits(&[name("c39"), name("unknown"), name("c0"), name("c0")]);
    for category in 1..=40_u32 {
        let bit = some[category as usize / 32] >> (category % 32) & 1 == 1;
        assert_eq!(bit, [1, 40].contains(&category), "{category}");
    }
    assert_eq!(links.bits(&[name("unknown")]), [0, 0], "nothing that a light names");
}
