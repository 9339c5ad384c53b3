// SPDX-License-Identifier: Apache-2.0
//! Boxes of meshes that are cut out: around what is there, in trees, clusters, at all keys, by slot; edits and files.

use std::sync::{Arc, Mutex};

use oocpt_abi::NodeChild;
use oocpt_core::mesh::MeshFiles;
use oocpt_core::scene::{PointsMotion, PointsSample};
use oocpt_core::texture::{HeightFiles, HeightImage, TextureRef, TileLayout};
use oocpt_core::{
    Aabb, Interpolation, MaterialDesc, MeshAsset, MeshDesc, NamedPrimvar, ParamValue, PartitionOptions, Primvar,
    SceneDb, Snapshot, TypedArray, Wrap,
};

use crate::material::preview_surface::{file, network, node, text};
use crate::mesh::store;
use crate::scene::bindings::bind;
use crate::support::{asset, committed, grid, polygons, primvar};

/// What is there of an image, in places from 0 to 1.
type Shape = fn(f32, f32) -> bool;

#[derive(Debug)]
struct Picture(Shape);

const SIDE: u16 = 64;

impl HeightImage for Picture {
    fn layout(&self) -> TileLayout {
        TileLayout::new([SIDE.into(); 2], 4).expect("a layout")
    }

    fn wrap(&self) -> Option<[Wrap; 2]> {
        None
    }

    fn channel(&self, level: u32, channel: u8) -> Result<Vec<f32>, String> {
        assert_eq!((level, channel), (0, 3), "the alpha of the finest level");
        let at = |i: u16| (f32::from(i) + 0.5) / f32::from(SIDE);
        let all = (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| [at(x), at(y)]));
        Ok(all.map(|[s, t]| if (self.0)(s, t) { 1.0 } else { 0.3 }).collect())
    }
}

/// The quarter at the origin, by name; other files may be set.
#[derive(Debug, Default)]
struct Files {
    replaced: Mutex<Option<Shape>>,
    opened: Mutex<Vec<String>>,
}

fn quarter(s: f32, t: f32) -> bool {
    s < 0.5 && t < 0.5
}

impl HeightFiles for Files {
    fn open(&self, texture: &TextureRef, _: u32) -> Result<Option<Arc<dyn HeightImage>>, String> {
        let name = &*texture.asset.resolved;
        self.opened.lock().expect("not poisoned").push(name.to_owned());
        let replaced = *self.replaced.lock().expect("not poisoned");
        let shape: Shape = match name {
            "quarter" => replaced.unwrap_or(quarter),
            "left" => |s, _| s < 0.25,
            "nothing" => |_, _| false,
            "all" => |_, _| true,
            _ => return Err("is damaged".into()),
        };
        Ok(Some(Arc::new(Picture(shape))))
    }
}

/// Cut out by a texture.
fn textured(path: &str, name: &str, own: &[(&str, ParamValue)]) -> MaterialDesc {
    wrapped(path, name, "clamp", own)
}

fn wrapped(path: &str, name: &str, wrap: &str, own: &[(&str, ParamValue)]) -> MaterialDesc {
    let wrap = [("wrapS", text(wrap)), ("wrapT", text(wrap)), ("file", file(name))];
    let nodes = vec![
        node("UsdPreviewSurface", own, &[("opacity", 1, "a")]),
        node("UsdUVTexture", &wrap, &[("st", 2, "result")]),
        node("UsdPrimvarReader_float2", &[("varname", text("st"))], &[]),
    ];
    network(path, nodes)
}

fn threshold(value: f32) -> (&'static str, ParamValue) {
    ("opacityThreshold", ParamValue::Float(value))
}

/// Cut out by a primvar.
fn by_primvar(path: &str, own: &[(&str, ParamValue)]) -> MaterialDesc {
    let reader = node("UsdPrimvarReader_float", &[("varname", text("cut"))], &[]);
    network(path, vec![node("UsdPreviewSurface", own, &[("opacity", 1, "result")]), reader])
}

fn with(mut desc: MeshDesc, name: &str, primvar: Primvar) -> MeshDesc {
    desc.primvars.push(NamedPrimvar { name: name.into(), primvar });
    desc
}

