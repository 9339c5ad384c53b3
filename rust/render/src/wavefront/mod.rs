// SPDX-License-Identifier: Apache-2.0
//! The wavefront: the passes of one wave, the memory they work in, and the order they run in.
//!
//! A pass has one name: its shader is `shaders/wavefront/NAME.comp`, its field in [`Passes`] is `NAME`, and it shows
//! under `NAME` in timings, debuggers and errors. Render thread only.

mod paths;
mod record;

pub(crate) use paths::{CONE_BYTES, PathBuffers, PathNeeds};
pub(crate) use record::Recorder;

use crate::device::{Device, Specialisation};
use crate::error::RenderError;
use crate::film::Film;
use crate::timings::Timings;
use oocpt_gpu::Pipeline;
use oocpt_shader_abi::{Features, passes};
use rayon::prelude::*;
use std::sync::Arc;
use std::time::Instant;

/// The passes, compiled for one specialisation.
#[derive(Debug)]
pub(crate) struct Passes {
    pub(crate) generate_camera_rays: Arc<Pipeline>,
    pub(crate) prepare_dispatch: Arc<Pipeline>,
    pub(crate) intersect_closest: Arc<Pipeline>,
    pub(crate) shade_background: Arc<Pipeline>,
    pub(crate) shade_surface: Arc<Pipeline>,
    pub(crate) intersect_shadow: Arc<Pipeline>,
    pub(crate) accumulate: Arc<Pipeline>,
    pub(crate) resolve: Arc<Pipeline>,
    pub(crate) measure_error: Arc<Pipeline>,
    /// Only when an image is traced through pixel centres.
    pub(crate) aovs: Option<AovPasses>,
    /// Only when the number of samples is wanted as an image.
    pub(crate) count_samples: Option<Arc<Pipeline>>,
    /// Only when chunks may be absent.
    pub(crate) stream: Option<StreamPasses>,
}

/// The passes that only streaming needs.
#[derive(Debug)]
pub(crate) struct StreamPasses {
    pub(crate) record_surfaces: Arc<Pipeline>,
    /// Only when something reads a texture.
    pub(crate) resolve_materials: Option<Arc<Pipeline>>,
    /// Only with cutouts that read a texture.
    pub(crate) resolve_cutouts: Option<Arc<Pipeline>>,
    pub(crate) sort_deferred_count: Arc<Pipeline>,
    pub(crate) sort_deferred_scan: Arc<Pipeline>,
    pub(crate) sort_deferred_scatter: Arc<Pipeline>,
    pub(crate) count_demand: Arc<Pipeline>,
    /// Only with roulette on loads.
    pub(crate) roulette: Option<RoulettePasses>,
}

/// The passes that only roulette on loads needs.
#[derive(Debug)]
pub(crate) struct RoulettePasses {
    pub(crate) roulette_level: Arc<Pipeline>,
    pub(crate) roulette_worth: Arc<Pipeline>,
    pub(crate) roulette_play: Arc<Pipeline>,
}

/// The passes that only images through pixel centres need.
#[derive(Debug)]
pub(crate) struct AovPasses {
    pub(crate) generate_aov_rays: Arc<Pipeline>,
    pub(crate) shade_aovs: Arc<Pipeline>,
}

impl Passes {
    /// The pipelines that there are.
    pub(crate) fn pipelines(&self) -> Vec<&Arc<Pipeline>> {
        let mut all = vec![
            &self.generate_camera_rays,
            &self.prepare_dispatch,
            &self.intersect_closest,
            &self.shade_background,
            &self.shade_surface,
            &self.intersect_shadow,
            &self.accumulate,
            &self.resolve,
            &self.measure_error,
        ];
        all.extend(self.aovs.iter().flat_map(|aovs| [&aovs.generate_aov_rays, &aovs.shade_aovs]));
        all.extend(&self.count_samples);
        if let Some(stream) = &self.stream {
            let StreamPasses { record_surfaces, resolve_materials, resolve_cutouts, .. } = stream;
            all.push(record_surfaces);
            all.extend(resolve_materials.iter().chain(resolve_cutouts));
            all.extend([&stream.sort_deferred_count, &stream.sort_deferred_scan, &stream.sort_deferred_scatter]);
            all.push(&stream.count_demand);
            let played = stream.roulette.iter();
            all.extend(played.flat_map(|r| [&r.roulette_level, &r.roulette_worth, &r.roulette_play]));
        }
        all
    }

