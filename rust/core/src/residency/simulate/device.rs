// SPDX-License-Identifier: Apache-2.0
//! The device of the simulation: slots, rounds, the link, and a simulated clock.

use super::super::{
    LoadPolicy, PlanError, PlannerOptions, RayDemand, ResidencyCommand, ResidencyPlanner, ResidencyStats, UnitId,
};
use super::rays::SimulatedRay;
use super::scene::SimulatedScene;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Capabilities of the device. The defaults are about those of a `PCIe` 4 card with a million rays in flight.
#[derive(Clone, Copy, Debug)]
pub struct SimulatedDevice {
    /// Bandwidth of the link, bytes per second.
    pub bytes_per_sec: f64,
    /// Seconds from the end of a load's bytes to its unit being usable.
    pub load_latency_secs: f64,
    /// Seconds of the link that each load costs besides its bytes.
    pub load_overhead_secs: f64,
    /// Number of unit visits per second, by all rays together.
    pub visits_per_sec: f64,
    /// Least number of seconds of a round.
    pub round_secs: f64,
    /// Number of segments of slots.
    pub segments: u32,
    /// Number of slots of a segment.
    pub segment_slots: u32,
    /// Number of rays that each simulated ray stands for.
    pub weight: u32,
    /// True if the planner is told the visits of resident units.
    pub counts_visits: bool,
    /// Options of the planner.
    pub planner: PlannerOptions,
}

impl Default for SimulatedDevice {
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

/// Costs of a simulated render.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SimulationReport {
    /// Simulated seconds until the last path ended.
    pub secs: f64,
    /// Seconds in which rays were traced.
    pub tracing_secs: f64,
    /// Seconds in which the link moved bytes.
    pub loading_secs: f64,
    /// Seconds in which nothing could be traced.
    pub waiting_secs: f64,
    /// Number of unit visits.
    pub visits: u64,
    /// True if all paths ended; false = given up after too many rounds without progress.
    pub finished: bool,
    /// Counters of the planner.
    pub residency: ResidencyStats,
}

/// Number of consecutive rounds without any visit after which a simulation gives up.
const STUCK_ROUNDS: u32 = 10_000;

/// Traces all paths of the workload under a budget. An error if a unit does not fit the budget.
pub fn run(
    workload: &SimulatedScene,
    device: &SimulatedDevice,
    budget: u64,
    policy: Box<dyn LoadPolicy>,
) -> Result<SimulationReport, PlanError> {
    let planner = ResidencyPlanner::with_policy(workload.catalog.clone(), budget, policy, device.planner)?;
    let slots = (device.segments * device.segment_slots) as usize;
    let mut simulation = ResidencySimulation {
        workload,
        device,
        planner,
        rays: vec![None; slots],
        segment: VecDeque::new(),
        next_path: 0,
        link: VecDeque::new(),
        link_free_secs: 0.0,
        counts: DemandCounts::new(workload.catalog.unit_count()),
        resident: vec![false; workload.catalog.unit_count()],
        report: SimulationReport::default(),
    };
    simulation.run();
    Ok(simulation.report)
}

/// The demand of a round.
struct DemandCounts {
    waiting: Vec<u32>,
    next: Vec<u32>,
    visits: Vec<u32>,
    active: u64,
}

impl DemandCounts {
    fn new(units: usize) -> Self {
        Self { waiting: vec![0; units], next: vec![0; units], visits: vec![0; units], active: 0 }
    }
}

struct ResidencySimulation<'a> {
    workload: &'a SimulatedScene,
    device: &'a SimulatedDevice,
    planner: ResidencyPlanner,
    rays: Vec<Option<SimulatedRay>>,
    /// Segments that contain paths, oldest first.
    segment: VecDeque<u32>,
    next_path: u32,
    /// Loads with the times at which they become usable.
    link: VecDeque<(f64, UnitId)>,
    link_free_secs: f64,
    counts: DemandCounts,
    resident: Vec<bool>,
    report: SimulationReport,
}

impl ResidencySimulation<'_> {
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
            *slot = (self.next_path < options.paths).then(|| SimulatedRay::camera(options, self.next_path));
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
            asked: None,
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
