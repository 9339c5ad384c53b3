// SPDX-License-Identifier: Apache-2.0
//! Units that rays read in host memory come to the device for their visits alone.

use oocpt_core::residency::{PlannerOptions, PolicyKind, RayDemand, ResidencyCommand, ResidencyPlanner, UnitCatalog};
use std::sync::Arc;

/// Four units of ten bytes.
fn planner(budget: u64, kind: PolicyKind) -> ResidencyPlanner {
    let catalog = UnitCatalog::new(vec![10; 4], [vec![0], vec![1], vec![2], vec![3]]).expect("a good catalog");
    let options = PlannerOptions { in_flight_bytes: 1000, ..PlannerOptions::default() };
    ResidencyPlanner::with_policy(Arc::new(catalog), budget, kind.policy(), options).expect("they fit")
}

/// Units that a step loads, which come at once, and that it evicts.
fn step(planner: &mut ResidencyPlanner, visits: &[u32], mapped: &[bool]) -> (Vec<u32>, Vec<u32>) {
    step_of(planner, &RayDemand { visits, mapped, active: 1000, ..RayDemand::default() })
}

fn step_of(planner: &mut ResidencyPlanner, demand: &RayDemand<'_>) -> (Vec<u32>, Vec<u32>) {
    let (mut loaded, mut evicted) = (Vec::new(), Vec::new());
    for command in planner.step(demand) {
        match command {
            ResidencyCommand::Load { unit, .. } => loaded.push(unit),
            ResidencyCommand::Evict { unit, .. } => evicted.push(unit),
        }
    }
    loaded.iter().for_each(|unit| planner.loaded(*unit));
    (loaded, evicted)
}

#[test]
fn the_most_visited_mapped_units_load_first() {
    let mut planner = planner(20, PolicyKind::Benefit);
    let visits = [3_000_000, 9_000_000, 1_000_000, 0];
    assert_eq!(step(&mut planner, &visits, &[true; 4]), (vec![1, 0], vec![]), "by visits, as far as there is room");
    for _ in 0..200 {
        assert_eq!(step(&mut planner, &visits, &[true; 4]), (vec![], vec![]), "no swap for less, however long it is");
    }
}

#[test]
fn more_visited_units_replace_less_visited_ones() {
    let mut planner = planner(20, PolicyKind::Benefit);
    let _ = step(&mut planner, &[3_000_000, 9_000_000, 0, 0], &[true; 4]);
    let mut swaps = Vec::new();
    for _ in 0..200 {
        let (loaded, evicted) = step(&mut planner, &[3_000_000, 9_000_000, 6_000_000, 0], &[true; 4]);
        swaps.extend(loaded.into_iter().zip(evicted));
    }
    assert_eq!(swaps, [(2, 0)], "once, and only the least visited goes");
}

#[test]
fn unmapped_or_unvisited_units_are_not_moved() {
    let mut planner = planner(40, PolicyKind::Benefit);
    let mapped = [false, true, true, true];
    assert_eq!(step(&mut planner, &[9_000_000, 0, 0, 5_000_000], &mapped), (vec![3], vec![]));
    for kind in [PolicyKind::Sweep, PolicyKind::Priority] {
        let mut planner = self::planner(40, kind);
        assert_eq!(step(&mut planner, &[5; 4], &[true; 4]), (vec![], vec![]), "{kind} knows of waiting rays alone");
    }
}

/// Nothing goes for a unit that hardly any ray reads; a few more rays, and something does.
#[test]
fn few_visits_displace_nothing() {
    let bytes = 16 << 20;
    let catalog = UnitCatalog::new(vec![bytes; 2], [vec![0], vec![1]]).expect("a good catalog");
    let mut planner = ResidencyPlanner::new(Arc::new(catalog), bytes, PolicyKind::Benefit).expect("it fits");
    assert_eq!(step(&mut planner, &[0, 1], &[true; 2]), (vec![1], vec![]), "one visit fills free memory");
    for _ in 0..1000 {
        assert_eq!(step(&mut planner, &[600], &[true; 2]), (vec![], vec![]), "14 400 lately, 1 KiB each");
    }
    for _ in 0..1000 {
        let _ = step(&mut planner, &[800], &[true; 2]);
    }
    assert_eq!(planner.resident_units(), [0], "18 900 lately");
}

