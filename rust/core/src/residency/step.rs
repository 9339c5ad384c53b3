// SPDX-License-Identifier: Apache-2.0
//! One step of planning: reads the demand, makes room if the budget shrank, loads units that starve, then units that
//! are demanded, then units that soon will be. Cost: a scan of the whole demand if the caller does not list the units
//! with demand, then a visit of the units with demand, and of the resident units if room is needed.

use super::entry::UnitState;
use super::planner::{LoadKind, ResidencyPlanner, UnitLoad};
use super::policy::PolicyView;
use super::victims::{EvictionHeap, EvictionVictim};
use super::{AssetId, RayDemand, ResidencyCommand, UnitId, at};

/// Number of candidates that a policy is asked for in a step.
const CANDIDATES: usize = 256;
/// Number of further candidates that are small, such as tiles of textures: together they weigh no more than a few
/// units.
const SMALL_CANDIDATES: usize = 4096;
const SMALL_BYTES: u64 = 256 << 10;
/// Number of candidates without room after which the step gives up.
const REFUSALS: usize = 16;
/// A unit starves when this many loads per demanded unit went before it, or this many steps.
const PATIENCE: u32 = 4;
const PATIENCE_MIN: u32 = 64;
/// The device idles if so many times more rays wait than can be traced.
const IDLE_RATIO: u64 = 64;
/// Prefetches have one in so many of the bytes in flight.
pub(super) const PREFETCH_SHARE: u64 = 4;
const DEFAULT_IN_FLIGHT_SHARE: u64 = 8;
/// In the simulation all policies are slower with several hundred MiB in flight, because the choices are stale by then.
const DEFAULT_IN_FLIGHT_MAX: u64 = 128 << 20;
/// Factor by which more bytes may be in flight when the device idles.
const IDLE_IN_FLIGHT: u64 = 4;

/// Number of resident units that are considered for eviction in a step, as long as one of them may be evicted.
const VICTIMS: usize = 4096;

/// Result of an attempt to load.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum LoadOutcome {
    Issued,
    /// There is no room, and nothing may be evicted for it now.
    NoRoom,
    /// Enough bytes are in flight.
    Full,
    /// An asset is being loaded for another unit.
    Shared,
    /// The caller of [`ResidencyPlanner::step_if`] refused it.
    Refused,
}

/// A load that the planner is about to begin because rays wait for the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadProposal {
    /// The unit.
    pub unit: UnitId,
    /// Bytes that the device does not hold.
    pub bytes: u64,
    /// True if nearly all rays wait, so that the device would be idle.
    pub is_idle: bool,
}

/// Decides which units a load may evict.
#[derive(Clone, Copy)]
pub(super) enum LoadPriority {
    /// It may evict every unit that is not pinned.
    Must,
    /// It may evict units that the policy gives up for this value.
    Worth(f64),
    /// As `Worth`, but only units that no ray waits for.
    Ahead(f64),
}

/// The demand of a step, and the commands planned for it so far.
pub(super) struct DemandPlan<'a> {
    pub(super) demand: RayDemand<'a>,
    pub(super) demanded: Vec<UnitId>,
    rays_waiting: u64,
    victims: Option<EvictionHeap>,
    commands: Vec<ResidencyCommand>,
    issued: usize,
    agrees: &'a mut dyn FnMut(&LoadProposal) -> bool,
}

impl DemandPlan<'_> {
    /// Returns true if nearly all rays wait.
    pub(super) fn is_idle(&self) -> bool {
        self.demand.active.saturating_mul(IDLE_RATIO) < self.rays_waiting
    }
}

impl ResidencyPlanner {
    /// Plans one step. The caller performs the commands in order; the lead of the module says when memory may be freed.
    pub fn step(&mut self, demand: &RayDemand<'_>) -> Vec<ResidencyCommand> {
        self.step_if(demand, &mut |_| true)
    }

    /// As [`Self::step`], but begins only those loads of demanded units that `agrees` accepts; another step asks again.
    pub fn step_if(
        &mut self,
        demand: &RayDemand<'_>,
        agrees: &mut dyn FnMut(&LoadProposal) -> bool,
    ) -> Vec<ResidencyCommand> {
        self.step = self.step.wrapping_add(1);
        self.stats.steps += 1;
        let commands = std::mem::take(&mut self.dropped);
        let mut plan = DemandPlan {
            demand: *demand,
            demanded: Vec::new(),
            rays_waiting: 0,
            victims: None,
            commands,
            issued: 0,
            agrees,
        };
        self.observe(&mut plan);
        self.shrink(&mut plan);
        self.settle_pairs();
        if self.pay_owed(&mut plan) && self.load_starving(&mut plan) {
            self.load_demanded(&mut plan);
            self.fill_room(&mut plan);
            self.load_mapped(&mut plan);
        }
        self.count_bytes();
        plan.commands
    }

