// SPDX-License-Identifier: Apache-2.0
//! The shaders' lookups against known values and against the filter in f64.

use super::harness::{Answer, Bench, Procedural, Query, encoded, hash, image, noise, number_of, texture, unit};
use super::{DONE, FALLBACK};
use crate::textures::ImageInfo;
use oocpt_core::texture::{ColorSpace, TexelFormat, TextureRef, TextureSampler, Wrap, expand, linear_from_srgb};
use std::sync::Arc;

const FORMATS: [TexelFormat; 3] = [TexelFormat::U8, TexelFormat::F16, TexelFormat::F32];
const WRAPS: [Wrap; 4] = [Wrap::Black, Wrap::Clamp, Wrap::Repeat, Wrap::Mirror];

#[test]
fn texel_centers_are_exact() {
    for format in FORMATS {
        for channels in [1, 2, 3, 4] {
            for size in [[8, 4], [256, 128], [16384, 1], [1, 1]] {
                for space in [ColorSpace::Raw, ColorSpace::Srgb] {
                    if space == ColorSpace::Srgb && format != TexelFormat::U8 {
                        continue;
                    }
                    let bench = Bench::new(
                        vec![image(size, channels, format)],
                        &[texture("0", [Wrap::Repeat; 2], space.clone())],
                    );
                    let places: Vec<[u32; 2]> = (0..500).map(|i| [hash(i) % size[0], hash(i + 7) % size[1]]).collect();
                    let center = |at: u32, side: u32| (at as f32 + 0.5) / side as f32;
                    let query = |p: &[u32; 2]| Query {
                        texture: 0,
                        st: [center(p[0], size[0]), center(p[1], size[1])],
                        width: 0.0,
                    };
                    let answers = bench.ask(&places.iter().map(query).collect::<Vec<_>>());
                    for (place, (value, said, _)) in places.iter().zip(answers) {
                        let bytes: Vec<u8> = (0..channels).map(|c| noise(0, place[0], place[1], c)).collect();
                        let stored = |(c, byte): (usize, &u8)| {
                            let v = number_of(&encoded(*byte, format));
                            let color = space == ColorSpace::Srgb && (c == 0 || (c < 3 && channels >= 3));
                            if color { linear_from_srgb(v) } else { v }
                        };
                        let values: Vec<f64> = bytes.iter().enumerate().map(stored).collect();
                        let expected = expand(&values).map(|v| v as f32);
                        let what = format!("{format:?} x {channels}, {size:?}, {space:?}, texel {place:?}");
                        assert_eq!((value, said), (expected, DONE), "{what}");
                    }
                }
            }
        }
    }
}

/// The largest error of lookups all over an image, against f64, in units of 2^-24 of the largest texel (1).
fn largest_error(size: [u32; 2], format: TexelFormat, wrap: [Wrap; 2], widest: f32) -> f64 {
    let widest = widest * size.map(|side| side as f32).iter().product::<f32>().sqrt();
    // Every second one has its fallback around it.
    let has_border = size[0].is_multiple_of(2);
    let texture = TextureRef { has_border, ..texture("0", wrap, ColorSpace::Raw) };
    let outside = if has_border { texture.fallback.map(f64::from) } else { [0.0; 4] };
    let bench = Bench::new(vec![image(size, 4, format)], &[texture]);
    let (layout, levels) = bench.texels(0, false);
    let texel = |level: u32, x: u32, y: u32| levels[level as usize][(y * layout.level_size(level)[0] + x) as usize];
    let sampler = TextureSampler { layout, wrap, outside, texel };
    let queries: Vec<Query> = (0..3000)
        .map(|i| {
            let reach = [1.0, 3.0, 40.0][(i % 3) as usize];
            let st = [unit(2 * i) - 0.5, unit(2 * i + 1) - 0.5].map(|u| 0.5 + reach * u);
            Query { texture: 0, st, width: if i % 2 == 0 { 0.0 } else { widest * unit(i + 9).powi(4) } }
        })
        .collect();
    let mut worst = 0.0_f64;
    for (query, (value, said, _)) in queries.iter().zip(bench.ask(&queries)) {
        assert_eq!(said, DONE, "everything is there");
        let expected = sampler.lookup(query.st.map(f64::from), f64::from(query.width));
        for (a, b) in value.iter().zip(expected) {
            let error = (f64::from(*a) - b).abs() * f64::from(1 << 24);
            assert!(error.is_finite(), "{query_st:?}: {value:?}", query_st = query.st);
            worst = worst.max(error);
        }
    }
    worst
}

