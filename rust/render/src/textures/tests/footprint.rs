// SPDX-License-Identifier: Apache-2.0
//! Footprints of cones in textures, by the shaders, against singular values in f64: random ellipses, and degenerate
//! ones.

use super::harness::{open, unit};
use bytemuck::Zeroable;
use glam::{DMat2, DVec2, DVec3};
use oocpt_abi::{Features, FrameConstants, PushConstants, groups};
use oocpt_core::texture::{ellipse, filter_width};
use oocpt_gpu::{Buffer, BufferUsage, Pipeline};
use oocpt_shaders::checks;
use std::time::Duration;

/// Gradients of u and v, normal, direction; rows of the map; texels; the cone's width.
#[derive(Clone, Copy, Debug)]
struct Query {
    vectors: [[f32; 3]; 4],
    rows: [f32; 4],
    size: [u32; 2],
    cone: f32,
}

/// A square texture of 64 texels, seen from in front by a cone of width 1.
const FRONT: Query = Query {
    vectors: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]],
    rows: [1.0, 0.0, 0.0, 1.0],
    size: [64, 64],
    cone: 1.0,
};

/// The packed ellipse and the filter's width of each query, and the width for lookups in masks.
fn ask(queries: &[Query]) -> Vec<([u32; 2], f32, f32)> {
    let gpu = open();
    let spec = (Features::MATERIALS | Features::TEXTURES).constants();
    let module = &checks::CHECK_FOOTPRINT;
    let pipeline = Pipeline::new(&gpu, module.name, &module.specialised(&spec), &spec, 32).expect("the pass compiles");
    let asked: Vec<[f32; 20]> = queries
        .iter()
        .map(|q| {
            let last = [q.cone, q.size[0] as f32, q.size[1] as f32, 0.0];
            let mut words = [0.0; 20];
            for (i, (vector, last)) in q.vectors.iter().zip(last).enumerate() {
                words[4 * i..4 * i + 3].copy_from_slice(vector);
                words[4 * i + 3] = last;
            }
            words[16..].copy_from_slice(&q.rows);
            words
        })
        .collect();
    let bytes = 16 * queries.len() as u64;
    let input = Buffer::new(&gpu, "queries", 5 * bytes, BufferUsage::Upload).expect("memory");
    input.write(0, bytemuck::cast_slice(&asked)).expect("mapped");
    let answers = Buffer::new(&gpu, "answers", bytes, BufferUsage::Readback).expect("memory");
    let frame = Buffer::new(&gpu, "frame", size_of::<FrameConstants>() as u64, BufferUsage::Upload).expect("memory");
    let made = FrameConstants { rays: input.address(), radiance: answers.address(), ..FrameConstants::zeroed() };
    frame.write(0, bytemuck::bytes_of(&made)).expect("mapped");
    let count = u32::try_from(queries.len()).expect("few");
    let push = PushConstants::wave(frame.address(), 0, count, 1);
    let mut commands = gpu.commands("footprints").expect("a list");
    commands.dispatch(&pipeline, bytemuck::bytes_of(&push), groups(u64::from(count)));
    assert!(commands.submit().expect("submitted").wait(Duration::from_secs(60)).expect("alive"), "it ends");
    let messages = gpu.take_validation_messages();
    assert!(messages.is_empty(), "Vulkan validation: {messages:?}");
    let words: Vec<[u32; 4]> = answers.map(|bytes| bytemuck::pod_collect_to_vec(bytes)).expect("mapped");
    words.iter().map(|w| ([w[0], w[1]], f32::from_bits(w[2]), f32::from_bits(w[3]))).collect()
}

fn expected(q: &Query) -> [f64; 2] {
    let [u, v, n, d] = q.vectors.map(|v| DVec3::from(v.map(f64::from)));
    let [a, b, c, e] = q.rows.map(f64::from);
    let map = DMat2::from_cols(DVec2::new(a, c), DVec2::new(b, e));
    ellipse([u, v], n, d, map, q.size).map(|axis| axis * f64::from(q.cone))
}

