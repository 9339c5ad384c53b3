// SPDX-License-Identifier: Apache-2.0
//! The island's statistics: counts are exact, the same twice, and do not depend on nesting.

use oocpt_core::scene::{SceneCounts, SceneDb};

use super::plants::Plants;
use super::{Parameters, Prims, build, counts};

fn parameters(instances: u64, copies: u32, flatten: bool) -> Parameters {
    Parameters { instances, unique_quads: 20_000, copies, flatten, distinct: false, seed: 7 }
}

fn committed(parameters: &Parameters) -> SceneCounts {
    let mut db = SceneDb::new();
    build(&mut db, parameters).expect("parameters in bounds");
    let commit = db.commit();
    assert!(commit.warnings.is_empty(), "the island is clean: {:?}", commit.warnings);
    commit.snapshot.counts
}

#[test]
fn distinct_islands_share_no_array() {
    let shared = parameters(20_000, 3, true);
    let distinct = Parameters { distinct: true, ..shared };
    let [one, three, three_distinct] = [parameters(20_000, 1, true), shared, distinct]
        .map(|parameters| Prims::new(&parameters).expect("parameters in bounds").array_bytes());
    assert!(three < one + one / 10, "shared: {three} bytes of three, {one} of one");
    assert!(three_distinct > 3 * one - one / 10, "distinct: {three_distinct} bytes of three, {one} of one");
    let [shared, distinct] = [shared, distinct].map(|parameters| committed(&parameters));
    assert_eq!(distinct.instances, shared.instances);
    assert_eq!(distinct.instanced_triangles, shared.instanced_triangles, "as many of each plant");
}

#[test]
fn counts_are_exact_however_it_is_nested() {
    for copies in [1, 3] {
        let [nested, flat] = [false, true].map(|flatten| committed(&parameters(20_000, copies, flatten)));
        let wanted = u128::from(20_000 * copies + 1);
        assert_eq!(nested.instances, wanted, "{copies} copies, nested");
        assert_eq!(flat.instances, wanted, "{copies} copies, flat");
        assert_eq!(nested.instanced_triangles, flat.instanced_triangles, "{copies} copies: the same meshes");
        assert_eq!(nested.unique_triangles, 40_000, "{copies} copies: 20 000 quads");
        assert_eq!(flat.unique_triangles, 40_000, "{copies} copies: 20 000 quads");
        assert_eq!(u128::from(flat.instance_records), wanted, "{copies} copies: nothing is nested");
        assert!(u128::from(nested.instance_records) < wanted * 3 / 4, "{copies} copies: clumps are nested");
    }
}

#[test]
fn every_instance_has_its_species_for_any_number() {
    let plants = Plants::new(1);
    for instances in [10_000, 10_001, 123_457, 39_300_000] {
        let placed = plants.species.iter().zip(counts(&plants, instances)).map(|(species, count)| {
            let sizes: Vec<u64> = species.variants.iter().map(|v| plants.flat(*v).len() as u64).collect();
            assert!(sizes.iter().all(|size| *size == sizes[0]), "variants of {} differ: {sizes:?}", species.name);
            count * sizes[0]
        });
        assert_eq!(placed.sum::<u64>(), instances, "of {instances}");
    }
}

#[test]
fn the_same_parameters_make_the_same_island_on_any_pool() {
    let make = |threads, seed| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let parameters = Parameters { seed, ..parameters(10_000, 1, true) };
        pool.install(|| Prims::new(&parameters)).expect("parameters in bounds")
    };
    let same = |a: &Prims, b: &Prims| {
        let pairs = a.instancers.iter().zip(&b.instancers);
        let mut arrays = pairs.flat_map(|(a, b)| [(&a.translations, &b.translations), (&a.rotations, &b.rotations)]);
        let same = |(a, b): (&Option<_>, &Option<_>)| match (a, b) {
            (Some(a), Some(b)) => oocpt_core::TypedArray::same_contents(a, b),
            _ => false,
        };
        arrays.all(same)
            && a.meshes.len() == b.meshes.len()
            && a.meshes.iter().zip(&b.meshes).all(|(a, b)| a.points.same_contents(&b.points))
    };
    let first = make(1, 7);
    assert!(same(&first, &make(3, 7)), "the same seed");
    assert!(!same(&first, &make(1, 8)), "another seed");
}

#[test]
fn some_places_are_a_thousand_times_denser_and_sizes_span_three_orders() {
    let parameters = parameters(200_000, 1, true);
    let prims = Prims::new(&parameters).expect("parameters in bounds");
    let half = super::land::Land::new(parameters.instances, parameters.seed).half;
    let side = 32_usize;
    let mut cells = vec![0_u32; side * side];
    for instancer in &prims.instancers {
        let translations = instancer.translations.as_ref().expect("places");
        for place in (0..translations.len()).filter_map(|i| translations.vec3(i)) {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "inside the square")]
            let cell = |v: f64| (((v + half) / (2.0 * half)).clamp(0.0, 0.999) * side as f64) as usize;
            cells[cell(place.z) * side + cell(place.x)] += 1;
        }
    }
    cells.retain(|&count| count > 0);
    cells.sort_unstable();
    let (low, high) = (cells[cells.len() / 100], cells[cells.len() - 1]);
    assert!(high >= 1000 * low.max(1), "from {low} to {high} instances a cell");
    let mut sizes: Vec<f64> = Vec::new();
    for (instancer, scales) in prims.instancers.iter().filter_map(|i| Some((i, i.scales.as_ref()?))) {
        if instancer.prim.path.ends_with("Pebbles") || instancer.prim.path.ends_with("Rocks") {
            sizes.extend((0..scales.len()).filter_map(|i| scales.vec3(i)).map(|s| s.x));
        }
    }
    let smallest = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    // Pebbles have a radius of about their scale; the terrain is a mesh of the same scene.
    assert!(half / smallest > 1e3, "from {smallest} m to {half} m");
}
