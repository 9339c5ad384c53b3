// SPDX-License-Identifier: Apache-2.0
// Writes the filtered images so far: one thread per pixel. Reads: film (the number of samples),
// FrameConstants::plane_sums. Writes: the planes of FrameConstants::aov that PlaneOffsets has, primvar_images that are
// filtered, those of shadows and waits, and light_images, which are times the camera's exposure as `color`. Adaptive: half of
// each stream, as `resolve`. A pixel without a sample is clear.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "wavefront/wavefront.glsl"
#include "wavefront/shadow_images.glsl"

vec4 primvar_mean(uint pixel, uint first) {
    const float samples = float(ConstFilm(FRAME.film).v[pixel].samples);
    return vec4(plane_sum(pixel, first), plane_sum(pixel, first + 1u), plane_sum(pixel, first + 2u),
                plane_sum(pixel, first + 3u)) / samples;
}

void write_primvar(uint64_t plane, uint first, uint pixel) {
    if (first == NO_INDEX) return;
    const uint other = FRAME.width * FRAME.height + pixel;
    vec4 value = vec4(0.0);
    if (ConstFilm(FRAME.film).v[pixel].samples > 0u) {
        value = primvar_mean(pixel, first);
        const bool has_other = HAS_ADAPTIVE && ConstFilm(FRAME.film).v[other].samples > 0u;
        if (has_other) value = 0.5 * (value + primvar_mean(other, first));
    }
    Vec4s(plane).v[pixel] = value;
}

vec3 mean_of(uint pixel, uint first) {
    const float samples = float(ConstFilm(FRAME.film).v[pixel].samples);
    return vec3(plane_sum(pixel, first), plane_sum(pixel, first + 1u), plane_sum(pixel, first + 2u)) / samples;
}

void write_plane(uint64_t plane, uint first, uint pixel, vec3 clear, float scale) {
    if (first == NO_INDEX) return;
    const uint other = FRAME.width * FRAME.height + pixel;
    vec3 value = clear;
    if (ConstFilm(FRAME.film).v[pixel].samples > 0u) {
        value = mean_of(pixel, first);
        if (HAS_ADAPTIVE && ConstFilm(FRAME.film).v[other].samples > 0u) value = 0.5 * (value + mean_of(other, first));
    }
    Vec3s(plane).v[pixel] = scale * value;
}

void main() {
    const uint pixel = thread_index();
    if (pixel >= FRAME.width * FRAME.height) return;
    const PlaneOffsets at = FRAME.plane_at;
    const AovClear clear = FRAME.aov_clear;
    write_plane(FRAME.aov.normal, at.normal, pixel, clear.normal, 1.0);
    write_plane(FRAME.aov.neye, at.neye, pixel, clear.neye, 1.0);
    write_plane(FRAME.aov.albedo, at.albedo, pixel, clear.albedo, 1.0);
    write_plane(FRAME.aov.position, at.position, pixel, clear.position, 1.0);
    write_plane(FRAME.aov.peye, at.peye, pixel, clear.peye, 1.0);
    write_plane(FRAME.aov.geometric_normal, at.geometric_normal, pixel, clear.geometric_normal, 1.0);
    for (uint i = 0u; HAS_SHADED_AOVS && i < MAX_SHOWN_PRIMVARS && FRAME.primvar_images[i] != 0ul; ++i) {
        write_primvar(FRAME.primvar_images[i], FRAME.primvar_at[i], pixel);
    }
    if (HAS_SHADOW_SUMS) {
        const uint first = FRAME.sum_words - FRAME.light_words;
        if (FRAME.shadow_at != NO_INDEX) Vec4s(FRAME.aov.shadow).v[pixel] = shadow(pixel, first + FRAME.shadow_at);
        if (FRAME.catcher_at != NO_INDEX) Floats(FRAME.aov.shadow_catcher).v[pixel] = caught_alpha(pixel);
    }
    if (HAS_LOAD_WAITS) {
        const uint first = FRAME.sum_words - WAIT_WORDS;
        Floats(FRAME.aov.load_waits).v[pixel] = plane_mean(pixel, first) + plane_mean(pixel, first + 1u);
    }
    if (!HAS_PATH_EXPRESSIONS) return;
    for (uint i = 0u; i < FRAME.light_count; ++i) {
        const uint first = FRAME.sum_words - FRAME.light_words + 3u * i;
        write_plane(FRAME.light_images[i], first, pixel, vec3(0.0), FRAME.exposure);
    }
}
