// SPDX-License-Identifier: Apache-2.0
// The distance that the surface point behind a pixel centre moves over the image while the shutter is open, from its
// positions as the camera sees them when the shutter opens and when it closes. Both ends go through the same
// operations, so the motion of a resting point is 0 to the bit.
#ifndef OOCPT_MOTION_VECTOR_GLSL
#define OOCPT_MOTION_VECTOR_GLSL

#include "camera/camera.glsl"
#include "wavefront/path_surface.glsl"

// Pixel, and distance along the view axis; false if the camera cannot project the point, for instance behind the lens.
bool seen_at(Double3 position, float time, out vec3 seen) {
    vec4 v;
    if (HAS_CAMERA_MOTION) {
        Double3 place;
        const Motion m = camera_frame(CameraMotionBlock(FRAME.camera_motion).m.key_count, time, place);
        v = vec4(apply_vector(inverse_map(m, vec3(0.0)), difference(position, place)), 1.0);
    } else {
        const vec4 p = vec4(difference(position, Double3(FRAME.ray_o, FRAME.ray_o_lo)), 1.0);
        v = vec4(dot(FRAME.view[0], p), dot(FRAME.view[1], p), dot(FRAME.view[2], p), 1.0);
    }
    const float w = dot(FRAME.clip_w, v);
    seen = vec3(vec2(dot(FRAME.pixel_x, v), dot(FRAME.pixel_y, v)) / w, -v.z);
    return w > 0.0;
}

// The world position of a point of the mesh of surface_chain at a time of the shutter. `kept`: the coordinates that the
// point keeps on an item that is not a triangle (geometry/leaf.glsl).
Double3 placed_at(HitHeader hit, vec3 kept, float time) {
    surface_time = time;
    uint mesh, instance_id;
    int prim_id;
    const Affine map = follow_chain(hit.chunk_instance, mesh, prim_id, instance_id);
    const Pose pose = pose_of(mesh, time);
    vec3 v0, v1, v2, local;
    posed_item(pose, hit.triangle, v0, v1, v2);
    if (HAS_LEAF_KINDS && (Meshes(FRAME.meshes).v[mesh].flags & MESH_LEAF_MASK) != 0u) {
        local = leaf_place(leaf_kind(Meshes(FRAME.meshes).v[mesh].flags), v0, v1, v2, hit.uv, kept);
    } else {
        local = fma(v0, vec3(1.0 - hit.uv.x - hit.uv.y), fma(v1, vec3(hit.uv.x), v2 * hit.uv.y));
    }
    const ChunkMap world = chunk_map(hit.chunk_instance);
    return add(world.origin, unapply_rows(world.x, world.y, world.z, unapply_point(map, local)));
}

// The motion, and both parts of it where they are wanted. After surface_of_hit(path).
vec3 motion_over_image(uint path, out vec4 both) {
    const HitHeader hit = load_hit_header(FRAME.hits, path);
    vec3 kept = vec3(0.0);
    if (HAS_LEAF_KINDS) {
        uint mesh, instance_id;
        int prim_id;
        follow_chain(hit.chunk_instance, mesh, prim_id, instance_id);
        const uint flags = Meshes(FRAME.meshes).v[mesh].flags;
        if ((flags & MESH_LEAF_MASK) != 0u) {
            const Pose pose = pose_of(mesh, surface_time);
            const Ray ray = load_ray(ray_address(path));
            const vec3 met = met_by(ray, hit.t, hit.chunk_instance, chunk_map(hit.chunk_instance));
            vec3 v0, v1, v2;
            posed_item(pose, hit.triangle, v0, v1, v2);
            kept = leaf_keep(leaf_kind(flags), v0, v1, v2, hit.uv, met);
        }
    }
    const float own_time = surface_time;
    vec3 from, to;
    const bool opens = seen_at(placed_at(hit, kept, 0.0), 0.0, from);
    const bool closes = seen_at(placed_at(hit, kept, 1.0), 1.0, to);
    both = vec4(0.0);
    if (FRAME.aov.motion_both != 0ul) {
        vec3 now;
        const bool is_seen = seen_at(placed_at(hit, kept, own_time), own_time, now);
        if (is_seen && opens && closes) both = vec4(now.xy - from.xy, to.xy - now.xy);
    }
    surface_time = own_time;
    return opens && closes ? to - from : vec3(0.0);
}

void store_motion(uint path, vec3 motion, vec4 both) {
    const uint pixel = film_pixel(pixel_position(path_pixel(path)));
    if (FRAME.aov.motion != 0ul) Vec3s(FRAME.aov.motion).v[pixel] = motion;
    if (FRAME.aov.motion_both != 0ul) Vec4s(FRAME.aov.motion_both).v[pixel] = both;
}

#endif
