// SPDX-License-Identifier: Apache-2.0
//! Compares the values of our pattern nodes with a table of reference values (`tests/reference/nodes.py`) and prints
//! the errors by node and by group. The data libraries are those of `PXR_MTLX_STDLIB_SEARCH_PATHS`. Exits with 1 if a
//! row is out of bounds.

#![expect(clippy::print_stdout, clippy::print_stderr, clippy::panic, reason = "a tool of the tests")]

#[path = "../tests/all/nodes/bounds.rs"]
mod bounds;
#[path = "../tests/all/nodes/compare.rs"]
mod compare;
#[path = "../tests/all/nodes/table.rs"]
mod table;
#[path = "../tests/all/nodes/translation.rs"]
mod translation;

use std::collections::{BTreeMap, BTreeSet};
use std::process::ExitCode;

use oocpt_materialx::library::standard;

use bounds::Bound;
use compare::{Found, compare, ways};
use table::Table;

/// Prints the errors of a node or a group, whose bound is `bound`.
fn print_errors(name: &str, found: &Found, bound: f64) {
    let Found { rows, equal, numbers, left_out, worst, wrong, .. } = found;
    let share = 100.0 * *equal as f64 / *rows as f64;
    let counts = format!("{rows:7} rows {share:6.2} % same bits {left_out:5} of {numbers:7} numbers left out");
    println!("{name:52} {counts}, worst {worst:8.2e} of {bound:7.1e}, {wrong} wrong");
}

/// Prints all comparisons; returns the number of rows out of bounds.
fn print_table(table: &Table) -> usize {
    let mut nodes: BTreeMap<&str, (Found, f64)> = BTreeMap::new();
    let mut groups: BTreeMap<&str, (Found, f64, BTreeSet<&str>)> = BTreeMap::new();
    for block in &table.blocks {
        let bound = Bound::of(block);
        for way in ways(block) {
            let found = compare(block, *way, standard());
            let node = nodes.entry(&block.definition).or_default();
            node.0.add(found.clone());
            node.1 = bound.most;
            let group = groups.entry(bound.group).or_default();
            group.0.add(found);
            group.1 = bound.most;
            group.2.insert(&block.definition);
        }
    }
    for (name, (found, most)) in &nodes {
        print_errors(name, found, *most);
        for detail in &found.lines {
            println!("    {detail}");
        }
    }
    for (name, why) in &table.missing {
        println!("{name:52} not compared: {why}");
    }
    println!();
    for (name, (found, most, definitions)) in &groups {
        print_errors(&format!("{name}: {} definitions", definitions.len()), found, *most);
    }
    groups.values().map(|(found, ..)| found.wrong).sum()
}

fn main() -> ExitCode {
    let Some(path) = std::env::args_os().nth(1) else {
        eprintln!("usage: nodes TABLE");
        return ExitCode::FAILURE;
    };
    match std::fs::read_to_string(path) {
        Ok(text) => ExitCode::from(u8::from(print_table(&table::read(&text)) > 0)),
        Err(error) => {
            eprintln!("no table: {error}");
            ExitCode::FAILURE
        }
    }
}
