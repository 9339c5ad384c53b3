// SPDX-License-Identifier: Apache-2.0
//! Scenes of many small chunks, each with another way to go wrong.

use crate::lights::TestFiles;
use crate::scenes::{constant, dome, glow, instanced, instancer, mesh, prim, sphere, square, sun};
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::scene::{
    CurveBasis, CurveWrap, CurvesDesc, InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, MeshDesc,
    NamedPrimvar, PrimDesc, PrimShape, Primvar, SceneDb, TransformSample,
};
use oocpt_core::{DomeFormat, LightDesc, LightKind, ShapingCone, TypedArray};

/// A scene, where its camera stands and what it looks at.
pub(crate) struct Scene {
    pub(crate) name: &'static str,
    pub(crate) build: fn(&mut SceneDb),
    pub(crate) eye: DVec3,
    pub(crate) target: DVec3,
}

/// All of them.
pub(crate) const SCENES: [Scene; 10] = [
    Scene { name: "flat", build: flat, eye: DVec3::new(6.0, 5.0, 12.0), target: DVec3::ZERO },
    Scene { name: "nested", build: nested, eye: DVec3::new(6.0, 5.0, 14.0), target: DVec3::ZERO },
    Scene { name: "overlapping chunks", build: overlapping, eye: DVec3::new(0.0, 2.0, 11.0), target: DVec3::ZERO },
    Scene { name: "one huge mesh", build: huge_mesh, eye: DVec3::new(3.0, 4.0, 7.0), target: DVec3::ZERO },
    Scene { name: "camera inside chunks", build: around, eye: DVec3::ZERO, target: DVec3::new(1.0, -0.2, -1.0) },
    Scene { name: "thin shadow casters", build: poles, eye: DVec3::new(0.0, 6.0, 9.0), target: DVec3::ZERO },
    Scene { name: "lamps under a sky", build: lamps, eye: DVec3::new(6.0, 5.0, 12.0), target: DVec3::ZERO },
    Scene { name: "coloured instances", build: coloured, eye: DVec3::new(6.0, 5.0, 14.0), target: DVec3::ZERO },
    Scene { name: "bulbs", build: bulbs, eye: DVec3::new(6.0, 5.0, 14.0), target: DVec3::ZERO },
    Scene { name: "fur and spray", build: fur, eye: DVec3::new(3.0, 3.0, 9.0), target: DVec3::ZERO },
];

/// Numbers between 0 and 1 that only depend on `i` (the R2 sequence and one more).
pub(super) fn scattered(i: u32) -> DVec3 {
    let i = f64::from(i);
    DVec3::new(0.754_877_666_246_7 * i, 0.569_840_290_998 * i, 0.381_966_011_250_1 * i).fract()
}

pub(super) fn lights(db: &mut SceneDb) {
    db.upsert_light(dome([0.4, 0.5, 0.7]));
    db.upsert_light(sun(2.0, 2.0, DMat4::from_rotation_x(-0.8) * DMat4::from_rotation_y(0.5)));
}

pub(super) fn ground(db: &mut SceneDb, half: f64, y: f64) {
    let place = DMat4::from_translation(DVec3::Y * y) * DMat4::from_scale(DVec3::splat(half));
    db.upsert_mesh(square(prim("/ground", place), 1, 0.5));
}

/// Sixty meshes, no two alike.
fn flat(db: &mut SceneDb) {
    lights(db);
    ground(db, 12.0, -1.0);
    for i in 0..60 {
        let at = (scattered(i) - 0.5) * DVec3::new(12.0, 2.0, 12.0);
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.7));
        let albedo = 0.3 + 0.01 * f32::from(u8::try_from(i).expect("small"));
        db.upsert_mesh(sphere(prim(&format!("/ball_{i}"), place), 10 + i32::try_from(i).expect("small"), 6, albedo));
    }
}

