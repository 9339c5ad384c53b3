// SPDX-License-Identifier: Apache-2.0
//! Device memory of chunks, and the rule by which cells that are too large are cut. Pure.

use rustc_hash::{FxHashMap, FxHashSet};

use crate::instancing::assembly::{Assembly, InstanceTarget};
use crate::mesh::SceneMesh;
use std::sync::Arc;

/// Factor of the chunk size that a cell with several targets may need.
const CLOSURE: u64 = 8;
/// Number of records below which a cell is no longer cut for its closure alone.
const FEW_RECORDS: u64 = 1024;
/// Factor of the chunk size that no cell of more than one record may exceed.
const MAX_CLOSURE: u64 = 64;

/// Device bytes of the assets of a snapshot.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct AssetCosts {
    meshes: Vec<u64>,
    assemblies: Vec<AssemblyCost>,
}

#[derive(Debug, PartialEq, Eq)]
struct AssemblyCost {
    own: u64,
    /// Bytes of a target with everything that is placed inside.
    closure: u64,
    /// Targets, sorted, each once.
    targets: Vec<InstanceTarget>,
}

impl AssetCosts {
    /// Adds up the bytes; children come before parents in `assemblies`.
    pub(crate) fn new(meshes: &[Arc<SceneMesh>], assemblies: &[Arc<Assembly>]) -> Self {
        let mut costs = Self {
            meshes: meshes.iter().map(|m| m.device_bytes()).collect(),
            assemblies: Vec::with_capacity(assemblies.len()),
        };
        for assembly in assemblies {
            let placed = assembly.members().iter().filter(|m| m.run.len() > 0);
            let mut targets: Vec<InstanceTarget> = placed.map(|m| m.target).collect();
            targets.sort_unstable();
            targets.dedup();
            let own = assembly.device_bytes();
            let closure = own.saturating_add(costs.closure(&targets));
            costs.assemblies.push(AssemblyCost { own, closure, targets });
        }
        costs
    }

    /// Bytes of a target itself.
    pub(crate) fn own(&self, target: InstanceTarget) -> u64 {
        match target {
            InstanceTarget::Mesh(m) => self.meshes.get(m as usize).copied().unwrap_or(0),
            InstanceTarget::Assembly(a) => self.assemblies.get(a as usize).map_or(0, |a| a.own),
        }
    }

    /// Bytes of an assembly with everything in it.
    pub(crate) fn of_assembly(&self, index: usize) -> u64 {
        self.assemblies.get(index).map_or(0, |a| a.closure)
    }

    /// Bytes of distinct targets with everything in them; each asset counts once.
    pub(crate) fn closure(&self, targets: &[InstanceTarget]) -> u64 {
        self.closure_above(targets, 0)
    }

    /// As [`AssetCosts::closure`], but any number not above `limit` stands for all of those.
    fn closure_above(&self, targets: &[InstanceTarget], limit: u64) -> u64 {
        // An upper bound first: each target alone.
        let alone = |target: &InstanceTarget| match target {
            InstanceTarget::Mesh(_) => self.own(*target),
            InstanceTarget::Assembly(a) => self.of_assembly(*a as usize),
        };
        let sum = targets.iter().map(alone).fold(0, u64::saturating_add);
        if sum <= limit || targets.iter().all(|t| matches!(t, InstanceTarget::Mesh(_))) || targets.len() == 1 {
            return sum;
        }
        let mut seen: FxHashSet<InstanceTarget> = targets.iter().copied().collect();
        let mut open: Vec<InstanceTarget> = targets.to_vec();
        let mut bytes = 0_u64;
        while let Some(target) = open.pop() {
            bytes = bytes.saturating_add(self.own(target));
            if let InstanceTarget::Assembly(a) = target {
                let below = self.assemblies.get(a as usize).map_or(&[][..], |a| &a.targets);
                open.extend(below.iter().filter(|t| seen.insert(**t)));
            }
        }
        bytes
    }
}

/// The rule that decides which cells of one assembly must be cut.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct CutRule {
    pub(crate) costs: Arc<AssetCosts>,
    pub(crate) chunk_bytes: u64,
    /// Device bytes of a record with its values.
    pub(crate) record_bytes: u64,
    /// Placements of each target in all chunks of the assembly.
    pub(crate) totals: FxHashMap<InstanceTarget, u64>,
}

impl CutRule {
    /// Returns true if `records` alone are too many.
    pub(crate) fn is_too_long(&self, records: u64) -> bool {
        records > 1 && records.saturating_mul(self.record_bytes) > self.chunk_bytes
    }

    /// The most records that are not too many by themselves.
    pub(crate) fn most_records(&self) -> u64 {
        (self.chunk_bytes / self.record_bytes.max(1)).max(1)
    }

    /// Returns true if a cell of `records` that places `targets` (each once, with the number of placements) must be
    /// cut.
    pub(crate) fn must_cut(&self, records: u64, targets: &[(InstanceTarget, u64)]) -> bool {
        if records <= 1 {
            return false;
        }
        let own = records.saturating_mul(self.record_bytes);
        let exclusive = targets.iter().filter(|(target, n)| self.totals.get(target) == Some(n));
        let cost = exclusive.map(|(target, _)| self.costs.own(*target)).fold(own, u64::saturating_add);
        if cost > self.chunk_bytes {
            return true;
        }
        let factor = if records > FEW_RECORDS { CLOSURE } else { MAX_CLOSURE };
        let limit = self.chunk_bytes.saturating_mul(factor);
        let targets: Vec<InstanceTarget> = targets.iter().map(|(target, _)| *target).collect();
        own.saturating_add(self.costs.closure_above(&targets, limit.saturating_sub(own))) > limit
    }
}
