// SPDX-License-Identifier: Apache-2.0
//! The light table: local lights and the tree over them, lights at infinity, shaping, pictures.
//!
//! Guarantees: plain data, of which the build makes the structs of the shaders. Any thread.

use bitflags::bitflags;
use bytemuck::{Pod, Zeroable};

/// Of [`GpuLocalLight::shaping`] and other indices: nothing.
pub const NO_INDEX: u32 = u32::MAX;
/// The bits of a light's `flags` that hold its [`GpuLightKind`].
pub const LIGHT_KIND_MASK: u32 = 15;
/// Set in [`GpuLightNode::child`] of a light; the other bits are its index.
pub const LIGHT_LEAF: u32 = 1 << 31;
/// Most nodes on a way from the root to a light.
pub const LIGHT_TREE_DEPTH: u32 = 44;
/// [`GpuLightMap::format`]: texels are four halves.
pub const MAP_HALF: u32 = 0;
/// [`GpuLightMap::format`]: texels are four floats.
pub const MAP_FLOAT: u32 = 1;

/// Kinds of light at infinity, the low four bits of `flags`; lights with a place have [`super::LIGHT_SHAPES`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u32)]
pub enum GpuLightKind {
    /// A cone of directions.
    Distant = 6,
    /// All directions.
    Dome = 7,
    /// All directions, times a picture.
    DomeMap = 8,
}

bitflags! {
    /// Bits of a light's `flags` above its [`GpuLightKind`].
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
    pub struct LightFlags: u32 {
        /// Camera rays see it.
        const CAMERA_VISIBLE = 16;
        /// Nothing is in its way.
        const NO_SHADOWS = 32;
        /// `shadow_color` is not black.
        const SHADOW_COLOR = 64;
        /// `shadow_link` is not 0.
        const SHADOW_LINK = 128;
        /// Its shadows end: `LightTablePointers::local_reaches` or `LightTablePointers::infinite_reaches` counts.
        const SHADOW_REACH = 256;
    }
}

