// SPDX-License-Identifier: Apache-2.0
//! Owen-scrambled Sobol numbers in padded sets of four dimensions: Burley, "Practical Hash-based Owen Scrambling",
//! JCGT 9(4), 2020. Pure and deterministic; `shaders/math/sampler.glsl` gives the same bits. All arithmetic wraps at
//! 32 bits.

/// Direction numbers `v[d][k]` of Sobol dimensions 0 to 3: bit `k` of the index contributes `v[d][k]`.
///
/// Made from the Joe-Kuo polynomials (new-joe-kuo-6.21201): dimension 0 is the van der Corput sequence; then degree 1
/// `a = 0 m = {1}`, degree 2 `a = 1 m = {1, 3}`, degree 3 `a = 1 m = {1, 3, 1}`.
pub const SOBOL_DIRECTIONS: [[u32; 32]; 4] =
    [van_der_corput(), directions(1, 0, [1, 0, 0]), directions(2, 1, [1, 3, 0]), directions(3, 1, [1, 3, 1])];

const fn van_der_corput() -> [u32; 32] {
    let mut v = [0; 32];
    let mut k = 0;
    while k < 32 {
        v[k] = 1 << (31 - k);
        k += 1;
    }
    v
}

/// Bratley and Fox 1988, recurrence (2): the direction numbers of a primitive polynomial of degree `degree` with inner
/// coefficients `a` (most significant bit first) and starting values `m`.
const fn directions(degree: usize, a: u32, m: [u32; 3]) -> [u32; 32] {
    let mut v = [0; 32];
    let mut k = 0;
    while k < 32 {
        if k < degree {
            v[k] = m[k] << (31 - k);
        } else {
            let mut x = v[k - degree] ^ (v[k - degree] >> degree);
            let mut j = 1;
            while j < degree {
                if (a >> (degree - 1 - j)) & 1 == 1 {
                    x ^= v[k - j];
                }
                j += 1;
            }
            v[k] = x;
        }
        k += 1;
    }
    v
}

/// A bijective mixer of 32 bits (of the `lowbias32` family).
#[must_use]
pub const fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x21f0_aaad);
    x ^= x >> 15;
    x = x.wrapping_mul(0xd35a_2d97);
    x ^ (x >> 15)
}

/// Folds `value` into `seed`: `s ^ (hash(v) + 0x9e3779b9 + (s << 6) + (s >> 2))`.
#[must_use]
pub const fn combine(seed: u32, value: u32) -> u32 {
    seed ^ hash(value).wrapping_add(0x9e37_79b9).wrapping_add(seed << 6).wrapping_add(seed >> 2)
}

/// Laine-Karras style permutation with Burley's constants (2020, listing 1): each output bit depends on lower bits
/// only.
#[must_use]
pub const fn laine_karras(mut x: u32, seed: u32) -> u32 {
    x = x.wrapping_add(seed);
    x ^= x.wrapping_mul(0x6c50_b47c);
    x ^= x.wrapping_mul(0xb82f_1e52);
    x ^= x.wrapping_mul(0xc7af_e638);
    x ^ x.wrapping_mul(0x8d22_f6e6)
}

/// Nested uniform (Owen) scrambling of `x` read as a binary fraction.
#[must_use]
pub const fn owen(x: u32, seed: u32) -> u32 {
    laine_karras(x.reverse_bits(), seed).reverse_bits()
}

/// Point `index` of Sobol dimension `dimension` (0..=3, taken modulo 4), unscrambled.
#[must_use]
pub const fn sobol(mut index: u32, dimension: usize) -> u32 {
    let v = &SOBOL_DIRECTIONS[dimension & 3];
    let mut x = 0;
    let mut k = 0;
    while index != 0 {
        if index & 1 == 1 {
            x ^= v[k];
        }
        index >>= 1;
        k += 1;
    }
    x
}

/// Four numbers in `[0, 1)`, multiples of 2^-24: sample `index` of the padded set `set` of the pixel seeded `seed`.
#[must_use]
pub fn sample_4d(index: u32, set: u32, seed: u32) -> [f32; 4] {
    let set_seed = hash(combine(seed, set));
    let shuffled = owen(index, set_seed);
    [0_u16, 1, 2, 3].map(|d| {
        let x = owen(sobol(shuffled, usize::from(d)), hash(combine(set_seed, u32::from(d))));
        unit_float(x)
    })
}

/// The first number of [`sample_4d`].
#[must_use]
pub fn sample_1d(index: u32, set: u32, seed: u32) -> f32 {
    let set_seed = hash(combine(seed, set));
    // Sobol dimension 0 reverses the bits.
    unit_float(owen(owen(index, set_seed).reverse_bits(), hash(combine(set_seed, 0))))
}

/// The upper 24 bits of `x` as a number in `[0, 1)`; exact.
#[must_use]
#[expect(clippy::cast_precision_loss, reason = "24 bits are exact in f32")]
pub fn unit_float(x: u32) -> f32 {
    (x >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// The seed of a pixel: `hash(combine(combine(seed, x), y))`.
#[must_use]
pub const fn pixel_seed(x: u32, y: u32, seed: u32) -> u32 {
    hash(combine(combine(seed, x), y))
}
