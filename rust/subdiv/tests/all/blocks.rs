// SPDX-License-Identifier: Apache-2.0
//! Many blocks of faces, put together: no seam is seen, and threads change nothing.

use std::collections::HashMap;

use oocpt_subdiv::{ControlMesh, FaceVaryingChannel, LimitFacets, LimitSurface, PackedValues, SurfaceData};

/// A bumpy grid of `side` squared quads, with texture coordinates that have a seam in the middle.
struct Grid {
    counts: Vec<i32>,
    corners: Vec<i32>,
    positions: Vec<f32>,
    places: Vec<i32>,
    coordinates: Vec<f32>,
}

fn grid(side: i32) -> Grid {
    let points = side + 1;
    let quads = || (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    let corners = |x: i32, y: i32| [(x, y), (x + 1, y), (x + 1, y + 1), (x, y + 1)];
    let position = |k: i32| {
        let (x, y) = ((k % points) as f32, (k / points) as f32);
        [x, y, (0.7 * x).sin() * (0.9 * y).cos()]
    };
    // The right half has values of its own.
    let place = |quad: i32, (x, y): (i32, i32)| y * points + x + i32::from(quad >= side / 2) * points * points;
    Grid {
        counts: vec![4; (side * side).cast_unsigned() as usize],
        corners: quads().flat_map(|(x, y)| corners(x, y).map(|(x, y)| y * points + x)).collect(),
        positions: (0..points * points).flat_map(position).collect(),
        places: quads().flat_map(|(x, y)| corners(x, y).map(|at| place(x, at))).collect(),
        coordinates: (0..2 * points * points).flat_map(|k| [k as f32, 0.5]).collect(),
    }
}

fn tessellate(grid: &Grid, rates: impl Fn(usize) -> i32) -> LimitFacets {
    let channels = [FaceVaryingChannel { corners: &grid.places, count: grid.coordinates.len() / 2 }];
    let control = ControlMesh {
        point_count: grid.positions.len() / 3,
        face_counts: &grid.counts,
        face_points: &grid.corners,
        channels: &channels,
        ..ControlMesh::default()
    };
    let surface = LimitSurface::new(&control).expect("a surface");
    let rates: Vec<i32> = (0..surface.edges().len()).map(rates).collect();
    let values = [PackedValues { width: 2, floats: &grid.coordinates }];
    let data = SurfaceData { positions: &grid.positions, channels: &values, ..SurfaceData::default() };
    surface.tessellate(&rates, &data).expect("facets")
}

#[test]
fn any_number_of_threads_gives_the_same_bits() {
    let grid = grid(60);
    let rates = |edge: usize| 1 + i32::try_from(edge % 7).unwrap();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| tessellate(&grid, rates))
    };
    let one = with(1);
    assert!(one.faces.len() > 3 << 14, "{} triangles are several blocks", one.faces.len());
    for threads in [2, 3, 16] {
        let other = with(threads);
        assert!(one == other, "{threads} threads");
        let bits = |facets: &LimitFacets| facets.positions.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        assert_eq!(bits(&one), bits(&other), "{threads} threads");
    }
}

#[test]
fn blocks_share_their_vertices() {
    let side = 100;
    let grid = grid(side);
    let facets = tessellate(&grid, |_| 4);
    assert_eq!(facets.faces.len(), 10_000 * 32, "triangles: twenty blocks");
    assert!(facets.faces.is_sorted(), "in the order of faces");
    // One vertex for each place, but two along the seam of the texture coordinates.
    let places = (4 * 100 + 1) * (4 * 100 + 1);
    assert_eq!(facets.positions.len() / 3, places + 401, "vertices");
    let mut firsts: HashMap<[u32; 3], u32> = HashMap::new();
    let (positions, _) = facets.positions.as_chunks::<3>();
    for (vertex, (position, place)) in (0..).zip(positions.iter().zip(&facets.places)) {
        let first = *firsts.entry(position.map(f32::to_bits)).or_insert(vertex);
        assert_eq!(*place, first, "the first vertex at {position:?}");
    }
    assert_eq!(firsts.len(), places, "no two places are one, and none is two");
}
