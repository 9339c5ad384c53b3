// SPDX-License-Identifier: Apache-2.0
//! The guarantees of the planner under any demand, any results of loads and any budget.

use super::witness::{Witness, budget_of, catalogs, kinds};
use oocpt_core::residency::{PolicyKind, RayDemand, ResidencyCommand};
use proptest::prelude::*;
use std::sync::Arc;

/// The events before a step, and its demand.
#[derive(Clone, Debug)]
struct Event {
    waiting: Vec<u32>,
    next: Vec<u32>,
    visits: Vec<u32>,
    active: u64,
    /// Of loads in flight: 0 stays, 1 and 2 complete, 3 fails (if failures happen in this case).
    ends: Vec<u8>,
    budget_percent: Option<u64>,
}

fn rays() -> impl Strategy<Value = Vec<u32>> {
    prop::collection::vec(prop_oneof![3 => Just(0_u32), 2 => 1_u32..100, 1 => 1000_u32..100_000], 0..10)
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let active = prop_oneof![Just(0_u64), 1_u64..1_000_000];
    let budget = prop::option::weighted(0.05, 0_u64..100);
    let ends = prop::collection::vec(0_u8..4, 1..6);
    let event = (rays(), rays(), rays(), active, ends, budget).prop_map(
        |(waiting, next, visits, active, ends, budget_percent)| Event {
            waiting,
            next,
            visits,
            active,
            ends,
            budget_percent,
        },
    );
    prop::collection::vec(event, 1..60)
}

/// The kinds of events in a case.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Weather {
    /// Loads complete, the budget stays.
    Calm,
    /// Loads fail, the budget changes.
    Rough,
}

fn play(witness: &mut Witness, events: &[Event], weather: Weather) -> Vec<ResidencyCommand> {
    play_asked(witness, events, weather, |_| None)
}

