// SPDX-License-Identifier: Apache-2.0
//! Writes the GLSL functions that dispatch over all shapes of lights, from the table.
//!
//! Pure. `shaders/light/shape.glsl` specifies the functions of a shape.

use oocpt_abi::{LIGHT_SHAPES, LightShape};
use std::fmt::Write as _;

/// `generated/light_shapes.glsl`: the shapes' files, their numbers, and functions over all of them.
pub(crate) fn functions() -> String {
    let mut text = String::from("// Written by rust/shaders/build.rs, from rust/abi/src/light_shapes.rs.\n\n");
    for LightShape { name, .. } in LIGHT_SHAPES {
        let _infallible = writeln!(text, "#include \"light/shapes/{name}.glsl\"");
    }
    text.push('\n');
    for shape in LIGHT_SHAPES {
        let _infallible = writeln!(text, "const uint {} = {}u;", constant(shape), shape.kind);
    }
    let solid = |call: &str| each(call, |shape| !shape.is_thin);
    let thin = |call: &str| each(call, |shape| shape.is_thin);
    let is_thin: Vec<String> =
        LIGHT_SHAPES.iter().filter(|shape| shape.is_thin).map(|shape| format!("kind == {}", constant(shape))).collect();
    let _infallible = write!(
        text,
        "
// Whether no ray can meet it.
bool is_thin(const uint kind) {{
    return {};
}}

// Whether the receiver is on the side that shines.
bool shape_faces(const uint kind, const vec3 o) {{
{}    return true;
}}

// The point q of the shape, and its distance, that a ray from outside meets.
bool shape_hit(const uint kind, const vec3 o, const vec3 d, out vec3 q, out float t) {{
    q = vec3(0.0);
    t = 0.0;
    if (is_thin(kind) || !shape_faces(kind, o)) return false;
{}    return false;
}}

// A point of the shape for the receiver o, from two random numbers; false when none shines there.
bool shape_point(const uint kind, const vec3 o, const vec2 u, out vec3 q) {{
    q = vec3(0.0);
    if (!shape_faces(kind, o)) return false;
{}    return true;
}}

// Density at the receiver, per world solid angle, of choosing the point q at distance t.
float shape_density(const uint kind, const float determinant, const vec3 o, const vec3 d, const vec3 q,
                    const float t) {{
    const float volume = abs(determinant);
{}    return 0.0;
}}

// What the intensity of a thin shape is multiplied by, seen along w.
float thin_length(const uint kind, const GpuLocalLight light, const vec3 w) {{
{}    return 1.0;
}}
",
        is_thin.join(" || "),
        solid("return NAME_faces(o)"),
        solid("return NAME_hit(o, d, q, t)"),
        each("q = NAME_point(o, u)", |_| true),
        solid("return NAME_density(volume, o, d, q, t)"),
        thin("return NAME_length(light, w)"),
    );
    text
}

/// `LIGHT_NAME`.
fn constant(shape: &LightShape) -> String {
    format!("LIGHT_{}", shape.name.to_uppercase())
}

/// A line for each shape for which `counts` is true, with its name in place of `NAME`.
fn each(call: &str, counts: impl Fn(&LightShape) -> bool) -> String {
    let line =
        |shape: &LightShape| format!("    if (kind == {}) {};\n", constant(shape), call.replace("NAME", shape.name));
    LIGHT_SHAPES.iter().filter(|shape| counts(shape)).map(line).collect()
}
