// SPDX-License-Identifier: Apache-2.0
//! One open device of the process, shared by all sessions with the same options: its memory heap and its pipelines.
//!
//! A device stays open until it is lost, or until another one is opened while nobody uses it: hosts create and destroy
//! delegates often, and compiling the passes again for each would cost seconds. Sessions with different budgets do not
//! share a device, so that no session's budget bounds another one.

pub mod bsdf_tables;
pub(crate) mod cache_folder;
pub(crate) mod compiled;
pub(crate) mod loader;
pub(crate) mod reading;

use crate::device::cache_folder::cache_folder;
use crate::device::compiled::CompiledPipelines;
use crate::device::loader::Loader;
use crate::device::reading::ReadingLimit;
use crate::error::RenderError;
use crate::sync::lock;
use oocpt_abi::{Features, PushConstants, SPEC_MAX_LEVELS, SPEC_STACK_SIZE};
use oocpt_gpu::{
    Buffer, BufferUsage, DeviceKind, Gpu, GpuError, Heap, HeapOptions, MAX_UPDATE_BYTES, OpenOptions, Pipeline,
};
use oocpt_shaders::{ALL, SCENE, ShaderModule};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};
use xxhash_rust::xxh3::Xxh3;

/// Size of the arenas that hold scene data, bytes.
const ARENA_BYTES: u64 = 64 << 20;
/// Size of the smallest arenas, bytes.
const MIN_ARENA_BYTES: u64 = 1 << 20;
/// Share of the budget that an arena takes at most: under a small budget, other arenas need room too.
const ARENA_SHARE: u64 = 16;
/// The longest time that one submission of a frame may take before the device counts as lost.
pub(crate) const WAVE_TIMEOUT: Duration = Duration::from_secs(120);
/// Longest wait for a small upload.
const UPLOAD_TIMEOUT: Duration = Duration::from_secs(60);

/// The specialisation constants of a pipeline, in the order of their ids (`oocpt_abi`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(crate) struct PassSpecialisation {
    /// Deepest chain of instance records, at least 1.
    pub(crate) max_levels: u32,
    /// Traversal stack entries of a ray.
    pub(crate) stack_size: u32,
    /// The features that are compiled in.
    pub(crate) features: Features,
    /// The fault that the passes commit (`SPEC_FAULT`); 0 = none.
    #[cfg(feature = "faults")]
    pub(crate) fault: u32,
}

impl PassSpecialisation {
    /// The same specialisation without the constants that `module` does not read, so that its pipeline does not depend
    /// on them.
    fn of(mut self, module: &ShaderModule) -> Self {
        self.max_levels = if module.reads_levels { self.max_levels } else { 1 };
        self.stack_size = if module.reads_stack { self.stack_size } else { 1 };
        self.features &= module.features;
        self
    }
}

/// The choice of a device, and how it is opened.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct DeviceOptions {
    /// Index of the device, or part of its name; if empty, the best one is chosen.
    pub(crate) selector: String,
    /// Number of the logical device of the same physical one: a picture may be rendered on several.
    pub(crate) twin: u32,
    /// Turns the validation layer on; its messages become errors of the session.
    pub(crate) validation: bool,
    /// Hard limit of device memory, MiB; 0 = 90 % of what is free.
    pub(crate) budget_mib: u32,
    /// Folder in which compiled pipelines are kept; `None` keeps none.
    pub(crate) pipeline_cache: Option<PathBuf>,
}

/// The folder that `oocpt:pipelineCache` names. Empty means the user's own folder, "0" none.
pub(crate) fn pipeline_folder(setting: &str) -> Option<PathBuf> {
    match setting {
        "0" => None,
        "" => cache_folder("pipelines"),
        path => Some(PathBuf::from(path)),
    }
}

/// A hash of the passes' code: pipelines of other passes are of no use.
fn passes_key() -> u64 {
    static KEY: OnceLock<u64> = OnceLock::new();
    *KEY.get_or_init(|| {
        let mut hash = Xxh3::new();
        for module in ALL.iter().chain(SCENE) {
            hash.update(bytemuck::cast_slice(module.words));
        }
        hash.digest()
    })
}

