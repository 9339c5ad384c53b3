// SPDX-License-Identifier: Apache-2.0
//! Nothing starves, nothing thrashes, failures do not stop the world.

use super::decisions::{catalog_of, planner};
use super::witness::{Witness, budget_of, catalogs, kinds};
use oocpt_core::residency::{PolicyKind, RayDemand, ResidencyCommand, UnitCatalog};
use proptest::prelude::*;
use std::sync::Arc;

/// Steps within which a unit is resident, by the planner's documented patience: it starves after `64 + 4 n` steps,
/// then at most n older ones go before it, each for its load, its pin and a step to leave.
fn bound(units: usize, latency: u32) -> u32 {
    let units = u32::try_from(units).expect("few");
    64 + 4 * units + 2 + (units + 1) * (2 * latency + 6)
}

/// Steps until each unit was resident once under a demand that never ends, `None` = not within `steps`.
fn first_resident(witness: &mut Witness, demand: &[Vec<u32>], latency: u32, steps: u32) -> Vec<Option<u32>> {
    let count = witness.planner.catalog().unit_count();
    let mut first = vec![None; count];
    let mut ready: Vec<(u32, u32)> = Vec::new();
    for (step, waiting) in (1..=steps).zip(demand.iter().cycle()) {
        let absent = |unit: usize| !witness.planner.is_resident(u32::try_from(unit).expect("few"));
        // At least one ray waits for every unit that is absent; the rest of the demand is as it comes.
        let rays = |unit: usize| 1 + waiting.get(unit).copied().unwrap_or(0);
        let waiting: Vec<u32> = (0..count).map(|unit| if absent(unit) { rays(unit) } else { 0 }).collect();
        let visits: Vec<u32> = (0..count).map(|unit| if absent(unit) { 0 } else { rays(unit) }).collect();
        witness.step(&RayDemand {
            waiting: &waiting,
            next: &[],
            visits: &visits,
            active: 1_000_000_000,
            requested: None,
            ..RayDemand::default()
        });
        for &unit in witness.loading.keys() {
            if !ready.iter().any(|&(_, other)| other == unit) {
                ready.push((step + latency, unit));
            }
        }
        for (_, unit) in ready.extract_if(.., |&mut (at, _)| at <= step) {
            witness.loaded(unit);
            first[unit as usize].get_or_insert(step);
        }
    }
    first
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 128, ..ProptestConfig::default() })]

    /// Every unit that rays wait for becomes resident, whatever the others ask, also if one unit fills the budget; the
    /// witness checks that it then stays for a step (pins).
    #[test]
    fn every_demanded_unit_becomes_resident(
        catalog in catalogs(), percent in prop_oneof![Just(0_u64), 0_u64..=100], kind in kinds(),
        demand in prop::collection::vec(prop::collection::vec(prop_oneof![Just(0_u32), 0_u32..1_000_000], 0..10), 1..8),
        latency in 0_u32..4, in_flight in 0_u64..100,
    ) {
        let budget = budget_of(&catalog, percent);
        let mut witness = Witness::new(&catalog, budget, kind, in_flight);
        let steps = bound(catalog.unit_count(), latency);
        let first = first_resident(&mut witness, &demand, latency, steps);
        prop_assert!(first.iter().all(Option::is_some), "{:?} within {} steps", first, steps);
    }

    /// The device has less memory than the budget says: loads fail until the planner holds less, then all loads
    /// succeed.
    #[test]
    fn failures_are_followed_by_progress(catalog in catalogs(), kind in kinds(), percent in 0_u64..=100) {
        let device_bytes = budget_of(&catalog, percent);
        let mut witness = Witness::new(&catalog, budget_of(&catalog, 100), kind, 0);
        let count = catalog.unit_count();
        let mut was_resident = vec![false; count];
        for _ in 0..16 * bound(count, 1) {
            let waiting: Vec<u32> = was_resident.iter().map(|&was| u32::from(!was) * 10).collect();
            if waiting.iter().all(|&rays| rays == 0) {
                break;
            }
            witness.step(&RayDemand { waiting: &waiting, active: 1, ..RayDemand::default() });
            let loading: Vec<u32> = witness.loading.keys().copied().collect();
            for unit in loading {
                // Held bytes are counted at the end of the list; if they fit then, they fitted before.
                if witness.planner.stats().bytes_held > device_bytes {
                    witness.failed(unit);
                } else {
                    witness.loaded(unit);
                    was_resident[unit as usize] = true;
                }
            }
        }
        prop_assert!(was_resident.iter().all(|&was| was), "{:?}", was_resident);
    }
}

