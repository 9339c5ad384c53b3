// SPDX-License-Identifier: Apache-2.0
//! The woods: a forest whose trees each have a mesh and pictures of their own, so that geometry and textures grow
//! together.
//!
//! A tree is a cone of displaced quads with a colour and a surface picture, and cards of leaves that a third picture
//! cuts out. Trees stand on the ground of the forest bench, those of a kind together, under a dome and a sun.

use anyhow::{Result, ensure};
use glam::{DQuat, DVec3};
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::camera::Camera;
use oocpt_core::scene::{InstancedBy, InstancerDesc, InstancerPrototype, LightDesc, LightKind, MeshDesc, SceneDb};

use super::forest::{self, HALF_SIDE, grid, ground, prim};
use super::island::Random;
use super::preview::{Picture, cards, dress, material};

/// What determines the woods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::Args, serde::Serialize)]
pub struct Parameters {
    /// Different trees; each has its meshes and three pictures.
    #[arg(long, default_value_t = 96)]
    pub trees: u32,
    /// Quads of a tree's body; about 200 bytes each.
    #[arg(long, default_value_t = 4096)]
    pub tree_quads: u32,
    /// Cards of leaves of a tree.
    #[arg(long, default_value_t = 400)]
    pub cards: u32,
    /// Side of the two pictures of a body, texels; the leaves' are half as wide. A tree has 12 bytes for each square
    /// texel of it.
    #[arg(long, default_value_t = 256)]
    pub texture_size: u32,
    /// Trees that stand there.
    #[arg(long, default_value_t = 3000)]
    pub instances: u32,
}

impl Parameters {
    fn check(&self) -> Result<()> {
        ensure!((1..=100_000).contains(&self.trees), "--trees: 1 to 100 000");
        ensure!((16..=100_000_000).contains(&self.tree_quads), "--tree-quads: 16 to 100 000 000");
        ensure!(self.cards <= 10_000_000, "--cards: at most 10 000 000");
        ensure!((2..=16_384).contains(&self.texture_size), "--texture-size: 2 to 16 384");
        ensure!((1..=100_000_000).contains(&self.instances), "--instances: 1 to 100 000 000");
        Ok(())
    }
}

/// Fills `db` with the scene. Its pictures are those of [`Pictures`](super::pictures::Pictures).
pub fn build(db: &mut SceneDb, parameters: &Parameters) -> Result<()> {
    parameters.check()?;
    let Parameters { trees, texture_size, .. } = *parameters;
    let bark = |seed: u32| Picture { name: format!("bark:{texture_size}:{seed}"), outputs: &[("rgb", "diffuseColor")] };
    db.upsert_mesh(dress(forest::terrain()?, coordinates(224, 224, 16.0), "/ground")?);
    db.upsert_material(material("/ground", &[bark(trees)], None));
    for tree in 0..trees {
        let surface = Picture {
            name: format!("surface:{texture_size}:{tree}"),
            outputs: &[("g", "roughness"), ("b", "metallic")],
        };
        let leaf = Picture {
            name: format!("leaf:{}:{tree}", texture_size / 2),
            outputs: &[("rgb", "diffuseColor"), ("a", "opacity")],
        };
        let (body_material, leaf_material) = (format!("/body_{tree}"), format!("/leaf_{tree}"));
        db.upsert_material(material(&body_material, &[bark(tree), surface], None));
        db.upsert_material(material(&leaf_material, &[leaf], Some(0.5)));
        db.upsert_mesh(body(tree, parameters.tree_quads, &body_material)?);
        db.upsert_mesh(crown(tree, parameters.cards, &leaf_material)?);
    }
    db.upsert_instancer(scatter(trees, parameters.instances)?);
    db.upsert_light(LightDesc { prim: prim("/dome", Vec::new()), kind: LightKind::PLAIN_DOME, ..light(0.6) });
    let mut sun =
        LightDesc { prim: prim("/sun", Vec::new()), kind: LightKind::Distant { angle_degrees: 0.53 }, ..light(2.0) };
    sun.prim.transform = glam::DMat4::from_rotation_x(-0.9) * glam::DMat4::from_rotation_y(0.5);
    sun.normalize = true;
    db.upsert_light(sun);
    Ok(())
}

/// A camera among the trees.
pub fn camera(width: u32, height: u32) -> Camera {
    forest::view(DVec3::new(0.0, 9.0, HALF_SIDE * 0.5), DVec3::new(0.0, 0.0, 10.0), width, height)
}

fn light(intensity: f32) -> LightDesc {
    LightDesc { color: [1.0; 3], intensity, exposure: 0.0, camera_visible: true, ..LightDesc::default() }
}

