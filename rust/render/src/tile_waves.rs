// SPDX-License-Identifier: Apache-2.0
//! In core, tiles of textures come when a wave has asked for them: brings what a wave lacked, and traces those of its
//! paths again that
//! lacked it, until none does. Then the film takes the wave, as if all tiles had been there. Render thread only.

use crate::assets::{Brought, Scene};
use crate::error::RenderError;
use crate::feedback::Copy;
use crate::progress::Progress;
use crate::thread::Gate;
use crate::waves::{Flight, Frames, Part, finish, launch};
use oocpt_shader_abi::PushFlags;

/// The textures of a frame in core.
pub(crate) struct Tiles<'a> {
    pub(crate) scene: &'a mut Scene,
    /// Most bytes of geometry and tiles.
    pub(crate) cap: Option<u64>,
    /// Where the waves say what they lack.
    pub(crate) feedback: Option<&'a crate::feedback::Feedback>,
}

/// What is to be done about a slice of pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Completed {
    /// It lacks nothing.
    Whole,
    /// It lacked tiles, which are there now.
    Again,
    /// The gate said no.
    GivenUp,
}

impl Tiles<'_> {
    /// Whether the wave that ended with this copy lacked tiles.
    pub(crate) fn is_incomplete(&self, lacking: Option<Copy>) -> Result<bool, RenderError> {
        Ok(self.lacking(lacking)?.is_some())
    }

    fn lacking(&self, lacking: Option<Copy>) -> Result<Option<Vec<u32>>, RenderError> {
        match (self.feedback, lacking) {
            (Some(feedback), Some(copy)) => Ok(feedback.read(copy)?),
            _ => Ok(None),
        }
    }

    /// Brings what was lacking, and records that nothing is.
    pub(crate) fn bring(
        &mut self,
        frames: &Frames<'_>,
        lacking: Option<Copy>,
        gate: &Gate<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<Completed, RenderError> {
        let (Some(tiles), Some(feedback)) = (self.lacking(lacking)?, self.feedback) else {
            return Ok(Completed::Whole);
        };
        tracing::debug!(tiles = tiles.len(), "tiles are wanted");
        match self.scene.bring_tiles(frames.device, &tiles, self.cap, gate, &mut progress.timings)? {
            Brought::NoRoom => Err(RenderError::TexturesOutgrow),
            Brought::GivenUp => Ok(Completed::GivenUp),
            Brought::All(shown) => {
                let mut commands = frames.commands("tiles")?;
                let held = self.scene.tile_bytes_held();
                let (loads, paged) = (progress.timings.tiles, progress.timings.tile_bytes);
                progress.streaming(|stats| {
                    (stats.loads, stats.bytes_paged) = (loads, paged);
                    (stats.texture_loads, stats.texture_bytes_paged, stats.texture_bytes) = (loads, paged, held);
                });
                self.scene.write_entries(&mut commands, &shown);
                feedback.reset(&mut commands);
                commands.submit()?;
                Ok(Completed::Again)
            }
        }
    }

    /// Traces the paths of a wave again that lacked tiles, until the film has it. Gives its last part; none when the
    /// gate said no: then
    /// the wave has left no trace.
    pub(crate) fn complete(
        &mut self,
        frames: &Frames<'_>,
        mut flight: Flight,
        gate: &Gate<'_>,
        progress: &mut Progress<'_>,
    ) -> Result<Option<Flight>, RenderError> {
        progress.timings.retraced_waves += 1;
        loop {
            match self.bring(frames, flight.lacking, gate, progress)? {
                Completed::Whole => return Ok(Some(flight)),
                Completed::GivenUp => return Ok(None),
                Completed::Again => {}
            }
            let parts = frames.recorder().parts();
            let last = parts.len().saturating_sub(1);
            for (index, rounds) in parts.into_iter().enumerate() {
                if !gate.proceed() {
                    return Ok(None);
                }
                let part = Part { wave: flight.wave(), rounds, ends: index == last, flags: PushFlags::RETRACE };
                flight = launch(frames, part, progress)?;
                finish(flight.submission(), progress)?;
            }
        }
    }
}
