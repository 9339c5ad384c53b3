// SPDX-License-Identifier: Apache-2.0
// The head of every wavefront pass: push constants, thread index, path numbering, rays in memory.
#ifndef OOCPT_WAVEFRONT_GLSL
#define OOCPT_WAVEFRONT_GLSL

#include "abi/memory.glsl"

layout(local_size_x = 64) in;
layout(push_constant, scalar) uniform PushBlock { PushConstants push; };

#define FRAME FrameBlock(push.frame).f
#define COUNTERS CountersBlock(FRAME.counters).c
#define STREAMING StreamingBlock(FRAME.streaming).s
#define ADAPTIVE AdaptiveBlock(FRAME.adaptive).a
#define TEXTURE_FEEDBACK TextureFeedbackBlock(FRAME.texture_feedback).t

uint thread_index() {
    return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * WORKGROUP_SIZE + gl_LocalInvocationIndex;
}

// Pixel, in trace order, and sample number of path `i` of those that begin at `first_pixel` of `first_sample`.
uint pixel_from(uint first_pixel, uint i) {
    return (first_pixel + i) % (FRAME.width * FRAME.height);
}

uint sample_from(uint first_sample, uint first_pixel, uint i) {
    return first_sample + (first_pixel + i) / (FRAME.width * FRAME.height);
}

// Streaming: the place in the segments for the radiance of the path in a slot. There are more places than slots: an
// ended path does not keep its slot from the next one.
uint path_place(uint path) {
    return ConstUints(STREAMING.places).v[path];
}

// In generate_*: the number of the segment that begins.
uint push_segment() {
    return push.flags >> PUSH_SEGMENT_SHIFT;
}

// In generate_*: the place of path `i` of the segment that begins.
uint segment_place(uint i) {
    return push_segment() * STREAMING.segment_size + i;
}

// Adaptive: pixel, with the stream in the highest bit, and sample number of path `i` of those that begin at entry
// `first_pixel` of the band and row `first_sample`.
uint band_of(uint first_sample) {
    return first_sample >> BAND_SHIFT;
}

uint row_of(uint first_sample) {
    return first_sample & ((1u << BAND_SHIFT) - 1u);
}

uint band_width(uint first_sample) {
    return ADAPTIVE.width[band_of(first_sample)];
}

uvec2 entry_from(uint first_pixel, uint first_sample, uint i) {
    const uint width = band_width(first_sample);
    const uvec2 entry = ConstUVec2s(ADAPTIVE.entries).v[(first_pixel + i) % width];
    return entry + uvec2(0u, row_of(first_sample) + (first_pixel + i) / width);
}

uvec2 path_entry(uint path) {
    if (!HAS_STREAMING) return entry_from(push.first_pixel, push.first_sample, path);
    const uint place = path_place(path);
    const uint segment = place / STREAMING.segment_size;
    return entry_from(Segments(STREAMING.segments).v[segment].first_pixel,
                      Segments(STREAMING.segments).v[segment].first_sample, place - segment * STREAMING.segment_size);
}

// Returns true if paths are numbered by entries; those through pixel centres are not.
bool has_entries() {
    return HAS_ADAPTIVE && (push.flags & PUSH_AOVS) == 0u;
}

// The seed of the samples of an entry: each stream has its own.
uint entry_seed(uint entry) {
    return (entry & STREAM_BIT) != 0u ? FRAME.seed ^ STREAM_SEED : FRAME.seed;
}

// The seed of the samples of a path.
uint path_seed(uint path) {
    return has_entries() ? entry_seed(path_entry(path).x) : FRAME.seed;
}

// Pixel of a path.
uint path_pixel(uint path) {
    if (has_entries()) return path_entry(path).x & ~STREAM_BIT;
    if (!HAS_STREAMING) return pixel_from(push.first_pixel, path);
    const uint place = path_place(path);
    const uint segment = place / STREAMING.segment_size;
    return pixel_from(Segments(STREAMING.segments).v[segment].first_pixel, place - segment * STREAMING.segment_size);
}

// Sample number of a path.
uint path_sample(uint path) {
    if (has_entries()) return path_entry(path).y;
    if (!HAS_STREAMING) return sample_from(push.first_sample, push.first_pixel, path);
    const uint place = path_place(path);
    const uint segment = place / STREAMING.segment_size;
    const uint i = place - segment * STREAMING.segment_size;
    return sample_from(Segments(STREAMING.segments).v[segment].first_sample,
                       Segments(STREAMING.segments).v[segment].first_pixel, i);
}

// Trace order in the window to the position in the picture: strips of 8 rows, cut into tiles of 8 columns, row by row
// inside. A bijection for any size.
uvec2 pixel_position(uint index) {
    const uint width = FRAME.width;
    const uint strip = index / (8u * width);
    const uint rows = min(8u, FRAME.height - 8u * strip);
    const uint in_strip = index - strip * 8u * width;
    const uint tile = in_strip / (8u * rows);
    const uint columns = min(8u, width - 8u * tile);
    const uint in_tile = in_strip - tile * 8u * rows;
    return uvec2(FRAME.window_x + 8u * tile + in_tile % columns, FRAME.window_y + 8u * strip + in_tile / columns);
}

// The pixel of film and planes, which are those of the window, at a position in the picture.
uint film_pixel(uvec2 position) {
    return (position.y - FRAME.window_y) * FRAME.width + (position.x - FRAME.window_x);
}

