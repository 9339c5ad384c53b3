// SPDX-License-Identifier: Apache-2.0
//! Which backend walks the rays of a frame, and native traversal between two parts of a submission. Render thread only.

use crate::assets::SceneView;
use crate::device::{Device, PassSpecialisation, WAVE_TIMEOUT};
use crate::error::RenderError;
use oocpt_abi::{Features, PushConstants};
use oocpt_core::inventory::TraversalUse;
use oocpt_core::settings::TraversalKind;
use oocpt_gpu::{Buffer, CommandList, Gpu, GpuError};
use oocpt_shaders::Pass;
use oocpt_traverse::{InstructionSet, TraceError, TraversalConstants};
use std::sync::Arc;

use super::TracedRays;

/// Who walks the rays, and why.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TraversalBackend {
    pub(crate) is_native: bool,
    why: &'static str,
    geometry_bytes: u64,
}

impl TraversalBackend {
    /// What `wanted` asks for and this device, these features and the scene allow.
    pub(crate) fn choose(
        wanted: TraversalKind,
        device: &Device,
        special: &PassSpecialisation,
        view: &SceneView,
    ) -> Result<Self, RenderError> {
        let geometry_bytes = view.geometry_bytes;
        let compute = |why| Self { is_native: false, why, geometry_bytes };
        let native = |why| Self { is_native: true, why, geometry_bytes };
        if wanted == TraversalKind::Compute {
            return Ok(compute("oocpt:traversal is compute"));
        }
        if !device.gpu.has_host_memory() {
            return match wanted {
                TraversalKind::Native => Err(RenderError::NoNative { device: device.gpu.report().name.clone() }),
                _ => Ok(compute("the device is no processor")),
            };
        }
        #[cfg(feature = "faults")]
        if special.fault != 0 {
            return Ok(compute("the shaders have a fault planted"));
        }
        if let Some(why) = oocpt_traverse::unsupported(special.features) {
            return Ok(compute(why));
        }
        if let Some(why) = view.cutouts_of_shaders
            && special.features.contains(Features::CUTOUTS | Features::TEXTURES)
        {
            return Ok(compute(why));
        }
        Ok(native(if wanted == TraversalKind::Native {
            "oocpt:traversal is native"
        } else {
            "the device is a processor"
        }))
    }

    /// Whether the frame has a pipeline of `pass`.
    pub(crate) fn has(self, pass: Pass) -> bool {
        let traces =
            [Pass::IntersectClosest, Pass::IntersectShadow, Pass::SettleClosest, Pass::SettleShadow].contains(&pass);
        !self.is_native || !traces
    }

    /// For the stats.
    pub(crate) fn list(self) -> TraversalUse {
        let backend = if self.is_native { TraversalKind::Native } else { TraversalKind::Compute };
        TraversalUse { backend: backend.name().to_owned(), why: self.why.to_owned() }
    }
}

/// Native traversal of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct NativeTraversal<'a> {
    gpu: &'a Arc<Gpu>,
    /// Buffers that the trace passes write.
    written: &'a [&'a Buffer],
    special: TraversalConstants,
}

impl<'a> NativeTraversal<'a> {
    pub(crate) fn new(
        gpu: &'a Arc<Gpu>,
        written: &'a [&'a Buffer],
        special: &PassSpecialisation,
        backend: TraversalBackend,
    ) -> Self {
        let PassSpecialisation { max_levels, stack_size, features, .. } = *special;
        let geometry_bytes = backend.geometry_bytes;
        let instructions = InstructionSet::Widest;
        let special = TraversalConstants { max_levels, stack_size, features, geometry_bytes, instructions };
        Self { gpu, written, special }
    }

    /// Traces the rays of the round that `push` names.
    pub(crate) fn trace(&self, commands: &mut CommandList, push: PushConstants, traced: TracedRays) {
        if traced != TracedRays::Shadow {
            self.pass(commands, Pass::IntersectClosest, push, oocpt_traverse::closest);
        }
        if traced != TracedRays::Closest {
            self.pass(commands, Pass::IntersectShadow, push, oocpt_traverse::shadow);
        }
    }

    fn pass(&self, commands: &mut CommandList, pass: Pass, push: PushConstants, trace: TraceFunction) {
        let name = pass.info().module.name;
        let failed =
            |error: &dyn std::fmt::Display| GpuError::Usage { name: name.to_owned(), message: error.to_string() };
        commands.host(name, WAVE_TIMEOUT, || {
            let view = self.gpu.host_view(self.written).ok_or_else(|| failed(&"the device's memory is not mapped"))?;
            trace(&view, push, self.special).map_err(|error| failed(&error))
        });
    }
}

type TraceFunction = fn(&oocpt_gpu::HostView, PushConstants, TraversalConstants) -> Result<(), TraceError>;
