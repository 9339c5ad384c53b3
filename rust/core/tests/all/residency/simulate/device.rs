// SPDX-License-Identifier: Apache-2.0
//! The device of the simulation: slots, rounds, the link, and a simulated clock.

use super::rays::Ray;
use super::scene::Workload;
use oocpt_core::residency::{
    LoadPolicy, PlanError, PlannerOptions, RayDemand, ResidencyCommand, ResidencyPlanner, ResidencyStats, UnitId,
};
use std::collections::VecDeque;

/// Capabilities of the device. The defaults are about those of a `PCIe` 4 card with a million rays in flight.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Device {
    /// Bytes the link moves in a second.
    pub(crate) bytes_per_sec: f64,
    /// Seconds from the end of a load's bytes to its unit being usable.
    pub(crate) load_latency_secs: f64,
    /// Link seconds each load costs beside its bytes.
    pub(crate) load_overhead_secs: f64,
    /// Units visited in a second, by all rays together.
    pub(crate) visits_per_sec: f64,
    /// Seconds a round costs however few its rays.
    pub(crate) round_secs: f64,
    /// Segments of slots.
    pub(crate) segments: u32,
    /// Slots of a segment.
    pub(crate) segment_slots: u32,
    /// Rays each simulated ray stands for.
    pub(crate) weight: u32,
    /// The planner is told the visits of resident units.
    pub(crate) counts_visits: bool,
    /// The planner's options.
    pub(crate) planner: PlannerOptions,
}

impl Default for Device {
    fn default() -> Self {
        Self {
            bytes_per_sec: 20e9,
            load_latency_secs: 100e-6,
            load_overhead_secs: 10e-6,
            visits_per_sec: 1e9,
            round_secs: 100e-6,
            segments: 16,
            segment_slots: 512,
            weight: 128,
            counts_visits: true,
            planner: PlannerOptions::default(),
        }
    }
}

/// What a simulated render cost.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Report {
    /// Simulated seconds until the last path was done.
    pub(crate) secs: f64,
    /// Seconds in which rays were traced.
    pub(crate) tracing_secs: f64,
    /// Seconds in which the link moved bytes.
    pub(crate) loading_secs: f64,
    /// Seconds in which nothing could be traced.
    pub(crate) waiting_secs: f64,
    /// Unit visits.
    pub(crate) visits: u64,
    /// All paths were done; `false` = given up after too many rounds without progress.
    pub(crate) finished: bool,
    /// The planner's counters.
    pub(crate) residency: ResidencyStats,
}

/// Number of consecutive rounds without any visit after which a simulation gives up.
const STUCK_ROUNDS: u32 = 10_000;

/// Traces all paths of the workload under a budget. An error when a unit does not fit the budget.
pub(crate) fn run(
    workload: &Workload,
    device: &Device,
    budget: u64,
    policy: Box<dyn LoadPolicy>,
) -> Result<Report, PlanError> {
    let planner = ResidencyPlanner::with_policy(workload.catalog.clone(), budget, policy, device.planner)?;
    let slots = (device.segments * device.segment_slots) as usize;
    let mut simulation = Simulation {
        workload,
        device,
        planner,
        rays: vec![None; slots],
        segment: VecDeque::new(),
        next_path: 0,
        link: VecDeque::new(),
        link_free_secs: 0.0,
        counts: Counts::new(workload.catalog.unit_count()),
        resident: vec![false; workload.catalog.unit_count()],
        report: Report::default(),
    };
    simulation.run();
    Ok(simulation.report)
}

/// The demand of a round.
struct Counts {
    waiting: Vec<u32>,
    next: Vec<u32>,
    visits: Vec<u32>,
    active: u64,
}

impl Counts {
    fn new(units: usize) -> Self {
        Self { waiting: vec![0; units], next: vec![0; units], visits: vec![0; units], active: 0 }
    }
}

struct Simulation<'a> {
    workload: &'a Workload,
    device: &'a Device,
    planner: ResidencyPlanner,
    rays: Vec<Option<Ray>>,
    /// Segments that hold paths, oldest first.
    segment: VecDeque<u32>,
    next_path: u32,
    /// Loads with the times at which they become usable.
    link: VecDeque<(f64, UnitId)>,
    link_free_secs: f64,
    counts: Counts,
    resident: Vec<bool>,
    report: Report,
}

