// SPDX-License-Identifier: Apache-2.0
// What prims do without (PrimMask): rays that pass through them, mattes. Only with PRIM_MASKS.
#ifndef OOCPT_PRIM_MASKS_GLSL
#define OOCPT_PRIM_MASKS_GLSL

// The mask of a prim; 0 for one that the table does not have.
uint prim_mask(int prim_id) {
    const uint index = uint(prim_id + 1);
    if (!HAS_PRIM_MASKS || index >= FRAME.mask_count) return 0u;
    return (ConstUints(FRAME.prim_masks).v[index / 4u] >> (8u * (index % 4u))) & 0xffu;
}

// The bit of the prims that the ray at an address passes, of a ray that is no shadow ray.
uint passing_bit(uint64_t ray) {
    const uint bit = HAS_PRIM_MASKS ? ray_word(ray) >> RAY_KIND_SHIFT : 0u;
    return bit == 0u ? PRIM_NO_CAMERA : bit;
}

// Returns true if shadow rays alone find lights for diffuse lobes, as other rays may not see what shadow rays see.
bool shadow_rays_alone() {
    return HAS_PRIM_MASKS && (FRAME.flags & FLAG_PARTED_SHADOWS) != 0u;
}

#endif
