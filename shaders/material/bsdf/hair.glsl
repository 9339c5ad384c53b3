// SPDX-License-Identifier: Apache-2.0
// Hair: scattering by a fibre (Chiang et al. 2016, "A Practical and Controllable Hair and Fur Model for Production Path
// Tracing"; d'Eon et al. 2011, "An Energy-Conserving Hair Reflectance Model"; parameters as MaterialX's
// chiang_hair_bsdf has them).
//
//   f |cosine| = sum over p of A_p M_p N_p    p = 0: reflection R, 1: TT, 2: TRT, 3: all that is reflected more often
//
// Angles: theta from the plane across the fibre, phi about it, phi = 0 at wo. h in [-1, 1] is where wo meets the circle
// across the fibre: gamma_o = asin(h), and the surface's normal is at phi = -gamma_o.
//   M_p  d'Eon et al. eq. 7, normalised over cos(theta) d theta. Written with exp(-a) I_0(a) and the half chord between
//        the directions, so nothing overflows or cancels at any variance v.
//   N_p  a logistic about phi_p = 2 p gamma_t - 2 gamma_o + p pi, cut off at +-pi (Chiang et al. eq. 6 and appendix A);
//        of p = 3: 1 / (2 pi).
//   A_p  Chiang et al. eq. 13: Fresnel f at cos(theta_o) cos(gamma_o), T = exp(-absorption 2 cos(gamma_t) /
//        cos(theta_t)) on a way through a fibre of radius 1. A_3 is the rest of the series, so for T = 1 the sum is 1.
//   tilt of the cuticle's scales: theta_o + 2 alpha, - alpha, - 4 alpha for p = 0, 1, 2 (section 4.1; the sign is
//        MaterialX's). wo is tilted, not wi: so the integral over wi stays exactly sum A_p.
// Reciprocal only as far as the model is: M_p and N_p are for alpha = 0 and one h; A_p depends on theta_o.
//
// The fibre's frame is that of wo: x along the fibre, y across it in the plane of x and wo. All lobes have densities.
#ifndef OOCPT_BSDF_HAIR_GLSL
#define OOCPT_BSDF_HAIR_GLSL

struct Hair {
    vec3 x, y, z;
    float sin_o, cos_o; // of theta_o
    vec4 sin_p, cos_p; // the same, tilted, by lobe
    vec4 phi; // phi_p
    vec4 variance; // v, by lobe
    vec4 spread; // s sqrt(pi / 8), by lobe
    vec3 a0, a1, a2, a3; // A_p times tints
    vec4 chance; // of the lobes
};

// exp(-x) I_0(x) for x >= 0 (Abramowitz and Stegun 9.8.1 and 9.8.2; relative error below 3e-7).
float scaled_bessel(float x) {
    if (x < 3.75) {
        const float t = (x / 3.75) * (x / 3.75);
        return exp(-x) * (1.0 + t * (3.5156229 + t
            * (3.0899424 + t * (1.2067492 + t * (0.2659732 + t * (0.0360768 + t * 0.0045813))))));
    }
    const float t = 3.75 / x;
    const float sum = 0.39894228 + t * (0.01328592
                                        + t * (0.00225319 + t * (-0.00157565 + t * (0.00916281 + t * (-0.02057706
        + t * (0.02635537 + t * (-0.01647633 + t * 0.00392377)))))));
    return sum * inversesqrt(x);
}

// atan(y, x) to 1e-7 (Abramowitz and Stegun 4.4.49). The functions of devices may be off by 4096 units in the last
// place, which narrow lobes show.
float exact_angle(float y, float x) {
    const float low = min(abs(x), abs(y));
    const float high = max(abs(x), abs(y));
    const float q = high > 0.0 ? low / high : 0.0;
    const float z = q * q;
    float angle = q * (1.0 + z * (-0.3333314528 + z
                                  * (0.1999355085 + z * (-0.1420889944 + z * (0.1065626393 + z * (-0.0752896400
        + z * (0.0429096138 + z * (-0.0161657367 + z * 0.0028662257))))))));
    if (abs(y) > abs(x)) angle = 0.5 * GGX_PI - angle;
    if (x < 0.0) angle = GGX_PI - angle;
    return y < 0.0 ? -angle : angle;
}

