// SPDX-License-Identifier: Apache-2.0
//! Tracks the memory of a device beside a planner, from its commands alone, and checks every command.

use oocpt_core::residency::{PlannerOptions, PolicyKind, RayDemand, ResidencyCommand, ResidencyPlanner, UnitCatalog};
use proptest::prelude::*;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

/// Steps that must have seen a unit usable before it may go.
const PIN_STEPS: u32 = 2;

pub(crate) struct Witness {
    pub(crate) planner: ResidencyPlanner,
    pub(crate) budget: u64,
    pub(crate) step: u32,
    /// Units that are loading, with the assets of their loads.
    pub(crate) loading: BTreeMap<u32, Vec<u32>>,
    /// Usable units, with the step after which they became so and whether rays had asked for them.
    pub(crate) resident: BTreeMap<u32, (u32, bool)>,
    /// Assets that are on the device or being loaded.
    pub(crate) held: BTreeSet<u32>,
    pub(crate) commands: Vec<ResidencyCommand>,
    /// True after a load failed or the budget was lowered: evictions may seem early from here on.
    pub(crate) disturbed: bool,
    requested: BTreeSet<u32>,
}

impl Witness {
    pub(crate) fn new(catalog: &Arc<UnitCatalog>, budget: u64, kind: PolicyKind, in_flight_bytes: u64) -> Self {
        let options = PlannerOptions { in_flight_bytes, ..PlannerOptions::default() };
        let planner = ResidencyPlanner::with_policy(catalog.clone(), budget, kind.policy(), options);
        Self {
            planner: planner.expect("the budget fits the largest unit"),
            budget,
            step: 0,
            loading: BTreeMap::new(),
            resident: BTreeMap::new(),
            held: BTreeSet::new(),
            commands: Vec::new(),
            disturbed: false,
            requested: BTreeSet::new(),
        }
    }

    pub(crate) fn bytes(&self, assets: &[u32]) -> u64 {
        assets.iter().map(|&asset| self.planner.catalog().bytes(asset)).sum()
    }

    fn held_bytes(&self) -> u64 {
        self.held.iter().map(|&asset| self.planner.catalog().bytes(asset)).sum()
    }

    /// Assets of a unit that no other unit loading or resident has, nor the one it makes room for.
    fn only_of(&self, unit: u32, successor: Option<&u32>) -> Vec<u32> {
        let holders = || self.loading.keys().chain(self.resident.keys()).chain(successor);
        let others = || holders().filter(move |&&other| other != unit);
        let catalog = self.planner.catalog();
        let shared = |asset: &u32| others().any(|&other| catalog.assets(other).contains(asset));
        catalog.assets(unit).iter().copied().filter(|asset| self.held.contains(asset) && !shared(asset)).collect()
    }

    /// One step of the planner; every command is checked as it is carried out.
    pub(crate) fn step(&mut self, demand: &RayDemand<'_>) {
        self.step += 1;
        let commands = self.planner.step(demand);
        let mut evicted_bytes = 0;
        for (place, command) in commands.iter().enumerate() {
            match command {
                ResidencyCommand::Evict { unit, assets } => {
                    let successor = commands[place..].iter().find_map(|command| match command {
                        ResidencyCommand::Load { unit, .. } => Some(unit),
                        ResidencyCommand::Evict { .. } => None,
                    });
                    let resident = self.resident.contains_key(unit);
                    // Assets that a following load shares stay, and assets that were evicted for another reason are
                    // loaded again with it; failed loads divide among themselves the assets that they drop (the count
                    // of bytes below detects a leak).
                    let frees = [self.only_of(*unit, successor), self.only_of(*unit, None)];
                    let drops = !resident && assets.iter().all(|asset| frees[1].contains(asset));
                    let right = frees[0] == *assets || (self.disturbed && frees[1] == *assets) || drops;
                    assert!(right, "{assets:?}, not {frees:?}");
                    if resident {
                        self.check_pin(*unit, demand);
                        evicted_bytes += self.bytes(assets);
                    }
                    self.resident.remove(unit);
                    self.held.retain(|asset| !assets.contains(asset));
                }
                ResidencyCommand::Load { unit, assets } => {
                    self.check_load(*unit, assets, demand, &mut evicted_bytes);
                }
            }
        }
        let bytes = self.held_bytes();
        assert!(bytes <= self.budget || !self.loading.is_empty(), "{bytes} bytes under {}", self.budget);
        assert_eq!(self.planner.stats().bytes_held, bytes, "the planner's count of bytes");
        assert!(evicted_bytes == 0 || self.disturbed, "an eviction makes room for a load");
        self.commands.extend(commands);
    }

