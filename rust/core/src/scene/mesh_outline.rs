// SPDX-License-Identifier: Apache-2.0
//! Facts about a mesh that do not change with the camera, and the balls by which dicing measures surfaces. Pure.

use std::sync::{Arc, OnceLock};

use glam::{DAffine3, DVec3};

use crate::desc::MeshDesc;
use crate::mesh::{Aabb, BuildDemand, DicingRate, MeshPatches, mesh_key_with};

/// Smallest distance that counts, as a share of the radius of what is looked at as a whole.
const NEAREST: f64 = 0.05;

/// The facts about a mesh that dicing needs.
#[derive(Debug)]
pub(crate) struct MeshOutline {
    pub(super) ball: BoundingSphere,
    /// Hash of all that the mesh is built from but the dicing.
    pub(super) content: u128,
    /// Its patches, once they were asked for.
    patches: OnceLock<Option<Arc<MeshPatches>>>,
}

impl MeshOutline {
    pub(super) fn new(desc: &MeshDesc, demand: BuildDemand<'_>) -> Self {
        let plain = DicingRate { pixels: 1.0, ..DicingRate::default() };
        let content = mesh_key_with(desc, &BuildDemand { dicing: Some(&plain), ..demand });
        Self { ball: BoundingSphere::of(&points_box(desc)), content, patches: OnceLock::new() }
    }

    /// The patches of the mesh; `None` if it is refined as a whole.
    pub(super) fn patches(&self, desc: &MeshDesc, demand: BuildDemand<'_>) -> Option<&Arc<MeshPatches>> {
        let plain = DicingRate { pixels: 1.0, ..DicingRate::default() };
        let make = || MeshPatches::of(desc, &BuildDemand { dicing: Some(&plain), ..demand }).map(Arc::new);
        self.patches.get_or_init(make).as_ref()
    }
}

/// The box of the control points that can be used. The limit surface may leave it, at boundaries with sharp corners
/// never.
fn points_box(desc: &MeshDesc) -> Aabb {
    let points = desc.points.view();
    let usable = (0..points.len()).filter_map(|at| points.vec3(at)).filter(|point| point.is_finite());
    usable.fold(Aabb::EMPTY, |bounds, point| bounds.with_point(point.as_vec3().to_array()))
}

/// A ball around a box.
#[derive(Clone, Copy, Debug)]
pub(super) struct BoundingSphere {
    pub(super) center: DVec3,
    pub(super) radius: f64,
}

impl BoundingSphere {
    pub(super) fn of(bounds: &Aabb) -> Self {
        if bounds.is_empty() {
            return Self { center: DVec3::ZERO, radius: 0.0 };
        }
        let [min, max] = [bounds.min, bounds.max].map(|corner| DVec3::from(corner.map(f64::from)));
        Self { center: 0.5 * (min + max), radius: 0.5 * min.distance(max) }
    }

    pub(super) fn placed(&self, map: &DAffine3) -> Self {
        Self { center: map.transform_point3(self.center), radius: self.radius * stretch(map) }
    }

    /// Its distance from a point, not less than a share of its size.
    pub(super) fn distance(&self, from: DVec3) -> f64 {
        (self.center.distance(from) - self.radius).max(NEAREST * self.radius)
    }

    pub(super) fn is_near(&self, from: DVec3) -> bool {
        self.is_within(2.0, from)
    }

    /// Returns true if its middle is not so many radii away.
    pub(super) fn is_within(&self, radii: f64, from: DVec3) -> bool {
        self.center.distance(from) < radii * self.radius
    }
}

/// By how much a map makes lengths longer, at most.
pub(super) fn stretch(map: &DAffine3) -> f64 {
    let m = &map.matrix3;
    // The longest axis, or the Frobenius norm where axes are sheared; for rotations with scales it is the first.
    let longest = m.x_axis.length().max(m.y_axis.length()).max(m.z_axis.length());
    let shear = m.x_axis.dot(m.y_axis).abs() + m.y_axis.dot(m.z_axis).abs() + m.z_axis.dot(m.x_axis).abs();
    if shear <= 1e-6 * longest * longest { longest } else { (longest * longest + shear).sqrt() }
}
