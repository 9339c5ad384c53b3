// SPDX-License-Identifier: Apache-2.0
// Scene data: trees, triangles, meshes, instances, materials, textures, chunks, distant lights. A part of abi.glsl.
#ifndef OOCPT_ABI_SCENE_GLSL
#define OOCPT_ABI_SCENE_GLSL

struct Bvh4Node {
    uvec3 origin;
    uint cell_and_counts;
    uvec3 lower;
    uvec3 upper;
    uint first_child;
    uint first_triangle;
};

struct LevelNode {
    uvec3 origin;
    uint cell;
    uvec3 lower;
    uvec3 upper;
    uint child[4];
    uint pad[2];
};

struct GpuTriangle {
    vec3 v0;
    uint face;
    vec3 v1;
    uint subset_and_sides;
    vec3 v2;
    uint ptex;
};

struct GpuPoint {
    vec3 center;
    uint face;
};

struct GpuInstance {
    vec4 object_from_parent[3];
    uint target;
    int prim_id;
    uint index_in_prototype;
    uint prototype_count;
};

struct GpuMotionKey {
    vec3 translation;
    float time;
    vec4 rotation;
    vec3 stretch;
    float half_angle;
    vec3 shear;
    uint pad;
};

struct GpuCameraMotion {
    vec3 o;
    uint key_count;
    vec3 o_x;
    float lens_radius;
    vec3 o_y;
    uint pad0;
    vec3 d;
    uint pad1;
    vec3 d_x;
    uint pad2;
    vec3 d_y;
    uint pad3;
};

struct GpuCameraKey {
    GpuMotionKey key;
    vec3 translation_lo;
    uint pad;
};

struct GpuMesh {
    uint64_t nodes;
    uint64_t triangles;
    float reach;
    uint flags;
    uint64_t corner_indices;
    uint64_t normals;
    uint64_t colors;
    uint64_t opacities;
    uint64_t primvars;
    uint primvar_count;
    uint triangle_count;
};

struct GpuInput {
    vec4 value;
    vec4 bias;
    vec3 row_s;
    uint kind;
    vec3 row_t;
    uint texture;
};

struct GpuCutout {
    vec3 row_s;
    uint set;
    vec3 row_t;
    uint size;
    uint64_t mask;
    uint modes;
    uint is_chance;
};

struct GpuMaterial {
    GpuInput inputs[19];
    uint flags;
    float opacity_threshold;
    uint names[4];
    vec2 set_fallback[2];
    uint program;
    uint program_sizes;
    vec4 primvar_fallback[2];
    GpuCutout cutout;
};

struct GpuPrim {
    uint first_slot;
    uint slot_count;
    uint link_set;
    uint pad;
};

struct GpuAttribute {
    uint64_t values;
    uint name;
    uint rate_and_width;
};

struct GpuSurfaceMaterial {
    vec2 uv[2];
    vec4 primvars[2];
    vec3 tangent;
    uint material;
    uvec2 footprints[2];
    float handedness;
    uint flags;
};

struct GpuAssembly {
    uint64_t nodes;
    uint64_t instances;
    uint64_t primvars;
};

struct GpuChunk {
    uint64_t nodes;
    uint64_t instances;
    uint64_t primvars;
};

struct GpuChunkInstance {
    vec4 chunk_from_world[3];
    vec3 origin_lo;
    uint chunk;
    uint instance_id;
    uint row;
    uint pad[2];
};

struct GpuTexture {
    uint64_t decode;
    uint64_t directory;
    uint first_page;
    uint flags;
    uint width;
    uint height;
    uint levels;
    uint pad;
    vec4 fallback;
};

#endif