    fn check_pin(&self, unit: u32, demand: &RayDemand<'_>) {
        if let Some(&(since, demanded)) = self.resident.get(&unit)
            && !self.disturbed
        {
            let seen = self.step - since;
            assert!(!demanded || seen >= PIN_STEPS, "unit {unit} goes after {seen} steps, {demand:?}");
        }
    }

    fn check_load(&mut self, unit: u32, assets: &[u32], demand: &RayDemand<'_>, evicted: &mut u64) {
        assert!(!self.resident.contains_key(&unit), "unit {unit} is loaded twice");
        let in_flight: BTreeSet<u32> = self.loading.values().flatten().copied().collect();
        let all = self.planner.catalog().assets(unit).to_vec();
        let missing: Vec<u32> = all.iter().copied().filter(|asset| !self.held.contains(asset)).collect();
        assert_eq!(missing, assets, "a load brings exactly what is not there");
        assert!(all.iter().all(|asset| !in_flight.contains(asset)), "a load relies on another in flight");
        let needed = self.held_bytes() + *evicted + self.bytes(assets) > self.budget;
        assert!(*evicted == 0 || needed || self.disturbed, "an eviction that was not needed");
        *evicted = 0;
        let waiting = |unit: u32| demand.waiting.get(unit as usize).copied().unwrap_or(0);
        if waiting(unit) == 0 {
            assert!(demand.next.get(unit as usize).is_some_and(|&rays| rays > 0), "unit {unit}: nobody asked");
            for other in 0..u32::try_from(self.planner.catalog().unit_count()).expect("few") {
                let coming = self.loading.contains_key(&other) || self.resident.contains_key(&other);
                assert!(waiting(other) == 0 || coming || self.disturbed, "{unit} is loaded ahead of {other}");
            }
        } else {
            self.requested.insert(unit);
        }
        assert!(self.loading.insert(unit, assets.to_vec()).is_none(), "unit {unit} is loaded twice");
        self.held.extend(assets);
        assert!(self.held_bytes() <= self.budget, "{} bytes under {}", self.held_bytes(), self.budget);
    }

    pub(crate) fn loaded(&mut self, unit: u32) {
        self.planner.loaded(unit);
        if self.loading.remove(&unit).is_some() {
            self.resident.insert(unit, (self.step, self.requested.remove(&unit)));
            assert!(self.planner.is_resident(unit), "a loaded unit is resident");
        }
    }

    pub(crate) fn failed(&mut self, unit: u32) {
        self.planner.failed(unit);
        if let Some(assets) = self.loading.remove(&unit) {
            self.held.retain(|asset| !assets.contains(asset));
            self.disturbed = true;
            assert!(!self.planner.is_resident(unit), "a unit that failed is not resident");
        }
    }

    pub(crate) fn set_budget(&mut self, budget: u64) {
        if self.planner.set_budget(budget).is_ok() {
            self.disturbed |= budget < self.budget;
            self.budget = budget;
        }
    }
}

/// Catalogs of a few units that share meshes.
pub(crate) fn catalogs() -> impl Strategy<Value = Arc<UnitCatalog>> {
    let meshes = prop::collection::vec(0_u64..200, 1..6);
    let blocks = prop::collection::vec((1_u64..100, prop::collection::vec(0_usize..6, 0..4)), 1..10);
    (meshes, blocks).prop_map(|(meshes, blocks)| {
        let count = u32::try_from(blocks.len()).expect("few");
        let mut bytes: Vec<u64> = blocks.iter().map(|(bytes, _)| *bytes).collect();
        bytes.extend(&meshes);
        let row = |(unit, (_, used)): (u32, &(u64, Vec<usize>))| {
            let used = used.iter().map(|mesh| count + u32::try_from(mesh % meshes.len()).expect("few"));
            std::iter::once(unit).chain(used).collect::<Vec<u32>>()
        };
        Arc::new(UnitCatalog::new(bytes, (0..).zip(&blocks).map(row)).expect("a good catalog"))
    })
}

/// A budget between one unit (`0`) and everything (`100`).
pub(crate) fn budget_of(catalog: &UnitCatalog, percent: u64) -> u64 {
    let least = catalog.least_budget();
    least + catalog.total_bytes().saturating_sub(least) * percent / 100
}

pub(crate) fn kinds() -> impl Strategy<Value = PolicyKind> {
    prop::sample::select(PolicyKind::ALL.to_vec())
}
