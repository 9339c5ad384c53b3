// SPDX-License-Identifier: Apache-2.0
//! Roulette on loads changes no mean: over many seeds the picture is the one in core, region by region, when nearly
//! every load is played for, and when production's prices decide. The same seed renders both, so the noise that they
//! share cancels and what is left is the roulette's own.
//!
//! Which rays wait for a load depends on how fast loads and rounds are, so no two runs play the same; the mean over the
//! draws is the same in all of them. Differences are therefore judged by their own spread: one look at a number of
//! seeds that is fixed before, by Student's distribution, with one bound on all comparisons of this file together.

use super::scenes::{SCENES, Scene};
use super::{TestFiles, options, percent, planting, request_of, small_chunks, smallest_budget};
use crate::support::{is_full, read, render, seeds};
use oocpt_core::settings::{SettingValue, Settings};
use oocpt_core::stats::StreamingStats;
use oocpt_render::{AovKind, AovRequest, PlantedFaults, RenderRequest, Session, SessionOptions};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

/// Seeds, and with all tests. The draws of consecutive seeds are stratified, by sixteen: a mean over them is closer to
/// the truth than its standard error says, never further.
const SEEDS: [u32; 2] = [32, 64];
/// Those with [`adaptive`] sampling, which takes twice as long.
const ADAPTIVE_SEEDS: [u32; 2] = [16, 64];
/// Seeds that show a bias where nearly every load is played for: with 16 it is twenty standard errors.
const PLANTED: u32 = 16;
/// The number of times that the roulette is to be played for each of the [`SEEDS`] ([`plays`]).
const PLAYS: u32 = 16;
/// The most times as many seeds that may be rendered for that.
const MAX_BATCHES: u32 = 4;
/// Seeds that only measure how often a machine plays.
const PILOTS: Range<u32> = 1 << 20..(1 << 20) + 4;
/// Probability of every load that is played for. At a half a load adds as much as often as it takes away, so that
/// Student's distribution holds far out with few seeds: with less, means that lie low come with spreads that are too
/// small.
const PER_MILLE: u16 = 500;
/// So many standard deviations of a normal distribution are as unlikely as a 63rd of 1e-4, to both sides: there are
/// nine comparisons of seven regions where nothing is planted, so all of them together fail by chance once in 10 000
/// times (Bonferroni).
const FAMILY: f64 = 4.8;
/// Regions from left to right and from top to bottom.
const REGIONS: [usize; 2] = [3, 2];

/// Colour of the regions and of the whole picture, in which a bias of all regions shows with the fewest seeds; alpha
/// and the number of samples, pixel by pixel.
type Regions = (Vec<f64>, [Vec<f32>; 2]);

/// Nearly every load is played for.
fn played() -> PlantedFaults {
    PlantedFaults { roulette_per_mille: Some(PER_MILLE), ..PlantedFaults::default() }
}

/// The fault that plays without weights.
fn unweighted() -> PlantedFaults {
    PlantedFaults { unweighted_roulette: true, ..played() }
}

/// A session whose seed may be changed, and the totals of what its renders counted.
struct Renderer {
    session: Session,
    view: RenderRequest,
    totals: StreamingStats,
    /// The decision of production, in which only the price of a byte is that of a slow disk: probabilities of all
    /// sizes, accounts that run out, few stragglers.
    known: HashMap<u32, Regions>,
}

impl Renderer {
    fn new(scene: &Scene, settings: Settings, options: SessionOptions) -> Self {
        let session = Session::with_options(settings, options);
        session.set_light_files(Arc::new(TestFiles));
        session.with_scene(scene.build);
        let mut view = request_of(scene);
        view.aovs = [AovKind::Color, AovKind::SampleCount].map(|kind| AovRequest { kind, clear: [0.0; 4] }).to_vec();
        Self { session, view, totals: StreamingStats::default(), known: HashMap::new() }
    }

