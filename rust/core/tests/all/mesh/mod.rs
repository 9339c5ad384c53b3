// SPDX-License-Identifier: Apache-2.0
//! Meshes as assets: topology, hierarchies, clusters, limit surfaces, displacement, deformation, curves and points.

mod box_bvh;
pub(crate) mod bvh;
mod bvh4;
mod cover;
mod curves_and_points;
mod deform;
mod deform_curves;
pub(crate) mod displace;
pub(crate) mod displace_patterns;
mod displace_textures;
mod displace_vectors;
mod host_memory;
mod primvar;
mod ptex;
mod refine;
mod split;
mod store;
mod triangulate;
