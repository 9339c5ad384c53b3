// SPDX-License-Identifier: Apache-2.0
// Moving lights: their placement at the time of a path. A shadow ray and a BSDF ray that meets the light use the same
// time, so both strategies weigh the same light; light trees bound it at all times. Without HAS_MOVING_LIGHTS and
// HAS_MOVING_MESH_LIGHTS none of it is compiled in.
#ifndef OOCPT_LIGHT_MOTION_GLSL
#define OOCPT_LIGHT_MOTION_GLSL

#include "geometry/motion.glsl"

float light_time = 0.5; // of the path whose lights are asked: set_light_time
bool light_moves = false; // the light that was loaded last
vec3 light_turn[3]; // its rotation, columns

void set_light_time(uint path) {
    if (HAS_MOVING_LIGHTS || HAS_MOVING_MESH_LIGHTS) light_time = path_time(path);
}

// Interpolates keys (the first, and how many): rotation and stretch, position, and radiance.
void light_keys_at(uint64_t table, uvec2 keys, out Motion m, out Double3 place, out float radiance) {
    const uint last = keys.x + keys.y - 2u;
    uint at = keys.x;
    while (at < last && LightKeys(table).v[at + 1u].key.time <= light_time) ++at;
    const GpuLightKey a = LightKeys(table).v[at];
    const GpuLightKey b = LightKeys(table).v[at + 1u];
    m = between(a.key, b.key, light_time);
    const Double3 from = Double3(a.key.translation, a.translation_lo);
    place = add(from, m.part * difference(Double3(b.key.translation, b.translation_lo), from));
    radiance = mix(a.radiance, b.radiance, m.part);
}

// The rotation and stretch of a light, its position, and its radiance relative to its entry's; false if it does not
// move.
bool light_frame(uint64_t places, uint index, out Motion m, out Double3 place, out float radiance) {
    const uvec2 keys = ConstUVec2s(places).v[index];
    light_moves = keys.y != 0u;
    if (!light_moves) return false;
    light_keys_at(LIGHTING.light_keys, keys, m, place, radiance);
    light_turn = m.turn;
    return true;
}

void move_local_light(uint index, inout GpuLocalLight light) {
    Motion m;
    Double3 place;
    float radiance;
    if (!light_frame(LIGHTING.local_motion, index, m, place, radiance)) return;
    light.position = place.hi;
    light.position_lo = place.lo;
    light.x = moved_vector(m, vec3(1.0, 0.0, 0.0));
    light.y = moved_vector(m, vec3(0.0, 1.0, 0.0));
    light.z = moved_vector(m, vec3(0.0, 0.0, 1.0));
    const vec3 yz = cross3(light.y, light.z);
    light.determinant = dot3(light.x, yz);
    light.row_x = yz / light.determinant;
    light.row_y = cross3(light.z, light.x) / light.determinant;
    light.row_z = cross3(light.x, light.y) / light.determinant;
    light.radiance *= radiance;
}

// Moves a mesh light, from the innermost moving frame outwards. The keys are those that traversal has, and give the
// same rotations and stretches.
void move_mesh_light(uint index, inout GpuMeshLight light) {
    const uvec2 levels = ConstUVec2s(LIGHTING.mesh_motion).v[index];
    for (uint i = levels.y; i > 0u; --i) {
        Motion m;
        Double3 place;
        float radiance;
        light_keys_at(LIGHTING.mesh_keys, ConstUVec2s(LIGHTING.mesh_motion).v[levels.x + i - 1u], m, place, radiance);
        place = add(place, moved_vector(m, light.position) + moved_vector(m, light.position_lo));
        light.position = place.hi;
        light.position_lo = place.lo;
        light.x = moved_vector(m, light.x);
        light.y = moved_vector(m, light.y);
        light.z = moved_vector(m, light.z);
    }
}

// A direction in the frame of the light that was loaded last.
vec3 into_light_frame(vec3 w) {
    if (!HAS_MOVING_LIGHTS || !light_moves) return w;
    return vec3(dot3(light_turn[0], w), dot3(light_turn[1], w), dot3(light_turn[2], w));
}

vec3 out_of_light_frame(vec3 w) {
    if (!HAS_MOVING_LIGHTS || !light_moves) return w;
    return combine_rows(light_turn[0], light_turn[1], light_turn[2], w);
}

// Must be called before into_light_frame for a light at infinity.
void turn_infinite_light(uint index) {
    if (!HAS_MOVING_LIGHTS) return;
    Motion m;
    Double3 place;
    float radiance;
    light_frame(LIGHTING.infinite_motion, index, m, place, radiance);
}

#endif