    /// Ages and heats the demanded units, and lists those that could be loaded.
    fn observe(&mut self, plan: &mut DemandPlan<'_>) {
        let (step, loads) = (self.step, self.loads_begun);
        for_each_nonzero(None, plan.demand.visits, self.entries.len(), |unit, rays| {
            let is_mapped = plan.demand.mapped.get(unit as usize) == Some(&true);
            let entry = &mut self.entries[unit as usize];
            if is_mapped || entry.state == UnitState::Resident {
                entry.visited(step, rays);
            }
        });
        for_each_nonzero(plan.demand.requested, plan.demand.waiting, self.entries.len(), |unit, rays| {
            let entry = &mut self.entries[unit as usize];
            entry.waited_for(step, rays);
            if entry.state == UnitState::Resident {
                return;
            }
            if step == 1 || entry.seen != step.wrapping_sub(1) {
                entry.since = step;
                entry.since_loads = loads;
            }
            entry.seen = step;
            plan.rays_waiting += u64::from(rays);
            if entry.state == UnitState::Absent && !entry.pauses(step) {
                plan.demanded.push(unit);
            }
        });
    }

    /// Evicts units until the bytes held fit a budget that was lowered.
    fn shrink(&mut self, plan: &mut DemandPlan<'_>) {
        while self.holdings.held() > self.budget {
            self.find_victims(plan);
            let unpinned = plan.victims.as_mut().and_then(EvictionHeap::pop).map(|victim| victim.unit);
            let Some(unit) = unpinned.or_else(|| self.residents.first().copied()) else { break };
            let command = self.evict(unit);
            plan.commands.push(command);
        }
    }

    /// Loads units that waited out of all proportion, oldest first. Returns `false` if one of them has to wait for
    /// room: then nothing else is loaded, so that room becomes free.
    fn load_starving(&mut self, plan: &mut DemandPlan<'_>) -> bool {
        let demanded = u32::try_from(plan.demanded.len()).unwrap_or(u32::MAX);
        let limit = demanded.saturating_mul(PATIENCE).saturating_add(PATIENCE_MIN);
        let waited = |unit: UnitId| {
            let entry = &self.entries[unit as usize];
            (self.step.wrapping_sub(entry.since), self.loads_begun.wrapping_sub(entry.since_loads))
        };
        let mut starving: Vec<(u32, UnitId)> = Vec::new();
        for &unit in &plan.demanded {
            let (steps, loads) = waited(unit);
            if steps > limit || (steps > PATIENCE_MIN && loads > limit) {
                starving.push((u32::MAX - steps, unit));
            }
        }
        starving.sort_unstable();
        for &(_, unit) in &starving {
            if !self.load_with_partner(plan, unit) {
                return false;
            }
        }
        if !starving.is_empty() {
            plan.demanded.retain(|&unit| self.entries[unit as usize].state == UnitState::Absent);
        }
        true
    }

    fn load_demanded(&mut self, plan: &mut DemandPlan<'_>) {
        let view = PolicyView {
            catalog: &self.catalog,
            demand: plan.demand,
            entries: &self.entries,
            holdings: &self.holdings,
            step: self.step,
        };
        let is_small = |unit: &&UnitId| self.catalog.closure_bytes(**unit) <= SMALL_BYTES;
        let small = plan.demanded.iter().filter(is_small).count().min(SMALL_CANDIDATES);
        let candidates = self.policy.order(&view, &plan.demanded, CANDIDATES + small);
        let refusals = self.try_each(plan, &candidates);
        // Rays wait, none can be traced, and nothing is loading: whatever the policy thinks of the swap, it is
        // progress.
        if plan.issued == 0 && self.loading.is_empty() && plan.is_idle() {
            for &(_, unit) in candidates.iter().take(REFUSALS) {
                if self.try_load(plan, unit, LoadPriority::Must) == LoadOutcome::Issued {
                    break;
                }
            }
        }
        // Rays may have waited for a unit that was evicted now.
        let evicted = plan.commands.iter().any(|command| matches!(command, ResidencyCommand::Evict { .. }));
        if refusals == 0 && !evicted && plan.issued == plan.demanded.len() {
            self.prefetch(plan);
        }
    }

