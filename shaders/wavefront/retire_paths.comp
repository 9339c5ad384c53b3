// SPDX-License-Identifier: Apache-2.0
// Streaming only. Moves the radiance of the paths that have ended in this step to their places in the segments, which
// may lie in host memory: one thread per path, WavefrontCounters::retire_args. Their slots begin new paths in later
// steps. Reads: free_slots, places, radiance. Writes: ended_radiance. With PATH_EXPRESSIONS, SHADOW_SUMS or LOAD_WAITS
// also: reads light_values, writes plane_values.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"

void main() {
    const uint at = thread_index();
    if (!HAS_STREAMING || at >= COUNTERS.retired_to - COUNTERS.retired_from) return;
    const uint path = ConstUints(STREAMING.free_slots).v[(COUNTERS.retired_from + at) % STREAMING.slots];
    Vec4s(STREAMING.ended_radiance).v[path_place(path)] = ConstVec4s(FRAME.radiance).v[path];
    if (!HAS_PATH_EXPRESSIONS && !HAS_SHADOW_SUMS && !HAS_LOAD_WAITS) return;
    const uint words = FRAME.light_words;
    const uint64_t from = FRAME.light_values + uint64_t(path) * (4u * FRAME.light_stride);
    const uint64_t values = FRAME.plane_values + uint64_t(path_place(path)) * (4u * FRAME.plane_words);
    const uint64_t to = values + 4u * (FRAME.sum_words - words); // the last that are summed
    for (uint word = 0u; word < words; ++word) Floats(to).v[word] = ConstFloats(from).v[word];
}
