// SPDX-License-Identifier: Apache-2.0
//! In core, tiles of textures come when a wave has asked for them: reads what a wave lacked, and brings it. Then the
//! film takes the wave as if all tiles had been there. Render thread only.

use super::WavefrontTracer;
use crate::assets::{DeviceScene, TilesOutcome};
use crate::error::RenderError;
use crate::feedback::{FeedbackBuffers, FeedbackCopy};
use crate::frame::progress::FrameProgress;
use crate::job::shared::FrameGate;

/// The textures of a frame in core.
#[derive(Debug)]
pub(crate) struct FrameTiles<'a> {
    pub(crate) scene: &'a mut DeviceScene,
    /// Most bytes of geometry and tiles.
    pub(crate) cap: Option<u64>,
    /// Where the waves say what they lack.
    pub(crate) feedback: Option<&'a FeedbackBuffers>,
}

impl FrameTiles<'_> {
    /// What the wave that ended with this copy lacked.
    pub(super) fn lacking(&self, lacking: Option<FeedbackCopy>) -> Result<Option<Vec<u32>>, RenderError> {
        match (self.feedback, lacking) {
            (Some(feedback), Some(copy)) => Ok(feedback.read(copy)?),
            _ => Ok(None),
        }
    }

    /// Brings `tiles`, and records that nothing is lacking. False: the gate said no.
    pub(super) fn bring(
        &mut self,
        tracer: &WavefrontTracer<'_>,
        tiles: &[u32],
        gate: &FrameGate<'_>,
        progress: &mut FrameProgress<'_>,
    ) -> Result<bool, RenderError> {
        tracing::debug!(tiles = tiles.len(), "tiles are wanted");
        let shown = match self.scene.bring_tiles(tracer.context.device, tiles, self.cap, gate, &mut progress.timings)? {
            TilesOutcome::NoRoom => return Err(RenderError::TexturesOutgrow),
            TilesOutcome::GivenUp => return Ok(false),
            TilesOutcome::All(shown) => shown,
        };
        let mut commands = tracer.commands("tiles")?;
        let held = self.scene.tile_bytes_held();
        let (loads, paged) = (progress.timings.tiles, progress.timings.tile_bytes);
        let mapped = tracer.context.device.host_heap_if_made().map_or(0, |heap| heap.stats().live_bytes);
        progress.streaming(|stats| {
            stats.mapped_bytes = mapped;
            (stats.loads, stats.bytes_paged) = (loads, paged);
            (stats.texture_loads, stats.texture_bytes_paged, stats.texture_bytes) = (loads, paged, held);
        });
        self.scene.write_entries(&mut commands, &shown);
        if let Some(feedback) = self.feedback {
            feedback.reset(&mut commands);
        }
        commands.submit()?;
        Ok(true)
    }
}
