// SPDX-License-Identifier: Apache-2.0
//! What the header of a product's file says of time: the frame, its rate, the shutter. Pure.

use crate::film::picture::{PictureAttribute, PictureAttributes, exr_text};
use crate::job::product::{FileTimes, ProductFile};
use exr::meta::attribute::{AttributeValue, Rational, TimeCode};
use exr::prelude::{ImageAttributes, LayerAttributes};

/// Attributes of OocPT.
pub(crate) fn times(file: &ProductFile) -> PictureAttributes {
    let FileTimes { frame, rate, shutter: [open, close] } = file.times;
    let shutter =
        [("shutterOpen", open), ("shutterClose", close)].map(|(name, at)| (open < close).then_some((name, at)));
    let rate = rate.map(|rate| ("timeCodesPerSecond", rate));
    let numbers = frame.map(|frame| ("frame", frame)).into_iter().chain(rate).chain(shutter.into_iter().flatten());
    numbers.map(|(name, number)| (name.to_owned(), PictureAttribute::Number(number))).collect()
}

/// Adds the attributes that `OpenEXR` defines (`framesPerSecond`, `timeCode`, `expTime`), and a plain `frame`.
#[expect(clippy::cast_possible_truncation, reason = "the attribute has single precision")]
pub(super) fn add(file: &ProductFile, layer: &mut LayerAttributes, shared: &mut ImageAttributes) {
    let FileTimes { frame, rate, shutter: [open, close] } = file.times;
    if let Some(frame) = frame {
        layer.other.insert(exr_text("frame"), AttributeValue::F64(frame));
    }
    let Some(rate) = rate else { return };
    layer.frames_per_second = fraction(rate);
    layer.exposure = (open < close).then(|| ((close - open) / rate) as f32);
    shared.time_code = frame.and_then(|frame| time_code(frame, rate));
}

/// A rate as a fraction: rates of film and video exactly, as 24000/1001 for 23.976.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "below 2^31")]
fn fraction(rate: f64) -> Option<Rational> {
    let whole = |number: f64| (number.round() - number).abs() < 1e-4 * number;
    let divisor = [1.0, 1.001, 100.0, 1e4].into_iter().find(|divisor| {
        let number = rate * divisor;
        whole(number) && number.round() >= 1.0 && (number.round() / divisor - rate).abs() < 1e-4 * rate
    })?;
    let (numerator, denominator) = if divisor == 1.001 { (1e3, 1001) } else { (1.0, divisor as u32) };
    let numerator = (rate * divisor).round() * numerator;
    (numerator < f64::from(i32::MAX)).then_some((numerator as i32, denominator))
}

/// The time code (SMPTE 12M, without dropped frames) of a whole frame from 0 on; none beyond a day, nor for rates that
/// it has no numbers for.
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "checked")]
fn time_code(frame: f64, rate: f64) -> Option<TimeCode> {
    let base = rate.round();
    let is_usual = (1.0..=30.0).contains(&base) && (rate - base).abs() < 0.05;
    if !is_usual || frame.fract() != 0.0 || !(0.0..86400.0 * base).contains(&frame) {
        return None;
    }
    let (seconds, frame) = ((frame / base).floor(), (frame % base) as u8);
    let seconds = seconds as u32;
    Some(TimeCode {
        hours: (seconds / 3600) as u8,
        minutes: (seconds / 60 % 60) as u8,
        seconds: (seconds % 60) as u8,
        frame,
        drop_frame: false,
        color_frame: false,
        field_phase: false,
        binary_group_flags: [false; 3],
        binary_groups: [0; 8],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_of_film_and_video_are_exact_fractions() {
        for (rate, expected) in [
            (24.0, (24, 1)),
            (23.976, (24000, 1001)),
            (24000.0 / 1001.0, (24000, 1001)),
            (29.97, (30000, 1001)),
            (12.5, (1250, 100)),
            (1.0, (1, 1)),
            (1000.0, (1000, 1)),
        ] {
            assert_eq!(fraction(rate), Some(expected), "{rate}");
        }
        assert_eq!([1e-9, 1e30, 0.0].map(fraction), [None; 3]);
    }

    #[test]
    fn time_codes_count_frames_seconds_minutes_and_hours() {
        let at = |frame: f64, rate: f64| time_code(frame, rate).map(|c| [c.hours, c.minutes, c.seconds, c.frame]);
        assert_eq!(at(0.0, 24.0), Some([0; 4]));
        assert_eq!(at(1001.0, 24.0), Some([0, 0, 41, 17]));
        assert_eq!(at(24.0 * 3600.0 * 23.0 + 24.0 * 3599.0 + 23.0, 24.0), Some([23, 59, 59, 23]));
        assert_eq!(at(29.0, 29.97), Some([0, 0, 0, 29]));
        for (frame, rate) in [(-1.0, 24.0), (0.5, 24.0), (1.0, 60.0), (1.0, 12.5), (24.0 * 86400.0, 24.0), (1.0, 0.0)] {
            assert_eq!(at(frame, rate), None, "{frame} at {rate}");
        }
        assert_eq!(at(f64::NAN, 24.0), None);
    }
}