// The place of a pixel of the window in the trace order of the whole picture: what is seeded with it does not depend on
// the window. The inverse of pixel_position for a window that is the whole.
uint whole_trace_order(uint index) {
    const uvec2 whole = uvec2(FRAME.picture_width, FRAME.picture_height);
    if (whole == uvec2(FRAME.width, FRAME.height)) return index;
    const uvec2 position = pixel_position(index);
    const uvec2 tile = position / 8u;
    const uvec2 in_tile = position - 8u * tile;
    const uint rows = min(8u, whole.y - 8u * tile.y);
    const uint columns = min(8u, whole.x - 8u * tile.x);
    return 8u * tile.y * whole.x + 8u * tile.x * rows + in_tile.y * columns + in_tile.x;
}

// Address of a ray; both kinds start with the members of Ray.
uint64_t ray_address(uint path) {
    return FRAME.rays + uint64_t(path) * uint64_t(RAY_BYTES);
}

uint64_t shadow_ray_address(uint path) {
    return FRAME.shadow_rays + uint64_t(path) * uint64_t(SHADOW_RAY_BYTES);
}

// Members of a ray at an address, of either kind.
uint ray_word(uint64_t ray) {
    return ConstUints(ray).v[RAY_WORD_BOUNCE];
}

// The bounce in Ray::bounce: with HAS_PRIM_MASKS the bit of the prims that the ray passes is above it.
uint unpack_ray_bounce(uint word) {
    return HAS_PRIM_MASKS ? word & ((1u << RAY_KIND_SHIFT) - 1u) : word;
}

uint pack_ray_bounce(uint bounce, uint bit) {
    return HAS_PRIM_MASKS ? bounce | bit << RAY_KIND_SHIFT : bounce;
}

// Of a ray that is no shadow ray.
uint ray_bounce(uint64_t ray) {
    return unpack_ray_bounce(ray_word(ray));
}

float ray_t_max(uint64_t ray) {
    return ConstFloats(ray).v[RAY_WORD_T_MAX];
}

uint ray_flags(uint64_t ray) {
    return ConstUints(ray).v[RAY_WORD_FLAGS];
}

void set_ray_flags(uint64_t ray, uint flags) {
    Uints(ray).v[RAY_WORD_FLAGS] = flags;
}

// The part of ray flags that describes the pending list: 0 for a ray that waits for nothing.
uint pack_waiting(uint count, bool more) {
    return count == 0u ? 0u : RAY_WAITED | (more ? RAY_MORE : 0u) | count << RAY_COUNT_SHIFT;
}

uint waiting_count(uint flags) {
    return (flags >> RAY_COUNT_SHIFT) & 7u;
}

// ShadowRay::bounce: with HAS_LIGHT_LINKS the category of the prims that are in the ray's way is above it; 0: all.
uint pack_shadow_bounce(uint bounce, uint link) {
    return HAS_LIGHT_LINKS ? bounce | link << SHADOW_LINK_SHIFT : bounce;
}

uint shadow_bounce(uint word) {
    return HAS_LIGHT_LINKS ? word & ((1u << SHADOW_LINK_SHIFT) - 1u) : word;
}

uint shadow_link(uint word) {
    return HAS_LIGHT_LINKS ? word >> SHADOW_LINK_SHIFT : 0u;
}

// ShadowRay::contribution and ShadowRay::in_shadow.
vec3 shadow_contribution(uint64_t ray) {
    return ConstVec4s(ray).v[3].xyz;
}

uint shadow_in_shadow(uint64_t ray) {
    return ConstUints(ray).v[RAY_WORD_IN_SHADOW];
}

void store_shadow_light(uint64_t ray, vec3 contribution, uint in_shadow) {
    Vec4s(ray).v[3] = vec4(contribution, uintBitsToFloat(in_shadow));
}

Ray load_ray(uint64_t address) {
    const vec4 a = ConstVec4s(address).v[0];
    const vec4 b = ConstVec4s(address).v[1];
    const vec4 c = ConstVec4s(address).v[2];
    return Ray(a.xyz, unpack_ray_bounce(floatBitsToUint(a.w)), b.xyz, b.w, c.xyz, floatBitsToUint(c.w));
}

void store_ray(uint64_t address, Ray ray) {
    Vec4s(address).v[0] = vec4(ray.o, uintBitsToFloat(ray.bounce));
    Vec4s(address).v[1] = vec4(ray.d, ray.t_max);
    Vec4s(address).v[2] = vec4(ray.o_lo, uintBitsToFloat(ray.flags));
}

PathState load_path(uint path) {
    const vec4 a = ConstVec4s(FRAME.paths).v[path];
    return PathState(a.xyz, a.w);
}

void store_path(uint path, PathState state) {
    Vec4s(FRAME.paths).v[path] = vec4(state.throughput, state.pdf);
}

bool is_finite(vec3 v) {
    const uvec3 bits = floatBitsToUint(v) & 0x7f800000u;
    return bits.x != 0x7f800000u && bits.y != 0x7f800000u && bits.z != 0x7f800000u;
}

float max_component(vec3 v) {
    return max(v.x, max(v.y, v.z));
}

// Counts values that are not finite, and notes the least pixel, whatever the order in which they come.
void note_nonfinite(uvec2 pixel) {
    atomicAdd(COUNTERS.nonfinite, 1u);
    atomicMax(COUNTERS.nonfinite_pixel, ~(pixel.y * FRAME.picture_width + pixel.x));
}

// The value that may be added to the radiance of a path: zero, and counted with its pixel, if not finite; bounded if it
// is indirect and a bound is set.
vec3 clamp_contribution(uint path, vec3 contribution, bool indirect) {
    if (!is_finite(contribution)) {
        note_nonfinite(pixel_position(path_pixel(path)));
        return vec3(0.0);
    }
    const float bound = FRAME.clamp;
    const float largest = max_component(contribution);
    return indirect && bound > 0.0 && largest > bound ? contribution * (bound / largest) : contribution;
}

#endif
