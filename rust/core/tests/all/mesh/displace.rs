// SPDX-License-Identifier: Apache-2.0
//! Displaced meshes against closed forms: heights of vertices, normals, closed surfaces, effects of bad data.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use oocpt_core::material::{Displacement, compile};
use oocpt_core::mesh::{BuildDemand, BuiltMesh, DicingRate, build_mesh_with};
use oocpt_core::texture::{HeightCache, HeightFiles, HeightImage, TextureRef, TileLayout};
use oocpt_core::{
    DroppedData, Interpolation, MaterialDesc, MeshAsset, MeshDesc, NamedPrimvar, ParamValue, Primvar, Subdivision,
    SubsetDesc, TypedArray, Wrap,
};

use crate::material::preview_surface::{file, node, text};

/// An image of 64 x 32 texels; its contents depend on the file name.
#[derive(Debug)]
struct Picture(String);

/// Texel (x, y) of a channel.
fn texel(x: i64, y: i64, channel: u8) -> f32 {
    let (x, y) = (x as f32, y as f32);
    (0.3 * x).sin() * (0.2 * y + 1.0).cos() + f32::from(channel) * 0.01 * x
}

#[expect(clippy::cast_possible_truncation, reason = "small and whole")]
fn whole(number: f64) -> i64 {
    number as i64
}

const SIZE: [u32; 2] = [64, 32];

impl HeightImage for Picture {
    fn layout(&self) -> TileLayout {
        TileLayout::new(SIZE, 4).unwrap()
    }

    fn wrap(&self) -> Option<[Wrap; 2]> {
        (self.0 == "mirrored").then_some([Wrap::Mirror; 2])
    }

    fn channel(&self, level: u32, channel: u8) -> Result<Vec<f32>, String> {
        let [width, height] = self.layout().level_size(level).map(i64::from);
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        match self.0.as_str() {
            "broken" => Err("is damaged".into()),
            "short" => Ok(vec![0.0; 7]),
            "nan" => Ok(places.map(|(x, _)| if x % 2 == 0 { f32::NAN } else { 1e30 }).collect()),
            // This file shows its level.
            "levels" => Ok(places.map(|_| level as f32).collect()),
            "one" => Ok(places.map(|_| 1.0).collect()),
            // This file rises from its number on, by a sixteenth.
            name if name.starts_with("tile") => {
                let number: f32 = name[4..8].parse().unwrap();
                Ok(places.map(|(x, _)| number + (x as f32 + 0.5) / (16 * width) as f32).collect())
            }
            name if name.starts_with("part") => {
                let number: f32 = name[4..8].parse().unwrap();
                Ok(places.map(|_| number).collect())
            }
            _ => Ok(places.map(|(x, y)| texel(x, y, channel)).collect()),
        }
    }
}

#[derive(Debug)]
pub(crate) struct Files;

impl HeightFiles for Files {
    fn open(&self, texture: &TextureRef, member: u32) -> Result<Option<Arc<dyn HeightImage>>, String> {
        let name = texture.asset.resolved.replace("<UDIM>", &member.to_string());
        match name.as_str() {
            "gone" => Err("cannot be found".into()),
            "tile1003" => Ok(None),
            _ => Ok(Some(Arc::new(Picture(name)))),
        }
    }
}

/// A material that is displaced by a texture with these inputs; `read` are those of a `UsdTransform2d`.
pub(crate) fn textured(
    name: &str,
    output: &str,
    own: &[(&str, ParamValue)],
    place: &[(&str, ParamValue)],
) -> MaterialDesc {
    let mut params = vec![("file", file(name))];
    params.extend(own.iter().cloned());
    let nodes = vec![
        node("UsdPreviewSurface", &[], &[("displacement", 1, output)]),
        node("UsdUVTexture", &params, &[("st", 2, "result")]),
        node("UsdTransform2d", place, &[("in", 3, "result")]),
        node("UsdPrimvarReader_float2", &[("varname", text("st"))], &[]),
    ];
    MaterialDesc { path: "/m".into(), nodes, surface: Some(0), displacement: Some(0) }
}

pub(crate) fn constant(amount: f32) -> MaterialDesc {
    let nodes = vec![node("UsdPreviewSurface", &[("displacement", ParamValue::Float(amount))], &[])];
    MaterialDesc { path: "/m".into(), nodes, surface: Some(0), displacement: Some(0) }
}

