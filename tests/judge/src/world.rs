// SPDX-License-Identifier: Apache-2.0
//! The flattened scene: every placement of every triangle in f64, with what the AOVs and the path tracer ask of it.

use glam::{DMat4, DVec3, DVec4};
use oocpt_abi::AttributeRate;
use oocpt_core::scene::snapshot::{Assembly, Attribute, InstanceRecord, InstanceTarget, MeshAsset, Snapshot};

use crate::JudgeError;
use crate::bvh::{Bvh, Crossing};
use crate::camera::Ray;

/// More would not fit a test machine.
const MAX_TRIANGLES: usize = 8_000_000;

/// One placement of a mesh.
#[derive(Debug)]
struct Placement {
    mesh: usize,
    world_from_object: DMat4,
    object_from_world: DMat4,
    prim_id: i32,
    instance_id: i32,
}

/// All triangles of a snapshot, relative to its origin.
#[derive(Debug)]
pub struct World {
    meshes: Vec<std::sync::Arc<MeshAsset>>,
    placements: Vec<Placement>,
    /// Per flattened triangle: placement, triangle of the mesh.
    sources: Vec<(u32, u32)>,
    corners: Vec<[DVec3; 3]>,
    bvh: Bvh,
}

/// The nearest crossing of a ray.
#[derive(Debug, Clone, Copy)]
pub struct WorldHit {
    /// Distance in units of the ray's direction.
    pub t: f64,
    /// Distance of the next other triangle on the ray, infinite if there is none. A tiny gap means a tie that f32 may
    /// break otherwise.
    pub runner_up: f64,
    u: f64,
    v: f64,
    triangle: usize,
}

/// What is known of a surface point.
#[derive(Debug, Clone, Copy)]
pub struct Surface {
    /// The hit point, relative to the snapshot's origin.
    pub position: DVec3,
    /// Unit normal of the triangle on the authored outer side.
    pub geometric_normal: DVec3,
    /// Unit shading normal on the authored outer side; the geometric one without normals.
    pub shading_normal: DVec3,
    /// `displayColor`, if the mesh has one.
    pub color: Option<DVec3>,
    /// `displayOpacity`, 1 without one.
    pub opacity: f64,
    /// Whether both sides are to be seen.
    pub double_sided: bool,
    /// Per mesh prim.
    pub prim_id: i32,
    /// Index into the flattened instances of the prim, 0 outside instancers.
    pub instance_id: i32,
    /// The authored face.
    pub element_id: i32,
}

impl World {
    /// Multiplies the snapshot out.
    ///
    /// # Errors
    /// [`JudgeError::TooLarge`], [`JudgeError::DanglingTarget`] and [`JudgeError::Singular`].
    pub fn flatten(snapshot: &Snapshot) -> Result<Self, JudgeError> {
        let mut world = Self {
            meshes: snapshot.meshes.iter().map(|mesh| mesh.asset().expect("readable")).collect(),
            placements: Vec::new(),
            sources: Vec::new(),
            corners: Vec::new(),
            bvh: Bvh::build(&[]),
        };
        if let Some(root) = snapshot.assemblies.len().checked_sub(1) {
            world.add_assembly(snapshot, root, DMat4::IDENTITY, 0)?;
        }
        world.bvh = Bvh::build(&world.corners);
        Ok(world)
    }

    fn add_assembly(&mut self, from: &Snapshot, index: usize, to_world: DMat4, id: i32) -> Result<(), JudgeError> {
        for (number, record) in records(&from.assemblies[index]).iter().enumerate() {
            let object_from_parent = affine(&record.object_from_parent);
            if object_from_parent.determinant() == 0.0 || !object_from_parent.is_finite() {
                return Err(JudgeError::Singular("an instance transform"));
            }
            let placed = to_world * object_from_parent.inverse();
            let id = id.wrapping_mul(record.prototype_count.cast_signed());
            let id = id.wrapping_add(record.index_in_prototype.cast_signed());
            let dangling = |kind| JudgeError::DanglingTarget { assembly: index, record: number, kind };
            match record.target {
                InstanceTarget::Assembly(target) => {
                    // Children come before parents, which also rules out cycles.
                    let target = usize::try_from(target).ok().filter(|&target| target < index);
                    self.add_assembly(from, target.ok_or_else(|| dangling("assembly"))?, placed, id)?;
                }
                InstanceTarget::Mesh(target) => {
                    let target = usize::try_from(target).ok().filter(|&target| target < self.meshes.len());
                    self.add_mesh(target.ok_or_else(|| dangling("mesh"))?, placed, record.prim_id, id)?;
                }
            }
        }
        Ok(())
    }

    fn add_mesh(&mut self, mesh: usize, placed: DMat4, prim_id: i32, instance_id: i32) -> Result<(), JudgeError> {
        let asset = self.meshes[mesh].clone();
        if self.corners.len() + asset.triangles.len() > MAX_TRIANGLES {
            return Err(JudgeError::TooLarge(MAX_TRIANGLES));
        }
        let too_large = |_| JudgeError::TooLarge(MAX_TRIANGLES);
        let placement = u32::try_from(self.placements.len()).map_err(too_large)?;
        for (index, triangle) in asset.triangles.iter().enumerate() {
            self.sources.push((placement, u32::try_from(index).map_err(too_large)?));
            let place = |corner: [f32; 3]| placed.transform_point3(DVec3::from(corner.map(f64::from)));
            self.corners.push(triangle.vertices.map(place));
        }
        let object_from_world = placed.inverse();
        self.placements.push(Placement { mesh, world_from_object: placed, object_from_world, prim_id, instance_id });
        Ok(())
    }

