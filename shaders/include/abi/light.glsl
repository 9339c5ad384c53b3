// SPDX-License-Identifier: Apache-2.0
// The light table: local lights and the tree over them, lights at infinity, shaping, pictures. A part of abi.glsl.
#ifndef OOCPT_ABI_LIGHT_GLSL
#define OOCPT_ABI_LIGHT_GLSL

struct Lighting {
    uint64_t local_lights;
    uint64_t nodes;
    uint64_t infinite_lights;
    uint64_t shapings;
    uint64_t ies;
    uint64_t maps;
    uint64_t link_bits;
    uint64_t prim_sets;
    uint infinite_count;
    uint link_words;
    float local_share;
    uint prim_count;
    uint64_t mesh_lights;
    uint64_t light_meshes;
    uint64_t mesh_nodes;
    uint64_t light_leaves;
    uint64_t light_triangles;
    uint64_t light_faces;
    uint mesh_light_count;
    uint joint;
    uint64_t light_values;
    uint64_t light_face_weights;
    uint64_t light_placed_values;
    uint64_t light_corners;
    uint textured_mesh_lights;
    uint pad;
    uint64_t light_keys;
    uint64_t local_motion;
    uint64_t infinite_motion;
    uint64_t mesh_motion;
    uint64_t mesh_keys;
    uint64_t local_reaches;
    uint64_t infinite_reaches;
    float local_brightness;
    float mesh_brightness;
    float dome_irradiance;
    float distant_irradiance;
    vec3 distant_axis;
    uint pad1;
};

struct GpuLightKey {
    GpuMotionKey key;
    vec3 translation_lo;
    float radiance;
};

struct GpuMeshLight {
    vec3 position;
    uint light_mesh;
    vec3 position_lo;
    float scale;
    vec3 x;
    uint prim_id;
    vec3 y;
    uint instance_id;
    vec3 z;
    uint mesh;
    float error;
    uint values;
    uint trail[2];
};

struct GpuLightMesh {
    uint root;
    uint first_face;
    uint face_count;
    uint pad;
};

struct GpuLightLeaf {
    uint first;
    uint count;
    float total;
    uint pad;
    uint trail[2];
};

struct GpuLightTriangle {
    vec3 v0;
    float cumulative;
    vec3 v1;
    uint subset;
    vec3 v2;
    uint face;
};

struct GpuLightValue {
    vec3 a;
    float weight;
    vec3 b;
    uint corners;
    vec3 c;
    uint pad1;
};

struct GpuLocalLight {
    vec3 position;
    uint flags;
    vec3 position_lo;
    float determinant;
    vec3 x;
    uint shaping;
    vec3 y;
    uint map;
    vec3 z;
    uint light_link;
    vec3 row_x;
    uint shadow_link;
    vec3 row_y;
    float diffuse;
    vec3 row_z;
    float specular;
    vec3 radiance;
    uint shadow_color;
};

struct GpuInfiniteLight {
    vec3 direction;
    float one_minus_cos;
    vec3 radiance;
    float probability;
    float cumulative;
    float diffuse;
    float specular;
    uint flags;
    uint map;
    uint light_link;
    uint shadow_link;
    uint shadow_color;
};

struct GpuLightNode {
    vec3 min[2];
    vec3 max[2];
    vec3 axis[2];
    float cos_axis[2];
    float cos_emission[2];
    float power[2];
    uint child[2];
    float back[2];
};

struct GpuLightShaping {
    vec3 axis;
    float cone_angle;
    vec3 x;
    float smooth_start;
    vec3 y;
    float focus;
    vec3 focus_tint;
    uint ies;
    float angle_scale;
    float ies_scale;
    uint pad[2];
};

struct GpuLightMap {
    uint64_t texels;
    uint64_t cells;
    uint width;
    uint height;
    uint columns;
    uint rows;
    vec3 x;
    uint format;
    vec3 y;
    uint pad0;
    vec3 z;
    uint pad1;
};

struct GpuCdf {
    float start;
    uint guide;
    float density;
};

#endif
