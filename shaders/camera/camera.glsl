// SPDX-License-Identifier: Apache-2.0
// Rays from the camera: origin and direction are affine in the image point.
#ifndef OOCPT_CAMERA_GLSL
#define OOCPT_CAMERA_GLSL

#include "texture/cone.glsl"

#include "math/double.glsl"
#include "geometry/motion.glsl"
#include "wavefront/progress.glsl"

// From the origin of image point (0, 0) to that of p; zero for a perspective camera.
vec3 camera_shift(vec2 p) {
    return p.x * FRAME.ray_o_x + p.y * FRAME.ray_o_y;
}

// Not normalised: one unit along the view axis.
vec3 camera_direction(vec2 p) {
    return FRAME.ray_d + p.x * FRAME.ray_d_x + p.y * FRAME.ray_d_y;
}

// The same of a camera that moves, at a time of the shutter; and where its rays begin.
struct MovedCamera {
    Double3 o;
    vec3 shift;
    vec3 d;
};

// The frame of a camera that moves, and where its origin is.
Motion camera_frame(uint key_count, float time, out Double3 place) {
    const uint64_t keys = FRAME.camera_motion + 96ul;
    uint at = 0u;
    while (at + 2u < key_count && CameraKeys(keys).v[at + 1u].key.time <= time) ++at;
    const GpuCameraKey a = CameraKeys(keys).v[at];
    const GpuCameraKey b = CameraKeys(keys).v[at + 1u];
    const Motion m = between(a.key, b.key, time);
    const Double3 from = Double3(a.key.translation, a.translation_lo);
    const vec3 way = difference(Double3(b.key.translation, b.translation_lo), from);
    place = add(from, m.part * way);
    return m;
}

// `lens`: a point of the unit disk; 0 without HAS_LENS.
MovedCamera camera_at(vec2 p, vec2 lens, float time) {
    const GpuCameraMotion motion = CameraMotionBlock(FRAME.camera_motion).m;
    Double3 place;
    const Motion m = camera_frame(motion.key_count, time, place);
    vec3 o = motion.o + p.x * motion.o_x + p.y * motion.o_y;
    vec3 d = motion.d + p.x * motion.d_x + p.y * motion.d_y;
    if (HAS_LENS) {
        const vec3 aside = vec3(lens * motion.lens_radius, 0.0);
        o += aside;
        d -= aside / FRAME.focus;
    }
    return MovedCamera(place, moved_vector(m, o), moved_vector(m, d));
}

// Nothing of the scene is farther from the camera (rust/core/src/scene/validate.rs).
const float FARTHEST = 1.0e18;

// From where to where the camera's planes let it see along a ray, in units of a direction that goes one unit along the
// view axis; y <= x: nowhere. `lens`: as for camera_at.
vec2 between_planes(vec2 p, vec2 lens) {
    vec2 seen = vec2(0.0, uintBitsToFloat(0x7f800000u));
    for (uint i = 0u; i < FRAME.clip_plane_count; ++i) {
        const ClipPlane plane = ClipPlanes(FRAME.clip_planes).v[i];
        float begins = plane.begins.x + p.x * plane.begins.y + p.y * plane.begins.z;
        float slope = plane.slope.x + p.x * plane.slope.y + p.y * plane.slope.z;
        if (HAS_LENS) {
            const float aside = lens.x * plane.lens_x + lens.y * plane.lens_y;
            begins += aside;
            slope -= aside / FRAME.focus;
        }
        const float at = -begins / slope;
        if (slope > 0.0) {
            seen.x = max(seen.x, at);
        } else if (slope < 0.0) {
            seen.y = min(seen.y, at);
        } else if (begins < 0.0) {
            seen.y = -1.0;
        }
    }
    if (!(seen.x < FARTHEST)) seen = vec2(0.0);
    return seen;
}

// The first ray of a path. Planes move where it begins and ends, so that all that meets it knows nothing of them: the
// new origin is on the ray but for what two floats round, and on no surface, so there is nothing to keep off from. A
// ray that sees nothing ends at 0, not before: a walk counts on that.
void start_ray_from(uint path, Double3 start, vec3 shift, vec3 d, vec2 p, vec2 lens) {
    if (HAS_TEXTURES) store_camera_cone(path, d);
    Double3 o = add(start, shift);
    float t_max = uintBitsToFloat(0x7f800000u);
    if (HAS_CLIPPING) {
        const vec2 seen = between_planes(p, lens);
        const float unit = sqrt(dot3(d, d));
        const vec3 way = seen.x * d;
        o = add(add(o, way), fma(vec3(seen.x), d, -way));
        t_max = max(seen.y - seen.x, 0.0) * unit;
        if (HAS_TEXTURES) begin_cone(path, seen.x * unit);
    }
    store_ray(ray_address(path), Ray(o.hi, 0u, normalize(d), t_max, o.lo, 0u));
}

void start_ray(uint path, vec3 shift, vec3 d, vec2 p, vec2 lens) {
    start_ray_from(path, Double3(FRAME.ray_o, FRAME.ray_o_lo), shift, d, p, lens);
}

// The slot of a new path: its number in a wave. With streaming the slot number arg0 + thread of all that were ever
// free: first every slot once, then those that ended paths have given back.
uint new_slot(uint thread) {
    if (!HAS_STREAMING || (push.flags & PUSH_FRESH) != 0u) return push.arg0 + thread;
    return ConstUints(STREAMING.free_slots).v[(push.arg0 + thread) % STREAMING.slots];
}

// Queues the paths of a wave or, with streaming, of a segment, whose table entry is written.
void queue_paths(uint thread, uint path) {
    const bool in_range = thread < push.path_count;
    if (!HAS_STREAMING) {
        if (thread == 0u) COUNTERS.ray_count[0] = push.path_count;
        if (in_range) Uints(FRAME.ray_queue[0]).v[path] = path;
        return;
    }
    if (thread == 0u) {
        Segments(STREAMING.segments).v[push_segment()] =
            PathSegment(push.first_pixel, push.first_sample, push.path_count, push.path_count);
    }
    if (in_range) {
        set_progress(path, SHADOW_DONE);
        Uints(STREAMING.places).v[path] = segment_place(thread);
    }
    uint to;
    QUEUE_SLOT(to, ray_count[push.round & 1u], in_range);
    if (in_range) Uints(FRAME.ray_queue[push.round & 1u]).v[to] = path;
}

// In core: queues those paths of a wave that start. The host has set ray_count[0] to 0.
void queue_some(uint thread, uint path, bool starts) {
    uint to;
    QUEUE_SLOT(to, ray_count[0], starts);
    if (starts) Uints(FRAME.ray_queue[0]).v[to] = path;
}

#endif
