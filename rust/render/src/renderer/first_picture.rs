// SPDX-License-Identifier: Apache-2.0
//! The first picture of a change in a live host: where a sample of each pixel takes longer than a frame, one of a part
//! of the resolution, filled up, so that what is shown is whole and follows the camera.
//!
//! It is rendered as a job of its own, one sample and the same passes, with statistics and messages that nobody sees;
//! what comes after it does not depend on it. Render thread only.

use crate::device::Device;
use crate::film::{Film, FilmSums};
use crate::frame::context::is_cpu;
use crate::job::RenderJob;
use crate::job::aov::AovKind;
use crate::job::publish::{PictureExtent, PublishedImages};
use crate::job::request::RenderRequest;
use crate::job::shared::SharedState;
use crate::job::window::{PictureLayout, PixelWindow};
use crate::sync::lock;
use oocpt_core::camera::Camera;
use oocpt_core::settings::Settings;
use oocpt_gpu::GpuError;
use rayon::prelude::*;
use std::time::Duration;

/// What the first picture may take to trace, seconds.
const TARGET_SECS: f64 = 0.02;
const TARGET_SECS_CPU: f64 = 0.07;
/// When it should be traced, seconds after the host asked: a commit that takes long leaves less time.
const DUE_SECS: f64 = 0.025;
const DUE_SECS_CPU: f64 = 0.085;
/// The share of the target that is left, however late it is.
const LEAST_SHARE: f64 = 0.3;
/// Paths a second of a device that has traced none yet.
const UNKNOWN_PACE: f64 = 2e7;
const UNKNOWN_PACE_CPU: f64 = 3e5;
/// By what each side of the picture is divided; the last where nothing is fast enough.
const FACTORS: [u32; 4] = [1, 2, 4, 8];
/// A newer job waits so long for the first picture of the one before: a host that moves the camera faster than a first
/// picture takes would see none at all.
pub(crate) const PATIENCE: Duration = Duration::from_secs(1);

/// How fast paths were traced last.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TracingPace {
    /// Paths a second.
    rate: Option<f64>,
}

impl TracingPace {
    /// Paths a second, if any have been traced.
    pub(crate) fn rate(self) -> Option<f64> {
        self.rate
    }

    /// Learns from a render of at least a sample for each pixel.
    pub(crate) fn learn(&mut self, paths: u64, secs: f64) {
        self.rate = rate(paths, secs).or(self.rate);
    }

    /// Learns from a first picture: when it was short, it says only how fast the device is at least.
    fn learn_at_least(&mut self, paths: u64, secs: f64, target: f64) {
        let Some(new) = rate(paths, secs) else { return };
        let old = self.rate.unwrap_or(new);
        self.rate = Some(if secs > target { old.min(new) } else { old.max(new) });
    }

    /// Learns from a picture that was given up after so long, without a sample for each of so many pixels.
    pub(crate) fn learn_at_most(&mut self, pixels: u64, secs: f64) {
        let Some(new) = rate(pixels, secs) else { return };
        self.rate = Some(self.rate.map_or(new, |old| old.min(new)));
    }

    /// By what to divide the sides of a picture of so many pixels that the host asked for so long ago.
    fn factor(self, pixels: u64, is_cpu: bool, ago: Duration) -> u32 {
        let [target, due, unknown] = if is_cpu {
            [TARGET_SECS_CPU, DUE_SECS_CPU, UNKNOWN_PACE_CPU]
        } else {
            [TARGET_SECS, DUE_SECS, UNKNOWN_PACE]
        };
        let left = (due - ago.as_secs_f64()).clamp(LEAST_SHARE * target, target);
        let most = self.rate.unwrap_or(unknown) * left;
        let fits = |factor: &u32| approximate(pixels) / f64::from(factor * factor) <= most;
        FACTORS.into_iter().find(fits).unwrap_or(FACTORS[FACTORS.len() - 1])
    }
}

fn rate(paths: u64, secs: f64) -> Option<f64> {
    (paths > 0 && secs > 0.0).then(|| approximate(paths) / secs)
}

#[expect(clippy::cast_precision_loss, reason = "counts of paths are compared with measured times")]
fn approximate(count: u64) -> f64 {
    count as f64
}

/// The first picture of a job.
#[derive(Debug)]
pub(crate) struct FirstPicture {
    factor: u32,
    layout: PictureLayout,
    pub(crate) job: RenderJob,
    pub(crate) film: Film,
}

/// What is kept from one to the next.
#[derive(Debug, Default)]
pub(crate) struct FirstPictures {
    pub(crate) pace: TracingPace,
    film: Option<Film>,
    /// Where its stats, messages and images go.
    pub(crate) apart: SharedState,
}

