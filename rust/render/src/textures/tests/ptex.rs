// SPDX-License-Identifier: Apache-2.0
//! Ptex: blocks with borders against their neighbours, and the shaders' lookups against the filter in f64.

use super::super::image::{ImageError, ImageLibrary, SourceImage};
use super::super::set::TextureCache;
use super::harness::{Answer, Bench, Query, hash, number_of};
use super::{DONE, FALLBACK};
use oocpt_abi::Features;
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::{
    ColorSpace, FaceLayout, PtexSampler, TextureRef, Wrap, expand, linear_from_srgb, pack_ptex, unpack_ptex,
};
use oocpt_ptex::{DataType, MeshType, PtexFace, PtexWriter, ReadAt};
use rustc_hash::FxHashMap;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Ptex faces of a mesh, whose faces name their vertices counterclockwise; sizes by number.
pub(in crate::textures) fn ptex_faces(mesh: &[Vec<u32>], log2: impl Fn(u32) -> [u8; 2]) -> Vec<PtexFace> {
    let mut first = Vec::new();
    let mut faces = Vec::new();
    for face in mesh {
        first.push(u32::try_from(faces.len()).expect("few"));
        let (count, is_subface) = if face.len() == 4 { (1, false) } else { (face.len(), true) };
        for _ in 0..count {
            let number = u32::try_from(faces.len()).expect("few");
            faces.push(PtexFace { is_subface, ..PtexFace::new(log2(number)) });
        }
    }
    // Half edges from vertex to vertex: the face in the mesh and the number of the edge there.
    let mut halves = FxHashMap::default();
    for (number, face) in mesh.iter().enumerate() {
        for (k, from) in face.iter().enumerate() {
            halves.insert((*from, face[(k + 1) % face.len()]), (number, k));
        }
    }
    let small = |k: usize| u8::try_from(k).expect("an edge");
    for (number, face) in mesh.iter().enumerate() {
        let n = face.len();
        let at = |k: usize| first[number] + u32::try_from(k % n).expect("few");
        for (k, from) in face.iter().enumerate() {
            let other = halves.get(&(face[(k + 1) % n], *from)).copied();
            // Who begins where our edge begins: the other edge ends there.
            let begin = other.map(|(other, edge)| {
                let m = mesh[other].len();
                if m == 4 { (first[other], small(edge)) } else { (first[other] + ((edge + 1) % m) as u32, 3) }
            });
            // Who is at its second half.
            let end = other.map(|(other, edge)| {
                if mesh[other].len() == 4 { (first[other], small(edge)) } else { (first[other] + edge as u32, 0) }
            });
            if n == 4 {
                faces[at(0) as usize].adjacent[k] = begin;
            } else {
                faces[at(k) as usize].adjacent[0] = begin;
                faces[at(k) as usize].adjacent[1] = Some((at(k + 1), 2));
                faces[at(k + 1) as usize].adjacent[3] = end;
                faces[at(k + 1) as usize].adjacent[2] = Some((at(k), 1));
            }
        }
    }
    faces
}

/// A file with texels of four channels by face, u, v and channel.
pub(in crate::textures) fn ptex_file(
    faces: &[PtexFace],
    data_type: DataType,
    channels: u32,
    texel: impl Fn(u32, u32, u32, u32) -> f32,
) -> Vec<u8> {
    let count = u32::try_from(faces.len()).expect("few");
    let mut writer = PtexWriter::new(Vec::new(), MeshType::Quad, data_type, channels, None, count).expect("begun");
    for (number, face) in (0..).zip(faces) {
        let [width, height] = face.log2.map(|log2| 1_u32 << log2);
        let places = (0..height).flat_map(|v| (0..width).map(move |u| (u, v)));
        let mut bytes: Vec<u8> = Vec::new();
        for (u, v) in places {
            for c in 0..channels {
                let value = texel(number, u, v, c);
                match data_type {
                    DataType::U8 => bytes.push((value * 255.0 + 0.5) as u8),
                    DataType::U16 => bytes.extend(((value * 65535.0 + 0.5) as u16).to_ne_bytes()),
                    DataType::F16 => bytes.extend(half::f16::from_f32(value).to_ne_bytes()),
                    DataType::F32 => bytes.extend(value.to_ne_bytes()),
                }
            }
        }
        writer.push_face(face, &bytes).expect("written");
    }
    writer.finish().expect("whole")
}

