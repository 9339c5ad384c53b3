// SPDX-License-Identifier: Apache-2.0
//! Native traversal against the shaders on the same memory: rays at each kind of item, rays with NaN, deep
//! trees; and broken trees, which only the host has to survive.
//!
//! The tests need a device that shares the memory of the host; on another one there is no native traversal, and nothing
//! to test.

use crate::support::{self, Ball, Found, Random, World, bundle_mesh, triangle_mesh};
use oocpt_abi::{Features, GpuTriangle, LeafType};

const RAYS: u32 = 1 << 14;

/// A million rays by `cargo xtask test --full`, else a quarter of them.
fn batches() -> u64 {
    if std::env::var_os("OOCPT_TEST_FULL").is_some() { 64 } else { 16 }
}

/// Rays at items, at their edges and corners as often as not.
fn rays_at(random: &mut Random, items: &[GpuTriangle], count: u32) -> Vec<[[f32; 3]; 2]> {
    let one = |random: &mut Random| {
        let item = &items[random.below(items.len())];
        let [a, b] = [random.weight(), random.weight()];
        let target: Vec<f32> = (0..3)
            .map(|i| item.v0[i] + a * (item.v1[i] - item.v0[i]) + b * (1.0 - a) * (item.v2[i] - item.v0[i]))
            .collect();
        let distance = 2.0_f32.powi(random.power(10));
        let mut o = [0, 1, 2].map(|i| target[i] + distance * random.signed());
        if random.below(8) == 0 {
            // Along an axis: components that are 0, and -0.
            let axis = random.below(3);
            o = [0, 1, 2].map(|i| if i == axis { o[i] } else { target[i] });
        }
        let length = if random.below(4) == 0 { 2.0_f32.powi(random.power(20)) } else { 1.0 };
        [o, [0, 1, 2].map(|i| (target[i] - o[i]) * length)]
    };
    (0..count).map(|_| one(random)).collect()
}

fn triangle(random: &mut Random) -> GpuTriangle {
    let middle = random.point(60.0);
    let size = 2.0_f32.powi(random.power(5));
    let mut corners = [0; 3].map(|_| {
        let off = random.point(size);
        [0, 1, 2].map(|i| middle[i] + off[i])
    });
    match random.below(6) {
        // A sliver: the third corner a little beside the edge.
        0 => corners[2] = [0, 1, 2].map(|i| 0.3 * corners[0][i] + 0.7 * corners[1][i] + 1e-5 * random.signed()),
        1 => corners[2] = corners[1],
        _ => {}
    }
    let [v0, v1, v2] = corners;
    GpuTriangle { v0, face: 0, v1, subset_and_sides: 0, v2, ptex: 0 }
}

fn round(random: &mut Random) -> GpuTriangle {
    let v0 = random.point(50.0);
    let length = 2.0_f32.powi(random.power(5));
    let off = random.point(length);
    let v1 = if random.below(5) == 0 { v0 } else { [0, 1, 2].map(|i| v0[i] + off[i]) };
    let radius = |random: &mut Random| match random.below(8) {
        0 => 0.0,
        _ => 2.0_f32.powi(random.power(4) - 3),
    };
    let v2 = [radius(random), radius(random), 0.0];
    GpuTriangle { v0, face: 0, v1, subset_and_sides: 0, v2, ptex: 0 }
}

/// Opposite corners in any order; now and then without an extent along x.
fn toy_box(random: &mut Random) -> GpuTriangle {
    let (v0, size) = (random.point(50.0), 2.0_f32.powi(random.power(5)));
    let off = random.point(size);
    let mut v1 = [0, 1, 2].map(|i| v0[i] + off[i]);
    if random.below(16) == 0 {
        v1[0] = v0[0];
    }
    GpuTriangle { v0, face: 0, v1, subset_and_sides: 0, v2: [0.0; 3], ptex: 0 }
}

