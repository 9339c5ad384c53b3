// SPDX-License-Identifier: Apache-2.0
//! Lists what a render is made of, for the stats, from its pipelines and buffers. Render thread only.

use crate::device::bsdf_tables;
use crate::device::{Device, PassSpecialisation};
use crate::frame::context::FrameContext;
use crate::frame::specialise;
use crate::wavefront::{TraversalBackend, WavefrontPasses};
use oocpt_abi::Features;
use oocpt_core::inventory::{PassUse, RenderInventory};
use oocpt_shaders::ALL;

/// The pipelines of a frame and their features.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompiledPasses<'a> {
    pub(crate) passes: &'a WavefrontPasses,
    pub(crate) special: PassSpecialisation,
    /// The features that the scene does not need, compiled in by [`crate::ForcedFeatures`].
    pub(crate) carried: Features,
    pub(crate) backend: TraversalBackend,
}

/// The inventory of a frame; the scene and the paths have `listed` their buffers.
pub(crate) fn of_frame(
    context: &FrameContext<'_>,
    compiled: CompiledPasses<'_>,
    listed: RenderInventory,
) -> RenderInventory {
    let FrameContext { device, job, film, tables, .. } = *context;
    let CompiledPasses { special, carried, .. } = compiled;
    let features = special.features;
    let mut inventory = RenderInventory {
        features: specialise::list(features, carried),
        passes: passes(device, compiled.passes),
        max_levels: special.max_levels,
        stack_size: special.stack_size,
        traversal: compiled.backend.list(),
        ..listed
    };
    film.list(&mut inventory);
    tables.list(&mut inventory);
    match features.contains(Features::MATERIALS) {
        true => inventory.add("BSDF tables", device.bsdf_bytes()),
        false => inventory.leave_out("BSDF tables", bsdf_tables::bytes().len() as u64),
    }
    inventory.set_primvars(job.primvars.to_vec());
    inventory
}

/// Every pass of the renderer, with a mark on those that have a pipeline here.
fn passes(device: &Device, passes: &WavefrontPasses) -> Vec<PassUse> {
    let made: Vec<_> = passes.all().collect();
    let entry = |name: &str| {
        let pipeline = made.iter().find(|pipeline| pipeline.name() == name);
        PassUse {
            name: name.to_owned(),
            made: pipeline.is_some(),
            compile_secs: pipeline.map_or(0.0, |p| device.compile_secs(p)),
        }
    };
    // Shaders whose names begin with `light_` are programs of tests.
    let of_tests = |name: &str| name.starts_with("light_");
    ALL.iter().filter(|module| !of_tests(module.name)).map(|module| entry(module.name)).collect()
}