/// Ptex files by number.
#[derive(Debug)]
pub(in crate::textures) struct PtexLibrary(pub(in crate::textures) Vec<Arc<[u8]>>);

impl ImageLibrary for PtexLibrary {
    fn open(&self, _: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        Err(ImageError("is no image".into()))
    }

    fn bytes(&self, asset: &AssetRef) -> Result<Box<dyn ReadAt>, ImageError> {
        let number: Option<usize> = asset.resolved.parse().ok();
        let file = number.and_then(|number| self.0.get(number)).ok_or_else(|| ImageError("cannot be found".into()))?;
        Ok(Box::new(Arc::clone(file)))
    }
}

pub(in crate::textures) fn ptex_texture(name: &str, color_space: ColorSpace) -> TextureRef {
    let asset = AssetRef { authored: name.into(), resolved: name.into() };
    let (wrap, fallback) = ([Wrap::UseMetadata; 2], [0.25, 0.5, 0.75, 1.0]);
    let prim = "/Material/Texture".into();
    TextureRef { prim, asset, wrap, color_space, fallback, has_border: false, is_ptex: true }
}

fn bench(files: Vec<Vec<u8>>, color_space: &ColorSpace) -> Bench {
    let textures: Vec<TextureRef> =
        (0..files.len()).map(|number| ptex_texture(&number.to_string(), color_space.clone())).collect();
    let library = PtexLibrary(files.into_iter().map(Into::into).collect());
    Bench::with(Arc::new(library), &textures, Features::PTEX)
}

/// A cube: three faces at each corner.
fn cube() -> Vec<Vec<u32>> {
    let faces = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]];
    faces.map(Vec::from).to_vec()
}

/// A prism over a pentagon: n-gons above and below, quads around.
fn prism() -> Vec<Vec<u32>> {
    let mut faces = vec![(0..5).rev().collect(), (5..10).collect()];
    faces.extend((0..5_u32).map(|k| vec![k, (k + 1) % 5, (k + 1) % 5 + 5, k + 5]));
    faces
}

/// A torus of quads: four faces at each corner.
fn torus(n: u32, m: u32) -> Vec<Vec<u32>> {
    let at = |x: u32, y: u32| (y % m) * n + x % n;
    (0..n * m)
        .map(|k| (k % n, k / n))
        .map(|(x, y)| vec![at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)])
        .collect()
}

fn random(face: u32, u: u32, v: u32, c: u32) -> f32 {
    let mut h = face.wrapping_mul(0x9e37_79b9) ^ u.wrapping_mul(0x85eb_ca6b) ^ v.wrapping_mul(0xc2b2_ae35) ^ c << 7;
    h = (h ^ h >> 15).wrapping_mul(0x2c1b_3c6d);
    ((h ^ h >> 12) & 0xff) as f32 / 255.0
}

/// Texels of the file by their numbers in the layout.
fn decoded(bench: &Bench, number: usize, is_srgb: bool) -> (FaceLayout, Vec<[f64; 4]>) {
    let (image, _) = bench.set.images().nth(number).expect("there");
    let faces = image.faces().expect("Ptex");
    let (channels, bytes) = (image.channels() as usize, image.info().format.bytes() as usize);
    let decode = |texel: &[u8]| {
        let values = texel.chunks(bytes).map(number_of).enumerate();
        let color = |c: usize| is_srgb && (c == 0 || (c < 3 && channels == 4));
        let values: Vec<f64> = values.map(|(c, v)| if color(c) { linear_from_srgb(v) } else { v }).collect();
        expand(&values)
    };
    (FaceLayout::clone(faces), bench.bytes(number).chunks(channels * bytes).map(decode).collect())
}

/// The value at `t` of an edge.
fn on_edge(edge: u8, t: f64) -> [f64; 2] {
    match edge {
        0 => [t, 0.0],
        1 => [1.0, t],
        2 => [1.0 - t, 1.0],
        _ => [0.0, 1.0 - t],
    }
}