/// Cubic curves of many pieces, in clusters and in instances, and points.
fn fur(db: &mut SceneDb) {
    lights(db);
    ground(db, 12.0, -1.2);
    let roots = 0..600_u32;
    let along = |i: u32, k: u32| {
        let root = (scattered(i) - 0.5) * DVec3::new(5.0, 0.0, 5.0) - DVec3::Y;
        let bend = (scattered(i + 3000) - 0.5) * 0.4 * f64::from(k * k);
        (root + bend + DVec3::Y * 0.4 * f64::from(k)).as_vec3().to_array()
    };
    let curves = CurvesDesc {
        basis: CurveBasis::BSpline,
        wrap: CurveWrap::Pinned,
        counts: TypedArray::of(vec![4_i32; 600]),
        indices: None,
    };
    let hair = MeshDesc {
        shape: PrimShape::Curves(curves),
        points: TypedArray::of::<[f32; 3]>(roots.flat_map(|i| (0..4).map(move |k| along(i, k))).collect()),
        widths: constant(0.05_f32),
        ..mesh(prim("/hair", DMat4::IDENTITY), 2, Vec::new(), &[], 0.4)
    };
    let tufts: Vec<_> = (0..30)
        .map(|i| ((scattered(i) - 0.5) * DVec3::new(9.0, 1.0, 9.0), DQuat::IDENTITY, DVec3::splat(0.3)))
        .collect();
    db.upsert_instancer(instancer(prim("/tufts", DMat4::IDENTITY), "/tufts/hair", &tufts));
    db.upsert_mesh(MeshDesc { prim: instanced(prim("/tufts/hair", DMat4::IDENTITY), "/tufts"), ..hair.clone() });
    db.upsert_mesh(hair);
    let spray = (0..900).map(|i| ((scattered(i) - 0.5) * DVec3::new(6.0, 4.0, 6.0)).as_vec3().to_array());
    db.upsert_mesh(MeshDesc {
        shape: PrimShape::Points,
        points: TypedArray::of::<[f32; 3]>(spray.collect()),
        widths: constant(0.09_f32),
        ..mesh(prim("/spray", DMat4::IDENTITY), 3, Vec::new(), &[], 0.8)
    });
}

/// Clumps of hundreds of balls, too large to be loaded whole.
fn nested(db: &mut SceneDb) {
    lights(db);
    ground(db, 14.0, -1.5);
    db.upsert_instancer(clumps());
    db.upsert_instancer(balls(0, 700, "/outer/clump"));
    db.upsert_mesh(sphere(instanced(prim("/outer/clump/ball", DMat4::IDENTITY), "/outer/clump"), 2, 5, 0.6));
}

fn clumps() -> InstancerDesc {
    let outer: Vec<_> = (0..9)
        .map(|i| {
            let at = (scattered(i) - 0.5) * DVec3::new(16.0, 1.0, 16.0);
            let mirror = if i % 3 == 1 { -1.0 } else { 1.0 };
            (at, DQuat::from_rotation_y(0.9 * f64::from(i)), DVec3::new(mirror, 1.1, 0.9))
        })
        .collect();
    instancer(prim("/outer", DMat4::IDENTITY), "/outer/clump", &outer)
}

/// Balls of a clump, in an instancer of this path.
pub(super) fn balls(first: u32, end: u32, path: &str) -> InstancerDesc {
    let mut clump = prim(path, DMat4::IDENTITY);
    clump.instanced_by = instanced(prim("/outer/clump", DMat4::IDENTITY), "/outer").instanced_by;
    let inner: Vec<_> = (first..end)
        .map(|i| {
            let at = (scattered(i) - 0.5) * DVec3::new(4.0, 2.0, 4.0);
            (at, DQuat::from_rotation_z(f64::from(i)), DVec3::new(0.12, 0.1, 0.14))
        })
        .collect();
    instancer(clump, &format!("{path}/ball"), &inner)
}