    /// Loads units, in this order, as long as each is worth more than the units that are evicted for it; returns how
    /// many found no room.
    pub(super) fn try_each(&mut self, plan: &mut DemandPlan<'_>, candidates: &[(f64, UnitId)]) -> usize {
        let mut refusals = 0;
        for &(value, unit) in candidates {
            match self.try_load(plan, unit, LoadPriority::Worth(value)) {
                LoadOutcome::Issued | LoadOutcome::Shared | LoadOutcome::Refused => {}
                LoadOutcome::NoRoom => refusals += 1,
                LoadOutcome::Full => break,
            }
            if refusals == REFUSALS {
                break;
            }
        }
        refusals
    }

    /// Begins to load a unit without evicting another one. After failed loads all others may be evicted in the end:
    /// then the free bytes are contiguous.
    pub(super) fn try_load_beside(
        &mut self,
        plan: &mut DemandPlan<'_>,
        unit: UnitId,
        other: Option<UnitId>,
        press: LoadPriority,
    ) -> LoadOutcome {
        let Some(missing) = self.holdings.missing(&self.catalog, unit) else { return LoadOutcome::Shared };
        let (kind, limit) = match press {
            LoadPriority::Must | LoadPriority::Worth(_) => (LoadKind::Demanded, self.in_flight_limit(plan)),
            LoadPriority::Ahead(_) => (LoadKind::Prefetch, self.in_flight_limit(plan) / PREFETCH_SHARE),
        };
        let in_flight = self.in_flight[kind as usize];
        if in_flight > 0 && in_flight.saturating_add(missing) > limit {
            return LoadOutcome::Full;
        }
        let of_both = [Some(unit), other].into_iter().flatten().map(|unit| self.catalog.closure_bytes(unit));
        let allowance = of_both.fold(0, u64::saturating_add).max(self.allowance).min(self.budget);
        if self.holdings.held() + missing > allowance {
            let first = self.first_victim(plan);
            if !first.is_some_and(|first| self.may_displace(plan, press, first)) {
                return LoadOutcome::NoRoom;
            }
        }
        let proposal = LoadProposal { unit, bytes: missing, is_idle: plan.is_idle() };
        if kind == LoadKind::Demanded && !(plan.agrees)(&proposal) {
            return LoadOutcome::Refused;
        }
        let mut assets = Vec::new();
        self.holdings.acquire(&self.catalog, unit, &mut assets);
        let room = kind == LoadKind::Demanded || self.leaves_room(plan);
        let Some(victims) = room.then(|| self.make_room(plan, press, allowance)).flatten() else {
            self.holdings.release(&self.catalog, unit, &mut Vec::new());
            return LoadOutcome::NoRoom;
        };
        for (victim, freed) in victims {
            self.forget(victim.unit);
            plan.commands.push(ResidencyCommand::Evict { unit: victim.unit, assets: freed });
        }
        self.issue(plan, UnitLoad { unit, assets, bytes: missing, kind });
        LoadOutcome::Issued
    }

    /// Releases victims until no more than `allowance` is held; releases nothing if that is not possible.
    fn make_room(
        &mut self,
        plan: &mut DemandPlan<'_>,
        press: LoadPriority,
        allowance: u64,
    ) -> Option<Vec<(EvictionVictim, Vec<AssetId>)>> {
        let mut gone: Vec<(EvictionVictim, Vec<AssetId>)> = Vec::new();
        while self.holdings.held() > allowance {
            let next = self.first_victim(plan);
            let Some(victim) = next.filter(|&victim| self.may_displace(plan, press, victim)) else {
                let victims = plan.victims.get_or_insert_default();
                for (victim, _) in gone {
                    self.holdings.acquire(&self.catalog, victim.unit, &mut Vec::new());
                    self.count_tile(victim.unit);
                    victims.put_back(victim);
                }
                return None;
            };
            plan.victims.get_or_insert_default().pop();
            let mut freed = Vec::new();
            self.holdings.release(&self.catalog, victim.unit, &mut freed);
            self.count_tile_gone(victim.unit);
            gone.push((victim, freed));
        }
        Some(gone)
    }

    fn may_displace(&self, plan: &DemandPlan<'_>, press: LoadPriority, victim: EvictionVictim) -> bool {
        match press {
            LoadPriority::Must => true,
            LoadPriority::Worth(value) => self.policy.displaces(value, victim.loss),
            LoadPriority::Ahead(value) => {
                at(plan.demand.waiting, victim.unit) == 0 && self.policy.displaces(value, victim.loss)
            }
        }
    }

    pub(super) fn is_unpinned(&self, unit: UnitId) -> bool {
        let entry = &self.entries[unit as usize];
        entry.holds == 0 && self.step.wrapping_sub(entry.usable) >= self.pin_steps()
    }