#[test]
fn faces_of_one_size_agree_along_edges_and_at_corners() {
    for (name, mesh) in [("cube", cube()), ("torus", torus(5, 4))] {
        let faces = ptex_faces(&mesh, |_| [3, 3]);
        let bench = bench(vec![ptex_file(&faces, DataType::F32, 3, random)], &ColorSpace::Auto);
        let (layout, texels) = decoded(&bench, 0, false);
        let sampler = PtexSampler { layout: &layout, texel: |at: u32| texels[at as usize] };
        let mut corners: BTreeMap<u32, Vec<f64>> = BTreeMap::new();
        for class in 0..=3 {
            let value = |face: u32, uv: [f64; 2]| sampler.bilinear(face, uv, class).expect("there")[0];
            corners.clear();
            for (number, face) in (0..).zip(&faces) {
                for edge in 0..4_u8 {
                    let (other, other_edge) = face.adjacent[usize::from(edge)].expect("closed");
                    for t in [0.5, 0.3, 0.77, 0.9375] {
                        let [a, b] = [(number, edge, t), (other, other_edge, 1.0 - t)]
                            .map(|(face, edge, t)| value(face, on_edge(edge, t)));
                        // Nearer to a corner than half a texel of the coarsest class the corner texels count.
                        if class > 1 || name == "torus" {
                            assert!(
                                (a - b).abs() < 1e-5,
                                "{name}, class {class}, {number} edge {edge} at {t}: {a} {b}"
                            );
                        }
                    }
                    let vertex = mesh[number as usize][usize::from(edge)];
                    corners.entry(vertex).or_default().push(value(number, on_edge(edge, 0.0)));
                }
            }
            for (vertex, values) in &corners {
                let far = values.iter().map(|v| (v - values[0]).abs()).fold(0.0, f64::max);
                assert!(values.len() == if name == "cube" { 3 } else { 4 }, "{name}: all faces");
                assert!(far < 1e-5, "{name}, class {class}: vertex {vertex} is {values:?}");
            }
        }
    }
}

#[test]
fn borders_of_faces_of_other_sizes_show_their_neighbours() {
    // Linear along the edge, so that a mean of texels is the texel of their middle: here each face is one colour.
    let mesh = prism();
    let sizes = |number: u32| [[3, 3], [2, 2], [4, 3], [3, 5]][number as usize % 4];
    let faces = ptex_faces(&mesh, sizes);
    let color = |face: u32| (face + 1) as f32 / 64.0;
    let bench = bench(vec![ptex_file(&faces, DataType::F32, 1, |face, _, _, _| color(face))], &ColorSpace::Auto);
    let (layout, texels) = decoded(&bench, 0, false);
    let sampler = PtexSampler { layout: &layout, texel: |at: u32| texels[at as usize] };
    for (number, face) in (0_u32..).zip(&faces) {
        // Faces of one colour are kept small.
        let own = (0..layout.classes()).rev().find(|class| layout.block(*class, number).is_some()).expect("some");
        for edge in 0..4_u8 {
            for t in [0.3, 0.7] {
                // Worked out by hand: the prism's quads meet the subfaces of an n-gon, whose edge has two halves.
                let (beyond, edge_beyond) = face.adjacent[usize::from(edge)].expect("closed");
                let neighbour = &faces[beyond as usize];
                let second = !face.is_subface && neighbour.is_subface && t > 0.5;
                // Subfaces of one n-gon are numbered counterclockwise: the second half is at the corner before.
                let base = if beyond < 5 { 0 } else { 5 };
                let beyond = if second { base + (beyond - base + 4) % 5 } else { beyond };
                assert!(!second || edge_beyond == 3, "the first half is at the edge that ends at the corner");
                let value = sampler.bilinear(number, on_edge(edge, t), own).expect("there")[0];
                let expected = 0.5 * f64::from(color(number) + color(beyond));
                assert!((value - expected).abs() < 1e-6, "{number} edge {edge} at {t}: {value}, not {expected}");
            }
        }
        let inside = sampler.bilinear(number, [0.5, 0.5], own).expect("there")[0];
        assert!((inside - f64::from(color(number))).abs() < 1e-6, "face {number} inside");
    }
}

