// SPDX-License-Identifier: Apache-2.0
//! The crate graph: the dependencies allowed between our crates, and the outside crates that are confined to one of
//! ours.

use std::collections::BTreeSet;

use anyhow::{Context as _, Result, bail};
use serde_json::Value;

use crate::places::RootFolders;
use crate::process::capture;
use crate::product::{self, cargo};

/// Arrows of the design: each crate, and our crates that it may use in shipped code.
const ARROWS: &[(&str, &[&str])] = &[
    ("oocpt-abi", &[]),
    ("oocpt-files", &[]),
    ("oocpt-core", &["oocpt-abi", "oocpt-materialx", "oocpt-subdiv"]),
    ("oocpt-materialx", &["oocpt-abi", "oocpt-files"]),
    ("oocpt-film", &["oocpt-abi", "oocpt-core", "oocpt-files"]),
    ("oocpt-ptex", &[]),
    ("oocpt-subdiv", &[]),
    ("oocpt-shaders", &["oocpt-abi"]),
    ("oocpt-gpu", &["oocpt-files"]),
    ("oocpt-traverse", &["oocpt-abi", "oocpt-gpu"]),
    (
        "oocpt-render",
        &[
            "oocpt-abi",
            "oocpt-core",
            "oocpt-film",
            "oocpt-files",
            "oocpt-ptex",
            "oocpt-shaders",
            "oocpt-gpu",
            "oocpt-traverse",
        ],
    ),
    ("oocpt-bridge", &["oocpt-abi", "oocpt-render", "oocpt-core", "oocpt-ptex"]),
    ("oocpt-scenes", &["oocpt-core", "oocpt-render"]),
    ("oocpt-command", &[]),
    ("oocpt-cli", &["oocpt-command", "oocpt-core", "oocpt-film", "oocpt-gpu", "oocpt-render", "oocpt-scenes"]),
    ("oocpt-bench", &["oocpt-abi", "oocpt-command", "oocpt-core", "oocpt-render", "oocpt-scenes"]),
    ("oocpt-judge", &["oocpt-abi", "oocpt-core"]),
    ("oocpt-extreme", &["oocpt-abi", "oocpt-render", "oocpt-core"]),
    ("xtask", &[]),
];

/// Additional crates that tests may use.
const TEST_ARROWS: &[&str] = &["oocpt-abi", "oocpt-judge", "oocpt-shaders"];

/// Outside crates that only these of ours may name. C++ calls the bridge; `oocpt-subdiv` calls OpenSubdiv.
const CONFINED: &[(&str, &[&str])] = &[
    ("ash", &["oocpt-gpu"]),
    ("cxx", &["oocpt-bridge", "oocpt-subdiv"]),
    ("offset-allocator", &["oocpt-gpu"]),
    ("opensubdiv-petite-sys", &["oocpt-subdiv"]),
];

/// The feature that only tests turn on: planted faults and controls.
const FAULTS: &str = "faults";

/// Checks that no code for tests is compiled into the product.
pub(super) fn product(places: &RootFolders) -> Result<()> {
    let mut tree = cargo(places, "tree");
    tree.args(product::packages()).args(["--prefix", "none", "--edges", "normal,build", "--format", "{f} {p}"]);
    let tree = capture(&mut tree)?;
    if !tree.contains(" oocpt-render ") {
        bail!("cargo tree does not tell of what the product is made: {tree}");
    }
    let found = faulty(&tree);
    if !found.is_empty() {
        bail!("the product is built with what only tests may turn on: {}", found.join(", "));
    }
    Ok(())
}

/// Packages of a list of features and packages that have the feature.
fn faulty(tree: &str) -> Vec<&str> {
    let has_it = |line: &&str| line.split(' ').next().is_some_and(|features| features.split(',').any(|f| f == FAULTS));
    let mut found: Vec<&str> = tree.lines().filter(has_it).filter_map(|line| line.split(' ').nth(1)).collect();
    found.sort_unstable();
    found.dedup();
    found
}

