// SPDX-License-Identifier: Apache-2.0
//! A module does not depend on what it does not read: with its specialisation constants set and folded by `spirv-opt`,
//! it is the same module whatever the others are.

use oocpt_abi::{Features, SPEC_MAX_LEVELS, SPEC_STACK_SIZE};
use oocpt_shaders::{ALL, ShaderModule, checks};
use std::path::Path;
use std::process::Command;

/// Folds constants, and removes unreachable code.
const PASSES: [&str; 6] = [
    "--freeze-spec-const",
    "--fold-spec-const-op-composite",
    "--eliminate-dead-functions",
    "--remove-unused-interface-variables",
    "--eliminate-dead-code-aggressive",
    "--compact-ids",
];

/// The module at `folder` with these features, levels and stack entries.
fn folded(module: &ShaderModule, folder: &Path, features: Features, levels: u32, stack: u32) -> Vec<u8> {
    let words = features.constants();
    let from = folder.join(format!("{}.spv", module.name));
    let to = folder.join("folded.spv");
    let bytes: Vec<u8> = module.words.iter().flat_map(|word| word.to_le_bytes()).collect();
    std::fs::write(&from, bytes).expect("written");
    let values = words.into_iter().chain([(SPEC_MAX_LEVELS, levels), (SPEC_STACK_SIZE, stack)]);
    // Only constants that the module declares may be set.
    let declared = |id: &u32| module.features != Features::empty() || *id == SPEC_MAX_LEVELS || *id == SPEC_STACK_SIZE;
    let values: Vec<String> =
        values.filter(|(id, _)| declared(id)).map(|(id, value)| format!("{id}:{value}")).collect();
    let status = Command::new("spirv-opt")
        .args(["--target-env=vulkan1.2", &format!("--set-spec-const-default-value={}", values.join(" "))])
        .args(PASSES)
        .args([from.as_os_str(), "-o".as_ref(), to.as_os_str()])
        .status()
        .expect("spirv-opt, of Debian's spirv-tools");
    assert!(status.success(), "{}", module.name);
    std::fs::read(to).expect("what it wrote")
}

/// Compares each of `modules` with and without all that it does not read.
fn compare<'m>(name: &str, modules: impl IntoIterator<Item = &'m ShaderModule>) {
    let folder = std::env::temp_dir().join(format!("oocpt-uses-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    for module in modules {
        let [levels, stack] = [module.reads_levels, module.reads_stack].map(|reads| if reads { 3 } else { 40 });
        let here = folded(module, &folder, module.features, 3, 3);
        assert!(here == folded(module, &folder, Features::all(), levels, stack), "{} reads more", module.name);
    }
    std::fs::remove_dir_all(folder).expect("removed");
}

#[test]
fn passes_read_only_their_declared_features() {
    compare("passes", ALL.iter().copied());
}

#[test]
fn check_shaders_read_only_their_declared_features() {
    compare("checks", [&checks::CHECK_BSDF, &checks::CHECK_TEXTURE]);
}

#[test]
fn each_pass_reads_the_features_it_declares() {
    let reads =
        |module: &str, feature| ALL.iter().find(|one| one.name == module).expect("a pass").features.contains(feature);
    assert!(reads("shade_surface", Features::SHEEN) && !reads("intersect_closest", Features::SHEEN));
    assert!(reads("intersect_shadow", Features::LIGHT_LINKS) && !reads("intersect_closest", Features::LIGHT_LINKS));
    assert!(reads("shade_background", Features::DOME) && !reads("accumulate", Features::DOME));
    let levels: Vec<&str> = ALL.iter().filter(|module| module.reads_levels).map(|module| module.name).collect();
    let trace = ["intersect_closest", "intersect_shadow", "settle_closest", "settle_shadow"];
    let mut expected = [&trace[..], &["record_surfaces", "shade_aovs", "shade_surface"]].concat();
    expected.sort_unstable();
    assert_eq!(levels, expected);
    let stacks: Vec<&str> = ALL.iter().filter(|module| module.reads_stack).map(|module| module.name).collect();
    assert_eq!(stacks, trace);
}
