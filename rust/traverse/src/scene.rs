// SPDX-License-Identifier: Apache-2.0
//! Resolves the inputs of the trace passes once for a pass: addresses become bytes with bounds. Any thread.

use crate::{TraceError, TraversalConstants};
use oocpt_abi::{
    Features, FrameConstants, GpuAssembly, GpuChunk, GpuChunkInstance, GpuInstance, GpuMesh, LightTablePointers,
    PushConstants, PushFlags, StreamingPointers,
};
use oocpt_gpu::{HostBytes, HostView};

/// The scene that the rays of a pass are traced through.
#[derive(Debug)]
pub(crate) struct TraversalScene<'v> {
    pub(crate) view: &'v HostView,
    pub(crate) special: TraversalConstants,
    pub(crate) push: PushConstants,
    pub(crate) frame: FrameConstants,
    pub(crate) streaming: StreamingPointers,
    pub(crate) top_nodes: HostBytes<'v>,
    chunk_instances: HostBytes<'v>,
    chunks: HostBytes<'v>,
    assemblies: HostBytes<'v>,
    meshes: HostBytes<'v>,
    pub(crate) materials: HostBytes<'v>,
    pub(crate) prims: HostBytes<'v>,
    pub(crate) material_slots: HostBytes<'v>,
    pub(crate) textures: HostBytes<'v>,
    pub(crate) texture_pages: HostBytes<'v>,
    pub(crate) cones: HostBytes<'v>,
    links: Option<LightLinks<'v>>,
    /// Masks of prims, four in a word; none without the feature.
    masks: HostBytes<'v>,
}

/// The categories that decide which prims block which shadow rays.
#[derive(Debug)]
struct LightLinks<'v> {
    bits: HostBytes<'v>,
    sets: HostBytes<'v>,
    words: u32,
    prims: u32,
}

impl<'v> TraversalScene<'v> {
    /// The scene of the frame block that `push` names.
    pub(crate) fn new(
        view: &'v HostView,
        push: PushConstants,
        special: TraversalConstants,
    ) -> Result<Self, TraceError> {
        let missing = |what| TraceError::NoMemory { what };
        let frame: FrameConstants = view.bytes(push.frame).get(0).ok_or_else(|| missing("the frame block"))?;
        let mut streaming = StreamingPointers::default();
        if special.features.contains(Features::STREAMING) {
            streaming = view.bytes(frame.streaming).get(0).ok_or_else(|| missing("the streaming block"))?;
        }
        let mut links = None;
        if special.features.contains(Features::LIGHT_LINKS) {
            let lighting: LightTablePointers =
                view.bytes(frame.lighting).get(0).ok_or_else(|| missing("the light table"))?;
            let (bits, sets) = (view.bytes(lighting.link_bits), view.bytes(lighting.prim_sets));
            links = Some(LightLinks { bits, sets, words: lighting.link_words, prims: lighting.prim_count });
        }
        let has_masks = special.features.contains(Features::PRIM_MASKS);
        Ok(Self {
            view,
            special,
            push,
            streaming,
            top_nodes: view.bytes(frame.top_nodes),
            chunk_instances: view.bytes(frame.chunk_instances),
            chunks: view.bytes(frame.chunks),
            assemblies: view.bytes(frame.assemblies),
            meshes: view.bytes(frame.meshes),
            materials: view.bytes(frame.materials),
            prims: view.bytes(frame.prims),
            material_slots: view.bytes(frame.material_slots),
            textures: view.bytes(frame.textures),
            texture_pages: view.bytes(frame.texture_pages),
            cones: view.bytes(frame.cones),
            links,
            masks: if has_masks { view.bytes(frame.prim_masks) } else { HostBytes::NONE },
            frame,
        })
    }

    #[inline(always)]
    pub(crate) fn has(&self, feature: Features) -> bool {
        self.special.features.contains(feature)
    }

    /// Returns true if the pass finds first hits through pixel centres.
    #[inline(always)]
    pub(crate) fn is_of_aovs(&self) -> bool {
        self.push.flags & PushFlags::AOVS.bits() != 0
    }

    #[inline(always)]
    pub(crate) fn chunk_instance(&self, index: u32) -> Option<GpuChunkInstance> {
        self.chunk_instances.get(index as usize)
    }

    #[inline(always)]
    pub(crate) fn prefetch_chunk_instance(&self, index: usize) {
        self.chunk_instances.prefetch::<GpuChunkInstance>(index, 1);
    }

    #[inline(always)]
    pub(crate) fn chunk(&self, index: u32) -> Option<GpuChunk> {
        self.chunks.get(index as usize)
    }

    #[inline(always)]
    pub(crate) fn assembly(&self, index: u32) -> Option<GpuAssembly> {
        self.assemblies.get(index as usize)
    }

    #[inline(always)]
    pub(crate) fn mesh(&self, index: u32) -> Option<GpuMesh> {
        self.meshes.get(index as usize)
    }

    /// Counts rays that enter a unit.
    pub(crate) fn count_rays(&self, unit: u32, rays: u32) {
        // Missing memory counts nothing.
        self.view.words(self.streaming.unit_rays).add(unit as usize, rays).unwrap_or_default();
    }

    /// Returns true if rays of the kind whose bit of [`oocpt_abi::PrimMask`] is `passing` pass through a prim
    /// (`prim_mask`).
    #[inline(always)]
    pub(crate) fn lets_pass(&self, passing: u32, instance: &GpuInstance) -> bool {
        let index = instance.prim_id.wrapping_add(1).cast_unsigned();
        if !self.has(Features::PRIM_MASKS) || index >= self.frame.mask_count {
            return false;
        }
        let word = self.masks.get::<u32>(index as usize / 4).unwrap_or(0);
        word >> (8 * (index % 4)) & 0xff & passing != 0
    }

    /// Returns true if a prim blocks rays of `category`, which is not 0 (`is_linked`).
    pub(crate) fn is_linked(&self, category: u32, instance: &GpuInstance) -> bool {
        let Some(links) = &self.links else { return true };
        let index = instance.prim_id.wrapping_add(1).cast_unsigned();
        let set = if index < links.prims { links.sets.get::<u32>(index as usize).unwrap_or(0) } else { 0 };
        let word = u64::from(set) * u64::from(links.words) + u64::from(category / 32);
        let word = usize::try_from(word).ok().and_then(|word| links.bits.get::<u32>(word)).unwrap_or(0);
        (word >> (category % 32)) & 1 != 0
    }
}