    /// Mean of the colour, region by region; alpha and counts must not change.
    fn regions(&mut self, seed: u32) -> Regions {
        if let Some(known) = self.known.get(&seed) {
            return known.clone();
        }
        self.session.set_setting("oocpt:seed", SettingValue::Int(seed.into())).expect("a seed");
        render(&self.session, &self.view);
        let stats = self.session.stats().streaming;
        self.totals.roulette_paths += stats.roulette_paths;
        self.totals.roulette_shadow_rays += stats.roulette_shadow_rays;
        self.totals.roulette_loads_saved += stats.roulette_loads_saved;
        self.totals.loads += stats.loads;
        let (width, height) = (self.view.width as usize, self.view.height as usize);
        let pixels = read::<[f32; 4]>(&self.session, &self.view, AovKind::Color);
        let mut sums = vec![0.0; REGIONS[0] * REGIONS[1]];
        for (index, pixel) in pixels.iter().enumerate() {
            let (x, y) = (index % width * REGIONS[0] / width, index / width * REGIONS[1] / height);
            let value: f32 = pixel[..3].iter().sum();
            sums[y * REGIONS[0] + x] += f64::from(value) / 3.0;
        }
        sums.push(sums.iter().sum());
        let counts = read::<f32>(&self.session, &self.view, AovKind::SampleCount);
        let regions = (sums, [pixels.iter().map(|pixel| pixel[3]).collect(), counts]);
        if stats.in_core {
            self.known.insert(seed, regions.clone());
        }
        regions
    }
}

/// The results of the seeds.
struct Shown {
    seeds: u32,
    /// Means and their standard errors of `with - without`, region by region.
    differences: Vec<(f64, f64)>,
}

/// The number of seeds that play often enough on this machine, from the plays of other seeds: if the compared seeds
/// decided it, they would end where more rays than on average have ended, and be too dark in the mean.
fn enough(with: &mut Renderer, least: u32) -> u32 {
    for seed in PILOTS {
        let _ = with.regions(seed);
    }
    let played = plays(&with.totals).max(1);
    let wanted = (u64::from(PLAYS * least) * PILOTS.len() as u64).div_ceil(played);
    with.totals = StreamingStats::default();
    u32::try_from(wanted).unwrap_or(u32::MAX).clamp(least, MAX_BATCHES * least).next_multiple_of(16)
}

/// Renders so many seeds.
fn show(without: &mut Renderer, with: &mut Renderer, end: u32) -> Shown {
    let mut sums = vec![(0.0, 0.0); REGIONS[0] * REGIONS[1] + 1];
    for seed in 0..end {
        let (expected, [alpha, counts]) = without.regions(seed);
        let (got, [same_alpha, same_counts]) = with.regions(seed);
        assert!(counts == same_counts, "what is played with decides nothing");
        assert!(alpha == same_alpha, "camera rays are not played with");
        for ((sum, e), g) in sums.iter_mut().zip(expected).zip(got) {
            let d = g - e;
            *sum = (sum.0 + d, sum.1 + d * d);
        }
    }
    let n = f64::from(end);
    let of = |(sum, squares): (f64, f64)| (sum / n, ((squares / n - (sum / n).powi(2)).max(0.0) / (n - 1.0)).sqrt());
    Shown { seeds: end, differences: sums.into_iter().map(of).collect() }
}

/// As unlikely for a mean of so many seeds, by Student's distribution, as [`FAMILY`] standard deviations for one of
/// very many (Abramowitz and Stegun 26.7.5).
fn limit(seeds: u32) -> f64 {
    let (z, nu) = (FAMILY, f64::from(seeds - 1));
    let terms = [z, (z.powi(3) + z) / 4.0, (5.0 * z.powi(5) + 16.0 * z.powi(3) + 3.0 * z) / 96.0];
    let third = (3.0 * z.powi(7) + 19.0 * z.powi(5) + 17.0 * z.powi(3) - 15.0 * z) / 384.0;
    terms[0] + terms[1] / nu + terms[2] / nu.powi(2) + third / nu.powi(3)
}

/// The number of plays: rays of both kinds that ended, loads that this saved.
fn plays(totals: &StreamingStats) -> u64 {
    totals.roulette_paths.min(totals.roulette_shadow_rays).min(2 * totals.roulette_loads_saved)
}

