// SPDX-License-Identifier: Apache-2.0
//! The errors of rendering, as the caller can act on them.
//!
//! Every variant ends the current render: the session reports it once as a [`crate::Message`], keeps the last image it
//! published and calls itself converged, so that no host waits for ever.

use oocpt_core::camera::CameraError;
use oocpt_core::mesh::StoredError;
use oocpt_gpu::GpuError;

/// The reason why a render ended early.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// A call of the device or the driver failed.
    #[error(transparent)]
    Gpu(GpuError),
    /// The scene and the images do not fit the memory budget.
    #[error(
        "the memory budget of {} MiB is too small: {} MiB are in use and {name} needs {} MiB more; raise \
         oocpt:memoryBudget or simplify the scene",
        .budget >> 20,
        .used >> 20,
        .bytes.div_ceil(1 << 20)
    )]
    Budget {
        /// The object that was to be placed.
        name: String,
        /// Its size, bytes.
        bytes: u64,
        /// Bytes in use.
        used: u64,
        /// The budget, bytes.
        budget: u64,
    },
    /// The textures that a render in core needs have outgrown the device; it continues by streaming.
    #[error("the textures that the picture shows do not fit beside the geometry")]
    TexturesOutgrow,
    /// Parts of the scene that a ray needs at once are larger than what is left for geometry.
    #[error(
        "the memory budget is too small: a ray through {parts} needs {} KiB at once, {} KiB are left for geometry; raise \
         oocpt:memoryBudget or oocpt:geometryBudget, or lower oocpt:chunkSize",
        .bytes.div_ceil(1 << 10),
        .budget >> 10
    )]
    PartsTooLarge {
        /// Description of the parts for the user.
        parts: String,
        /// Bytes of the parts together.
        bytes: u64,
        /// Bytes that geometry may take.
        budget: u64,
    },
    /// The loads let no ray continue.
    #[error(
        "the memory budget is too small: {loads} loads have brought none of {left} paths to its end; raise oocpt:memoryBudget \
         or oocpt:geometryBudget"
    )]
    NoProgress {
        /// Loads since the last path ended.
        loads: u64,
        /// Paths in flight.
        left: u64,
    },
    /// A mesh that is not in memory cannot be read or built.
    #[error(transparent)]
    Mesh(#[from] StoredError),
    /// The report of the chunks could not be written; the images are there.
    #[error("{0}")]
    Report(String),
    /// `oocpt:traversal` is native, but the device is not a processor.
    #[error(
        "oocpt:traversal: native needs a device whose memory is the host's, which {device} is not; use auto or compute"
    )]
    NoNative {
        /// Name of the device.
        device: String,
    },
    /// The camera's matrices cannot be inverted or are not finite.
    #[error("camera: {0}")]
    Camera(#[from] CameraError),
    /// The image asked for is empty or larger than the renderer supports.
    #[error("an image of {width} x {height} pixels is not supported (1 to {max} pixels a side, {max_pixels} in all)")]
    ImageSize {
        /// Requested width, pixels.
        width: u32,
        /// Requested height, pixels.
        height: u32,
        /// Largest side, pixels.
        max: u32,
        /// Largest area, pixels.
        max_pixels: u64,
    },
    /// The scene has more of something than the 32-bit ids of the GPU tables can number.
    #[error("the scene has {count} {what}; at most {limit} are supported")]
    TooMany {
        /// The kind of object that is counted, in the plural.
        what: &'static str,
        /// The number that the scene has.
        count: u64,
        /// The largest number that is supported.
        limit: u64,
    },
    /// Instancers are nested deeper than the traversal supports.
    #[error("instancers are nested {levels} levels deep; at most {limit} are supported")]
    TooDeep {
        /// Levels the scene has.
        levels: u32,
        /// Levels supported.
        limit: u32,
    },
    /// A ray needed more traversal stack than the host had allocated: a defect of this program, which is always
    /// reported.
    #[error("{count} rays ran out of traversal stack; please report this scene")]
    StackOverflow {
        /// Rays affected.
        count: u64,
    },
    /// The render thread panicked because of a defect of its own; the text is the panic message.
    #[error("internal error in the render thread: {0}")]
    Internal(String),
}

impl From<GpuError> for RenderError {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::OutOfMemory { name, bytes, used, budget } => Self::Budget { name, bytes, used, budget },
            other => Self::Gpu(other),
        }
    }
}

/// The words of a panic.
pub(crate) fn panic_text(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<&str>()
        .map(ToString::to_string)
        .or_else(|| panic.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "unknown panic".into())
}
