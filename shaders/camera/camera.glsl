// SPDX-License-Identifier: Apache-2.0
// Rays from the camera: their origin and direction are affine functions of the image point p, in pixels.
#ifndef OOCPT_CAMERA_GLSL
#define OOCPT_CAMERA_GLSL

#include "texture/cone.glsl"

#include "math/double.glsl"
#include "geometry/motion.glsl"
#include "wavefront/progress.glsl"

// The shift from the origin of image point (0, 0) to that of p; zero for a perspective camera.
vec3 camera_shift(vec2 p) {
    return p.x * FRAME.ray_o_x + p.y * FRAME.ray_o_y;
}

// Not normalised: the direction advances one unit along the view axis.
vec3 camera_direction(vec2 p) {
    return FRAME.ray_d + p.x * FRAME.ray_d_x + p.y * FRAME.ray_d_y;
}

// A ray of a moving camera at a time of the shutter: it starts at o + shift.
struct CameraRay {
    Double3 o;
    vec3 shift;
    vec3 d;
};

// The interpolated frame of a moving camera, and its position.
Motion camera_frame(uint key_count, float time, out Double3 position) {
    const uint64_t keys = FRAME.camera_motion + 96ul;
    uint at = 0u;
    while (at + 2u < key_count && CameraKeys(keys).v[at + 1u].key.time <= time) ++at;
    const GpuCameraKey a = CameraKeys(keys).v[at];
    const GpuCameraKey b = CameraKeys(keys).v[at + 1u];
    const Motion m = between(a.key, b.key, time);
    const Double3 from = Double3(a.key.translation, a.translation_lo);
    const vec3 displacement = difference(Double3(b.key.translation, b.translation_lo), from);
    position = add(from, m.part * displacement);
    return m;
}

// `lens`: a point of the unit disk; 0 without HAS_LENS.
CameraRay camera_ray_at(vec2 p, vec2 lens, float time) {
    const GpuCameraMotion motion = CameraMotionBlock(FRAME.camera_motion).m;
    Double3 position;
    const Motion m = camera_frame(motion.key_count, time, position);
    vec3 o = motion.o + p.x * motion.o_x + p.y * motion.o_y;
    vec3 d = motion.d + p.x * motion.d_x + p.y * motion.d_y;
    if (HAS_LENS) {
        const vec3 lens_offset = vec3(lens * motion.lens_radius, 0.0);
        o += lens_offset;
        d -= lens_offset / FRAME.focus;
    }
    return CameraRay(position, moved_vector(m, o), moved_vector(m, d));
}

// Nothing of the scene is farther from the camera (rust/core/src/scene/validate.rs).
const float MAX_DISTANCE = 1.0e18;

// The interval of a ray that the clipping planes leave, in units of a direction that goes one unit along the view axis;
// empty if y <= x. `lens`: as for camera_ray_at.
vec2 clip_interval(vec2 p, vec2 lens) {
    vec2 interval = vec2(0.0, uintBitsToFloat(0x7f800000u));
    for (uint i = 0u; i < FRAME.clip_plane_count; ++i) {
        const ClipPlane plane = ClipPlanes(FRAME.clip_planes).v[i];
        float distance_at_origin = plane.begins.x + p.x * plane.begins.y + p.y * plane.begins.z;
        float slope = plane.slope.x + p.x * plane.slope.y + p.y * plane.slope.z;
        if (HAS_LENS) {
            const float lens_offset = lens.x * plane.lens_x + lens.y * plane.lens_y;
            distance_at_origin += lens_offset;
            slope -= lens_offset / FRAME.focus;
        }
        const float crossing = -distance_at_origin / slope;
        if (slope > 0.0) {
            interval.x = max(interval.x, crossing);
        } else if (slope < 0.0) {
            interval.y = min(interval.y, crossing);
        } else if (distance_at_origin < 0.0) {
            interval.y = -1.0;
        }
    }
    if (!(interval.x < MAX_DISTANCE)) interval = vec2(0.0);
    return interval;
}

// Stores the first ray of a path. Clipping planes move its origin and its end, so that no other pass knows of them. The
// new origin is on the ray, up to the rounding of two floats, and on no surface, so it needs no offset against
// self-intersection. A ray whose interval is empty ends at 0: traversal relies on t_max >= 0.
void start_ray_from(uint path, Double3 start, vec3 shift, vec3 d, vec2 p, vec2 lens) {
    if (HAS_TEXTURES) store_camera_cone(path, d);
    Double3 o = add(start, shift);
    float t_max = uintBitsToFloat(0x7f800000u);
    if (HAS_CLIPPING) {
        const vec2 interval = clip_interval(p, lens);
        const float unit = sqrt(dot3(d, d));
        // The product and its rounding error.
        const vec3 advance = interval.x * d;
        o = add(add(o, advance), fma(vec3(interval.x), d, -advance));
        t_max = max(interval.y - interval.x, 0.0) * unit;
        if (HAS_TEXTURES) begin_cone(path, interval.x * unit);
    }
    store_ray(ray_address(path), Ray(o.hi, 0u, normalize(d), t_max, o.lo, 0u));
}

void start_ray(uint path, vec3 shift, vec3 d, vec2 p, vec2 lens) {
    start_ray_from(path, Double3(FRAME.ray_o, FRAME.ray_o_lo), shift, d, p, lens);
}

// The slot of a new path: its index in a wave. With streaming it is entry arg0 + thread of the list of free slots,
// which has every slot once, then those that ended paths have given back.
uint path_slot(uint thread) {
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

// In core: queues the paths of a wave that start. The host has set ray_count[0] to 0.
void queue_started_paths(uint path, bool starts) {
    uint to;
    QUEUE_SLOT(to, ray_count[0], starts);
    if (starts) Uints(FRAME.ray_queue[0]).v[to] = path;
}

#endif
