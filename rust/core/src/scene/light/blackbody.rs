// SPDX-License-Identifier: Apache-2.0
//! Colour temperature. Pure.

/// Colour of a black body, linear Rec. 709 of luminance 1, as `UsdLux` wants it: temperatures clamp to 1000..10000 K,
/// the colour is scaled to luminance 1, then negative components (out of gamut below about 1900 K) become 0.
///
/// Chromaticity after Krystek, "An algorithm to calculate correlated colour temperature", 1985, eqs. (uv) for 1000 K to
/// 15000 K, error below 1e-4 in u and v. `None` for NaN.
#[must_use]
pub fn blackbody(kelvin: f32) -> Option<[f64; 3]> {
    if kelvin.is_nan() {
        return None;
    }
    let t = f64::from(kelvin).clamp(1000.0, 10000.0);
    let t2 = t * t;
    let u = (0.860_117_757 + 1.541_182_54e-4 * t + 1.286_412_12e-7 * t2)
        / (1.0 + 8.424_202_35e-4 * t + 7.081_451_63e-7 * t2);
    let v = (0.317_398_726 + 4.228_062_45e-5 * t + 4.204_816_91e-8 * t2)
        / (1.0 - 2.897_418_16e-5 * t + 1.614_560_53e-7 * t2);
    // CIE 1960 uv to xy, then XYZ at Y = 1.
    let denominator = 2.0 * u - 8.0 * v + 4.0;
    let (x, y) = (3.0 * u / denominator, 2.0 * v / denominator);
    let (big_x, big_z) = (x / y, (1.0 - x - y) / y);
    // XYZ to linear Rec. 709 (D65); the rows keep Y, so the luminance is 1 up to the rounding of the matrix.
    let rgb = [
        3.240_454_2 * big_x - 1.537_138_5 - 0.498_531_4 * big_z,
        -0.969_266_0 * big_x + 1.876_010_8 + 0.041_556_0 * big_z,
        0.055_643_4 * big_x - 0.204_025_9 + 1.057_225_2 * big_z,
    ];
    let luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
    Some(rgb.map(|c| (c / luminance).max(0.0)))
}