/// Returns true if enough rays ended, over all seeds, for the test to be meaningful: half as many as the pilot seeds
/// predicted.
fn was_played(totals: &StreamingStats, seeds: u32) -> bool {
    plays(totals) >= u64::from(PLAYS * seeds / 2)
}

impl Shown {
    /// Regions further from no difference than [`limit`].
    fn outside(&self) -> Vec<usize> {
        let limit = limit(self.seeds);
        let is_outside = |&(_, &(mean, sigma)): &(usize, &(f64, f64))| mean.abs() > limit * sigma;
        self.differences.iter().enumerate().filter(is_outside).map(|(region, _)| region).collect()
    }
}

/// The regions that differ, at `budget_percent`, with roulette under `faults`.
fn differing(
    scene: &Scene,
    without: &mut Renderer,
    budget_percent: u64,
    (faults, least): (PlantedFaults, u32),
) -> (Vec<usize>, StreamingStats, String) {
    let _ = without.regions(0);
    let bytes = without.session.stats().streaming.scene_bytes;
    let budget = percent(bytes, budget_percent).max(smallest_budget(scene));
    let settings = Settings { geometry_budget_kib: budget, straggler_roulette: true, ..without.session.settings() };
    let mut with = Renderer::new(scene, settings, SessionOptions { force_streaming: true, ..planting(faults) });
    let count = enough(&mut with, least);
    let shown = show(without, &mut with, count);
    let said = format!(
        "{}, {budget_percent} % ({budget} of {} KiB), {count} seeds, at most {:.2} standard errors: {:.3?}",
        scene.name,
        bytes >> 10,
        limit(count),
        shown.differences
    );
    (shown.outside(), with.totals, said)
}

#[expect(clippy::print_stdout, reason = "what was measured stands in the log")]
fn has_no_bias(scene: &Scene, budgets: &[u64]) {
    let mut without = Renderer::new(scene, small_chunks(), options());
    for &budget_percent in budgets {
        let (regions, totals, said) = differing(scene, &mut without, budget_percent, (played(), seeds(SEEDS)));
        println!("{said}; {totals:?}");
        assert!(was_played(&totals, seeds(SEEDS)), "{said}: roulette was played: {totals:?}");
        assert!(regions.is_empty(), "regions {regions:?} have another mean: {said}");
    }
}

#[test]
fn roulette_is_unbiased_in_every_region() {
    has_no_bias(&SCENES[0], if is_full() { &[25, 10, 5] } else { &[5] });
}

#[test]
fn roulette_is_unbiased_with_materials_and_lights() {
    has_no_bias(&SCENES[6], if is_full() { &[25, 10, 5] } else { &[10] });
}

#[test]
fn unweighted_survivors_are_noticed() {
    let mut without = Renderer::new(&SCENES[0], small_chunks(), options());
    let (regions, totals, said) = differing(&SCENES[0], &mut without, 10, (unweighted(), PLANTED));
    println!("{said}; {totals:?}");
    assert!(!regions.is_empty(), "a picture that is too dark must be seen: {said}");
}

/// Two epochs of adaptive sampling.
fn adaptive() -> Settings {
    Settings { adaptive_sampling: true, samples_per_pixel: 32, ..small_chunks() }
}

/// Both streams of a pixel see the same verdicts, so a verdict on samples that decide would make counts depend on the
/// samples that they count. It is played in the last epoch alone: the counts are those without it, pixel by pixel, and
/// so is the mean.
#[test]
fn roulette_is_unbiased_with_adaptive_sampling() {
    let scene = &SCENES[0];
    let mut without = Renderer::new(scene, adaptive(), options());
    let (regions, totals, said) = differing(scene, &mut without, 10, (played(), seeds(ADAPTIVE_SEEDS)));
    println!("{said}; {totals:?}");
    assert!(was_played(&totals, seeds(ADAPTIVE_SEEDS)), "{said}: roulette was played: {totals:?}");
    assert!(regions.is_empty(), "regions {regions:?} have another mean: {said}");
}

