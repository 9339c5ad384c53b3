// SPDX-License-Identifier: Apache-2.0
//! What the scene database takes in: plain descriptions of prims, as Hydra gives them, unchecked.
//!
//! Arrays are borrowed ([`TypedArray`]). Matrices are column-vector (`p' = M p`). Any thread.

use std::sync::Arc;

use glam::DMat4;

use crate::array::TypedArray;

/// How primvar values are spread over a mesh (`HdInterpolation`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// One value.
    Constant,
    /// One value per face.
    Uniform,
    /// One value per point, linear inside faces.
    Varying,
    /// One value per point.
    Vertex,
    /// One value per face corner, in the order of `face_vertex_indices`.
    FaceVarying,
    /// One value per instance; not usable on a mesh.
    Instance,
}

/// A primvar: values, how they are spread, and optional indices into the values.
#[derive(Clone, Debug)]
pub struct Primvar {
    /// How elements map to the mesh.
    pub interpolation: Interpolation,
    /// The values.
    pub values: TypedArray,
    /// If present, element `k` is `values[indices[k]]`.
    pub indices: Option<TypedArray>,
}

/// Subdivision scheme. Refinement is not done yet; the scheme decides the normals: `CatmullClark` and `Loop` without
/// authored normals get smooth area-weighted vertex normals, the others are flat.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Subdivision {
    /// A polygon mesh.
    None,
    /// Refined without smoothing.
    Bilinear,
    /// Catmull-Clark.
    CatmullClark,
    /// Loop.
    Loop,
}

/// "This prim is part of the prototype `prototype_root` of `instancer`".
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct InstancedBy {
    /// Path of the instancer.
    pub instancer: Arc<str>,
    /// Root path of the prototype, equal to an [`InstancerPrototype::root`] of that instancer.
    pub prototype_root: Arc<str>,
}

/// What all prims have.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimDesc {
    /// Unique path.
    pub path: Arc<str>,
    /// Local to world; relative to the prototype root when the prim is instanced.
    pub transform: DMat4,
    /// An invisible prim contributes nothing.
    pub visible: bool,
    /// "default" (also "" and "geometry"), "render", "proxy", "guide". Only looked at for meshes, as Hydra does.
    pub purpose: Arc<str>,
    /// Empty: the prim is in the world. Otherwise it appears in each of these prototypes, and not in the world.
    pub instanced_by: Vec<InstancedBy>,
}

/// A polygon mesh.
#[derive(Clone, Debug)]
pub struct MeshDesc {
    /// Path, placement, visibility.
    pub prim: PrimDesc,
    /// Hydra's prim id, goes to the primId output.
    pub prim_id: i32,
    /// False: seen from the front only.
    pub double_sided: bool,
    /// Orientation of the faces.
    pub left_handed: bool,
    /// Subdivision scheme.
    pub subdivision: Subdivision,
    /// Corners per face (ints).
    pub face_vertex_counts: TypedArray,
    /// Point of each corner (ints).
    pub face_vertex_indices: TypedArray,
    /// Faces to leave out (ints).
    pub hole_indices: Option<TypedArray>,
    /// Positions in object space.
    pub points: TypedArray,
    /// Authored normals, object space.
    pub normals: Option<Primvar>,
    /// `displayColor`, linear.
    pub display_color: Option<Primvar>,
    /// `displayOpacity`.
    pub display_opacity: Option<Primvar>,
}

/// One prototype of an instancer.
#[derive(Clone, Debug)]
pub struct InstancerPrototype {
    /// Root path of the prototype.
    pub root: Arc<str>,
    /// Numbers of the instances that show this prototype (ints).
    pub indices: TypedArray,
}

/// A point instancer. Matrix of instance i: `T * R * S * transforms[i]` (column vectors), as `HdInstancer`.
#[derive(Clone, Debug)]
pub struct InstancerDesc {
    /// Path, placement, visibility.
    pub prim: PrimDesc,
    /// Prototypes with their instances.
    pub prototypes: Vec<InstancerPrototype>,
    /// Bool per instance, false = not shown.
    pub mask: Option<TypedArray>,
    /// Three-vectors.
    pub translations: Option<TypedArray>,
    /// Quaternions (normalised on use; a zero one is the identity), or four-vectors meaning (i, j, k, real).
    pub rotations: Option<TypedArray>,
    /// Three-vectors.
    pub scales: Option<TypedArray>,
    /// Matrices.
    pub transforms: Option<TypedArray>,
}

/// Kinds of light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Constant environment.
    Dome,
    /// Light from a cone of directions around the local +z axis (it shines along -z).
    Distant {
        /// Full angle of the cone, degrees; 0 = exactly one direction.
        angle_degrees: f32,
    },
}

/// A light with the `UsdLux` inputs.
#[derive(Clone, Debug, PartialEq)]
pub struct LightDesc {
    /// Path, placement, visibility.
    pub prim: PrimDesc,
    /// Kind.
    pub kind: LightKind,
    /// Linear Rec. 709.
    pub color: [f32; 3],
    /// Multiplier.
    pub intensity: f32,
    /// Stops.
    pub exposure: f32,
    /// Kelvin, if colour temperature is enabled.
    pub color_temperature: Option<f32>,
    /// Divide by the size of the light.
    pub normalize: bool,
    /// Seen directly by camera rays.
    pub camera_visible: bool,
}
