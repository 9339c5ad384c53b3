// SPDX-License-Identifier: Apache-2.0
//! The forest by night: the same ground and blobs, lit by small lamps of every shape that stand between them, some of
//! them shaped.

use anyhow::Result;
use glam::{DMat4, DVec3};
use oocpt_core::scene::{LightDesc, LightKind, PrimDesc, SceneDb, ShapingCone};

use super::forest::{self, HALF_SIDE, ground};
use super::island::Random;

/// Where the dome of the forest is.
const DOME: &str = "/dome";

/// Fills `db` with a forest of `instances` and `lamps` lamps.
pub(crate) fn build(db: &mut SceneDb, instances: u32, lamps: u32) -> Result<()> {
    forest::build(db, instances)?;
    db.remove(DOME);
    let mut random = Random::new(&[11]);
    for lamp in 0..lamps {
        let (x, z) = (random.range(-HALF_SIDE, HALF_SIDE), random.range(-HALF_SIDE, HALF_SIDE));
        let at = DVec3::new(x, ground(x, z) + 2.0, z);
        let kind = match lamp % 4 {
            0 => LightKind::Sphere { radius: 0.2, treat_as_point: false },
            1 => LightKind::Rect { width: 0.5, height: 0.3, texture: None },
            2 => LightKind::Disk { radius: 0.3 },
            _ => LightKind::Cylinder { length: 0.6, radius: 0.05, treat_as_line: false },
        };
        // Looks down; every eighth is a spot.
        let transform = DMat4::from_translation(at) * DMat4::from_rotation_x(-0.5 * std::f64::consts::PI);
        let shaping = (lamp % 8 == 2).then(|| ShapingCone {
            cone_angle_degrees: 35.0,
            cone_softness: 0.3,
            ..ShapingCone::default()
        });
        db.upsert_light(LightDesc {
            prim: PrimDesc { transform, ..forest::prim(&format!("/lamps/lamp_{lamp}"), Vec::new()) },
            kind,
            color: [1.0, 0.8, 0.5],
            intensity: 60.0,
            shaping,
            ..LightDesc::default()
        });
    }
    Ok(())
}