/// Least time between two writes of compiled pipelines to disk while passes are compiled.
const KEEP_INTERVAL: Duration = Duration::from_secs(1);

/// The pipelines that are not on disk yet, and the time of the last write.
#[derive(Debug, Default)]
struct UnsavedPipelines {
    count: u32,
    written: Option<Instant>,
}

/// Longest wait for the warm-up of one pipeline, which is single-threaded: what takes 10 s alone may take minutes
/// beside other work.
const WARM_UP_TIMEOUT: Duration = Duration::from_secs(1800);

/// An open device with the state that all frames on it share.
#[derive(Debug)]
pub(crate) struct Device {
    pub(crate) gpu: Arc<Gpu>,
    pub(crate) heap: Heap,
    host_heap: OnceLock<Arc<Heap>>,
    options: DeviceOptions,
    loader: OnceLock<Loader>,
    /// The limit on mesh bytes that the loader reads at a time.
    pub(crate) reading: Arc<ReadingLimit>,
    bsdf_tables: [Mutex<Option<Buffer>>; 4],
    pipelines: Mutex<CompiledPipelines<(&'static str, PassSpecialisation), Pipeline>>,
    unkept: Mutex<UnsavedPipelines>,
}

static OPEN: Mutex<Vec<Arc<Device>>> = Mutex::new(Vec::new());

impl Device {
    /// The open device of these options, or a newly opened one.
    pub(crate) fn open(options: &DeviceOptions) -> Result<Arc<Self>, RenderError> {
        let mut open = lock(&OPEN);
        if let Some(device) = open.iter().find(|device| device.options == *options) {
            return Ok(Arc::clone(device));
        }
        open.retain(|device| Arc::strong_count(device) > 1);
        let gpu = Gpu::open(&OpenOptions {
            selector: (!options.selector.is_empty()).then(|| options.selector.clone()),
            validation: options.validation,
            budget_bytes: (options.budget_mib > 0).then(|| u64::from(options.budget_mib) << 20),
            pipeline_cache: options.pipeline_cache.clone(),
            pipeline_key: passes_key(),
            ..OpenOptions::default()
        })?;
        tracing::info!(device = gpu.report().name, "opened");
        let arena = (gpu.memory().budget / ARENA_SHARE).clamp(MIN_ARENA_BYTES, ARENA_BYTES);
        let heap = Heap::new(&gpu, "scene", arena)?;
        let device = Arc::new(Self {
            gpu,
            heap,
            host_heap: OnceLock::new(),
            options: options.clone(),
            loader: OnceLock::new(),
            reading: Arc::default(),
            bsdf_tables: Default::default(),
            pipelines: Mutex::default(),
            unkept: Mutex::default(),
        });
        open.push(Arc::clone(&device));
        Ok(device)
    }

    /// Returns true if [`Device::open`] with these options would give this device.
    pub(crate) fn serves(&self, options: &DeviceOptions) -> bool {
        self.options == *options
    }

    /// Makes the next [`Device::open`] open a new device, after the loss of this one.
    pub(crate) fn forget(self: &Arc<Self>) {
        lock(&OPEN).retain(|device| !Arc::ptr_eq(device, self));
    }

    /// The heap of host memory, if it has been created.
    pub(crate) fn host_heap_if_made(&self) -> Option<&Arc<Heap>> {
        self.host_heap.get()
    }

    /// The threads that bring scene data to the device, started at first use.
    pub(crate) fn loader(&self) -> Result<&Loader, RenderError> {
        if let Some(loader) = self.loader.get() {
            return Ok(loader);
        }
        let loader = Loader::new(&self.gpu, Arc::clone(&self.reading))?;
        Ok(self.loader.get_or_init(|| loader))
    }