// M_p of directions with these sines and cosines.
float longitudinal(vec2 o, vec2 i, float v) {
    const vec2 chord = vec2(o.x + i.x, o.y - i.y);
    const float a = o.y * i.y / v;
    return exp(-0.5 * dot(chord, chord) / v) * scaled_bessel(a) / (v * (1.0 - exp(-2.0 / v)));
}

// The angle modulo 2 pi, in -pi..pi.
float wrapped(float angle) {
    return angle - 2.0 * GGX_PI * floor(angle / (2.0 * GGX_PI) + 0.5);
}

// The trimmed logistic at `x` in -pi..pi.
float azimuthal(float x, float s) {
    const float e = exp(-abs(x) / s);
    const float whole = tanh(min(0.5 * GGX_PI / s, 20.0));
    return e / (s * (1.0 + e) * (1.0 + e) * whole);
}

// A sample of the trimmed logistic.
float sample_azimuthal(float u, float s) {
    const float whole = tanh(min(0.5 * GGX_PI / s, 20.0));
    // The distribution function from the middle: (tanh(x / 2 s)) / 2.
    const float t = clamp((2.0 * u - 1.0) * whole, -0.99999994, 0.99999994);
    return clamp(s * log((1.0 + t) / (1.0 - t)), -GGX_PI, GGX_PI);
}

float lobe_longitudinal(Hair hair, uint p, vec2 i) {
    return longitudinal(vec2(hair.sin_p[p], hair.cos_p[p]), i, hair.variance[p]);
}

float lobe_azimuthal(Hair hair, uint p, float phi) {
    return p == 3u ? 0.5 / GGX_PI : azimuthal(wrapped(phi - hair.phi[p]), hair.spread[p]);
}

// `across_it`: the direction in which HairShading::offset grows. `normal`: on the viewer's side, that of a tube.
Hair make_hair(HairShading s, vec3 tangent, vec3 across_it, vec3 normal, float ior, vec3 wo) {
    Hair hair;
    vec3 x = tangent;
    if (!(dot(x, x) > 0.5)) {
        vec3 unused;
        tangents(normal, x, unused);
    }
    hair.x = x;
    hair.sin_o = clamp(dot(x, wo), -1.0, 1.0);
    const vec3 across = wo - x * dot(x, wo);
    const float size2 = dot(across, across);
    vec3 unused;
    hair.cos_o = sqrt(size2);
    if (size2 > 1.0e-14) hair.y = across * inversesqrt(size2);
    else tangents(x, hair.y, unused);
    hair.z = cross(x, hair.y);

    // The normal across the fibre; for a hit on the end of a tube only its middle is known.
    const vec3 side = normal - x * dot(x, normal);
    const float side2 = dot(side, side);
    float h = 0.0;
    float cos_gamma_o = 1.0; // not from h: near the edge nothing would be left of it
    if (abs(s.offset) <= 1.0) {
        h = dot(across_it, hair.z) > 0.0 ? -s.offset : s.offset;
        cos_gamma_o = sqrt((1.0 - h) * (1.0 + h));
    } else if (side2 > 1.0e-12) {
        h = clamp(-dot(side, hair.z) * inversesqrt(side2), -1.0, 1.0);
        cos_gamma_o = clamp(dot(side, hair.y) * inversesqrt(side2), 0.0, 1.0);
    }
    const float gamma_o = exact_angle(h, cos_gamma_o);
    // The index seen across the fibre (Marschner et al. 2003, appendix B).
    const float eta = max(ior, 1.0);
    const float sin_t = hair.sin_o / eta;
    const float cos_t = sqrt(max(1.0 - sin_t * sin_t, 1.0e-12));
    const float bent = sqrt(max(eta * eta - hair.sin_o * hair.sin_o, 0.0)) / max(hair.cos_o, 1.0e-7);
    const float sin_gamma_t = clamp(h / max(bent, 1.0e-7), -1.0, 1.0);
    const float cos_gamma_t = sqrt((1.0 - sin_gamma_t) * (1.0 + sin_gamma_t));
    const float gamma_t = exact_angle(sin_gamma_t, cos_gamma_t);

    const float cosine = hair.cos_o * cos_gamma_o;
    const float f = dielectric_reflectance(cosine, refracted_cosine(cosine, 1.0 / eta), eta);
    const vec3 through = exp(-s.absorption * (2.0 * cos_gamma_t / cos_t));
    const vec3 tt = (1.0 - f) * (1.0 - f) * through;
    hair.a0 = s.tint_r * f;
    hair.a1 = s.tint_tt * tt;
    hair.a2 = s.tint_trt * (tt * through * f);
    // At f = 1 nothing enters.
    hair.a3 = s.tint_trt * (tt * through * through * (f * f) / max(1.0 - through * f, vec3(1.0e-7)));
    const vec4 weight = vec4(hair.a0.x + hair.a0.y + hair.a0.z, hair.a1.x + hair.a1.y + hair.a1.z,
                             hair.a2.x + hair.a2.y + hair.a2.z, hair.a3.x + hair.a3.y + hair.a3.z);
    const float sum = weight.x + weight.y + weight.z + weight.w;
    hair.chance = sum > 0.0 ? weight / sum : vec4(0.0);

    const vec4 tilt = vec4(2.0, -1.0, -4.0, 0.0) * s.tilt;
    const vec4 sine = sin(tilt);
    const vec4 cosines = cos(tilt);
    hair.sin_p = hair.sin_o * cosines + hair.cos_o * sine;
    hair.cos_p = abs(hair.cos_o * cosines - hair.sin_o * sine);
    hair.phi = vec4(0.0, 1.0, 2.0, 0.0) * (2.0 * gamma_t + GGX_PI) - 2.0 * gamma_o;
    hair.variance = s.variance.xyzz;
    hair.spread = s.spread.xyzz * 0.62665707; // sqrt(pi / 8): Chiang et al., appendix A
    return hair;
}

