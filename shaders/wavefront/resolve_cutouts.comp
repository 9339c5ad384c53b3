// SPDX-License-Identifier: Apache-2.0
// Streaming with cutouts only. Goes on with the lookups that rays asked about, as far as tiles of textures are there:
// one thread per deferred ray, WavefrontCounters::deferred_args. Reads: deferred, rays and shadow_rays (flags),
// textures and tiles. Reads and writes: deferred tests.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/deferred.glsl"
#include "traversal/cutout.glsl"

void main() {
    if (!HAS_STREAMING || !HAS_CUTOUTS || !HAS_TEXTURES) return;
    const uint at = thread_index();
    const uint list = COUNTERS.deferred_parity;
    if (at >= COUNTERS.deferred_count[list]) return;
    const uint entry = ConstUints(STREAMING.deferred[list]).v[at];
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    const uint path = path_of_entry(entry);
    if ((entry & MATERIAL_BIT) != 0u || !is_asked(path, is_shadow)) return;
    DeferredAlphaTests alpha_tests = DeferredAlphaTests(alpha_test_list(is_shadow));
    const DeferredAlphaTest q = alpha_tests.v[path];
    if (q.unit == OWN_UNIT || !is_tile_resident(q.unit)) return;
    TextureProgress progress = TextureProgress(q.mean, q.flags & ALPHA_TEST_TAPS);
    const uint status = continue_lookup(q.texture, q.st, q.width, progress);
    uint flags = (q.flags & ~ALPHA_TEST_TAPS) | progress.taps;
    if (status >= TEXTURE_FALLBACK && is_there(progress.mean, status, q.scale, q.bias, flags, q.limit)) {
        flags |= ALPHA_TEST_PRESENT;
    }
    alpha_tests.v[path].mean = progress.mean;
    alpha_tests.v[path].flags = flags;
    alpha_tests.v[path].unit = status < TEXTURE_FALLBACK ? STREAMING.first_tile + status : OWN_UNIT;
}