    /// The heap of host memory that the device reads across the bus, created empty at first use. Its arenas are
    /// allocated ahead by [`Heap::reserve`]: the driver takes half a second for a gigabyte.
    pub(crate) fn host_heap(&self) -> Result<&Arc<Heap>, RenderError> {
        if let Some(heap) = self.host_heap.get() {
            return Ok(heap);
        }
        let (usage, keeps_arenas) = (BufferUsage::Shared, true);
        let options = HeapOptions { arena_bytes: ARENA_BYTES, usage, keeps_arenas, ..HeapOptions::default() };
        let heap = Arc::new(Heap::with_options(&self.gpu, "host-mapped scene", options)?);
        Ok(self.host_heap.get_or_init(|| heap))
    }

    /// Addresses of the albedo tables of the BSDF and of sheen, uploaded at first use. The tables of rough glass and of
    /// sheen are uploaded only for a scene that has them; an address is 0 for a scene without materials or without
    /// sheen.
    pub(crate) fn bsdf_tables(&self, features: Features) -> Result<[u64; 2], RenderError> {
        if !features.contains(Features::MATERIALS) {
            return Ok([0; 2]);
        }
        let has_glass = features.contains(Features::ROUGH_TRANSMISSION);
        let has_sheen = features.contains(Features::SHEEN);
        let glass = if has_glass { bsdf_tables::glass::bytes() } else { &[] };
        let sheen = if has_sheen { bsdf_tables::sheen::bytes() } else { &[] };
        let sheen_at = (bsdf_tables::bytes().len() + glass.len()) as u64;
        let addresses = |tables: &Buffer| [tables.address(), if has_sheen { tables.address() + sheen_at } else { 0 }];
        let mut tables = lock(&self.bsdf_tables[usize::from(has_glass) + 2 * usize::from(has_sheen)]);
        if let Some(tables) = &*tables {
            return Ok(addresses(tables));
        }
        let bytes = [bsdf_tables::bytes(), glass, sheen].concat();
        let buffer = Buffer::new(&self.gpu, "BSDF tables", bytes.len() as u64, BufferUsage::Device)?;
        let mut commands = self.gpu.commands("BSDF tables")?;
        for (index, part) in bytes.chunks(MAX_UPDATE_BYTES).enumerate() {
            commands.update(&buffer, (index * MAX_UPDATE_BYTES) as u64, part);
        }
        if !commands.submit()?.wait(UPLOAD_TIMEOUT)? {
            return Err(RenderError::Internal("the BSDF's tables did not reach the device".into()));
        }
        Ok(addresses(tables.insert(buffer)))
    }

    /// The pipeline of `module` for `special`, compiled at first use.
    pub(crate) fn pipeline(
        &self,
        module: &'static ShaderModule,
        special: PassSpecialisation,
    ) -> Result<Arc<Pipeline>, GpuError> {
        let special = special.of(module);
        let key = (module.name, special);
        if let Some(made) = lock(&self.pipelines).get(&key) {
            return Ok(made);
        }
        let [low, high, top] = special.features.constants();
        let (levels, stack) = ((SPEC_MAX_LEVELS, special.max_levels), (SPEC_STACK_SIZE, special.stack_size));
        let constants = [
            levels,
            stack,
            low,
            high,
            top,
            #[cfg(feature = "faults")]
            (oocpt_abi::SPEC_FAULT, special.fault),
        ];
        // 32 bytes.
        let push_bytes = u32::try_from(size_of::<PushConstants>()).unwrap_or(u32::MAX);
        let started = Instant::now();
        let words = module.specialised(&constants);
        let pipeline = Pipeline::new(&self.gpu, module.name, &words, &constants, push_bytes)?;
        tracing::debug!(pass = module.name, secs = started.elapsed().as_secs_f64(), "compiled");
        lock(&self.unkept).count += 1;
        Ok(lock(&self.pipelines).insert(&key, pipeline, started.elapsed().as_secs_f64()))
    }

