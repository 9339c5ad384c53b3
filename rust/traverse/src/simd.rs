// SPDX-License-Identifier: Apache-2.0
//! The two tests that a walk spends its time in, by what the processor has: a ray against the boxes of four children,
//! and the edges of a triangle. Each kind does the same operations in the same order, so the same bits. Pure, any
//! thread.

#[cfg(target_arch = "x86_64")]
mod avx2;

#[cfg(target_arch = "x86_64")]
pub(crate) use avx2::Avx2Simd;

use crate::node::{BoxRay, EnteredChildren, MeshChildren};
use crate::vector::{V3, dot3, safe_reciprocal};
use bytemuck::cast;
use oocpt_abi::{ABSENT, Bvh4Node, LevelNode, SLAB_PAD};
use std::fmt::Debug;

/// What every node begins with: `origin` and `cell`, the lower planes, the upper planes, and two numbers of its own.
pub(crate) type NodeGrid = [[u32; 4]; 3];

/// Two functions of three numbers, a number for each corner.
#[derive(Clone, Copy, Debug)]
pub(crate) struct EdgeFunctions {
    /// The edge functions opposite to the corners.
    pub(crate) w: [f32; 3],
    /// Some are below zero, and some above it.
    pub(crate) is_outside: bool,
}

/// Instructions of a processor.
pub(crate) trait Simd: Copy + Debug + Send + Sync {
    /// Calls `op`, and lets the compiler use these instructions in all that it inlines there.
    fn vectorize<O: pulp::NullaryFnOnce>(self, op: O) -> O::Output;

    /// The children of a box grid that the ray enters before `limit`, which is no NaN, as if all four were there;
    /// `entry` is where it enters the node.
    fn meet(self, grid: &NodeGrid, ray: &BoxRay, limit: f32, entry: f32) -> EnteredChildren;

    /// A bit for each child of a level's node that there is.
    fn there(self, children: &[u32; 4]) -> u32;

    /// The children of a node of the top level, a chunk or an assembly.
    #[inline(always)]
    fn meet_level(self, node: &LevelNode, ray: &BoxRay, limit: f32, entry: f32) -> EnteredChildren {
        let [grid @ .., _]: [[u32; 4]; 4] = cast(*node);
        let mut met = self.meet(&grid, ray, limit, entry);
        met.mask &= self.there(&node.child);
        met
    }

    /// The children of a node of a mesh.
    #[inline(always)]
    fn meet_mesh(self, node: &Bvh4Node, ray: &BoxRay, limit: f32, entry: f32) -> EnteredChildren {
        let mut met = self.meet(&cast(*node), ray, limit, entry);
        met.mask &= MeshChildren::new(node).there();
        met
    }

    /// The ray from `o` along `d` against boxes that are padded by `pad`.
    fn box_ray(self, o: V3, d: V3, pad: f32) -> BoxRay;

    /// The edge functions of a triangle as seen from `o`, in the plane whose two axes these rows give. Each corner has
    /// a fourth number, which is nothing.
    fn edges(self, corners: &[[f32; 4]; 3], o: V3, plane: [V3; 2]) -> EdgeFunctions;
}

/// What every processor has.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PortableSimd;

impl Simd for PortableSimd {
    #[inline(always)]
    fn vectorize<O: pulp::NullaryFnOnce>(self, op: O) -> O::Output {
        op.call()
    }

    #[inline(always)]
    fn there(self, children: &[u32; 4]) -> u32 {
        let mut there = 0;
        for (lane, &child) in children.iter().enumerate() {
            there |= u32::from(child != ABSENT) << lane;
        }
        there
    }

