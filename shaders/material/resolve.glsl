// SPDX-License-Identifier: Apache-2.0
// resolve_materials and resolve_lights: evaluates the material of each path of resolve_queue and, with RESOLVE_LIGHTS,
// the emission of the light that its surface will sample. Includes wavefront, progress, path_surface, material before,
// and shade with RESOLVE_LIGHTS.
#ifndef OOCPT_RESOLVE_GLSL
#define OOCPT_RESOLVE_GLSL

void main() {
    if (!HAS_STREAMING || !HAS_TEXTURES) return;
    const uint at = thread_index();
    const bool in_range = at < COUNTERS.resolve_count;
    uint path = 0u;
    uint status = TEXTURE_DONE;
    if (in_range) {
        path = ConstUints(STREAMING.resolve_queue).v[at];
        noted_count = 0u;
        const Surface surface = stored_surface(path);
        const Shading shading = make_shading(path, surface, status);
#ifdef RESOLVE_LIGHTS
        if (HAS_MESH_LIGHT_VALUES && status >= TEXTURE_FALLBACK && (push.flags & PUSH_AOVS) == 0u) {
            resolve_ask(path, surface, shading, status);
        }
#endif
    }
    const bool waits = in_range && status < TEXTURE_FALLBACK;
    if (waits) {
        PendingLists(STREAMING.pending).v[path].chunk_instance[0] = status;
        for (uint k = 0u; k < noted_count; ++k) {
            PendingLists(STREAMING.pending).v[path].chunk_instance[k + 1u] = noted_units[k];
        }
        set_ray_flags(ray_address(path), pack_waiting(1u + noted_count, false));
    }
    push_deferred(path | MATERIAL_BIT, waits);
    uint to;
    QUEUE_SLOT(to, surface_count, in_range && !waits);
    if (in_range && !waits) Uints(FRAME.surface_queue).v[to] = path;
    ADD_EACH(tile_misses, waits ? 1u : 0u);
}

#endif
