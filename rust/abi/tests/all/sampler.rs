// SPDX-License-Identifier: Apache-2.0
//! The sampler's definition and its stratification.

use oocpt_abi::sampler::{SOBOL_DIRECTIONS, hash, laine_karras, owen, pixel_seed, sample_1d, sample_4d, sobol};

/// First numerators (over 8) of dimensions 0 to 3, by hand from the Joe-Kuo direction numbers 1/2, 1/4, 1/8; 1/2, 3/4,
/// 5/8; 1/2, 3/4, 3/8; 1/2, 3/4, 1/8.
#[test]
fn first_sobol_points_match_the_published_ones() {
    let expected: [[u32; 8]; 4] =
        [[0, 4, 2, 6, 1, 5, 3, 7], [0, 4, 6, 2, 5, 1, 3, 7], [0, 4, 6, 2, 3, 7, 5, 1], [0, 4, 6, 2, 1, 5, 7, 3]];
    for (dimension, points) in expected.iter().enumerate() {
        for (index, point) in (0..).zip(points) {
            assert_eq!(sobol(index, dimension) >> 29, *point, "dimension {dimension} point {index}");
        }
    }
}

#[test]
fn direction_matrices_are_upper_triangular_with_unit_diagonal() {
    for v in SOBOL_DIRECTIONS {
        for (k, v) in v.into_iter().enumerate() {
            assert_eq!(v.trailing_zeros(), 31 - u32::try_from(k).unwrap());
        }
    }
}

#[test]
fn hash_mixers_permute_residues() {
    // Laine-Karras maps residues modulo 2^k to residues modulo 2^k; owen does the same to the high bits.
    for seed in [0, 1, 0xdead_beef] {
        let mut low = std::collections::BTreeSet::new();
        let mut high = std::collections::BTreeSet::new();
        for x in 0..256_u32 {
            assert_eq!(laine_karras(x, seed) & 255, laine_karras(x | 0xabcd_ef00, seed) & 255);
            low.insert(laine_karras(x, seed) & 255);
            high.insert(owen(x << 24, seed) >> 24);
        }
        assert_eq!((low.len(), high.len()), (256, 256));
    }
    assert_eq!(hash(0), 0);
}

/// Every elementary interval of volume 2^-m holds exactly one of the first 2^m points.
#[test]
fn pair_of_dimensions_0_and_1_is_a_0_m_2_net() {
    for (set, seed) in [(0, 0), (3, 0), (0, 77), (9, 0xffff_ffff)] {
        for m in 0..=10_u32 {
            for split in 0..=m {
                let mut seen = vec![false; 1 << m];
                for index in 0..1_u32 << m {
                    let [x, y, ..] = sample_4d(index, set, seed);
                    let cell = (stratum(x, split) << (m - split)) | stratum(y, m - split);
                    assert!(!std::mem::replace(&mut seen[cell], true), "m {m} split {split} set {set} seed {seed}");
                }
            }
        }
    }
}

/// Number of the interval of size 2^-bits that holds `x`.
fn stratum(x: f32, bits: u32) -> usize {
    let scaled = f64::from(x) * f64::from(1_u32 << bits);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "in 0..2^bits")]
    let cell = scaled as usize;
    cell
}

#[test]
fn each_dimension_is_stratified_in_every_aligned_block() {
    for m in [4_u32, 8] {
        for block in [0_u32, 1, 5] {
            let mut seen = vec![[false; 4]; 1 << m];
            for index in 0..1_u32 << m {
                let point = sample_4d((block << m) + index, 2, 1234);
                for d in 0..4 {
                    assert!((0.0..1.0).contains(&point[d]));
                    assert!(!std::mem::replace(&mut seen[stratum(point[d], m)][d], true), "m {m} dimension {d}");
                }
            }
        }
    }
}

/// Sobol in four dimensions has t = 3 at most here: cells of a 2x2x2x2 grid hold 2^m / 16 of 2^m points for m >= 7.
#[test]
fn four_dimensions_are_evenly_filled() {
    let mut counts = [0_u32; 16];
    for index in 0..1024 {
        let point = sample_4d(index, 1, 42);
        counts[point.iter().enumerate().map(|(d, &x)| stratum(x, 1) << d).sum::<usize>()] += 1;
    }
    assert_eq!(counts, [64; 16]);
}

#[test]
fn sets_and_seeds_are_decorrelated() {
    let mean = |f: &dyn Fn(u32) -> f64| (0..4096).map(f).sum::<f64>() / 4096.0;
    let centred = |p: [f32; 4], d: usize| f64::from(p[d]) - 0.5;
    for d in 0..4 {
        let sets = mean(&|i| centred(sample_4d(i, 0, 5), d) * centred(sample_4d(i, 1, 5), d));
        let pixels = mean(&|i| {
            centred(sample_4d(i, 0, pixel_seed(3, 4, 0)), d) * centred(sample_4d(i, 0, pixel_seed(4, 4, 0)), d)
        });
        // The standard deviation of a product of independent uniforms over 4096 samples is 1 / 12 / 64 = 0.0013.
        assert!(sets.abs() < 0.006 && pixels.abs() < 0.006, "{d}: {sets} {pixels}");
    }
}

#[test]
fn sample_bits_are_pinned_for_the_glsl_twin() {
    let bits = |p: [f32; 4]| p.map(f32::to_bits);
    assert_eq!(bits(sample_4d(0, 0, 0)), PINNED[0]);
    assert_eq!(bits(sample_4d(12345, 6, 0x89ab_cdef)), PINNED[1]);
    assert_eq!(pixel_seed(17, 23, 5), PINNED_SEED);
}

#[test]
fn one_number_is_the_first_of_four() {
    for (index, set, seed) in (0..64).flat_map(|index| [(index, 0, 0), (index * 977, 6, 0x89ab_cdef)]) {
        assert_eq!(
            sample_1d(index, set, seed).to_bits(),
            sample_4d(index, set, seed)[0].to_bits(),
            "{index} {set} {seed}"
        );
    }
}

/// Recorded from an independent Python transcription of the definition.
const PINNED: [[u32; 4]; 2] =
    [[0x3ebc_404e, 0x3f41_ca9d, 0x3f77_3b77, 0x3f12_803f], [0x3e23_9f28, 0x3f19_a7f2, 0x3eda_df34, 0x3f59_6dad]];
const PINNED_SEED: u32 = 0x8c26_b051;
