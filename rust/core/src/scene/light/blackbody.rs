// SPDX-License-Identifier: Apache-2.0
//! Converts colour temperatures to colours. Pure.

/// Temperature of the first row of [`FIT`], kelvin.
const COLDEST: f64 = 1000.0;
/// Temperature of the last row, kelvin.
const HOTTEST: f64 = 10000.0;
/// Step between rows, kelvin.
const STEP: f64 = 500.0;

/// Green and blue relative to red, and their slopes per 1000 K.
///
/// Source: values and finite differences (10 K) of `UsdLux.BlackbodyTemperatureAsRgb` of usd-core 25.08, which gives
/// the colour of a black body (Planck's law, CIE 1931 observer) in linear Rec. 709. It departs from the Planckian locus
/// below 2000 K, where that leaves the gamut; hosts show their users the function's colours, so these are followed, not
/// the locus.
const FIT: [[f64; 4]; 19] = [
    [0.02749, 0.00000, 0.12228, 0.00000],
    [0.14966, 0.00000, 0.23027, 0.00810],
    [0.25664, 0.00810, 0.22233, 0.06727],
    [0.37203, 0.06745, 0.22027, 0.14582],
    [0.47673, 0.15360, 0.19834, 0.19189],
    [0.57038, 0.25920, 0.17674, 0.22368],
    [0.65348, 0.37715, 0.15648, 0.24251],
    [0.72688, 0.50161, 0.13804, 0.25097],
    [0.79154, 0.62805, 0.12156, 0.25168],
    [0.84846, 0.75323, 0.10702, 0.24690],
    [0.89858, 0.87490, 0.09438, 0.23864],
    [0.94277, 0.99164, 0.07965, 0.21755],
    [0.98182, 1.10260, 0.07467, 0.21815],
    [1.01641, 1.20737, 0.06623, 0.20562],
    [1.04715, 1.30584, 0.05878, 0.19256],
    [1.07455, 1.39810, 0.05240, 0.17995],
    [1.09907, 1.48438, 0.04688, 0.16797],
    [1.12108, 1.56496, 0.04225, 0.15731],
    [1.14090, 1.64020, 0.02079, 0.07890],
];

/// Colour of a black body, linear Rec. 709 of luminance 1, as `UsdLux` wants it: temperatures clamp to 1000..10000 K,
/// and components are not negative.
///
/// Cubic Hermite interpolation of `FIT`; within 1e-3 of `UsdLux.BlackbodyTemperatureAsRgb` in every component and at
/// every temperature (`tests/hydra/test_features_lights.py`). `None` for NaN.
#[must_use]
pub fn blackbody(kelvin: f32) -> Option<[f64; 3]> {
    if kelvin.is_nan() {
        return None;
    }
    let at = (f64::from(kelvin).clamp(COLDEST, HOTTEST) - COLDEST) / STEP;
    let row = at.floor().min((HOTTEST - COLDEST) / STEP - 1.0);
    let s = at - row;
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 17")]
    let mut rows = FIT.iter().skip(row as usize);
    let (a, b) = (rows.next()?, rows.next()?);
    let (s2, s3) = (s * s, s * s * s);
    let cubic = |k: usize| {
        let values = a[k] * (2.0 * s3 - 3.0 * s2 + 1.0) + b[k] * (3.0 * s2 - 2.0 * s3);
        let slopes = a[k + 2] * (s3 - 2.0 * s2 + s) + b[k + 2] * (s3 - s2);
        (values + slopes * (STEP / 1000.0)).max(0.0)
    };
    let rgb = [1.0, cubic(0), cubic(1)];
    let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
    Some(rgb.map(|c| c / luminance))
}