/// Vectors of all lengths, down to a cosine of 1/1000; a fourth of them nearly round.
fn random(i: u32) -> Query {
    let number = |k: u32| 2.0 * unit(40 * i + k) - 1.0;
    let vector = |k: u32| DVec3::new(f64::from(number(k)), f64::from(number(k + 1)), f64::from(number(k + 2)));
    let scale = |k: u32| f64::from(20.0 * number(k)).exp2();
    let is_round = i.is_multiple_of(4);
    let normal = vector(0).normalize_or(DVec3::Z);
    let (x, y) = normal.any_orthonormal_pair();
    let u = x * f64::from(number(3)) + y * f64::from(number(4));
    let other = x * f64::from(number(5)) + y * f64::from(number(6));
    let v = if is_round { normal.cross(u) + 0.2 * u.length() * other } else { other };
    let turn = f64::from(number(9)) * std::f64::consts::PI;
    let steepest = if is_round { 0.3 } else { 10.0 };
    let cosine = f64::from(-steepest * unit(40 * i + 10)).exp2() * if i.is_multiple_of(2) { 1.0 } else { -1.0 };
    let direction = normal * cosine + (x * turn.cos() + y * turn.sin()) * (1.0 - cosine * cosine).sqrt();
    let stretch = if i % 8 == 1 { 8.0 } else { 1.0 };
    let f = |v: DVec3| v.as_vec3().to_array();
    let side = |k: u32| 1 + (16_384.0 * unit(40 * i + k).powi(3)) as u32;
    Query {
        vectors: [f(u * stretch * scale(39)), f(v * scale(39)), f(normal * scale(11)), f(direction * scale(12))],
        rows: if i % 8 == 2 { [number(13), number(14), number(15), number(16)] } else { FRONT.rows },
        size: if is_round { [side(20); 2] } else { [side(20), side(21)] },
        cone: (10.0 * number(17)).exp2(),
    }
}

#[test]
fn filter_widths_match_singular_values_in_f64() {
    let queries: Vec<Query> = (0..20_000).map(random).collect();
    let answers = ask(&queries);
    let (mut packed, mut flat, mut thin) = (0.0_f64, 0, 0);
    for (q, (_, width, _)) in queries.iter().zip(answers) {
        let axes = expected(q);
        let want = filter_width(axes);
        thin += u32::from(axes[0] > 16.0 * axes[1]);
        flat += u32::from(axes[0] < 1.1 * axes[1]);
        let error = (f64::from(width) - want).abs();
        // Where the map stretches the shorter axis, what packing rounds is stretched as well: steps of the ratio are
        // 2^-10 of it, those of the direction 2^-15 of the longer axis.
        let stretch = f64::from(q.size[0].max(q.size[1])) / f64::from(q.size[0].min(q.size[1]));
        let bound = (2e-3_f64).max(1e-4 * stretch);
        packed = packed.max(error / want / bound);
        assert!(error <= bound * want, "{q:?}: {width}, not {want} of {axes:?}");
    }
    assert!(thin > 1000 && flat > 100, "ellipses of all kinds: {thin} thin, {flat} round");
    assert!(packed > 0.1, "the bound is not loose: {packed}");
}

#[test]
fn a_degenerate_footprint_keeps_a_finite_width() {
    let with = |k: usize, vector: [f32; 3]| {
        let mut q = FRONT;
        q.vectors[k] = vector;
        q
    };
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let cases = [
        ("from in front", FRONT, 64.0),
        ("the other way round", with(0, [-1.0, 0.0, 0.0]), 64.0),
        ("no area: along one line", with(1, [1.0, 0.0, 0.0]), 64.0 * 2.0_f32.sqrt() / 16.0),
        ("one dimension", with(1, [0.0; 3]), 4.0),
        ("a point", Query { vectors: [[0.0; 3], [0.0; 3], FRONT.vectors[2], FRONT.vectors[3]], ..FRONT }, 0.0),
        ("eight to one", with(0, [8.0, 0.0, 0.0]), 64.0),
        ("sixty-four to one", with(1, [0.0, 64.0, 0.0]), 256.0),
        ("edge on: as far as the bound of the slant", with(3, [0.0, 1.0, 0.0]), 64.0e4 / 16.0),
        ("no direction", with(3, [0.0; 3]), 0.0),
        ("no normal", with(2, [0.0; 3]), 0.0),
        ("no number", with(0, [nan, 0.0, 0.0]), 0.0),
        ("no number, no direction", with(3, [nan; 3]), 0.0),
        ("endless", with(0, [inf, 0.0, 0.0]), 0.0),
        ("huge", with(0, [3.0e38, 0.0, 0.0]), inf),
        ("1 x 64 texels", Query { size: [1, 64], ..FRONT }, 4.0),
        ("one texel", Query { size: [1, 1], ..FRONT }, 1.0),
        ("no image", Query { size: [0, 0], ..FRONT }, 0.0),
        ("no cone", Query { cone: 0.0, ..FRONT }, 0.0),
        ("a cone that is no number", Query { cone: nan, ..FRONT }, 0.0),
        ("a map to a line", Query { rows: [1.0, 0.0, 0.0, 0.0], ..FRONT }, 4.0),
        ("a map to a point", Query { rows: [0.0; 4], ..FRONT }, 0.0),
        ("tiny", Query { vectors: FRONT.vectors.map(|v| v.map(|x| x * 1.0e-18)), ..FRONT }, 64.0e-18),
    ];
    let answers = ask(&cases.map(|(_, query, _)| query));
    for ((name, _, width), (packed, got, _)) in cases.iter().zip(answers) {
        let is_near = if width.is_finite() { (got - width).abs() <= 1e-3 * width } else { got > 1.0e30 };
        assert!(is_near, "{name}: {got}, not {width} ({packed:x?})");
    }
}

