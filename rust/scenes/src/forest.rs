// SPDX-License-Identifier: Apache-2.0
//! The forest bench scene, made straight into the core: displaced spheres scattered over a hilly terrain.
//!
//! It is the scene of the project's reference figures: `instances` placements of 16 meshes of 10 000 triangles each on
//! a terrain of 100 352 triangles, a constant dome, every surface diffuse with albedo 0.5.

use anyhow::Result;
use glam::{DMat4, DQuat, DVec3, DVec4};
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::camera::Camera;
use oocpt_core::scene::{
    InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, LightDesc, LightKind, MeshDesc, PrimDesc, Primvar,
    SceneDb, Subdivision,
};
use std::sync::Arc;

/// Prototype meshes.
const MESHES: u32 = 16;
/// Half the side of the terrain, scene units.
pub(super) const HALF_SIDE: f64 = 100.0;

/// Fills `db` with the scene.
pub fn build(db: &mut SceneDb, instances: u32) -> Result<()> {
    db.upsert_mesh(terrain()?);
    for index in 0..MESHES {
        db.upsert_mesh(blob(index)?);
    }
    db.upsert_instancer(scatter(instances)?);
    db.upsert_light(LightDesc {
        prim: prim("/dome", Vec::new()),
        kind: LightKind::PLAIN_DOME,
        color: [1.0; 3],
        intensity: 1.0,
        exposure: 0.0,
        color_temperature: None,
        normalize: false,
        camera_visible: true,
        ..LightDesc::default()
    });
    Ok(())
}

/// A camera that looks over the forest from its edge.
pub fn camera(width: u32, height: u32) -> Camera {
    view(DVec3::new(0.0, 14.0, HALF_SIDE * 0.9), DVec3::new(0.0, 0.0, 20.0), width, height)
}

/// A camera at `eye` that looks at `target`.
pub(super) fn view(eye: DVec3, target: DVec3, width: u32, height: u32) -> Camera {
    let (w, h) = (f64::from(width), f64::from(height));
    let back = (eye - target).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "image sizes fit f32 and i32")]
    Camera {
        world_from_view: DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0)),
        projection: perspective(0.6, w / h, 0.1, 1000.0),
        display_window: [0.0, 0.0, w as f32, h as f32],
        data_window: [0, 0, width as i32, height as i32],
        lens_radius: 0.0,
        focus_distance: 0.0,
        clip_planes: Vec::new(),
        motion: Vec::new(),
        exposure_scale: 1.0,
    }
}

/// OpenGL perspective: vertical field of view in radians, width over height, near and far distance.
fn perspective(fov: f64, aspect: f64, near: f64, far: f64) -> DMat4 {
    let scale = 1.0 / (0.5 * fov).tan();
    DMat4::from_cols(
        DVec4::new(scale / aspect, 0.0, 0.0, 0.0),
        DVec4::new(0.0, scale, 0.0, 0.0),
        DVec4::new(0.0, 0.0, (far + near) / (near - far), -1.0),
        DVec4::new(0.0, 0.0, 2.0 * far * near / (near - far), 0.0),
    )
}

pub(super) fn prim(path: &str, instanced_by: Vec<InstancedBy>) -> PrimDesc {
    PrimDesc { path: path.into(), instanced_by, ..PrimDesc::default() }
}

/// The height of the ground, scene units.
pub(super) fn ground(x: f64, z: f64) -> f64 {
    3.0 * (0.07 * x).sin() * (0.05 * z).cos() + 0.6 * (0.31 * x + 0.2 * z).sin()
}