shared! {
    /// Where the light table is.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct LightTablePointers {
        /// [`GpuLocalLight`] array; 0 without `Features::LOCAL_LIGHTS`, as `nodes`.
        pub local_lights: u64,
        /// [`GpuLightNode`] array, the root first.
        pub nodes: u64,
        /// [`GpuInfiniteLight`] array.
        pub infinite_lights: u64,
        /// [`GpuLightShaping`] array; 0 without `Features::SHAPING`.
        pub shapings: u64,
        /// Profiles, one after the other, in words: numbers of vertical and of horizontal angles (u32), these angles
        /// (degrees), candelas by horizontal, then vertical angle. 0 without `Features::IES`.
        pub ies: u64,
        /// [`GpuLightMap`] array; 0 without pictures.
        pub maps: u64,
        /// Bits of the sets of categories, `link_words` words each; 0 without `Features::LIGHT_LINKS`.
        pub link_bits: u64,
        /// u32 set of categories of each prim id + 1, `prim_count` of them; prims beyond are in set 0, in no category.
        /// Then as many i32: the prim id that is shown of it, another one where a prim is itself below linked
        /// instances.
        pub prim_sets: u64,
        /// Lights at infinity.
        pub infinite_count: u32,
        /// Words of a set.
        pub link_words: u32,
        /// Probability that a shadow ray goes to a light with a place; neither 0 nor 1: shaders work it out.
        pub local_share: f32,
        /// Prims of `prim_sets`.
        pub prim_count: u32,
        /// [`GpuMeshLight`] array, by prim id, instance id and mesh; 0 without `Features::MESH_LIGHTS`, as all that
        /// follows.
        pub mesh_lights: u64,
        /// [`GpuLightMesh`] array.
        pub light_meshes: u64,
        /// [`GpuLightNode`] array: the tree over `mesh_lights`, the root first, then those over the leaves of the
        /// meshes.
        pub mesh_nodes: u64,
        /// [`GpuLightLeaf`] array.
        pub light_leaves: u64,
        /// [`GpuLightTriangle`] array.
        pub light_triangles: u64,
        /// Faces that shine, mesh by mesh, in order: face and index of its leaf, 8 B.
        pub light_faces: u64,
        /// Entries of `mesh_lights`.
        pub mesh_light_count: u32,
        /// Index in `nodes` of the node whose first child is the local lights and whose second is the mesh lights.
        pub joint: u32,
        /// [`GpuLightValue`] array, beside `light_triangles`; 0 without `Features::MESH_LIGHT_VALUES`, as the next two.
        pub light_values: u64,
        /// f32 weights of a unit of area, relative to the mesh's, beside `light_faces`.
        pub light_face_weights: u64,
        /// f32x3 emissions that placements have from their instances: see [`GpuMeshLight::values`].
        pub light_placed_values: u64,
        /// f32x4 that programs read at corners of triangles: see [`GpuLightValue::corners`]. 0 without
        /// `Features::MESH_LIGHT_PROGRAMS`.
        pub light_corners: u64,
        /// 1 when the emission of some mesh light reads a texture.
        pub textured_mesh_lights: u32,
        /// 0.
        pub pad: u32,
        /// [`GpuLightKey`](super::scene::GpuLightKey) array; 0 without `Features::MOVING_LIGHTS`, as the next two.
        pub light_keys: u64,
        /// u32x2 for each local light: its first key, and how many; 0 for one at rest. 8-byte aligned.
        pub local_motion: u64,
        /// The same for each light at infinity.
        pub infinite_motion: u64,
        /// u32x2 for each entry of `mesh_lights`: index in this table of the outermost of the frames that move around
        /// it, and how many do; 0 for one at rest. Behind these entries, for each frame, its first key and how many.
        /// 8-byte aligned. 0 without `Features::MOVING_MESH_LIGHTS`, as the next.
        pub mesh_motion: u64,
        /// [`GpuLightKey`](super::scene::GpuLightKey) array: the map to the frame around; its `radiance` is 1.
        pub mesh_keys: u64,
        /// f32x4 for each local light: how far its shadows reach, over how much of that they fade out, one over the
        /// exponent of what is left, 0. 0 without `Features::SHADOW_REACH`, as the next.
        pub local_reaches: u64,
        /// The same for each light at infinity.
        pub infinite_reaches: u64,
        /// What importance in the tree over local lights is multiplied by to be roughly an irradiance. This and what
        /// follows count where `local_share` is neither 0 nor 1.
        pub local_brightness: f32,
        /// The same for the tree over mesh lights.
        pub mesh_brightness: f32,
        /// Irradiance that domes give, roughly: pi times the mean radiance of each.
        pub dome_irradiance: f32,
        /// The sum of the irradiances of distant lights on surfaces that face them.
        pub distant_irradiance: f32,
        /// The sum of the directions of distant lights, times these.
        pub distant_axis: [f32; 3],
        /// 0.
        pub pad1: u32,
    }
}

shared! {
    /// A placement of a mesh that emits light, 96 B. World points are `position + x p.x + y p.y + z p.z` for points p
    /// of the mesh; of one that moves (`LightTablePointers::mesh_motion`) points of the innermost frame that does.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuMeshLight {
        /// Origin of the mesh's frame, relative to the snapshot's origin, high part.
        pub position: [f32; 3],
        /// Index of its [`GpuLightMesh`].
        pub light_mesh: u32,
        /// Low part.
        pub position_lo: [f32; 3],
        /// What weighs 1: the largest weight of the emissions of the prim's materials.
        pub scale: f32,
        /// World vector of the mesh's x.
        pub x: [f32; 3],
        /// Prim id of a hit.
        pub prim_id: u32,
        /// World vector of the mesh's y.
        pub y: [f32; 3],
        /// Instance id of a hit.
        pub instance_id: u32,
        /// World vector of the mesh's z.
        pub z: [f32; 3],
        /// Index of its mesh among all meshes.
        pub mesh: u32,
        /// How far traversal may find the mesh from where it is, in the world.
        pub error: f32,
        /// Index in `LightTablePointers::light_placed_values` of its first slot's, or [`NO_INDEX`].
        pub values: u32,
        /// Turns to it from the root of the tree, the first in the lowest bit.
        pub trail: [u32; 2],
    }
}

