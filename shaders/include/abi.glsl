// SPDX-License-Identifier: Apache-2.0
// Every struct that host and shaders share. The twin of rust/abi/src/*.rs, where the members are documented;
// the build compares names, offsets and sizes in the SPIR-V with the Rust structs. Addresses are uint64_t; see
// memory.glsl.
#ifndef OOCPT_ABI_GLSL
#define OOCPT_ABI_GLSL

#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
#extension GL_EXT_control_flow_attributes : require

#include "include/abi/constants.glsl"
#include "include/abi/frame.glsl"
#include "include/abi/scene.glsl"
#include "include/abi/light.glsl"
#include "include/abi/path.glsl"

#endif
