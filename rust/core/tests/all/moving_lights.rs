// SPDX-License-Identifier: Apache-2.0
//! Lights that move: bounds that hold them at every time, motion that cannot be used, and what is no motion.

use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3};
use oocpt_core::scene::{InstancedBy, LightMotion, MAX_KEYS, map_at};
use oocpt_core::{DomeFormat, LightDesc, LightKind, SceneDb, TransformSample, TypedArray};

use crate::support::{prim, scatter};

/// Transforms at times.
type Maps<'a> = &'a [(f64, DMat4)];

fn lamp(kind: LightKind, maps: Maps<'_>) -> LightDesc {
    let mut desc = LightDesc { prim: prim("/lamp"), kind, ..LightDesc::default() };
    desc.prim.motion =
        maps.iter().map(|(time, transform)| TransformSample { time: *time, transform: *transform }).collect();
    desc
}

fn ball() -> LightKind {
    LightKind::Sphere { radius: 0.5, treat_as_point: false }
}

/// The motion of the only light, and what was said.
fn moved(build: impl FnOnce(&mut SceneDb)) -> (Option<Arc<LightMotion>>, Vec<String>) {
    let mut db = SceneDb::new();
    build(&mut db);
    let commit = db.commit();
    let lights = &commit.snapshot.lights;
    assert_eq!(lights.len(), 1, "{lights:?}");
    let light = lights.first().expect("one");
    (light.motion.clone(), commit.warnings.iter().map(|w| format!("{}: {}", w.path, w.message)).collect())
}

#[test]
fn bounds_hold_a_light_at_every_time() {
    let turned = |x: f64, angle: f64| {
        let axis = DVec3::new(0.3, 1.0, -0.4).normalize();
        DMat4::from_translation(DVec3::new(x, 1.0, 0.0)) * DMat4::from_axis_angle(axis, angle)
    };
    let grown = DMat4::from_scale(DVec3::new(3.0, 0.5, 1.0));
    let ways: [&[(f64, DMat4)]; 3] = [
        &[(0.0, turned(0.0, 0.0)), (1.0, turned(4.0, 3.0))],
        &[(-0.5, turned(0.0, 1.0)), (0.3, turned(1.0, -1.0) * grown), (2.0, turned(-7.0, 0.5))],
        &[(0.4, turned(0.0, 0.0)), (0.5, turned(2.0, 2.5))],
    ];
    let kinds = [ball(), LightKind::Rect { width: 3.0, height: 0.2, texture: None }];
    for (kind, maps) in kinds.iter().flat_map(|kind| ways.iter().map(move |maps| (kind, *maps))) {
        let (motion, said) = moved(|db| db.upsert_light(lamp(kind.clone(), maps)));
        let motion = motion.expect("it moves");
        assert!(said.is_empty(), "{said:?}");
        let flat = matches!(kind, LightKind::Rect { .. });
        let (min, max) = motion.swept([1.0, 1.0, if flat { 0.0 } else { 1.0 }]);
        let (min, max) = (DVec3::from_array(min), DVec3::from_array(max));
        let (axes, most) = motion.axes();
        let (mut low, mut high, mut farthest) = (DVec3::INFINITY, DVec3::NEG_INFINITY, 0.0_f64);
        for step in 0..=4000 {
            let map = map_at(&motion.keys, f64::from(step) / 4000.0);
            for corner in 0..8 {
                let side = |bit: u32| if corner >> bit & 1 == 1 { 1.0 } else { -1.0 };
                let p = map.transform_point3(DVec3::new(side(0), side(1), if flat { 0.0 } else { side(2) }));
                (low, high) = (low.min(p), high.max(p));
            }
            if flat {
                // The unit shape's own axes: z stays the normal of the plane.
                let DMat3 { x_axis, y_axis, z_axis } = map.matrix3;
                let axis = -z_axis.normalize();
                assert!(axis.dot(x_axis).abs() < 1e-9 && axis.dot(y_axis).abs() < 1e-9, "the normal");
                let near = axes.iter().map(|a| DVec3::from_array(*a).angle_between(axis)).fold(f64::MAX, f64::min);
                farthest = farthest.max(near);
            }
        }
        assert!(min.cmple(low).all() && max.cmpge(high).all(), "{min} {max} for {low} {high}");
        let spare = (low - min).max(max - high).max_element();
        assert!(spare < 0.05 * (high - low).max_element(), "{spare} is too much for {low} {high}");
        assert!(farthest <= 0.5 * most + 1e-6 && most <= 0.1, "{farthest} from an axis, of steps of {most}");
    }
}

