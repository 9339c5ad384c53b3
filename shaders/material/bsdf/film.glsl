// SPDX-License-Identifier: Apache-2.0
// A film thinner than light is long on the base: what its two interfaces reflect interferes. Only with HAS_THIN_FILM.
//
// With amplitudes r1 and r2 of the interfaces, x = r1 r2, and p the phase of a way through the film and back (Airy;
// Born and Wolf, Principles of Optics, 7.6),
//   R = 1 - (1 - r1^2)(1 - r2^2) / (1 + x^2 + 2 x cos p)
//     = 1 - (1 - r1^2)(1 - r2^2) / (1 - x^2) (1 + 2 sum over m >= 1 of (-x)^m cos(m p)).
// Each channel is a band of wavenumbers over which cos(m p) has its mean in closed form, as Belcour and Barla (2017,
// "A Practical Extension to Microfacet Theory for the Modeling of Varying Iridescence") integrate spectra: thick
// films have no colour. Theirs are Gaussian; these are Lorentzian, of half-width w: the mean is exp(-2 pi m way w)
// cos(m p), and the sum is Airy's again with y = x exp(-2 pi way w) in the place of x. r1 is exact, by polarisation;
// r2 is Schlick's of the base's index against the film's, without a phase of its own: metals are about right only.
#ifndef OOCPT_BSDF_FILM_GLSL
#define OOCPT_BSDF_FILM_GLSL

#include "material/bsdf/ggx.glsl"

// Middle and half-width of the channels, in wavenumbers (1 / nm): 600, 546 and 450 nm, half-widths of 20, 20 and 15 nm.
const vec3 FILM_WAVENUMBER = vec3(1.0 / 600.0, 1.0 / 546.0, 1.0 / 450.0);
const vec3 FILM_WIDTH = vec3(20.0 / (600.0 * 600.0), 20.0 / (546.0 * 546.0), 15.0 / (450.0 * 450.0));

// Reflectance of a base that reflects f0 head on without the film (weight, thickness in nm, index), at a cosine with
// the normal outside.
vec3 film_reflectance(vec3 film, vec3 f0, float cosine) {
    const float inner = refracted_cosine(cosine, 1.0 / film.z);
    const vec3 root = sqrt(clamp(f0, 0.0, 0.98));
    const vec3 base = (1.0 + root) / (1.0 - root);
    const vec3 head_on = (film.z - base) / (film.z + base);
    const vec3 r2_squared = head_on * head_on + (1.0 - head_on * head_on) * power5(1.0 - inner);
    const vec3 r2 = sign(head_on) * sqrt(r2_squared);
    const float path = 2.0 * film.z * film.y * inner; // nm
    const vec3 wave = cos(2.0 * GGX_PI * fract(path * FILM_WAVENUMBER));
    const vec3 wash = exp(-2.0 * GGX_PI * path * FILM_WIDTH);
    vec3 reflected = vec3(0.0);
    [[dont_unroll]] for (uint k = 0u; k < 2u; ++k) {
        const float r1 = k == 0u ? (cosine - film.z * inner) / max(cosine + film.z * inner, 1.0e-30)
                                 : (film.z * cosine - inner) / max(film.z * cosine + inner, 1.0e-30);
        // Parallel to the plane of incidence r2 has the other sign, as r1 has here.
        const vec3 x = r1 * (k == 0u ? r2 : -r2);
        const vec3 y = x * wash;
        const vec3 mean = (1.0 - y * y) / max(1.0 + y * y + 2.0 * y * wave, 1.0e-6);
        reflected += 0.5 * (1.0 - (1.0 - r1 * r1) * (1.0 - r2_squared) / max(1.0 - x * x, 1.0e-6) * mean);
    }
    return clamp(reflected, 0.0, 1.0);
}

#endif
