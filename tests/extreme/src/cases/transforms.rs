// SPDX-License-Identifier: Apache-2.0
//! Maps that are far from rigid: nested eight deep, stretched, sheared, mirrored, nearly singular, singular;
//! quaternions as files have them.

use glam::{DMat3, DMat4, DQuat, DVec3};
use half::f16;
use oocpt_core::scene::{InstancerDesc, InstancerPrototype, MeshDesc, SceneDb};
use oocpt_core::{ElementType, TypedArray};

use crate::build::{Body, Placed, World, dome, instanced, narrow, prim, wide};
use crate::lab::{Lab, Miss};
use crate::shot::{Stage, Way};
use crate::tracer::Tracer;
use crate::tracer::camera::Eye;

const SIZE: [u32; 2] = [48, 32];

/// An instancer that places what is below `root` by translations, rotations and scales.
pub(crate) struct Ring {
    pub(crate) translations: Vec<DVec3>,
    pub(crate) rotations: TypedArray,
    pub(crate) scales: Vec<DVec3>,
}

impl Ring {
    /// Rotations in single precision.
    pub(crate) fn new(translations: Vec<DVec3>, rotations: &[DQuat], scales: Vec<DVec3>) -> Option<Self> {
        let floats: Vec<[f32; 4]> = rotations.iter().map(|q| q.as_quat().to_array()).collect();
        let rotations = TypedArray::from_vec(ElementType::Quatf, floats).ok()?;
        Some(Self { translations, rotations, scales })
    }

    /// Its instances' matrices in f64, from the numbers as they are stored.
    pub(crate) fn maps(&self) -> Vec<DMat4> {
        let rotation = |i: usize| self.rotations.quat(i).map_or(DQuat::IDENTITY, DQuat::normalize);
        let map = |(i, (t, s)): (usize, (&DVec3, &DVec3))| {
            DMat4::from_scale_rotation_translation(wide(narrow(*s)), rotation(i), wide(narrow(*t)))
        };
        self.translations.iter().zip(&self.scales).enumerate().map(map).collect()
    }

    pub(crate) fn desc(&self, prim: oocpt_core::scene::PrimDesc, root: &str) -> InstancerDesc {
        let array = |values: &[DVec3]| Some(TypedArray::of(values.iter().map(|v| narrow(*v)).collect::<Vec<_>>()));
        let numbers = (0..).take(self.translations.len()).collect::<Vec<i32>>();
        InstancerDesc {
            prim,
            prototypes: vec![InstancerPrototype { root: root.into(), indices: TypedArray::of(numbers) }],
            translations: array(&self.translations),
            rotations: Some(self.rotations.clone()),
            scales: array(&self.scales),
            ..InstancerDesc::default()
        }
    }
}

/// A body under nested instancers, outermost first.
pub(crate) fn author_nested(db: &mut SceneDb, rings: &[Ring], body: &Body) {
    let mut path = "/n".to_owned();
    let mut parent: Option<String> = None;
    for ring in rings {
        let mut own = prim(&path, DMat4::IDENTITY);
        if let Some(parent) = &parent {
            own = instanced(own, parent);
        }
        let root = format!("{path}/n");
        db.upsert_instancer(ring.desc(own, &root));
        parent = Some(path);
        path = root;
    }
    let mut own = prim(&path, DMat4::IDENTITY);
    if let Some(parent) = &parent {
        own = instanced(own, parent);
    }
    db.upsert_mesh(body.mesh(own, 1));
}

/// The same multiplied out.
pub(crate) fn flatten(rings: &[Ring], body: &Body) -> Vec<Placed> {
    let mut places = vec![DMat4::IDENTITY];
    for ring in rings {
        let maps = ring.maps();
        places = places.iter().flat_map(|outer| maps.iter().map(|inner| *outer * *inner).collect::<Vec<_>>()).collect();
    }
    places.into_iter().map(|place| Placed { body: body.clone(), place }).collect()
}

