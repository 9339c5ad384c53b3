// SPDX-License-Identifier: Apache-2.0
//! Meshes split into clusters: nothing is lost, nothing changes a bit, nothing depends on threads.

use oocpt_abi::AttributeRate;
use oocpt_core::mesh::{build_mesh, build_mesh_split, split_mesh};
use oocpt_core::{Aabb, Attribute, Interpolation, MeshAsset, MeshDesc, Primvar};
use proptest::prelude::*;

use crate::support::{grid, primvar};

/// A triangle with its attributes, as bits: corners, face, and per corner normal, colour and opacity.
type Look = (Vec<u32>, u32, Vec<u32>);

fn value<T: Copy>(attribute: &Attribute<T>, corners: &[[u32; 3]], triangle: usize, corner: usize) -> T {
    attribute.values[match attribute.rate {
        AttributeRate::Constant => 0,
        AttributeRate::Uniform => triangle,
        AttributeRate::Vertex => corners[triangle][corner] as usize,
        AttributeRate::FaceVarying => 3 * triangle + corner,
    }]
}

fn looks<'a>(meshes: impl IntoIterator<Item = &'a MeshAsset>) -> Vec<Look> {
    let mut looks = Vec::new();
    for mesh in meshes {
        for (t, triangle) in mesh.triangles.iter().enumerate() {
            let mut values = Vec::new();
            for corner in 0..3 {
                for attribute in [&mesh.normals, &mesh.colors].into_iter().flatten() {
                    values.extend(value(attribute, &mesh.corner_indices, t, corner).map(f32::to_bits));
                }
                values.extend(mesh.opacities.iter().map(|a| value(a, &mesh.corner_indices, t, corner).to_bits()));
            }
            let corners = triangle.vertices.as_flattened().iter().map(|v| v.to_bits()).collect();
            looks.push((corners, triangle.face, values));
        }
    }
    looks.sort_unstable();
    looks
}

/// Number of values that an attribute of the cluster must have.
fn values_wanted(rate: AttributeRate, mesh: &MeshAsset) -> usize {
    let mut points = mesh.corner_indices.as_flattened().to_vec();
    points.sort_unstable();
    points.dedup();
    match rate {
        AttributeRate::Constant => 1,
        AttributeRate::Uniform => mesh.triangles.len(),
        AttributeRate::Vertex => points.len(),
        AttributeRate::FaceVarying => 3 * mesh.triangles.len(),
    }
}

/// Everything that must hold of the clusters of `mesh`.
fn check(mesh: &MeshAsset, clusters: &[&MeshAsset], max_bytes: u64) -> Result<(), TestCaseError> {
    prop_assert_eq!(looks(clusters.iter().copied()), looks([mesh]), "every triangle once, with all its bits");
    let mut keys: Vec<u128> = clusters.iter().map(|c| c.key).collect();
    for cluster in clusters {
        prop_assert_eq!(cluster.bvh.validate(&cluster.triangles, cluster.kind), Ok(()), "the hierarchy");
        let bytes = cluster.device_bytes();
        prop_assert!(bytes <= max_bytes || cluster.triangles.len() == 1, "{bytes} bytes of {max_bytes}");
        let bounds = cluster.triangles.iter().fold(Aabb::EMPTY, |b, t| b.union(&t.bounds(cluster.kind)));
        prop_assert_eq!(cluster.bounds, bounds, "the box");
        let flags = |m: &MeshAsset| (m.double_sided, m.left_handed);
        prop_assert_eq!(flags(cluster), flags(mesh), "the flags");
        prop_assert_eq!(cluster.corner_indices.is_empty(), mesh.corner_indices.is_empty(), "corners where needed");
        for (have, had) in [(&cluster.normals, &mesh.normals), (&cluster.colors, &mesh.colors)] {
            prop_assert_eq!(have.as_ref().map(|a| a.rate), had.as_ref().map(|a| a.rate), "rates");
            let lengths = have.as_ref().map(|a| (a.values.len(), values_wanted(a.rate, cluster)));
            prop_assert!(lengths.is_none_or(|(len, wanted)| len == wanted), "{lengths:?} values");
        }
        let opacities = cluster.opacities.as_ref().map(|a| (a.values.len(), values_wanted(a.rate, cluster)));
        prop_assert!(opacities.is_none_or(|(len, wanted)| len == wanted), "{opacities:?} opacities");
    }
    keys.push(mesh.key);
    keys.sort_unstable();
    keys.dedup();
    prop_assert_eq!(keys.len(), clusters.len() + 1, "keys are distinct");
    Ok(())
}

