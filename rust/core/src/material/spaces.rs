// SPDX-License-Identifier: Apache-2.0
//! Names of colour spaces, and the choice between the names that a texture node has. Pure.
//!
//! The rule: `sourceColorSpace`, where it is authored and not `auto`, wins; then the `colorSpace` metadata of the
//! attribute `file`; then the file itself (`auto` of the `UsdPreviewSurface` specification 2.6). The specification
//! knows `raw`, `sRGB` and `auto` and no metadata, and `HdStorm` reads nothing else, so a scene that says one of the
//! two looks here as it does there; metadata, which `HdStorm` ignores, counts only where the scene leaves the question
//! open.

use super::ColorSpace;
use super::compiler::NetworkCompiler;
use super::params::text;
use crate::desc::NodeDesc;

/// Names of the sRGB curve with the primaries of Rec. 709: of `UsdUVTexture`, `GfColorSpaceNames`, the Color Interop
/// Forum, and the configurations of ACES.
const SRGB: &[&str] = &[
    "srgb",
    "srgb_texture",
    "srgb_tx",
    "srgb_rec709",
    "srgb_rec709_scene",
    "srgb - texture",
    "srgb texture",
    "srgb encoded rec.709 (srgb)",
    "srgb_encoded_rec709_tx",
    "utility - srgb - texture",
    "input - generic - srgb - texture",
];

/// Names for data, or for linear values with the primaries of Rec. 709.
const RAW: &[&str] = &[
    "raw",
    "data",
    "identity",
    "none",
    "non-color",
    "noncolor",
    "utility - raw",
    "linear",
    "lin_rec709",
    "lin_rec709_scene",
    "lin_rec709_srgb",
    "lin_srgb",
    "linear srgb",
    "linear rec.709",
    "linear rec.709 (srgb)",
    "utility - linear - srgb",
    "utility - linear - rec.709",
];

/// Names that leave the choice to the file.
const AUTO: &[&str] = &["", "auto", "unknown"];

/// The colour space of a name. Case is ignored, as in `OpenColorIO`.
pub(super) fn named(name: &str) -> ColorSpace {
    let lower = name.trim().to_ascii_lowercase();
    let is_in = |list: &[&str]| list.contains(&&*lower);
    if is_in(AUTO) {
        ColorSpace::Auto
    } else if is_in(RAW) {
        ColorSpace::Raw
    } else if is_in(SRGB) {
        ColorSpace::Srgb
    } else {
        ColorSpace::Named(name.trim().into())
    }
}

/// Decodes a value with the sRGB curve.
#[must_use]
pub fn linear_from_srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

impl<'a> NetworkCompiler<'a> {
    /// The colour space of a texture node, by the rule above.
    pub(super) fn color_space(&mut self, node: &'a NodeDesc) -> ColorSpace {
        let mut named_by = |name: &str| text(node, name, &mut self.problems).map_or(ColorSpace::Auto, named);
        match named_by("sourceColorSpace") {
            // Both front ends pass the metadata of an input as a parameter of this name.
            ColorSpace::Auto => named_by("colorSpace:file"),
            space => space,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linear_and_srgb_names_need_no_conversion() {
        for name in ["sRGB", "srgb_texture", "sRGB - Texture", "srgb_rec709_scene", "Utility - sRGB - Texture"] {
            assert_eq!(named(name), ColorSpace::Srgb, "{name}");
        }
        for name in
            ["raw", "Raw", "data", "identity", "lin_rec709", "lin_rec709_scene", "linear", "Linear Rec.709 (sRGB)"]
        {
            assert_eq!(named(name), ColorSpace::Raw, "{name}");
        }
        for name in ["", "auto", "Auto", "unknown", " "] {
            assert_eq!(named(name), ColorSpace::Auto, "{name}");
        }
    }

    #[test]
    fn unknown_color_space_names_are_kept_verbatim() {
        for name in ["ACEScg", "lin_ap1", "srgb_ap1", "scene_linear", "g22_rec709", "Studio Camera Log"] {
            assert_eq!(named(name), ColorSpace::Named(name.into()), "{name}");
        }
        assert_eq!(named(" ACEScg "), ColorSpace::Named("ACEScg".into()), "without space around it");
    }
}
