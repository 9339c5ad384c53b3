// SPDX-License-Identifier: Apache-2.0
//! AVX2: where a ray enters and where it leaves four boxes are eight lanes; the corners of a triangle are four, of
//! which the last two are the same.

use super::{EdgeFunctions, NodeGrid, SLAB_PAD, Simd};
use crate::node::{BoxRay, EnteredChildren};
use crate::vector::{V3, tiny_component};
use bytemuck::cast;
use oocpt_abi::ABSENT;
use std::arch::x86_64::{__m128, __m128i, __m256, _CMP_GT_OQ, _CMP_LE_OQ, _CMP_LT_OQ};

/// A processor that has AVX2, and what else x86-64-v3 has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Avx2Simd(pulp::x86::V3);

impl Avx2Simd {
    /// None where the processor does not have all of it.
    pub(crate) fn try_new() -> Option<Self> {
        pulp::x86::V3::try_new().map(Self)
    }

    #[inline(always)]
    fn halves(self, low: __m128, high: __m128) -> __m256 {
        let avx = self.0.avx;
        avx._mm256_insertf128_ps::<1>(avx._mm256_castps128_ps256(low), high)
    }
}

/// The first three of four lanes.
const THREE: [u32; 4] = [u32::MAX, u32::MAX, u32::MAX, 0];
/// The sign of four lanes.
const SIGN: [u32; 4] = [1 << 31; 4];
/// Each byte in its place.
const IN_PLACE: [u8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

impl Simd for Avx2Simd {
    #[inline(always)]
    fn vectorize<O: pulp::NullaryFnOnce>(self, op: O) -> O::Output {
        self.0.vectorize(op)
    }

    #[inline(always)]
    fn there(self, children: &[u32; 4]) -> u32 {
        let pulp::x86::V3 { sse, sse2, .. } = self.0;
        let absent = sse2._mm_cmpeq_epi32(cast(*children), cast([ABSENT; 4]));
        !sse._mm_movemask_ps(cast(absent)).cast_unsigned()
    }

    #[inline(always)]
    fn meet(self, grid: &NodeGrid, ray: &BoxRay, limit: f32, entry: f32) -> EnteredChildren {
        let pulp::x86::V3 { sse, sse2, sse4_1, ssse3, avx, avx2, .. } = self.0;
        let [head, lower, rest]: [__m128i; 3] = cast(*grid);
        let [o, reciprocal, around]: [__m128; 3] = [cast(ray.o), cast(ray.reciprocal), cast(ray.around)];
        // What is behind the three numbers of the origin must not be computed with: it might be slow.
        let origin = sse._mm_and_ps(cast(head), cast(THREE));
        let from = sse._mm_mul_ps(sse._mm_sub_ps(origin, o), reciprocal);
        let exponents = sse4_1._mm_cvtepu8_epi32(sse2._mm_srli_si128::<12>(head));
        let cells: __m128 = cast(sse2._mm_slli_epi32::<23>(exponents));
        let scale = sse._mm_mul_ps(cells, reciprocal);
        let scales = self.halves(scale, sse._mm_xor_ps(scale, cast(SIGN)));
        let far = sse._mm_xor_ps(sse._mm_add_ps(from, around), cast(SIGN));
        let froms = self.halves(sse._mm_sub_ps(from, around), far);

        // Pairs of planes, near and far.
        let upper = ssse3._mm_alignr_epi8::<12>(rest, lower);
        let xy = ssse3._mm_shuffle_epi8(sse2._mm_unpacklo_epi32(lower, upper), cast(ray.turns[0]));
        let z = ssse3._mm_shuffle_epi8(sse2._mm_unpackhi_epi32(lower, upper), cast(ray.turns[1]));
        let planes = |pair: __m128i| avx._mm256_cvtepi32_ps(avx2._mm256_cvtepu8_epi32(pair));
        let along =
            |planes: __m256, scale: __m256, from: __m256| avx._mm256_add_ps(avx._mm256_mul_ps(planes, scale), from);
        let along_z = along(planes(z), avx._mm256_permute_ps::<0xaa>(scales), avx._mm256_permute_ps::<0xaa>(froms));
        let y = sse2._mm_srli_si128::<8>(xy);
        let along_y = along(planes(y), avx._mm256_permute_ps::<0x55>(scales), avx._mm256_permute_ps::<0x55>(froms));
        let along_x = along(planes(xy), avx._mm256_permute_ps::<0>(scales), avx._mm256_permute_ps::<0>(froms));
        // The largest of where the ray enters and, with its sign turned, of where it leaves; of two, the second one
        // where either is NaN.
        let nothing = self.halves(sse._mm_setzero_ps(), sse._mm_set1_ps(f32::NEG_INFINITY));
        let reached = avx._mm256_max_ps(along_z, nothing);
        let reached = avx._mm256_max_ps(along_x, avx._mm256_max_ps(along_y, reached));
        let entries = avx._mm256_castps256_ps128(reached);
        let leaves = sse._mm_mul_ps(avx._mm256_extractf128_ps::<1>(reached), sse._mm_set1_ps(-SLAB_PAD));
        let leaves = sse._mm_min_ps(leaves, sse._mm_set1_ps(limit));
        let met = sse._mm_movemask_ps(avx._mm_cmp_ps::<_CMP_LE_OQ>(entries, leaves));
        let entries = sse._mm_max_ps(entries, sse._mm_set1_ps(entry));
        EnteredChildren { entries: cast(entries), mask: met.cast_unsigned() }
    }

    #[inline(always)]
    fn box_ray(self, o: V3, d: V3, pad: f32) -> BoxRay {
        let pulp::x86::V3 { sse, sse2, sse4_1, avx, .. } = self.0;
        // safe_reciprocal, in three lanes.
        let tiny = sse._mm_set1_ps(tiny_component(d));
        let along: __m128 = cast([d[0], d[1], d[2], 0.0]);
        let sign: __m128 = cast(SIGN);
        let is_tiny = avx._mm_cmp_ps::<_CMP_LT_OQ>(sse._mm_andnot_ps(sign, along), tiny);
        let signed_tiny = sse._mm_or_ps(tiny, sse._mm_and_ps(sign, along));
        let divisor = sse4_1._mm_blendv_ps(along, signed_tiny, is_tiny);
        let reciprocal = sse._mm_and_ps(sse._mm_div_ps(sse._mm_set1_ps(1.0), divisor), cast(THREE));
        let around = sse._mm_mul_ps(sse._mm_set1_ps(pad), sse._mm_andnot_ps(sign, reciprocal));
        // 4 where a byte has to come from the other number of its pair.
        let backward: __m128i = cast(avx._mm_cmp_ps::<_CMP_LT_OQ>(reciprocal, sse._mm_setzero_ps()));
        let other = sse2._mm_and_si128(backward, cast([4_u8; 16]));
        let xy = sse2._mm_xor_si128(sse2._mm_shuffle_epi32::<0b01_01_00_00>(other), cast(IN_PLACE));
        let z = sse2._mm_xor_si128(sse2._mm_shuffle_epi32::<0b10_10_10_10>(other), cast(IN_PLACE));
        BoxRay {
            o: [o[0], o[1], o[2], 0.0],
            reciprocal: cast(reciprocal),
            around: cast(around),
            turns: [cast(xy), cast(z)],
        }
    }

    #[inline(always)]
    fn edges(self, corners: &[[f32; 4]; 3], o: V3, plane: [V3; 2]) -> EdgeFunctions {
        let pulp::x86::V3 { sse, avx, .. } = self.0;
        let [a, b, c] = *corners;
        let [a, b, c]: [__m128; 3] = [cast(a), cast(b), cast(c)];
        // Lanes of the corners a, b, c, c.
        let (ab_xy, ab_z) = (sse._mm_unpacklo_ps(a, b), sse._mm_unpackhi_ps(a, b));
        let axis = |lanes: __m128, o: f32| sse._mm_sub_ps(lanes, sse._mm_set1_ps(o));
        let x = axis(sse._mm_shuffle_ps::<0b00_00_01_00>(ab_xy, c), o[0]);
        let y = axis(sse._mm_shuffle_ps::<0b01_01_11_10>(ab_xy, c), o[1]);
        let z = axis(sse._mm_shuffle_ps::<0b10_10_01_00>(ab_z, c), o[2]);
        // No `map` of arrays here: it stays a call, around which all lanes are kept in memory.
        let times = |number: f32, lanes: __m128| sse._mm_mul_ps(sse._mm_set1_ps(number), lanes);
        let apply = |V3([rx, ry, rz]): V3| {
            let yz = sse._mm_add_ps(times(ry, y), times(rz, z));
            sse._mm_add_ps(times(rx, x), yz)
        };
        let [u, v] = plane;
        let (u, v) = (apply(u), apply(v));
        // Of the corners q, r, p and r, p, q.
        let (u1, v1) = (avx._mm_permute_ps::<0b11_00_10_01>(u), avx._mm_permute_ps::<0b11_00_10_01>(v));
        let (u2, v2) = (avx._mm_permute_ps::<0b11_01_00_10>(u), avx._mm_permute_ps::<0b11_01_00_10>(v));
        let w = sse._mm_sub_ps(sse._mm_mul_ps(u1, v2), sse._mm_mul_ps(v1, u2));
        let zero = sse._mm_setzero_ps();
        let below = sse._mm_movemask_ps(avx._mm_cmp_ps::<_CMP_LT_OQ>(w, zero));
        let above = sse._mm_movemask_ps(avx._mm_cmp_ps::<_CMP_GT_OQ>(w, zero));
        let [wa, wb, wc, _]: [f32; 4] = cast(w);
        EdgeFunctions { w: [wa, wb, wc], is_outside: below & 7 != 0 && above & 7 != 0 }
    }
}
