// SPDX-License-Identifier: Apache-2.0
//! The closing words of a batch render: one line about time, error and memory, and a warning if few pixels hold most of
//! the error. Pure.

use oocpt_core::stats::{ErrorRow, RenderStats, WorstPixel};

/// Share of the picture's error that is worth a warning when a few pixels hold it.
const SHARE: f64 = 0.5;
/// One pixel in so many may be among the few.
const ONE_IN: u64 = 1000;
/// The relative squared error from which a pixel is a firefly: it is off by as much as its surroundings show. A few
/// pixels at edges hold most of the error of a picture without noise, but theirs are smaller.
const OF_A_FIREFLY: f64 = 1.0;

/// Samples, seconds, relMSE with its 95 % interval, peak of the device memory, loads, the windows of the film, and
/// the devices of a picture that several render.
pub(crate) fn line(stats: &RenderStats) -> String {
    let estimate = stats.error.as_ref().and_then(|row| row.estimate);
    let error = estimate.map_or_else(
        || "error unknown".to_owned(),
        |error| format!("relMSE {:.1e} ({:.1e} to {:.1e})", error.rel_mse, error.low, error.high),
    );
    let loads = match &stats.streaming {
        streaming if streaming.in_core => "in core".to_owned(),
        streaming => format!("{} loads", streaming.loads),
    };
    let windows = match stats.film_windows {
        0 => String::new(),
        windows => format!(", the film in {windows} windows"),
    };
    let samples: Vec<String> = stats.devices.iter().map(|device| device.samples.to_string()).collect();
    let devices = match &*samples {
        [] => String::new(),
        [samples] => format!(", on 1 device ({samples} samples)"),
        samples => format!(", on {} devices ({} samples)", samples.len(), samples.join(", ")),
    };
    let denoised = stats.denoised.as_ref();
    let denoised =
        denoised.map_or_else(String::new, |usage| format!(", denoised in {:.1} s by {}", usage.seconds, usage.by));
    format!(
        "{} samples, {:.1} s, {error}, {} of device memory, {loads}{windows}{devices}{denoised}",
        stats.samples_completed,
        stats.seconds_total,
        bytes(stats.gpu_peak_bytes)
    )
}

/// Says which pixels hold half of the error, if they are few and there is a firefly among them.
pub(crate) fn fireflies(row: &ErrorRow, pixels: u64) -> Option<String> {
    let estimate = row.estimate?;
    #[expect(clippy::cast_precision_loss, reason = "a share")]
    let limit = SHARE * estimate.rel_mse * pixels as f64;
    if limit.is_nan() || limit <= 0.0 {
        return None;
    }
    let mut sum = 0.0;
    let holds = |pixel: &WorstPixel| {
        sum += pixel.error;
        sum >= limit
    };
    let count = 1 + row.worst.iter().position(holds)?;
    let worst = row.worst.first().filter(|worst| worst.error >= OF_A_FIREFLY)?;
    let (is, place) = match count {
        1 => ("1 pixel holds".to_owned(), ""),
        _ => (format!("{count} pixels hold"), "the worst "),
    };
    (count as u64 <= pixels / ONE_IN).then(|| {
        format!(
            "{is} half of the picture's error, {place}at {}, {} from the upper left: a small bright light that is met \
             by chance; more samples, oocpt:clamp or a larger light help",
            worst.x, worst.y
        )
    })
}

/// Formats a number of bytes in the unit that leaves one to four digits.
fn bytes(count: u64) -> String {
    #[expect(clippy::cast_precision_loss, reason = "two digits are shown")]
    let mib = count as f64 / f64::from(1 << 20);
    if mib < 1024.0 { format!("{mib:.0} MiB") } else { format!("{:.1} GiB", mib / 1024.0) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::convergence::ErrorEstimate;
    use oocpt_core::stats::{DenoiserUsage, DeviceUsage};

    fn row(rel_mse: f64, worst: &[f64]) -> ErrorRow {
        let estimate = Some(ErrorEstimate { rel_mse, low: 0.5 * rel_mse, high: 2.0 * rel_mse });
        let pixel = |(x, error): (u32, &f64)| WorstPixel { x, y: 7, error: *error };
        ErrorRow { estimate, worst: (3..).zip(worst).map(pixel).collect(), ..ErrorRow::default() }
    }

    #[test]
    fn the_line_names_time_error_memory_and_loads() {
        let mut stats = RenderStats { samples_completed: 64, seconds_total: 12.34, ..RenderStats::default() };
        stats.gpu_peak_bytes = 1500 << 20;
        stats.error = Some(row(4.1e-3, &[]));
        stats.streaming.loads = 7;
        assert_eq!(
            line(&stats),
            "64 samples, 12.3 s, relMSE 4.1e-3 (2.1e-3 to 8.2e-3), 1.5 GiB of device memory, 7 loads"
        );
        let by = "Open Image Denoise 2.5.1, CPU".to_owned();
        stats.denoised = Some(DenoiserUsage { by, seconds: 0.31, replaces_color: true, ..DenoiserUsage::default() });
        assert!(line(&stats).ends_with("7 loads, denoised in 0.3 s by Open Image Denoise 2.5.1, CPU"), "{stats:?}");
        stats.denoised = None;
        (stats.streaming.in_core, stats.error, stats.gpu_peak_bytes) = (true, None, 300 << 20);
        assert_eq!(line(&stats), "64 samples, 12.3 s, error unknown, 300 MiB of device memory, in core");
        for (samples, said) in [(&[64][..], "on 1 device (64 samples)"), (&[40, 24], "on 2 devices (40, 24 samples)")] {
            let used = |&samples: &u32| DeviceUsage { samples, ..DeviceUsage::default() };
            stats.devices = samples.iter().map(used).collect();
            assert!(line(&stats).ends_with(said), "{}", line(&stats));
        }
        stats.devices = Vec::new();
        stats.film_windows = 5;
        assert!(line(&stats).ends_with(" of device memory, in core, the film in 5 windows"), "{}", line(&stats));
    }

    #[test]
    fn few_pixels_with_half_of_the_error_are_told_with_their_place() {
        // 10 000 pixels of 1e-3: 10 in all.
        let said = fireflies(&row(1e-3, &[4.0, 1.5, 0.1]), 10_000).expect("5.5 of 10");
        assert!(said.starts_with("2 pixels hold half of the picture's error, the worst at 3, 7"), "{said}");
        let said = fireflies(&row(1e-3, &[6.0]), 10_000).expect("6 of 10");
        assert!(said.starts_with("1 pixel holds half of the picture's error, at 3, 7"), "{said}");
        assert_eq!(fireflies(&row(1e-3, &[2.0, 1.0, 1.0]), 10_000), None, "4 of 10");
    }

    #[test]
    fn edges_of_a_picture_without_noise_are_no_fireflies() {
        assert!(fireflies(&row(1e-6, &[1.2]), 40_000).is_some(), "off by more than it shows");
        assert_eq!(fireflies(&row(1e-6, &[0.03, 0.01]), 40_000), None, "all of 0.04, but small");
    }

    #[test]
    fn pixels_that_are_many_are_no_fireflies() {
        let worst = [1.0; 8];
        assert!(fireflies(&row(1e-3, &worst), 8_000).is_some(), "4 of 8000");
        assert_eq!(fireflies(&row(2e-3, &worst), 3_999), None, "4 of 3999");
        assert_eq!(fireflies(&row(0.0, &worst), 8_000), None, "no error");
        assert_eq!(fireflies(&ErrorRow { worst: row(1.0, &worst).worst, ..ErrorRow::default() }, 8_000), None);
    }
}