impl Simulation<'_> {
    fn run(&mut self) {
        for segment in 0..self.device.segments {
            self.fill(segment);
        }
        let mut stuck = 0;
        while !self.segment.is_empty() && stuck < STUCK_ROUNDS {
            let visits = self.trace();
            stuck = if visits == 0 { stuck + 1 } else { 0 };
            self.retire();
            self.pass_time(visits);
            self.plan();
        }
        self.report.finished = self.segment.is_empty();
        self.report.residency = self.planner.stats().clone();
    }

    /// Fills a segment with new paths, as long as there are any.
    fn fill(&mut self, segment: u32) {
        let options = &self.workload.options;
        if self.next_path >= options.paths {
            return;
        }
        let first = (segment * self.device.segment_slots) as usize;
        for slot in &mut self.rays[first..first + self.device.segment_slots as usize] {
            *slot = (self.next_path < options.paths).then(|| Ray::camera(options, self.next_path));
            self.next_path = self.next_path.saturating_add(1);
        }
        self.segment.push_back(segment);
    }

    /// One round: every ray visits the units that it can, and rays that know their hit continue with the path's next
    /// ray. Returns the visits.
    fn trace(&mut self) -> u64 {
        let (counts, resident, weight) = (&mut self.counts, &self.resident, self.device.weight);
        counts.visits.fill(0);
        counts.active = 0;
        let mut visits = 0;
        for slot in &mut self.rays {
            let Some(ray) = slot else { continue };
            let pending = ray.pending.as_slice();
            if let Some((&first, others)) = pending.split_first() {
                if pending.iter().all(|&unit| !resident[unit as usize]) {
                    continue;
                }
                counts.waiting[first as usize] -= weight;
                others.iter().for_each(|&unit| counts.next[unit as usize] -= weight);
            }
            ray.trace(resident, |unit| {
                counts.visits[unit as usize] += weight;
                visits += u64::from(weight);
            });
            if let Some((&first, others)) = ray.pending.as_slice().split_first() {
                counts.waiting[first as usize] += weight;
                others.iter().for_each(|&unit| counts.next[unit as usize] += weight);
                continue;
            }
            *slot = ray.next(&self.workload.options);
            counts.active += u64::from(weight) * u64::from(slot.is_some());
        }
        visits
    }

    /// Gives new paths to segments whose paths are done, oldest first.
    fn retire(&mut self) {
        let slots = self.device.segment_slots;
        while let Some(&oldest) = self.segment.front() {
            let first = (oldest * slots) as usize;
            if self.rays[first..first + slots as usize].iter().any(Option::is_some) {
                break;
            }
            self.segment.pop_front();
            let before = self.segment.len();
            self.fill(oldest);
            self.counts.active += u64::from(slots * self.device.weight) * (self.segment.len() - before) as u64;
        }
    }

    /// Advances the clock by the round, or to the next arrival if there was nothing to trace.
    fn pass_time(&mut self, visits: u64) {
        #[expect(clippy::cast_precision_loss, reason = "an estimate")]
        let traced = visits as f64 / self.device.visits_per_sec;
        let mut secs = self.report.secs + self.device.round_secs + traced;
        if visits > 0 {
            self.report.tracing_secs += secs - self.report.secs;
        } else {
            if let Some(&(arrival, _)) = self.link.front() {
                secs = secs.max(arrival);
            }
            self.report.waiting_secs += secs - self.report.secs;
        }
        self.report.secs = secs;
        self.report.visits += visits;
        while let Some(&(arrival, unit)) = self.link.front()
            && arrival <= secs
        {
            self.planner.loaded(unit);
            self.resident[unit as usize] = true;
            self.link.pop_front();
        }
    }

    fn plan(&mut self) {
        let counts = &self.counts;
        let visits = if self.device.counts_visits { counts.visits.as_slice() } else { &[] };
        let demand = RayDemand {
            waiting: &counts.waiting,
            next: &counts.next,
            visits,
            active: counts.active,
            requested: None,
            ..RayDemand::default()
        };
        for command in self.planner.step(&demand) {
            let (unit, assets) = match command {
                ResidencyCommand::Load { unit, assets } => (unit, assets),
                ResidencyCommand::Evict { unit, .. } => {
                    self.resident[unit as usize] = false;
                    continue;
                }
            };
            let bytes: u64 = assets.iter().map(|&asset| self.workload.catalog.bytes(asset)).sum();
            #[expect(clippy::cast_precision_loss, reason = "an estimate")]
            let secs = bytes as f64 / self.device.bytes_per_sec + self.device.load_overhead_secs;
            self.link_free_secs = self.link_free_secs.max(self.report.secs) + secs;
            self.report.loading_secs += secs;
            self.link.push_back((self.link_free_secs + self.device.load_latency_secs, unit));
        }
    }
}
