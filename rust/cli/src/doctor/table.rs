// SPDX-License-Identifier: Apache-2.0
//! The report of a scene in words. Pure.

use super::needs::SceneNeeds;
use oocpt_core::inventory::RenderInventory;
use std::fmt::Write as _;

/// The report as text.
pub(super) fn text(needs: &SceneNeeds) -> String {
    let SceneNeeds { scene, device, width, height, inventory, warnings, .. } = needs;
    let mut text = format!("{scene}, {width} x {height} px, on {device}\n");
    features(&mut text, inventory);
    passes(&mut text, inventory);
    buffers(&mut text, inventory);
    primvars(&mut text, inventory);
    sums(&mut text, needs);
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

fn passes(text: &mut String, inventory: &RenderInventory) {
    _ = writeln!(text, "\n{:<26}{:>10}{:>12}", "pass", "pipeline", "compile s");
    for pass in &inventory.passes {
        let (made, secs) = match pass.made {
            true => ("made", format!("{:.3}", pass.compile_secs)),
            false => ("left out", "-".to_owned()),
        };
        _ = writeln!(text, "{:<26}{made:>10}{secs:>12}", pass.name);
    }
}

fn buffers(text: &mut String, inventory: &RenderInventory) {
    _ = writeln!(text, "\n{:<32}{:>14}{:>14}", "buffer", "bytes", "left out");
    for buffer in &inventory.buffers {
        _ = writeln!(text, "{:<32}{:>14}{:>14}", buffer.name, buffer.bytes, buffer.saved);
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

fn sums(text: &mut String, needs: &SceneNeeds) {
    let SceneNeeds { pipelines, bytes, compile_secs, trace_secs, inventory, .. } = needs;
    _ = writeln!(text, "\n{:>10}{:>16}{:>12}{:>10}", "pipelines", "bytes", "compile s", "trace s");
    _ = writeln!(text, "{pipelines:>10}{bytes:>16}{compile_secs:>12.3}{trace_secs:>10.4}");
    _ = writeln!(text, "left out here: {} bytes, unread primvars included", inventory.saved());
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
        let report = SceneNeeds {
            scene: "forest".into(),
            device: "d".into(),
            width: 16,
            height: 9,
            pipelines: 1,
            bytes: 640,
            compile_secs: 0.25,
            trace_secs: 0.5,
            inventory,
            warnings: Vec::new(),
        };
        let warned = text(&SceneNeeds { warnings: vec!["/A: bad data".into()], ..report.clone() });
        assert!(warned.ends_with("\nthe host warned\n  /A: bad data\n"), "{warned}");
        let text = text(&report);
        let line = |start: &str| text.lines().find(|line| line.trim_start().starts_with(start)).expect(start);
        assert!(line("there").contains("LENS") && line("left out").contains("COAT"), "{text}");
        assert!(line("resolve").contains("made") && line("count_demand").contains("left out"), "{text}");
        assert_eq!(line("cones").split_whitespace().collect::<Vec<_>>(), ["cones", "0", "80"], "{text}");
        assert_eq!(
            line("st").split_whitespace().collect::<Vec<_>>(),
            ["st", "0", "0", "3", "24"],
            "no control characters"
        );
        assert_eq!(line("1  ").split_whitespace().collect::<Vec<_>>(), ["1", "640", "0.250", "0.5000"], "{text}");
        assert!(text.ends_with("left out here: 104 bytes, unread primvars included\n"), "{text}");
    }
}