    /// Compiles what is not compiled yet and has it translated (see [`Device::translate`]).
    pub(crate) fn new(
        device: &Device,
        special: Specialisation,
        film: &Film,
        timings: &mut Timings,
    ) -> Result<Self, RenderError> {
        let started = Instant::now();
        let passes = Self::compiled(device, special, film)?;
        timings.translated += device.translate(&passes.pipelines())?;
        timings.compile_secs += started.elapsed().as_secs_f64();
        Ok(passes)
    }

    /// Compiles on all threads.
    fn compiled(device: &Device, special: Specialisation, film: &Film) -> Result<Self, RenderError> {
        let aovs = || -> Result<_, RenderError> {
            Ok(AovPasses {
                generate_aov_rays: device.pipeline(&passes::GENERATE_AOV_RAYS, special)?,
                shade_aovs: device.pipeline(&passes::SHADE_AOVS, special)?,
            })
        };
        let textures = special.features.contains(Features::TEXTURES);
        let cutouts = textures && special.features.contains(Features::CUTOUTS);
        let plays = special.features.contains(Features::ROULETTE);
        let roulette = || -> Result<_, RenderError> {
            Ok(RoulettePasses {
                roulette_level: device.pipeline(&passes::ROULETTE_LEVEL, special)?,
                roulette_worth: device.pipeline(&passes::ROULETTE_WORTH, special)?,
                roulette_play: device.pipeline(&passes::ROULETTE_PLAY, special)?,
            })
        };
        let stream = || -> Result<_, RenderError> {
            let asks = special.features.contains(Features::MESH_LIGHT_VALUES);
            let pass = if asks { &passes::RESOLVE_LIGHTS } else { &passes::RESOLVE_MATERIALS };
            let resolve = || device.pipeline(pass, special);
            let answer = || device.pipeline(&passes::RESOLVE_CUTOUTS, special);
            Ok(StreamPasses {
                resolve_materials: textures.then(resolve).transpose()?,
                resolve_cutouts: cutouts.then(answer).transpose()?,
                record_surfaces: device.pipeline(&passes::RECORD_SURFACES, special)?,
                sort_deferred_count: device.pipeline(&passes::SORT_DEFERRED_COUNT, special)?,
                sort_deferred_scan: device.pipeline(&passes::SORT_DEFERRED_SCAN, special)?,
                sort_deferred_scatter: device.pipeline(&passes::SORT_DEFERRED_SCATTER, special)?,
                count_demand: device.pipeline(&passes::COUNT_DEMAND, special)?,
                roulette: plays.then(roulette).transpose()?,
            })
        };
        let streams = special.features.contains(Features::STREAMING);
        compile_side_by_side(device, special, film)?;
        Ok(Self {
            generate_camera_rays: device.pipeline(&passes::GENERATE_CAMERA_RAYS, special)?,
            prepare_dispatch: device.pipeline(&passes::PREPARE_DISPATCH, special)?,
            intersect_closest: device.pipeline(&passes::INTERSECT_CLOSEST, special)?,
            shade_background: device.pipeline(&passes::SHADE_BACKGROUND, special)?,
            shade_surface: device.pipeline(&passes::SHADE_SURFACE, special)?,
            intersect_shadow: device.pipeline(&passes::INTERSECT_SHADOW, special)?,
            accumulate: device.pipeline(&passes::ACCUMULATE, special)?,
            resolve: device.pipeline(&passes::RESOLVE, special)?,
            measure_error: device.pipeline(&passes::MEASURE_ERROR, special)?,
            aovs: film.has_planes().then(aovs).transpose()?,
            count_samples: film.has_counts().then(|| device.pipeline(&passes::COUNT_SAMPLES, special)).transpose()?,
            stream: streams.then(stream).transpose()?,
        })
    }
}

/// Compiles what every render needs, on all threads, the longest first.
fn compile_side_by_side(device: &Device, special: Specialisation, film: &Film) -> Result<(), RenderError> {
    let mut wanted = vec![
        // Takes as long as all others together.
        &passes::SHADE_SURFACE,
        &passes::INTERSECT_CLOSEST,
        &passes::INTERSECT_SHADOW,
        &passes::SHADE_BACKGROUND,
        &passes::GENERATE_CAMERA_RAYS,
        &passes::MEASURE_ERROR,
        &passes::ACCUMULATE,
        &passes::PREPARE_DISPATCH,
        &passes::RESOLVE,
    ];
    if film.has_planes() {
        wanted.extend([&passes::SHADE_AOVS, &passes::GENERATE_AOV_RAYS]);
    }
    wanted.par_iter().with_max_len(1).try_for_each(|module| device.pipeline(module, special).map(|_pipeline| ()))?;
    Ok(())
}