#[test]
fn filtering_agrees_with_double_precision() {
    for size in [[1, 1], [1, 7], [64, 64], [129, 64], [300, 200], [256, 256]] {
        for wrap in WRAPS {
            let worst = largest_error(size, TexelFormat::F32, [wrap, Wrap::Repeat], 3.0);
            assert!(worst <= 16.0, "{size:?}, {wrap:?}: {worst} units in the last place of 1");
        }
    }
    for format in FORMATS {
        let worst = largest_error([300, 200], format, [Wrap::Mirror, Wrap::Clamp], 3.0);
        assert!(worst <= 16.0, "{format:?}: {worst} units in the last place of 1");
    }
}

#[test]
fn a_wide_image_is_as_exact_as_a_small_one() {
    let worst = largest_error([16384, 4], TexelFormat::U8, [Wrap::Repeat; 2], 0.5);
    assert!(worst <= 16.0, "16384 x 4: {worst} units in the last place of 1");
}

#[test]
fn srgb_is_decoded_before_it_is_filtered() {
    let black_and_white = Procedural {
        byte: |_, x, _, _| if x == 0 { 0 } else { 255 },
        info: image([2, 1], 3, TexelFormat::U8).info.clone(),
    };
    let bench = Bench::new(vec![Arc::new(black_and_white)], &[texture("0", [Wrap::Clamp; 2], ColorSpace::Auto)]);
    let middle = Query { texture: 0, st: [0.5, 0.5], width: 0.0 };
    let all = Query { width: 8.0, ..middle };
    let answers = bench.ask(&[middle, all]);
    assert_eq!(answers[0].0, [0.5, 0.5, 0.5, 1.0], "half the light, not half the byte");
    // The level of one texel is made in linear light and stored as a byte: 0.5 is 187.5 and becomes 188.
    let expected = linear_from_srgb(188.0 / 255.0) as f32;
    assert_eq!(answers[1].0, [expected, expected, expected, 1.0], "the mean of both");
}

#[test]
fn lookups_outside_follow_the_wrap_mode() {
    let corners = Procedural {
        byte: |_, x, y, _| [[10, 20], [30, 40]][y as usize][x as usize],
        info: image([2, 2], 1, TexelFormat::U8).info.clone(),
    };
    let textures: Vec<TextureRef> = WRAPS.iter().map(|wrap| texture("0", [*wrap; 2], ColorSpace::Raw)).collect();
    let bench = Bench::new(vec![Arc::new(corners)], &textures);
    let at = |texture: u32, s: f32, t: f32| Query { texture, st: [s, t], width: 0.0 };
    let cases = [
        (at(0, 1.75, 0.25), 0.0, 0.0),
        (at(0, 1.0, 0.25), 10.0, 0.5), // half way from the last texel to nothing
        (at(1, 1.75, 0.25), 20.0, 1.0),
        (at(1, -7.0, 9.0), 30.0, 1.0),
        (at(2, 1.25, 0.25), 10.0, 1.0),
        (at(2, -0.25, -0.25), 40.0, 1.0),
        (at(3, 1.25, 0.25), 20.0, 1.0),
        (at(3, 1.75, 0.25), 10.0, 1.0),
        (at(3, -0.25, 0.75), 30.0, 1.0),
    ];
    let answers = bench.ask(&cases.map(|case| case.0));
    for ((query, byte, alpha), (value, ..)) in cases.iter().zip(answers) {
        let expected = [*byte / 255.0, *byte / 255.0, *byte / 255.0, *alpha];
        let what = format!("{:?} at {:?}", WRAPS[query.texture as usize], query.st);
        assert!(value.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-7), "{what}: {value:?}, not {expected:?}");
    }
}

#[test]
fn levels_are_chosen_by_the_width_of_the_filter() {
    let levels: Vec<[u32; 2]> = (0..10).map(|level| [512 >> level, (256_u32 >> level).max(1)]).collect();
    let info = ImageInfo { levels, ..image([512, 256], 1, TexelFormat::U8).info.clone() };
    let steps = Procedural { byte: |level, _, _, _| (level * 20) as u8, info };
    let bench = Bench::new(vec![Arc::new(steps)], &[texture("0", [Wrap::Repeat; 2], ColorSpace::Raw)]);
    let widths = [0.0, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 40.0, 256.0, 512.0, 1e20, f32::INFINITY];
    let expected = [0.0, 0.0, 0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 5.25, 8.0, 9.0, 9.0, 9.0];
    let query = |width: &f32| Query { texture: 0, st: [0.3, 0.9], width: *width };
    let answers = bench.ask(&widths.iter().map(query).collect::<Vec<_>>());
    for ((width, level), (value, ..)) in widths.iter().zip(expected).zip(answers) {
        let got = value[0] * 255.0 / 20.0;
        assert!((got - level).abs() < 1e-5, "{width} texels: level {got}, not {level}");
    }
}

