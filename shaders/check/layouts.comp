// SPDX-License-Identifier: Apache-2.0
// Not a pass: puts structs into memory that the passes read as vec4s, so that the build can check their layout.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "abi/memory.glsl"

layout(local_size_x = 64) in;

layout(push_constant, scalar) uniform Addresses { uint64_t address; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Triangles { GpuTriangle v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Balls { GpuPoint v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer MeshNodes { Bvh4Node v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer LevelNodes { LevelNode v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer MaterialTable { GpuMaterial v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer PrimTable { GpuPrim v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer AttributeTable { GpuAttribute v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Rays { Ray v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer Paths { PathState v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer ShadowRays { ShadowRay v[]; };

void main() {
    Triangles(address).v[0].face = 0u;
    Balls(address).v[0].face = 0u;
    MeshNodes(address).v[0].first_child = 0u;
    LevelNodes(address).v[0].cell = 0u;
    MaterialTable(address).v[0].flags = 0u;
    PrimTable(address).v[0].pad = 0u;
    AttributeTable(address).v[0].name = 0u;
    Rays(address).v[0].flags = 0u;
    Paths(address).v[0].pdf = 0.0;
    ShadowRays(address).v[0].flags = 0u;
}