fn displacement(material: &MaterialDesc) -> Arc<Displacement> {
    let compiled = compile(material);
    assert_eq!(compiled.problem(), None, "a sound network");
    compiled.displacement.expect("a displacement")
}

pub(crate) fn build(desc: &MeshDesc, material: &MaterialDesc, pieces: f64) -> BuiltMesh {
    build_by_slot(desc, &[Some(displacement(material))], pieces)
}

/// Builds a mesh, with edges of one unit cut into this number of pieces.
pub(crate) fn build_by_slot(desc: &MeshDesc, displacements: &[Option<Arc<Displacement>>], pieces: f64) -> BuiltMesh {
    let dicing = DicingRate { pixels: 1.0, density: pieces, ..DicingRate::default() };
    let heights = HeightCache::new(Some(Arc::new(Files)));
    let demand =
        BuildDemand { dicing: Some(&dicing), displacements, heights: Some(&heights), ..BuildDemand::default() };
    build_mesh_with(desc, &demand, 1, u64::MAX, u64::MAX)
}

pub(crate) fn asset(built: &BuiltMesh) -> &MeshAsset {
    assert_eq!((built.dropped, &built.notes[..]), (DroppedData::default(), &[][..]), "nothing is wrong");
    built.asset.as_ref().unwrap()
}

fn primvar<T: oocpt_core::array::ArrayElement + std::fmt::Debug>(
    interpolation: Interpolation,
    values: Vec<T>,
) -> Primvar {
    Primvar { interpolation, values: TypedArray::of(values), indices: None }
}

pub(crate) fn st(interpolation: Interpolation, values: Vec<[f32; 2]>) -> Vec<NamedPrimvar> {
    vec![NamedPrimvar { name: "st".into(), primvar: primvar(interpolation, values) }]
}

/// The square from (0, 0, 0) to (1, 1, 0); st is x and y.
pub(crate) fn square() -> MeshDesc {
    let corners = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    MeshDesc {
        double_sided: true,
        face_vertex_counts: TypedArray::of(vec![4_i32]),
        face_vertex_indices: TypedArray::of(vec![0_i32, 1, 2, 3]),
        points: TypedArray::of::<[f32; 3]>(corners.iter().map(|[x, y]| [*x, *y, 0.0]).collect()),
        primvars: st(Interpolation::Vertex, corners.to_vec()),
        ..MeshDesc::default()
    }
}

