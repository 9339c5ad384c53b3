// SPDX-License-Identifier: Apache-2.0
//! Writes the GLSL of the structs that host and shaders share.
//!
//! Pure. Errors here do not pass the comparison with the SPIR-V (`check.rs`).

use oocpt_abi::{LAYOUTS, MemberLayout};
use std::fmt::Write as _;

/// `generated/structs.glsl`.
pub(crate) fn structs() -> Result<String, String> {
    let mut text = String::from("// Written by rust/shaders/build.rs, from rust/abi/src.\n");
    for layout in LAYOUTS {
        let _infallible = writeln!(text, "\nstruct {} {{", layout.name);
        for member in layout.members {
            let (base, sides) = type_of(member).map_err(|error| format!("{}.{}: {error}", layout.name, member.name))?;
            let _infallible = writeln!(text, "    {base} {}{sides};", member.name);
        }
        text.push_str("};\n");
    }
    Ok(text)
}

/// The GLSL type of a member: the text before its name, and behind.
fn type_of(member: &MemberLayout) -> Result<(String, String), String> {
    if let Some(glsl) = member.glsl {
        let (base, sides) = glsl.split_at(glsl.find('[').unwrap_or(glsl.len()));
        return Ok((base.to_owned(), sides.to_owned()));
    }
    glsl(member.rust, member.size)
}

/// The GLSL type of a Rust type of `size` bytes.
fn glsl(rust: &str, size: usize) -> Result<(String, String), String> {
    let plain = |name: &str| Ok((name.to_owned(), String::new()));
    match rust {
        "u32" => return plain("uint"),
        "i32" => return plain("int"),
        "f32" => return plain("float"),
        "u64" => return plain("uint64_t"),
        "i64" => return plain("int64_t"),
        "[f32; 2]" => return plain("vec2"),
        "[f32; 3]" => return plain("vec3"),
        "[f32; 4]" => return plain("vec4"),
        "[u32; 3]" => return plain("uvec3"),
        _ => {}
    }
    let array = rust.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')?.rsplit_once("; "));
    let Some((element, count)) = array else {
        let known = LAYOUTS.iter().any(|layout| layout.name == rust);
        return if known { plain(rust) } else { Err(format!("no type of GLSL is known for {rust}")) };
    };
    // A length with a name follows from the sizes.
    let named = || LAYOUTS.iter().find(|layout| layout.name == element).map(|layout| size / layout.size);
    let count = count.parse().ok().or_else(named).ok_or_else(|| format!("{rust}: how many?"))?;
    let (base, sides) = glsl(element, size / count.max(1))?;
    Ok((base, format!("[{count}]{sides}")))
}
