// SPDX-License-Identifier: Apache-2.0
//! Bounds on differences, by group of categories, and the numbers that are left out.

use super::table::{Block, width};

/// The bound of a category.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bound {
    /// Name of the group.
    pub(crate) group: &'static str,
    /// The greatest difference, over the scale of the row: the greatest of 1, the number, and with `by_inputs` the
    /// inputs.
    pub(crate) most: f64,
    pub(crate) by_inputs: bool,
}

const fn bound(group: &'static str, most: f64, by_inputs: bool) -> Bound {
    Bound { group, most, by_inputs }
}

const NOISE: Bound = bound("noise", 0.0, false);
/// The bound of all categories that are not listed.
const EXACT: Bound = bound("the same bits", 0.0, false);
/// Against f64 rounded once.
const FUNCTIONS: Bound = bound("functions", 2.0e-7, false);
/// A mixture of equal values is that value here, where `MaterialX` rounds three times.
const MIXTURES: Bound = bound("mixtures", 1.5e-7, true);
/// Sums in another order, quotients by a root, sines of a software device.
const ROUNDED: Bound = bound("sums and roots", 1.0e-6, true);
/// Powers and logarithms of a software device are approximations, and the generator writes constants with six decimals.
const POWERS: Bound = bound("powers", 5.0e-6, true);
/// Colours and noise at places that were turned and scaled: an error of a place counts as often as it was scaled.
const PLACES: Bound = bound("turned places", 2.0e-4, true);

const GROUPS: [(Bound, &[&str]); 6] = [
    (NOISE, &["noise2d", "noise3d", "fractal3d", "cellnoise2d", "cellnoise3d", "worleynoise2d", "worleynoise3d"]),
    (FUNCTIONS, &["sin", "cos", "tan", "asin", "acos", "atan2", "sqrt", "ln", "exp", "power", "safepower"]),
    (
        MIXTURES,
        &[
            "burn",
            "difference",
            "disjointover",
            "dodge",
            "in",
            "mask",
            "matte",
            "minus",
            "mix",
            "out",
            "over",
            "overlay",
            "plus",
            "ramp4",
            "ramp_gradient",
            "ramplr",
            "ramptb",
            "screen",
        ],
    ),
    (
        ROUNDED,
        &[
            "UsdTransform2d",
            "bitangent",
            "normal",
            "normalize",
            "normalmap",
            "place2d",
            "rotate2d",
            "rotate3d",
            "smoothstep",
            "standard_surface_to_open_pbr_surface",
            "open_pbr_surface_to_standard_surface",
            "tangent",
            "transformmatrix",
            "transformnormal",
            "viewdirection",
            "gltf_iridescence_thickness",
            "randomfloat",
            "blackbody",
        ],
    ),
    (
        POWERS,
        &[
            "acescg_to_lin_rec709",
            "adobergb_to_lin_rec709",
            "chiang_hair_absorption_from_color",
            "chiang_hair_roughness",
            "colorcorrect",
            "deon_hair_absorption_from_melanin",
            "g18_rec709_to_lin_rec709",
            "g22_ap1_to_lin_rec709",
            "g22_rec709_to_lin_rec709",
            "gooch_shade",
            "lin_adobergb_to_lin_rec709",
            "lin_displayp3_to_lin_rec709",
            "range",
            "rec709_display_to_lin_rec709",
            "srgb_displayp3_to_lin_rec709",
            "srgb_texture_to_lin_rec709",
        ],
    ),
    (
        PLACES,
        &[
            "UsdUVTexture",
            "gltf_colorimage",
            "gltf_image",
            "gltf_normalmap",
            "ramp",
            "randomcolor",
            "triplanarprojection",
            "unifiednoise2d",
            "unifiednoise3d",
        ],
    ),
];

impl Bound {
    pub(crate) fn of(block: &Block) -> Self {
        let found = GROUPS.iter().find(|(_, categories)| categories.contains(&block.category.as_str()));
        found.map_or(EXACT, |(bound, _)| *bound)
    }
}

/// Component `k` of an input of a row, or the only one.
fn input(block: &Block, row: &[f32], name: &str, k: usize) -> Option<f32> {
    let mut at = 0;
    for column in &block.inputs {
        if column.name == name {
            return Some(row[at + k.min(column.width - 1)]);
        }
        at += column.width;
    }
    None
}

/// The reason why a component of a row is left out: its definition differs there.
pub(crate) fn left_out(block: &Block, row: &[f32], k: usize) -> Option<&'static str> {
    let of = |name: &str| input(block, row, name, k).unwrap_or_default();
    let is_last = k == 3 && width(&block.kind) == 4;
    let (is_out, why) = match block.category.as_str() {
        // GLSL leaves it to the device; here it goes up.
        "round" => ((of("in") - of("in").floor()) == 0.5, "halves"),
        // A rounded remainder is next to 0 or next to the divisor.
        "modulo" => {
            let quotient = f64::from(of("in1")) / f64::from(of("in2"));
            ((quotient - quotient.round()).abs() < 2.0e-7 * quotient.abs().max(1.0), "whole quotients")
        }
        // The shader makes it 1; the specification leaves it as it is.
        "rgbtohsv" | "hsvtorgb" | "hsvadjust" => (is_last, "alpha"),
        "range" => (of("inlow") == of("inhigh"), "nothing between inlow and inhigh"),
        // The shader's step is as wide as a pixel; on the edge it is anything.
        "splitlr" | "splittb" => {
            let along = usize::from(block.category == "splittb");
            (input(block, row, "texcoord", along) == input(block, row, "center", 0), "the edge itself")
        }
        _ => (false, ""),
    };
    is_out.then_some(why)
}