#[test]
fn motion_that_cannot_be_used_is_one_message_and_the_light_stays() {
    let identity = DMat4::IDENTITY;
    let flat = DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0));
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let aside = DMat4::from_translation(DVec3::X);
    let cases: [(&str, Maps<'_>, &str); 5] = [
        ("NaN", &[(0.0, identity), (1.0, DMat4::NAN)], "singular or not finite"),
        ("flat", &[(0.0, identity), (1.0, flat)], "singular or not finite"),
        ("backwards", &[(1.0, identity), (0.0, aside)], "order of time"),
        ("never", &[(0.0, identity), (f64::NAN, aside)], "no usable time"),
        ("mirrored", &[(0.0, identity), (1.0, mirror)], "inside out"),
    ];
    for kind in [ball(), LightKind::Distant { angle_degrees: 1.0 }] {
        for (name, maps, text) in cases {
            let (motion, said) = moved(|db| db.upsert_light(lamp(kind.clone(), maps)));
            let [said] = &said[..] else { panic!("{name}: {said:?}") };
            assert!(said.starts_with("/lamp: ") && said.contains(text), "{name}: {said}");
            assert!(motion.is_none(), "{name}: it stays");
        }
    }
}

#[test]
fn what_shows_no_motion_has_none_and_prototypes_say_so() {
    let turn = [(0.0, DMat4::IDENTITY), (1.0, DMat4::from_rotation_x(1.0))];
    let sky = LightKind::Dome { texture: None, format: DomeFormat::Latlong };
    let (motion, said) = moved(|db| db.upsert_light(lamp(sky, &turn)));
    assert!(motion.is_none() && said.is_empty(), "a sky of one colour looks as it did: {said:?}");
    let same = [(0.0, DMat4::IDENTITY), (1.0, DMat4::IDENTITY)];
    let (motion, said) = moved(|db| db.upsert_light(lamp(ball(), &same)));
    assert!(motion.is_none() && said.is_empty(), "it rests: {said:?}");
    // Radiance is linear between keys, of which there are enough where a normalised lamp grows.
    let grow = [(0.0, DMat4::IDENTITY), (1.0, DMat4::from_scale(DVec3::splat(2.0)))];
    let (motion, _) = moved(|db| db.upsert_light(LightDesc { normalize: true, ..lamp(ball(), &grow) }));
    let motion = motion.expect("it moves");
    assert_eq!(motion.keys.len(), MAX_KEYS);
    let last = motion.radiance.last().copied().unwrap_or_default();
    assert!((last - 0.25).abs() < 1e-6, "a quarter for four times the area: {last}");
    // In a prototype, of an instancer that moves or by itself.
    for own in [true, false] {
        let (motion, said) = moved(|db| {
            let mut desc = lamp(ball(), if own { &turn } else { &[] });
            desc.prim.instanced_by = vec![InstancedBy { instancer: "/row".into(), prototype_root: "/lamp".into() }];
            db.upsert_light(desc);
            let mut row = scatter("/row", &[[0.0; 3]], &[("/lamp", &[0])]);
            row.motion.seconds = [0.0, 1.0];
            row.motion.velocities = (!own).then(|| TypedArray::of(vec![[1.0_f32; 3]]));
            db.upsert_instancer(row);
        });
        assert!(motion.is_none(), "not yet");
        let [said] = &said[..] else { panic!("{own}: {said:?}") };
        assert!(said.starts_with("/lamp: ") && said.contains("prototype moves"), "{said}");
    }
}