#[test]
fn udim_sets_with_missing_tiles_use_the_fallback() {
    let flat = |byte: fn(u32, u32, u32, u32) -> u8| {
        Arc::new(Procedural { byte, info: image([4, 4], 1, TexelFormat::U8).info.clone() })
    };
    let images = vec![flat(|_, _, _, _| 51), flat(|_, _, _, _| 102)];
    let wraps = [Wrap::Repeat; 2];
    let textures = [
        texture("0_<UDIM>", wraps, ColorSpace::Raw),
        texture("1", wraps, ColorSpace::Raw),
        texture("9", wraps, ColorSpace::Raw),
        texture("", wraps, ColorSpace::Raw),
    ];
    let bench = Bench::new(images, &textures);
    assert_eq!(bench.set.warnings.len(), 2, "one for each texture that is not there: {:?}", bench.set.warnings);
    let at = |texture: u32, s: f32, t: f32| Query { texture, st: [s, t], width: 0.0 };
    let there = ([0.2, 0.2, 0.2, 1.0], DONE);
    let fallback = ([0.25, 0.5, 0.75, 1.0], FALLBACK);
    let cases = [
        (at(0, 0.5, 0.5), there),
        (at(0, 1.999, 0.001), there),
        (at(0, 1.2, 1.7), there),
        (at(0, 2.5, 0.5), fallback),
        (at(0, 0.5, 1.5), fallback),
        (at(0, -0.5, 0.5), fallback),
        (at(0, 10.5, 0.5), fallback),
        (at(1, 7.3, 0.1), ([0.4, 0.4, 0.4, 1.0], DONE)),
        (at(2, 0.5, 0.5), fallback),
        (at(3, 0.5, 0.5), fallback),
    ];
    let answers = bench.ask(&cases.map(|case| case.0));
    for ((query, expected), (value, said, _)) in cases.iter().zip(answers) {
        assert_eq!((value, said), *expected, "texture {} at {:?}", query.texture, query.st);
    }
}

#[test]
fn a_lookup_that_waits_for_each_tile_in_turn_gives_the_same_bits() {
    let bench =
        Bench::new(vec![image([300, 260], 4, TexelFormat::U8)], &[texture("0", [Wrap::Repeat; 2], ColorSpace::Auto)]);
    let queries: Vec<Query> = (0..2000)
        .map(|i| {
            // Near the borders of tiles, and anywhere.
            let near = |texels: f32, side: f32, u: f32| (texels + 2.0 * u - 1.0) / side;
            let (u, v) = (unit(2 * i), unit(2 * i + 1));
            let border = [near(128.0, 300.0, u), near(128.0, 260.0, v)];
            let st = [border, [u, v], [near(0.0, 300.0, u), near(256.0, 260.0, v)]][(i % 3) as usize];
            Query { texture: 0, st, width: if i % 2 == 0 { 0.0 } else { 8.4 * unit(i + 3) } }
        })
        .collect();
    let whole = bench.ask(&queries);
    let nothing = vec![0_u64; bench.addresses.len()];
    let mut answers: Vec<Answer> = vec![([0.0; 4], 0, 0); queries.len()];
    let mut rounds = 0;
    bench.pages.write(0, bytemuck::cast_slice(&nothing)).expect("mapped");
    answers = bench.go_on(&queries, &answers);
    assert!(answers.iter().all(|answer| answer.1 < FALLBACK), "nothing is there, all wait");
    while answers.iter().any(|answer| answer.1 != DONE) {
        rounds += 1;
        assert!(rounds < 200, "lookups do not end");
        // One tile at a time: the one that the first of those that wait needs.
        let tile = answers.iter().map(|answer| answer.1).find(|said| *said != DONE).expect("one waits");
        let mut pages = nothing.clone();
        pages[tile as usize] = bench.addresses[tile as usize];
        bench.pages.write(0, bytemuck::cast_slice(&pages)).expect("mapped");
        let waiting: Vec<usize> = (0..queries.len()).filter(|i| answers[*i].1 != DONE).collect();
        let asked: Vec<Query> = waiting.iter().map(|i| queries[*i]).collect();
        let before: Vec<Answer> = waiting.iter().map(|i| answers[*i]).collect();
        for (i, answer) in waiting.into_iter().zip(bench.go_on(&asked, &before)) {
            answers[i] = answer;
        }
    }
    let bits = |answer: &Answer| answer.0.map(f32::to_bits);
    let differ = whole.iter().zip(&answers).filter(|(a, b)| bits(a) != bits(b)).count();
    assert_eq!(differ, 0, "lookups in pieces differ from those at once");
    assert!(rounds > 10, "there is more than one tile: {rounds} rounds");
}
