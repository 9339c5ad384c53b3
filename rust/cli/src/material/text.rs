// SPDX-License-Identifier: Apache-2.0
//! Materials as text for a terminal.

use oocpt_core::material::{MaterialText, ProgramText};
use std::fmt::Write as _;

/// A material's kind in a word or two.
fn kind(material: &MaterialText) -> &str {
    match (material.is_understood, material.surface.as_str()) {
        (_, "") => "no surface",
        (true, surface) => surface,
        (false, _) => "not understood",
    }
}

fn count(number: usize, what: &str) -> String {
    let plural = if number == 1 { "" } else { "s" };
    format!("{number} {what}{plural}")
}

/// One line for each material.
pub(super) fn list(materials: &[&MaterialText]) -> String {
    let longest = materials.iter().map(|material| material.path.chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for material in materials {
        let programs =
            [&material.program, &material.opacity_program, &material.emission_program, &material.displacement_program];
        let instructions = programs.iter().map(|program| program.instructions.len()).sum();
        let costs = [
            count(material.nodes.len(), "node"),
            count(instructions, "instruction"),
            count(material.textures.len(), "texture"),
            count(material.warnings.len(), "warning"),
        ];
        line(&mut text, &format!("{:<longest$}  {}, {}", material.path, kind(material), costs.join(", ")));
    }
    line(&mut text, &count(materials.len(), "material"));
    text
}

/// The whole of a material.
pub(super) fn whole(material: &MaterialText) -> String {
    let mut text = String::new();
    line(&mut text, &format!("{}: {}", material.path, kind(material)));
    section(&mut text, &format!("as it arrived: {}", count(material.nodes.len(), "node")));
    for node in &material.nodes {
        line(&mut text, &format!("  {}  {}", node.path, node.kind));
        for input in &node.inputs {
            line(&mut text, &format!("      {input}"));
        }
    }
    section(&mut text, "folded: inputs of the BSDF");
    if !material.is_understood {
        line(&mut text, "  none: its meshes look as if they had no material");
    }
    for value in &material.values {
        line(&mut text, &format!("  {value}"));
    }
    let longest = material.inputs.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    for (name, value) in &material.inputs {
        line(&mut text, &format!("  {name:<longest$}  {value}"));
    }
    for value in &material.displacement_values {
        line(&mut text, &format!("  displacement: {value}"));
    }
    if !material.displacement.is_empty() {
        line(&mut text, &format!("  displacement  {}", material.displacement));
    }
    program(&mut text, "bytecode", &material.program);
    program(&mut text, "bytecode of the opacity", &material.opacity_program);
    program(&mut text, "bytecode of the emission, for points of the light", &material.emission_program);
    program(&mut text, "bytecode of the displacement, for vertices", &material.displacement_program);
    if material.program.instructions.is_empty() && material.opacity_program.instructions.is_empty() {
        section(&mut text, "bytecode: none, no input needs a program");
    }
    section(&mut text, &format!("for each hit: {}", count(material.lookups, "texture lookup")));
    line(
        &mut text,
        &format!(
            "  needs {}",
            if material.needs.is_empty() { "nothing".to_owned() } else { material.needs.join(", ") }
        ),
    );
    for texture in &material.textures {
        line(&mut text, &format!("  texture {texture}"));
    }
    text += &warnings("warnings", &material.warnings);
    text
}

fn program(text: &mut String, title: &str, program: &ProgramText) {
    if program.instructions.is_empty() {
        return;
    }
    let ProgramText { instructions, noises, registers, constants, lookups } = program;
    let costs = [
        format!("{} ({noises} of noise)", count(instructions.len(), "instruction")),
        count(*registers, "register"),
        count(*constants, "constant"),
        count(*lookups, "texture lookup"),
    ];
    section(text, &format!("{title}: {}", costs.join(", ")));
    for (at, instruction) in instructions.iter().enumerate() {
        line(text, &format!("  {at:>4}  {instruction}"));
    }
}

/// Warnings below a title; empty if there are none.
pub(super) fn warnings(title: &str, warnings: &[String]) -> String {
    let mut text = String::new();
    if !warnings.is_empty() {
        section(&mut text, title);
    }
    for warning in warnings {
        line(&mut text, &format!("  {warning}"));
    }
    text
}

fn section(text: &mut String, title: &str) {
    line(text, "");
    line(text, title);
}

fn line(text: &mut String, line: &str) {
    // Writing to a String cannot fail.
    writeln!(text, "{line}").unwrap_or_default();
}
