// SPDX-License-Identifier: Apache-2.0
//! The scenes of the tests, small and made of few pieces.

use glam::{DMat4, DQuat, DVec3, Vec3};
use oocpt_core::TypedArray;
use oocpt_core::scene::{
    InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, LightDesc, LightKind, MaterialDesc, MeshDesc,
    NodeDesc, ParamDesc, ParamValue, PointsMotion, PointsSample, PrimDesc, Primvar, SceneDb, Subdivision,
};

/// A visible prim.
pub(crate) fn prim(path: &str, transform: DMat4) -> PrimDesc {
    PrimDesc { path: path.into(), transform, ..PrimDesc::default() }
}

/// The same prim as a prototype root of `instancer`.
pub(crate) fn instanced(mut prim: PrimDesc, instancer: &str) -> PrimDesc {
    let prototype_root = prim.path.clone();
    prim.instanced_by = vec![InstancedBy { instancer: instancer.into(), prototype_root }];
    prim
}

/// A constant primvar.
pub(crate) fn constant<T: oocpt_core::ArrayElement + std::fmt::Debug>(value: T) -> Option<Primvar> {
    Some(Primvar { interpolation: Interpolation::Constant, values: TypedArray::of(vec![value]), indices: None })
}

/// A mesh of the given faces, flat shaded, one colour.
pub(crate) fn mesh(prim: PrimDesc, prim_id: i32, points: Vec<[f32; 3]>, faces: &[Vec<i32>], albedo: f32) -> MeshDesc {
    MeshDesc {
        prim,
        prim_id,
        double_sided: true,
        left_handed: false,
        subdivision: Subdivision::None,
        face_vertex_counts: TypedArray::of(
            faces.iter().map(|face| i32::try_from(face.len()).expect("small")).collect::<Vec<i32>>(),
        ),
        face_vertex_indices: TypedArray::of(faces.concat()),
        hole_indices: None,
        points: TypedArray::of(points),
        normals: None,
        display_color: constant([albedo; 3]),
        display_opacity: None,
        ..MeshDesc::default()
    }
}

/// A square of two units in the plane y = 0, facing up.
pub(crate) fn square(prim: PrimDesc, prim_id: i32, albedo: f32) -> MeshDesc {
    let points = vec![[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]];
    mesh(prim, prim_id, points, &[vec![0, 1, 2, 3]], albedo)
}

/// A closed sphere of radius 1: `rings` x `2 * rings` cells, triangles at the poles.
pub(crate) fn sphere(prim: PrimDesc, prim_id: i32, rings: i32, albedo: f32) -> MeshDesc {
    let columns = 2 * rings;
    let mut points = vec![[0.0, 1.0, 0.0]];
    for ring in 1..rings {
        for column in 0..columns {
            let phi = std::f64::consts::PI * f64::from(ring) / f64::from(rings);
            let theta = std::f64::consts::TAU * f64::from(column) / f64::from(columns);
            points.push(DVec3::new(phi.sin() * theta.cos(), phi.cos(), -phi.sin() * theta.sin()).as_vec3().to_array());
        }
    }
    points.push([0.0, -1.0, 0.0]);
    let last = i32::try_from(points.len()).expect("small") - 1;
    let at = |ring: i32, column: i32| 1 + (ring - 1) * columns + column % columns;
    let mut faces = Vec::new();
    for column in 0..columns {
        faces.push(vec![0, at(1, column), at(1, column + 1)]);
        for ring in 1..rings - 1 {
            let (a, b) = (at(ring, column), at(ring + 1, column));
            faces.push(vec![a, b, at(ring + 1, column + 1), at(ring, column + 1)]);
        }
        faces.push(vec![at(rings - 1, column), last, at(rings - 1, column + 1)]);
    }
    mesh(prim, prim_id, points, &faces, albedo)
}

/// A `UsdPreviewSurface` that emits.
pub(crate) fn glow(path: &str, radiance: [f32; 3]) -> MaterialDesc {
    let surface = NodeDesc {
        path: format!("{path}/surface").into(),
        kind: "UsdPreviewSurface".into(),
        params: vec![ParamDesc { name: "emissiveColor".into(), value: ParamValue::Vec3(radiance) }],
        connections: Vec::new(),
    };
    MaterialDesc { path: path.into(), nodes: vec![surface], surface: Some(0), ..MaterialDesc::default() }
}

