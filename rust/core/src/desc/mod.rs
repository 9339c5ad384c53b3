// SPDX-License-Identifier: Apache-2.0
//! The inputs of the scene database: plain descriptions of prims, as Hydra gives them, unchecked.
//!
//! Arrays are borrowed ([`TypedArray`]). Matrices are column-vector (`p' = M p`). Any thread.

mod defaults;
mod dropped;
mod light;
mod motion;
mod prim_mask;
mod shape;
mod solid;
mod subdivision;

pub use dropped::DroppedData;
pub use light::{DomeFormat, LightDesc, LightKind, MaterialSync, ShadowReach, ShapingCone};
pub use motion::{InstancerMotion, InstancerSample, PointsMotion, PointsSample, TransformSample};
pub use prim_mask::{prim_mask_names, read_prim_mask};
pub use shape::{CurveBasis, CurveWrap, CurvesDesc, PrimShape};
pub use solid::{AROUND, SolidDesc, SolidSize};
pub use subdivision::{BoundaryRule, CreaseRule, FaceVaryingLinear, Subdivision, SubdivisionTags, TriangleRule};

use std::sync::Arc;

use glam::DMat4;
use oocpt_abi::PrimMask;

use crate::array::TypedArray;

/// Rate at which a primvar has values on a mesh (`HdInterpolation`).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// One value for the whole mesh.
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

/// A primvar: values, their rate, and optional indices into the values.
#[derive(Clone, Debug)]
pub struct Primvar {
    /// The rate of its elements.
    pub interpolation: Interpolation,
    /// Values, before `indices`.
    pub values: TypedArray,
    /// If present, element `k` is `values[indices[k]]`.
    pub indices: Option<TypedArray>,
}

/// A primvar with its name.
#[derive(Clone, Debug)]
pub struct NamedPrimvar {
    /// Name without `primvars:`, for example "st".
    pub name: Arc<str>,
    /// Values and rate.
    pub primvar: Primvar,
}

/// A file that a scene names.
#[derive(Clone, Debug, Default, PartialEq, Eq, Hash)]
pub struct AssetRef {
    /// Path as written in the scene; for messages.
    pub authored: Arc<str>,
    /// Path as the host's resolver gave it; empty if it could not be found. `<UDIM>` stays in the text.
    pub resolved: Arc<str>,
}

/// A `GeomSubset`: faces with a material of their own.
#[derive(Clone, Debug)]
pub struct SubsetDesc {
    /// Path of the subset.
    pub path: Arc<str>,
    /// Path of the bound material; `None`: the faces have none.
    pub material: Option<Arc<str>>,
    /// Numbers of faces (ints).
    pub faces: TypedArray,
}

/// An instancing relation: "this prim is part of the prototype `prototype_root` of `instancer`".
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct InstancedBy {
    /// Path of the instancer.
    pub instancer: Arc<str>,
    /// Root path of the prototype, equal to an [`InstancerPrototype::root`] of that instancer.
    pub prototype_root: Arc<str>,
}

/// The data that all prims have.
#[derive(Clone, Debug, PartialEq)]
pub struct PrimDesc {
    /// Unique path.
    pub path: Arc<str>,
    /// Local to world; relative to the prototype root if the prim is instanced.
    pub transform: DMat4,
    /// Values of `transform` at times around the shutter; empty if the prim does not move.
    pub motion: Vec<TransformSample>,
    /// An invisible prim contributes nothing.
    pub visible: bool,
    /// Purpose: "default" (also "" and "geometry"), "render", "proxy" or "guide". It is used for meshes only, as in
    /// Hydra.
    pub purpose: Arc<str>,
    /// Prototypes that contain the prim; it appears in each of them, and not in the world. Empty: the prim is in the
    /// world.
    pub instanced_by: Vec<InstancedBy>,
}

/// A prim with a surface: a mesh, curves or points. The "faces" of curves are the curves, those of points the points.
#[derive(Clone, Debug)]
pub struct MeshDesc {
    /// Path, placement, visibility.
    pub prim: PrimDesc,
    /// Hydra's prim id, goes to the primId output.
    pub prim_id: i32,
    /// True if it is seen from both sides, false if from the front only.
    pub double_sided: bool,
    /// True if its faces are left-handed.
    pub left_handed: bool,
    /// Subdivision scheme.
    pub subdivision: Subdivision,
    /// Rules, creases and corners of the scheme.
    pub subdivision_tags: SubdivisionTags,
    /// Hydra's refine level (`complexity`): edges are cut into at least `2^refine_level` pieces.
    pub refine_level: u8,
    /// Corners per face (ints).
    pub face_vertex_counts: TypedArray,
    /// Point of each corner (ints).
    pub face_vertex_indices: TypedArray,
    /// Faces to leave out (ints).
    pub hole_indices: Option<TypedArray>,
    /// Positions in object space.
    pub points: TypedArray,
    /// Motion of the points while the shutter is open.
    pub point_motion: PointsMotion,
    /// Kind of primitive that the points make.
    pub shape: PrimShape,
    /// Solid from which shape, points, faces, widths and normals are made ([`MeshDesc::take_form`]).
    pub solid: Option<SolidDesc>,
    /// Diameters of curves and points; `None`: one pixel.
    pub widths: Option<Primvar>,
    /// Authored normals, object space.
    pub normals: Option<Primvar>,
    /// `displayColor`, linear.
    pub display_color: Option<Primvar>,
    /// `displayOpacity`, in [0, 1].
    pub display_opacity: Option<Primvar>,
    /// All other primvars. They are built only if a bound material reads them.
    pub primvars: Vec<NamedPrimvar>,
    /// Path of the bound material.
    pub material: Option<Arc<str>>,
    /// Faces with other materials. A face in no subset has `material`, a face in several belongs to the first.
    pub subsets: Vec<SubsetDesc>,
    /// Collections of light linking that the prim is in (`categories` of Hydra).
    pub categories: Vec<Arc<str>>,
    /// Label in light path expressions; `None` or empty: none.
    pub label: Option<Arc<str>>,
    /// The kinds of rays that pass through it, and whether it is a matte.
    pub mask: PrimMask,
}

