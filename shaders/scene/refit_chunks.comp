// SPDX-License-Identifier: Apache-2.0
// Live views only. Places the records of held chunks from the arrays of their instancers, and refits the trees over
// them: nodes keep their children, and get bounds from the leaves up, as rust/core/src/mesh/level_shape.rs gives them
// (Wald, Boulos, Shirley 2007). A workgroup for each chunk, from chunk push.count on. It lists the nodes level by level
// on the way down, and bounds them level by level on the way up: a node is written by one thread, after its children.
// Of a chunk that it has placed before, it places the records below nodes in which some element has changed.
// Reads: push.source, members and places of each chunk, arrays of instancers and what changed in them, children of
// nodes. Writes: maps of records, bounds of nodes, push.target. Reads and writes: boxes, order, levels.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "scene/place_instance.glsl"

layout(local_size_x = REFIT_THREADS) in;
layout(push_constant, scalar) uniform PushBlock { PlacingPush push; };

layout(buffer_reference, scalar, buffer_reference_align = 8) readonly buffer HeldChunks { GpuHeldChunk v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 8) buffer RefittedChunks { GpuRefittedChunk v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer PlacedRecords { GpuInstance v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 16) buffer TreeNodes { LevelNode v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer NodeBoxes { float v[]; };
layout(buffer_reference, scalar, buffer_reference_align = 4) coherent buffer NodeOrder { uint v[]; };

// As in rust/core/src/mesh/bvh4.rs.
const double LAST_PLANE = 255.0LF;
const double MARGIN = 1.0LF / 8192.0LF;
#define NOWHERE vec3(uintBitsToFloat(0x7f800000u))

shared uint level_starts[REFIT_LEVELS + 1u];
shared uint listed;
shared uint unusable;
shared uint changed_nodes[REFIT_CHANGED_WORDS];
shared double areas[REFIT_THREADS];

bool is_inner(uint child, uint node_count) {
    return (child & LEAF) == 0u && child < node_count;
}

// Lists the nodes of a chunk from the root down; the number of levels.
uint list_levels(GpuHeldChunk chunk) {
    TreeNodes nodes = TreeNodes(chunk.nodes);
    NodeOrder order = NodeOrder(chunk.order);
    const uint thread = gl_LocalInvocationIndex;
    if (thread == 0u) {
        order.v[0] = 0u;
        level_starts[0] = 0u;
        listed = 1u;
        unusable = 0u;
    }
    memoryBarrierBuffer();
    barrier();
    uint begin = 0u, end = 1u, levels = 0u;
    while (begin < end && levels < REFIT_LEVELS) {
        for (uint i = begin + thread; i < end; i += REFIT_THREADS) {
            const uint node = order.v[i];
            for (uint k = 0u; k < 4u; ++k) {
                const uint child = nodes.v[node].child[k];
                if (!is_inner(child, chunk.node_count)) continue;
                const uint at = atomicAdd(listed, 1u);
                if (at < chunk.node_count) order.v[at] = child;
            }
        }
        memoryBarrierBuffer();
        barrier();
        begin = end;
        end = min(listed, chunk.node_count);
        ++levels;
        if (thread == 0u) level_starts[levels] = begin;
        barrier();
    }
    return levels;
}

// The levels of the last pass; their number.
uint known_levels(GpuHeldChunk chunk) {
    ConstUints levels = ConstUints(chunk.levels);
    const uint count = min(levels.v[0], REFIT_LEVELS);
    const uint thread = gl_LocalInvocationIndex;
    for (uint level = thread; level <= count; level += REFIT_THREADS) level_starts[level] = levels.v[1u + level];
    for (uint word = thread; word < REFIT_CHANGED_WORDS; word += REFIT_THREADS) changed_nodes[word] = 0u;
    if (thread == 0u) unusable = 0u;
    barrier();
    return count;
}

void keep_levels(GpuHeldChunk chunk, uint count) {
    Uints levels = Uints(chunk.levels);
    const uint thread = gl_LocalInvocationIndex;
    for (uint level = thread; level <= count; level += REFIT_THREADS) levels.v[1u + level] = level_starts[level];
    if (thread == 0u) levels.v[0] = count;
}

bool is_changed(GpuHeldChunk chunk, uint record) {
    if (record >= chunk.record_count) return false;
    const uvec2 place = ConstUVec2s(chunk.places).v[record];
    ChunkMembers members = ChunkMembers(chunk.members);
    for (uint k = 0u; k < 4u; ++k) {
        const uint64_t changed = members.v[place.x].changed[k];
        if (changed == 0ul || place.y >= members.v[place.x].count) continue;
        if (changed == uint64_t(ALL_CHANGED)) return true;
        if ((ConstUints(changed).v[place.y / 32u] >> (place.y % 32u) & 1u) != 0u) return true;
    }
    return false;
}

// Whether something has changed below a node whose children were looked at; notes it for the level above.
bool has_changed(GpuHeldChunk chunk, uint node) {
    TreeNodes nodes = TreeNodes(chunk.nodes);
    bool changed = false;
    for (uint k = 0u; k < 4u && !changed; ++k) {
        const uint child = nodes.v[node].child[k];
        if (child == ABSENT) continue;
        if ((child & LEAF) != 0u) {
            changed = is_changed(chunk, child & ~LEAF);
        } else if (child < chunk.node_count) {
            changed = (changed_nodes[child / 32u] >> (child % 32u) & 1u) != 0u;
        }
    }
    if (changed) atomicOr(changed_nodes[node / 32u], 1u << (node % 32u));
    return changed;
}

// The biased exponent of the smallest power of two that is a normal float and of which 253 cells are not below `edge`,
// without a division, which drivers may round twice.
uint cell_exponent(double edge) {
    const uvec2 bits = unpackDouble2x32(edge);
    const uint fraction = bits.y & 0xfffffu;
    const bool is_above = fraction > 0xfa000u || (fraction == 0xfa000u && bits.x != 0u);
    const uint exponent = (bits.y >> 20) + (is_above ? 1u : 0u);
    return clamp(exponent - min(exponent, 1023u - 127u + 7u), 1u, 253u);
}

uint floor_of(double cells) {
    return uint(clamp(cells, 0.0LF, LAST_PLANE));
}

uint ceil_of(double cells) {
    const uint byte = floor_of(cells);
    return byte + (byte < 255u && cells > double(byte) ? 1u : 0u);
}

// Writes the grid of a node over `all` and the planes of its children. Boxes that are empty have planes in the wrong
// order.
void write_bounds(TreeNodes nodes, uint node, vec3 lower[4], vec3 upper[4], vec3 all_lower, vec3 all_upper) {
    uvec3 origins = uvec3(0u), low_planes = uvec3(0xffffffffu), high_planes = uvec3(0u);
    uint cell = 0u;
    const bool is_empty = any(greaterThan(all_lower, all_upper));
    for (uint axis = 0u; axis < 3u && !is_empty; ++axis) {
        const float least = all_lower[axis], most = all_upper[axis];
        const float spare = max(most * (1.0 / 256.0) - least * (1.0 / 256.0), abs(least) * (1.0 / 4194304.0));
        const float from = least - max(spare, 1e-30);
        origins[axis] = floatBitsToUint(from);
        const uint exponent = cell_exponent(double(most) - double(from));
        const double per_cell = 1.0LF / double(uintBitsToFloat(exponent << 23));
        cell |= exponent << (8u * axis);
        uint low = 0u, high = 0u;
        for (uint k = 0u; k < 4u; ++k) {
            low |= floor_of((double(lower[k][axis]) - double(from)) * per_cell - MARGIN) << (8u * k);
            high |= ceil_of((double(upper[k][axis]) - double(from)) * per_cell + MARGIN) << (8u * k);
        }
        low_planes[axis] = low;
        high_planes[axis] = high;
    }
    for (uint axis = 0u; axis < 3u; ++axis) {
        nodes.v[node].origin[axis] = origins[axis];
        nodes.v[node].lower[axis] = low_planes[axis];
        nodes.v[node].upper[axis] = high_planes[axis];
    }
    nodes.v[node].cell = cell;
}

// Places a record; its box, which is empty if it is not usable.
void place_record(GpuHeldChunk chunk, uint record, out vec3 lower, out vec3 upper) {
    lower = NOWHERE;
    upper = -NOWHERE;
    if (record >= chunk.record_count) return;
    const uvec2 place = ConstUVec2s(chunk.places).v[record];
    PlacedRecords records = PlacedRecords(chunk.records);
    PlacedInstance placed;
    const bool is_usable = place_instance(ChunkMembers(chunk.members).v[place.x], place.y, placed);
    if (is_usable) {
        lower = placed.lower;
        upper = placed.upper;
    } else {
        const vec4 far = vec4(0.0, 0.0, 0.0, 1e30);
        placed.rows = vec4[3](far, far, far);
        placed.flips = false;
        atomicAdd(unusable, 1u);
    }
    for (uint k = 0u; k < 3u; ++k) {
        for (uint at = 0u; at < 4u; ++at) records.v[record].object_from_parent[k][at] = placed.rows[k][at];
    }
    const uint count = records.v[record].prototype_count & ~FLIPS_HANDEDNESS;
    records.v[record].prototype_count = placed.flips ? count | FLIPS_HANDEDNESS : count;
}

double half_surface(vec3 lower, vec3 upper) {
    if (any(greaterThan(lower, upper))) return 0.0LF;
    const dvec3 edges = dvec3(upper) - dvec3(lower);
    return (edges.x * edges.y + edges.y * edges.z) + edges.z * edges.x;
}

// Bounds a node whose children are bounded; half its surface.
double bound_node(GpuHeldChunk chunk, uint node) {
    TreeNodes nodes = TreeNodes(chunk.nodes);
    NodeBoxes boxes = NodeBoxes(chunk.boxes);
    vec3 lower[4], upper[4];
    vec3 all_lower = NOWHERE, all_upper = -NOWHERE;
    for (uint k = 0u; k < 4u; ++k) {
        lower[k] = NOWHERE;
        upper[k] = -NOWHERE;
        const uint child = nodes.v[node].child[k];
        if (child == ABSENT) continue;
        if ((child & LEAF) != 0u) {
            place_record(chunk, child & ~LEAF, lower[k], upper[k]);
        } else if (child < chunk.node_count) {
            const uint at = 6u * child;
            lower[k] = vec3(boxes.v[at], boxes.v[at + 1u], boxes.v[at + 2u]);
            upper[k] = vec3(boxes.v[at + 3u], boxes.v[at + 4u], boxes.v[at + 5u]);
        }
        all_lower = min(all_lower, lower[k]);
        all_upper = max(all_upper, upper[k]);
    }
    write_bounds(nodes, node, lower, upper, all_lower, all_upper);
    for (uint axis = 0u; axis < 3u; ++axis) {
        boxes.v[6u * node + axis] = all_lower[axis];
        boxes.v[6u * node + 3u + axis] = all_upper[axis];
    }
    return half_surface(all_lower, all_upper);
}

// Half the surface of a node whose box is known.
double known_surface(GpuHeldChunk chunk, uint node) {
    NodeBoxes boxes = NodeBoxes(chunk.boxes);
    const uint at = 6u * node;
    return half_surface(vec3(boxes.v[at], boxes.v[at + 1u], boxes.v[at + 2u]),
                        vec3(boxes.v[at + 3u], boxes.v[at + 4u], boxes.v[at + 5u]));
}

void main() {
    const uint number = push.count + gl_WorkGroupID.x;
    const GpuHeldChunk chunk = HeldChunks(push.source).v[number];
    const uint thread = gl_LocalInvocationIndex;
    const bool is_known = chunk.is_known != 0u && chunk.node_count <= 32u * REFIT_CHANGED_WORDS;
    uint levels;
    if (is_known) {
        levels = known_levels(chunk);
    } else {
        levels = list_levels(chunk);
        keep_levels(chunk, levels);
    }
    NodeOrder order = NodeOrder(chunk.order);
    double area = 0.0LF;
    for (uint level = levels; level > 0u; --level) {
        const uint end = level_starts[level];
        for (uint i = level_starts[level - 1u] + thread; i < end; i += REFIT_THREADS) {
            const uint node = order.v[i];
            area += !is_known || has_changed(chunk, node) ? bound_node(chunk, node) : known_surface(chunk, node);
        }
        memoryBarrierBuffer();
        barrier();
    }
    areas[thread] = area;
    barrier();
    if (thread != 0u) return;
    for (uint other = 1u; other < REFIT_THREADS; ++other) area += areas[other];
    NodeBoxes boxes = NodeBoxes(chunk.boxes);
    RefittedChunks(push.target).v[number] = GpuRefittedChunk(packUint2x32(unpackDouble2x32(area)),
        vec3(boxes.v[0], boxes.v[1], boxes.v[2]), vec3(boxes.v[3], boxes.v[4], boxes.v[5]), unusable, 0u);
}
