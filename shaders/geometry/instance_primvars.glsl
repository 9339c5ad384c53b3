// SPDX-License-Identifier: Apache-2.0
// Implements instance_primvar (surface_material.glsl): the value that a primvar has for an instance. Before including,
// define INSTANCE_CHUNK as the chunk instance and INSTANCE_CHAIN as the array of instance records from the chunk's down
// to the mesh's.
//
// Each level holds the values of its own records, beside them, so they are loaded and evicted with their chunk. The
// innermost level that has a value wins; the caller looks first for the mesh's own primvar, which wins over all of
// them.
#ifndef OOCPT_INSTANCE_PRIMVARS_GLSL
#define OOCPT_INSTANCE_PRIMVARS_GLSL

// Takes the value of `row` in a table, if it has one.
void take_value(uint64_t table, uint row, uint name, inout vec4 value, inout bool found) {
    if (table == 0ul) return;
    for (uint i = 0u; Attributes(table).v[i].name != NO_NAME; ++i) {
        if (Attributes(table).v[i].name != name) continue;
        const uint width = Attributes(table).v[i].rate_and_width >> 8;
        const uint64_t values = table + Attributes(table).v[i].values;
        if (ConstUints(values).v[row * width] == NO_VALUE) continue;
        value = primvar_at(values, row, width);
        found = true;
    }
}

bool instance_primvar(uint name, out vec4 value) {
    value = vec4(0.0);
    bool found = false;
    if (!HAS_INSTANCE_PRIMVARS || name == NO_NAME) return false;
    const uint outer = ChunkInstances(FRAME.chunk_instances).v[INSTANCE_CHUNK].row;
    if (outer != NO_ROW) take_value(FRAME.placed_values, outer, name, value, found);
    const uint chunk = ChunkInstances(FRAME.chunk_instances).v[INSTANCE_CHUNK].chunk;
    uint64_t table = Chunks(FRAME.chunks).v[chunk].primvars;
    uint64_t instances = Chunks(FRAME.chunks).v[chunk].instances;
    for (uint level = 0u; level < MAX_LEVELS; ++level) {
        const uint record = INSTANCE_CHAIN[level];
        take_value(table, record, name, value, found);
        const uint target = Instances(instances).v[record].target;
        if (!HAS_NESTING || (target & TARGET_ASSEMBLY) == 0u) break;
        table = Assemblies(FRAME.assemblies).v[target & TARGET_NUMBER].primvars;
        instances = Assemblies(FRAME.assemblies).v[target & TARGET_NUMBER].instances;
    }
    return found;
}

#endif