    /// Number of flattened triangles.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.corners.len()
    }

    /// The nearest crossing that is not wholly transparent, and how far behind the next one is.
    #[must_use]
    pub fn nearest(&self, ray: &Ray) -> Option<WorldHit> {
        let mut best: Option<Crossing> = None;
        let mut runner_up = f64::INFINITY;
        self.bvh.visit(&self.corners, ray, f64::INFINITY, |crossing| {
            match best {
                _ if self.opacity(crossing) <= 0.0 => (),
                Some(nearest) if nearest.t <= crossing.t => runner_up = runner_up.min(crossing.t),
                previous => {
                    runner_up = previous.map_or(f64::INFINITY, |previous| previous.t);
                    best = Some(crossing);
                }
            }
            runner_up
        });
        let Crossing { t, u, v, triangle } = best?;
        Some(WorldHit { t, runner_up, u, v, triangle })
    }

    /// The nearest crossing that `stops` the ray: a crossing is skipped with a probability of `1 - opacity`.
    pub(crate) fn nearest_opaque(&self, ray: &Ray, mut stops: impl FnMut(f64) -> bool) -> Option<WorldHit> {
        let mut best: Option<Crossing> = None;
        self.bvh.visit(&self.corners, ray, f64::INFINITY, |crossing| {
            let bound = best.map_or(f64::INFINITY, |nearest| nearest.t);
            let opacity = self.opacity(crossing);
            if crossing.t < bound && (opacity >= 1.0 || stops(opacity)) {
                best = Some(crossing);
                return crossing.t;
            }
            bound
        });
        best.map(|Crossing { t, u, v, triangle }| WorldHit { t, runner_up: f64::INFINITY, u, v, triangle })
    }

    fn opacity(&self, crossing: Crossing) -> f64 {
        let (placement, triangle) = self.source(crossing.triangle);
        let asset = &self.meshes[placement.mesh];
        let Some(opacities) = &asset.opacities else { return 1.0 };
        interpolate(asset, opacities, triangle, weights(crossing.u, crossing.v), |value| DVec3::splat(f64::from(value)))
            .x
            .clamp(0.0, 1.0)
    }

    fn source(&self, triangle: usize) -> (&Placement, usize) {
        let (placement, triangle) = self.sources[triangle];
        (&self.placements[placement as usize], triangle as usize)
    }

    /// Everything known of the point where `ray` was hit.
    #[must_use]
    pub fn surface(&self, ray: &Ray, hit: &WorldHit) -> Surface {
        let (placement, triangle) = self.source(hit.triangle);
        let asset = &self.meshes[placement.mesh];
        let bary = weights(hit.u, hit.v);
        let corners = asset.triangles[triangle].vertices.map(|corner| DVec3::from(corner.map(f64::from)));
        let winding = if asset.left_handed { -1.0 } else { 1.0 };
        let facing = (corners[1] - corners[0]).cross(corners[2] - corners[0]) * winding;
        // Normals go by the inverse transpose, which keeps the authored outer side also under mirroring.
        let to_world = |normal: DVec3| {
            (placement.object_from_world.transpose() * normal.extend(0.0)).truncate().normalize_or_zero()
        };
        let geometric_normal = to_world(facing);
        let vector = |value: [f32; 3]| DVec3::from(value.map(f64::from));
        let shading =
            asset.normals.as_ref().map(|normals| to_world(interpolate(asset, normals, triangle, bary, vector)));
        let crossing = Crossing { t: hit.t, u: hit.u, v: hit.v, triangle: hit.triangle };
        Surface {
            position: ray.origin + ray.direction * hit.t,
            geometric_normal,
            shading_normal: shading.filter(|normal| *normal != DVec3::ZERO).unwrap_or(geometric_normal),
            color: asset.colors.as_ref().map(|colors| interpolate(asset, colors, triangle, bary, vector)),
            opacity: self.opacity(crossing),
            double_sided: asset.double_sided,
            prim_id: placement.prim_id,
            instance_id: placement.instance_id,
            element_id: asset.triangles[triangle].face.cast_signed(),
        }
    }

    /// World placement of every mesh in the order of the walk, for tests of the snapshot itself.
    pub fn placements(&self) -> impl Iterator<Item = (usize, DMat4)> + '_ {
        self.placements.iter().map(|placement| (placement.mesh, placement.world_from_object))
    }
}

fn records(assembly: &Assembly) -> Vec<InstanceRecord> {
    let mut records = vec![InstanceRecord::default(); assembly.len()];
    assembly.encode(0..assembly.len(), &mut records);
    records
}

fn affine(rows: &[[f32; 4]; 3]) -> DMat4 {
    let row = |index: usize| DVec4::from(rows[index].map(f64::from));
    DMat4::from_cols(row(0), row(1), row(2), DVec4::W).transpose()
}

fn weights(u: f64, v: f64) -> DVec3 {
    DVec3::new(1.0 - u - v, u, v)
}

fn interpolate<T: Copy>(
    asset: &MeshAsset,
    attribute: &Attribute<T>,
    triangle: usize,
    bary: DVec3,
    read: impl Fn(T) -> DVec3,
) -> DVec3 {
    let at = |index: usize| attribute.values.get(index).map_or(DVec3::ZERO, |&value| read(value));
    let blend = |corners: [usize; 3]| at(corners[0]) * bary.x + at(corners[1]) * bary.y + at(corners[2]) * bary.z;
    match attribute.rate {
        AttributeRate::Constant => at(0),
        AttributeRate::Uniform => at(triangle),
        AttributeRate::Vertex => {
            asset.corner_indices.get(triangle).map_or(DVec3::ZERO, |corners| blend(corners.map(|i| i as usize)))
        }
        AttributeRate::FaceVarying => blend([0, 1, 2].map(|corner| triangle * 3 + corner)),
    }
}
