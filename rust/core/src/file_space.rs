// SPDX-License-Identifier: Apache-2.0
//! The linear colour spaces in which products are written (`renderingColorSpace` of the render settings). Pure.
//!
//! Light is transported in linear Rec. 709; what is written is taken to another space by the matrix of both spaces'
//! primaries, with the Bradford adaptation of their white points (Lam 1985), as `GfColorSpace` and `OpenColorIO` do.
//! Any thread.

use glam::{DMat3, DVec2, DVec3};

/// A linear RGB space.
#[derive(Debug, PartialEq)]
pub struct FileSpace {
    /// The names that scenes have for it, USD's first; compared by their letters and digits, without `_scene`.
    names: &'static [&'static str],
    /// Chromaticities x, y of red, green, blue and white.
    pub chromaticities: [[f64; 2]; 4],
}

const D65: [f64; 2] = [0.3127, 0.3290];
/// White of the ACES spaces (SMPTE ST 2065-1, Academy S-2014-004).
const ACES: [f64; 2] = [0.32168, 0.33767];

/// In which light is transported (ITU-R BT.709-6).
const REC709: FileSpace = FileSpace {
    names: &["lin_rec709_scene", "lin_srgb", "Linear Rec.709 (sRGB)", "Linear Rec.709"],
    chromaticities: [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06], D65],
};
/// BT.2020-2, SMPTE EG 432-1 with white D65, Adobe RGB (1998).
const OTHERS: [FileSpace; 5] = [
    FileSpace {
        names: &["lin_ap1_scene", "ACEScg", "lin_acescg"],
        chromaticities: [[0.713, 0.293], [0.165, 0.830], [0.128, 0.044], ACES],
    },
    FileSpace {
        names: &["lin_ap0_scene", "ACES2065-1", "aces", "lin_aces2065-1"],
        chromaticities: [[0.7347, 0.2653], [0.0, 1.0], [0.0001, -0.077], ACES],
    },
    FileSpace {
        names: &["lin_rec2020_scene", "Linear Rec.2020"],
        chromaticities: [[0.708, 0.292], [0.170, 0.797], [0.131, 0.046], D65],
    },
    FileSpace {
        names: &["lin_p3d65_scene", "lin_displayp3", "Linear P3-D65"],
        chromaticities: [[0.680, 0.320], [0.265, 0.690], [0.150, 0.060], D65],
    },
    FileSpace {
        names: &["lin_adobergb_scene", "Linear AdobeRGB"],
        chromaticities: [[0.64, 0.33], [0.21, 0.71], [0.15, 0.06], D65],
    },
];
/// Names for values as they are.
const AS_THEY_ARE: [&str; 5] = ["", "raw", "data", "identity", "unknown"];

/// What is compared of a name.
fn plain(name: &str) -> String {
    let short = name.trim().chars().take(64).filter(char::is_ascii_alphanumeric);
    let text: String = short.map(|c| c.to_ascii_lowercase()).collect();
    text.strip_suffix("scene").map(str::to_owned).unwrap_or(text)
}

impl FileSpace {
    /// The space of this name; `None` where values are written as they are.
    ///
    /// # Errors
    /// The nearest name, if there is no such space.
    pub fn named(name: &str) -> Result<Option<&'static Self>, &'static str> {
        let wanted = plain(name);
        let is_it = |names: &[&str]| names.iter().any(|known| plain(known) == wanted);
        if AS_THEY_ARE.contains(&&*wanted) || is_it(REC709.names) {
            return Ok(None);
        }
        let nearest = || {
            let names = OTHERS.iter().chain([&REC709]).flat_map(|space| space.names.iter().copied());
            names.min_by_key(|known| strsim::damerau_levenshtein(&plain(known), &wanted)).unwrap_or("raw")
        };
        OTHERS.iter().find(|space| is_it(space.names)).map(Some).ok_or_else(nearest)
    }