/// A cube from -1 to 1 whose faces share their points; each face shows all of the texture, turned by its number.
pub(crate) fn cube(subdivision: Subdivision) -> MeshDesc {
    let coordinate = |k: usize, bit: usize| if k >> bit & 1 == 1 { 1.0_f32 } else { -1.0 };
    let points: Vec<[f32; 3]> = (0..8).map(|k| [coordinate(k, 0), coordinate(k, 1), coordinate(k, 2)]).collect();
    let corners = vec![0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5];
    let unit = [[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
    MeshDesc {
        subdivision,
        double_sided: true,
        face_vertex_counts: TypedArray::of(vec![4_i32; 6]),
        face_vertex_indices: TypedArray::of::<i32>(corners),
        points: TypedArray::of(points),
        primvars: st(Interpolation::FaceVarying, (0..24).map(|k| unit[(k % 4 + k / 4) % 4]).collect()),
        ..MeshDesc::default()
    }
}

/// Position, normal and face of each corner.
pub(crate) fn corners(asset: &MeshAsset) -> Vec<(DVec3, DVec3, u32)> {
    let normals = asset.normals.as_ref().unwrap();
    let both = asset.triangles.iter().zip(&asset.corner_indices);
    both.flat_map(|(triangle, indices)| {
        [0, 1, 2].map(|k| {
            let normal = Vec3::from(normals.values[indices[k] as usize]);
            (Vec3::from(triangle.vertices[k]).as_dvec3(), normal.as_dvec3(), triangle.face)
        })
    })
    .collect()
}

/// Number of edges without a triangle on the other side.
fn open_edges(asset: &MeshAsset) -> usize {
    let bits = |v: [f32; 3]| v.map(|v| (v + 0.0).to_bits());
    let mut edges: HashMap<([u32; 3], [u32; 3]), i32> = HashMap::new();
    for triangle in &asset.triangles {
        let [a, b, c] = triangle.vertices.map(bits);
        for (from, to) in [(a, b), (b, c), (c, a)] {
            *edges.entry((from, to)).or_default() += 1;
            *edges.entry((to, from)).or_default() -= 1;
        }
    }
    edges.values().filter(|count| **count != 0).count()
}

/// Bilinear filter of the picture, from its definition.
pub(crate) fn filtered(s: f64, t: f64, channel: u8, wrap: impl Fn(i64, i64) -> Option<i64>) -> f64 {
    let (x, y) = (s * f64::from(SIZE[0]) - 0.5, t * f64::from(SIZE[1]) - 0.5);
    let mut sum = 0.0;
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let (column, row) = (x.floor() + f64::from(dx), y.floor() + f64::from(dy));
        let weight = (1.0 - (x - column).abs()) * (1.0 - (y - row).abs());
        let column = wrap(whole(column), i64::from(SIZE[0]));
        let row = wrap(whole(row), i64::from(SIZE[1]));
        sum += weight * column.zip(row).map_or(0.0, |(column, row)| f64::from(texel(column, row, channel)));
    }
    sum
}

pub(crate) fn repeated(x: i64, size: i64) -> Option<i64> {
    Some(x.rem_euclid(size))
}

pub(crate) fn wraps(mode: &str) -> [(&'static str, ParamValue); 2] {
    [("wrapS", text(mode)), ("wrapT", text(mode))]
}

#[test]
fn a_square_is_its_height_field() {
    type Mode = fn(i64, i64) -> Option<i64>;
    let modes: [(&str, &str, Mode); 5] = [
        ("repeat", "waves", repeated),
        ("clamp", "waves", |x, size| Some(x.clamp(0, size - 1))),
        ("black", "waves", |x, size| Some(x).filter(|x| (0..size).contains(x))),
        ("mirror", "waves", |x, size| Some(x.rem_euclid(2 * size)).map(|x| x.min(2 * size - 1 - x))),
        ("useMetadata", "mirrored", |x, size| Some(x.rem_euclid(2 * size)).map(|x| x.min(2 * size - 1 - x))),
    ];
    for (channel, (output, (mode, name, wrap))) in (0..).zip(["r", "g", "b", "a"].iter().cycle().zip(modes)) {
        let channel = channel % 4;
        let own = wraps(mode).into_iter().chain([
            ("scale", ParamValue::Vec4([0.5, 0.25, 0.125, 2.0])),
            ("bias", ParamValue::Vec4([1.0, 2.0, 3.0, 4.0])),
        ]);
        let place = [
            ("scale", ParamValue::Vec2([2.0, 1.5])),
            ("rotation", ParamValue::Float(90.0)),
            ("translation", ParamValue::Vec2([0.25, -0.5])),
        ];
        let material = textured(name, output, &own.collect::<Vec<_>>(), &place);
        let built = build(&square(), &material, 200.0);
        let asset = asset(&built);
        assert_eq!(asset.triangles.len(), 2 * 200 * 200, "200 pieces an edge");
        let (scale, bias) = ([0.5, 0.25, 0.125, 2.0][channel as usize], [1.0, 2.0, 3.0, 4.0][channel as usize]);
        for (position, _, _) in corners(asset) {
            let (s, t) = (-1.5 * position.y + 0.25, 2.0 * position.x - 0.5);
            let height = scale * filtered(s, t, channel, wrap) + bias;
            assert!((position.z - height).abs() < 1e-5, "{mode}, {output}: {position} is not {height} high");
        }
    }
}

#[test]
fn displaced_normals_match_the_height_field() {
    // Slowly changing compared with the pieces.
    let material = textured("waves", "r", &wraps("clamp"), &[]);
    let built = build(&square(), &material, 512.0);
    let mut worst: f64 = 0.0;
    let mut sum = 0.0;
    let all = corners(asset(&built));
    for (position, normal, _) in &all {
        let clamp = |x: i64, size: i64| Some(x.clamp(0, size - 1));
        let height = |x: f64, y: f64| filtered(x, y, 0, clamp);
        let step = 1.0 / 1024.0;
        let slope = |dx: f64, dy: f64| {
            let (x, y) = (position.x, position.y);
            let ahead = [(x + dx).min(1.0), (y + dy).min(1.0)];
            let behind = [(x - dx).max(0.0), (y - dy).max(0.0)];
            (height(ahead[0], ahead[1]) - height(behind[0], behind[1])) / (ahead[0] - behind[0] + ahead[1] - behind[1])
        };
        let exact = DVec3::new(-slope(step, 0.0), -slope(0.0, step), 1.0).normalize();
        let angle = exact.dot(*normal).clamp(-1.0, 1.0).acos();
        // A bilinear filter bends at texels; at the sides a vertex has one triangle or two.
        let is_inside = position.truncate().cmpgt(glam::DVec2::ZERO) & position.truncate().cmplt(glam::DVec2::ONE);
        worst = worst.max(if is_inside.all() { angle } else { 0.0 });
        sum += angle;
    }
    let mean = sum / all.len() as f64;
    assert!(mean < 5e-4 && worst < 0.12, "off by {mean} on average, {worst} at worst (radians)");
}

#[test]
fn a_ball_grows_by_its_displacement() {
    // Normals equal positions: inside faces both are the same mean, so a point at p is moved to p + h p / |p|.
    let (rings, around) = (32_i32, 64_i32);
    let angle = |k: i32, of: i32| std::f32::consts::PI * k as f32 / of as f32;
    let point = |ring: i32, k: i32| {
        let (polar, azimuth) = (angle(ring, rings), 2.0 * angle(k % around, around));
        [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()]
    };
    let places = (0..=rings).flat_map(|ring| (0..around).map(move |k| (ring, k)));
    let points: Vec<[f32; 3]> = places.map(|(ring, k)| point(ring, k)).collect();
    let at = |ring: i32, k: i32| ring * around + k % around;
    let quads = (1..rings - 1).flat_map(|ring| (0..around).map(move |k| (ring, k)));
    let indices: Vec<i32> = quads.flat_map(|(r, k)| [at(r, k), at(r + 1, k), at(r + 1, k + 1), at(r, k + 1)]).collect();
    let desc = MeshDesc {
        double_sided: true,
        face_vertex_counts: TypedArray::of(vec![4_i32; indices.len() / 4]),
        face_vertex_indices: TypedArray::of(indices),
        normals: Some(primvar(Interpolation::Vertex, points.clone())),
        points: TypedArray::of(points),
        ..MeshDesc::default()
    };
    for amount in [0.25_f32, -0.5] {
        let built = build(&desc, &constant(amount), 40.0);
        for (position, normal, _) in corners(asset(&built)) {
            let radius = position.length() - f64::from(amount);
            // Facets of the undisplaced ball go down to the cosine of half a step, twice.
            assert!((0.996..1.000_001).contains(&radius), "{position} was not on the ball");
            assert!(normal.dot(position.normalize()) > 0.99, "{normal} is off by more than facets were");
        }
    }
}

#[test]
fn displaced_faces_stay_watertight_at_texture_and_normal_seams() {
    for subdivision in [Subdivision::None, Subdivision::Bilinear, Subdivision::CatmullClark] {
        let material = textured("waves", "r", &wraps("clamp"), &[]);
        let built = build(&cube(subdivision), &material, 13.7);
        let asset = asset(&built);
        assert!(asset.triangles.len() > 6 * 2 * 20 * 20, "{} triangles", asset.triangles.len());
        assert_eq!(open_edges(asset), 0, "{subdivision:?}: no gap");
        let edge = built.asset.as_ref().unwrap().triangles.iter().filter(|t| t.face == 0).count();
        assert!(edge * 6 == asset.triangles.len(), "each face has its own");
    }
    // A different rate at every edge.
    let dicing = DicingRate {
        pixels: 1.0,
        density: 1.0,
        focal: 30.0,
        eyes: vec![oocpt_core::mesh::CameraEye { position: DVec3::new(1.5, 2.0, 1.2), nearest: 0.1 }],
        ..DicingRate::default()
    };
    let heights = HeightCache::new(Some(Arc::new(Files)));
    let displacements = [Some(displacement(&textured("waves", "r", &wraps("clamp"), &[])))];
    let demand = BuildDemand {
        dicing: Some(&dicing),
        displacements: &displacements,
        heights: Some(&heights),
        ..BuildDemand::default()
    };
    let built = build_mesh_with(&cube(Subdivision::None), &demand, 1, u64::MAX, u64::MAX);
    assert_eq!(open_edges(asset(&built)), 0, "rates that differ from edge to edge");
}

#[test]
fn flat_shaded_faces_displace_outwards_and_edges_along_the_mean_normal() {
    for left_handed in [false, true] {
        let desc = MeshDesc { left_handed, ..cube(Subdivision::None) };
        let built = build(&desc, &constant(0.125), 5.0);
        let side = if left_handed { -0.125 } else { 0.125 };
        for (position, normal, _) in corners(asset(&built)) {
            let far = position.abs().max_element();
            let on_edge = position.abs().to_array().iter().filter(|v| (**v - far).abs() < 1e-6).count() > 1;
            let expected = match (on_edge, position.abs().min_element() > 1.0_f64.min(far) - 1e-6) {
                (false, _) => 1.0 + side,
                (true, false) => 1.0 + side / 2.0_f64.sqrt(),
                (true, true) => 1.0 + side / 3.0_f64.sqrt(),
            };
            assert!((far - expected).abs() < 1e-6, "{position}: {far} is not {expected}");
            assert!(normal.is_normalized(), "{normal}");
        }
    }
}

#[test]
fn subsets_are_displaced_by_their_own_material() {
    let subset = SubsetDesc { path: "/c/s".into(), material: None, faces: TypedArray::of(vec![1_i32, 1, 99]) };
    let desc = MeshDesc { subsets: vec![subset], ..cube(Subdivision::None) };
    // Face 1 is at z = 1.
    let built = build_by_slot(&desc, &[None, Some(displacement(&constant(3.0)))], 4.0);
    for triangle in &built.asset.as_ref().unwrap().triangles {
        let inside = triangle.vertices.iter().filter(|v| v[0].abs() < 0.9 && v[1].abs() < 0.9 && v[2] > 0.9);
        if triangle.face == 1 {
            inside.for_each(|v| assert!((v[2] - 4.0).abs() < 1e-6, "{v:?} is of the subset"));
        } else {
            triangle.vertices.iter().for_each(|v| assert!(v[2] < 2.5, "{v:?} is not"));
        }
    }
    assert_eq!(open_edges(built.asset.as_ref().unwrap()), 0, "no gap around the subset");
    assert_eq!(built.dropped.subset_faces, 1, "face 99 is counted once");
}

#[test]
fn polygons_that_are_not_convex_keep_their_area() {
    // An L of six corners, and a dart.
    for (points, area) in [
        (
            vec![
                [0.0_f32, 0.0, 0.0],
                [2.0, 0.0, 0.0],
                [2.0, 1.0, 0.0],
                [1.0, 1.0, 0.0],
                [1.0, 2.0, 0.0],
                [0.0, 2.0, 0.0],
            ],
            3.0,
        ),
        (vec![[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.5, 0.0], [-1.0, 2.0, 0.0]], 0.5),
    ] {
        let count = i32::try_from(points.len()).unwrap();
        let desc = MeshDesc {
            double_sided: true,
            face_vertex_counts: TypedArray::of(vec![count]),
            face_vertex_indices: TypedArray::of((0..count).collect::<Vec<i32>>()),
            points: TypedArray::of(points),
            ..MeshDesc::default()
        };
        let built = build(&desc, &constant(0.25), 7.0);
        let of = |[a, b, c]: [[f32; 3]; 3]| {
            let [a, b, c] = [a, b, c].map(|v| Vec3::from(v).as_dvec3());
            assert!([a.z, b.z, c.z].iter().all(|z| (z - 0.25).abs() < 1e-6), "moved");
            0.5 * (b - a).cross(c - a).z
        };
        let total: f64 = asset(&built).triangles.iter().map(|t| of(t.vertices)).sum();
        let positive = asset(&built).triangles.iter().all(|t| of(t.vertices) > 0.0);
        assert!((total - area).abs() < 1e-5 && positive, "{total} is not {area}");
    }
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let material = textured("waves", "r", &wraps("repeat"), &[]);
        // Several blocks of faces.
        let built = pool.install(|| build(&cube(Subdivision::CatmullClark), &material, 100.0));
        built.asset.unwrap()
    };
    let one = with(1);
    assert!(one.triangles.len() > 6 << 16, "{} triangles", one.triangles.len());
    for threads in [2, 5] {
        let other = with(threads);
        let bits = |asset: &MeshAsset| {
            let normals = asset.normals.as_ref().unwrap().values.as_flattened().iter().map(|v| v.to_bits()).collect();
            let corners = asset.triangles.iter().flat_map(|t| t.vertices).flatten().map(f32::to_bits).collect();
            [normals, corners] as [Vec<u32>; 2]
        };
        assert!(bits(&one) == bits(&other) && one.bvh == other.bvh, "{threads} threads");
    }
}
