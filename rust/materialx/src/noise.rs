// SPDX-License-Identifier: Apache-2.0
//! Noise as `MaterialX` 1.39 defines it: gradient noise (Perlin 2002, "Improving Noise"), cell noise and cellular
//! noise (Worley 1996, "A Cellular Texture Basis Function") over a lattice hashed by lookup3 (Jenkins 2006). The twin
//! is `shaders/material/pattern_noise.glsl`.
//!
//! Guarantees: the same bits as the twin, except for the square roots of distances; no panic. Coordinates beyond the
//! range of i32 stay in its last cell and have no fraction. Any thread.

use std::array::from_fn;

/// Octaves that a fractal sum has at most.
pub(crate) const MAX_OCTAVES: u32 = 32;

/// What is added to each further octave of a fractal sum.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FractalOctaves {
    pub(crate) count: u32,
    /// Factor of the coordinates.
    pub(crate) lacunarity: f32,
    /// Factor of the amplitude.
    pub(crate) diminish: f32,
}

impl FractalOctaves {
    /// Noise itself.
    pub(crate) const ONE: Self = Self { count: 1, lacunarity: 1.0, diminish: 1.0 };
}

/// lookup3's final mixing; the last word.
fn finish(mut words: [u32; 3]) -> u32 {
    for (step, rotation) in [14, 11, 25, 16, 4, 14, 24].into_iter().enumerate() {
        let (to, from) = ((step + 2) % 3, (step + 1) % 3);
        words[to] = (words[to] ^ words[from]).wrapping_sub(words[from].rotate_left(rotation));
    }
    words[2]
}

/// lookup3's mixing of three words, between blocks of three.
fn mix(mut words: [u32; 3]) -> [u32; 3] {
    for (step, rotation) in [4, 6, 8, 16, 19, 4].into_iter().enumerate() {
        let [to, with, from] = [step % 3, (step + 1) % 3, (step + 2) % 3];
        words[to] = words[to].wrapping_sub(words[from]) ^ words[from].rotate_left(rotation);
        words[from] = words[from].wrapping_add(words[with]);
    }
    words
}

/// lookup3 of up to four words with the seed 13.
fn hash(words: &[u32]) -> u32 {
    let mut state = [words.iter().fold(0xdead_beef_u32 + 13, |seed, _| seed.wrapping_add(4)); 3];
    for (at, &word) in words.iter().enumerate() {
        if at == 3 {
            state = mix(state);
        }
        state[at % 3] = state[at % 3].wrapping_add(word);
    }
    finish(state)
}

/// 0 to 1.
#[expect(clippy::cast_precision_loss, reason = "rounding is part of the definition")]
fn unit(bits: u32) -> f32 {
    bits as f32 / 4_294_967_296.0
}

/// The cell that a coordinate is in, and how far it is in it.
#[expect(clippy::cast_possible_truncation, reason = "limited to what i32 and f32 have both")]
fn cell(x: f32) -> (i32, f32) {
    const LAST: f32 = 2_147_483_520.0;
    let floor = x.floor();
    (floor.clamp(-2_147_483_648.0, LAST) as i32, if x.abs() <= LAST { x - floor } else { 0.0 })
}

/// Bits of the cells, as words to hash.
fn words<const N: usize>(cells: [(i32, f32); N]) -> [u32; N] {
    cells.map(|(cell, _)| cell.cast_unsigned())
}

/// `mx_cell_noise_float`.
pub(crate) fn cell_noise<const N: usize>(p: [f32; N]) -> f32 {
    unit(hash(&words(p.map(cell))))
}

/// `mx_cell_noise_vec3`: the number of the component is one more word. N is 2 or 3.
pub(crate) fn cell_noise_vector<const N: usize>(p: [f32; N]) -> [f32; 3] {
    let mut all = [0; 4];
    all[..N].copy_from_slice(&words(p.map(cell)));
    from_fn(|component| {
        all[N] = [0, 1, 2][component];
        unit(hash(&all[..=N]))
    })
}

