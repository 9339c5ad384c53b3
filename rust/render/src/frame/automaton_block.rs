// SPDX-License-Identifier: Apache-2.0
//! Uploads what paths carry along for light path expressions: the automaton, and the labels of lights and prims.
//! Render thread only.

use crate::error::RenderError;
use crate::frame::context::FrameContext;
use crate::job::expression;
use oocpt_abi::{FrameConstants, GpuPathAutomaton};
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::{Buffer, BufferUsage};
use std::sync::Arc;

const NAME: &str = "light path automaton";

/// Uploads the automaton of the film's expressions, if there are any, and writes its address into the block.
pub(crate) fn upload(
    context: &FrameContext<'_>,
    block: &mut FrameConstants,
    listed: &mut RenderInventory,
) -> Result<Option<Buffer>, RenderError> {
    let expressions = context.film.expressions();
    if expressions.is_empty() {
        return Ok(None);
    }
    let automaton = expression::automaton(&expressions);
    let labels =
        |of: &[Option<Arc<str>>]| -> Vec<u32> { of.iter().map(|label| automaton.label(label.as_deref())).collect() };
    let prims = labels(&context.job.snapshot.surfaces.labels);
    let tables = [
        automaton.next.clone(),
        automaton.accepts.clone(),
        labels(&context.lights.local_labels),
        labels(&context.lights.infinite_labels),
        prims,
    ];
    let header = size_of::<GpuPathAutomaton>() as u64;
    let bytes = header + tables.iter().map(|table| 4 * table.len() as u64).sum::<u64>();
    let buffer = Buffer::new(&context.device.gpu, NAME, bytes, BufferUsage::Upload)?;
    let mut addresses = [0; 5];
    let mut at = header;
    for (table, address) in tables.iter().zip(&mut addresses) {
        buffer.write(at, bytemuck::cast_slice(table))?;
        *address = if table.is_empty() { 0 } else { buffer.address() + at };
        at += 4 * table.len() as u64;
    }
    let [next, accepts, local_labels, infinite_labels, prim_labels] = addresses;
    let of_gpu = GpuPathAutomaton {
        next,
        accepts,
        local_labels,
        infinite_labels,
        prim_labels,
        // At most MAX_PRIM_ID + 1.
        prim_count: u32::try_from(tables[4].len()).unwrap_or(0),
        label_count: automaton.label_count(),
        default_label: automaton.label(None),
        start: automaton.start,
        unoccluded: automaton.unoccluded,
        pad: 0,
    };
    buffer.write(0, bytemuck::bytes_of(&of_gpu))?;
    listed.add(NAME, bytes);
    block.automaton = buffer.address();
    Ok(Some(buffer))
}