/// A dome of constant radiance.
pub(crate) fn dome(radiance: [f32; 3]) -> LightDesc {
    LightDesc {
        prim: prim("/dome", DMat4::IDENTITY),
        kind: LightKind::PLAIN_DOME,
        color: radiance,
        intensity: 1.0,
        exposure: 0.0,
        color_temperature: None,
        normalize: false,
        camera_visible: true,
        ..LightDesc::default()
    }
}

/// A distant light of the given irradiance, full angle in degrees, shining along the -z axis of `transform`.
pub(crate) fn sun(irradiance: f32, angle_degrees: f32, transform: DMat4) -> LightDesc {
    LightDesc {
        prim: prim("/sun", transform),
        kind: LightKind::Distant { angle_degrees },
        color: [1.0; 3],
        intensity: irradiance,
        normalize: true,
        ..dome([1.0; 3])
    }
}

/// `desc` with the points of `place` at times of the shutter.
pub(crate) fn deforming(desc: MeshDesc, times: &[f64], place: &dyn Fn(Vec3, f64) -> Vec3) -> MeshDesc {
    let view = desc.points.view();
    #[expect(clippy::unwrap_used, reason = "a test")]
    let points = |time: f64| -> TypedArray {
        let placed = |at: usize| place(view.vec3(at).unwrap().as_vec3(), time).to_array();
        TypedArray::of((0..view.len()).map(placed).collect::<Vec<[f32; 3]>>())
    };
    let samples: Vec<_> =
        times.iter().map(|&time| PointsSample { time, points: points(time), normals: None, widths: None }).collect();
    let first = samples[0].points.clone();
    let samples = if samples.len() > 1 { samples } else { Vec::new() };
    MeshDesc { points: first, point_motion: PointsMotion { samples, ..PointsMotion::default() }, ..desc }
}

/// The mesh of [`deforming`] with widths that change.
pub(crate) fn widening(mut desc: MeshDesc, width: &dyn Fn(f64) -> f32) -> MeshDesc {
    desc.widths = constant(width(desc.point_motion.samples[0].time));
    for sample in &mut desc.point_motion.samples {
        sample.widths = Some(TypedArray::of(vec![width(sample.time)]));
    }
    desc
}

/// The mesh of [`deforming`] with normals that turn.
pub(crate) fn turning(mut desc: MeshDesc, normal: &dyn Fn(f64) -> Vec3) -> MeshDesc {
    desc.normals = constant(normal(desc.point_motion.samples[0].time).to_array());
    for sample in &mut desc.point_motion.samples {
        sample.normals = Some(TypedArray::of(vec![normal(sample.time).to_array()]));
    }
    desc
}

/// An instancer with one prototype.
pub(crate) fn instancer(prim: PrimDesc, root: &str, places: &[(DVec3, DQuat, DVec3)]) -> InstancerDesc {
    let numbers: Vec<i32> = (0..).take(places.len()).collect();
    let rotations: Vec<[f32; 4]> = places.iter().map(|place| place.1.as_quat().to_array()).collect();
    InstancerDesc {
        prim,
        prototypes: vec![InstancerPrototype { root: root.into(), indices: TypedArray::of(numbers) }],
        mask: None,
        translations: Some(TypedArray::of(places.iter().map(|p| p.0.as_vec3().to_array()).collect::<Vec<_>>())),
        rotations: Some(
            TypedArray::from_vec(oocpt_core::ElementType::Quatf, rotations).expect("quaternions are four floats"),
        ),
        scales: Some(TypedArray::of(places.iter().map(|p| p.2.as_vec3().to_array()).collect::<Vec<_>>())),
        transforms: None,
        ..InstancerDesc::default()
    }
}

/// Placements of the outer and inner instancer of [`nested`]: turned, stretched, one mirrored.
pub(crate) fn places() -> [Vec<(DVec3, DQuat, DVec3)>; 2] {
    let outer = (0..3).map(|i| {
        let x = f64::from(i);
        let mirror = if i == 1 { -1.0 } else { 1.0 };
        (DVec3::new(2.4 * x - 2.4, 0.1 * x, -0.5 * x), DQuat::from_rotation_y(0.7 * x), DVec3::new(mirror, 1.0, 1.2))
    });
    let inner = (0..4).map(|i| {
        let angle = f64::from(i) * 1.7;
        let at = DVec3::new(0.6 * angle.cos(), 0.35 + 0.2 * f64::from(i), 0.6 * angle.sin());
        (at, DQuat::from_rotation_z(angle), DVec3::new(0.3, 0.2 + 0.05 * f64::from(i), 0.35))
    });
    [outer.collect(), inner.collect()]
}