/// Two units that do not fit together, wanted alike for ever: how often they swap.
fn swaps(kind: PolicyKind, steps: u32) -> u64 {
    let catalog = catalog_of(2, |unit| vec![unit], 0);
    let mut planner = planner(&catalog, 1, kind);
    for _ in 0..steps {
        let rays = |here: bool| (0..2).map(|unit| u32::from(planner.is_resident(unit) == here) * 100).collect();
        let (waiting, visits): (Vec<u32>, Vec<u32>) = (rays(false), rays(true));
        let commands = planner.step(&RayDemand {
            waiting: &waiting,
            next: &[],
            visits: &visits,
            active: 1000,
            requested: None,
            ..RayDemand::default()
        });
        for command in commands {
            if let ResidencyCommand::Load { unit, .. } = command {
                planner.loaded(unit);
            }
        }
    }
    planner.stats().evictions
}

#[test]
fn equally_demanded_units_rarely_swap() {
    // The pin alone allows a swap every second step, as in a round robin.
    assert!(swaps(PolicyKind::Sweep, 1000) <= 500, "sweep swaps at most every second step");
    for kind in [PolicyKind::Priority, PolicyKind::Benefit] {
        let swaps = swaps(kind, 1000);
        assert!((1..=1000 / 64).contains(&swaps), "{kind} swapped {swaps} times, only patience may make it");
    }
}

#[test]
fn an_idle_device_always_loads_something() {
    // One ray waits; the resident unit was of great use a moment ago.
    for kind in PolicyKind::ALL {
        let mut planner = planner(&catalog_of(2, |unit| vec![unit], 0), 1, kind);
        assert!(planner.keep_resident(0), "{kind}: kept");
        let visits = [1_000_000];
        let busy = RayDemand { waiting: &[0, 1], visits: &visits, active: 1000, ..RayDemand::default() };
        planner.step(&busy);
        planner.step(&busy);
        let idle = RayDemand { active: 0, ..busy };
        assert!(kind == PolicyKind::Sweep || planner.step(&busy).is_empty(), "{kind}: not worth it");
        assert!(kind == PolicyKind::Sweep || !planner.step(&idle).is_empty(), "{kind}: progress");
    }
}

#[test]
fn assets_shared_by_a_failed_load_and_an_evicted_unit_are_freed() {
    // Units 0 and 1 share asset 2, unit 1 is loading when 0 is thrown out by a lower budget, then fails.
    let catalog = Arc::new(UnitCatalog::new(vec![10, 10, 10], [vec![0, 2], vec![1, 2]]).expect("a good catalog"));
    let mut planner = planner(&catalog, 30, PolicyKind::Benefit);
    assert!(planner.keep_resident(0), "kept");
    let waiting = [0, 5];
    let demand = RayDemand { waiting: &waiting, active: 1, ..RayDemand::default() };
    assert_eq!(
        planner.step(&demand),
        [ResidencyCommand::Load { unit: 1, assets: vec![1] }],
        "the shared asset is there"
    );
    planner.set_budget(20).expect("one unit fits");
    assert_eq!(planner.step(&demand), [ResidencyCommand::Evict { unit: 0, assets: vec![0] }], "over the budget");
    planner.failed(1);
    assert_eq!(planner.stats().bytes_held, 0, "nothing of it is held");
    let dropped = ResidencyCommand::Evict { unit: 1, assets: vec![2] };
    assert_eq!(planner.step(&demand).first(), Some(&dropped), "the caller frees what was shared");
}
