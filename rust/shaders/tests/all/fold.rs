// SPDX-License-Identifier: Apache-2.0
//! A module folded by its specialisation constants is valid and equivalent: `spirv-opt` reduces both to the same code.

use oocpt_abi::{FEATURES, Features, SPEC_MAX_LEVELS, SPEC_STACK_SIZE};
use oocpt_shaders::{ALL, ShaderModule, checks, passes};
use std::path::{Path, PathBuf};
use std::process::Command;

/// Folds constants and branches, removes unreachable code, and renumbers the ids.
const PASSES: [&str; 13] = [
    "--freeze-spec-const",
    "--fold-spec-const-op-composite",
    "--ccp",
    "--eliminate-dead-branches",
    "--merge-blocks",
    "--ccp",
    "--eliminate-dead-branches",
    "--eliminate-dead-functions",
    "--merge-blocks",
    "--remove-unused-interface-variables",
    "--eliminate-dead-code-aggressive",
    "--eliminate-dead-const",
    "--compact-ids",
];

/// A folder that is removed after the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("oocpt-fold-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder");
        Self(folder)
    }

    fn write(&self, name: &str, words: &[u32]) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>()).expect("written");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _leaves_a_folder = std::fs::remove_dir_all(&self.0);
    }
}

fn run(what: &str, tool: &str, args: &[&str], files: &[&Path]) {
    let output = Command::new(tool).args(args).args(files).output().expect(tool);
    let text = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{what}: {text}");
}

fn spec(features: Features) -> [(u32, u32); 5] {
    let [low, high, top] = features.constants();
    [(SPEC_MAX_LEVELS, 2), (SPEC_STACK_SIZE, 40), low, high, top]
}

/// The code to which `spirv-opt` reduces a module: its instructions sorted by their texts, without the numbers of
/// results, since the order of blocks may differ.
fn reduced(folder: &Folder, name: &str, words: &[u32], spec: &[(u32, u32)]) -> Vec<String> {
    let from = folder.write(name, words);
    let [to, text] = ["reduced.spv", "reduced.txt"].map(|file| folder.0.join(file));
    let values: Vec<String> = spec.iter().map(|(id, value)| format!("{id}:{value}")).collect();
    let values = format!("--set-spec-const-default-value={}", values.join(" "));
    let mut args = vec!["--target-env=vulkan1.2", "--strip-debug", &values];
    args.extend(PASSES);
    args.push("-o");
    run(name, "spirv-opt", &args, &[&to, &from]);
    run(name, "spirv-dis", &["--no-indent", "--no-header", "-o"], &[&text, &to]);
    let text = std::fs::read_to_string(text).expect("what it wrote");
    // The entry point lists variables in an order of its own.
    let lines = text.lines().filter(|line| !line.starts_with("OpEntryPoint"));
    let mut lines: Vec<String> = lines.map(without_numbers).collect();
    lines.sort_unstable();
    lines
}

/// A line of an assembly without numbers of ids: types and constants keep their names.
fn without_numbers(line: &str) -> String {
    let word = |word: &str| match word.strip_prefix('%') {
        Some(id) if id.contains("struct_") || id.chars().all(|letter| letter.is_ascii_digit()) => {
            format!("%{}", id.trim_end_matches(|letter: char| letter.is_ascii_digit()))
        }
        Some(id) => format!("%{id}"),
        None => word.to_owned(),
    };
    line.split(' ').map(word).collect::<Vec<_>>().join(" ")
}

fn check(folder: &Folder, module: &ShaderModule, features: Features) {
    let spec = spec(features);
    let words = module.specialised(&spec);
    assert!(words.len() < module.words.len(), "{} stays as it is", module.name);
    let written = folder.write("folded.spv", &words);
    let what = format!("{} with {features:?}", module.name);
    run(&what, "spirv-val", &["--target-env", "vulkan1.2", "--scalar-block-layout"], &[&written]);
    let [before, after] = [module.words, &words].map(|words| reduced(folder, "whole.spv", words, &spec));
    let other = before.iter().zip(&after).find(|(before, after)| before != after);
    assert!(other.is_none(), "{what} is another: {other:?}");
    assert_eq!(before.len(), after.len(), "{what}");
}

