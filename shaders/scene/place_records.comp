// SPDX-License-Identifier: Apache-2.0
// Live views only. Places the records of held chunks from the arrays of their instancers: all of a chunk that is new
// here, of others those for which some element has changed. Workgroups along y take one chunk each, from chunk
// push.count on; threads along x take its records.
// Reads: push.source, members and places of each chunk, arrays of instancers and what changed in them. Writes: maps and
// boxes of records.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene/place_instance.glsl"

layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PushBlock { PlacingPush push; };

layout(buffer_reference, scalar, buffer_reference_align = 16) buffer PlacedRecords { GpuInstance v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) writeonly buffer RecordBoxes { float v[]; };

#define NOWHERE vec3(uintBitsToFloat(0x7f800000u))

void place_record(GpuHeldChunk chunk, uint record) {
    const uvec2 place = ConstUVec2s(chunk.places).v[record];
    PlacedInstance placed;
    if (!place_instance(ChunkMembers(chunk.members).v[place.x], place.y, placed)) {
        const vec4 far = vec4(0.0, 0.0, 0.0, 1e30);
        placed.rows = vec4[3](far, far, far);
        placed.flips = false;
        placed.lower = NOWHERE;
        placed.upper = -NOWHERE;
    }
    PlacedRecords records = PlacedRecords(chunk.records);
    for (uint k = 0u; k < 3u; ++k) {
        for (uint at = 0u; at < 4u; ++at) records.v[record].object_from_parent[k][at] = placed.rows[k][at];
    }
    const uint count = records.v[record].prototype_count & ~FLIPS_HANDEDNESS;
    records.v[record].prototype_count = placed.flips ? count | FLIPS_HANDEDNESS : count;
    RecordBoxes boxes = RecordBoxes(chunk.record_boxes);
    for (uint axis = 0u; axis < 3u; ++axis) {
        boxes.v[6u * record + axis] = placed.lower[axis];
        boxes.v[6u * record + 3u + axis] = placed.upper[axis];
    }
}

void main() {
    const GpuHeldChunk chunk = HeldChunks(push.source).v[push.count + gl_WorkGroupID.y];
    const uint threads = gl_NumWorkGroups.x * WORKGROUP_SIZE;
    for (uint record = gl_GlobalInvocationID.x; record < chunk.record_count; record += threads) {
        if (chunk.is_known == 0u || is_changed(chunk, record)) place_record(chunk, record);
    }
}