/// When nearly all rays wait, what the few others read displaces nothing.
#[test]
fn waiting_rays_take_precedence_over_visits() {
    let mut planner = planner(20, PolicyKind::Benefit);
    let most = [9_000_000, 3_000_000, 1_000_000, 0];
    for _ in 0..5 {
        let _ = step(&mut planner, &most, &[true; 4]);
    }
    let mapped = [true, true, true, false];
    let visits = [0, 0, 8_000_000, 0];
    let mut loads = Vec::new();
    for waiting in [10_000, 0] {
        // What rays wait for does not come.
        let demand = RayDemand {
            visits: &visits,
            mapped: &mapped,
            waiting: &[0, 0, 0, waiting],
            active: 5,
            ..RayDemand::default()
        };
        let commands = (0..20).flat_map(|_| planner.step(&demand)).collect::<Vec<_>>();
        loads.extend(commands.into_iter().filter_map(|command| match command {
            ResidencyCommand::Load { unit, .. } => Some((unit, waiting)),
            ResidencyCommand::Evict { .. } => None,
        }));
    }
    assert_eq!(loads, [(3, 10_000), (2, 0)]);
}

/// What hardly any ray waits for comes while there is room, and displaces nothing.
#[test]
fn units_with_little_demand_load_only_into_free_space() {
    let waiting = [1000, 1, 0, 2];
    let demand = RayDemand { waiting: &waiting, active: 100_000, ..RayDemand::default() };
    for (budget, expected) in [(30, vec![0, 3, 1]), (29, vec![0, 3])] {
        let mut planner = planner(budget, PolicyKind::Benefit);
        assert_eq!(step_of(&mut planner, &demand), (expected, vec![]), "{budget}");
    }
}

/// Two chunks and two tiles, where rays do not wait for chunks any more: what they cannot read in host memory stays,
/// whatever waits.
#[test]
fn unmapped_units_stay_resident_for_rays_that_do_not_wait() {
    let mut planner = planner(20, PolicyKind::Benefit);
    assert_eq!(
        step_of(&mut planner, &RayDemand { waiting: &[1, 1, 0, 0], ..RayDemand::default() }),
        (vec![0, 1], vec![])
    );
    let kept = RayDemand { mapped: &[false, true], keep_below: 2, ..RayDemand::default() };
    let mut seen = Vec::new();
    for waiting in [[0, 0, 9, 0], [0, 0, 0, 9], [0, 0, 9, 0]] {
        for _ in 0..20 {
            let (loaded, evicted) = step_of(&mut planner, &RayDemand { waiting: &waiting, ..kept });
            seen.extend(loaded.into_iter().zip(evicted));
        }
    }
    assert_eq!(seen, [(2, 1), (3, 2), (2, 3)], "the mapped chunk goes, then tiles for each other");
    for _ in 0..20 {
        let visited = RayDemand { visits: &[0, 9_000_000], active: 1000, ..kept };
        assert_eq!(step_of(&mut planner, &visited), (vec![], vec![]), "tiles keep the room of what is only visited");
    }
}

/// A chunk and a mesh of ten bytes, and six tiles of two. Nobody counts the visits of tiles.
fn with_tiles(budget: u64, first_tile: Option<u32>) -> ResidencyPlanner {
    let bytes = [vec![10; 2], vec![2; 6]].concat();
    let catalog = UnitCatalog::new(bytes, (0..8).map(|asset| vec![asset])).expect("a good catalog");
    let options = PlannerOptions { in_flight_bytes: 1000, first_tile, ..PlannerOptions::default() };
    ResidencyPlanner::with_policy(Arc::new(catalog), budget, PolicyKind::Benefit.policy(), options).expect("they fit")
}

/// How many tiles are there after rays have waited for all six, two at a time, while others visit chunk and mesh,
/// which are mapped.
fn tiles_left(planner: &mut ResidencyPlanner) -> usize {
    let mapped = [true, true, false, false, false, false, false, false];
    for tiles in [[2, 3], [4, 5], [6, 7]] {
        let mut waiting = [0; 8];
        tiles.iter().for_each(|tile| waiting[*tile] = 40_000_000);
        let demand = RayDemand { waiting: &waiting, mapped: &mapped, active: 1 << 40, ..RayDemand::default() };
        let _ = step_of(planner, &demand);
        for _ in 0..300 {
            let demand = RayDemand { visits: &[9_000_000; 2], mapped: &mapped, active: 1000, ..RayDemand::default() };
            let _ = step_of(planner, &demand);
        }
    }
    planner.resident_units().iter().filter(|unit| **unit >= 2).count()
}

#[test]
fn few_tiles_stay_though_geometry_is_visited() {
    assert_eq!(tiles_left(&mut with_tiles(22, None)), 1, "without a share geometry takes the place of tiles");
    assert_eq!(tiles_left(&mut with_tiles(22, Some(2))), 6, "a third of the budget is theirs");
    assert_eq!(tiles_left(&mut with_tiles(20, Some(2))), 5, "what is more than that goes");
}