/// Compares the results of both backends for rays at random items.
fn agree(kind: LeafType, make: fn(&mut Random) -> GpuTriangle) {
    let Some(mut world) = World::new(kind.needs, 64, RAYS) else { return };
    let mut met = 0;
    for batch in 0..batches() {
        let mut random = Random(batch + 1);
        let items: Vec<GpuTriangle> = (0..48).map(|_| make(&mut random)).collect();
        world.set_mesh(&triangle_mesh(48), &items, kind);
        let rays = rays_at(&mut random, &items, RAYS);
        world.set_rays(&rays);
        let (shader, native) = (world.shader(), world.native());
        for (path, (a, b)) in shader.hits.iter().zip(&native.hits).enumerate() {
            assert_eq!(a, b, "batch {batch}, ray {path}: {:?}", rays[path]);
        }
        assert_eq!(shader.in_shadow, native.in_shadow, "batch {batch}: any hit");
        met += shader.hits.iter().flatten().count();
    }
    let all = usize::try_from(batches() * u64::from(RAYS)).expect("a million at most");
    assert!(met * 3 > all && met < all, "{met} of {all} rays met something");
}

#[test]
fn rays_meet_the_same_triangles() {
    agree(LeafType::TRIANGLE, triangle);
}

#[test]
fn rays_meet_the_same_curves() {
    agree(LeafType::ROUND, round);
}

/// Compares the results of both backends for rays at points, with a radius each or one for all; they must
/// also equal those of hulls of two such balls, also if they move.
#[test]
fn rays_meet_the_same_points() {
    let features = Features::POINTS | Features::ROUND | Features::DEFORMATION;
    let Some(mut world) = World::new(features, 64, RAYS) else { return };
    let mut met = 0;
    for batch in 0..batches() {
        let mut random = Random(batch + 1);
        let has_own = batch % 8 != 1 && batch % 8 != 3;
        let count = 1 + random.below(48);
        let radius = 2.0_f32.powi(random.power(2) - 2);
        let ball = |random: &mut Random| {
            let own = 2.0_f32.powi(random.power(4) - 3);
            (random.point(50.0), if has_own { own } else { radius })
        };
        let balls: Vec<Ball> = (0..count).map(|_| ball(&mut random)).collect();
        let moves = batch % 4 == 3;
        let later: Vec<Ball> = balls.iter().filter(|_| moves).map(|_| ball(&mut random)).collect();
        let as_hull = |&(v0, radius): &Ball| GpuTriangle {
            v0,
            face: 0,
            v1: v0,
            subset_and_sides: 0,
            v2: [radius, radius, 0.0],
            ptex: 0,
        };
        let hulls: Vec<GpuTriangle> = balls.iter().map(as_hull).collect();
        let targets = balls.iter().map(|&(v0, radius)| GpuTriangle {
            v1: [v0[0] + radius, v0[1], v0[2]],
            v2: [v0[0], v0[1] + radius, v0[2] - radius],
            ..as_hull(&(v0, radius))
        });
        let targets: Vec<GpuTriangle> = targets.collect();
        let rays = rays_at(&mut random, &targets, RAYS);
        world.set_rays(&rays);
        world.set_points(&bundle_mesh(u32::try_from(count.div_ceil(8)).expect("few")), &balls, &later, has_own);
        let (shader, native) = (world.shader(), world.native());
        met += shader.hits.iter().flatten().count();
        let later: Vec<GpuTriangle> = later.iter().map(as_hull).collect();
        world.set_hulls(&triangle_mesh(u32::try_from(count).expect("few")), &hulls, &later);
        assert!(world.shader() == shader, "batch {batch}: hulls met by shaders");
        assert!(world.native() == native, "batch {batch}: hulls met by the host");
        // Frames of this world have no shutter: both have other times.
        assert!(moves || shader == native, "batch {batch}: both");
    }
    let all = usize::try_from(batches() * u64::from(RAYS)).expect("a million at most");
    assert!(met * 4 > all && met < all, "{met} of {all} rays met something");
}

#[test]
fn rays_meet_the_same_example_leaves() {
    agree(LeafType::TOY_BOX, toy_box);
}

#[test]
fn nan_rays_give_the_same_result() {
    let Some(mut world) = World::new(Features::empty(), 64, 4096) else { return };
    let mut random = Random(7);
    let items: Vec<GpuTriangle> = (0..48).map(|_| triangle(&mut random)).collect();
    world.set_mesh(&triangle_mesh(48), &items, LeafType::TRIANGLE);
    let mut rays = rays_at(&mut random, &items, 4096);
    let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e-40, 3e38, -3e38, 1e-30, 1e20];
    for ray in &mut rays {
        for _ in 0..=random.below(2) {
            ray[random.below(2)][random.below(3)] = odd[random.below(odd.len())];
        }
    }
    world.set_rays(&rays);
    let (shader, native) = (world.shader(), world.native());
    for (path, (a, b)) in shader.hits.iter().zip(&native.hits).enumerate() {
        assert_eq!(a, b, "ray {path}: {:?}", rays[path]);
    }
    assert!(native.hits.iter().flatten().count() > 50, "some of them are rays all the same");
    assert_eq!(shader.in_shadow, native.in_shadow, "any hit");
}

