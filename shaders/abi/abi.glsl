// SPDX-License-Identifier: Apache-2.0
// Every struct that host and shaders share. The build writes them from rust/abi/src, where the members are documented,
// and compares names, offsets and sizes in the SPIR-V with the Rust structs. Addresses are uint64_t; see memory.glsl.
#ifndef OOCPT_ABI_GLSL
#define OOCPT_ABI_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require

#include "abi/constants.glsl"
#include "generated/structs.glsl"

// A colour of 10 bits a channel (rust/abi/src/path.rs packs it).
vec3 unpack_color(uint color) {
    return vec3(uvec3(color, color >> 10, color >> 20) & 1023u) / 1023.0;
}

#endif
