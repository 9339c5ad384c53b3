// SPDX-License-Identifier: Apache-2.0
//! A mesh that is refined patch by patch is, bit for bit, what it is if it is refined at once.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::*;
use crate::array::TypedArray;
use crate::desc::{Interpolation, NamedPrimvar, Primvar, SubdivisionTags, SubsetDesc};
use crate::material::{Displacement, InputValue, PreviewDisplacement};
use crate::mesh::build::{ClusterLimits, build_mesh_into, build_patch_into};
use crate::mesh::{AnyAttribute, CameraEye, DicingRate, EdgeRates, MeshAsset, MeshPatch, WantedPrimvar};

/// The number that tests give the primvar `st`.
const ST: u32 = 7;

/// Numbers that are the same in every run.
struct Random(u64);

impl Random {
    fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }

    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    fn share(&mut self) -> f32 {
        self.below(1 << 20) as f32 / (1 << 20) as f32
    }
}

/// A bumpy grid of `side` squared quads. Some are cut into triangles, some pairs are hexagons; some edges have fins,
/// so that three faces meet there.
fn faces(side: u32, is_loop: bool, random: &mut Random) -> (Vec<i32>, Vec<i32>) {
    let point = |x: u32, y: u32| (y * (side + 1) + x).cast_signed();
    let (mut counts, mut corners) = (Vec::new(), Vec::new());
    let mut add = |face: &[i32]| {
        counts.push(i32::try_from(face.len()).unwrap());
        corners.extend_from_slice(face);
    };
    let mut fin = ((side + 1) * (side + 1)).cast_signed();
    for y in 0..side {
        let mut x = 0;
        while x < side {
            let [a, b, c, d] = [point(x, y), point(x + 1, y), point(x + 1, y + 1), point(x, y + 1)];
            match random.below(8) {
                kind if kind == 0 || is_loop => [[a, b, c], [a, c, d]].iter().for_each(|face| add(face)),
                1 if x + 1 < side => {
                    add(&[a, b, point(x + 2, y), point(x + 2, y + 1), c, d]);
                    x += 1;
                }
                2 if fin < i32::try_from((side + 1) * (side + 2)).unwrap() => {
                    add(&[a, b, c, d]);
                    add(&[b, a, fin]);
                    fin += 1;
                }
                _ => add(&[a, b, c, d]),
            }
            x += 1;
        }
    }
    (counts, corners)
}

/// Such a grid with creases, sharp corners, holes, texture coordinates with a seam, a color for each face, two subsets.
fn mesh(side: u32, subdivision: Subdivision, random: &mut Random) -> MeshDesc {
    let (counts, corners) = faces(side, subdivision == Subdivision::Loop, random);
    let points = (side + 1) * (side + 2);
    #[expect(clippy::cast_precision_loss, reason = "small numbers")]
    let place = |at: u32| {
        let (x, y) = ((at % (side + 1)) as f32, (at / (side + 1)) as f32);
        if at < (side + 1) * (side + 1) { [x, y, 0.7 * random.share()] } else { [x, x, 1.5 + random.share()] }
    };
    let points: Vec<[f32; 3]> = (0..points).map(place).collect();
    let st: Vec<[f32; 2]> = corners.iter().map(|at| points[*at as usize]).map(|p| [p[0] / 9.0, p[1] / 9.0]).collect();
    let count = counts.len();
    let colors: Vec<[f32; 3]> = (0..count).map(|_| [random.share(), 0.5, 0.5]).collect();
    let mut some = |end: usize, of: usize| -> Vec<i32> {
        (0..of).map(|_| i32::try_from(random.below(end as u64)).unwrap()).collect()
    };
    let creases: Vec<i32> = some(corners.len() - 1, count / 8)
        .iter()
        .flat_map(|&at| {
            let at = at as usize;
            if corners[at] == corners[at + 1] { [corners[0], corners[1]] } else { [corners[at], corners[at + 1]] }
        })
        .collect();
    let values = |values, interpolation| Primvar { interpolation, values, indices: None };
    MeshDesc {
        subdivision,
        subdivision_tags: SubdivisionTags {
            crease_lengths: Some(TypedArray::of(vec![2_i32; creases.len() / 2])),
            crease_sharpnesses: Some(TypedArray::of(
                (0..creases.len() / 2).map(|k| [0.5, 2.0, 10.0][k % 3]).collect::<Vec<f32>>(),
            )),
            crease_indices: Some(TypedArray::of(creases)),
            corner_sharpnesses: Some(TypedArray::of(vec![3.0_f32; 5])),
            corner_indices: Some(TypedArray::of(some(points.len(), 5))),
            ..SubdivisionTags::default()
        },
        hole_indices: Some(TypedArray::of(some(count, count / 20))),
        subsets: (0..2)
            .map(|_| SubsetDesc { path: "/s".into(), material: None, faces: TypedArray::of(some(count, count / 3)) })
            .collect(),
        face_vertex_counts: TypedArray::of(counts),
        face_vertex_indices: TypedArray::of::<i32>(corners),
        points: TypedArray::of(points),
        display_color: Some(values(TypedArray::of(colors), Interpolation::Uniform)),
        primvars: vec![NamedPrimvar {
            name: "st".into(),
            primvar: values(TypedArray::of(st), Interpolation::FaceVarying),
        }],
        ..MeshDesc::default()
    }
}

