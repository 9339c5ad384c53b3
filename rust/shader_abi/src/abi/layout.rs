// SPDX-License-Identifier: Apache-2.0
//! Offsets and sizes of every member of every shared struct, as the Rust compiler lays them out.
//!
//! Guarantees: the members are listed in full: a struct literal pattern without `..` fails to compile otherwise.

use super::{
    AovClear, AovTargets, Counters, ErrorSums, FilmPixel, Frame, GpuAlias, GpuAssembly, GpuAttribute, GpuChunk,
    GpuChunkInstance, GpuInfiniteLight, GpuInput, GpuInstance, GpuLight, GpuLightLeaf, GpuLightMap, GpuLightMesh,
    GpuLightNode, GpuLightShaping, GpuLightTriangle, GpuLocalLight, GpuMaterial, GpuMesh, GpuMeshLight, GpuNode,
    GpuPrim, GpuSurface, GpuSurfaceMaterial, GpuTexture, GpuTriangle, IndirectArgs, LbvhBounds, LbvhPush, Lighting,
    PathState, Pending, Push, Question, Ray, Roulette, Segment, ShadowRay, Streaming,
};
use core::mem::{offset_of, size_of};

/// Where a member is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemberLayout {
    /// Name, equal in GLSL.
    pub name: &'static str,
    /// Bytes from the start of the struct.
    pub offset: usize,
    /// Bytes of the member.
    pub size: usize,
}

/// How a struct is laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StructLayout {
    /// Name, equal in GLSL.
    pub name: &'static str,
    /// Bytes of the struct, and distance of array elements.
    pub size: usize,
    /// Members in order.
    pub members: &'static [MemberLayout],
}

/// The size of what a projection returns a reference to.
const fn member_size<S, M>(_: fn(&S) -> &M) -> usize {
    size_of::<M>()
}

macro_rules! layout {
    ($name:ident { $($member:ident),+ $(,)? }) => {{
        // Fails to compile when a member is missing from the list.
        const fn complete(value: &$name) {
            let $name { $($member: _),+ } = value;
        }
        const _: fn(&$name) = complete;
        StructLayout {
            name: stringify!($name),
            size: size_of::<$name>(),
            members: &[$(MemberLayout {
                name: stringify!($member),
                offset: offset_of!($name, $member),
                size: member_size(|value: &$name| &value.$member),
            }),+],
        }
    }};
}