pub(super) fn check(places: &RootFolders) -> Result<()> {
    let metadata = capture(cargo(places, "metadata").args(["--no-deps", "--format-version", "1"]))?;
    let metadata = serde_json::from_str(&metadata).context("cargo metadata is no JSON")?;
    let violations = violations(&metadata)?;
    if !violations.is_empty() {
        bail!("{}", violations.join("; "));
    }
    Ok(())
}

/// One line per arrow that the design does not have.
fn violations(metadata: &Value) -> Result<Vec<String>> {
    let packages = metadata["packages"].as_array().context("cargo metadata lists no packages")?;
    let ours: BTreeSet<&str> = packages.iter().filter_map(|package| package["name"].as_str()).collect();
    let mut found = Vec::new();
    for package in packages {
        let name = package["name"].as_str().context("a package without a name")?;
        let Some((_, allowed)) = ARROWS.iter().find(|(known, _)| *known == name) else {
            found.push(format!("{name} is not in the table of crates"));
            continue;
        };
        for dependency in package["dependencies"].as_array().into_iter().flatten() {
            let used = dependency["name"].as_str().context("a dependency without a name")?;
            let for_tests = dependency["kind"] == "dev";
            let is_allowed = if ours.contains(used) {
                // A crate's tests may depend on the crate itself to enable features.
                allowed.contains(&used) || (for_tests && (used == name || TEST_ARROWS.contains(&used)))
            } else {
                CONFINED.iter().all(|(outside, homes)| *outside != used || homes.contains(&name))
            };
            if !is_allowed {
                found.push(format!("{name} must not use {used}"));
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn package(name: &str, dependencies: &[(&str, Value)]) -> Value {
        let listed: Vec<Value> = dependencies.iter().map(|(used, kind)| json!({"name": used, "kind": kind})).collect();
        json!({"name": name, "dependencies": listed})
    }

    #[test]
    fn a_product_with_faults_is_noticed() {
        let clean = "default,std bytemuck v1.25.2\n oocpt-gpu v0.1.0 (/faults/rust/gpu)\n oocpt-render v0.1.0 (/r)";
        assert!(faulty(clean).is_empty(), "a folder of that name is none: {:?}", faulty(clean));
        let planted = format!("{clean}\ndefault,faults oocpt-gpu v0.1.0 (/r)\nfaults oocpt-gpu v0.1.0 (/r) (*)");
        assert_eq!(faulty(&planted), ["oocpt-gpu"], "named once");
    }

    fn found(packages: Vec<Value>) -> Vec<String> {
        violations(&json!({"packages": packages})).unwrap()
    }

    #[test]
    fn the_design_passes() {
        let render = [("oocpt-core", Value::Null), ("oocpt-gpu", Value::Null), ("glam", Value::Null)];
        let gpu = [("ash", Value::Null), ("oocpt-shaders", json!("dev"))];
        let packages = vec![
            package("oocpt-core", &[]),
            package("oocpt-shaders", &[]),
            package("oocpt-gpu", &gpu),
            package("oocpt-render", &render),
        ];
        assert_eq!(found(packages), Vec::<String>::new(), "allowed arrows");
    }

    #[test]
    fn arrows_against_the_design_are_named() {
        let packages = vec![
            package("oocpt-core", &[("oocpt-gpu", Value::Null), ("ash", Value::Null)]),
            package("oocpt-gpu", &[("oocpt-shaders", Value::Null)]),
            package("oocpt-shaders", &[]),
            package("oocpt-new", &[]),
        ];
        let expected = [
            "oocpt-core must not use oocpt-gpu",
            "oocpt-core must not use ash",
            "oocpt-gpu must not use oocpt-shaders",
            "oocpt-new is not in the table of crates",
        ];
        assert_eq!(found(packages), expected, "each by name");
    }
}
