// SPDX-License-Identifier: Apache-2.0
// What samples have for images of shadows (Features::SHADOW_SUMS), among the light values of their path: the light that
// the shadow ray of bounce 0 asks for, and what of it arrives. The film sums both; an image is 1 - arrived / asked of
// the sums (resolve_planes). Both are of the same shadow rays and without the weight against the BSDF's ray: where
// nothing is in the way of any they are the same, and their ratio is 1 without noise. Needs wavefront.glsl.
#ifndef OOCPT_LIGHT_SHADOW_SUMS_GLSL
#define OOCPT_LIGHT_SHADOW_SUMS_GLSL

#include "math/affine.glsl"

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722); // of linear Rec. 709

uint64_t shadow_values_of(uint path, uint first) {
    return FRAME.light_values + uint64_t(path) * (4u * FRAME.light_stride) + 4u * first;
}

// A path begins: it has asked for no light.
void clear_shadow_values(uint path) {
    const uint end = FRAME.light_words - (HAS_LOAD_WAITS ? WAIT_WORDS : 0u);
    for (uint word = 3u * FRAME.light_count; word < end; ++word) {
        Floats(shadow_values_of(path, word)).v[0] = 0.0;
    }
}

// The sample meets a shadow catcher.
void meet_catcher(uint path) {
    Floats(shadow_values_of(path, FRAME.catcher_at)).v[2] = 1.0;
}

// A shadow ray of bounce 0 asks for this light, which arrives unless store_shadow says otherwise.
void ask_light(uint path, vec3 light, bool is_caught) {
    if (FRAME.shadow_at != NO_INDEX) {
        const uint64_t values = shadow_values_of(path, FRAME.shadow_at);
        Vec3s(values).v[0] = light;
        Vec3s(values).v[1] = light;
    }
    if (!is_caught || FRAME.catcher_at == NO_INDEX) return;
    const uint64_t values = shadow_values_of(path, FRAME.catcher_at);
    Floats(values).v[0] = dot3(LUMINANCE, light);
    Floats(values).v[1] = dot3(LUMINANCE, light);
}

// So much of the light that would arrive does.
void store_shadow(uint path, vec3 arrives) {
    if (FRAME.shadow_at != NO_INDEX) {
        const uint64_t values = shadow_values_of(path, FRAME.shadow_at);
        Vec3s(values).v[1] = ConstVec3s(values).v[1] * arrives;
    }
    if (FRAME.catcher_at == NO_INDEX) return;
    const uint64_t values = shadow_values_of(path, FRAME.catcher_at);
    Floats(values).v[1] = ConstFloats(values).v[1] * dot3(LUMINANCE, arrives);
}

#endif
