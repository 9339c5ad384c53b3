// SPDX-License-Identifier: Apache-2.0
//! Errors of the device, with as few variants as callers can act on.
//!
//! Plain data, any thread. Running out of memory is an event for the caller's planner (evict, shrink, try again), not
//! the end.

/// Every error of this crate. Cheap to clone, so that it can be both returned and kept.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// There is no Vulkan loader, no driver, or no device that the selector names. `reason` is one sentence that tells
    /// the user what to install or which names exist.
    #[error("no usable Vulkan device: {reason}")]
    NoDevice {
        /// One sentence that names what is missing and what to do.
        reason: String,
    },
    /// The chosen device lacks something the renderer cannot do without.
    #[error("{device} cannot be used: it lacks {missing}")]
    MissingCapability {
        /// The device's name.
        device: String,
        /// Everything that is missing, as a comma-separated list.
        missing: String,
    },
    /// The budget or the driver refused memory. Nothing was changed: free something and try again.
    #[error("out of GPU memory for {name}: {bytes} bytes wanted, {used} of {budget} bytes in use")]
    OutOfMemory {
        /// Name of the buffer, heap or range.
        name: String,
        /// Bytes asked for.
        bytes: u64,
        /// Bytes held at that time.
        used: u64,
        /// The budget at that time.
        budget: u64,
    },
    /// One allocation is larger than the driver allows in one piece, whatever is free.
    #[error("{name}: {bytes} bytes in one piece, but the driver allows {limit}")]
    TooLarge {
        /// Name of the buffer or range.
        name: String,
        /// Bytes asked for.
        bytes: u64,
        /// Largest piece in bytes.
        limit: u64,
    },
    /// The device is gone (crash, watchdog, unplugged). Every later call on this [`Gpu`](crate::Gpu) gives the same
    /// error.
    #[error("the GPU was lost; last pass known to have finished: {last_pass}")]
    DeviceLost {
        /// Name of the last pass that wrote its marker, or of the last submission if there is no marker.
        last_pass: String,
    },
    /// A call that breaks the contract of this crate (range outside a buffer, wrong push constant size, ...).
    #[error("{name}: {message}")]
    Usage {
        /// Name of the object or of the command list.
        name: String,
        /// Description of the error.
        message: String,
    },
    /// A Vulkan call failed in a way that has no variant of its own.
    #[error("{call} failed: {code}")]
    Vulkan {
        /// The Vulkan function.
        call: &'static str,
        /// The result code, as text.
        code: String,
    },
}