/// All that a triangle is seen by: face, corners, normals, coordinates, subset, as bits.
type SeenTriangle = (u32, Vec<u32>, u16);

fn triangles(asset: &MeshAsset) -> Vec<SeenTriangle> {
    let bits = |floats: &[f32]| floats.iter().map(|float| float.to_bits()).collect::<Vec<u32>>();
    let normals = asset.normals.as_ref().expect("normals");
    let st = match &asset.primvars[0].values {
        AnyAttribute::Two(st) => st,
        other => panic!("texture coordinates: {other:?}"),
    };
    let colors = asset.colors.as_ref().expect("colors");
    let seen = |(at, triangle): (usize, &super::super::Triangle)| {
        let mut all = bits(triangle.vertices.as_flattened());
        for corner in asset.corner_indices[at] {
            all.extend(bits(&normals.values[corner as usize]));
            all.extend(bits(&st.values[corner as usize]));
        }
        all.extend(bits(&colors.values[at]));
        (triangle.face, all, asset.subsets[at])
    };
    asset.triangles.iter().enumerate().map(seen).collect()
}

const LIMITS: ClusterLimits = ClusterLimits { limit_bytes: u64::MAX, cluster_bytes: u64::MAX, at_once: 1 };

/// What is made of `desc` as a whole mesh, sorted.
fn built_at_once(desc: &MeshDesc, demand: &BuildDemand<'_>) -> Vec<SeenTriangle> {
    let built = build_mesh_into(desc, demand, 0, LIMITS, (None, &mut |_| panic!("nothing is split")));
    let mut seen = triangles(&built.asset.expect("triangles"));
    seen.sort();
    seen
}

/// A number of pieces that depends on the ends of an edge alone.
fn random_pieces(a: DVec3, b: DVec3) -> u16 {
    let bits = (a + b).to_array().map(f64::to_bits);
    let mixed = bits.iter().fold(1_u64, |sum, bits| (sum ^ bits).wrapping_mul(0x9E37_79B9_7F4A_7C15).rotate_left(29));
    [1, 2, 3, 5, 1, 8][(mixed >> 13) as usize % 6]
}

/// What is made of `desc` in so many parts, sorted.
fn built(
    desc: &MeshDesc,
    demand: &BuildDemand<'_>,
    parts: usize,
    pieces: impl Fn(DVec3, DVec3) -> u16,
) -> Vec<SeenTriangle> {
    let all = Arc::new(MeshPatches::in_parts(desc, demand, parts).expect("patches"));
    assert_eq!(all.patches.len(), parts);
    let wanted: Vec<Vec<u16>> = (0..parts).map(|patch| all.own_edges(desc, patch, &pieces)).collect();
    let rates = all.rates(&wanted);
    let mut seen = Vec::new();
    for number in 0..parts {
        let patch = MeshPatch::new(&all, number, demand.displaces(desc), &rates);
        let built = build_patch_into((desc, &patch), demand, 0, LIMITS, &mut |_| panic!("nothing is split"));
        assert_eq!(built.dropped.unrefined_meshes, 0);
        let asset = built.asset.expect("triangles");
        asset.bvh.validate(&asset.triangles, asset.kind).expect("a tree");
        let used = asset.corner_indices.as_flattened().iter().max().expect("corners");
        assert_eq!(asset.normals.as_ref().expect("normals").values.len(), *used as usize + 1, "no values of the rings");
        seen.extend(triangles(&asset));
    }
    seen.sort();
    seen
}

/// Open edges of triangles, by the bits of their ends, that are not edges of the control mesh which are open too.
fn cracks(desc: &MeshDesc, seen: &[SeenTriangle]) -> usize {
    let mut uses: BTreeMap<[[u32; 3]; 2], (usize, u32)> = BTreeMap::new();
    for (face, bits, _) in seen {
        let corners: Vec<[u32; 3]> = bits[..9].as_chunks::<3>().0.to_vec();
        for k in 0..3 {
            let mut ends = [corners[k], corners[(k + 1) % 3]];
            ends.sort_unstable();
            let slot = uses.entry(ends).or_insert((0, *face));
            slot.0 += 1;
        }
    }
    // Faces with an edge that no other face that is drawn has.
    let holes: Vec<i32> = desc.hole_indices.iter().flat_map(|h| (0..h.len()).filter_map(|at| h.index(at))).collect();
    let firsts = firsts(desc).expect("faces");
    let mut around: BTreeMap<[i32; 2], Vec<u32>> = BTreeMap::new();
    for (face, range) in (0_u32..).zip(firsts.windows(2)) {
        let points: Vec<i32> =
            (range[0]..range[1]).filter_map(|at| desc.face_vertex_indices.index(at as usize)).collect();
        for k in 0..points.len() {
            let mut ends = [points[k], points[(k + 1) % points.len()]];
            ends.sort_unstable();
            if !holes.contains(&face.cast_signed()) {
                around.entry(ends).or_default().push(face);
            }
        }
    }
    let open: std::collections::BTreeSet<u32> = around.values().filter(|f| f.len() == 1).map(|f| f[0]).collect();
    uses.values().filter(|(uses, face)| *uses == 1 && !open.contains(face)).count()
}

