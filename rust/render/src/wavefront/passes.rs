// SPDX-License-Identifier: Apache-2.0
//! The pipelines of a frame: those rows of `oocpt_shaders::PASSES` whose conditions hold, compiled for one
//! specialisation. Render thread only.

use super::TraversalBackend;
use crate::device::{Device, PassSpecialisation};
use crate::error::RenderError;
use crate::film::Film;
use crate::film::filtered::FilteredPlanes;
use crate::job::timings::RenderTimings;
use oocpt_gpu::Pipeline;
use oocpt_shaders::{PASSES, Pass, PassImage, PassInfo};
use std::sync::Arc;
use std::time::Instant;

/// The pipelines of one frame.
#[derive(Debug)]
pub(crate) struct WavefrontPasses {
    /// Pipelines by pass; `None` if a condition does not hold.
    pipelines: [Option<Arc<Pipeline>>; PASSES.len()],
}

/// The passes that a frame needs. The longest come first: `shade_surface` takes as long as all others together.
pub(super) fn wanted(
    (special, backend): (PassSpecialisation, TraversalBackend),
    film: &Film,
) -> Vec<&'static PassInfo> {
    let wants = |image| match image {
        PassImage::PixelCentres => film.has_planes(),
        PassImage::Filtered => film.filtered().is_some_and(FilteredPlanes::has_means),
        PassImage::RankedIds => film.filtered().is_some_and(FilteredPlanes::has_ids),
        PassImage::Deep => film.filtered().is_some_and(FilteredPlanes::has_deep),
        PassImage::FirstHits => film.has_planes() || film.filters_first_hits(),
        PassImage::Spread => film.has_spread(),
        PassImage::SampleCount => film.has_counts(),
        PassImage::ExactSums => film.has_exact_sums(),
    };
    let needed = |row: &&PassInfo| row.when.holds(special.features, wants) && backend.has(row.pass);
    let mut wanted: Vec<&PassInfo> = PASSES.iter().filter(needed).collect();
    wanted.sort_by_key(|row| std::cmp::Reverse(row.module.words.len()));
    wanted
}

impl WavefrontPasses {
    /// Compiles the pipelines that are missing on all threads, and warms each up as soon as it is there
    /// ([`Device::warm_up`]).
    pub(crate) fn new(
        device: &Device,
        (special, backend): (PassSpecialisation, TraversalBackend),
        film: &Film,
        timings: &mut RenderTimings,
    ) -> Result<Self, RenderError> {
        let started = Instant::now();
        let wanted = wanted((special, backend), film);
        let (send, made) = std::sync::mpsc::channel();
        let pipelines = rayon::in_place_scope(|scope| {
            for row in wanted {
                let send = send.clone();
                // Nobody receives any more once one has failed.
                scope.spawn(move |_| drop(send.send((row.pass, device.pipeline(row.module, special)))));
            }
            drop(send);
            let mut pipelines: [Option<Arc<Pipeline>>; PASSES.len()] = [const { None }; PASSES.len()];
            for (pass, pipeline) in made {
                let pipeline = pipelines[pass as usize].insert(pipeline?);
                // Other threads go on compiling meanwhile.
                timings.warmed_up_pipelines += device.warm_up(pipeline)?;
            }
            Ok::<_, RenderError>(pipelines)
        })?;
        device.keep_pipelines(false);
        timings.compile_secs += started.elapsed().as_secs_f64();
        Ok(Self { pipelines })
    }

    /// The pipeline of `pass`; `None` if the frame does not need it.
    pub(crate) fn get(&self, pass: Pass) -> Option<&Arc<Pipeline>> {
        self.pipelines[pass as usize].as_ref()
    }

    /// The pipelines of the frame.
    pub(crate) fn all(&self) -> impl Iterator<Item = &Arc<Pipeline>> {
        self.pipelines.iter().flatten()
    }
}