/// With all tests; [`unweighted_survivors_are_noticed`] is always run.
#[test]
fn unweighted_survivors_are_noticed_with_adaptive_sampling() {
    if !is_full() {
        eprintln!("skipped: only with all tests (OOCPT_TEST_FULL)");
        return;
    }
    let mut without = Renderer::new(&SCENES[0], adaptive(), options());
    let (regions, totals, said) = differing(&SCENES[0], &mut without, 10, (unweighted(), PLANTED));
    println!("{said}; {totals:?}");
    assert!(!regions.is_empty(), "a picture that is too dark must be seen: {said}");
}

#[test]
fn roulette_on_steering_samples_is_noticed() {
    let scene = &SCENES[0];
    let mut without = Renderer::new(scene, adaptive(), options());
    let _ = without.regions(0);
    let bytes = without.session.stats().streaming.scene_bytes;
    let geometry_budget_kib = percent(bytes, 10).max(smallest_budget(scene));
    let settings = Settings { geometry_budget_kib, straggler_roulette: true, ..adaptive() };
    let mut changed = |early_roulette: bool| {
        let played = planting(PlantedFaults { early_roulette, ..played() });
        let mut with = Renderer::new(scene, settings.clone(), played);
        (1..=seeds([2, 8])).filter(|&seed| without.regions(seed).1[1] != with.regions(seed).1[1]).count()
    };
    let (right, planted) = (changed(false), changed(true));
    assert_eq!(right, 0, "counts are decided before");
    assert!(planted > 0, "counts that verdicts decide must be seen");
}

/// With measured costs: so small a scene has few or no loads that are not worth it; the test is that nothing hangs.
#[test]
fn with_measured_prices_all_paths_finish() {
    for scene in &SCENES {
        let budget = smallest_budget(scene);
        let settings = Settings { geometry_budget_kib: budget, straggler_roulette: true, ..small_chunks() };
        let mut with = Renderer::new(scene, settings, SessionOptions { force_streaming: true, ..options() });
        let (regions, _) = with.regions(1);
        let stats = with.session.stats().streaming;
        assert!(regions.iter().all(|v| v.is_finite()) && stats.paths_left == 0, "{}: {stats:?}", scene.name);
    }
}

/// By the decision of production, in which only the price of a byte is that of a slow disk: probabilities of all sizes,
/// accounts that run out, few stragglers.
fn of_production() -> PlantedFaults {
    PlantedFaults { roulette_ns_per_byte: Some(1000), ..PlantedFaults::default() }
}

#[test]
fn roulette_is_unbiased_at_production_prices() {
    let scenes = [&SCENES[0], &SCENES[6]];
    for scene in &scenes[..if is_full() { 2 } else { 1 }] {
        let mut without = Renderer::new(scene, small_chunks(), options());
        let (regions, totals, said) = differing(scene, &mut without, 10, (of_production(), seeds(SEEDS)));
        println!("{said}; {totals:?}");
        assert!(
            totals.roulette_paths > 100 && totals.roulette_shadow_rays > 100 && totals.roulette_loads_saved > 100,
            "{said}: roulette was played: {totals:?}"
        );
        assert!(regions.is_empty(), "regions {regions:?} have another mean: {said}");
    }
}

#[test]
fn unweighted_survivors_are_noticed_at_production_prices() {
    let mut without = Renderer::new(&SCENES[0], small_chunks(), options());
    let faults = PlantedFaults { unweighted_roulette: true, ..of_production() };
    let (regions, _, said) = differing(&SCENES[0], &mut without, 10, (faults, seeds(SEEDS)));
    println!("{said}");
    assert!(!regions.is_empty(), "a picture that is too dark must be seen: {said}");
}

#[test]
fn significance_limits_match_students_t() {
    // Two-sided quantiles at 1.59e-6, by numerical integration of the density. With 16 seeds the limit is 7.57 where
    // the quantile is 7.61: by half a percent too strict.
    for (seeds, expected) in [(16, 7.57), (32, 5.91), (64, 5.30), (1024, 4.83)] {
        assert!((limit(seeds) - expected).abs() < 0.03, "{seeds}: {}", limit(seeds));
    }
}
