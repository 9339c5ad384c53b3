// SPDX-License-Identifier: Apache-2.0
//! What a policy decides: which unit is worth loading first, which is worth keeping, and when the one is worth the
//! other. Everything that must always hold (budget, pins, starvation, loads in flight) is the planner's, not a
//! policy's.

mod benefit;
mod priority;
mod sweep;
mod view;

pub use benefit::BenefitPolicy;
pub use priority::PriorityPolicy;
pub use sweep::SweepPolicy;
pub use view::PolicyView;

use super::UnitId;
use serde::{Deserialize, Serialize};

/// Orders units. Values are finite and compared only with values of the same policy.
pub trait LoadPolicy: std::fmt::Debug + Send {
    /// The absent units worth a load now, best first, each with its value; `demanded` are those with waiting rays that
    /// may be loaded. At most `limit`.
    fn order(&mut self, view: &PolicyView<'_>, demanded: &[UnitId], limit: usize) -> Vec<(f64, UnitId)>;

    /// What is lost by evicting a resident unit; the least goes first.
    fn loss(&self, view: &PolicyView<'_>, unit: UnitId) -> f64;

    /// May a load of this value displace a unit of this loss? A margin here is what keeps equals from swapping.
    fn displaces(&self, value: f64, loss: f64) -> bool;

    /// The value of a load ahead of demand, `None` if this policy makes none.
    fn prefetch(&self, _view: &PolicyView<'_>, _unit: UnitId) -> Option<f64> {
        None
    }

    /// The value of loading a unit that rays read in host memory; `None` if this policy does not bring such.
    fn visited(&self, _view: &PolicyView<'_>, _unit: UnitId) -> Option<f64> {
        None
    }

    /// The value of [`Self::visited`] from which on other units may go for such a load.
    fn least_visited(&self) -> f64 {
        f64::INFINITY
    }

    /// A load was issued.
    fn issued(&mut self, _unit: UnitId) {}
}

/// The policies there are; all may be compared in one run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PolicyKind {
    /// Round robin over all units with demand.
    Sweep,
    /// Most waiting rays first.
    Priority,
    /// Most waiting rays per byte to load.
    #[default]
    Benefit,
}

/// A name no policy has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("unknown policy {0:?}, expected \"sweep\", \"priority\" or \"benefit\"")]
pub struct UnknownPolicy(pub String);

impl PolicyKind {
    /// All, in the order of the documentation.
    pub const ALL: [Self; 3] = [Self::Sweep, Self::Priority, Self::Benefit];

    /// The name in settings and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Sweep => "sweep",
            Self::Priority => "priority",
            Self::Benefit => "benefit",
        }
    }

    /// A policy of this kind in its first state.
    pub fn policy(self) -> Box<dyn LoadPolicy> {
        match self {
            Self::Sweep => Box::new(SweepPolicy::default()),
            Self::Priority => Box::new(PriorityPolicy),
            Self::Benefit => Box::new(BenefitPolicy),
        }
    }
}

impl std::fmt::Display for PolicyKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for PolicyKind {
    type Err = UnknownPolicy;

    fn from_str(name: &str) -> Result<Self, UnknownPolicy> {
        Self::ALL.into_iter().find(|kind| kind.name() == name).ok_or_else(|| UnknownPolicy(name.to_owned()))
    }
}

/// The `limit` largest of `values`, largest first, ties by the smaller id; O(n + limit log limit).
pub(super) fn top(mut values: Vec<(f64, UnitId)>, limit: usize) -> Vec<(f64, UnitId)> {
    let order = |a: &(f64, UnitId), b: &(f64, UnitId)| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1));
    if values.len() > limit {
        values.select_nth_unstable_by(limit, order);
        values.truncate(limit);
    }
    values.sort_unstable_by(order);
    values
}