#[test]
fn ptex_lookups_match_the_filter_in_f64() {
    let sizes = |number: u32| [[7, 7], [5, 6], [0, 0], [8, 3]][number as usize % 4];
    let faces = ptex_faces(&torus(6, 5), sizes);
    for (data_type, channels, space) in [
        (DataType::U8, 3, ColorSpace::Auto),
        (DataType::U8, 1, ColorSpace::Raw),
        (DataType::U16, 2, ColorSpace::Auto),
        (DataType::F16, 4, ColorSpace::Auto),
        (DataType::F32, 5, ColorSpace::Auto),
    ] {
        let file = || ptex_file(&faces, data_type, channels, random);
        let bench = bench(vec![file(), file()], &space);
        assert_eq!(bench.set.images().count(), 2, "two files: {:?}", bench.set.warnings);
        let is_srgb = data_type == DataType::U8 && channels == 3;
        let (layout, texels) = decoded(&bench, 1, is_srgb);
        let sampler = PtexSampler { layout: &layout, texel: |at: u32| texels[at as usize] };
        let mut queries = Vec::new();
        for i in 0..3000_u32 {
            let unit = |salt: u32| f64::from(hash(i * 7 + salt) >> 8) / f64::from(1 << 24);
            let edge = [0.0, 1.0, 0.5];
            let uv = if i % 10 == 0 { [edge[i as usize % 3], unit(2)] } else { [unit(1), unit(2)] };
            let width = if i % 4 == 0 { 0.0 } else { (300.0 * unit(3) * unit(4)) as f32 };
            queries.push((hash(i) % 30, Query { texture: 1, st: pack_ptex(hash(i) % 30, uv), width }));
        }
        let answers = bench.ask(&queries.iter().map(|(_, query)| *query).collect::<Vec<_>>());
        for ((face, query), (value, said, _)) in queries.iter().zip(answers) {
            let (packed, uv) = unpack_ptex(query.st);
            assert_eq!((packed, said), (*face, DONE), "{data_type:?}");
            let expected = sampler.lookup(*face, uv, f64::from(query.width)).expect("there");
            let off = (0..4).map(|k| (expected[k] - f64::from(value[k])).abs()).fold(0.0, f64::max);
            assert!(off < 2e-5, "{data_type:?} face {face} at {uv:?}, {}: {value:?}, not {expected:?}", query.width);
        }
    }
}

#[test]
fn missing_faces_and_invalid_files_give_the_fallback() {
    let faces = ptex_faces(&cube(), |_| [1, 1]);
    let triangles = PtexWriter::new(Vec::new(), MeshType::Triangle, DataType::U8, 1, None, 1).and_then(|mut writer| {
        writer.push_face(&PtexFace::new([1, 1]), &[1, 2, 3, 4])?;
        writer.finish()
    });
    let files = vec![ptex_file(&faces, DataType::U8, 1, random), triangles.expect("written"), b"no file".to_vec()];
    let bench = bench(files, &ColorSpace::Auto);
    assert_eq!(bench.set.warnings.len(), 2, "one line for each file: {:?}", bench.set.warnings);
    let query = |texture: u32, face: u32| Query { texture, st: pack_ptex(face, [0.5, 0.5]), width: 1.0 };
    let answers = bench.ask(&[query(0, 5), query(0, 6), query(0, (1 << 26) - 1), query(1, 0), query(2, 0)]);
    assert_eq!(answers[0].1, DONE, "the last face");
    for (value, said, _) in &answers[1..] {
        assert_eq!((*value, *said), ([0.25, 0.5, 0.75, 1.0], FALLBACK), "the fallback");
    }
}

#[test]
fn a_deferred_lookup_resumes_at_the_missing_tile() {
    let faces = ptex_faces(&torus(3, 3), |_| [8, 8]);
    let bench = bench(vec![ptex_file(&faces, DataType::U8, 4, random)], &ColorSpace::Raw);
    assert!(bench.addresses.len() > 30, "faces of several tiles: {}", bench.addresses.len());
    let queries: Vec<Query> = (0..400_u32)
        .map(|i| {
            let unit = |salt: u32| f64::from(hash(i * 5 + salt) >> 8) / f64::from(1 << 24);
            Query { texture: 0, st: pack_ptex(i % 9, [unit(0), unit(1)]), width: (40.0 * unit(2)) as f32 }
        })
        .collect();
    let whole = bench.ask(&queries);
    let mut there = vec![0_u64; bench.addresses.len()];
    bench.pages.write(0, bytemuck::cast_slice(&there)).expect("mapped");
    let mut answers = bench.ask(&queries);
    for round in 0.. {
        let missing: Vec<usize> = answers.iter().filter(|a| a.1 < FALLBACK).map(|a| a.1 as usize).collect();
        if missing.is_empty() {
            break;
        }
        assert!(round < 100, "each tile that comes is progress");
        // One at a time, and the others go.
        there.fill(0);
        for page in missing.iter().step_by(2) {
            there[*page] = bench.addresses[*page];
        }
        bench.pages.write(0, bytemuck::cast_slice(&there)).expect("mapped");
        // Whoever is done asks no more.
        let open: Vec<usize> = (0..queries.len()).filter(|k| answers[*k].1 < FALLBACK).collect();
        let (again, before): (Vec<Query>, Vec<Answer>) = open.iter().map(|&k| (queries[k], answers[k])).unzip();
        for (k, answer) in open.into_iter().zip(bench.go_on(&again, &before)) {
            answers[k] = answer;
        }
    }
    for (got, expected) in answers.iter().zip(&whole) {
        assert_eq!((got.0, got.1), (expected.0, DONE), "the same bits");
    }
}