/// Every struct that crosses.
pub const LAYOUTS: &[StructLayout] = &[
    layout!(Push { frame, first_pixel, first_sample, path_count, round, arg0, flags }),
    layout!(AovTargets { depth, camera_depth, prim_id, instance_id, element_id, normal, neye, albedo }),
    layout!(AovClear { depth, camera_depth, prim_id, instance_id, element_id, normal, neye, albedo }),
    layout!(Frame {
        top_nodes,
        chunk_instances,
        chunks,
        assemblies,
        meshes,
        lights,
        rays,
        shadow_rays,
        hits,
        paths,
        radiance,
        ray_queue,
        shadow_queue,
        surface_queue,
        escaped_queue,
        streaming,
        counters,
        film,
        color,
        aov,
        aov_clear,
        clear_color,
        ray_o,
        ray_o_lo,
        ray_o_x,
        ray_o_y,
        ray_d,
        ray_d_x,
        ray_d_y,
        lens_u,
        lens_v,
        focus,
        clip_z,
        clip_w,
        view,
        view_normal,
        dome_radiance,
        dome_background,
        dome_select,
        default_albedo,
        clamp,
        width,
        height,
        seed,
        max_bounces,
        light_count,
        flags,
        materials,
        prims,
        material_slots,
        textures,
        texture_pages,
        cones,
        bsdf_tables,
        lighting,
        light_paths,
        placed_values
    }),
    layout!(Streaming {
        segments,
        progress,
        pending,
        shadow_pending,
        surfaces,
        deferred,
        demand,
        sort_counts,
        sort_sums,
        chunk_rays,
        places,
        free_slots,
        surface_materials,
        questions,
        shadow_questions,
        resolve_queue,
        resolved,
        resolve_progress,
        roulette,
        worth,
        verdicts,
        segment_size,
        chunk_count,
        slots,
        unit_count,
        lookups,
        segment_count
    }),
    layout!(Roulette { mean, second_moment, ended_paths, ended_shadows }),
    layout!(Segment { first_pixel, first_sample, count, alive }),
    layout!(Pending { entry, chunk_instance }),
    layout!(Question { t, id, chunk_instance, flags, mean, texture, st, footprint, scale, bias, limit, unit }),
    layout!(GpuSurface {
        position,
        offset,
        position_lo,
        prim_id,
        geometric_normal,
        instance_id,
        shading_normal,
        face,
        albedo,
        cone
    }),
    layout!(GpuNode { min, max, child, count }),
    layout!(GpuTriangle { v0, face, v1, pad1, v2, pad2 }),
    layout!(GpuInstance { object_from_parent, target, prim_id, index_in_prototype, prototype_count }),
    layout!(GpuMesh {
        nodes,
        triangles,
        corner_indices,
        normals,
        colors,
        opacities,
        flags,
        triangle_count,
        primvars,
        primvar_count,
        pad
    }),
    layout!(GpuInput { value, bias, row_s, kind, row_t, texture }),
    layout!(GpuMaterial { inputs, flags, opacity_threshold, names, set_fallback, pad }),
    layout!(GpuPrim { first_slot, slot_count, link_set, pad }),
    layout!(GpuAttribute { values, name, rate_and_width }),
    layout!(GpuSurfaceMaterial { uv, primvars, tangent, material, uv_density, handedness, flags }),
    layout!(GpuAssembly { nodes, instances, primvars }),
    layout!(GpuLight { direction, one_minus_cos, radiance, probability, cumulative }),
    layout!(Lighting {
        local_lights,
        nodes,
        infinite_lights,
        shapings,
        ies,
        maps,
        link_bits,
        prim_sets,
        infinite_count,
        link_words,
        local_share,
        prim_count,
        mesh_lights,
        light_meshes,
        mesh_nodes,
        light_leaves,
        light_triangles,
        light_faces,
        mesh_light_count,
        joint
    }),
    layout!(GpuMeshLight {
        position,
        light_mesh,
        position_lo,
        scale,
        x,
        prim_id,
        y,
        instance_id,
        z,
        mesh,
        error,
        pad,
        trail
    }),
    layout!(GpuLightMesh { root, first_face, face_count, pad }),
    layout!(GpuLightLeaf { first, count, total, pad, trail }),
    layout!(GpuLightTriangle { v0, cumulative, v1, subset, v2, face }),
    layout!(GpuLocalLight {
        position,
        flags,
        position_lo,
        determinant,
        x,
        shaping,
        y,
        map,
        z,
        light_link,
        row_x,
        shadow_link,
        row_y,
        diffuse,
        row_z,
        specular,
        radiance,
        shadow_color
    }),
    layout!(GpuInfiniteLight {
        direction,
        one_minus_cos,
        radiance,
        probability,
        cumulative,
        diffuse,
        specular,
        flags,
        map,
        light_link,
        shadow_link,
        shadow_color
    }),
    layout!(GpuLightNode { min, max, axis, cos_axis, cos_emission, power, child, back }),
    layout!(GpuLightShaping {
        axis,
        cone_angle,
        x,
        smooth_start,
        y,
        focus,
        focus_tint,
        ies,
        angle_scale,
        ies_scale,
        pad
    }),
    layout!(GpuLightMap { texels, alias, width, height, columns, rows, x, format, y, pad0, z, pad1 }),
    layout!(GpuAlias { other, threshold, density }),
    layout!(GpuChunk { nodes, instances, primvars }),
    layout!(GpuTexture { decode, first_page, flags, width, height, levels, texels, fallback }),
    layout!(GpuChunkInstance { chunk_from_world, origin_lo, chunk, instance_id, row, pad }),
    layout!(Ray { o, bounce, d, t_max, o_lo, flags }),
    layout!(PathState { throughput, pdf }),
    layout!(ShadowRay { o, bounce, d, t_max, o_lo, flags, contribution, pad }),
    layout!(IndirectArgs { x, y, z }),
    layout!(Counters {
        closest_rays,
        shadow_rays,
        chunk_visits,
        chunk_misses,
        nonfinite,
        stack_overflows,
        ray_count,
        surface_count,
        escaped_count,
        shadow_count,
        deferred_parity,
        deferred_count,
        visits,
        misses,
        resumed_rays,
        resumed_shadows,
        ray_base,
        shadow_base,
        ray_args,
        surface_args,
        escaped_args,
        shadow_args,
        deferred_args,
        freed,
        tile_misses,
        resolve_count,
        resolve_base,
        resolve_args
    }),
    layout!(FilmPixel { sum, compensation, m2, samples, m2_compensation, pad0, earlier, pad1 }),
    layout!(ErrorSums { s, d, ss, sd, dd, doubt, worst, worst_pixel, pixels, fewest, most, pad }),
    layout!(LbvhBounds { min, max }),
    layout!(LbvhPush {
        bounds,
        keys_in,
        keys_out,
        items_in,
        items_out,
        histogram,
        nodes,
        parents,
        visits,
        depth,
        origin,
        scale,
        count,
        shift,
        groups,
        pad
    }),
];