shared! {
    /// The triangles of a mesh that emit light, with the weights of their slots, 16 B.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Pod, Zeroable)]
    pub struct GpuLightMesh {
        /// Index of the root of the tree over its leaves.
        pub root: u32,
        /// Its first entry in the table of faces.
        pub first_face: u32,
        /// Number of its faces there.
        pub face_count: u32,
        /// 0.
        pub pad: u32,
    }
}

shared! {
    /// Triangles of some faces, chosen by area and weight alone, 24 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuLightLeaf {
        /// Its first triangle.
        pub first: u32,
        /// Number of its triangles.
        pub count: u32,
        /// Sum of their areas, in the mesh's frame, times their weights.
        pub total: f32,
        /// 0.
        pub pad: u32,
        /// As [`GpuMeshLight::trail`], from the root of the mesh's tree.
        pub trail: [u32; 2],
    }
}

shared! {
    /// A triangle that emits light, in the mesh's frame, 48 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuLightTriangle {
        /// A corner.
        pub v0: [f32; 3],
        /// Share of its leaf's `total` up to and including it; exactly 1 for the last one.
        pub cumulative: f32,
        /// A corner.
        pub v1: [f32; 3],
        /// Number of its subset: its slot among its prim's.
        pub subset: u32,
        /// A corner.
        pub v2: [f32; 3],
        /// Face of a hit.
        pub face: u32,
    }
}

shared! {
    /// What [`GpuLightTriangle`] has with `Features::MESH_LIGHT_VALUES`: at its corners the emission, or texture
    /// coordinates in x and y; 48 B.
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuLightValue {
        /// At `v0`.
        pub a: [f32; 3],
        /// What a unit of its area counts for, relative to the mesh's.
        pub weight: f32,
        /// At `v1`.
        pub b: [f32; 3],
        /// Where its emission is a program's: index in [`LightTablePointers::light_corners`] of nine rows, for each
        /// corner (u, v, u, v) of both sets of texture coordinates, the first primvar and the second.
        pub corners: u32,
        /// At `v2`.
        pub c: [f32; 3],
        /// 0.
        pub pad1: u32,
    }
}

shared! {
    /// A light at a place, 144 B. World points are `position + x q.x + y q.y + z q.z` for points q of the unit shape.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuLocalLight {
        /// Origin of the unit shape, relative to the snapshot's origin, high part.
        pub position: [f32; 3],
        /// [`GpuLightKind`] and [`LightFlags`].
        pub flags: u32,
        /// Low part.
        pub position_lo: [f32; 3],
        /// Determinant of (x, y, z).
        pub determinant: f32,
        /// World vector of the unit shape's x.
        pub x: [f32; 3],
        /// Index of its [`GpuLightShaping`], or [`NO_INDEX`].
        pub shaping: u32,
        /// World vector of the unit shape's y.
        pub y: [f32; 3],
        /// Index of its [`GpuLightMap`], or [`NO_INDEX`].
        pub map: u32,
        /// World vector of the unit shape's z.
        pub z: [f32; 3],
        /// Category of the prims that it lights; 0: all.
        pub light_link: u32,
        /// Rows of the inverse of (x, y, z).
        pub row_x: [f32; 3],
        /// Category of the prims that shadow it; 0: all.
        pub shadow_link: u32,
        /// See `row_x`.
        pub row_y: [f32; 3],
        /// Multiplier of diffuse reflection.
        pub diffuse: f32,
        /// See `row_x`.
        pub row_z: [f32; 3],
        /// Multiplier of other reflection.
        pub specular: f32,
        /// Radiance; intensity of a point; intensity per length of a line, from the side.
        pub radiance: [f32; 3],
        /// What shadows leave of it, 10 bits for each colour.
        pub shadow_color: u32,
    }
}