/// As `nested`: each clump has a colour, half of the balls in it one of their own, and some are there in part only.
fn coloured(db: &mut SceneDb) {
    nested(db);
    let per_instance = |name: &str, values: TypedArray| NamedPrimvar {
        name: name.into(),
        primvar: Primvar { interpolation: Interpolation::Instance, values, indices: None },
    };
    let color = |i: u32| scattered(i + 1).as_vec3().to_array();
    let mut outer = clumps();
    outer.primvars = vec![per_instance("displayColor", TypedArray::of((0..9).map(color).collect::<Vec<_>>()))];
    db.upsert_instancer(outer);
    let mut inner = balls(0, 350, "/outer/clump");
    let opacities: Vec<f32> = (0..350_u16).map(|i| 0.25 + 0.25 * f32::from(i % 4)).collect();
    inner.primvars = vec![
        per_instance("displayColor", TypedArray::of((0..350).map(color).collect::<Vec<_>>())),
        per_instance("displayOpacity", TypedArray::of(opacities)),
    ];
    db.upsert_instancer(inner);
    db.upsert_instancer(balls(350, 700, "/outer/more"));
    for path in ["/outer/clump", "/outer/more"] {
        let ball = sphere(instanced(prim(&format!("{path}/ball"), DMat4::IDENTITY), path), 2, 5, 0.6);
        db.upsert_mesh(MeshDesc { display_color: None, ..ball });
    }
}

/// Rods that reach through everything: the boxes of all chunks overlap.
fn overlapping(db: &mut SceneDb) {
    lights(db);
    let rods: Vec<_> = (0..1500)
        .map(|i| {
            let at = (scattered(i) - 0.5) * 6.0;
            let turn = scattered(7 * i + 3) * 6.0;
            (at, DQuat::from_euler(glam::EulerRot::XYZ, turn.x, turn.y, turn.z), DVec3::new(0.02, 1.0, 0.02))
        })
        .collect();
    db.upsert_instancer(instancer(prim("/rods", DMat4::IDENTITY), "/rods/rod", &rods));
    db.upsert_mesh(sphere(instanced(prim("/rods/rod", DMat4::IDENTITY), "/rods"), 2, 5, 0.7));
}

/// A hilly sheet that is split into many clusters, twice, once turned.
fn huge_mesh(db: &mut SceneDb) {
    const N: i32 = 56;
    lights(db);
    let at = |i: i32| f64::from(i) / f64::from(N) - 0.5;
    let mut points = Vec::new();
    for z in 0..=N {
        for x in 0..=N {
            let height =
                0.08 * (17.0 * at(x)).sin() * (13.0 * at(z)).cos() + 0.02 * (71.0 * at(x) + 53.0 * at(z)).sin();
            points.push((DVec3::new(at(x), height, at(z)) * 10.0).as_vec3().to_array());
        }
    }
    let corner = |x: i32, z: i32| z * (N + 1) + x;
    let cells = (0..N).flat_map(|z| (0..N).map(move |x| (x, z)));
    let faces: Vec<_> =
        cells.map(|(x, z)| vec![corner(x, z), corner(x, z + 1), corner(x + 1, z + 1), corner(x + 1, z)]).collect();
    db.upsert_mesh(mesh(prim("/sheet", DMat4::IDENTITY), 1, points.clone(), &faces, 0.6));
    let above = DMat4::from_translation(DVec3::new(0.0, 1.5, -3.0))
        * DMat4::from_rotation_x(1.0)
        * DMat4::from_scale(DVec3::splat(0.4));
    db.upsert_mesh(mesh(prim("/leaning", above), 2, points, &faces, 0.6));
}

/// Props of which every part of the set has each one, in place of cells with props of their own.
pub(crate) const SET: Scene = Scene { name: "set", build: set, eye: DVec3::new(5.0, 4.0, 11.0), target: DVec3::ZERO };

/// Meshes of [`SET`], and placements of them.
const PROPS: u32 = 24;
const PLACED: u32 = 1000;

