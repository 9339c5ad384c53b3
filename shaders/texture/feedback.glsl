// SPDX-License-Identifier: Apache-2.0
// Tiles of textures that lookups lacked, in core. A path that lacks one is traced again when the host has loaded it; as
// a path is a function of its number, the result is the same as if the tile had been there. As long as a path of a wave
// is incomplete, the wave is not added to the film, and the waves that are recorded behind it do nothing. Includes
// wavefront before.
#ifndef OOCPT_TEXTURE_FEEDBACK_GLSL
#define OOCPT_TEXTURE_FEEDBACK_GLSL

const bool HAS_TEXTURE_FEEDBACK = HAS_TEXTURES && !HAS_STREAMING;

// Records that a path lacks tile `page` of the scene.
void request_tile(uint path, uint page) {
    if (FRAME.texture_feedback == 0ul) return;
    if ((push.flags & PUSH_AOVS) == 0u) Uints(TEXTURE_FEEDBACK.incomplete_paths).v[path] = 1u;
    TEXTURE_FEEDBACK.is_incomplete = 1u;
    const uint bit = 1u << (page & 31u);
    if ((atomicOr(Uints(TEXTURE_FEEDBACK.requested).v[page >> 5], bit) & bit) != 0u) return;
    const uint at = atomicAdd(TEXTURE_FEEDBACK.request_count, 1u);
    if (at < TEXTURE_FEEDBACK.request_capacity) Uints(TEXTURE_FEEDBACK.wanted).v[at] = page;
}

// Returns true if the passes of this wave do nothing, because an earlier wave is incomplete.
bool waits_for_tiles() {
    return HAS_TEXTURE_FEEDBACK && FRAME.texture_feedback != 0ul && TEXTURE_FEEDBACK.is_incomplete != 0u;
}

// Returns true if a path of a wave starts: all do, or, when it is traced again, those that lacked a tile.
bool starts_path(uint path) {
    if (!HAS_TEXTURE_FEEDBACK || FRAME.texture_feedback == 0ul) return true;
    const bool starts = (push.flags & PUSH_RETRACE) == 0u || Uints(TEXTURE_FEEDBACK.incomplete_paths).v[path] != 0u;
    if (starts) Uints(TEXTURE_FEEDBACK.incomplete_paths).v[path] = 0u;
    return starts;
}

#endif
