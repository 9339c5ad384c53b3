// SPDX-License-Identifier: Apache-2.0
//! Runs `shaders/check/bsdf.comp` on cases and brings its numbers back.

use super::cases::{CASE_FLOATS, Case};
use glam::DVec3;
use oocpt_abi::{Features, groups};
use oocpt_gpu::{Buffer, BufferUsage, Gpu, OpenOptions, Pipeline};
use oocpt_render::bsdf_tables;
use oocpt_shaders::checks;
use std::sync::Arc;
use std::time::Duration;

const RESULT_FLOATS: usize = 28;
/// Every lobe of today's materials.
pub(super) const ALL: Features = SHARP_GLASS.union(Features::ROUGH_TRANSMISSION);
/// The same without what only rough glass needs.
pub(super) const SHARP_GLASS: Features = PLAIN.union(Features::TRANSMISSION).union(Features::COAT);
/// What every material has.
pub(super) const PLAIN: Features = Features::MATERIALS;

/// What one case gave.
#[derive(Debug, Clone, Copy)]
pub(super) struct Answer {
    pub(super) ok: bool,
    pub(super) sampled: DVec3,
    pub(super) weight: DVec3,
    pub(super) pdf: f64,
    /// Evaluated at `sampled`.
    pub(super) value: DVec3,
    pub(super) value_pdf: f64,
    /// Evaluated at the case's `wi`.
    pub(super) diffuse: DVec3,
    pub(super) specular: DVec3,
    pub(super) given_pdf: f64,
    /// Of coat, specular, diffuse, multiple scattering, glass, its multiple scattering.
    pub(super) chance: [f64; 6],
    pub(super) chance_sheen: f64,
    /// What a smooth interface lets through, 1 - F; 0 for what is not glass.
    pub(super) lets_through: f64,
    /// Of glass, as the shader takes it; 0: sharp.
    pub(super) glass_alpha: f64,
    /// All floats, as they came.
    pub(super) raw: [f32; RESULT_FLOATS],
}

pub(super) struct Device {
    gpu: Arc<Gpu>,
    pipeline: Pipeline,
    tables: Buffer,
    /// None without its lobe: the pass must not ask.
    sheen: Option<Buffer>,
}

#[derive(Clone, Copy)]
enum Mode {
    Cases = 0,
    Sums = 1,
    Samples = 2,
    Grid = 3,
}

impl Device {
    pub(super) fn new(features: Features) -> Self {
        let selector = std::env::var("OOCPT_TEST_DEVICE").ok();
        let gpu = Gpu::open(&OpenOptions { selector, validation: true, ..OpenOptions::default() }).expect("a device");
        let module = &checks::CHECK_BSDF;
        let pipeline =
            Pipeline::new(&gpu, module.name, &module.specialised(&features.constants()), &features.constants(), 64)
                .expect("the pass compiles");
        let tables = upload(&gpu, &[bsdf_tables::bytes(), bsdf_tables::glass::bytes()].concat());
        let sheen = features.contains(Features::SHEEN).then(|| upload(&gpu, bsdf_tables::sheen::bytes()));
        Self { gpu, pipeline, tables, sheen }
    }

    fn run(&self, mode: Mode, input: &[f32], threads: usize, floats: usize, [points, seed]: [u32; 2]) -> Vec<f32> {
        let input = upload(&self.gpu, bytemuck::cast_slice(input));
        let bytes = 4 * (threads * floats) as u64;
        let results = Buffer::new(&self.gpu, "results", bytes, BufferUsage::Device).expect("small");
        let copy = Buffer::new(&self.gpu, "copy", bytes, BufferUsage::Readback).expect("small");
        let (tables, from) = (self.tables.address(), input.address());
        let sheen = self.sheen.as_ref().map_or(0, Buffer::address);
        let push = [tables, from, results.address(), threads as u64, mode as u64, points.into(), seed.into(), sheen];
        let mut commands = self.gpu.commands("bsdf").expect("a list");
        commands.dispatch(&self.pipeline, bytemuck::cast_slice(&push), groups(threads as u64));
        commands.copy(&results, 0, &copy, 0, bytes);
        let done = commands.submit().expect("submitted").wait(Duration::from_secs(300)).expect("alive");
        assert!(done, "the check did not end");
        copy.map(|bytes| bytemuck::pod_collect_to_vec(bytes)).expect("mapped")
    }