impl MeshDesc {
    /// The authored primvar that a material means by `name`.
    #[must_use]
    pub fn authored_primvar(&self, name: &str) -> Option<&Primvar> {
        let named = self.primvars.iter().find(|p| &*p.name == name).map(|p| &p.primvar);
        named.or(match name {
            "displayColor" => self.display_color.as_ref(),
            "displayOpacity" => self.display_opacity.as_ref(),
            "normals" => self.normals.as_ref(),
            _ => None,
        })
    }
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
    /// Translation of each instance (three-vectors).
    pub translations: Option<TypedArray>,
    /// Rotation of each instance: quaternions (normalised on use; a zero one is the identity), or four-vectors as (i,
    /// j, k, real).
    pub rotations: Option<TypedArray>,
    /// Scale of each instance (three-vectors).
    pub scales: Option<TypedArray>,
    /// Transform of each instance (matrices).
    pub transforms: Option<TypedArray>,
    /// Motion of the instances while the shutter is open.
    pub motion: InstancerMotion,
    /// Other primvars with a value per instance.
    pub primvars: Vec<NamedPrimvar>,
    /// Collections of light linking that the instances are in.
    pub links: Arc<InstanceLinks>,
}

/// Collections of light linking that the instances of an instancer are in (`categories` and `instanceCategories` of
/// Hydra). Everything that an instance shows is in them, besides the collections that it is in itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InstanceLinks {
    /// Sets of collections.
    pub sets: Vec<Vec<Arc<str>>>,
    /// Index into `sets` of each instance; an instance beyond its end, or with an index beyond `sets`, is in none.
    /// `None`: all instances have the first set.
    pub of: Option<Vec<u32>>,
}

/// A material: a network of shading nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MaterialDesc {
    /// Unique path.
    pub path: Arc<str>,
    /// The nodes, in any order.
    pub nodes: Vec<NodeDesc>,
    /// Number of the node at the surface terminal.
    pub surface: Option<usize>,
    /// Number of the node at the displacement terminal.
    pub displacement: Option<usize>,
}

impl MaterialDesc {
    /// The path of a node, which is that of its prim or one within the material.
    pub(crate) fn named(&self, node: &Arc<str>) -> Arc<str> {
        if node.starts_with(&*self.path) {
            return node.clone();
        }
        format!("{}/{}", self.path, node.trim_start_matches('/')).into()
    }
}

/// A shading node.
#[derive(Clone, Debug, PartialEq)]
pub struct NodeDesc {
    /// Path, for messages.
    pub path: Arc<str>,
    /// Name of its definition, for example `UsdUVTexture`.
    pub kind: Arc<str>,
    /// Authored inputs.
    pub params: Vec<ParamDesc>,
    /// Connections to other nodes; they win over params of the same name.
    pub connections: Vec<ConnectionDesc>,
}

/// An authored input of a node.
#[derive(Clone, Debug, PartialEq)]
pub struct ParamDesc {
    /// Name without `inputs:`.
    pub name: Arc<str>,
    /// Value of the input.
    pub value: ParamValue,
}

/// Value of an input.
#[derive(Clone, Debug, PartialEq)]
pub enum ParamValue {
    /// A bool.
    Bool(bool),
    /// An integer of any width.
    Int(i64),
    /// A floating-point number of any width.
    Float(f32),
    /// Two floating-point numbers.
    Vec2([f32; 2]),
    /// Three floating-point numbers; also colours, linear Rec. 709.
    Vec3([f32; 3]),
    /// Four floating-point numbers.
    Vec4([f32; 4]),
    /// A token or string.
    Text(Arc<str>),
    /// A file.
    Asset(AssetRef),
}

/// A connection: "`input` of this node is `output` of that one".
#[derive(Clone, Debug, PartialEq)]
pub struct ConnectionDesc {
    /// Name of the input, without `inputs:`.
    pub input: Arc<str>,
    /// Number of the other node in [`MaterialDesc::nodes`].
    pub node: usize,
    /// Name of its output, without `outputs:`.
    pub output: Arc<str>,
}
