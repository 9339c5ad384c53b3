// SPDX-License-Identifier: Apache-2.0
//! Lights that move: bounds that contain them at every time, unusable motion, and lights at rest.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use glam::{DMat3, DMat4, DVec3, DVec4};
use oocpt_core::scene::{InstancerDesc, Light, LightMotion, MAX_KEYS, map_at};
use oocpt_core::{DomeFormat, LightDesc, LightKind, SceneDb, TransformSample, TypedArray};

use crate::support::{by, prim, scatter};

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

/// The motion of the only light, and the warnings.
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
fn invalid_light_motion_gives_one_warning_and_a_static_light() {
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
fn motion_without_visible_effect_is_dropped() {
    let turn = [(0.0, DMat4::IDENTITY), (1.0, DMat4::from_rotation_x(1.0))];
    let sky = LightKind::Dome { texture: None, format: DomeFormat::Latlong };
    let (motion, said) = moved(|db| db.upsert_light(lamp(sky, &turn)));
    assert!(motion.is_none() && said.is_empty(), "a sky of one colour looks as it did: {said:?}");
    let same = [(0.0, DMat4::IDENTITY), (1.0, DMat4::IDENTITY)];
    let (motion, said) = moved(|db| db.upsert_light(lamp(ball(), &same)));
    assert!(motion.is_none() && said.is_empty(), "it rests: {said:?}");
    // Radiance is linear between keys, and a normalised lamp that grows has enough of them.
    let grow = [(0.0, DMat4::IDENTITY), (1.0, DMat4::from_scale(DVec3::splat(2.0)))];
    let (motion, _) = moved(|db| db.upsert_light(LightDesc { normalize: true, ..lamp(ball(), &grow) }));
    let motion = motion.expect("it moves");
    assert_eq!(motion.keys.len(), MAX_KEYS);
    let last = motion.radiance.last().copied().unwrap_or_default();
    assert!((last - 0.25).abs() < 1e-6, "a quarter for four times the area: {last}");
}

/// The motions of all lights of a ball in `/row`, and the warnings.
fn of_prototype(own: Maps<'_>, instancers: impl IntoIterator<Item = InstancerDesc>) -> (Vec<Light>, Vec<String>) {
    let mut db = SceneDb::new();
    let mut desc = lamp(ball(), own);
    desc.prim.transform = own.first().map_or(ARM, |(_, transform)| *transform);
    desc.prim.instanced_by = vec![by("/row", "/lamp")];
    db.upsert_light(desc);
    instancers.into_iter().for_each(|instancer| db.upsert_instancer(instancer));
    let commit = db.commit();
    (commit.snapshot.lights.clone(), commit.warnings.iter().map(|w| format!("{}: {}", w.path, w.message)).collect())
}

const ARM: DMat4 = DMat4::from_cols(DVec4::X, DVec4::Y, DVec4::Z, DVec4::new(2.0, 0.0, 0.0, 1.0));

fn row(maps: Maps<'_>) -> InstancerDesc {
    let mut row = scatter("/row", &[[0.0; 3], [0.0, 10.0, 0.0]], &[("/lamp", &[0, 1])]);
    row.prim.transform = maps.first().map_or(DMat4::IDENTITY, |(_, transform)| *transform);
    row.prim.motion =
        maps.iter().map(|(time, transform)| TransformSample { time: *time, transform: *transform }).collect();
    row
}

/// Compares where the lights' centres are with `way(light, time)`.
fn follows(what: &str, (lights, said): (Vec<Light>, Vec<String>), way: impl Fn(usize, f64) -> DVec3, bound: f64) {
    assert!(said.is_empty(), "{what}: {said:?}");
    assert_eq!(lights.len(), 2, "{what}");
    for (light, number) in lights.iter().zip(0..) {
        let motion = light.motion.as_ref().expect("it moves");
        for step in 0..=1000 {
            let time = f64::from(step) / 1000.0;
            let (at, known) = (map_at(&motion.keys, time).translation, way(number, time));
            assert!(at.distance(known) <= bound, "{what}, {number} at {time}: {at}, not {known}");
        }
    }
}

#[test]
fn prototype_lights_follow_all_enclosing_motion() {
    let up = |number: usize| DVec3::Y * 10.0 * number as f64;
    let on_arm = |angle: f64| 2.0 * DVec3::new(angle.cos(), angle.sin(), 0.0);
    let slide = |x: f64| DMat4::from_translation(DVec3::X * x);
    // By itself.
    let own = [(0.0, slide(1.0)), (0.5, slide(3.0)), (1.0, slide(2.0))];
    let x = |time: f64| if time < 0.5 { 1.0 + 4.0 * time } else { 4.0 - 2.0 * time };
    follows("its own", of_prototype(&own, [row(&[])]), |n, time| DVec3::X * x(time) + up(n), 1e-9);
    // By velocities, which accelerate: four straight pieces.
    let mut blown = row(&[]);
    blown.motion.seconds = [-0.5, 0.5];
    blown.motion.velocities = Some(TypedArray::of(vec![[0.0_f32, 0.0, 2.0], [0.0, 0.0, -4.0]]));
    let rate = |n: usize| if n == 0 { 2.0 } else { -4.0 };
    let lights = of_prototype(&[], [blown.clone()]);
    assert!(lights.0.iter().all(|light| light.motion.as_ref().is_some_and(|m| m.keys.len() == 2)), "as few keys");
    follows("velocities", lights, |n, time| DVec3::new(2.0, 0.0, rate(n) * (time - 0.5)) + up(n), 1e-6);
    blown.motion.accelerations = Some(TypedArray::of(vec![[0.0_f32, 8.0, 0.0]; 2]));
    let fall = |time: f64| 4.0 * (time - 0.5) * (time - 0.5);
    let way = |n: usize, time: f64| DVec3::new(2.0, fall(time), rate(n) * (time - 0.5)) + up(n);
    // Of the parabola's height over a quarter: 4 / 4^2 / 4.
    follows("accelerations", of_prototype(&[], [blown]), way, 0.0626);
    // On an arm of an instancer that turns: along the arc.
    let turned = |angle: f64| DMat4::from_rotation_z(angle);
    let turning = || row(&[(0.0, turned(0.0)), (1.0, turned(FRAC_PI_2))]);
    let arc = |n: usize, time: f64| turned(FRAC_PI_2 * time).transform_point3(on_arm(0.0) + up(n));
    // A quarter turn in fifteen pieces: (1 - cos(3 degrees)) of the arm; 15 pieces in two halves: of 3.2 degrees.
    follows("an arm", of_prototype(&[], [turning()]), arc, 0.0014 * 10.2);
    // All at once, and in an instancer that moves.
    let mut inner = turning();
    inner.prim.instanced_by = vec![by("/outer", "/row")];
    inner.motion.seconds = [0.0, 1.0];
    inner.motion.velocities = Some(TypedArray::of(vec![[0.0_f32, 0.0, 3.0]; 2]));
    let mut outer = scatter("/outer", &[[5.0, 0.0, 0.0]], &[("/row", &[0])]);
    outer.prim.motion =
        [(0.0, 0.0), (1.0, -7.0)].map(|(time, x)| TransformSample { time, transform: slide(x) }).to_vec();
    let all = |n: usize, time: f64| {
        let in_row = DVec3::X * x(time) + up(n) + DVec3::Z * 3.0 * time;
        turned(FRAC_PI_2 * time).transform_point3(in_row) + DVec3::X * (5.0 - 7.0 * time)
    };
    follows("all", of_prototype(&own, [inner, outer]), all, 0.0016 * 10.5);
}

#[test]
fn invalid_motion_stops_only_the_light_that_has_it() {
    let still = |(lights, said): &(Vec<Light>, Vec<String>)| {
        assert!(lights.len() == 2 && lights.iter().all(|light| light.motion.is_none()), "they stay");
        said.clone()
    };
    let said = still(&of_prototype(&[(0.0, ARM), (1.0, DMat4::NAN)], [row(&[])]));
    assert!(said.len() <= 1, "{said:?}");
    let said = still(&of_prototype(&[], [row(&[(0.0, DMat4::IDENTITY), (1.0, DMat4::NAN)])]));
    assert!(said.len() <= 1, "{said:?}");
    let mut nan = row(&[]);
    nan.motion.seconds = [0.0, 1.0];
    nan.motion.velocities = Some(TypedArray::of(vec![[f32::NAN, 0.0, 0.0], [0.0, 1.0, 0.0]]));
    let (lights, _) = of_prototype(&[], [nan]);
    let moves: Vec<bool> = lights.iter().map(|light| light.motion.is_some()).collect();
    assert_eq!(moves, [false, true], "one instance has a velocity that can be used");
}