    #[inline(always)]
    fn meet(self, grid: &NodeGrid, ray: &BoxRay, limit: f32, entry: f32) -> EnteredChildren {
        let [x, y, z, cell, planes @ ..]: [u32; 12] = cast(*grid);
        let (origin, cell) = ([x, y, z], cell.to_le_bytes());
        // Comparisons that keep what is there where the other is NaN: what min and max of the shaders do.
        let mut entries = [0.0_f32; 4];
        let mut leaves = [f32::INFINITY; 4];
        for axis in [2, 1, 0] {
            let reciprocal = ray.reciprocal[axis];
            let from = (f32::from_bits(origin[axis]) - ray.o[axis]) * reciprocal;
            let scale = f32::from_bits(u32::from(cell[axis]) << 23) * reciprocal;
            let (near_from, far_from) = (from - ray.around[axis], from + ray.around[axis]);
            let [lower, upper] = [planes[axis], planes[axis + 3]];
            let [near, far] = if reciprocal < 0.0 { [upper, lower] } else { [lower, upper] };
            let [near, far] = [near, far].map(|planes| planes.to_le_bytes().map(f32::from));
            for lane in 0..4 {
                let a = near[lane] * scale + near_from;
                let b = far[lane] * scale + far_from;
                entries[lane] = if a > entries[lane] { a } else { entries[lane] };
                leaves[lane] = if b < leaves[lane] { b } else { leaves[lane] };
            }
        }
        let mut mask = 0;
        for lane in 0..4 {
            let leave = leaves[lane] * SLAB_PAD;
            let leave = if leave < limit { leave } else { limit };
            mask |= u32::from(entries[lane] <= leave) << lane;
        }
        EnteredChildren { entries: entries.map(|at| if at > entry { at } else { entry }), mask }
    }

    #[inline(always)]
    fn box_ray(self, o: V3, d: V3, pad: f32) -> BoxRay {
        let V3([x, y, z]) = safe_reciprocal(d);
        let reciprocal = [x, y, z, 0.0];
        let around = reciprocal.map(|r| pad * r.abs());
        BoxRay { o: [o[0], o[1], o[2], 0.0], reciprocal, around, turns: BoxRay::NONE.turns }
    }

