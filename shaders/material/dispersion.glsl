// SPDX-License-Identifier: Apache-2.0
// Dispersion of glass (Features::DISPERSION): its index by channel, and the one channel that a path has after it.
//
// Red, green and blue are the wavelengths 600, 546 and 450 nm, the middles of the bands of bsdf/film.glsl. The index of
// each is Cauchy's n = a + b / l^2 (Born and Wolf, Principles of Optics, 2.3), from the given index n_d at 587.6 nm and
// the Abbe number V = (n_d - 1) / (n_F - n_C), F and C at 486.1 and 656.3 nm, as OpenPBR 1.1 has it:
//     n(l) = n_d + (n_d - 1) / V (1 / l^2 - 1 / l_d^2) / (1 / l_F^2 - 1 / l_C^2).
//
// A path that reaches such a surface goes on with one channel, chosen in proportion to its throughput, which is divided
// by the probability of the choice; everything the path does there is that channel's. So a direction depends on one
// index, and no channel's estimate is biased. The throughput itself shows that a path has one channel: nothing else is
// stored.
#ifndef OOCPT_DISPERSION_GLSL
#define OOCPT_DISPERSION_GLSL

// Set of random numbers: the choice of the channel.
const uint CHANNEL_SET = (1u << 30) + 1u;

float inverse_square(float length) {
    return 1.0 / (length * length);
}

// The index of a channel.
float dispersed_ior(float ior, float dispersion, uint channel) {
    if (!(ior > 1.0)) return ior;
    const vec3 lengths = vec3(0.600, 0.546, 0.450);
    const float off = inverse_square(lengths[channel]) - inverse_square(0.5876);
    const float bend = off / (inverse_square(0.4861) - inverse_square(0.6563));
    return max(ior + (ior - 1.0) * dispersion * bend, 1.0);
}

// The channel that u in [0, 1) selects in proportion to the throughput, and the factor for the throughput.
uint choose_channel(vec3 throughput, float u, out vec3 factor) {
    const vec3 part = max(throughput, 0.0);
    const float sum = part.x + part.y + part.z;
    const float at = u * sum;
    uint channel = at < part.x ? 0u : (at < part.x + part.y ? 1u : 2u);
    if (!(part[channel] > 0.0)) channel = part.x > 0.0 ? 0u : (part.y > 0.0 ? 1u : 2u); // rounding
    factor = vec3(0.0);
    // The factor is exactly 1 if there is no other channel.
    if (part[channel] > 0.0) factor[channel] = part[channel] == sum ? 1.0 : sum / part[channel];
    return channel;
}

// Makes a dispersive shading that of one channel, for a path that arrives with throughput `carried`; returns the factor
// for the throughput.
vec3 disperse(uint path, vec3 throughput, inout Shading s) {
    if (!(s.dispersion > 0.0 && s.opacity < 1.0)) return vec3(1.0);
    const uvec2 pixel = pixel_position(path_pixel(path));
    const float u = sample_4d(path_sample(path), CHANNEL_SET, pixel_seed(pixel.x, pixel.y, path_seed(path))).x;
    vec3 factor;
    const uint channel = choose_channel(throughput, u, factor);
    s.ior = dispersed_ior(s.ior, s.dispersion, channel);
    return factor;
}

#endif
