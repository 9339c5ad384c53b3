// SPDX-License-Identifier: Apache-2.0
// Noise as MaterialX 1.39 defines it: gradient noise (Perlin 2002, "Improving Noise"), cell noise and cellular noise
// (Worley 1996, "A Cellular Texture Basis Function") over a lattice hashed by lookup3 (Jenkins 2006). The twin is
// rust/materialx/src/noise.rs: the same bits, except for the square roots of distances. Sums and products are in its
// order. Coordinates beyond the range of int stay in its last cell and have no fraction.
#ifndef OOCPT_PATTERN_NOISE_GLSL
#define OOCPT_PATTERN_NOISE_GLSL

// Octaves that a fractal sum has at most.
const uint PATTERN_OCTAVES = 32u;

// Four hashes at once: the corners of a square of the lattice.
struct LatticeWords {
    uvec4 a;
    uvec4 b;
    uvec4 c;
};

uvec4 rotated_left(uvec4 word, int by) {
    return word << by | word >> (32 - by);
}

uvec4 lattice_stir(uvec4 word, uvec4 with, int by) {
    return (word ^ with) - rotated_left(with, by);
}

// lookup3's final mixing; the last word.
uvec4 lattice_finish(LatticeWords w) {
    w.c = lattice_stir(w.c, w.b, 14);
    w.a = lattice_stir(w.a, w.c, 11);
    w.b = lattice_stir(w.b, w.a, 25);
    w.c = lattice_stir(w.c, w.b, 16);
    w.a = lattice_stir(w.a, w.c, 4);
    w.b = lattice_stir(w.b, w.a, 14);
    return lattice_stir(w.c, w.b, 24);
}

// A step of lookup3's mixing between blocks of three words.
void lattice_mix(inout uvec4 to, inout uvec4 from, uvec4 with, int by) {
    to = (to - from) ^ rotated_left(from, by);
    from += with;
}

// State of lookup3 before `count` words, with the seed 13.
uvec4 lattice_seed(uint count) {
    return uvec4(0xdeadbeefu + 13u + 4u * count);
}

uvec4 lattice_hash(uvec4 x, uvec4 y) {
    const uvec4 seed = lattice_seed(2u);
    return lattice_finish(LatticeWords(seed + x, seed + y, seed));
}

uvec4 lattice_hash(uvec4 x, uvec4 y, uvec4 z) {
    const uvec4 seed = lattice_seed(3u);
    return lattice_finish(LatticeWords(seed + x, seed + y, seed + z));
}

uvec4 lattice_hash(uvec4 x, uvec4 y, uvec4 z, uvec4 w) {
    const uvec4 seed = lattice_seed(4u);
    LatticeWords s = LatticeWords(seed + x, seed + y, seed + z);
    lattice_mix(s.a, s.c, s.b, 4);
    lattice_mix(s.b, s.a, s.c, 6);
    lattice_mix(s.c, s.b, s.a, 8);
    lattice_mix(s.a, s.c, s.b, 16);
    lattice_mix(s.b, s.a, s.c, 19);
    lattice_mix(s.c, s.b, s.a, 4);
    s.a += w;
    return lattice_finish(s);
}

// The cell that a coordinate is in, as a word.
uvec3 lattice_cell(vec3 p) {
    return uvec3(ivec3(clamp(floor(p), vec3(-2147483648.0), vec3(2147483520.0))));
}

// The position in the cell, 0..1.
vec3 lattice_part(vec3 p) {
    return mix(vec3(0.0), p - floor(p), lessThanEqual(abs(p), vec3(2147483520.0)));
}

// The random numbers of a cell, 0 to 1: xyz, the numbers of the components being one more word; w: without that word.
vec4 cell_noise(vec3 p, bool solid) {
    const uvec3 cell = lattice_cell(p);
    const uvec4 x = uvec4(cell.x);
    const uvec4 y = uvec4(cell.y);
    const uvec4 component = uvec4(0u, 1u, 2u, 0u);
    uvec4 bits;
    if (solid) {
        const uvec4 z = uvec4(cell.z);
        bits = uvec4(lattice_hash(x, y, z, component).xyz, lattice_hash(x, y, z).x);
    } else {
        bits = uvec4(lattice_hash(x, y, component).xyz, lattice_hash(x, y).x);
    }
    return vec4(bits) / 4294967296.0;
}

// `value` with its sign changed where the first bit is set.
vec4 negated(vec4 value, uvec4 bits) {
    return uintBitsToFloat(floatBitsToUint(value) ^ bits << 31);
}