/// Eight instancers in each other, two instances each, turned and scaled so that all stays in view.
pub(crate) fn eight_deep() -> Vec<Ring> {
    let ring = |level: u32| {
        let l = f64::from(level);
        let reach = 1.2 * 0.72_f64.powf(l);
        let grow = |i: f64| DVec3::new(0.9 + 0.1 * i, 0.95, 1.05 - 0.2 * i) * if level == 7 { 0.12 } else { 1.0 };
        let turn = |i: f64| DQuat::from_rotation_z(0.4 * l + i) * DQuat::from_rotation_x(0.3 * i - 0.2 * l);
        let side = |i: f64| DVec3::new(2.0 * i - 1.0, 0.3 * (i - 0.5), 0.2 * l * (0.5 - i)) * reach * 0.5;
        Ring::new([0.0, 1.0].map(side).to_vec(), &[0.0, 1.0].map(turn), [0.0, 1.0].map(grow).to_vec())
    };
    (0..8).filter_map(ring).collect()
}

fn eye() -> Eye {
    Eye::at(DVec3::new(1.5, 2.0, 5.0), DVec3::ZERO, 0.7, SIZE)
}

fn way() -> Way {
    Way { samples: 16, bounces: 2, planes: true, ..Way::default() }
}

/// Distances and light of what is on the stage, against the tracer.
fn compare(lab: &mut Lab<'_>, case: &str, stage: &Stage, tracer: &Tracer, ulps: f64, miss: Option<Miss>) {
    let shot = lab.shoot(case, stage, &eye().camera(), &way());
    lab.distances(case, tracer, &eye(), &shot, ulps, miss);
    let reference = tracer.render(&eye(), 256, 2, true);
    lab.light(case, &reference, &eye(), &shot, &way(), miss);
}

pub(crate) fn run(lab: &mut Lab<'_>) {
    lab.case("transforms/instancers 8 deep", |lab, case| {
        let (rings, body) = (eight_deep(), Body::sphere(6, 0.7));
        let world = World { bodies: flatten(&rings, &body), dome: 1.0, sun: None };
        let stage = lab.bench.stage(|db| {
            author_nested(db, &rings, &body);
            db.upsert_light(dome(1.0));
        });
        compare(lab, case, &stage, &world.tracer(), 32.0, None);
    });
    for (name, scale) in [
        ("1e-6, 1, 1e6", DVec3::new(1e-6, 1.0, 1e6)),
        ("1e6, 1e6, 1e-6", DVec3::new(1e6, 1e6, 1e-6)),
        ("1e-6 all", DVec3::splat(1e-6)),
        ("1e6 all", DVec3::splat(1e6)),
    ] {
        // The points are stretched the other way: what is seen stays a ball.
        lab.case(&format!("transforms/scales {name}"), |lab, case| {
            counter(lab, case, &DMat4::from_scale(scale), 16.0, None);
        });
    }
    let shear = |x: f64, y: f64| DMat3::from_cols(DVec3::X, DVec3::new(x, 1.0, 0.0), DVec3::new(0.0, y, 1.0));
    for (name, map) in [("10, twice", shear(10.0, 10.0)), ("1000", shear(1000.0, 0.0))] {
        lab.case(&format!("transforms/shear of {name}"), |lab, case| {
            counter(lab, case, &DMat4::from_mat3(map), 4.0 * condition(&map), None);
        });
    }
    let mirror = DMat4::from_scale(DVec3::new(-1.0, 1.0, 1.0)) * DMat4::from_rotation_z(0.4);
    lab.case("transforms/mirror", |lab, case| counter(lab, case, &mirror, 8.0, None));
    let skew = DMat3::from_cols(DVec3::new(1.0, 0.1, 0.0), DVec3::new(0.98, 0.2, 0.05), DVec3::new(0.3, -0.4, 1.0));
    lab.case("transforms/rotation far from orthonormal", |lab, case| {
        counter(lab, case, &DMat4::from_mat3(skew), 4.0 * condition(&skew), None);
    });
    for exponent in [-4, -9] {
        lab.case(&format!("transforms/nearly singular, 1e{exponent} thin"), |lab, case| {
            let thin = DMat4::from_rotation_x(0.5) * DMat4::from_scale(DVec3::new(1.0, 10.0_f64.powi(exponent), 1.0));
            let bodies = vec![Placed { body: Body::sphere(12, 0.7), place: thin }];
            let world = World { bodies, dome: 1.0, sun: None };
            let stage = lab.bench.stage(|db| world.author(db));
            compare(lab, case, &stage, &world.tracer(), 16.0, None);
        });
    }
    lab.case("transforms/singular", singular);
    lab.case("transforms/half quaternions, not normalised", half_quaternions);
}

