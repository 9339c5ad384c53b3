// SPDX-License-Identifier: Apache-2.0
//! Compares our results with a table.

use oocpt_materialx::library::NodeLibrary;

use super::bounds::{Bound, left_out};
use super::table::{Block, Row};
use super::translation::{Way, value_of};

/// The result of a comparison.
#[derive(Clone, Debug, Default)]
pub(crate) struct Found {
    pub(crate) rows: usize,
    /// Rows whose numbers are all the same bits.
    pub(crate) equal: usize,
    pub(crate) numbers: usize,
    /// Numbers of them for which `MaterialX` has no finite value, or that are left out.
    pub(crate) left_out: usize,
    /// Greatest difference, over the scale of the row.
    pub(crate) worst: f64,
    /// A few of them, and unsupported parts.
    pub(crate) wrong: usize,
    /// The number as operations treat it: neither -0 nor below 2^-126.
    pub(crate) lines: Vec<String>,
}

impl Found {
    pub(crate) fn add(&mut self, other: Self) {
        self.rows += other.rows;
        self.equal += other.equal;
        self.numbers += other.numbers;
        self.left_out += other.left_out;
        self.worst = self.worst.max(other.worst);
        self.wrong += other.wrong;
        self.lines.extend(other.lines);
    }
}

/// The number as operations treat it: neither -0 nor below 2^-126.
fn normal(x: f32) -> f32 {
    if x.is_normal() { x } else { 0.0 }
}

fn row(block: &Block, Row { given, expected, .. }: &Row, way: Way, bound: Bound, library: &NodeLibrary) -> Found {
    let mut found = Found { rows: 1, equal: 1, numbers: expected.len(), ..Found::default() };
    let name = format!("{} {way:?} {}", block.definition, block.output);
    let ours = match value_of(block, given, way, library) {
        Ok(ours) => ours,
        Err(problem) => {
            found.lines.push(format!("{name}: {problem}"));
            return Found { wrong: 1, equal: 0, ..found };
        }
    };
    let largest = given.iter().fold(1.0_f32, |most, x| most.max(x.abs()));
    let mut is_wrong = ours.len() != expected.len();
    for (k, (ours, expected)) in ours.iter().zip(expected).enumerate() {
        is_wrong |= !ours.is_finite();
        if !expected.is_finite() || left_out(block, given, k).is_some() {
            found.left_out += 1;
            continue;
        }
        let (ours, expected) = (normal(*ours), normal(*expected));
        if ours.to_bits() != expected.to_bits() {
            found.equal = 0;
        }
        let scale = expected.abs().max(if bound.by_inputs { largest } else { 1.0 });
        let off = (f64::from(ours) - f64::from(expected)).abs() / f64::from(scale);
        found.worst = found.worst.max(off);
        is_wrong |= off > bound.most;
    }
    if is_wrong {
        found.wrong = 1;
        found.lines.push(format!("{name} of {given:?}: {ours:?}, not {expected:?}"));
    }
    found
}

/// Compares rows of a block in one way.
pub(crate) fn compare(block: &Block, way: Way, library: &NodeLibrary) -> Found {
    const MAX_LINES: usize = 3;
    let bound = Bound::of(block);
    let mut all = Found::default();
    for values in block.rows.iter().filter(|row| way != Way::Unsaid || row.is_default) {
        all.add(row(block, values, way, bound, library));
        all.lines.truncate(MAX_LINES);
    }
    all
}

/// The ways in which a block can be compared: nodes that read the geometry are not folded.
pub(crate) fn ways(block: &Block) -> &'static [Way] {
    if block.geometry.is_empty() { &[Way::Said, Way::Read, Way::Unsaid] } else { &[Way::Read, Way::Unsaid] }
}
