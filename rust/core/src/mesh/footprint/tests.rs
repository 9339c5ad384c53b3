// SPDX-License-Identifier: Apache-2.0
//! Compares footprints with the memory that building really takes: the growth of a process that builds one mesh and
//! nothing else.

use crate::array::TypedArray;
use crate::desc::{
    CurveBasis, CurveWrap, CurvesDesc, Interpolation, MeshDesc, NamedPrimvar, PointsSample, PrimShape, Primvar,
    Subdivision,
};
use crate::material::{Cutout, Displacement, InputValue, PreviewDisplacement};
use crate::mesh::build::{ClusterLimits, build_mesh_into, build_patch_into};
use crate::mesh::{BuildDemand, BuildFootprint, CutoutCover, DicingRate, MeshPatch, MeshPatches, WantedPrimvar};
use std::process::Command;
use std::sync::Arc;

/// Environment variable that names the case to the child process.
const CASE: &str = "OOCPT_TEST_FOOTPRINT";
/// Bytes by which a process grows besides: stacks of its threads, overhead of the heap.
const SLACK: u64 = 4 << 20;

/// A mesh, its limits for splitting, and the number of clusters made in parallel.
struct Case {
    name: &'static str,
    desc: fn() -> MeshDesc,
    limit: u64,
    at_once: usize,
    /// True if it is cut out by a primvar.
    is_cut: bool,
    /// Pieces of every edge of a displaced patch of it; 0: all of the mesh.
    patch: u16,
}

const WHOLE: u64 = u64::MAX;
const SPLIT: u64 = 32 << 20;

