// SPDX-License-Identifier: Apache-2.0
//! Rays that need two units at the same time, such as a chunk and a mesh that it places: they all get on, also where
//! the budget holds no more than the two.

use super::witness::{Witness, kinds};
use oocpt_core::residency::{PolicyKind, RayDemand, ResidencyCommand, ResidencyPlanner, UnitCatalog};
use proptest::prelude::*;
use std::sync::Arc;

/// Bytes of bases and of other units, and what each ray needs, one pair after the other.
#[derive(Clone, Debug)]
struct Case {
    bases: Vec<u64>,
    others: Vec<u64>,
    rays: Vec<Vec<(u32, u32)>>,
}

fn cases() -> impl Strategy<Value = Case> {
    let bytes = || prop::collection::vec(1_u64..100, 1..6);
    let pairs = prop::collection::vec((0_u32..6, 0_u32..6), 1..4);
    (bytes(), bytes(), prop::collection::vec(pairs, 1..8)).prop_map(|(bases, others, mut rays)| {
        let [base_count, other_count] = [&bases, &others].map(|units| u32::try_from(units.len()).expect("few"));
        for (base, other) in rays.iter_mut().flatten() {
            *base %= base_count;
            *other = base_count + *other % other_count;
        }
        Case { bases, others, rays }
    })
}

impl Case {
    fn catalog(&self) -> Arc<UnitCatalog> {
        let bytes: Vec<u64> = self.bases.iter().chain(&self.others).copied().collect();
        let units = 0..u32::try_from(bytes.len()).expect("few");
        let catalog = UnitCatalog::new(bytes, units.map(|unit| [unit])).expect("a good catalog");
        Arc::new(catalog.with_bases(self.bases.len()))
    }
}

/// What rays wait for after a step: a ray knows the second unit of a pair once it has seen the first one.
#[derive(Clone, Default)]
struct Waiting {
    rays: Vec<u32>,
    partners: Vec<u32>,
}

/// A ray: the pairs that it still needs, and whether it knows the other unit of the next one.
struct Ray<'a> {
    pairs: &'a [(u32, u32)],
    knows: bool,
}

impl Ray<'_> {
    fn trace(&mut self, is_there: impl Fn(u32) -> bool) {
        while let Some(&(base, other)) = self.pairs.first() {
            self.knows |= is_there(base);
            if !is_there(base) || !is_there(other) {
                return;
            }
            (self.pairs, self.knows) = (&self.pairs[1..], false);
        }
    }

    fn wait(&self, waiting: &mut Waiting) {
        let Some(&(base, other)) = self.pairs.first() else { return };
        waiting.rays[base as usize] += 1;
        if self.knows {
            waiting.rays[other as usize] += 1;
            waiting.partners[base as usize] = other + 1;
            waiting.partners[other as usize] = base + 1;
        }
    }
}

/// Steps until all rays are done, none within `most`. The planner sees what the step before the last one left.
fn steps_to_the_end(case: &Case, witness: &mut Witness, latency: u32, most: u32) -> Option<u32> {
    let units = witness.planner.catalog().unit_count();
    let mut rays: Vec<Ray<'_>> = case.rays.iter().map(|pairs| Ray { pairs, knows: false }).collect();
    let nothing = Waiting { rays: vec![0; units], partners: vec![0; units] };
    let mut seen = nothing.clone();
    let mut coming: Vec<(u32, u32)> = Vec::new();
    for step in 1..=most {
        let mut left = nothing.clone();
        for ray in &mut rays {
            ray.trace(|unit| witness.resident.contains_key(&unit));
            ray.wait(&mut left);
        }
        if rays.iter().all(|ray| ray.pairs.is_empty()) {
            return Some(step);
        }
        let Waiting { rays: waiting, partners } = std::mem::replace(&mut seen, left);
        witness.step(&RayDemand { waiting: &waiting, partners: &partners, active: 1_000_000, ..RayDemand::default() });
        for &unit in witness.loading.keys() {
            if !coming.iter().any(|&(_, other)| other == unit) {
                coming.push((step + latency, unit));
            }
        }
        for (_, unit) in coming.extract_if(.., |&mut (at, _)| at <= step) {
            witness.loaded(unit);
        }
    }
    None
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    /// Under every policy; that bytes stay within the budget is checked by the witness.
    #[test]
    fn rays_that_need_two_units_end_in_the_least_budget(
        case in cases(), kind in kinds(), latency in 0_u32..4, more in prop_oneof![2 => Just(0_u64), 1 => 0_u64..100],
    ) {
        let catalog = case.catalog();
        let mut witness = Witness::new(&catalog, catalog.least_budget() + more, kind, 0);
        let units = u32::try_from(catalog.unit_count()).expect("few");
        let pairs = u32::try_from(case.rays.iter().map(Vec::len).sum::<usize>()).expect("few");
        let most = 2 * pairs * (64 + 4 * units + (2 * units + 2) * (2 * latency + 6));
        let steps = steps_to_the_end(&case, &mut witness, latency, most);
        prop_assert!(steps.is_some(), "rays still wait after {} steps", most);
    }
}