pub(crate) fn matrix(place: &(DVec3, DQuat, DVec3)) -> DMat4 {
    // As the arrays are stored: single precision.
    DMat4::from_translation(place.0.as_vec3().as_dvec3())
        * DMat4::from_quat(place.1.as_quat().as_dquat())
        * DMat4::from_scale(place.2.as_vec3().as_dvec3())
}

/// Ground, lights, and three clumps of four spheres and a square, instanced in two levels.
pub(crate) fn nested(db: &mut SceneDb) {
    ground_and_lights(db);
    let [outer, inner] = places();
    db.upsert_instancer(instancer(prim("/outer", DMat4::IDENTITY), "/outer/clump", &outer));
    let clump = instanced(prim("/outer/clump", DMat4::IDENTITY), "/outer");
    db.upsert_instancer(instancer(clump.clone(), "/outer/clump/ball", &inner));
    db.upsert_mesh(sphere(instanced(prim("/outer/clump/ball", DMat4::IDENTITY), "/outer/clump"), 2, 8, 0.6));
    let mut mat = prim("/outer/clump/mat", DMat4::from_translation(DVec3::Y * 0.05));
    mat.instanced_by = clump.instanced_by;
    db.upsert_mesh(square(mat, 3, 0.3));
}

/// The scene of [`nested`] with every placement a mesh of its own.
pub(crate) fn flattened(db: &mut SceneDb) {
    ground_and_lights(db);
    let [outer, inner] = places();
    for (o, outer) in outer.iter().enumerate() {
        for (i, inner) in inner.iter().enumerate() {
            let place = prim(&format!("/flat/ball_{o}_{i}"), matrix(outer) * matrix(inner));
            db.upsert_mesh(sphere(place, 2, 8, 0.6));
        }
        let place = prim(&format!("/flat/mat_{o}"), matrix(outer) * DMat4::from_translation(DVec3::Y * 0.05));
        db.upsert_mesh(square(place, 3, 0.3));
    }
}

fn ground_and_lights(db: &mut SceneDb) {
    db.upsert_mesh(square(prim("/ground", DMat4::from_scale(DVec3::splat(6.0))), 1, 0.5));
    db.upsert_light(dome([0.3, 0.4, 0.6]));
    db.upsert_light(sun(2.0, 3.0, DMat4::from_rotation_x(-0.9) * DMat4::from_rotation_y(0.4)));
}

/// Every shading feature at once: vertex colours, face-varying normals, opacity, a left-handed mesh, a mirrored one.
pub(crate) fn features(db: &mut SceneDb) {
    ground_and_lights(db);
    let mut smooth = sphere(prim("/smooth", DMat4::from_translation(DVec3::new(-1.6, 1.0, 0.0))), 4, 8, 0.5);
    smooth.subdivision = Subdivision::CatmullClark;
    let count = smooth.points.len();
    let ramp = |i: usize| {
        #[expect(clippy::cast_precision_loss, reason = "a few hundred points")]
        let t = i as f32 / count as f32;
        [0.2 + 0.6 * t, 0.5, 0.8 - 0.6 * t]
    };
    smooth.display_color = Some(Primvar {
        interpolation: Interpolation::Vertex,
        values: TypedArray::of((0..count).map(ramp).collect::<Vec<_>>()),
        indices: None,
    });
    db.upsert_mesh(smooth);
    let mut veil = square(prim("/veil", tilted(DVec3::new(1.2, 1.0, 0.8))), 5, 0.7);
    veil.display_opacity = Some(Primvar {
        interpolation: Interpolation::Vertex,
        values: TypedArray::of(vec![0.0_f32, 1.0, 0.5, 0.25]),
        indices: None,
    });
    db.upsert_mesh(veil);
    let mirrored = DMat4::from_translation(DVec3::new(1.0, 0.6, -1.4)) * DMat4::from_scale(DVec3::new(-0.6, 0.6, 0.6));
    let mut other = sphere(prim("/mirrored", mirrored), 6, 6, 0.4);
    other.left_handed = true;
    db.upsert_mesh(other);
}

fn tilted(at: DVec3) -> DMat4 {
    DMat4::from_translation(at) * DMat4::from_rotation_x(1.2)
}
