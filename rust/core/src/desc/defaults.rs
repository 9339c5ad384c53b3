// SPDX-License-Identifier: Apache-2.0
//! Default values of descriptions: a constructor names the fields that it sets and takes the rest from here.

use std::sync::Arc;

use glam::DMat4;
use oocpt_abi::PrimMask;

use super::{
    InstancerDesc, InstancerMotion, LightDesc, LightKind, MeshDesc, PointsMotion, PrimDesc, PrimShape, ShapingCone,
    Subdivision, SubdivisionTags,
};
use crate::array::TypedArray;

impl Default for PrimDesc {
    /// A visible prim at the origin of the world, without a path.
    fn default() -> Self {
        Self {
            path: "".into(),
            transform: DMat4::IDENTITY,
            motion: Vec::new(),
            visible: true,
            purpose: "default".into(),
            instanced_by: Vec::new(),
        }
    }
}

impl Default for MeshDesc {
    /// A mesh without a face and without a material.
    fn default() -> Self {
        Self {
            prim: PrimDesc::default(),
            prim_id: -1,
            double_sided: false,
            left_handed: false,
            subdivision: Subdivision::None,
            subdivision_tags: SubdivisionTags::default(),
            refine_level: 0,
            face_vertex_counts: TypedArray::of(Vec::<i32>::new()),
            face_vertex_indices: TypedArray::of(Vec::<i32>::new()),
            hole_indices: None,
            points: TypedArray::of(Vec::<[f32; 3]>::new()),
            point_motion: PointsMotion::default(),
            shape: PrimShape::Mesh,
            solid: None,
            widths: None,
            normals: None,
            display_color: None,
            display_opacity: None,
            primvars: Vec::new(),
            material: None,
            subsets: Vec::new(),
            categories: Vec::new(),
            label: None,
            mask: PrimMask::empty(),
        }
    }
}

impl Default for InstancerDesc {
    /// An instancer without a prototype.
    fn default() -> Self {
        Self {
            prim: PrimDesc::default(),
            prototypes: Vec::new(),
            mask: None,
            translations: None,
            rotations: None,
            scales: None,
            transforms: None,
            motion: InstancerMotion::default(),
            primvars: Vec::new(),
            links: Arc::default(),
        }
    }
}

impl Default for LightDesc {
    /// A white constant dome of radiance 1 that everything sees.
    fn default() -> Self {
        Self {
            prim: PrimDesc::default(),
            kind: LightKind::PLAIN_DOME,
            color: [1.0; 3],
            intensity: 1.0,
            exposure: 0.0,
            color_temperature: None,
            normalize: false,
            camera_visible: true,
            diffuse: 1.0,
            specular: 1.0,
            shaping: None,
            shadow_enable: true,
            shadow_color: [0.0; 3],
            shadow_reach: None,
            light_link: None,
            shadow_link: None,
            label: None,
        }
    }
}

impl Default for ShapingCone {
    /// `UsdLuxShapingAPI`: a cone of 90 degrees, no focus, no profile.
    fn default() -> Self {
        Self {
            cone_angle_degrees: 90.0,
            cone_softness: 0.0,
            focus: 0.0,
            focus_tint: [0.0; 3],
            ies: None,
            ies_angle_scale: 0.0,
            ies_normalize: false,
        }
    }
}