/// A grid of `columns` x `rows` cells of two triangles over a parametric surface.
pub(super) fn grid(path: &str, columns: u32, rows: u32, point: impl Fn(f64, f64) -> DVec3) -> Result<MeshDesc> {
    let mut points = Vec::new();
    for row in 0..=rows {
        for column in 0..=columns {
            let p = point(f64::from(column) / f64::from(columns), f64::from(row) / f64::from(rows));
            points.push(p.as_vec3().to_array());
        }
    }
    let mut indices = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let a = i32::try_from(row * (columns + 1) + column)?;
            let b = a + i32::try_from(columns + 1)?;
            indices.extend([a, b, a + 1, a + 1, b, b + 1]);
        }
    }
    let counts = vec![3_i32; indices.len() / 3];
    let color = Primvar {
        interpolation: Interpolation::Constant,
        values: TypedArray::from_vec(ElementType::Vec3f, vec![[0.5_f32; 3]])?,
        indices: None,
    };
    Ok(MeshDesc {
        prim: prim(path, Vec::new()),
        prim_id: 0,
        double_sided: true,
        left_handed: false,
        subdivision: Subdivision::None,
        face_vertex_counts: TypedArray::from_vec(ElementType::I32, counts)?,
        face_vertex_indices: TypedArray::from_vec(ElementType::I32, indices)?,
        hole_indices: None,
        points: TypedArray::from_vec(ElementType::Vec3f, points)?,
        normals: None,
        display_color: Some(color),
        display_opacity: None,
        ..MeshDesc::default()
    })
}

pub(super) fn terrain() -> Result<MeshDesc> {
    grid("/terrain", 224, 224, |u, v| {
        let (x, z) = ((2.0 * u - 1.0) * HALF_SIDE, (2.0 * v - 1.0) * HALF_SIDE);
        DVec3::new(x, ground(x, z), z)
    })
}

/// A lumpy closed blob of unit size: 100 x 50 cells of two triangles.
fn blob(index: u32) -> Result<MeshDesc> {
    let path = format!("/scatter/proto_{index}");
    let phase = f64::from(index);
    let mut mesh = grid(&path, 100, 50, |u, v| {
        let (theta, phi) = (u * std::f64::consts::TAU, 0.02 + v * (std::f64::consts::PI - 0.04));
        // The poles stay open by a pinhole: a closed grid would have zero-area triangles there.
        let bump = 1.0 + 0.15 * (3.0 * theta + phase).sin() * (4.0 * phi).sin() + 0.05 * (17.0 * phi + phase).sin();
        let direction = DVec3::new(phi.sin() * theta.cos(), phi.cos(), phi.sin() * theta.sin());
        direction * 0.4 * bump + DVec3::Y * 0.4
    })?;
    mesh.prim_id = i32::try_from(index)? + 1;
    mesh.prim.instanced_by = vec![InstancedBy { instancer: "/scatter".into(), prototype_root: path.as_str().into() }];
    Ok(mesh)
}

/// The instancer of the forest.
pub fn scatter(instances: u32) -> Result<InstancerDesc> {
    let mut state = 0x1234_5678_9abc_def0_u64;
    let mut random = move || {
        // SplitMix64: a fixed, portable sequence.
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        #[expect(clippy::cast_precision_loss, reason = "53 bits are exact in f64")]
        let unit = ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64;
        unit
    };
    let mut translations = Vec::new();
    let mut rotations = Vec::new();
    let mut scales = Vec::new();
    let mut indices = vec![Vec::new(); MESHES as usize];
    for instance in 0..instances {
        let (x, z) = ((2.0 * random() - 1.0) * HALF_SIDE, (2.0 * random() - 1.0) * HALF_SIDE);
        translations.push(DVec3::new(x, ground(x, z), z).as_vec3().to_array());
        rotations.push(DQuat::from_rotation_y(random() * std::f64::consts::TAU).as_quat().to_array());
        scales.push((DVec3::splat(0.6) + DVec3::splat(0.8 * random())).as_vec3().to_array());
        indices[(instance % MESHES) as usize].push(i32::try_from(instance)?);
    }
    let mut prototypes = Vec::new();
    for (index, list) in indices.into_iter().enumerate() {
        let root: Arc<str> = format!("/scatter/proto_{index}").into();
        prototypes.push(InstancerPrototype { root, indices: TypedArray::from_vec(ElementType::I32, list)? });
    }
    Ok(InstancerDesc {
        prim: prim("/scatter", Vec::new()),
        prototypes,
        mask: None,
        translations: Some(TypedArray::from_vec(ElementType::Vec3f, translations)?),
        rotations: Some(TypedArray::from_vec(ElementType::Quatf, rotations)?),
        scales: Some(TypedArray::from_vec(ElementType::Vec3f, scales)?),
        transforms: None,
        ..InstancerDesc::default()
    })
}