    pub(super) fn cases(&self, cases: &[Case]) -> Vec<Answer> {
        let input: Vec<f32> = cases.iter().flat_map(Case::floats).collect();
        let results = self.run(Mode::Cases, &input, cases.len(), RESULT_FLOATS, [0; 2]);
        results.as_chunks::<RESULT_FLOATS>().0.iter().map(Answer::new).collect()
    }

    /// Albedo of each case with the standard error of its mean, over `parts * points` samples, and the share of samples
    /// that gave a direction.
    pub(super) fn albedos(&self, cases: &[Case], parts: usize, points: u32) -> Vec<(DVec3, f64, f64)> {
        let input: Vec<f32> = cases.iter().flat_map(Case::floats).collect();
        let mut sums = vec![Vec::new(); cases.len()];
        for part in 0..parts {
            let seed = u32::try_from(part).expect("few") * points;
            let results = self.run(Mode::Sums, &input, cases.len(), 4, [points, seed]);
            for (sums, result) in sums.iter_mut().zip(results.as_chunks::<4>().0) {
                sums.push(result.map(|x| f64::from(x) / f64::from(points)));
            }
        }
        sums.iter().map(|sums| mean(sums)).collect()
    }

    /// Directions and densities of random samples of a case; density -1: none, 0: sharp.
    pub(super) fn samples(&self, case: &Case, count: usize, seed: u32) -> Vec<[f32; 4]> {
        let results = self.run(Mode::Samples, &case.floats(), count, 4, [0, seed]);
        results.as_chunks::<4>().0.to_vec()
    }

    /// Value and density of a case at directions.
    pub(super) fn grid(&self, case: &Case, directions: &[DVec3]) -> Vec<[f32; 4]> {
        let mut input: Vec<f32> = case.floats().to_vec();
        input.extend(directions.iter().flat_map(|d| d.as_vec3().to_array()));
        let results = self.run(Mode::Grid, &input, directions.len(), 4, [0; 2]);
        results.as_chunks::<4>().0.to_vec()
    }

    /// No message of the validation layer went unseen.
    pub(super) fn close(&self) {
        let messages = self.gpu.take_validation_messages();
        assert!(messages.is_empty(), "Vulkan validation: {messages:?}");
    }
}

fn upload(gpu: &Arc<Gpu>, bytes: &[u8]) -> Buffer {
    let buffer = Buffer::new(gpu, "input", bytes.len() as u64, BufferUsage::Upload).expect("small");
    buffer.write(0, bytes).expect("mapped");
    buffer
}

#[expect(clippy::cast_precision_loss, reason = "few parts")]
fn mean(sums: &[[f64; 4]]) -> (DVec3, f64, f64) {
    let count = sums.len() as f64;
    let total = sums.iter().fold([0.0; 4], |a, b| std::array::from_fn(|i| a[i] + b[i] / count));
    let spread =
        |i: usize| sums.iter().map(|s| (s[i] - total[i]).powi(2)).sum::<f64>() / (count * (count - 1.0).max(1.0));
    let error = spread(0).max(spread(1)).max(spread(2)).sqrt();
    (DVec3::new(total[0], total[1], total[2]), error, total[3])
}

impl Answer {
    fn new(raw: &[f32; RESULT_FLOATS]) -> Self {
        let at = |i: usize| f64::from(raw[i]);
        let at3 = |i: usize| DVec3::new(at(i), at(i + 1), at(i + 2));
        Self {
            ok: raw[0] > 0.5,
            sampled: at3(1),
            weight: at3(4),
            pdf: at(7),
            value: at3(8),
            value_pdf: at(11),
            diffuse: at3(12),
            specular: at3(15),
            given_pdf: at(18),
            chance: [at(19), at(20), at(21), at(22), at(23), at(24)],
            chance_sheen: at(27),
            lets_through: at(25),
            glass_alpha: at(26),
            raw: *raw,
        }
    }
}

const _: () = assert!(CASE_FLOATS == 64, "as the shader reads them");
