// SPDX-License-Identifier: Apache-2.0
// Rays through the pixel centres, pinhole, unaffected by sampling: one thread per pixel of the slice that push names.
// Reads: Frame. Writes: rays of every path; ray_queue[0] and Counters::ray_count[0].
#version 460
#extension GL_GOOGLE_include_directive : require
#include "include/wavefront.glsl"
#include "include/camera.glsl"

void main() {
    const uint path = thread_index();
    if (path == 0u) COUNTERS.ray_count[0] = push.path_count;
    if (path >= push.path_count) return;
    const vec2 p = vec2(pixel_position(path_pixel(path))) + 0.5;
    start_ray(path, camera_shift(p), camera_direction(p));
}
