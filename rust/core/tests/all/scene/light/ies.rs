// SPDX-License-Identifier: Apache-2.0
//! IES profiles: angles, symmetry, power, and hostile files.

use std::f64::consts::PI;

use oocpt_core::scene::{IesError, IesProfile};
use proptest::prelude::*;

/// A file of these angles and candelas.
fn file(vertical: &[f64], horizontal: &[f64], candela: impl Fn(f64, f64) -> f64) -> String {
    let list = |values: &[f64]| values.iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
    let values: Vec<f64> =
        horizontal.iter().flat_map(|&h| vertical.iter().map(move |&v| (v, h))).map(|(v, h)| candela(v, h)).collect();
    format!(
        "IESNA:LM-63-2002\r\n[TEST] made here\r\nTILT=NONE\r\n1 -1 2.0 {} {} 1 2 0 0 0\r\n0.5 1 60\r\n{}\r\n{}\r\n{}\r\n",
        vertical.len(),
        horizontal.len(),
        list(vertical),
        list(horizontal),
        list(&values)
    )
}

fn steps(count: u32, last: f64) -> Vec<f64> {
    (0..=count).map(|i| last * f64::from(i) / f64::from(count)).collect()
}

#[test]
fn a_uniform_profile_has_the_power_of_an_isotropic_light() {
    let profile = IesProfile::parse(file(&[0.0, 180.0], &[0.0], |_, _| 3.0).as_bytes()).expect("a profile");
    assert!((profile.power / (12.0 * PI) - 1.0).abs() < 1e-5, "multiplier 2 x ballast 0.5 x 3 cd: {}", profile.power);
    assert!((profile.candela(1.0, 2.0) - 3.0).abs() < 1e-6, "everywhere the same");
}

/// Power of max(0, cos theta): pi.
#[test]
fn a_cosine_profile_interpolates_and_integrates() {
    let text = file(&steps(90, 90.0), &[0.0], |v, _| v.to_radians().cos());
    let profile = IesProfile::parse(text.as_bytes()).expect("a profile");
    assert!((profile.power / PI - 1.0).abs() < 2e-4, "{}", profile.power);
    for degrees in [0.0_f64, 10.5, 45.0, 89.5] {
        let expected = degrees.to_radians().cos();
        assert!((profile.candela(degrees.to_radians(), 0.3) - expected).abs() < 1e-4, "{degrees}");
    }
    assert!(profile.candela(91.0_f64.to_radians(), 0.0).abs() < 1e-12, "nothing above the last angle");
}

/// The divisor of `ies:normalize`: the mean over the sphere, or over the half that a profile covers.
#[test]
fn the_mean_covers_only_measured_angles() {
    let mean = |first: f64, last: f64| {
        IesProfile::parse(file(&[first, last], &[0.0], |_, _| 3.0).as_bytes()).expect("a profile").mean()
    };
    let cap = |first: f64, last: f64| 0.5 * (first.to_radians().cos() - last.to_radians().cos());
    for (first, last, expected) in [
        (0.0, 180.0, 3.0),
        (0.0, 90.0, 3.0),
        (90.0, 180.0, 3.0),
        (0.0, 60.0, 3.0 * 2.0 * cap(0.0, 60.0)),
        (30.0, 120.0, 3.0 * 2.0 * cap(30.0, 120.0)),
        // hdEmbree takes this much as a half.
        (0.0, 95.0, 3.0 * 2.0 * cap(0.0, 95.0)),
        (0.0, 97.0, 3.0 * cap(0.0, 97.0)),
        (60.0, 180.0, 3.0 * cap(60.0, 180.0)),
    ] {
        let given = mean(first, last);
        assert!((given / expected - 1.0).abs() < 5e-3, "{first} to {last} degrees: {given}, not {expected}");
    }
}

#[test]
fn quarters_and_halves_are_mirrored() {
    let shape = |h: f64| 2.0 + (2.0 * h.to_radians()).cos();
    for (horizontal, symmetric) in [(steps(90, 90.0), true), (steps(180, 180.0), true), (steps(360, 360.0), true)] {
        let text = file(&[0.0, 90.0, 180.0], &horizontal, |_, h| shape(h));
        let profile = IesProfile::parse(text.as_bytes()).expect("a profile");
        for h in [0.0_f64, 30.0, 135.0, 200.0, 300.0, 359.5] {
            let value = profile.candela(1.0, h.to_radians());
            assert!(
                symmetric && (value - shape(h)).abs() < 2e-3,
                "{} angles at {h}: {value} not {}",
                horizontal.len(),
                shape(h)
            );
        }
    }
    let odd: Vec<f64> = (90..=270).step_by(10).map(f64::from).collect();
    let side = |h: f64| 2.0 + h.to_radians().sin();
    let profile = IesProfile::parse(file(&[0.0, 180.0], &odd, |_, h| side(h)).as_bytes()).expect("a profile");
    for h in [95.0_f64, 180.0, 265.0] {
        assert!((profile.candela(1.0, h.to_radians()) - side(h)).abs() < 1e-2, "{h}");
    }
    // Mirrored at the plane through 90 and 270.
    assert!(
        (profile.candela(1.0, 0.0) - side(180.0)).abs() < 1e-2
            && (profile.candela(1.0, 45.0_f64.to_radians()) - side(135.0)).abs() < 1e-2
    );
}

#[test]
fn malformed_profiles_give_a_specific_error() {
    let good = file(&steps(4, 90.0), &[0.0], |_, _| 1.0);
    assert!(IesProfile::parse(good.as_bytes()).is_ok(), "the file itself is sound");
    let cases = [
        (String::new(), IesError::NoTilt),
        (good.replace("TILT=NONE", "TILT=lamp.tlt"), IesError::TiltFile),
        (good.replace("1 -1 2.0 5 1 1", "1 -1 2.0 5 1 3"), IesError::Photometry("A")),
        (good.replace("1 -1 2.0 5 1 1", "1 -1 2.0 99999999 1 1"), IesError::Range("number of vertical angles")),
        (good.replace("1 -1 2.0 5 1 1", "1 -1 2.0 4096 4096 1"), IesError::Number("vertical angle")),
        (good.replace("22.5 45", "45 22.5"), IesError::Order("vertical")),
        (good.replace("0.5 1 60", "nan 1 60"), IesError::Number("ballast factor")),
    ];
    for (text, error) in cases {
        assert_eq!(IesProfile::parse(text.as_bytes()), Err(error));
    }
}

proptest! {
    /// No bytes make it panic, and its results are finite.
    #[test]
    fn arbitrary_bytes_never_panic(noise in proptest::collection::vec(any::<u8>(), 0..400), cut in 0_usize..200) {
        let good = file(&steps(6, 180.0), &steps(4, 90.0), |v, h| v + h);
        let mut bytes = good.into_bytes();
        let at = cut.min(bytes.len());
        bytes.splice(at..(at + noise.len() / 8).min(bytes.len()), noise.iter().copied().filter(|b| b % 3 == 0));
        if let Ok(profile) = IesProfile::parse(&bytes) {
            prop_assert!(profile.candela.iter().all(|c| c.is_finite() && *c >= 0.0), "candelas are finite");
            prop_assert!(profile.candela(1.0, 1.0).is_finite(), "so is what is between");
        }
        let _survived = IesProfile::parse(&noise);
    }
}
