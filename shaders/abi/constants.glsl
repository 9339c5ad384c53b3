// SPDX-License-Identifier: Apache-2.0
// Specialisation constants, features and other numbers that host and shaders share. A part of abi.glsl. HAS_* and the
// numbers come from rust/abi/src/features.rs and constants.rs; the build writes them.
#ifndef OOCPT_CONSTANTS_GLSL
#define OOCPT_CONSTANTS_GLSL

layout(constant_id = 0) const uint MAX_LEVELS = 1u;
layout(constant_id = 1) const uint STACK_SIZE = 64u;
layout(constant_id = 2) const uint FEATURES = 0xffffffffu;
layout(constant_id = 3) const uint FEATURES_HIGH = 0u; // bits 32 to 63
layout(constant_id = 5) const uint FEATURES_TOP = 0u; // bits 64 to 95
#ifdef OOCPT_FAULTS // only in builds for tests: which absent chunk instances rays forget
layout(constant_id = 4) const uint FAULT = 0u;
#endif

#include "generated/constants.glsl"

const bool HAS_NESTING = HAS_INSTANCING && MAX_LEVELS > 1u;

#endif
