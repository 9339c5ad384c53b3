// SPDX-License-Identifier: Apache-2.0
//! GLSL of the table of lobes: what goes through all of them, written once.
//!
//! Pure. `shaders/material/bsdf/lobe.glsl` says which functions a lobe has.

use oocpt_abi::{self as abi, LobeNormal, LobePart, LobeRow, LobeSides};
use std::fmt::Write as _;

const HEAD: &str = "// Written by rust/shaders/build.rs, from rust/abi/src/lobes.rs.\n\n";

/// `generated/lobes.glsl`: numbers of the lobes, and the struct of their chances.
pub(crate) fn types() -> String {
    let mut text = String::from(HEAD);
    for (at, lobe) in abi::LOBES.iter().enumerate() {
        let _infallible = writeln!(text, "const uint LOBE_{} = {at}u;", lobe.name.to_uppercase());
    }
    let members: String = abi::LOBES.iter().map(|lobe| format!("    float {};\n", lobe.name)).collect();
    let zeros = vec!["0.0"; abi::LOBES.len()].join(", ");
    let _infallible = write!(
        text,
        "const uint NO_LOBE = {}u;\n\nstruct LobeChances {{\n{members}}};\n\nLobeChances no_chances() {{\n    \
         return LobeChances({zeros});\n}}\n",
        abi::LOBES.len()
    );
    text
}

/// `generated/lobe_functions.glsl`: the lobes' files, and what goes through all of them.
pub(crate) fn functions() -> String {
    let mut text = String::from(HEAD);
    for LobeRow { name, .. } in abi::LOBES {
        let _infallible = writeln!(text, "#include \"material/bsdf/lobes/{name}.glsl\"");
    }
    for function in [exists(), chances(), choose(), sample(), add()] {
        text.push('\n');
        text.push_str(&function);
    }
    text
}

/// `HAS_A && HAS_B && `.
fn has(lobe: &LobeRow) -> String {
    lobe.needs.iter_names().map(|(name, _)| format!("HAS_{name} && ")).collect()
}

fn exists() -> String {
    let mut text = String::from(
        "// Whether the surface is more than Lambert.\n\
         bool has_lobe_over_diffuse(const Bsdf b) {\n",
    );
    for lobe in abi::LOBES.iter().filter(|lobe| lobe.name != abi::LOBE_ALONE) {
        let _infallible = writeln!(text, "    if ({}{}_exists(b)) return true;", has(lobe), lobe.name);
    }
    text.push_str("    return false;\n}\n");
    text
}

fn chances() -> String {
    let mut text = String::from(
        "// Sets what the lobes keep; gives the chance of each, by its albedo.\n\
         LobeChances lobe_chances(inout Bsdf b, const LobeInputs x) {\n    LobeChances c = no_chances();\n",
    );
    let ordered = abi::lobes_in_order(abi::LOBES_ADDED);
    for lobe in &ordered {
        let _infallible = writeln!(text, "    if ({0}{1}_exists(b)) c.{1} = {1}_albedo(b, x);", has(lobe), lobe.name);
    }
    let sum = ordered.iter().map(|lobe| format!("c.{}", lobe.name)).collect::<Vec<_>>().join(" + ");
    let shares = abi::LOBES.iter().map(|lobe| format!("c.{} / sum", lobe.name)).collect::<Vec<_>>().join(", ");
    let _infallible = write!(
        text,
        "    const float sum = {sum};\n    if (!(sum > 0.0)) return no_chances();\n    \
         return LobeChances({shares});\n}}\n"
    );
    text
}

fn choose() -> String {
    let mut text = String::from(
        "// The lobe that `u` falls on, and where in its chance it does; NO_LOBE: none has a chance. What rounding\n\
         // leaves is the last one's that has.\n\
         uint choose_lobe(const LobeChances c, inout float u) {\n    uint lobe = NO_LOBE;\n    \
         float at = u;\n    float first = u;\n    float chance = 1.0;\n    bool found = false;\n",
    );
    for lobe in abi::LOBES {
        let name = lobe.name;
        let _infallible = write!(
            text,
            "    if ({}!found && c.{name} > 0.0) {{\n        lobe = LOBE_{};\n        first = at;\n        \
             chance = c.{name};\n        found = at < chance;\n        at -= chance;\n    }}\n",
            has(lobe),
            name.to_uppercase()
        );
    }
    text.push_str("    u = first / chance;\n    return lobe;\n}\n");
    text
}

fn sample() -> String {
    let mut text = String::from(
        "// A direction of a lobe; false: none.\n\
         bool sample_lobe(const Bsdf b, uint lobe, vec3 u, out LobeSample s) {\n    \
         s = LobeSample(b.g, false, vec3(0.0));\n",
    );
    for lobe in abi::LOBES {
        let name = lobe.name;
        let _infallible =
            writeln!(text, "    if ({}lobe == LOBE_{}) return {name}_sample(b, u, s);", has(lobe), name.to_uppercase());
    }
    text.push_str("    return false;\n}\n");
    text
}

fn add() -> String {
    let mut text = String::from(
        "// Adds what all lobes reflect in a direction, and their densities.\n\
         void add_lobes(const Bsdf b, const LobeDirection d, inout vec3 diffuse, inout vec3 specular,\n               \
         inout float pdf) {\n    \
         float kept;\n",
    );
    for lobe in abi::lobes_in_order(abi::LOBES_EVALUATED) {
        let name = lobe.name;
        let part = match lobe.part {
            LobePart::Diffuse => "diffuse",
            LobePart::Specular => "specular",
        };
        let side = match (lobe.normal, lobe.sides) {
            (LobeNormal::Shading, LobeSides::Reflects) => "!d.beyond && d.cosine > 0.0",
            (LobeNormal::Shading, LobeSides::Both) => "d.cosine > 0.0",
            (LobeNormal::Layers, LobeSides::Reflects) => "!d.beyond && d.i.z > 0.0",
            (LobeNormal::Layers, LobeSides::Both) => "(d.beyond ? d.i.z < 0.0 : d.i.z > 0.0)",
        };
        let _infallible = write!(
            text,
            "    if ({}b.chance.{name} > 0.0 && {side}) {{\n        \
             {part} += {name}_evaluate(b, d, kept);\n        pdf += {name}_density(b, d, kept);\n    }}\n",
            has(lobe)
        );
    }
    text.push_str("}\n");
    text
}
