// SPDX-License-Identifier: Apache-2.0
//! A heap of leaves: every leaf an instance of one card, over a ground, under a dome.

use anyhow::Result;
use glam::{DQuat, DVec3};
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::camera::Camera;
use oocpt_core::scene::{InstancedBy, InstancerDesc, InstancerPrototype, LightDesc, LightKind, SceneDb};

use super::forest::{self, grid, prim};
use super::island::Random;
use super::preview::{Picture, cards, material};

/// How leaves are there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Leaves {
    /// The colour of a picture, no opacity.
    Opaque,
    /// The same picture's alpha, which is 1 all over, cuts at 0.5.
    Sheets,
    /// A picture with the shape of a leaf in its alpha cuts at 0.5.
    Cut,
}

impl Leaves {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::Opaque, Self::Sheets, Self::Cut];

    /// The name in options and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Opaque => "opaque",
            Self::Sheets => "opaque picture",
            Self::Cut => "cut out",
        }
    }
}

/// Half the side of the box that the leaves fill, scene units.
const HALF_SIDE: f64 = 1.0;

/// Fills `db` with `count` leaves; side of their picture in texels.
pub fn build(db: &mut SceneDb, kind: Leaves, count: u32, texture_size: u32) -> Result<()> {
    let side = texture_size.max(2);
    let (picture, outputs): (_, &[_]) = match kind {
        Leaves::Opaque => ("sheet", &[("rgb", "diffuseColor")]),
        Leaves::Sheets => ("sheet", &[("rgb", "diffuseColor"), ("a", "opacity")]),
        Leaves::Cut => ("leaf", &[("rgb", "diffuseColor"), ("a", "opacity")]),
    };
    let threshold = (kind != Leaves::Opaque).then_some(0.5);
    let picture = Picture { name: format!("{picture}:{side}:1"), outputs };
    db.upsert_material(material("/leaf", &[picture], threshold));
    let mut leaf = grid("/heap/leaf", 1, 1, |u, v| DVec3::new(u, v, 0.0))?;
    leaf.prim_id = 1;
    leaf.prim.instanced_by = vec![InstancedBy { instancer: "/heap".into(), prototype_root: "/heap/leaf".into() }];
    db.upsert_mesh(cards(leaf, &[(DVec3::ZERO, DVec3::X, DVec3::Y)], "/leaf")?);
    db.upsert_instancer(scatter(count)?);
    let mut ground = grid("/ground", 1, 1, |u, v| DVec3::new(20.0 * u - 10.0, -HALF_SIDE, 10.0 - 20.0 * v))?;
    ground.prim_id = 2;
    db.upsert_mesh(ground);
    db.upsert_light(LightDesc {
        prim: prim("/dome", Vec::new()),
        kind: LightKind::PLAIN_DOME,
        color: [1.0; 3],
        intensity: 1.0,
        exposure: 0.0,
        camera_visible: true,
        ..LightDesc::default()
    });
    Ok(())
}

/// A camera that the heap fills most of the picture of.
pub fn camera(width: u32, height: u32) -> Camera {
    forest::view(DVec3::new(0.0, 1.2, 4.0), DVec3::new(0.0, -0.1, 0.0), width, height)
}

fn scatter(count: u32) -> Result<InstancerDesc> {
    let mut random = Random::new(&[5]);
    let (mut translations, mut rotations) = (Vec::new(), Vec::new());
    // Eight times the box's front in leaves, however many there are.
    let half = (8.0 * HALF_SIDE * HALF_SIDE / f64::from(count.max(1))).sqrt();
    for _ in 0..count {
        let mut coordinate = || random.range(-HALF_SIDE, HALF_SIDE);
        translations.push(DVec3::new(coordinate(), coordinate(), coordinate()).as_vec3().to_array());
        rotations.push(DQuat::from_axis_angle(random.direction(), random.angle()).as_quat().to_array());
    }
    let scales = vec![DVec3::splat(half).as_vec3().to_array(); count as usize];
    let indices = TypedArray::from_vec(ElementType::I32, (0..i32::try_from(count)?).collect::<Vec<_>>())?;
    Ok(InstancerDesc {
        prim: prim("/heap", Vec::new()),
        prototypes: vec![InstancerPrototype { root: "/heap/leaf".into(), indices }],
        mask: None,
        translations: Some(TypedArray::from_vec(ElementType::Vec3f, translations)?),
        rotations: Some(TypedArray::from_vec(ElementType::Quatf, rotations)?),
        scales: Some(TypedArray::from_vec(ElementType::Vec3f, scales)?),
        transforms: None,
        ..InstancerDesc::default()
    })
}