// f |cosine| and density of wi.
vec4 hair_evaluate(Hair hair, vec3 wi) {
    const vec2 across = vec2(dot(wi, hair.y), dot(wi, hair.z));
    const float phi = exact_angle(across.y, across.x);
    const vec2 i = vec2(clamp(dot(wi, hair.x), -1.0, 1.0), length(across));
    vec4 lobes;
    [[unroll]] for (uint p = 0u; p < 4u; ++p) {
        lobes[p] = lobe_longitudinal(hair, p, i) * lobe_azimuthal(hair, p, phi);
    }
    return vec4(hair.a0 * lobes.x + hair.a1 * lobes.y + hair.a2 * lobes.z + hair.a3 * lobes.w, dot(hair.chance, lobes));
}

// A direction: u.xy, and u.z by its lobe and then along the fibre's cone. False: the fibre is black.
bool hair_sample(Hair hair, vec3 u, out vec3 wi) {
    wi = hair.y;
    float at = u.z;
    uint p = 0u;
    while (p < 3u && at >= hair.chance[p]) at -= hair.chance[p++];
    while (p > 0u && hair.chance[p] <= 0.0) --p; // rounding
    if (hair.chance[p] <= 0.0) return false;
    const float rest = clamp(at / hair.chance[p], 0.0, 1.0);
    // d'Eon et al. 2013, "Importance Sampling for Physically-Based Hair Fiber Models", eq. 7: the cosine with the
    // cone's axis is 1 - below.
    const float v = hair.variance[p];
    const float least = exp(-2.0 / v);
    const float below = clamp(-v * log(max(u.y + (1.0 - u.y) * least, 1.0e-30)), 0.0, 2.0);
    const float sine = sqrt(below * (2.0 - below));
    const float sin_i = clamp(sine * cos(2.0 * GGX_PI * rest) * hair.cos_p[p] - (1.0 - below) * hair.sin_p[p], -1.0,
                              1.0);
    const float cos_i = sqrt(max(0.0, 1.0 - sin_i * sin_i));
    const float phi = p == 3u ? 2.0 * GGX_PI * u.x : hair.phi[p] + sample_azimuthal(u.x, hair.spread[p]);
    wi = normalize(sin_i * hair.x + cos_i * (cos(phi) * hair.y + sin(phi) * hair.z));
    return true;
}

#endif