fn set(db: &mut SceneDb) {
    lights(db);
    ground(db, 12.0, -1.0);
    let places: Vec<_> = (0..PLACED)
        .map(|i| {
            let at = (scattered(i) - 0.5) * DVec3::new(14.0, 2.5, 14.0);
            (at, DQuat::from_rotation_y(f64::from(i)), DVec3::splat(0.25))
        })
        .collect();
    let root = |prop: u32| format!("/set/prop_{prop}");
    let mut placed = instancer(prim("/set", DMat4::IDENTITY), "", &places);
    placed.prototypes = (0..PROPS)
        .map(|prop| {
            let indices: Vec<i32> = (0..PLACED).filter(|i| i % PROPS == prop).map(u32::cast_signed).collect();
            InstancerPrototype { root: root(prop).into(), indices: TypedArray::of(indices) }
        })
        .collect();
    db.upsert_instancer(placed);
    for prop in 0..PROPS {
        let number = i32::try_from(prop).expect("small");
        let mut of = prim(&root(prop), DMat4::IDENTITY);
        of.instanced_by = vec![InstancedBy { instancer: "/set".into(), prototype_root: root(prop).into() }];
        let albedo = 0.4 + 0.01 * f32::from(u8::try_from(prop).expect("small"));
        db.upsert_mesh(sphere(of, 10 + number, 8 + number % 5, albedo));
    }
}

/// Tens of thousands of grains: ten MiB of instance records.
pub(crate) const BEACH: Scene =
    Scene { name: "beach", build: beach, eye: DVec3::new(0.0, 3.0, 9.0), target: DVec3::ZERO };

fn beach(db: &mut SceneDb) {
    lights(db);
    ground(db, 12.0, 0.0);
    let grains: Vec<_> = (0..80_000)
        .map(|i| {
            let at = (scattered(i) - 0.5) * DVec3::new(20.0, 0.0, 20.0);
            (at, DQuat::from_rotation_y(f64::from(i)), DVec3::splat(0.03))
        })
        .collect();
    db.upsert_instancer(instancer(prim("/grains", DMat4::IDENTITY), "/grains/grain", &grains));
    db.upsert_mesh(sphere(instanced(prim("/grains/grain", DMat4::IDENTITY), "/grains"), 2, 4, 0.6));
}

/// Sixty balls under a dome with a picture, lamps of all kinds among them; one has no shadows, one coloured ones.
fn lamps(db: &mut SceneDb) {
    lamps_and_sky(db, &|_| Vec::new());
}

/// With what `motion` says of each transform.
pub(super) fn lamps_and_sky(db: &mut SceneDb, motion: &dyn Fn(DMat4) -> Vec<TransformSample>) {
    flat(db);
    db.remove("/sun");
    let texture = Some(TestFiles::asset("sky"));
    let sky = LightKind::Dome { texture, format: DomeFormat::Latlong };
    let mut sky = LightDesc { kind: sky, intensity: 0.3, ..dome([1.0; 3]) };
    sky.prim.motion = motion(sky.prim.transform);
    db.upsert_light(sky);
    let point = LightKind::Sphere { radius: 0.2, treat_as_point: true };
    let kinds = [
        LightKind::Rect { width: 2.0, height: 1.0, texture: None },
        LightKind::Sphere { radius: 0.3, treat_as_point: false },
        LightKind::Disk { radius: 0.7 },
        LightKind::Cylinder { length: 2.0, radius: 0.1, treat_as_line: false },
        point,
    ];
    for i in 0..20_u32 {
        let at = (scattered(i + 100) - 0.5) * DVec3::new(12.0, 3.0, 12.0) + DVec3::Y * 1.5;
        let turn = scattered(7 * i + 3) * 6.0;
        let place =
            DMat4::from_rotation_translation(DQuat::from_euler(glam::EulerRot::XYZ, turn.x, turn.y, turn.z), at);
        let shaping = (i % 4 == 1).then(|| ShapingCone {
            cone_angle_degrees: 50.0,
            cone_softness: 0.4,
            ..ShapingCone::default()
        });
        db.upsert_light(LightDesc {
            prim: PrimDesc { motion: motion(place), ..prim(&format!("/lamp_{i}"), place) },
            kind: kinds[i as usize % kinds.len()].clone(),
            color: [1.0, 0.8, 0.5],
            intensity: 3.0,
            shaping,
            shadow_enable: i != 6,
            shadow_color: if i == 8 { [0.5; 3] } else { [0.0; 3] },
            diffuse: if i == 3 { 0.5 } else { 1.0 },
            ..LightDesc::default()
        });
    }
}