fn displaced() -> Vec<Option<Arc<Displacement>>> {
    let amount = InputValue::Primvar { slot: 0, fallback: [0.0; 4] };
    let by_primvar = PreviewDisplacement { amount, texture: None, uv: None, primvar: Some("height".into()) };
    let constant =
        PreviewDisplacement { amount: InputValue::Constant([0.3; 4]), texture: None, uv: None, primvar: None };
    let all = [Some(by_primvar), None, Some(constant)];
    all.into_iter().map(|preview| preview.map(|preview| Arc::new(Displacement::Preview(preview)))).collect()
}

fn is_the_same_in_patches(subdivision: Subdivision, displacements: &[Option<Arc<Displacement>>], seed: u64) {
    let mut random = Random(seed);
    let mut desc = mesh(24, subdivision, &mut random);
    let heights: Vec<f32> = (0..desc.points.len()).map(|_| random.share()).collect();
    let values = TypedArray::of(heights);
    let primvar = Primvar { interpolation: Interpolation::Vertex, values, indices: None };
    desc.primvars.push(NamedPrimvar { name: "height".into(), primvar });
    let wanted = [WantedPrimvar { name: "st".into(), id: ST }];
    let dicing = DicingRate { pixels: 1.0, ..DicingRate::default() };
    let demand = BuildDemand { wanted: &wanted, dicing: Some(&dicing), displacements, ..BuildDemand::default() };
    let whole = built(&desc, &demand, 1, random_pieces);
    assert!(whole.len() > 5000, "{} triangles", whole.len());
    assert_eq!(cracks(&desc, &whole), 0, "cracks of a mesh that is refined at once, seed {seed}");
    for parts in [2, 9, 23] {
        let patched = built(&desc, &demand, parts, random_pieces);
        assert_eq!(cracks(&desc, &patched), 0, "cracks in {parts} parts, {subdivision:?}, seed {seed}");
        assert!(patched == whole, "{parts} parts are other triangles, {subdivision:?}, seed {seed}");
    }
}

/// A mesh that was never taken apart. Flat faces of six corners are cut with other diagonals.
fn is_the_same_at_once(subdivision: Subdivision, displacements: &[Option<Arc<Displacement>>], seed: u64) {
    let desc = mesh(24, subdivision, &mut Random(seed));
    let wanted = [WantedPrimvar { name: "st".into(), id: ST }];
    let eye = CameraEye { position: DVec3::new(5.0, 3.0, 4.0), nearest: 0.1 };
    let dicing = DicingRate { pixels: 1.0, density: 1.0, focal: 6.0, eyes: vec![eye], ..DicingRate::default() };
    let demand = BuildDemand { wanted: &wanted, dicing: Some(&dicing), displacements, ..BuildDemand::default() };
    let edges = EdgeRates::new(&desc, &dicing, demand.displaces(&desc));
    let whole = built_at_once(&desc, &demand);
    let patched = built(&desc, &demand, 7, |a, b| u16::try_from(edges.pieces(a, b)).unwrap());
    // Borders of blocks would be elsewhere.
    assert!((3000..1 << 14).contains(&whole.len()), "{} triangles", whole.len());
    assert!(whole == patched, "patches are other triangles, {subdivision:?}, seed {seed}");
}

#[test]
fn patches_are_what_a_whole_mesh_is_made_to() {
    for seed in 11..14 {
        is_the_same_at_once(Subdivision::CatmullClark, &[], seed);
        is_the_same_at_once(Subdivision::Loop, &[], seed);
        is_the_same_at_once(Subdivision::CatmullClark, &displaced(), seed);
    }
}

#[test]
fn patches_of_subdivision_surfaces_are_the_whole() {
    for seed in 1..5 {
        is_the_same_in_patches(Subdivision::CatmullClark, &[], seed);
        is_the_same_in_patches(Subdivision::Loop, &[], seed);
    }
}

#[test]
fn patches_of_displaced_surfaces_are_the_whole() {
    for seed in 5..8 {
        is_the_same_in_patches(Subdivision::CatmullClark, &displaced(), seed);
        is_the_same_in_patches(Subdivision::None, &displaced(), seed);
    }
}