/// `n x n` quads with attributes of the given rates, `None` for none.
fn meadow(n: u16, [normals, colors, opacities]: [Option<Interpolation>; 3]) -> MeshDesc {
    let mut desc = grid("/m", n);
    let n = usize::from(n);
    let count = |interpolation| match interpolation {
        Interpolation::Uniform => n * n,
        Interpolation::Vertex | Interpolation::Varying => (n + 1) * (n + 1),
        Interpolation::FaceVarying => 4 * n * n,
        _ => 1,
    };
    let value = |k: usize, d: u32| oocpt_abi::sampler::sample_4d(u32::try_from(k).unwrap(), d, 8);
    let vectors = |interpolation: Interpolation, d: u32| -> Primvar {
        let values: Vec<[f32; 3]> =
            (0..count(interpolation)).map(|k| value(k, d)).map(|v| [v[0], v[1], v[2] + 0.01]).collect();
        primvar(interpolation, values)
    };
    desc.normals = normals.map(|i| vectors(i, 0));
    desc.display_color = colors.map(|i| vectors(i, 1));
    desc.display_opacity = opacities.map(|i| primvar(i, (0..count(i)).map(|k| 0.9 * value(k, 2)[0]).collect()));
    desc.left_handed = n % 2 == 0;
    desc.double_sided = n % 3 == 0;
    desc
}

fn rate() -> impl Strategy<Value = Option<Interpolation>> {
    prop_oneof![
        2 => Just(None),
        1 => Just(Some(Interpolation::Constant)),
        2 => Just(Some(Interpolation::Uniform)),
        2 => Just(Some(Interpolation::Vertex)),
        2 => Just(Some(Interpolation::FaceVarying)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]
    #[test]
    fn a_split_mesh_is_the_same_mesh(n in 1_u16..20, rates in prop::array::uniform3(rate()), max in 0_u64..20_000) {
        let desc = meadow(n, rates);
        let whole = build_mesh(&desc, 77).asset.unwrap();
        let clusters = split_mesh(&whole, max);
        check(&whole, &clusters.iter().collect::<Vec<_>>(), max)?;
        let built = build_mesh_split(&desc, 77, 0, max);
        prop_assert!(built.asset.is_none(), "either whole or in pieces");
        check(&whole, &built.clusters.iter().map(|c| &**c).collect::<Vec<_>>(), max)?;
        let order_is_in_the_key = built.clusters.iter().all(|b| clusters.iter().all(|c| c.key != b.key));
        prop_assert!(order_is_in_the_key, "clusters made from another order have other keys");
    }
}

/// Compares all data of two clusters.
fn same(a: &MeshAsset, b: &MeshAsset) -> bool {
    (a.key, a.bounds, &a.bvh, &a.triangles, &a.corner_indices)
        == (b.key, b.bounds, &b.bvh, &b.triangles, &b.corner_indices)
        && (&a.normals, &a.colors, &a.opacities) == (&b.normals, &b.colors, &b.opacities)
        && (a.double_sided, a.left_handed) == (b.double_sided, b.left_handed)
}

#[test]
fn threads_do_not_change_the_clusters() {
    let vertex = Some(Interpolation::Vertex);
    let desc = meadow(40, [vertex, Some(Interpolation::FaceVarying), None]);
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| build_mesh_split(&desc, 5, 0, 16 << 10).clusters)
    };
    let (one, many) = (on(1), on(7));
    assert!(one.len() > 10, "{} clusters", one.len());
    assert_eq!(one.len(), many.len(), "the number of clusters");
    assert!(one.iter().zip(&many).all(|(a, b)| same(a, b)), "every bit of every cluster");
}

#[test]
fn cluster_keys_depend_on_mesh_cluster_size_and_index() {
    let whole = build_mesh(&grid("/g", 10), 1).asset.unwrap();
    let other = MeshAsset { key: 2, ..(*whole).clone() };
    let keys: Vec<Vec<u128>> = [split_mesh(&whole, 4000), split_mesh(&whole, 4001), split_mesh(&other, 4000)]
        .map(|clusters| clusters.iter().map(|c| c.key).collect())
        .into();
    let mut all: Vec<u128> = keys.concat();
    all.sort_unstable();
    all.dedup();
    assert_eq!(all.len(), keys.iter().map(Vec::len).sum::<usize>(), "no key appears twice");
    let again: Vec<u128> = split_mesh(&whole, 4000).iter().map(|c| c.key).collect();
    assert_eq!(again, keys[0], "and the same question has the same answer");
}