/// How much a map magnifies the rounding of its own coefficients, componentwise: the norm of `|M| |M^-1|` (Skeel 1979).
/// 1 for scales along the axes, however different.
fn condition(map: &DMat3) -> f64 {
    let size = |m: &DMat3| DMat3::from_cols(m.x_axis.abs(), m.y_axis.abs(), m.z_axis.abs());
    let product = size(map) * size(&map.inverse());
    (product * DVec3::ONE).max_element()
}

/// A ball whose points were put through the inverse of `map` first.
fn counter(lab: &mut Lab<'_>, case: &str, map: &DMat4, ulps: f64, miss: Option<Miss>) {
    let inverse = map.inverse();
    let body = Body::sphere(12, 0.7).moved(|p| inverse.transform_point3(p));
    let world = World { bodies: vec![Placed { body, place: *map }], dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| world.author(db));
    compare(lab, case, &stage, &world.tracer(), ulps, miss);
}

/// A singular prim is left out, with one warning; the rest is as it is without.
fn singular(lab: &mut Lab<'_>, case: &str) {
    let ball = Placed { body: Body::sphere(12, 0.7), place: DMat4::IDENTITY };
    let world = World { bodies: vec![ball], dome: 1.0, sun: None };
    let flat = Body::cube(0.5).mesh(prim("/flat", DMat4::from_scale(DVec3::new(2.0, 0.0, 2.0))), 7);
    let stage = lab.bench.stage(|db| {
        world.author(db);
        db.upsert_mesh(MeshDesc { ..flat });
    });
    let shot = lab.shoot_warned(case, &stage, &eye().camera(), &way());
    lab.distances(case, &world.tracer(), &eye(), &shot, 8.0, None);
    #[expect(clippy::cast_precision_loss, reason = "a count")]
    let warnings = shot.warnings.len() as f64;
    lab.number(case, "warnings", 1.0, warnings, 0.0);
}

/// Quaternions of half precision and any length turn as their directions say.
fn half_quaternions(lab: &mut Lab<'_>, case: &str) {
    let quaternions =
        [[0.3, 0.1, -0.2, 0.4], [3.0, -10.0, 20.0, 500.0], [6e-5, 2e-4, -1e-4, 3e-4], [0.0, 0.7, 0.7, 0.0]];
    let halves: Vec<[f16; 4]> = quaternions.iter().map(|q| q.map(f16::from_f64)).collect();
    let Ok(rotations) = TypedArray::from_vec(ElementType::Quath, halves) else {
        lab.count(case, "array of halves refused", 1.0, None);
        return;
    };
    let at = |i: f64| DVec3::new(i - 1.5, 0.3 * (i - 1.0), 0.2 * i);
    let ring = Ring {
        translations: [0.0, 1.0, 2.0, 3.0].map(at).to_vec(),
        rotations,
        scales: vec![DVec3::new(0.5, 0.3, 0.4); 4],
    };
    let (rings, body) = ([ring], Body::cube(0.6));
    let world = World { bodies: flatten(&rings, &body), dome: 1.0, sun: None };
    let stage = lab.bench.stage(|db| {
        author_nested(db, &rings, &body);
        db.upsert_light(dome(1.0));
    });
    compare(lab, case, &stage, &world.tracer(), 8.0, None);
}