/// As [`play`], where `asked` says which units a step looks at.
fn play_asked(
    witness: &mut Witness,
    events: &[Event],
    weather: Weather,
    requested: impl Fn(&Event) -> Option<Vec<u32>>,
) -> Vec<ResidencyCommand> {
    for event in events {
        let loading: Vec<u32> = witness.loading.keys().copied().collect();
        for (unit, end) in loading.into_iter().zip(event.ends.iter().cycle()) {
            match (*end, weather) {
                (0, _) => {}
                (3, Weather::Rough) => witness.failed(unit),
                _ => witness.loaded(unit),
            }
        }
        if let (Some(percent), Weather::Rough) = (event.budget_percent, weather) {
            let budget = budget_of(witness.planner.catalog(), percent);
            witness.set_budget(budget);
        }
        let Event { waiting, next, visits, active, .. } = event;
        let requested = requested(event);
        witness.step(&RayDemand {
            waiting,
            next,
            visits,
            active: *active,
            requested: requested.as_deref(),
            ..RayDemand::default()
        });
    }
    witness.commands.clone()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, ..ProptestConfig::default() })]

    /// Budget, reference counts, pins, states, evictions only for need, prefetches behind demand: see
    /// [`Witness::step`].
    #[test]
    fn every_command_is_right(
        catalog in catalogs(), percent in 0_u64..=100, kind in kinds(), events in events(), in_flight in 0_u64..300,
    ) {
        let budget = budget_of(&catalog, percent);
        play(&mut Witness::new(&catalog, budget, kind, in_flight), &events, Weather::Calm);
    }

    #[test]
    fn every_command_is_right_when_loads_fail_and_budgets_change(
        catalog in catalogs(), percent in 0_u64..=100, kind in kinds(), events in events(), in_flight in 0_u64..300,
    ) {
        let budget = budget_of(&catalog, percent);
        play(&mut Witness::new(&catalog, budget, kind, in_flight), &events, Weather::Rough);
    }

    #[test]
    fn equal_calls_give_equal_commands(
        catalog in catalogs(), percent in 0_u64..=100, kind in kinds(), events in events(),
    ) {
        let budget = budget_of(&catalog, percent);
        let run = || play(&mut Witness::new(&catalog, budget, kind, 0), &events, Weather::Rough);
        prop_assert_eq!(run(), run(), "two runs");
    }

    /// A list of the demanded units, past the catalog and with other units too, gives the same commands.
    #[test]
    fn a_demand_list_gives_the_same_commands_as_the_full_table(
        catalog in catalogs(), percent in 0_u64..=100, kind in kinds(), events in events(), more in 0_u32..13,
    ) {
        let budget = budget_of(&catalog, percent);
        let run = |requested: fn(u32, &Event) -> Option<Vec<u32>>| {
            let mut witness = Witness::new(&catalog, budget, kind, 0);
            play_asked(&mut witness, &events, Weather::Rough, |event| requested(more, event))
        };
        let list = |more: u32, event: &Event| {
            let is_asked = |values: &[u32], unit: u32| values.get(unit as usize).is_some_and(|rays| *rays > 0);
            let of = |unit: &u32| *unit == more || is_asked(&event.waiting, *unit) || is_asked(&event.next, *unit);
            Some((0..13).filter(of).collect())
        };
        prop_assert_eq!(run(|_, _| None), run(list), "with and without the list");
    }

    /// The bytes in flight are at most those of the option, four times as many when the device idles, or one load.
    #[test]
    fn loads_in_flight_are_bounded(
        catalog in catalogs(), kind in kinds(), events in events(), in_flight in 1_u64..300,
    ) {
        let mut witness = Witness::new(&catalog, budget_of(&catalog, 100), kind, in_flight);
        for event in events {
            let Event { waiting, next, .. } = &event;
            let loading: Vec<u32> = witness.loading.keys().copied().collect();
            loading.into_iter().take(1).for_each(|unit| witness.loaded(unit));
            witness.step(&RayDemand { waiting, next, active: u64::MAX, ..RayDemand::default() });
            let sizes = || witness.loading.values().map(|assets| witness.bytes(assets));
            // A share for demanded loads, a quarter of it for prefetches; each may be one load however large.
            let largest = sizes().max().unwrap_or(0);
            prop_assert!(sizes().sum::<u64>() <= in_flight.max(largest) + (in_flight / 4).max(largest), "{event:?}");
        }
    }

    /// After an edit, kept units are resident, are not loaded, and never exceed the budget.
    #[test]
    fn kept_units_are_resident(
        catalog in catalogs(), percent in 0_u64..=100, kind in kinds(), events in events(),
    ) {
        let mut witness = Witness::new(&catalog, budget_of(&catalog, percent), kind, 0);
        for unit in (0..12_u32).rev() {
            if witness.planner.keep_resident(unit) {
                witness.resident.insert(unit, (0, true));
                witness.held.extend(catalog.assets(unit));
            }
            prop_assert_eq!(witness.planner.is_resident(unit), witness.resident.contains_key(&unit), "{}", unit);
        }
        prop_assert!(witness.planner.stats().bytes_held <= witness.budget, "kept more than fits");
        prop_assert!(percent < 100 || witness.resident.len() == catalog.unit_count(), "everything fits");
        prop_assert_eq!(witness.planner.stats().loads, 0, "keeping is no load");
        play(&mut witness, &events, Weather::Calm);
    }
}

#[test]
fn a_catalog_of_four_million_units_plans() {
    let count = 4_000_000_u32;
    let catalog = super::decisions::catalog_of(count, |unit| vec![unit, count + unit % 1000], 1000);
    for kind in PolicyKind::ALL {
        let mut witness = super::decisions::planner(&Arc::clone(&catalog), 1_000_000, kind);
        let mut waiting = vec![0; count as usize];
        waiting[3_999_999] = 7;
        let demand = RayDemand { waiting: &waiting, active: 9, ..RayDemand::default() };
        let expected = ResidencyCommand::Load { unit: 3_999_999, assets: vec![3_999_999, count + 999] };
        assert_eq!(witness.step(&demand), [expected], "{kind}");
    }
}
