// SPDX-License-Identifier: Apache-2.0
//! GLSL of the table of leaf kinds: what goes through all of them but triangles, written once.
//!
//! Pure. `shaders/geometry/leaf.glsl` says which functions a kind has.

use oocpt_abi::{LEAVES, LeafType};
use std::fmt::Write as _;

/// The kinds' files and numbers, and whether there may be any.
fn head() -> String {
    let mut text = String::from("// Written by rust/shaders/build.rs, from rust/abi/src/leaves.rs.\n\n");
    for LeafType { name, .. } in others() {
        let _infallible = writeln!(text, "#include \"geometry/{name}.glsl\"");
    }
    text.push('\n');
    for leaf in LEAVES {
        let _infallible = writeln!(text, "const uint {} = {}u;", constant(leaf), leaf.number);
    }
    let compiled: Vec<String> = others().map(|leaf| format!("({})", has(leaf))).collect();
    let _infallible = write!(
        text,
        "
// Whether leaves may be made of anything but triangles.
const bool HAS_LEAF_KINDS = {};

// The number of a mesh's kind.
uint leaf_kind(const uint flags) {{
    return (flags & MESH_LEAF_MASK) >> MESH_LEAF_SHIFT;
}}
",
        compiled.join(" || ")
    );
    text
}

/// `generated/leaves.glsl`: that, and functions over all of them.
pub(crate) fn functions() -> String {
    let tubes: Vec<String> = others().filter(|leaf| leaf.is_tube).map(is).collect();
    let mut text = head();
    let _infallible = write!(
        text,
        "
// Whether a ray meets the item in front of its origin, at which distance, and the weights of the second and third
// corner there.
bool leaf_hit(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t,
              out vec2 uv) {{
    t = 0.0;
    uv = vec2(0.0);
{}    return false;
}}

// Whether a ray leaves the item that it enters in front of its origin, and where.
bool leaf_exit(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec3 o, const vec3 d, out float t,
               out vec2 uv) {{
    t = 0.0;
    uv = vec2(0.0);
{}    return false;
}}

// The point of the item's surface at a hit, given where the ray meets it, and the unit normal there.
vec3 leaf_point(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 met,
                out vec3 normal) {{
    normal = vec3(0.0, 0.0, 1.0);
{}    return met;
}}

// How far beside the surface at a hit with this normal a point is.
float leaf_beside(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 normal,
                  const vec3 point) {{
{}    return 0.0;
}}

// A bound on how far the leaf test may see the surface from its place, for a ray that begins there.
float leaf_rounding(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec3 point) {{
{}    return 0.0;
}}

// The edges along which values by corner change.
void leaf_edges(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, out vec3 e, out vec3 f) {{
    e = v1 - v0;
    f = v2 - v0;
{}}}

// What a point of the surface keeps when the item moves or changes its size.
vec3 leaf_keep(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 point) {{
{}    return point;
}}

// Where the point is that keeps this.
vec3 leaf_place(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv, const vec3 kept) {{
{}    return kept;
}}

// Whether it is a piece of a tube around its first edge.
bool leaf_is_tube(const uint kind) {{
    return {};
}}

// The radius of a tube at a hit.
float leaf_radius(const uint kind, const vec3 v0, const vec3 v1, const vec3 v2, const vec2 uv) {{
{}    return 0.0;
}}
",
        each("return NAME_hit(v0, v1, v2, o, d, t, uv)", |_| true),
        each("return NAME_exit(v0, v1, v2, o, d, t, uv)", |_| true),
        each("return NAME_point(v0, v1, v2, uv, met, normal)", |_| true),
        each("return NAME_beside(v0, v1, v2, uv, normal, point)", |_| true),
        each("return NAME_rounding(v0, v1, v2, point)", |_| true),
        each("NAME_edges(v0, v1, v2, e, f)", |_| true),
        each("return NAME_keep(v0, v1, v2, uv, point)", |_| true),
        each("return NAME_place(v0, v1, v2, uv, kept)", |_| true),
        tubes.join(" || "),
        each("return NAME_radius(v0, v1, v2, uv)", |leaf| leaf.is_tube),
    );
    text
}

/// All but triangles, which call sites handle themselves: without other kinds nothing but that is compiled.
fn others() -> impl Iterator<Item = &'static LeafType> {
    LEAVES.iter().filter(|leaf| leaf.number != LeafType::TRIANGLE.number)
}

/// `LEAF_NAME`.
fn constant(leaf: &LeafType) -> String {
    format!("LEAF_{}", leaf.name.to_uppercase())
}

/// `HAS_A && HAS_B`.
fn has(leaf: &LeafType) -> String {
    let needs: Vec<String> = leaf.needs.iter_names().map(|(name, _)| format!("HAS_{name}")).collect();
    needs.join(" && ")
}

/// Whether it is compiled in and the kind that is asked about.
fn is(leaf: &LeafType) -> String {
    format!("({} && kind == {})", has(leaf), constant(leaf))
}

/// A line for each kind that `counts`, with its name in the place of `NAME`.
fn each(call: &str, counts: impl Fn(&LeafType) -> bool) -> String {
    let line = |leaf: &LeafType| format!("    if {} {};\n", is(leaf), call.replace("NAME", leaf.name));
    others().filter(|leaf| counts(leaf)).map(line).collect()
}
