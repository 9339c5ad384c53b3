// SPDX-License-Identifier: Apache-2.0
// Starts the paths of a wave, or of the segment that flags name in free slots from number arg0 on: one thread per path.
// In core, with textures: of a wave that is traced again, the paths that lacked a tile; of a wave behind an incomplete
// one, none.
// Reads: FrameConstants. Writes: rays, paths, radiance of every path. In core: ray_queue[0] and
// WavefrontCounters::ray_count[0]. With streaming: the segment, progress; pushes to ray_queue[round & 1].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "texture/feedback.glsl"
#include "math/sampler.glsl"
#include "material/lambert.glsl"
#include "camera/camera.glsl"

void start_path(uint thread, uint path) {
    uint pixel_index = pixel_from(push.first_pixel, thread);
    uint index = sample_from(push.first_sample, push.first_pixel, thread);
    uint seed = FRAME.seed;
    if (HAS_ADAPTIVE) {
        const uvec2 entry = entry_from(push.first_pixel, push.first_sample, thread);
        pixel_index = entry.x & ~STREAM_BIT;
        index = entry.y;
        seed = entry_seed(entry.x);
    }
    const uvec2 pixel = pixel_position(pixel_index);
    const vec4 u = sample_4d(index, 0u, pixel_seed(pixel.x, pixel.y, seed));
    const vec2 p = vec2(pixel) + u.xy;
    const vec2 lens = HAS_LENS ? disk(u.zw) : vec2(0.0);
    if (HAS_CAMERA_MOTION) {
        const float time = shutter_time(index, pixel_seed(pixel.x, pixel.y, seed));
        const MovedCamera camera = camera_at(p, lens, time);
        start_ray_from(path, camera.o, camera.shift, camera.d, p, lens);
    } else {
        vec3 shift = camera_shift(p);
        vec3 d = camera_direction(p);
        if (HAS_LENS) {
            const vec3 aside = lens.x * FRAME.lens_u + lens.y * FRAME.lens_v;
            shift += aside;
            d -= aside / FRAME.focus;
        }
        start_ray(path, shift, d, p, lens);
    }
    store_path(path, PathState(vec3(1.0), 0.0));
    Vec4s(FRAME.radiance).v[path] = vec4(0.0);
    if (HAS_ROULETTE) Vec4s(STREAMING.ended_radiance).v[segment_place(thread)] = vec4(0.0, 0.0, 0.0, -1.0);
}

void main() {
    const uint thread = thread_index();
    const bool waits = waits_for_tiles();
    uint path = 0u;
    bool starts = false;
    if (thread < push.path_count && !waits) {
        path = new_slot(thread);
        starts = starts_path(path);
        if (starts) start_path(thread, path);
    }
    if (HAS_TEXTURE_FEEDBACK && (waits || (push.flags & PUSH_RETRACE) != 0u)) {
        queue_some(thread, path, starts);
    } else {
        queue_paths(thread, path);
    }
}
