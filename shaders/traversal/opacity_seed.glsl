// SPDX-License-Identifier: Apache-2.0
// The seed that decides, with the ids of a surface, whether a ray of a path meets it.
#ifndef OOCPT_OPACITY_SEED_GLSL
#define OOCPT_OPACITY_SEED_GLSL

// `ray` numbers the rays of the path: 2 * bounce, + 1 for shadow rays.
uint opacity_seed(uint path, uint ray) {
    if (!HAS_OPACITY && !HAS_CUTOUTS) return 0u;
    const uint pixel = whole_trace_order(path_pixel(path));
    return hash_combine(hash_combine(hash_combine(path_seed(path), pixel), path_sample(path)), ray);
}

#endif
