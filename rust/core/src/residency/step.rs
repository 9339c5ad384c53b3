// SPDX-License-Identifier: Apache-2.0
//! One step of planning: read the demand, make room where the budget shrank, load what starves, what is demanded, and
//! what soon will be. Cost: a scan of the demand where the caller does not
//! say what was asked for, then the units with demand, the resident units when room is needed.

use super::entry::UnitState;
use super::planner::{LoadKind, ResidencyPlanner, UnitLoad};
use super::policy::PolicyView;
use super::victims::{EvictionHeap, EvictionVictim};
use super::{AssetId, RayDemand, ResidencyCommand, UnitId, at};

/// Candidates a policy is asked for in a step.
const CANDIDATES: usize = 256;
/// As many more that are small, tiles of textures for instance: so many of them weigh no more than a few units.
const SMALL_CANDIDATES: usize = 4096;
const SMALL_BYTES: u64 = 256 << 10;
/// Candidates that may find no room before the step gives up.
const REFUSALS: usize = 16;
/// A unit starves when so many loads per demanded unit went before it, or so many steps.
const PATIENCE: u32 = 4;
const PATIENCE_MIN: u32 = 64;
/// The device idles when so many times more rays wait than can be traced.
const IDLE_RATIO: u64 = 64;
/// Share of the bytes in flight that prefetches have.
pub(super) const PREFETCH_SHARE: u64 = 4;
const DEFAULT_IN_FLIGHT_SHARE: u64 = 8;
/// In the simulation all policies are slower with several hundred MiB in flight: what was chosen is stale by then.
const DEFAULT_IN_FLIGHT_MAX: u64 = 128 << 20;
/// So many times more may be in flight when the device idles.
const IDLE_IN_FLIGHT: u64 = 4;

/// Resident units that are looked at in a step for one to evict, as long as one of them may go.
const VICTIMS: usize = 4096;

/// What became of a try to load.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum LoadOutcome {
    Issued,
    /// Nothing may go for it now.
    NoRoom,
    /// Enough is in flight.
    Full,
    /// An asset is on its way for another unit.
    Shared,
    /// The caller of [`ResidencyPlanner::step_if`] does not want it.
    Refused,
}

/// A load that the planner is about to begin because rays wait for the unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadProposal {
    /// The unit.
    pub unit: UnitId,
    /// Bytes that the device does not hold.
    pub bytes: u64,
    /// Nearly all rays wait: the device would do nothing else.
    pub is_idle: bool,
}

/// How hard a load may press.
#[derive(Clone, Copy)]
pub(super) enum LoadPriority {
    /// Whatever is not pinned may go.
    Must,
    /// What the policy lets go for this value.
    Worth(f64),
    /// As `Worth`, but of units nobody waits for.
    Ahead(f64),
}

/// The demand of a step and what was made of it so far.
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
    /// Nearly all rays wait.
    pub(super) fn is_idle(&self) -> bool {
        self.demand.active.saturating_mul(IDLE_RATIO) < self.rays_waiting
    }
}

impl ResidencyPlanner {
    /// Plans one step. Perform the commands in order; see the module's documentation for when memory may be freed.
    pub fn step(&mut self, demand: &RayDemand<'_>) -> Vec<ResidencyCommand> {
        self.step_if(demand, &mut |_| true)
    }

    /// As [`Self::step`], but begins only such loads of demanded units as `agrees` agrees to; another step asks again.
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

    /// Ages and heats what is demanded, and lists what could be loaded.
    fn observe(&mut self, plan: &mut DemandPlan<'_>) {
        let (step, loads) = (self.step, self.loads_begun);
        for_each_nonzero(None, plan.demand.visits, self.entries.len(), |unit, rays| {
            let is_mapped = plan.demand.mapped.get(unit as usize) == Some(&true);
            let entry = &mut self.entries[unit as usize];
            if is_mapped || entry.state == UnitState::Resident {
                entry.visited(step, rays);
            }
        });
        for_each_nonzero(plan.demand.asked, plan.demand.waiting, self.entries.len(), |unit, rays| {
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

    /// Evicts down to a budget that was lowered.
    fn shrink(&mut self, plan: &mut DemandPlan<'_>) {
        while self.holdings.held() > self.budget {
            self.find_victims(plan);
            let unpinned = plan.victims.as_mut().and_then(EvictionHeap::pop).map(|victim| victim.unit);
            let Some(unit) = unpinned.or_else(|| self.residents.first().copied()) else { break };
            let command = self.evict(unit);
            plan.commands.push(command);
        }
    }

    /// Loads what waited out of all proportion, oldest first. `false` when one of them has to wait for room: then
    /// nothing else is loaded, so that the room comes.
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
        // Rays wait, none can be traced, nothing comes: whatever the policy thinks of the swap, it is progress.
        if plan.issued == 0 && self.loading.is_empty() && plan.is_idle() {
            for &(_, unit) in candidates.iter().take(REFUSALS) {
                if self.try_load(plan, unit, LoadPriority::Must) == LoadOutcome::Issued {
                    break;
                }
            }
        }
        // What was evicted now may have been waited for.
        let evicted = plan.commands.iter().any(|command| matches!(command, ResidencyCommand::Evict { .. }));
        if refusals == 0 && !evicted && plan.issued == plan.demanded.len() {
            self.prefetch(plan);
        }
    }

    /// Loads units, in this order, where each is worth more than what goes for it; how many found no room.
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

    /// Begins to load a unit, while another one stays. Where loads have failed, all others go at last: what is free is
    /// in one piece then.
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

    /// Releases victims until no more is held than `allowance`; releases nothing when that cannot be.
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

    /// The next one that may go.
    fn first_victim(&mut self, plan: &mut DemandPlan<'_>) -> Option<EvictionVictim> {
        loop {
            self.find_victims(plan);
            let first = plan.victims.as_ref().and_then(EvictionHeap::first)?;
            // Since it was listed, it may have become what is loaded needs, or other tiles may have gone.
            if self.entries[first.unit as usize].holds == 0 && !self.is_tile_to_stay(first.unit) {
                return Some(first);
            }
            plan.victims.get_or_insert_default().pop();
        }
    }

    /// Lists who may go: first some of the resident units, from a hand that goes round; when these are used up the
    /// rest.
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

    /// A resident unit is one no more; its assets were released.
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

/// Calls `visit` for the values above 0 of the first `count`, ascending: those of `asked`, or it skips zeros 16 at a
/// time.
pub(super) fn for_each_nonzero(
    asked: Option<&[UnitId]>,
    values: &[u32],
    count: usize,
    mut visit: impl FnMut(UnitId, u32),
) {
    let values = &values[..values.len().min(count)];
    if let Some(asked) = asked {
        let value_of = |unit: UnitId| Some((unit, *values.get(unit as usize)?));
        asked.iter().filter_map(|unit| value_of(*unit)).filter(|(_, value)| *value != 0).for_each(|(unit, value)| {
            visit(unit, value);
        });
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