/// Files that lie: neighbours at random, bytes changed, ends cut off. An error or tiles, in time, whatever they say.
#[test]
fn hostile_ptex_files_terminate() {
    let mut state = 7_u32;
    let mut next = move |below: u32| {
        state = hash(state);
        state % below
    };
    let (mut refused, mut made) = (0, 0);
    for round in 0..300 {
        let count = 1 + next(40);
        let faces: Vec<PtexFace> = (0..count)
            .map(|_| PtexFace {
                adjacent: std::array::from_fn(|_| (next(5) > 0).then(|| (next(count + 2), next(4) as u8))),
                is_subface: next(3) == 0,
                ..PtexFace::new([next(7) as u8, next(7) as u8])
            })
            .collect();
        let mut file = ptex_file(&faces, DataType::U8, 1 + next(5), random);
        if round % 2 == 1 {
            for _ in 0..1 + next(20) {
                let at = next(u32::try_from(file.len()).expect("small")) as usize;
                file[at] ^= 1 << next(8);
            }
            if next(3) == 0 {
                file.truncate(next(u32::try_from(file.len()).expect("small")) as usize);
            }
        }
        let library: Arc<dyn ImageLibrary> = Arc::new(PtexLibrary(vec![file.into()]));
        let set = TextureCache::default().sync(Some(&library), &[ptex_texture("0", ColorSpace::Auto)]);
        let tiles: usize =
            set.images().map(|(image, count)| (0..count).map(|tile| image.tile(tile).len()).sum::<usize>()).sum();
        let complaints = set.warnings.len() + set.take_complaints().len();
        assert!(round % 2 == 1 || (complaints == 0 && tiles > 0), "neighbours that are none are no error");
        assert!(complaints <= 1, "one line for a file");
        refused += complaints;
        made += tiles.min(1);
    }
    assert!(refused > 50 && made > 150, "some of both: {refused}, {made}");
}

/// A few hundred bytes that say they are gigabytes.
#[test]
fn small_files_of_many_texels_are_refused_and_constant_faces_are_small() {
    let write = |log2: [u8; 2], constant: bool, count: u32| {
        let mut writer = PtexWriter::new(Vec::new(), MeshType::Quad, DataType::U8, 4, None, count).expect("begun");
        let face = PtexFace { is_constant: constant, ..PtexFace::new(log2) };
        let texel = [10, 20, 30, 255];
        let texels = if constant { texel.to_vec() } else { texel.repeat(1 << (log2[0] + log2[1])) };
        (0..count).for_each(|_| writer.push_face(&face, &texels).expect("written"));
        writer.finish().expect("whole")
    };
    let open = |file: Vec<u8>| {
        let library: Arc<dyn ImageLibrary> = Arc::new(PtexLibrary(vec![file.into()]));
        TextureCache::default().sync(Some(&library), &[ptex_texture("0", ColorSpace::Raw)])
    };
    let constant = open(write([14, 14], true, 30));
    assert!(constant.warnings.is_empty(), "{:?}", constant.warnings);
    let (image, count) = constant.images().next().expect("there");
    assert!(count < 10, "30 faces of 16 x 16: {count} tiles");
    let texel = |tile: &Vec<u8>| tile[..4].to_vec();
    assert_eq!(texel(&image.tile(0)), [10, 20, 30, 255]);
    // Nothing tells them apart, so the file is next to nothing.
    let refused = open(write([14, 14], true, 200_000));
    assert!(refused.images().count() == 0 && refused.warnings.len() == 1, "{:?}", refused.warnings);
}