/// Clusters are patches: a walk that enters one need not enter them all. And they are rather full.
#[test]
fn clusters_are_compact_and_full() {
    let whole = build_mesh(&grid("/g", 100), 1).asset.unwrap();
    let max = 32 << 10;
    let clusters = split_mesh(&whole, max);
    let footprint = |b: &Aabb| (b.max[0] - b.min[0]) * (b.max[1] - b.min[1]);
    let total: f32 = clusters.iter().map(|c| footprint(&c.bounds)).sum();
    assert!(total < 1.4 * footprint(&whole.bounds), "the clusters cover the grid {total} times");
    let ideal = whole.device_bytes().div_ceil(max);
    let number = clusters.len() as u64;
    assert!(number <= ideal + ideal / 4, "{number} clusters where {ideal} could do");
}

#[test]
fn only_meshes_above_the_limit_are_split() {
    let desc = meadow(12, [Some(Interpolation::Vertex), None, None]);
    let bytes = build_mesh(&desc, 3).asset.unwrap().device_bytes();
    let split = |limit| build_mesh_split(&desc, 3, limit, 4096);
    let (below, above) = (split(bytes / 2), split(bytes * 2));
    assert!(below.asset.is_none() && below.clusters.len() > 3, "{} clusters", below.clusters.len());
    assert!(above.asset.is_some() && above.clusters.is_empty(), "a small mesh stays whole");
    assert!(same(&above.asset.unwrap(), &build_mesh(&desc, 3).asset.unwrap()), "and is what it always was");
    assert_eq!(below.dropped, above.dropped, "what is dropped does not depend on it");
    let mut nothing = desc.clone();
    nothing.face_vertex_indices = oocpt_core::TypedArray::of(vec![0_i32; 4 * 144]);
    let nothing = build_mesh_split(&nothing, 3, 0, 4096);
    assert!(nothing.asset.is_none() && nothing.clusters.is_empty(), "no area, no cluster");
    assert_eq!(nothing.dropped.empty_meshes, 1, "and it is told");
}

/// Triangles at the same position cannot be separated by planes; they are split nevertheless.
#[test]
fn coincident_triangles_are_split_too() {
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0_f32]];
    let desc = crate::support::polygons("/p", &[3; 500], &[0, 1, 2].repeat(500), &triangle);
    let whole = build_mesh(&desc, 1).asset.unwrap();
    let clusters = split_mesh(&whole, 4096);
    assert!(clusters.len() > 4, "{} clusters", clusters.len());
    check(&whole, &clusters.iter().collect::<Vec<_>>(), 4096).unwrap();
}

/// Bytes of the arrays that a mesh keeps, and of the room that they have taken.
fn kept(mesh: &MeshAsset) -> [usize; 2] {
    fn both<T>(values: &Vec<T>) -> [usize; 2] {
        [values.len(), values.capacity()].map(|count| count * size_of::<T>())
    }
    let mut parts = vec![
        both(&mesh.triangles),
        both(&mesh.corner_indices),
        both(&mesh.bvh.nodes),
        both(&mesh.subsets),
        both(&mesh.ptex),
    ];
    parts.extend([&mesh.normals, &mesh.colors].into_iter().flatten().map(|attribute| both(&attribute.values)));
    parts.extend(mesh.opacities.iter().map(|attribute| both(&attribute.values)));
    parts.iter().fold([0; 2], |[used, taken], part| [used + part[0], taken + part[1]])
}

/// A built mesh stays as long as its scene: room for elements that never come would be memory that nothing counts.
#[test]
fn built_meshes_have_no_spare_capacity() {
    for interpolation in [Interpolation::Vertex, Interpolation::Uniform, Interpolation::FaceVarying] {
        let desc = meadow(41, [Some(interpolation); 3]);
        let whole = build_mesh(&desc, 1).asset.unwrap();
        for mesh in split_mesh(&whole, 20_000).iter().chain([&*whole]) {
            let [used, taken] = kept(mesh);
            assert_eq!(taken, used, "{interpolation:?}, {} triangles: bytes taken, and used", mesh.triangles.len());
        }
    }
}