    /// The next unit that may be evicted.
    fn first_victim(&mut self, plan: &mut DemandPlan<'_>) -> Option<EvictionVictim> {
        loop {
            self.find_victims(plan);
            let first = plan.victims.as_ref().and_then(EvictionHeap::first)?;
            // Since it was listed, the loaded unit may have come to need it, or other tiles may have been evicted.
            if self.entries[first.unit as usize].holds == 0 && !self.is_tile_to_stay(first.unit) {
                return Some(first);
            }
            plan.victims.get_or_insert_default().pop();
        }
    }

    /// Lists units that may be evicted: first some of the resident units, from an index that cycles; after these are
    /// used up the rest.
    fn find_victims(&mut self, plan: &mut DemandPlan<'_>) {
        let mut victims = plan.victims.take().unwrap_or_else(|| {
            let count = self.residents.len();
            self.hand = if count <= VICTIMS { 0 } else { (self.hand + VICTIMS) % count };
            let (before, after) = self.residents.split_at(self.hand);
            EvictionHeap::new([after, before].concat())
        });
        let view = self.view(plan.demand);
        let (keep_below, mapped) = (plan.demand.keep_below, plan.demand.mapped);
        let is_kept = |unit: UnitId| unit < keep_below && mapped.get(unit as usize) != Some(&true);
        let may_go = |&unit: &UnitId| {
            let is_kept = is_kept(unit) || self.is_tile_to_stay(unit);
            self.entries[unit as usize].state == UnitState::Resident && self.is_unpinned(unit) && !is_kept
        };
        while victims.first().is_none() && victims.list(&*self.policy, &view, VICTIMS, may_go) {}
        plan.victims = Some(victims);
    }

    fn issue(&mut self, plan: &mut DemandPlan<'_>, load: UnitLoad) {
        self.holdings.set_in_flight(&load.assets, true);
        self.count_tile(load.unit);
        self.stats.peak_bytes = self.stats.peak_bytes.max(self.holdings.held());
        self.entries[load.unit as usize].state = UnitState::Loading;
        self.loads_begun = self.loads_begun.wrapping_add(1);
        self.in_flight[load.kind as usize] += load.bytes;
        self.policy.issued(load.unit);
        plan.issued += usize::from(load.kind == LoadKind::Demanded);
        plan.commands.push(ResidencyCommand::Load { unit: load.unit, assets: load.assets.clone() });
        self.loading.insert(load.unit, load);
    }

    fn evict(&mut self, unit: UnitId) -> ResidencyCommand {
        let mut assets = Vec::new();
        self.holdings.release(&self.catalog, unit, &mut assets);
        self.count_tile_gone(unit);
        self.forget(unit);
        ResidencyCommand::Evict { unit, assets }
    }

    /// Removes a unit from the resident ones after its assets were released.
    fn forget(&mut self, unit: UnitId) {
        let slot = self.entries[unit as usize].slot;
        self.residents.swap_remove(slot as usize);
        if let Some(&moved) = self.residents.get(slot as usize) {
            self.entries[moved as usize].slot = slot;
        }
        self.entries[unit as usize].state = UnitState::Absent;
        self.stats.evictions += 1;
    }

    pub(super) fn view<'a>(&'a self, demand: RayDemand<'a>) -> PolicyView<'a> {
        PolicyView { catalog: &self.catalog, demand, entries: &self.entries, holdings: &self.holdings, step: self.step }
    }

    pub(super) fn in_flight_limit(&self, plan: &DemandPlan<'_>) -> u64 {
        let more = if plan.is_idle() { IDLE_IN_FLIGHT } else { 1 };
        match self.options.in_flight_bytes {
            0 => (self.budget / DEFAULT_IN_FLIGHT_SHARE).saturating_mul(more).min(DEFAULT_IN_FLIGHT_MAX),
            bytes => bytes.saturating_mul(more),
        }
    }
}

/// Calls `visit` for the values above 0 of the first `count`, ascending: those of `asked`, or all, skipping zeros 16 at
/// a time.
pub(super) fn for_each_nonzero(
    requested: Option<&[UnitId]>,
    values: &[u32],
    count: usize,
    mut visit: impl FnMut(UnitId, u32),
) {
    let values = &values[..values.len().min(count)];
    if let Some(requested) = requested {
        let value_of = |unit: UnitId| Some((unit, *values.get(unit as usize)?));
        requested.iter().filter_map(|unit| value_of(*unit)).filter(|(_, value)| *value != 0).for_each(
            |(unit, value)| {
                visit(unit, value);
            },
        );
        return;
    }
    for (block, values) in (0_u32..).step_by(16).zip(values.chunks(16)) {
        if values.iter().fold(0, |any, &value| any | value) != 0 {
            for (unit, &value) in (block..).zip(values) {
                if value != 0 {
                    visit(unit, value);
                }
            }
        }
    }
}