/// A square of 2 x 2 at z = 1; st from 0 to 1.
fn card(path: &str) -> MeshDesc {
    let points = [[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 2.0, 1.0], [0.0, 2.0, 1.0]];
    let desc = bind(polygons(path, &[4], &[0, 1, 2, 3], &points), "/m", &[]);
    with(desc, "st", primvar(Interpolation::Vertex, vec![[0.0_f32, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]))
}

fn database(files: &Arc<Files>, material: MaterialDesc) -> SceneDb {
    let mut db = SceneDb::new();
    db.set_height_files(files.clone());
    db.upsert_material(material);
    db
}

fn built(desc: MeshDesc, material: MaterialDesc) -> Arc<MeshAsset> {
    let mut db = database(&Arc::default(), material);
    db.upsert_mesh(desc);
    asset(&committed(&mut db).meshes[0])
}

/// What is there lies in the box, which is hardly larger.
fn is_around(mesh: &MeshAsset, low: [f32; 3], high: [f32; 3]) {
    let Aabb { min, max } = mesh.bounds;
    for k in 0..3 {
        let off = [low[k] - min[k], max[k] - high[k]];
        assert!(off.iter().all(|off| (0.0..0.06).contains(off)), "{low:?} {high:?}: {:?}", mesh.bounds);
    }
    assert!(mesh.is_clipped);
}

fn is_whole(mesh: &MeshAsset) {
    assert!(!mesh.is_clipped && mesh.bounds == mesh.whole, "{:?}", mesh.bounds);
}

#[test]
fn the_box_of_a_card_is_that_of_its_leaf() {
    let presence = ("opacityMode", text("presence"));
    let mesh = built(card("/a"), textured("/m", "quarter", &[threshold(0.5)]));
    is_around(&mesh, [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]);
    assert_eq!(mesh.whole, Aabb { min: [0.0, 0.0, 1.0], max: [2.0, 2.0, 1.0] });
    assert_eq!(mesh.triangles.len(), 2);
    // Where it repeats, lookups at its edges mix with the other side.
    assert_eq!(built(card("/a"), wrapped("/m", "quarter", "repeat", &[threshold(0.5)])).bounds, mesh.whole);
    for (name, own) in [
        ("all", vec![threshold(0.5)]),
        ("gone", vec![threshold(0.5)]),
        ("quarter", vec![threshold(0.2)]),
        ("quarter", vec![presence.clone()]),
        ("quarter", vec![]),
        ("nothing", vec![threshold(0.5)]),
        ("quarter", vec![threshold(0.5), ("emissiveColor", ParamValue::Vec3([1.0; 3]))]),
    ] {
        is_whole(&built(card("/a"), textured("/m", name, &own)));
    }
    for (own, values) in [([threshold(0.5)], [1.0_f32, 0.0, 0.0, 1.0]), ([presence], [1.0, -1.0, -1.0, 1.0])] {
        let desc = with(card("/a"), "cut", primvar(Interpolation::Vertex, values.to_vec()));
        is_around(&built(desc, by_primvar("/m", &own)), [0.0, 0.0, 1.0], [1.0, 2.0, 1.0]);
    }
    for (interpolation, values) in [(Interpolation::Constant, vec![0.7_f32]), (Interpolation::Uniform, vec![0.7])] {
        let mesh = built(with(card("/a"), "cut", primvar(interpolation, values)), by_primvar("/m", &[threshold(0.5)]));
        assert_eq!((mesh.bounds, mesh.triangles.len()), (mesh.whole, 2), "all of it is there");
    }
    let corners = primvar(Interpolation::FaceVarying, vec![0.0_f32, 0.0, 1.0, 1.0]);
    is_around(
        &built(with(card("/a"), "cut", corners), by_primvar("/m", &[threshold(0.5)])),
        [0.0, 1.0, 1.0],
        [2.0, 2.0, 1.0],
    );
}

#[test]
fn triangles_of_which_nothing_is_there_are_in_no_tree() {
    let count = 12_u16;
    let desc = grid("/a", count);
    let (side, faces) = (usize::from(count), usize::from(count) * usize::from(count));
    let cut: Vec<f32> = (0..faces).map(|face| if face % side < 3 || face == faces - 1 { 1.0 } else { 0.0 }).collect();
    let desc = bind(with(desc, "cut", primvar(Interpolation::Uniform, cut)), "/m", &[]);
    let mesh = built(desc.clone(), by_primvar("/m", &[threshold(0.5)]));
    let mut numbers: Vec<u32> = mesh.triangles.iter().map(|triangle| triangle.face).collect();
    numbers.sort_unstable();
    let is_there = |face: &u16| face % count < 3 || *face == count * count - 1;
    let expected: Vec<u32> = (0..count * count).filter(is_there).flat_map(|face| [u32::from(face); 2]).collect();
    assert_eq!(numbers, expected, "faces keep their numbers");
    assert!(mesh.is_clipped && mesh.whole == mesh.bounds);
}

/// What is there of triangles lies in the boxes of the leaves that have them.
fn holds_what_is_there(mesh: &MeshAsset, is_there: impl Fn([f32; 2]) -> bool) -> usize {
    let st = match &mesh.primvars[0].values {
        oocpt_core::AnyAttribute::Two(st) => st,
        other => panic!("{other:?}"),
    };
    let mut seen = 0;
    for node in &mesh.bvh.nodes {
        for child in 0..4 {
            let NodeChild::Leaf { first, count } = node.child(child) else { continue };
            for triangle in first as usize..(first + count) as usize {
                let places = mesh.corner_indices[triangle].map(|point| st.values[point as usize]);
                let keys = std::iter::once(&mesh.triangles[triangle].vertices)
                    .chain(mesh.keys.vertices.iter().skip(triangle).step_by(mesh.triangles.len()));
                for vertices in keys {
                    for (u, v) in (0..=20_u16).flat_map(|u| (0..=20 - u).map(move |v| (u, v))) {
                        let weights = [20 - u - v, u, v].map(|weight| f32::from(weight) / 20.0);
                        let mix = |of: &dyn Fn(usize) -> f32| (0..3).map(|i| weights[i] * of(i)).sum::<f32>();
                        if !is_there([0, 1].map(|k| mix(&|i| places[i][k]))) {
                            continue;
                        }
                        seen += 1;
                        for (axis, at) in [0, 1, 2].map(|axis| mix(&|i| vertices[i][axis])).into_iter().enumerate() {
                            let at = f64::from(at);
                            let [low, high] = node.planes(child as usize, axis);
                            assert!(low - 1e-6 <= at && at <= high + 1e-6, "{at} of {low} to {high}");
                        }
                    }
                }
            }
        }
    }
    seen
}

/// Coordinates that go twice around the image over a wavy grid, with its points at two times.
fn waving(path: &str, count: u16) -> MeshDesc {
    let desc = bind(grid(path, count), "/m", &[]);
    let view = desc.points.view();
    let points: Vec<[f32; 3]> =
        (0..view.len()).filter_map(|at| view.vec3(at)).map(|p| p.as_vec3().to_array()).collect();
    let st = points.iter().map(|[x, y, _]| [2.0 * x, 2.0 * y + 0.1 * x]).collect();
    let moved = points.iter().map(|[x, y, z]| [x + 0.3, y + 0.2 * z, z + 0.5 * x]).collect();
    let sample = |(time, points): (f64, Vec<[f32; 3]>)| PointsSample {
        time,
        points: TypedArray::of(points),
        normals: None,
        widths: None,
    };
    let samples = [(0.0, points.clone()), (1.0, moved)].into_iter().map(sample).collect();
    let point_motion = PointsMotion { samples, ..PointsMotion::default() };
    with(MeshDesc { point_motion, ..desc }, "st", primvar(Interpolation::Vertex, st))
}

fn is_in_quarter([s, t]: [f32; 2]) -> bool {
    quarter(s - s.floor(), t - t.floor())
}

#[test]
fn leaves_of_trees_and_clusters_hold_what_is_there_at_all_keys() {
    let material = || wrapped("/m", "quarter", "repeat", &[threshold(0.65)]);
    let still = MeshDesc { point_motion: PointsMotion::default(), ..waving("/a", 40) };
    for desc in [still, waving("/a", 40)] {
        let mesh = built(desc.clone(), material());
        assert!(mesh.is_clipped && mesh.triangles.len() < 1600, "{}", mesh.triangles.len());
        let whole = holds_what_is_there(&mesh, is_in_quarter);
        assert!(whole > 20_000, "{whole}");
        let mut db = database(&Arc::default(), material());
        db.set_partition(PartitionOptions { chunk_bytes: 16 << 10 });
        db.upsert_mesh(desc);
        let snapshot = committed(&mut db);
        assert!(snapshot.meshes.len() > 4 && snapshot.meshes.iter().all(|mesh| mesh.is_clipped), "clusters");
        let parts: usize = snapshot.meshes.iter().map(|part| holds_what_is_there(&asset(part), is_in_quarter)).sum();
        assert_eq!(parts, whole, "all of it is in some cluster");
    }
}

#[test]
fn slots_are_cut_out_by_their_own_materials() {
    let mut desc = bind(grid("/a", 2), "/m", &[("/n", &[3])]);
    let zeros = vec![0.0_f32; 4];
    desc = with(desc, "cut", primvar(Interpolation::Uniform, zeros));
    let mut db = database(&Arc::default(), by_primvar("/m", &[threshold(0.5)]));
    db.upsert_material(by_primvar("/n", &[]));
    db.upsert_mesh(desc);
    let mesh = asset(&committed(&mut db).meshes[0]);
    let faces: Vec<u32> = mesh.triangles.iter().map(|triangle| triangle.face).collect();
    assert_eq!(faces, [3, 3], "what is transparent is there");
}

fn mesh_of(snapshot: &Snapshot) -> Arc<MeshAsset> {
    asset(&snapshot.meshes[0])
}

#[test]
fn edits_of_cutouts_build_meshes_again() {
    let files = Arc::default();
    let mut db = database(&files, textured("/m", "quarter", &[threshold(0.5)]));
    db.upsert_mesh(card("/a"));
    let first = mesh_of(&committed(&mut db));
    db.upsert_material(textured("/m", "quarter", &[threshold(0.5), ("diffuseColor", ParamValue::Vec3([0.1; 3]))]));
    assert!(Arc::ptr_eq(&first, &mesh_of(&committed(&mut db))), "what is there is the same");
    db.upsert_material(textured("/m", "left", &[threshold(0.5)]));
    is_around(&mesh_of(&committed(&mut db)), [0.0, 0.0, 1.0], [0.5, 2.0, 1.0]);
    db.upsert_material(textured("/m", "left", &[threshold(0.2)]));
    is_whole(&mesh_of(&committed(&mut db)));
    db.upsert_material(textured("/m", "quarter", &[threshold(0.5)]));
    assert_eq!(mesh_of(&committed(&mut db)).bounds, first.bounds);
    db.set_whole_bounds(true);
    is_whole(&mesh_of(&committed(&mut db)));
}

/// As long as a scene shows a file, boxes are of the file as it was: so are its tiles.
#[test]
fn a_file_is_read_once_as_long_as_it_is_shown() {
    let files = Arc::<Files>::default();
    let mut db = database(&files, textured("/m", "quarter", &[threshold(0.5)]));
    db.upsert_material(textured("/n", "quarter", &[threshold(0.5)]));
    for number in 0..4 {
        db.upsert_mesh(bind(card(&format!("/mesh_{number}")), ["/m", "/n"][number % 2], &[]));
    }
    committed(&mut db);
    *files.replaced.lock().expect("not poisoned") = Some(|s, _| s < 0.5);
    let mut other = card("/mesh_0");
    other.points = TypedArray::of(vec![[0.0_f32, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 3.0, 1.0], [0.0, 3.0, 1.0]]);
    db.upsert_mesh(other);
    let snapshot = committed(&mut db);
    assert!(snapshot.meshes.iter().all(|mesh| mesh.bounds.max[1] < 1.6), "of the file as it was");
    assert_eq!(files.opened.lock().expect("not poisoned").len(), 1);
    (0..4).for_each(|number| db.remove(&format!("/mesh_{number}")));
    committed(&mut db);
    db.upsert_mesh(card("/a"));
    is_around(&mesh_of(&committed(&mut db)), [0.0, 0.0, 1.0], [1.0, 2.0, 1.0]);
}

/// A process that finds meshes in files does not find those of an image that was replaced since.
#[test]
fn kept_meshes_are_of_the_image_as_it_is() {
    let kept = Arc::new(store::Files::lasting());
    let run = |shape: Option<Shape>| {
        let files = Arc::<Files>::default();
        *files.replaced.lock().expect("not poisoned") = shape;
        let mut db = database(&files, textured("/m", "quarter", &[threshold(0.5)]));
        db.set_mesh_files(Some(kept.clone() as Arc<dyn MeshFiles>));
        db.upsert_mesh(card("/a"));
        let snapshot = committed(&mut db);
        (mesh_of(&snapshot), kept.found())
    };
    let (first, _) = run(None);
    let (second, found) = run(None);
    assert_eq!((second.bounds, second.whole, found), (first.bounds, first.whole, 1), "found");
    let (other, found) = run(Some(|s, _| s < 0.5));
    is_around(&other, [0.0, 0.0, 1.0], [1.0, 2.0, 1.0]);
    assert_eq!(found, 1, "another one");
}

#[test]
fn hostile_coordinates_keep_whole_boxes() {
    let (nan, inf) = (f32::NAN, f32::INFINITY);
    for st in [
        [[nan, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]],
        [[0.0, 0.0], [inf, 0.0], [1.0, 1.0], [0.0, 1.0]],
        [[-1.0e30, 0.0], [1.0e30, 0.0], [1.0e30, 1.0], [-1.0e30, 1.0]],
        [[3.0e38, 3.0e38], [-3.0e38, 3.0e38], [-3.0e38, -3.0e38], [3.0e38, -3.0e38]],
        [[0.0, 0.0], [40.0, 0.0], [40.0, 40.0], [0.0, 40.0]],
    ] {
        let mut desc = card("/a");
        desc.primvars[0].primvar.values = TypedArray::of(st.to_vec());
        let mut db = database(&Arc::default(), textured("/m", "quarter", &[threshold(0.5)]));
        db.upsert_mesh(desc);
        let commit = db.commit();
        commit.snapshot.validate().expect("sound");
        let mesh = asset(&commit.snapshot.meshes[0]);
        let is_usable = st.as_flattened().iter().all(|x| x.is_finite());
        assert!(mesh.bounds == mesh.whole || !is_usable, "{st:?}: {:?}", mesh.bounds);
    }
}
