// SPDX-License-Identifier: Apache-2.0
//! Hashes and the first coordinate of a sample (`include/sampler.glsl`). Pure, any thread.

/// `hash_u32`.
pub(crate) fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x21f0_aaad);
    x ^= x >> 15;
    x = x.wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

/// `hash_combine`.
pub(crate) fn combine(seed: u32, v: u32) -> u32 {
    seed ^ hash(v).wrapping_add(0x9e37_79b9).wrapping_add(seed << 6).wrapping_add(seed >> 2)
}

/// The bits as a number in [0, 1).
#[expect(clippy::cast_precision_loss, reason = "24 bits")]
pub(crate) fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 * 5.960_464_5e-8
}

/// `pixel_seed`.
pub(crate) fn pixel_seed([x, y]: [u32; 2], seed: u32) -> u32 {
    hash(combine(combine(seed, x), y))
}

/// `owen_scramble`.
fn owen_scramble(x: u32, seed: u32) -> u32 {
    let mut x = x.reverse_bits().wrapping_add(seed);
    for factor in [0x6c50_b47c, 0xb82f_1e52, 0xc7af_e638, 0x8d22_f6e6_u32] {
        x ^= x.wrapping_mul(factor);
    }
    x.reverse_bits()
}

/// `sample_4d(index, set, seed).x`.
pub(crate) fn first_coordinate(index: u32, set: u32, seed: u32) -> f32 {
    let set_seed = hash(combine(seed, set));
    let x = owen_scramble(index, set_seed).reverse_bits();
    unit(owen_scramble(x, hash(combine(set_seed, 0))))
}