    /// USD's name for it.
    pub fn name(&self) -> &'static str {
        self.names.first().copied().unwrap_or_default()
    }

    /// The rows of the matrix from linear Rec. 709 to this space.
    pub fn from_rec709(&self) -> [[f64; 3]; 3] {
        let adapted = bradford(REC709.white(), self.white());
        let matrix = self.to_xyz().inverse() * adapted * REC709.to_xyz();
        [0, 1, 2].map(|row| matrix.row(row).to_array())
    }

    fn white(&self) -> DVec3 {
        xyz(self.chromaticities[3])
    }

    /// From RGB to XYZ: white has luminance 1.
    fn to_xyz(&self) -> DMat3 {
        let [red, green, blue, _] = self.chromaticities.map(xyz);
        let primaries = DMat3::from_cols(red, green, blue);
        primaries * DMat3::from_diagonal(primaries.inverse() * self.white())
    }
}

/// The colour of luminance 1 of a chromaticity.
fn xyz(chromaticity: [f64; 2]) -> DVec3 {
    let DVec2 { x, y } = DVec2::from(chromaticity);
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

/// The matrix of XYZ that takes one white to another.
fn bradford(from: DVec3, to: DVec3) -> DMat3 {
    let cones =
        DMat3::from_cols_array_2d(&[[0.8951, -0.7502, 0.0389], [0.2664, 1.7135, -0.0685], [-0.1614, 0.0367, 1.0296]]);
    cones.inverse() * DMat3::from_diagonal((cones * to) / (cones * from)) * cones
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn matrices_are_those_of_openusd() {
        // Gf.ColorSpace(NAME).Convert of red, green, blue in lin_rec709_scene, OpenUSD 25.08; each row is an output.
        let known = [
            (
                "lin_ap1_scene",
                [
                    [0.613_098, 0.339_523, 0.047_379],
                    [0.070_194, 0.916_354, 0.013_452],
                    [0.020_616, 0.109_570, 0.869_815],
                ],
            ),
            (
                "lin_ap0_scene",
                [
                    [0.439_633, 0.382_989, 0.177_378],
                    [0.089_776, 0.813_439, 0.096_784],
                    [0.017_541, 0.111_547, 0.870_912],
                ],
            ),
            (
                "lin_rec2020_scene",
                [
                    [0.627_404, 0.329_283, 0.043_313],
                    [0.069_097, 0.919_540, 0.011_362],
                    [0.016_391, 0.088_013, 0.895_595],
                ],
            ),
            (
                "lin_p3d65_scene",
                [[0.822_462, 0.177_538, 0.0], [0.033_194, 0.966_806, 0.0], [0.017_083, 0.072_397, 0.910_520]],
            ),
            ("lin_adobergb_scene", [[0.715_126, 0.284_874, 0.0], [0.0, 1.0, 0.0], [0.0, 0.041_162, 0.958_838]]),
        ];
        for (name, rows) in known {
            let space = FileSpace::named(name).expect("known").expect("another space");
            assert_eq!(space.name(), name);
            for (row, expected) in space.from_rec709().iter().zip(rows) {
                for (have, want) in row.iter().zip(expected) {
                    assert!((have - want).abs() < 1.5e-6, "{name}: {row:?}, not {expected:?}");
                }
                assert!((row.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{name}: grey stays grey");
            }
        }
    }

    #[test]
    fn names_of_usd_and_of_configurations_are_known() {
        let named = |name: &str| FileSpace::named(name).map(|space| space.map(FileSpace::name));
        for name in ["lin_ap1", "acescg", "ACEScg", "lin_ap1_scene", " ACES cg "] {
            assert_eq!(named(name), Ok(Some("lin_ap1_scene")), "{name}");
        }
        for name in ["", "raw", "lin_srgb", "lin_rec709", "lin_rec709_scene", "Linear Rec.709 (sRGB)"] {
            assert_eq!(named(name), Ok(None), "{name}");
        }
        assert_eq!(named("aces2065-1"), Ok(Some("lin_ap0_scene")));
        assert_eq!(named("lin_displayp3"), Ok(Some("lin_p3d65_scene")));
        assert_eq!(named("lin_rec2021"), Err("lin_rec2020_scene"), "the nearest");
        assert!(named("srgb_texture").is_err() && named(&"x".repeat(100_000)).is_err(), "not linear, no name");
    }
}
