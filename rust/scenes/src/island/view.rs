// SPDX-License-Identifier: Apache-2.0
//! Where the island is seen from, and its light.

use glam::{DMat4, DQuat, DVec3, DVec4};
use oocpt_core::camera::Camera;
use oocpt_core::scene::{LightDesc, LightKind, PrimDesc};

use super::Parameters;
use super::land::Land;

/// Horizontal field of view, radians.
const FIELD_OF_VIEW: f64 = 1.05;
/// Near and far plane; only depth images look at them.
const CLIPPING: [f64; 2] = [0.1, 100_000.0];

/// A camera as USD has it; lengths in scene units.
#[derive(Clone, Copy, Debug)]
pub struct StageCamera {
    /// Camera to world.
    pub world_from_view: DMat4,
    /// Horizontal, radians.
    pub field_of_view: f64,
    /// Near and far plane.
    pub clipping: [f64; 2],
}

/// Over the shallows in front of the beach.
pub(crate) fn eye(land: &Land) -> DVec3 {
    let (x, mut z) = (0.20 * land.half, 1.2 * land.half);
    // The coast is wavy: come in from the sea until it is near.
    while land.inland(x, z) < -(0.15 * land.half).min(14.0) / land.half && z > 0.0 {
        z -= 0.005 * land.half;
    }
    DVec3::new(x, 2.0 + (0.012 * land.half).min(2.0), z)
}

/// World from view.
fn world_from_view(parameters: &Parameters) -> DMat4 {
    let land = Land::new(parameters.instances, parameters.seed);
    let eye = eye(&land);
    let target = DVec3::new(-0.22 * land.half, eye.y + 0.03 * land.half, 0.0);
    let back = (eye - target).normalize();
    let right = DVec3::Y.cross(back).normalize();
    let up = back.cross(right);
    DMat4::from_cols(right.extend(0.0), up.extend(0.0), back.extend(0.0), eye.extend(1.0))
}

/// The camera of the scene: over the beach, towards the hills.
pub fn camera(parameters: &Parameters, width: u32, height: u32) -> Camera {
    let (w, h) = (f64::from(width), f64::from(height));
    let scale = 1.0 / (0.5 * FIELD_OF_VIEW).tan();
    let [near, far] = CLIPPING;
    #[expect(clippy::cast_possible_truncation, clippy::cast_possible_wrap, reason = "image sizes fit f32 and i32")]
    Camera {
        world_from_view: world_from_view(parameters),
        projection: DMat4::from_cols(
            DVec4::new(scale, 0.0, 0.0, 0.0),
            DVec4::new(0.0, scale * w / h, 0.0, 0.0),
            DVec4::new(0.0, 0.0, (far + near) / (near - far), -1.0),
            DVec4::new(0.0, 0.0, 2.0 * far * near / (near - far), 0.0),
        ),
        display_window: [0.0, 0.0, w as f32, h as f32],
        data_window: [0, 0, width as i32, height as i32],
        lens_radius: 0.0,
        focus_distance: 0.0,
        clip_planes: Vec::new(),
        motion: Vec::new(),
        exposure_scale: 1.0,
    }
}

/// The same camera for a stage.
pub fn stage_camera(parameters: &Parameters) -> StageCamera {
    StageCamera { world_from_view: world_from_view(parameters), field_of_view: FIELD_OF_VIEW, clipping: CLIPPING }
}

/// Sky and sun.
pub(crate) fn lights() -> Vec<LightDesc> {
    let light = |path: &str, kind, color, intensity, transform| LightDesc {
        prim: PrimDesc { path: path.into(), transform, ..PrimDesc::default() },
        // The sun's intensity is the irradiance on a surface that faces it.
        normalize: matches!(kind, LightKind::Distant { .. }),
        kind,
        color,
        intensity,
        exposure: 0.0,
        color_temperature: None,
        camera_visible: true,
        ..LightDesc::default()
    };
    let to_sun = DVec3::new(0.62, 0.55, 0.45).normalize();
    let turn = DMat4::from_quat(DQuat::from_rotation_arc(DVec3::Z, to_sun));
    let sun = LightKind::Distant { angle_degrees: 0.53 };
    vec![
        light("/World/Sky", LightKind::PLAIN_DOME, [0.50, 0.70, 1.0], 0.75, DMat4::IDENTITY),
        light("/World/Sun", sun, [1.0, 0.88, 0.70], 3.6, turn),
    ]
}