    /// Writes the pipelines that were compiled since the last write to disk, after a batch of them or, with `at_end`,
    /// after a render: hosts may exit without closing the device.
    pub(crate) fn keep_pipelines(&self, at_end: bool) {
        let mut unkept = lock(&self.unkept);
        let is_early = !at_end && unkept.written.is_some_and(|written| written.elapsed() < KEEP_INTERVAL);
        if unkept.count > 0 && !is_early {
            self.gpu.save_pipeline_cache();
            *unkept = UnsavedPipelines { count: 0, written: Some(Instant::now()) };
        }
    }

    /// Warms `pipeline` up by an empty dispatch in a submission of its own, unless it has been used before. Returns the
    /// number of pipelines warmed up, 0 or 1. Only software drivers generate machine code at the first use: that would
    /// be part of a wave otherwise, and a wave is bounded in time.
    pub(crate) fn warm_up(&self, pipeline: &Arc<Pipeline>) -> Result<u64, RenderError> {
        if self.gpu.report().kind != DeviceKind::Cpu {
            return Ok(0);
        }
        if lock(&self.pipelines).is_warm(pipeline) {
            return Ok(0);
        }
        let started = Instant::now();
        let mut commands = self.gpu.commands("warm up")?;
        commands.dispatch_nothing(pipeline);
        if !commands.submit()?.wait(WARM_UP_TIMEOUT)? {
            return Err(RenderError::Internal(format!("the driver does not get done with {}", pipeline.name())));
        }
        tracing::debug!(pass = pipeline.name(), secs = started.elapsed().as_secs_f64(), "warmed up");
        lock(&self.pipelines).mark_warm(pipeline, started.elapsed().as_secs_f64());
        Ok(1)
    }

    /// Seconds that compiling `pipeline` took.
    pub(crate) fn compile_secs(&self, pipeline: &Arc<Pipeline>) -> f64 {
        lock(&self.pipelines).compile_secs(pipeline)
    }

    /// Bytes of the BSDF's tables on this device; 0 until a scene with materials is rendered.
    pub(crate) fn bsdf_bytes(&self) -> u64 {
        self.bsdf_tables.iter().map(|tables| lock(tables).as_ref().map_or(0, Buffer::size)).sum()
    }
}

#[cfg(test)]
mod tests {
    use oocpt_gpu::DeviceCapabilities;
    use oocpt_shaders::PASSES;
    use std::collections::BTreeSet;

    /// `OpCapability` of SPIR-V.
    const OP_CAPABILITY: u32 = 17;
    /// Capabilities of SPIR-V by number, and the required feature of a device that is named for each.
    const REQUIRED: [(u32, &str); 5] = [
        (11, "shaderInt64"),
        (61, "subgroup"),
        (63, "subgroup"),
        (64, "subgroup"),
        // PhysicalStorageBufferAddresses.
        (5347, "bufferDeviceAddress"),
    ];

    /// The capabilities that passes declare.
    fn declared() -> BTreeSet<u32> {
        let mut declared = BTreeSet::new();
        for row in &PASSES {
            let mut rest = &row.module.words[5..];
            while let [word, operand, ..] = rest
                && word & 0xffff == OP_CAPABILITY
            {
                declared.insert(*operand);
                rest = &rest[(word >> 16) as usize..];
            }
        }
        declared
    }

    #[test]
    fn every_capability_used_by_passes_is_required() {
        let mut modern = DeviceCapabilities::default();
        modern.vulkan_1_2 = true;
        let missing = modern.missing();
        // Every device has Shader; Shuffle is named with the other subgroup capabilities.
        for capability in declared().into_iter().filter(|capability| ![1, 65].contains(capability)) {
            let feature = REQUIRED.iter().find(|(number, _)| *number == capability).map(|(_, feature)| *feature);
            let feature = feature.unwrap_or_else(|| panic!("capability {capability} is required of no device"));
            assert!(missing.iter().any(|name| name.contains(feature)), "{feature} is not required");
        }
    }

    #[test]
    fn no_unused_capability_is_required() {
        let declared = declared();
        let unused: Vec<u32> = REQUIRED.iter().map(|(number, _)| *number).filter(|n| !declared.contains(n)).collect();
        assert!(unused.is_empty(), "{unused:?}");
    }
}