/// A chain of nodes, each with a triangle beside the next one.
fn chain(depth: u32) -> (Vec<oocpt_abi::Bvh4Node>, Vec<GpuTriangle>) {
    let nodes = (0..depth).map(|i| support::node(1, i + 1, [0, 1, 0, 0], i)).collect();
    let mut random = Random(3);
    let mut last = support::node(0, 0, [1, 0, 0, 0], depth);
    last.first_triangle = depth;
    let mut all: Vec<_> = nodes;
    all.push(last);
    (all, (0..=depth).map(|_| triangle(&mut random)).collect())
}

#[test]
fn a_tree_as_deep_as_the_stack_is_walked_and_a_deeper_one_is_counted() {
    for (stack, overflows) in [(1024, false), (64, true)] {
        let Some(mut world) = World::new(Features::empty(), stack, 1024) else { return };
        let (nodes, items) = chain(600);
        world.set_mesh(&nodes, &items, LeafType::TRIANGLE);
        world.set_rays(&rays_at(&mut Random(5), &items, 1024));
        let (shader, native) = (world.shader(), world.native());
        assert_eq!(native.overflows > 0, overflows, "{stack} entries: {} rays", native.overflows);
        assert_eq!(shader.overflows > 0, overflows, "{stack} entries, shader: {} rays", shader.overflows);
        if !overflows {
            assert_eq!(shader.hits, native.hits, "{stack} entries");
        }
    }
}

#[test]
fn a_broken_tree_ends_and_reads_nothing_outside() {
    let Some(mut world) = World::new(Features::empty(), 64, 64) else { return };
    let mut random = Random(11);
    let items: Vec<GpuTriangle> = (0..3).map(|_| triangle(&mut random)).collect();
    world.set_mesh(&triangle_mesh(3), &items, LeafType::TRIANGLE);
    world.set_rays(&rays_at(&mut random, &items, 64));
    assert!(world.native().hits.iter().any(Option::is_some), "it works before it is broken");
    let broken = [
        ("a node that is its own child", vec![support::node(1, 0, [0; 4], 0)]),
        ("children behind the end", vec![support::node(4, 0x0fff_fff0, [0; 4], 0)]),
        ("triangles behind the end", vec![support::node(0, 0, [3; 4], 0x0fff_fff0)]),
        ("more children than there are", vec![support::node(15, 0x0fff_ffff, [3; 4], u32::MAX)]),
    ];
    for (what, nodes) in broken {
        world.set_mesh(&nodes, &items, LeafType::TRIANGLE);
        // One ray: a node that is its own child takes all steps that a walk may take.
        world.set_rays(&rays_at(&mut random, &items, 1));
        assert!(world.native().hits.iter().all(Option::<Found>::is_none), "{what}");
    }
    world.set_mesh(&triangle_mesh(3), &items, LeafType::TRIANGLE);
    for at in [1, 16, u64::MAX, u64::MAX - 63, 1 << 47] {
        world.set_mesh_addresses(at);
        assert!(world.native().hits.iter().all(Option::<Found>::is_none), "a mesh at {at:#x}");
    }
}

#[test]
fn broken_tables_of_cutouts_end_and_read_nothing_outside() {
    let features = Features::CUTOUTS | Features::MATERIALS | Features::TEXTURES | Features::OPACITY_MASKS;
    let Some(mut world) = World::new(features | Features::INSTANCE_PRIMVARS, 64, 256) else { return };
    let (mut there, mut all) = (0, 0);
    for seed in 1..=400 {
        let mut random = Random(seed);
        let mut items: Vec<GpuTriangle> = (0..48).map(|_| triangle(&mut random)).collect();
        for (subset, item) in (0..).zip(&mut items) {
            item.subset_and_sides = subset & 3;
        }
        world.set_mesh(&triangle_mesh(48), &items, LeafType::TRIANGLE);
        world.set_rays(&rays_at(&mut random, &items, 256));
        world.set_broken_cutouts(&mut random);
        // Its result is meaningless, but the walk must end.
        there += world.native().hits.iter().flatten().count();
        all += 256;
    }
    assert!(there * 20 > all && there * 4 < all, "{there} of {all} rays met what was there");
}