const CASES: &[Case] = &[
    Case { name: "quads", desc: || grid(400), limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "quads with values", desc: dressed, limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "triangles", desc: triangles, limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "split", desc: || grid(1000), limit: SPLIT, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "split, four at once", desc: || grid(1000), limit: SPLIT, at_once: 4, is_cut: false, patch: 0 },
    Case { name: "just not split", desc: || grid(480), limit: SPLIT, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "moving", desc: moving, limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "cut out", desc: dressed, limit: WHOLE, at_once: 1, is_cut: true, patch: 0 },
    Case { name: "cut out, split", desc: || with_st(grid(1000)), limit: SPLIT, at_once: 1, is_cut: true, patch: 0 },
    Case { name: "subdivided", desc: || surface(64, 3), limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "subdivided coarsely", desc: || surface(300, 0), limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "patch", desc: || surface(64, 0), limit: WHOLE, at_once: 1, is_cut: false, patch: 12 },
    Case { name: "patch, cut out", desc: || surface(64, 0), limit: WHOLE, at_once: 1, is_cut: true, patch: 8 },
    Case { name: "points", desc: points, limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "points, split", desc: points, limit: SPLIT / 8, at_once: 2, is_cut: false, patch: 0 },
    Case { name: "curves", desc: || curves(CurveBasis::BSpline), limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
    Case { name: "lines", desc: || curves(CurveBasis::Linear), limit: WHOLE, at_once: 1, is_cut: false, patch: 0 },
];

/// A wavy square of `side` squared quads.
fn grid(side: u16) -> MeshDesc {
    let points = i32::from(side) + 1;
    let quad = |k: i32| {
        let at = k / i32::from(side) * points + k % i32::from(side);
        [at, at + 1, at + 1 + points, at + points]
    };
    let place = |k: i32| {
        #[expect(clippy::cast_precision_loss, reason = "small numbers")]
        let [x, y] = [k % points, k / points].map(|v| v as f32);
        [x, y, (0.3 * x).sin() * (0.2 * y).cos()]
    };
    let quads = i32::from(side) * i32::from(side);
    MeshDesc {
        face_vertex_counts: TypedArray::of(vec![4_i32; usize::from(side) * usize::from(side)]),
        face_vertex_indices: TypedArray::of::<i32>((0..quads).flat_map(quad).collect()),
        points: TypedArray::of::<[f32; 3]>((0..points * points).map(place).collect()),
        ..MeshDesc::default()
    }
}

fn primvar<T: crate::array::ArrayElement + std::fmt::Debug>(interpolation: Interpolation, values: Vec<T>) -> Primvar {
    Primvar { interpolation, values: TypedArray::of(values), indices: None }
}

fn dressed() -> MeshDesc {
    let mut desc = with_st(grid(400));
    let (points, corners) = (desc.points.len(), desc.face_vertex_indices.len());
    desc.normals = Some(primvar(Interpolation::FaceVarying, vec![[0.0_f32, 0.0, 1.0]; corners]));
    desc.display_color = Some(primvar(Interpolation::Vertex, vec![[0.5_f32; 3]; points]));
    desc
}

fn with_st(mut desc: MeshDesc) -> MeshDesc {
    let corners = desc.face_vertex_indices.len();
    let values = primvar(Interpolation::FaceVarying, vec![[0.25_f32; 2]; corners]);
    desc.primvars = vec![NamedPrimvar { name: "st".into(), primvar: values }];
    desc
}

fn triangles() -> MeshDesc {
    let quads = grid(400);
    let view = quads.face_vertex_indices.view();
    let corners: Vec<i32> = (0..view.len()).filter_map(|at| view.index(at)).collect();
    let split = |quad: &[i32; 4]| [quad[0], quad[1], quad[2], quad[0], quad[2], quad[3]];
    let corners: Vec<i32> = corners.as_chunks::<4>().0.iter().flat_map(split).collect();
    let counts = TypedArray::of(vec![3_i32; corners.len() / 3]);
    MeshDesc { face_vertex_counts: counts, face_vertex_indices: TypedArray::of(corners), ..quads }
}

fn moving() -> MeshDesc {
    let mut desc = grid(300);
    desc.subdivision = Subdivision::CatmullClark;
    let view = desc.points.view();
    let moved = |by: f32| {
        let places = (0..view.len()).filter_map(|at| view.vec3(at)).map(|p| p.as_vec3().to_array());
        places.map(move |place| place.map(|v| v + by))
    };
    let samples: Vec<PointsSample> = [0.0_f32, 0.5, 1.0]
        .map(|time| {
            let points = TypedArray::of::<[f32; 3]>(moved(time).collect());
            PointsSample { time: f64::from(time), points, normals: None, widths: None }
        })
        .into();
    desc.point_motion.samples = samples;
    desc
}

fn surface(side: u16, refine_level: u8) -> MeshDesc {
    with_st(MeshDesc { subdivision: Subdivision::CatmullClark, refine_level, ..grid(side) })
}

fn points() -> MeshDesc {
    let widths = Some(primvar(Interpolation::Constant, vec![0.5_f32]));
    let none = || TypedArray::of(Vec::<i32>::new());
    MeshDesc { shape: PrimShape::Points, widths, face_vertex_counts: none(), face_vertex_indices: none(), ..grid(700) }
}

fn curves(basis: CurveBasis) -> MeshDesc {
    let desc = points();
    let count = desc.points.len() / 8 / 20;
    let counts = TypedArray::of(vec![20_i32; count]);
    let wrap = CurveWrap::Nonperiodic;
    MeshDesc { shape: PrimShape::Curves(CurvesDesc { basis, wrap, counts, indices: None }), ..desc }
}

/// A number of `/proc/self/status`, bytes.
fn status(key: &str) -> u64 {
    let text = std::fs::read_to_string("/proc/self/status").expect("read");
    let line = text.lines().find_map(|line| line.strip_prefix(key)).expect("there is one");
    line.trim().trim_end_matches(" kB").parse::<u64>().expect("a number") << 10
}

/// The first patch of a mesh.
fn patch(desc: &MeshDesc, demand: &BuildDemand<'_>, pieces: u16) -> MeshPatch {
    let all = Arc::new(MeshPatches::of(desc, demand).expect("patches"));
    let wanted: Vec<Vec<u16>> = (0..all.patches.len()).map(|patch| all.own_edges(desc, patch, |_, _| pieces)).collect();
    MeshPatch::new(&all, 0, true, &all.rates(&wanted))
}

/// Builds one case; prints the growth of the process and the footprint.
fn child(case: &Case) {
    let desc = (case.desc)();
    let wanted = [WantedPrimvar { name: "st".into(), id: 7 }];
    let dicing = DicingRate::default();
    let cutout = Arc::new(Cutout::Primvar { name: "st".into(), threshold: 0.1 });
    let covers = [Some(CutoutCover { cutout, image: None }).filter(|_| case.is_cut)];
    let amount = InputValue::Constant([0.1; 4]);
    let preview = PreviewDisplacement { amount, texture: None, uv: None, primvar: None };
    let displaced = [Some(Arc::new(Displacement::Preview(preview)))];
    let displacements = if case.patch > 0 { &displaced[..] } else { &[] };
    let demand = BuildDemand { wanted: &wanted, dicing: Some(&dicing), covers: &covers, displacements, heights: None };
    let cluster_bytes = 8 << 20;
    let patch = (case.patch > 0).then(|| patch(&desc, &demand, case.patch));
    let footprint = match &patch {
        Some(patch) => BuildFootprint::of_patch(&desc, &demand, patch, [case.limit, cluster_bytes]),
        None => BuildFootprint::of(&desc, &demand, case.limit, cluster_bytes),
    };
    let (at_once, foretold) = footprint.within(u64::MAX, case.at_once);
    // Resets the maximum of the memory held.
    std::fs::write("/proc/self/clear_refs", "5").expect("written");
    let before = status("VmRSS:");
    let cuts = ClusterLimits { limit_bytes: case.limit, cluster_bytes, at_once };
    let mut clusters = 0;
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().expect("threads");
    let mut put = |_| clusters += 1;
    let built = pool.install(|| match &patch {
        Some(patch) => build_patch_into((&desc, patch), &demand, 1, cuts, &mut put),
        None => build_mesh_into(&desc, &demand, 1, cuts, (None, &mut put)),
    });
    let took = status("VmHWM:").saturating_sub(before);
    assert_eq!(built.asset.is_none(), clusters > 0, "{}", case.name);
    println!("{took} {foretold} {}", built.dropped.coarse_meshes);
}

#[test]
fn building_takes_no_more_than_was_foretold() {
    if let Ok(case) = std::env::var(CASE) {
        return child(&CASES[case.parse::<usize>().expect("a number")]);
    }
    let mib = |bytes: u64| bytes >> 20;
    let mut wrong = Vec::new();
    for (number, case) in CASES.iter().enumerate() {
        let name = "mesh::footprint::tests::building_takes_no_more_than_was_foretold";
        let child = Command::new(std::env::current_exe().expect("a path"))
            .args([name, "--exact", "--nocapture"])
            .env(CASE, number.to_string())
            .output()
            .expect("started");
        let text = String::from_utf8_lossy(&child.stdout).into_owned();
        let numbers = text.lines().find_map(|line| {
            let all: Vec<u64> = line.split(' ').filter_map(|word| word.parse().ok()).collect();
            <[u64; 3]>::try_from(all).ok()
        });
        let [took, foretold, coarse] = numbers.unwrap_or_else(|| panic!("{}: {text}{child:?}", case.name));
        println!("{}: took {} MiB, foretold {} MiB", case.name, mib(took), mib(foretold));
        assert_eq!(coarse, 0, "{}", case.name);
        if took > foretold + SLACK || foretold > 3 * took {
            wrong.push((case.name, mib(took), mib(foretold)));
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}

#[test]
fn hostile_sizes_do_not_overflow() {
    let counts = [i32::MAX, -1, 4, 0, i32::MIN, 1];
    let desc = |shape: PrimShape| MeshDesc {
        shape,
        subdivision: Subdivision::CatmullClark,
        refine_level: u8::MAX,
        face_vertex_counts: TypedArray::of(counts.to_vec()),
        face_vertex_indices: TypedArray::of(vec![i32::MAX, i32::MIN, 0, 1, 2, 3]),
        points: TypedArray::of(vec![[f32::NAN; 3], [f32::MAX; 3], [-f32::MAX; 3], [f32::INFINITY; 3]]),
        ..MeshDesc::default()
    };
    let curves = |basis| {
        let counts = TypedArray::of(counts.to_vec());
        PrimShape::Curves(CurvesDesc { basis, wrap: CurveWrap::Periodic, counts, indices: None })
    };
    let near = DicingRate { pixels: 1e-30, density: f64::MAX, ..DicingRate::default() };
    let shapes = [PrimShape::Mesh, PrimShape::Points, curves(CurveBasis::Linear), curves(CurveBasis::CatmullRom)];
    for desc in shapes.map(desc) {
        for dicing in [None, Some(&near)] {
            for (limit, cluster) in [(0, 0), (1, 1), (u64::MAX, u64::MAX)] {
                let demand = BuildDemand { dicing, ..BuildDemand::default() };
                let footprint = BuildFootprint::of(&desc, &demand, limit, cluster);
                assert!(footprint.least() < 1 << 40, "a few points: {footprint:?}");
                assert!(footprint.within(0, usize::MAX).0 == 1, "at least one");
            }
        }
    }
}
