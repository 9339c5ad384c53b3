// SPDX-License-Identifier: Apache-2.0
// Roulette on loads only. Weights or ends the rays that wait for a unit with a verdict: one thread per deferred ray,
// WavefrontCounters::deferred_args. Ended rays go on like those whose unit is resident, so that intersect_* finish
// them. arg0: the table of verdicts. Reads: deferred, pending lists, verdicts. Reads and writes: rays (flags),
// shadow_rays (flags, contribution), paths (throughput), with SHADOW_SUMS light_values; adds to RouletteStats.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/roulette.glsl"
#include "light/shadow_sums.glsl"

void end_ray(uint path, bool is_shadow) {
    set_ray_flags(is_shadow ? shadow_ray_address(path) : ray_address(path), RAY_ENDED);
    if (is_shadow) {
        atomicAdd(ROULETTE.ended_shadows, 1u);
    } else {
        atomicAdd(ROULETTE.ended_paths, 1u);
    }
}

void weigh_ray(uint path, bool is_shadow, float weight) {
    if (is_shadow) {
        const uint64_t ray = shadow_ray_address(path);
        store_shadow_light(ray, shadow_contribution(ray) * weight, shadow_in_shadow(ray));
        if (HAS_SHADOW_SUMS && shadow_bounce(ray_word(ray)) == 0u) store_shadow(path, vec3(weight));
    } else {
        PathState state = load_path(path);
        state.throughput *= weight;
        store_path(path, state);
    }
}

void main() {
    if (!HAS_ROULETTE) return;
    const uint at = thread_index();
    const uint list = COUNTERS.deferred_parity;
    if (at >= COUNTERS.deferred_count[list]) return;
    const uint entry = ConstUints(STREAMING.deferred[list]).v[at];
    const bool is_shadow = (entry & SHADOW_BIT) != 0u;
    uint unit;
    if (!waits_for_geometry(entry, unit) || !is_played(entry)) return;
    const float verdict = ConstFloats(STREAMING.verdicts[push.arg0]).v[unit];
    if (verdict < 0.0) {
        end_ray(path_of_entry(entry), is_shadow);
    } else if (verdict > 0.0) {
        weigh_ray(path_of_entry(entry), is_shadow, verdict);
    }
}
