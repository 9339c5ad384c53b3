// SPDX-License-Identifier: Apache-2.0
// Rays through the pixel centres, pinhole, unaffected by sampling: one thread per pixel of the slice that push names,
// which is a wave or, with streaming, the segment that flags name in free slots from number arg0 on.
// Reads: FrameConstants. Writes: rays of every path, and what generate_camera_rays writes of queues and segments.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "camera/camera.glsl"

void main() {
    const uint thread = thread_index();
    uint path = 0u;
    if (thread < push.path_count) {
        path = new_slot(thread);
        const vec2 p = vec2(pixel_position(pixel_from(push.first_pixel, thread))) + 0.5;
        start_ray(path, camera_shift(p), camera_direction(p), p, vec2(0.0));
    }
    queue_paths(thread, path);
}