shared! {
    /// A light at infinity, 64 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuInfiniteLight {
        /// Of a distant light: unit vector from the scene towards it.
        pub direction: [f32; 3],
        /// Of a distant light: 1 - cos(half angle) = 2 sin^2(half angle / 2), in [0, 2]; 0 = all light comes from
        /// `direction`. Kept apart from the cosine because a sun of half a degree loses 0.3 % of its solid angle when
        /// 1 - cos is formed in f32.
        pub one_minus_cos: f32,
        /// Radiance; of a single direction, irradiance; of a picture, its factor.
        pub radiance: [f32; 3],
        /// Probability among the lights at infinity (sum 1, each > 0).
        pub probability: f32,
        /// Sum of the probabilities up to and including this light; exactly 1 for the last one.
        pub cumulative: f32,
        /// Multiplier of diffuse reflection.
        pub diffuse: f32,
        /// Multiplier of other reflection.
        pub specular: f32,
        /// [`GpuLightKind`] and [`LightFlags`].
        pub flags: u32,
        /// Index of its [`GpuLightMap`], or [`NO_INDEX`].
        pub map: u32,
        /// See [`GpuLocalLight::light_link`].
        pub light_link: u32,
        /// See [`GpuLocalLight::shadow_link`].
        pub shadow_link: u32,
        /// See [`GpuLocalLight::shadow_color`].
        pub shadow_color: u32,
    }
}

shared! {
    /// A node of the light tree: two children, 112 B. A missing child has power 0.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuLightNode {
        /// Lower corners of the children's boxes.
        pub min: [[f32; 3]; 2],
        /// Upper corners.
        pub max: [[f32; 3]; 2],
        /// Axes of the cones that the lights' own directions lie in, unit.
        pub axis: [[f32; 3]; 2],
        /// Cosine of the half angles of these cones.
        pub cos_axis: [f32; 2] = "float[2]",
        /// Cosine of the angle to its own direction up to which a light shines.
        pub cos_emission: [f32; 2] = "float[2]",
        /// Share of the power of all lights.
        pub power: [f32; 2] = "float[2]",
        /// Index of a node, or [`LIGHT_LEAF`] and the index of a light.
        pub child: [u32; 2],
        /// How much of the light goes to the other side of its own directions: 0 for lights of one side, 1 for emissive
        /// meshes, less for closed ones, whose inside is seldom seen.
        pub back: [f32; 2] = "float[2]",
    }
}

shared! {
    /// Where a light shines, 72 B and padding.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuLightShaping {
        /// Where the light points, unit, world.
        pub axis: [f32; 3],
        /// Half angle of the cone, radians.
        pub cone_angle: f32,
        /// Local x axis, unit, world.
        pub x: [f32; 3],
        /// Angle at which the light begins to fade out.
        pub smooth_start: f32,
        /// Local y axis, unit, world.
        pub y: [f32; 3],
        /// Exponent of the cosine; 0: none.
        pub focus: f32,
        /// Colour of what the exponent takes away.
        pub focus_tint: [f32; 3],
        /// Word of its profile in [`LightTablePointers::ies`], or [`NO_INDEX`].
        pub ies: u32,
        /// See `LightShaping::ies_angle_scale` of the core.
        pub angle_scale: f32,
        /// Factor of the candelas.
        pub ies_scale: f32,
        /// 0.
        pub pad: [u32; 2],
    }
}

shared! {
    /// A picture of a dome or of a rectangle, 80 B.
    #[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
    pub struct GpuLightMap {
        /// Texels, the top row first.
        pub texels: u64,
        /// [`GpuCdf`] entries of the cells of each row, the top row first, then of the rows: `(columns + 1) * rows`; 0
        /// for rectangles.
        pub cells: u64,
        /// Texels in a row.
        pub width: u32,
        /// Rows of texels.
        pub height: u32,
        /// Cells in a row.
        pub columns: u32,
        /// Rows of cells.
        pub rows: u32,
        /// Rows of dome-from-world.
        pub x: [f32; 3],
        /// [`MAP_HALF`] or [`MAP_FLOAT`].
        pub format: u32,
        /// See `x`.
        pub y: [f32; 3],
        /// 0.
        pub pad0: u32,
        /// See `x`.
        pub z: [f32; 3],
        /// 0.
        pub pad1: u32,
    }
}

shared! {
    /// An entry of a piecewise constant distribution over [0, 1), 12 B: inverted by way of a guide (Chen and Asau
    /// 1974).
    #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
    pub struct GpuCdf {
        /// Probability of all entries before this one; the last of equal ones is meant.
        pub start: f32,
        /// Entry that the number `i / n` falls on, for entry i of n: a search begins there, and ends where the next one
        /// begins.
        pub guide: u32,
        /// Of a cell: its probability times the number of cells. Of a row: its probability times the number of rows.
        pub density: f32,
    }
}