impl FirstPictures {
    /// Whether a coarser picture is shown before so many pixels of `job` have a sample.
    pub(crate) fn comes_first(&self, device: &Device, job: &RenderJob, pixels: u64) -> bool {
        let factor = self.pace.factor(pixels, is_cpu(device), job.asked_at.elapsed());
        #[cfg(feature = "faults")]
        let factor = job.options.faults.first_picture.unwrap_or(factor);
        factor > 1
    }

    /// The first picture of `job`; none where the host does not want to see images on the way, or where a sample of
    /// each pixel is as fast, or where there is no memory for it.
    pub(crate) fn begin(&mut self, device: &Device, job: &RenderJob) -> Option<FirstPicture> {
        let factor = self.pace.factor(job.request.pixels(), is_cpu(device), job.asked_at.elapsed());
        #[cfg(feature = "faults")]
        let factor = job.options.faults.first_picture.unwrap_or(factor);
        if !job.settings.interactive || factor <= 1 || job.request.aovs.is_empty() || job.catches_up {
            return None;
        }
        let layout = job.request.layout();
        let job = coarser(job, factor);
        let sums = FilmSums::of(&job, false);
        let film = self
            .film
            .take()
            .filter(|film| film.fits(&job.request, sums))
            .map_or_else(|| Film::new(&device.gpu, &job.request, sums), Ok::<_, GpuError>);
        let film = film.inspect_err(|error| tracing::debug!(%error, "no first picture")).ok()?;
        Some(FirstPicture { factor, layout, job, film })
    }

    /// Takes back what was made for a first picture, which took so long; shows it if it is `done`.
    pub(crate) fn end(
        &mut self,
        picture: FirstPicture,
        done: Option<f64>,
        published: &mut PublishedImages,
        is_cpu: bool,
    ) {
        let FirstPicture { factor, layout, job, film } = picture;
        self.film = Some(film);
        lock(&self.apart.messages).clear();
        let Some(secs) = done else { return };
        self.pace.learn_at_least(job.request.pixels(), secs, if is_cpu { TARGET_SECS_CPU } else { TARGET_SECS });
        fill_up(&lock(&self.apart.published), published, (&job, &layout), factor);
    }
}

/// The job of a first picture: one sample, of a part of the resolution, and nothing but the window.
fn coarser(job: &RenderJob, factor: u32) -> RenderJob {
    let request = &job.request;
    let part = request.part();
    let [width, height] = part.size().map(|side| side.div_ceil(factor));
    let camera = coarser_camera(&request.camera, (part, factor), [width, height]);
    let settings = Settings {
        samples_per_pixel: 1,
        adaptive_sampling: false,
        target_error: 0.0,
        time_limit_secs: 0.0,
        report: String::new(),
        reference: String::new(),
        chunk_report: String::new(),
        ..job.settings.clone()
    };
    let mut options = job.options;
    (options.progress_bar, options.closing_words) = (false, false);
    RenderJob {
        request: RenderRequest { width, height, camera, aovs: request.aovs.clone(), window: None },
        settings,
        options,
        ..job.clone()
    }
}

/// The same view in pixels `factor` times as wide, from the lower left corner of `part` on: the last ones may lie half
/// outside.
#[expect(clippy::cast_precision_loss, clippy::cast_possible_wrap, reason = "sides are at most 2^16 pixels")]
fn coarser_camera(camera: &Camera, (part, factor): (PixelWindow, u32), [width, height]: [u32; 2]) -> Camera {
    let [left, _, _, bottom] = camera.data_window;
    let (left, bottom) = (left.saturating_add_unsigned(part.x), bottom.saturating_sub_unsigned(part.y));
    let [x0, y0, x1, y1] = camera.display_window;
    let x = |x: f32| (x - left as f32) / factor as f32;
    let y = |y: f32| height as f32 - (bottom as f32 - y) / factor as f32;
    Camera {
        display_window: [x(x0), y(y0), x(x1), y(y1)],
        data_window: [0, 0, width as i32, height as i32],
        ..camera.clone()
    }
}

/// Shows images whose pixels are `factor` times as wide.
fn fill_up(
    from: &PublishedImages,
    into: &mut PublishedImages,
    (job, layout): (&RenderJob, &PictureLayout),
    factor: u32,
) {
    let kinds = job.request.kinds();
    if !kinds.iter().all(|kind| from.image(*kind).is_some())
        || !into.begin(job.generation, &kinds, layout, PictureExtent::WHOLE)
    {
        return;
    }
    let [width, factor, coarse] = [layout.size[0], factor, job.request.width].map(|side| side as usize);
    let [first, columns, below] = [layout.window.x, layout.window.width, layout.window.y].map(|side| side as usize);
    for kind in kinds {
        let (Some(image), bytes) = (from.image(kind), kind.pixel_bytes()) else { continue };
        let mut image = image.to_vec();
        match kind {
            AovKind::Motion => widen_motion(&mut image, (kind, 2), factor),
            AovKind::MotionBoth => widen_motion(&mut image, (kind, 4), factor),
            _ => {}
        }
        into.change(kind, |filled, layout| {
            let row_bytes = width * bytes;
            let rows = layout.window.height as usize * row_bytes;
            // Rows of the same pixels by the same thread: all but the first are copies of it.
            let blocks = filled[below * row_bytes..][..rows].par_chunks_mut(factor * row_bytes);
            blocks.zip(image.par_chunks_exact(coarse * bytes)).for_each(|(block, pixels)| {
                let window = first * bytes..(first + columns) * bytes;
                widen_row(&mut block[window.clone()], pixels, (factor, bytes));
                for row in 1..block.len() / row_bytes {
                    block.copy_within(window.clone(), row * row_bytes + window.start);
                }
            });
        });
    }
}