/// Two units and their partner, of which the budget holds one beside it.
#[test]
fn the_partner_stays_while_a_unit_is_loaded() {
    for kind in PolicyKind::ALL {
        let catalog = UnitCatalog::new(vec![10; 3], [[0], [1], [2]]).expect("a good catalog").with_bases(2);
        let mut planner = ResidencyPlanner::new(Arc::new(catalog), 20, kind).expect("they fit");
        assert!(planner.keep_resident(0) && planner.keep_resident(1), "{kind}: kept");
        for _ in 0..5 {
            let _ = planner.step(&RayDemand::default());
        }
        // Nobody waits for the first one as the planner sees it, and it was of use least lately.
        let demand = RayDemand { waiting: &[0, 0, 9], partners: &[0, 0, 1], visits: &[0, 5], ..RayDemand::default() };
        let commands = planner.step(&RayDemand { active: 0, ..demand });
        let evicted: Vec<_> =
            commands.iter().filter(|command| matches!(command, ResidencyCommand::Evict { .. })).collect();
        assert!(matches!(evicted[..], [ResidencyCommand::Evict { unit: 1, .. }]), "{kind}: {commands:?}");
        planner.loaded(2);
        let both = |planner: &ResidencyPlanner| planner.is_resident(0) && planner.is_resident(2);
        let demand = RayDemand { waiting: &[0, 9, 0], active: 0, ..RayDemand::default() };
        let steps = (1..9).find(|_| {
            let _ = planner.step(&demand);
            !both(&planner)
        });
        assert_eq!(steps, Some(2), "{kind}: until a step has seen the two together");
    }
}

/// Rays that share a base, where the budget holds it with one of the units that they need.
#[test]
fn another_partner_takes_no_room_from_units_that_starve_together() {
    let rays = vec![vec![(2, 5)], vec![(2, 4)], vec![(1, 4)]];
    let case = Case { bases: vec![1, 72, 18, 1], others: vec![55, 55], rays };
    for kind in PolicyKind::ALL {
        let catalog = case.catalog();
        let mut witness = Witness::new(&catalog, catalog.least_budget(), kind, 0);
        assert!(steps_to_the_end(&case, &mut witness, 0, 1000).is_some(), "{kind}: rays still wait");
    }
}

/// A device whose free memory is in pieces: a unit finds none beside anything but its partner, though all fits the
/// budget.
#[test]
fn a_load_that_keeps_failing_ends_beside_its_partner_alone() {
    for kind in PolicyKind::ALL {
        let catalog =
            UnitCatalog::new(vec![40, 10, 10, 10], [[0], [1], [2], [3]]).expect("a good catalog").with_bases(2);
        let mut planner = ResidencyPlanner::new(Arc::new(catalog), 60, kind).expect("they fit");
        assert!(planner.keep_resident(1) && planner.keep_resident(2), "{kind}: kept");
        let ended = (0..1000).any(|_| {
            let demand = RayDemand { waiting: &[0, 1, 0, 1], partners: &[0, 4, 0, 2], ..RayDemand::default() };
            for command in planner.step(&demand) {
                match command {
                    ResidencyCommand::Load { unit: 3, .. } if planner.is_resident(2) => planner.failed(3),
                    ResidencyCommand::Load { unit, .. } => planner.loaded(unit),
                    ResidencyCommand::Evict { .. } => {}
                }
            }
            planner.is_resident(1) && planner.is_resident(3)
        });
        assert!(ended, "{kind}: it fails for ever");
    }
}

/// Round robin brought each of these units again and again, and never two that a ray needs together.
#[test]
fn units_that_come_by_turns_meet_their_partners() {
    let case = Case {
        bases: vec![14, 72, 7, 72],
        others: vec![14, 79, 7, 66],
        rays: vec![vec![(1, 7)], vec![(0, 4)], vec![(3, 5)], vec![(1, 5)]],
    };
    for kind in PolicyKind::ALL {
        let catalog = case.catalog();
        let mut witness = Witness::new(&catalog, catalog.least_budget(), kind, 0);
        assert!(steps_to_the_end(&case, &mut witness, 0, 400).is_some(), "{kind}: rays still wait");
    }
}