/// Coordinates of the points of a grid, `repeats` over it.
fn coordinates(columns: u32, rows: u32, repeats: f32) -> Vec<[f32; 2]> {
    #[expect(clippy::cast_possible_truncation, reason = "between 0 and 1")]
    let part = |at: u32, of: u32| (f64::from(at) / f64::from(of)) as f32 * repeats;
    (0..=rows).flat_map(|row| (0..=columns).map(move |column| [part(column, columns), part(row, rows)])).collect()
}

/// Puts a mesh under the root of its tree.
fn planted(mut mesh: MeshDesc, tree: u32, part: u32) -> Result<MeshDesc> {
    mesh.prim_id = i32::try_from(2 * tree + part)? + 1;
    mesh.prim.instanced_by =
        vec![InstancedBy { instancer: "/woods".into(), prototype_root: root(tree).as_str().into() }];
    Ok(mesh)
}

fn root(tree: u32) -> String {
    format!("/woods/tree_{tree}")
}

/// A cone with a bumpy skin, two units high.
fn body(tree: u32, quads: u32, material: &str) -> Result<MeshDesc> {
    let rows = (quads / 2).isqrt().max(2);
    let columns = quads.div_ceil(rows).max(3);
    let phase = f64::from(tree);
    let mesh = grid(&format!("{}/body", root(tree)), columns, rows, |u, v| {
        let angle = u * std::f64::consts::TAU;
        let bump =
            1.0 + 0.2 * (5.0 * angle + phase).sin() * (20.0 * v).sin() + 0.04 * (31.0 * angle + 90.0 * v + phase).sin();
        // The tip stays open by a pinhole.
        let radius = 0.5 * (1.0 - 0.99 * v) * bump;
        DVec3::new(radius * angle.cos(), 2.0 * v, -radius * angle.sin())
    })?;
    dress(planted(mesh, tree, 0)?, coordinates(columns, rows, 1.0), material)
}

/// Cards around the cone.
fn crown(tree: u32, count: u32, material: &str) -> Result<MeshDesc> {
    let mut random = Random::new(&[u64::from(tree), 11]);
    let leaves: Vec<_> = (0..count.max(1))
        .map(|_| {
            let (v, angle) = (1.0 - random.unit().sqrt(), random.angle());
            let out = DVec3::new(angle.cos(), 0.0, angle.sin());
            let centre = out * (0.55 * (1.0 - v) + random.range(0.0, 0.2)) + DVec3::Y * (2.0 * v + 0.05);
            let turn = DQuat::from_axis_angle(random.direction(), random.range(0.0, 0.8));
            let half = random.range(0.04, 0.09);
            (centre, turn * DVec3::new(-out.z, 0.0, out.x) * half, turn * (out + DVec3::Y * 0.4) * half)
        })
        .collect();
    let mesh = grid(&format!("{}/crown", root(tree)), 1, 1, |u, v| DVec3::new(u, v, 0.0))?;
    cards(planted(mesh, tree, 1)?, &leaves, material)
}

fn scatter(trees: u32, instances: u32) -> Result<InstancerDesc> {
    let mut random = Random::new(&[u64::from(trees), 3]);
    let (mut translations, mut rotations, mut scales) = (Vec::new(), Vec::new(), Vec::new());
    let mut indices = vec![Vec::new(); trees as usize];
    // Patches in a square grid, one for each kind, that reach into each other.
    let side = (trees - 1).isqrt() + 1;
    let patch = 2.0 * HALF_SIDE / f64::from(side);
    for instance in 0..instances {
        let kind = instance % trees;
        let mut place = |cell: u32| {
            let centre = (f64::from(cell) + 0.5) * patch - HALF_SIDE;
            (centre + random.range(-0.6, 0.6) * patch).clamp(-HALF_SIDE, HALF_SIDE)
        };
        let (x, z) = (place(kind % side), place(kind / side));
        translations.push(DVec3::new(x, ground(x, z), z).as_vec3().to_array());
        rotations.push(DQuat::from_rotation_y(random.angle()).as_quat().to_array());
        scales.push(DVec3::splat(random.range(1.0, 2.0)).as_vec3().to_array());
        indices[(instance % trees) as usize].push(i32::try_from(instance)?);
    }
    let mut prototypes = Vec::new();
    for (tree, list) in (0..).zip(indices) {
        let indices = TypedArray::from_vec(ElementType::I32, list)?;
        prototypes.push(InstancerPrototype { root: root(tree).as_str().into(), indices });
    }
    Ok(InstancerDesc {
        prim: prim("/woods", Vec::new()),
        prototypes,
        mask: None,
        translations: Some(TypedArray::from_vec(ElementType::Vec3f, translations)?),
        rotations: Some(TypedArray::from_vec(ElementType::Quatf, rotations)?),
        scales: Some(TypedArray::from_vec(ElementType::Vec3f, scales)?),
        transforms: None,
        ..InstancerDesc::default()
    })
}