/// Makes each of `pixels` `factor` times as wide; they have 4 or 16 bytes, or a few.
fn widen_row(row: &mut [u8], pixels: &[u8], (factor, bytes): (usize, usize)) {
    match bytes {
        4 => widen_words::<4>(row, pixels, factor),
        16 => widen_words::<16>(row, pixels, factor),
        _ => {
            for (block, pixel) in row.chunks_mut(factor * bytes).zip(pixels.chunks_exact(bytes)) {
                block.chunks_exact_mut(bytes).for_each(|to| to.copy_from_slice(pixel));
            }
        }
    }
}

/// The same for a size that the compiler knows.
fn widen_words<const BYTES: usize>(row: &mut [u8], pixels: &[u8], factor: usize) {
    let (row, pixels) = (row.as_chunks_mut::<BYTES>().0, pixels.as_chunks::<BYTES>().0);
    row.chunks_mut(factor).zip(pixels).for_each(|(block, pixel)| block.fill(*pixel));
}

/// Motion over the image is in its pixels, the change of depth behind so many numbers is not.
#[expect(clippy::cast_precision_loss, reason = "a small number")]
fn widen_motion(image: &mut [u8], (kind, numbers): (AovKind, usize), factor: usize) {
    for pixel in image.chunks_exact_mut(kind.pixel_bytes()) {
        for number in pixel.chunks_exact_mut(4).take(numbers) {
            let wide: f32 = bytemuck::pod_read_unaligned::<f32>(number) * factor as f32;
            number.copy_from_slice(bytemuck::bytes_of(&wide));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_picture_is_as_fine_as_the_pace_allows() {
        let of = |rate: Option<f64>, pixels: u64| {
            [true, false].map(|is_cpu| TracingPace { rate }.factor(pixels, is_cpu, Duration::ZERO))
        };
        assert_eq!(of(None, 64 * 64), [1, 1], "a small picture needs none");
        assert_eq!(of(None, 1280 * 720), [8, 2], "nothing is known");
        assert_eq!(of(Some(1e6), 1280 * 720), [4, 8], "a million paths a second");
        assert_eq!(of(Some(1e9), 1280 * 720), [1, 1], "a fast device");
        assert_eq!(of(Some(1e3), 1280 * 720), [8, 8], "none is fast enough");
    }

    #[test]
    fn a_late_picture_is_coarser() {
        let of = |ago: u64| {
            let pace = TracingPace { rate: Some(6e7) };
            pace.factor(1280 * 720, false, Duration::from_millis(ago))
        };
        assert_eq!([0, 5, 9, 10, 18, 1000].map(of), [1, 1, 1, 2, 2, 2], "a sample of each pixel takes 15 ms");
    }

    #[test]
    fn a_short_first_picture_says_how_fast_the_device_is_at_least() {
        let mut pace = TracingPace::default();
        pace.learn_at_least(1000, 0.01, 0.02);
        assert_eq!(pace.rate(), Some(1e5), "all that is known");
        pace.learn(1 << 20, 1.0);
        pace.learn_at_least(1000, 0.01, 0.02);
        assert_eq!(pace.rate(), Some(f64::from(1 << 20)), "it was too short to tell");
        pace.learn_at_least(1000, 0.1, 0.02);
        assert_eq!(pace.rate(), Some(1e4), "the scene has become slow");
        pace.learn(0, 0.0);
        assert_eq!(pace.rate(), Some(1e4), "nothing was traced");
    }

    #[test]
    fn a_picture_that_is_given_up_says_how_fast_the_device_is_at_most() {
        let (mut pace, pixels) = (TracingPace { rate: Some(1e6) }, 57_600);
        assert_eq!(pace.factor(pixels, true, Duration::ZERO), 1, "a whole sample is thought to be as fast");
        pace.learn_at_most(pixels, 0.01);
        assert_eq!(pace.rate(), Some(1e6), "it was too short to tell");
        pace.learn_at_most(pixels, 0.1);
        assert_eq!(pace.rate(), Some(5.76e5), "it was not");
        assert_eq!(pace.factor(pixels, true, Duration::ZERO), 2, "so the next one has a first picture");
    }
}