    #[inline(always)]
    fn edges(self, corners: &[[f32; 4]; 3], o: V3, plane: [V3; 2]) -> EdgeFunctions {
        let [p, q, r] = corners.map(|[x, y, z, _]| plane.map(|axis| dot3(axis, V3([x, y, z]) - o)));
        let edge = |p: [f32; 2], q: [f32; 2]| p[0] * q[1] - p[1] * q[0];
        let w = [edge(q, r), edge(r, p), edge(p, q)];
        let is_outside = w.iter().any(|&w| w < 0.0) && w.iter().any(|&w| w > 0.0);
        EdgeFunctions { w, is_outside }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// Numbers of all kinds: ordinary ones, and those that rounding and comparisons treat in their own way.
    struct Numbers(u64);

    impl Numbers {
        fn bits(&mut self) -> u32 {
            // SplitMix64.
            self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
            (z >> 32) as u32
        }

        fn ordinary(&mut self) -> f32 {
            let [low, high, ..] = self.bits().to_le_bytes();
            f32::from(i16::from_le_bytes([low, high])) / 256.0
        }

        fn any(&mut self) -> f32 {
            const ODD: [f32; 12] = [
                0.0,
                -0.0,
                f32::NAN,
                f32::INFINITY,
                f32::NEG_INFINITY,
                f32::MIN_POSITIVE,
                1.0e-41,
                -1.0e-41,
                f32::MAX,
                f32::MIN,
                1.0,
                -1.0e-20,
            ];
            match self.bits() % 4 {
                0 => ODD[self.bits() as usize % ODD.len()],
                1 => f32::from_bits(self.bits()),
                _ => self.ordinary(),
            }
        }

        fn vector(&mut self, is_odd: bool) -> V3 {
            V3([(); 3].map(|()| if is_odd { self.any() } else { self.ordinary() }))
        }
    }

    /// NaN is NaN, whatever its bits.
    fn same(a: f32, b: f32) -> bool {
        a.to_bits() == b.to_bits() || (a.is_nan() && b.is_nan())
    }

    fn each(test: impl Fn(Avx2Simd, &mut Numbers, bool)) {
        // A processor without it has nothing to compare.
        let Some(avx2) = Avx2Simd::try_new() else { return };
        let mut numbers = Numbers(7);
        for case in 0..200_000 {
            test(avx2, &mut numbers, case % 2 == 0);
        }
    }

    #[test]
    fn simd_box_tests_match_scalar() {
        let (met, passed) = (Cell::new(0), Cell::new(0));
        each(|avx2, numbers, is_odd| {
            let (o, d) = (numbers.vector(is_odd), numbers.vector(is_odd));
            let pad = if is_odd { numbers.any() } else { 1.0e-5 };
            let (portable, wide) = (PortableSimd.box_ray(o, d, pad), avx2.box_ray(o, d, pad));
            for axis in 0..3 {
                assert!(same(portable.o[axis], wide.o[axis]), "{o:?}");
                assert!(same(portable.reciprocal[axis], wide.reciprocal[axis]), "{d:?}");
                assert!(same(portable.around[axis], wide.around[axis]), "{d:?} {pad}");
            }
            let mut grid = [[0; 4]; 3].map(|row: [u32; 4]| row.map(|_| numbers.bits()));
            let origin = if is_odd { numbers.vector(true) } else { 0.1 * o + numbers.vector(false) };
            for (word, place) in grid[0].iter_mut().zip(origin.0) {
                *word = place.to_bits();
            }
            if !is_odd {
                // Cells of a 256th to 2: boxes about as large as the rays are long.
                let mut cell = || 119 + numbers.bits() % 9;
                grid[0][3] = cell() | cell() << 8 | cell() << 16 | 0x5500_0000;
            }
            let limit = numbers.any().abs();
            let limit = if limit.is_nan() { f32::INFINITY } else { limit };
            let entry = if is_odd { 0.0 } else { numbers.ordinary().abs() };
            let (a, b) = (PortableSimd.meet(&grid, &portable, limit, entry), avx2.meet(&grid, &wide, limit, entry));
            assert_eq!(a.mask, b.mask, "{grid:?} {o:?} {d:?} {limit}");
            met.set(met.get() + a.mask.count_ones());
            passed.set(passed.get() + a.mask.count_zeros() - 28);
            for lane in 0..4 {
                assert!(same(a.entries[lane], b.entries[lane]), "{grid:?} {o:?} {d:?}: {a:?} {b:?}");
            }
            let children = [(); 4].map(|()| if numbers.bits() % 2 == 0 { ABSENT } else { numbers.bits() });
            assert_eq!(PortableSimd.there(&children) & 15, avx2.there(&children) & 15, "{children:?}");
        });
        assert!(Avx2Simd::try_new().is_none() || (met.get() > 20_000 && passed.get() > 20_000), "{met:?} {passed:?}");
    }

    #[test]
    fn simd_triangle_edges_match_scalar() {
        let inside = Cell::new(0);
        each(|avx2, numbers, is_odd| {
            let o = numbers.vector(is_odd);
            let plane = [numbers.vector(is_odd), numbers.vector(is_odd)];
            let corners = [(); 3].map(|()| {
                let V3([x, y, z]) = numbers.vector(is_odd);
                [x, y, z, f32::from_bits(numbers.bits())]
            });
            let (a, b) = (PortableSimd.edges(&corners, o, plane), avx2.edges(&corners, o, plane));
            assert_eq!(a.is_outside, b.is_outside, "{corners:?} {o:?} {plane:?}");
            assert!(a.w.iter().zip(b.w).all(|(&a, b)| same(a, b)), "{corners:?} {o:?} {plane:?}: {a:?} {b:?}");
            inside.set(inside.get() + u32::from(!is_odd && !a.is_outside));
        });
        assert!(Avx2Simd::try_new().is_none() || inside.get() > 1000, "{inside:?}");
    }
}
