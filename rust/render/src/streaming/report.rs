// SPDX-License-Identifier: Apache-2.0
//! Writes the data for `oocpt report chunks`: chunks, loads, rays, and the number of unfinished paths over time.

use super::StreamingContext;
use crate::error::RenderError;
use crate::job::timings::LeftMoment;
use crate::report::chunk_report::{ChunkReport, ReportCamera, ReportChunk, ReportInstance, ReportMoment, VERSION};
use oocpt_core::residency::UnitId;
use std::path::Path;

impl StreamingContext<'_, '_> {
    /// Writes the report if `oocpt:chunkReport` names a file.
    pub(super) fn write_report(&self) -> Result<(), RenderError> {
        let file = self.tracer.context.job.settings.chunk_report.as_str();
        if file.is_empty() {
            return Ok(());
        }
        let rays = self.buffers.unit_rays(&self.tracer.context.device.gpu)?;
        self.chunk_report(&rays).write(Path::new(file)).map_err(|error| RenderError::Report(error.to_string()))
    }

    fn chunk_report(&self, rays: &[u32]) -> ChunkReport {
        let (job, camera) = (self.tracer.context.job, self.tracer.context.rays);
        let (world, planner) = (&job.snapshot.world, &self.residency.planner);
        let wide = |v: [f32; 3]| v.map(f64::from);
        let part = job.request.part();
        let o = [0, 1, 2].map(|k: usize| f64::from(camera.o[k]) + f64::from(camera.o_lo[k]));
        // The report is of the window: rays count from its corner.
        let from_corner = |at: [f64; 3], x: [f32; 3], y: [f32; 3]| {
            let moved = |k: usize| at[k] + f64::from(part.x) * f64::from(x[k]) + f64::from(part.y) * f64::from(y[k]);
            [0, 1, 2].map(moved)
        };
        let chunk = |(id, chunk): (UnitId, &std::sync::Arc<oocpt_core::partition::Chunk>)| {
            let loads = u64::from(planner.load_count(id));
            ReportChunk {
                bytes: planner.catalog().closure_bytes(id),
                records: chunk.len() as u64,
                loads,
                reloads: loads.saturating_sub(1),
                rays: rays.get(id as usize).copied().map_or(0, u64::from),
                is_resident: planner.is_resident(id),
            }
        };
        let moment = |m: &LeftMoment| ReportMoment { seconds: m.seconds, paths_left: m.paths_left };
        ChunkReport {
            version: VERSION,
            width: part.width,
            height: part.height,
            origin: job.snapshot.origin.to_array(),
            camera: ReportCamera {
                o: from_corner(o, camera.o_x, camera.o_y),
                o_x: wide(camera.o_x),
                o_y: wide(camera.o_y),
                d: from_corner(wide(camera.d), camera.d_x, camera.d_y),
                d_x: wide(camera.d_x),
                d_y: wide(camera.d_y),
            },
            instances: world
                .instances
                .iter()
                .map(|i| ReportInstance { bounds: [i.bounds.min, i.bounds.max], chunk: i.chunk })
                .collect(),
            chunks: (0..).zip(&world.chunks).map(chunk).collect(),
            progress: self.left.moments.iter().map(moment).collect(),
        }
    }
}