/// A texture that is stretched in st as its image is has square texels: an ellipse that is thin in st is round in
/// texels, and must not lose its shorter axis in packing.
#[test]
fn stretched_textures_keep_the_minor_axis() {
    let strip = |i: u32, size: [u32; 2]| {
        let angle = unit(i) * 7.0;
        let axis =
            |turn: f32, texels: u32| [(angle + turn).cos() / texels as f32, (angle + turn).sin() / texels as f32, 0.0];
        let vectors =
            [axis(0.0, size[0]), axis(std::f32::consts::FRAC_PI_2, size[1]), FRONT.vectors[2], FRONT.vectors[3]];
        Query { vectors, size, cone: 3.0, ..FRONT }
    };
    let queries: Vec<Query> =
        (0..300).map(|i| strip(i, [[8192, 128], [1, 300], [128, 8192], [16_384, 16]][i as usize % 4])).collect();
    for (q, (_, width, _)) in queries.iter().zip(ask(&queries)) {
        assert!((width - 3.0).abs() < 0.01, "{q:?}: {width} texels, not 3");
    }
}

/// Limit on how far a map from coordinates to texels may be from a similarity: the sum of the squares of its axes over
/// twice their product. The rounding of a footprint's direction may be off by so much more.
const MAX_UNEVEN: f32 = 2.5;

/// Any width gives the same coverage: the width only selects the level of the mask.
#[test]
fn mask_lookups_are_as_wide_as_the_filter() {
    let queries: Vec<Query> = (0..40_000).map(random).collect();
    let (mut usual, mut near_ones) = (0, 0);
    for (q, (_, width, near)) in queries.iter().zip(ask(&queries)) {
        assert!((0.0..1.0e9).contains(&near), "{q:?}: {near}");
        let [a, b, c, d] = q.rows;
        let [[a, b], [c, d]] =
            [([a, b], q.size[0]), ([c, d], q.size[1])].map(|(row, side)| row.map(|x| x * side as f32));
        let is_even = a * a + b * b + c * c + d * d <= 2.0 * MAX_UNEVEN * (a * d - b * c).abs();
        // Edges are as long as the normal.
        if is_even && q.vectors.iter().all(|v| (1e-3..1e3).contains(&glam::Vec3::from(*v).length())) {
            usual += 1;
            near_ones += u32::from((near / width - 1.0).abs() < 0.1);
        }
    }
    assert!(usual > 1000 && 5 * near_ones > 4 * usual, "most are: {near_ones} of {usual}");
}

#[test]
fn degenerate_footprints_ask_the_finest_level_of_a_mask() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    let with = |k: usize, vector: [f32; 3]| {
        let mut q = FRONT;
        q.vectors[k] = vector;
        q
    };
    let cases = [
        ("a point", Query { vectors: [[0.0; 3], [0.0; 3], FRONT.vectors[2], FRONT.vectors[3]], ..FRONT }),
        ("edge on", with(3, [0.0, 1.0, 0.0])),
        ("no direction", with(3, [0.0; 3])),
        ("no normal", with(2, [0.0; 3])),
        ("no number", with(0, [nan, 0.0, 0.0])),
        ("no direction that is a number", with(3, [nan; 3])),
        ("endless", with(0, [inf, 0.0, 0.0])),
        ("huge", with(0, [3.0e38, 0.0, 0.0])),
        ("tiny", Query { vectors: FRONT.vectors.map(|v| v.map(|x| x * 1.0e-18)), ..FRONT }),
        ("a cone that is no number", Query { cone: nan, ..FRONT }),
    ];
    for ((name, _), (.., near)) in cases.iter().zip(ask(&cases.map(|(_, query)| query))) {
        assert!(near == 0.0, "{name}: {near}");
    }
    let [(_, width, near)] = ask(&[FRONT])[..] else { panic!("one answer") };
    assert!((near - width).abs() < 0.1, "from in front: {near}, {width}");
}
