// SPDX-License-Identifier: Apache-2.0
//! The report of a scene in words. Pure.

use super::scene::{PassBuild, SceneReport};
use oocpt_core::inventory::{BufferUse, RenderInventory};
use std::fmt::Write as _;

/// The report as text.
pub(super) fn text(report: &SceneReport) -> String {
    let SceneReport { scene, by, device, width, height, own, everything, warnings } = report;
    let all = everything.as_ref();
    let mut text = format!("{scene} ({by}), {width} x {height} px, on {device}\n");
    features(&mut text, &own.inventory);
    passes(&mut text, own, all);
    buffers(&mut text, &own.inventory, all.map(|all| &all.inventory));
    primvars(&mut text, &own.inventory);
    sums(&mut text, own, all);
    if !warnings.is_empty() {
        _ = writeln!(text, "\nthe host warned");
        for warning in warnings {
            _ = writeln!(text, "  {warning}");
        }
    }
    text
}

// Writing to a string cannot fail, here and below.

fn features(text: &mut String, inventory: &RenderInventory) {
    let RenderInventory { max_levels, stack_size, .. } = inventory;
    let levels = if *max_levels == 1 { "level" } else { "levels" };
    _ = writeln!(text, "\nfeatures ({max_levels} {levels} of instances, stack of {stack_size})");
    for present in [true, false] {
        for feature in inventory.features.iter().filter(|feature| feature.present == present) {
            let there = if present { "there" } else { "left out" };
            _ = writeln!(text, "  {there:<10}{:<20}{}", feature.name, feature.what);
        }
    }
}

fn passes(text: &mut String, own: &PassBuild, all: Option<&PassBuild>) {
    _ = writeln!(text, "\n{:<26}{:>10}{:>12}{:>14}", "pass", "pipeline", "compile s", "everything s");
    for pass in &own.inventory.passes {
        let made = if pass.made { "made" } else { "left out" };
        let secs = |secs: Option<f64>| secs.map_or("-".to_owned(), |secs| format!("{secs:.3}"));
        let here = secs(pass.made.then_some(pass.compile_secs));
        let there = all.and_then(|all| all.inventory.passes.iter().find(|other| other.name == pass.name));
        let there = secs(there.filter(|other| other.made).map(|other| other.compile_secs));
        _ = writeln!(text, "{:<26}{made:>10}{here:>12}{there:>14}", pass.name);
    }
}

fn buffers(text: &mut String, own: &RenderInventory, all: Option<&RenderInventory>) {
    _ = writeln!(text, "\n{:<32}{:>14}{:>14}{:>14}", "buffer", "bytes", "left out", "everything");
    let nothing = BufferUse::default();
    let more =
        all.iter().flat_map(|all| &all.buffers).filter(|other| !own.buffers.iter().any(|b| b.name == other.name));
    for name in own.buffers.iter().chain(more).map(|buffer| &buffer.name) {
        let find = |inventory: &RenderInventory| inventory.buffers.iter().find(|buffer| buffer.name == *name).cloned();
        let here = find(own).unwrap_or_else(|| nothing.clone());
        let there = all.map_or("-".to_owned(), |all| find(all).map_or(0, |buffer| buffer.bytes).to_string());
        _ = writeln!(text, "{name:<32}{:>14}{:>14}{there:>14}", here.bytes, here.saved);
    }
}

fn primvars(text: &mut String, inventory: &RenderInventory) {
    if inventory.primvars.is_empty() {
        return;
    }
    _ = writeln!(text, "\n{:<32}{:>10}{:>14}{:>10}{:>14}", "primvar", "read of", "bytes", "unread of", "bytes");
    for primvar in &inventory.primvars {
        let name: String = primvar.name.chars().filter(|c| !c.is_control()).collect();
        _ = writeln!(
            text,
            "{name:<32}{:>10}{:>14}{:>10}{:>14}",
            primvar.made, primvar.bytes, primvar.left_out, primvar.saved
        );
    }
    if inventory.more_primvars > 0 {
        _ = writeln!(text, "and {} more", inventory.more_primvars);
    }
}

fn sums(text: &mut String, own: &PassBuild, all: Option<&PassBuild>) {
    let row = |build: &PassBuild| {
        format!("{:>10}{:>16}{:>12.3}{:>10.4}", build.pipelines, build.bytes, build.compile_secs, build.trace_secs)
    };
    _ = writeln!(text, "\n{:<14}{:>10}{:>16}{:>12}{:>10}", "build", "pipelines", "bytes", "compile s", "trace s");
    _ = writeln!(text, "{:<14}{}", "own", row(own));
    if let Some(all) = all {
        _ = writeln!(text, "{:<14}{}", "everything", row(all));
    }
    _ = writeln!(text, "left out here: {} bytes, unread primvars included", own.inventory.saved());
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::inventory::{FeatureUse, PassUse, PrimvarUse};

    #[test]
    fn the_table_separates_present_from_omitted_parts() {
        let mut inventory = RenderInventory { max_levels: 2, stack_size: 48, ..RenderInventory::default() };
        let feature = |name: &str, present| FeatureUse { name: name.into(), present, ..FeatureUse::default() };
        inventory.features = vec![feature("COAT", false), feature("LENS", true)];
        let pass = |name: &str, made| PassUse { name: name.into(), made, compile_secs: 0.25 };
        inventory.passes = vec![pass("resolve", true), pass("count_demand", false)];
        inventory.add("rays", 640);
        inventory.leave_out("cones", 80);
        inventory.primvars =
            vec![PrimvarUse { name: "s\u{1b}t".into(), left_out: 3, saved: 24, ..PrimvarUse::default() }];
        let build = |bytes| PassBuild {
            inventory: inventory.clone(),
            pipelines: 1,
            bytes,
            compile_secs: 0.25,
            trace_secs: 0.5,
        };
        let report = SceneReport {
            scene: "forest".into(),
            by: "generated",
            device: "d".into(),
            width: 16,
            height: 9,
            own: build(640),
            everything: Some(build(720)),
            warnings: Vec::new(),
        };
        let warned = text(&SceneReport { warnings: vec!["/A: bad data".into()], ..report.clone() });
        assert!(warned.ends_with("\nthe host warned\n  /A: bad data\n"), "{warned}");
        let text = text(&report);
        let line = |start: &str| text.lines().find(|line| line.trim_start().starts_with(start)).expect(start);
        assert!(line("there").contains("LENS") && line("left out").contains("COAT"), "{text}");
        assert!(line("resolve").contains("made") && line("count_demand").contains("left out"), "{text}");
        assert_eq!(line("cones").split_whitespace().collect::<Vec<_>>(), ["cones", "0", "80", "0"], "{text}");
        assert_eq!(
            line("st").split_whitespace().collect::<Vec<_>>(),
            ["st", "0", "0", "3", "24"],
            "no control characters"
        );
        assert_eq!(line("everything").split_whitespace().nth(2), Some("720"), "{text}");
        assert!(text.ends_with("left out here: 104 bytes, unread primvars included\n"), "{text}");
    }
}