/// Features with all that they need.
fn with_needs(mut features: Features) -> Features {
    for feature in FEATURES.iter().rev().filter(|feature| features.contains(feature.bit)).collect::<Vec<_>>() {
        features |= feature.needs;
    }
    features
}

#[test]
fn folding_preserves_passes_with_no_and_with_all_features() {
    let folder = Folder::new("all");
    for module in ALL.iter().copied().chain([&checks::CHECK_BSDF, &checks::CHECK_TEXTURE]) {
        check(&folder, module, Features::empty());
        check(&folder, module, Features::all());
    }
}

#[test]
fn folding_preserves_large_passes_with_some_features() {
    let folder = Folder::new("some");
    let large =
        [&passes::SHADE_SURFACE, &passes::INTERSECT_CLOSEST, &passes::INTERSECT_SHADOW, &passes::RESOLVE_LIGHTS];
    let mut state = 7_u64;
    for round in 0..3 {
        for module in large {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let wide = u128::from(state) << 50 ^ u128::from(state.rotate_left(31));
            let bits = if round % 2 == 0 { wide >> 7 & wide >> 13 } else { wide >> 7 | wide >> 13 };
            check(&folder, module, with_needs(Features::from_bits_truncate(bits)));
        }
    }
}

#[test]
fn folding_removes_what_a_minimal_scene_does_not_need() {
    let words = |module: &ShaderModule, features| module.specialised(&spec(features)).len();
    for (module, most) in [(&passes::SHADE_SURFACE, 0.25), (&passes::INTERSECT_CLOSEST, 0.6)] {
        #[allow(clippy::cast_precision_loss, reason = "some hundred thousand")]
        let share = words(module, Features::empty()) as f64 / module.words.len() as f64;
        assert!(share < most, "{} keeps {share}", module.name);
    }
}

/// Reads of random numbers of a hit are in passes that shade mixtures, and in no other.
#[test]
fn without_mixtures_there_are_no_numbers_for_them() {
    let words = |module: &ShaderModule, features| module.specialised(&spec(with_needs(features))).len();
    let patterns =
        Features::PATTERNS | Features::CUTOUT_PROGRAMS | Features::MESH_LIGHT_PROGRAMS | Features::SHADED_AOVS;
    let mixtures = patterns | Features::MIXTURES;
    for module in [&passes::SHADE_SURFACE, &passes::SHADE_AOVS] {
        let [without, with] = [patterns, mixtures].map(|features| words(module, features));
        assert!(with > without + 50, "{}: {with} words with mixtures, {without} without", module.name);
    }
    for module in [&passes::INTERSECT_CLOSEST, &passes::INTERSECT_SHADOW] {
        assert!(!module.features.contains(Features::MIXTURES), "{} asks for mixtures", module.name);
        assert_eq!(words(module, patterns), words(module, mixtures), "{}", module.name);
    }
}

/// Images of ids and depth do not evaluate materials.
#[test]
fn without_images_of_shading_there_are_no_materials_in_their_pass() {
    let words = |features| passes::SHADE_AOVS.specialised(&spec(with_needs(features))).len();
    let bare = Features::MATERIALS | Features::TEXTURES;
    let patterns = bare | Features::PATTERNS;
    let of_opacity = words(patterns) - words(bare);
    assert!(of_opacity < 500, "{of_opacity} words of programs: those of materials are there");
    let (without, with) = (words(patterns), words(patterns | Features::SHADED_AOVS));
    assert!(with > without + 1000, "{with} words with images of shading, {without} without");
}

#[test]
fn folding_leaves_an_invalid_module_unchanged() {
    static JUNK: [u32; 8] = [0x0723_0203, 0x0001_0500, 0, 9, 0, 0xffff_0036, 1, 2];
    let junk = ShaderModule { words: &JUNK, ..passes::RESOLVE };
    assert_eq!(junk.specialised(&[]), JUNK.as_slice());
    for cut in (0..passes::RESOLVE.words.len()).step_by(97) {
        let cut = ShaderModule { words: &passes::RESOLVE.words[..cut], ..passes::RESOLVE };
        let _neither_panics_nor_hangs = cut.specialised(&spec(Features::empty()));
    }
}