/// Clumps of balls of which some glow, a mesh in many clusters that glows too, and a lamp of another kind.
fn bulbs(db: &mut SceneDb) {
    nested(db);
    db.remove("/sun");
    db.upsert_material(glow("/glow", [2.0, 1.5, 1.0]));
    db.upsert_material(glow("/ember", [0.4, 0.1, 0.0]));
    for i in 0..6_u32 {
        let at = (scattered(i + 40) - 0.5) * DVec3::new(12.0, 2.0, 12.0) + DVec3::Y;
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::new(0.3, 0.2, 0.25));
        let mut bulb = sphere(prim(&format!("/bulb_{i}"), place), 100 + i32::try_from(i).expect("small"), 6, 0.5);
        bulb.material = Some("/glow".into());
        db.upsert_mesh(bulb);
    }
    let mut large = sphere(prim("/large", DMat4::from_translation(DVec3::Y * 3.0)), 90, 40, 0.5);
    large.material = Some("/ember".into());
    db.upsert_mesh(large);
    let root = "/outer/clump/swarm/bulb";
    let mut swarm = sphere(instanced(prim(root, DMat4::IDENTITY), "/outer/clump/swarm"), 91, 5, 0.5);
    swarm.material = Some("/glow".into());
    db.upsert_mesh(swarm);
    let places: Vec<_> = (0..40)
        .map(|i| {
            let at = (scattered(i + 500) - 0.5) * DVec3::new(4.0, 3.0, 4.0);
            (at, DQuat::from_rotation_y(f64::from(i)), DVec3::new(0.05, 0.03, 0.06))
        })
        .collect();
    let mut inside = instanced(prim("/outer/clump/swarm", DMat4::IDENTITY), "/outer");
    inside.instanced_by[0].prototype_root = "/outer/clump".into();
    db.upsert_instancer(instancer(inside, root, &places));
    db.upsert_light(LightDesc {
        prim: prim("/lamp", DMat4::from_translation(DVec3::Y * 4.0)),
        kind: LightKind::Sphere { radius: 0.3, treat_as_point: false },
        intensity: 2.0,
        ..LightDesc::default()
    });
}

/// Balls on all sides of the camera, some so near that their chunks hold it.
fn around(db: &mut SceneDb) {
    lights(db);
    let balls: Vec<_> = (0..2000)
        .map(|i| {
            let at = (scattered(i) - 0.5) * 8.0;
            let size = if at.length() < 0.5 { 0.01 } else { 0.08 };
            (at, DQuat::from_rotation_x(f64::from(i)), DVec3::splat(size))
        })
        .collect();
    db.upsert_instancer(instancer(prim("/balls", DMat4::IDENTITY), "/balls/ball", &balls));
    db.upsert_mesh(sphere(instanced(prim("/balls/ball", DMat4::IDENTITY), "/balls"), 2, 5, 0.6));
}

/// Poles of a few millimetres whose shadows cross many chunks, and a low sun without extent.
fn poles(db: &mut SceneDb) {
    db.upsert_light(dome([0.05; 3]));
    db.upsert_light(sun(3.0, 0.0, DMat4::from_rotation_y(0.8) * DMat4::from_rotation_x(-0.2)));
    ground(db, 8.0, 0.0);
    let poles: Vec<_> = (0..900)
        .map(|i| {
            let at = (scattered(i) - 0.5) * DVec3::new(14.0, 0.0, 14.0);
            (at, DQuat::from_rotation_y(f64::from(i)), DVec3::new(0.01, 1.0, 0.01))
        })
        .collect();
    db.upsert_instancer(instancer(prim("/poles", DMat4::IDENTITY), "/poles/pole", &poles));
    db.upsert_mesh(sphere(instanced(prim("/poles/pole", DMat4::IDENTITY), "/poles"), 2, 5, 0.2));
}
