// SPDX-License-Identifier: Apache-2.0
// Starts paths at the camera, one per thread: those of a wave or, with streaming, of the segment whose index is in
// push.flags, in the free slots from push.arg0 on. In core, with textures: a wave that is traced again (PUSH_RETRACE)
// starts only the paths that lacked a tile, and a wave behind an incomplete one starts none. Reads: FrameConstants.
// Writes: rays, paths, radiance of every path; with LOAD_WAITS light_values. In core: ray_queue[0] and WavefrontCounters::ray_count[0]. With
// streaming: the segment, progress; pushes to ray_queue[round & 1].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "texture/feedback.glsl"
#include "math/sampler.glsl"
#include "material/lambert.glsl"
#include "camera/camera.glsl"
#include "camera/pixel_filter.glsl"
#include "wavefront/load_waits.glsl"

void start_path(uint thread, uint path) {
    uint pixel_index = pixel_from(push.first_pixel, thread);
    uint sample_index = sample_from(push.first_sample, push.first_pixel, thread);
    uint seed = FRAME.seed;
    if (HAS_ADAPTIVE) {
        const uvec2 entry = entry_from(push.first_pixel, push.first_sample, thread);
        pixel_index = entry.x & ~STREAM_BIT;
        sample_index = entry.y;
        seed = entry_seed(entry.x);
    }
    const uvec2 pixel = pixel_position(pixel_index);
    const vec4 u = sample_4d(sample_index, 0u, pixel_seed(pixel.x, pixel.y, seed));
    vec2 p = vec2(pixel) + u.xy;
    if (HAS_PIXEL_FILTER) p = vec2(pixel) + filter_place(u.xy);
    const vec2 lens = HAS_LENS ? disk(u.zw) : vec2(0.0);
    if (HAS_CAMERA_MOTION) {
        const float time = shutter_time(sample_index, pixel_seed(pixel.x, pixel.y, seed));
        const CameraRay ray = camera_ray_at(p, lens, time);
        start_ray_from(path, ray.o, ray.shift, ray.d, p, lens);
    } else {
        vec3 shift = camera_shift(p);
        vec3 d = camera_direction(p);
        if (HAS_LENS) {
            const vec3 lens_offset = lens.x * FRAME.lens_u + lens.y * FRAME.lens_v;
            shift += lens_offset;
            d -= lens_offset / FRAME.focus;
        }
        start_ray(path, shift, d, p, lens);
    }
    store_path(path, PathState(vec3(1.0), 0.0));
    Vec4s(FRAME.radiance).v[path] = vec4(0.0);
    if (HAS_LOAD_WAITS) clear_load_waits(path);
    if (HAS_ROULETTE) Vec4s(STREAMING.ended_radiance).v[segment_place(thread)] = vec4(0.0, 0.0, 0.0, -1.0);
}

void main() {
    const uint thread = thread_index();
    const bool is_blocked = waits_for_tiles();
    uint path = 0u;
    bool starts = false;
    if (thread < push.path_count && !is_blocked) {
        path = path_slot(thread);
        starts = starts_path(path);
        if (starts) start_path(thread, path);
    }
    if (HAS_TEXTURE_FEEDBACK && (is_blocked || (push.flags & PUSH_RETRACE) != 0u)) {
        queue_started_paths(path, starts);
    } else {
        queue_paths(thread, path);
    }
}