/// Product of a vector and the gradient that a hash chooses: 8 in the plane, the 12 edges of a cube (4 of them twice)
/// in space.
fn gradient<const N: usize>(hash: u32, d: [f32; N]) -> f32 {
    let (u, v) = if N == 2 {
        let first = hash & 7 < 4;
        if first { (d[0], 2.0 * d[1]) } else { (d[1], 2.0 * d[0]) }
    } else {
        let edge = hash & 15;
        let second = if edge < 4 {
            1
        } else if edge == 12 || edge == 14 {
            0
        } else {
            N - 1
        };
        (d[usize::from(edge >= 8)], d[second])
    };
    let negated = |x: f32, bit: u32| if hash & bit == 0 { x } else { -x };
    negated(u, 1) + negated(v, 2)
}

/// `mx_perlin_noise_vec3`, whose first component is `mx_perlin_noise_float`. N is 2 or 3.
fn perlin<const N: usize>(p: [f32; N]) -> [f32; 3] {
    let cells = p.map(cell);
    let fades = cells.map(|(_, t)| t * t * t * (t * (t * 6.0 - 15.0) + 10.0));
    let mut corners = [[0.0; 8]; 3];
    for corner in 0..1 << N {
        let ahead = |axis: usize| corner >> axis & 1 == 1;
        let words: [u32; N] = from_fn(|axis| cells[axis].0.wrapping_add(ahead(axis).into()).cast_unsigned());
        let to: [f32; N] = from_fn(|axis| cells[axis].1 - f32::from(u8::from(ahead(axis))));
        let hash = hash(&words);
        for (channel, values) in corners.iter_mut().enumerate() {
            values[corner] = gradient(hash >> (8 * channel), to);
        }
    }
    corners.map(|mut values| {
        for (axis, t) in fades.into_iter().enumerate() {
            for pair in 0..4 >> axis {
                values[pair] = values[2 * pair] * (1.0 - t) + values[2 * pair + 1] * t;
            }
        }
        values[0] * if N == 2 { 0.6616 } else { 0.982 }
    })
}

/// Sum of octaves of [`perlin`]: its three components.
pub(crate) fn fractal<const N: usize>(mut p: [f32; N], octaves: FractalOctaves) -> [f32; 3] {
    let mut sum = [0.0; 3];
    let mut amplitude = 1.0;
    for _ in 0..octaves.count.min(MAX_OCTAVES) {
        let noise = perlin(p);
        sum = from_fn(|k| sum[k] + amplitude * noise[k]);
        amplitude *= octaves.diminish;
        p = p.map(|x| x * octaves.lacunarity);
    }
    sum
}

/// What cellular noise finds.
pub(crate) struct CellularNoise<const N: usize> {
    /// Distances to the three nearest points; 1000 where there is none.
    pub(crate) distances: [f32; 3],
    /// The nearest point.
    pub(crate) nearest: [f32; N],
}

/// The nearest of the points that lie one in a cell, in the cell of `p` and those around it. `jitter` takes them from
/// the centres of their cells. N is 2 or 3.
#[expect(clippy::cast_precision_loss, reason = "rounding is part of the definition")]
pub(crate) fn worley<const N: usize>(p: [f32; N], jitter: f32) -> CellularNoise<N> {
    let cells = p.map(cell);
    let mut squares = [1e6_f32; 3];
    let mut nearest = [0.0; N];
    for neighbour in 0..[1, 3, 9, 27][N] {
        // The first axis changes last: of points at equal distance the first one is taken.
        let mut digits = neighbour;
        let mut step = [0; N];
        for digit in step.iter_mut().rev() {
            *digit = digits % 3 - 1;
            digits /= 3;
        }
        let random = cell_noise_vector::<N>(from_fn(|axis| cells[axis].0.wrapping_add(step[axis]) as f32));
        let to: [f32; N] = from_fn(|axis| step[axis] as f32 + ((random[axis] - 0.5) * jitter + 0.5) - cells[axis].1);
        let square = to.iter().skip(1).fold(to[0] * to[0], |sum, x| sum + x * x);
        if square < squares[0] {
            squares = [square, squares[0], squares[1]];
            nearest = to;
        } else if square < squares[1] {
            squares = [squares[0], square, squares[1]];
        } else if square < squares[2] {
            squares[2] = square;
        }
    }
    CellularNoise { distances: squares.map(f32::sqrt), nearest: from_fn(|axis| nearest[axis] + p[axis]) }
}