// Products of vectors and the gradients that hashes choose: 8 in the plane.
vec4 gradients(uvec4 hash, vec4 x, vec4 y) {
    const bvec4 first = lessThan(hash & 7u, uvec4(4u));
    return negated(mix(y, x, first), hash) + negated(2.0 * mix(x, y, first), hash >> 1);
}

// The 12 edges of a cube, 4 of them twice.
vec4 gradients(uvec4 hash, vec4 x, vec4 y, vec4 z) {
    const uvec4 edge = hash & 15u;
    const vec4 u = mix(y, x, lessThan(edge, uvec4(8u)));
    const vec4 far = mix(z, x, equal(edge & 13u, uvec4(12u)));
    return negated(u, hash) + negated(mix(far, y, lessThan(edge, uvec4(4u))), hash >> 1);
}

float between(float a, float b, float t) {
    return a * (1.0 - t) + b * t;
}

// Interpolates the corners of a square, x first.
float between(vec4 v, vec2 t) {
    return between(between(v.x, v.y, t.x), between(v.z, v.w, t.x), t.y);
}

// Gradient noise: three channels in space or in the plane, or the first of them in x.
vec3 perlin_noise(vec3 p, bool solid, bool all_channels) {
    const uvec3 cell = lattice_cell(p);
    const vec3 at = lattice_part(p);
    const vec3 t = at * at * at * (at * (at * 6.0 - 15.0) + 10.0);
    const uvec4 x = cell.x + uvec4(0u, 1u, 0u, 1u);
    const uvec4 y = cell.y + uvec4(0u, 0u, 1u, 1u);
    const vec4 to_x = at.x - vec4(0.0, 1.0, 0.0, 1.0);
    const vec4 to_y = at.y - vec4(0.0, 0.0, 1.0, 1.0);
    const uint channels = all_channels ? 3u : 1u;
    vec3 result = vec3(0.0);
    if (solid) {
        uvec4 low = lattice_hash(x, y, uvec4(cell.z));
        uvec4 high = lattice_hash(x, y, uvec4(cell.z + 1u));
        for (uint channel = 0u; channel < channels; ++channel, low >>= 8, high >>= 8) {
            const float below = between(gradients(low, to_x, to_y, vec4(at.z)), t.xy);
            const float above = between(gradients(high, to_x, to_y, vec4(at.z - 1.0)), t.xy);
            result[channel] = between(below, above, t.z) * 0.982;
        }
    } else {
        uvec4 hash = lattice_hash(x, y);
        for (uint channel = 0u; channel < channels; ++channel, hash >>= 8) {
            result[channel] = between(gradients(hash, to_x, to_y), t.xy) * 0.6616;
        }
    }
    return result;
}

// Sum of octaves of gradient noise.
vec3 perlin_sum(vec3 p, bool solid, bool all_channels, uint octaves, float lacunarity, float diminish) {
    vec3 sum = vec3(0.0);
    float amplitude = 1.0;
    for (uint i = 0u; i < min(octaves, PATTERN_OCTAVES); ++i) {
        sum += amplitude * perlin_noise(p, solid, all_channels);
        amplitude *= diminish;
        p *= lacunarity;
    }
    return sum;
}

// The nearest of the points that lie one in a cell, in the cell of `p` and those around it: distances to the three
// nearest ones, 1000 where there is none. `jitter` takes them from the centres of their cells. In the plane z is 0.
vec3 worley_noise(vec3 p, bool solid, float jitter, out vec3 nearest) {
    const uvec3 cell = lattice_cell(p);
    const vec3 at = lattice_part(p);
    vec3 squares = vec3(1e6);
    nearest = vec3(0.0);
    // z changes first: of points at equal distance the first one is taken.
    const int depth = solid ? 3 : 1;
    for (int neighbour = 0; neighbour < 9 * depth; ++neighbour) {
        const ivec3 digits = ivec3(neighbour / (3 * depth), neighbour / depth % 3, neighbour % depth);
        const ivec3 step = digits - ivec3(1, 1, depth / 2);
        const vec3 random = cell_noise(vec3(ivec3(cell + uvec3(step))), solid).xyz;
        vec3 to = vec3(step) + ((random - 0.5) * jitter + 0.5) - at;
        if (!solid) to.z = 0.0;
        const float square = to.x * to.x + to.y * to.y + to.z * to.z;
        if (square < squares.x) {
            squares = vec3(square, squares.xy);
            nearest = to;
        } else if (square < squares.y) {
            squares.yz = vec2(square, squares.y);
        } else if (square < squares.z) {
            squares.z = square;
        }
    }
    nearest += p;
    return sqrt(squares);
}

#endif
