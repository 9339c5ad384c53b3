// SPDX-License-Identifier: Apache-2.0
//! Tests of the core against answers known from elsewhere: brute force, closed forms, published values.

#[cfg(test)]
mod adaptive;
#[cfg(test)]
mod arrays;
#[cfg(test)]
mod bad_hierarchies;
#[cfg(test)]
mod bad_scenes;
#[cfg(test)]
mod bindings;
#[cfg(test)]
mod boxes;
#[cfg(test)]
mod bvh;
mod bvh4;
#[cfg(test)]
mod cameras;
#[cfg(test)]
mod clusters;
#[cfg(test)]
mod convergence;
#[cfg(test)]
mod deform;
mod deform_curves;
#[cfg(test)]
mod described;
mod dicing;
#[cfg(test)]
mod displaced;
#[cfg(test)]
mod displaced_patterns;
#[cfg(test)]
mod displaced_textures;
#[cfg(test)]
mod displaced_vectors;
#[cfg(test)]
mod edits;
#[cfg(test)]
mod faces;
#[cfg(test)]
mod host_budget;
#[cfg(test)]
mod hostile_materials;
#[cfg(test)]
mod ies;
#[cfg(test)]
mod instance_primvars;
#[cfg(test)]
mod instancing;
#[cfg(test)]
mod lights;
#[cfg(test)]
mod links;
mod local_lights;
#[cfg(test)]
mod materials;
#[cfg(test)]
mod materialx;
mod mesh_lights;
#[cfg(test)]
mod mesh_placements;
#[cfg(test)]
mod motion;
mod moving_lights;
#[cfg(test)]
mod partition;
#[cfg(test)]
mod partition_cases;
#[cfg(test)]
mod partition_edits;
#[cfg(test)]
mod partition_moving;
#[cfg(test)]
mod primvar_uses;
#[cfg(test)]
mod primvars;
mod ptex;
#[cfg(test)]
mod refine;
#[cfg(test)]
mod round;
#[cfg(test)]
mod samplers;
#[cfg(test)]
mod settings;
#[cfg(test)]
mod stored_meshes;
#[cfg(test)]
mod support;
