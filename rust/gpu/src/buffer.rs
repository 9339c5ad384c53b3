// SPDX-License-Identifier: Apache-2.0
//! Buffers with memory of their own.
//!
//! They are for few, long-lived things: queues, staging, readback, film. Things that come and go by the thousand belong
//! in a [`Heap`](crate::Heap). All methods may be called from any thread.

use std::sync::{Arc, PoisonError, RwLock};

use crate::device::mapped::MappedPointer;
use crate::error::GpuError;
use crate::gpu::Gpu;
use crate::instance::memory_type::BufferUsage;
use crate::memory::block::MemoryBlock;
use crate::range::DeviceRange;
use crate::range::sealed::{RangeParts, ToRangeParts};
use crate::submit::kept::HeldResource;

/// Device or host memory with a device address. Put it in an [`Arc`] to share it.
///
/// Dropping it does not wait: its memory goes back to the budget when the last submission made so far has finished. A
/// command list that only knows the *address* must be submitted before the drop, or keep the buffer by
/// [`CommandList::keep`](crate::CommandList::keep).
#[derive(Debug)]
pub struct Buffer {
    block: Arc<MemoryBlock>,
    name: String,
    size: u64,
    usage: BufferUsage,
    /// Serialises host threads on the mapped bytes: many readers or one writer.
    host: RwLock<()>,
}

impl Buffer {
    /// Creates a buffer of `bytes` (0 is allowed and still has an address). New memory holds arbitrary bytes.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] when the budget or the driver refuses even after waiting for retired memory,
    /// [`GpuError::TooLarge`], [`GpuError::DeviceLost`].
    pub fn new(gpu: &Arc<Gpu>, name: &str, bytes: u64, usage: BufferUsage) -> Result<Self, GpuError> {
        Ok(Self {
            block: Arc::new(gpu.opened().block(name, bytes, usage)?),
            name: name.to_owned(),
            size: bytes,
            usage,
            host: RwLock::new(()),
        })
    }

    /// Device address of the first byte, a multiple of 16.
    #[must_use]
    pub fn address(&self) -> u64 {
        self.block.raw.address
    }

    /// Size in bytes, as asked for.
    #[must_use]
    pub fn size(&self) -> u64 {
        self.size
    }

    /// Name that it was created with.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Usage that it was created for.
    #[must_use]
    pub fn usage(&self) -> BufferUsage {
        self.usage
    }

    /// Copies `bytes` to `offset`. Every submission made after this returns sees it. A submission in flight may see any
    /// part of it.
    ///
    /// # Errors
    /// [`GpuError::Usage`] when the buffer is not mapped or the range does not fit.
    pub fn write(&self, offset: u64, bytes: &[u8]) -> Result<(), GpuError> {
        let start = self.mapped_range(offset, bytes.len())?;
        let _exclusive = self.host.write().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: `bytes.len()` bytes from `start` are mapped, the lock keeps other host threads away, and a mapping
        // does not overlap Rust memory.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), start, bytes.len()) };
        Ok(())
    }

    /// Copies from `offset` into `bytes`. The bytes contain the writes of submissions that are known to be done
    /// ([`Submission::wait`](crate::Submission::wait)); those of others are unspecified.
    ///
    /// # Errors
    /// [`GpuError::Usage`] when the buffer is not mapped or the range does not fit.
    pub fn read(&self, offset: u64, bytes: &mut [u8]) -> Result<(), GpuError> {
        let start = self.mapped_range(offset, bytes.len())?;
        let _shared = self.host.read().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: as in `write`; the lock keeps host writers away.
        unsafe { std::ptr::copy_nonoverlapping(start, bytes.as_mut_ptr(), bytes.len()) };
        Ok(())
    }

    /// Lends all mapped bytes to `f`, which may split them among threads. No other host thread uses the buffer
    /// meanwhile, and the caller ensures that no submission in flight does. Do not read from a `BufferUsage::Upload`
    /// buffer: it may be very slow.
    ///
    /// # Errors
    /// [`GpuError::Usage`] when the buffer is not mapped or larger than the host can address.
    pub fn map<R>(&self, f: impl FnOnce(&mut [u8]) -> R) -> Result<R, GpuError> {
        let length = usize::try_from(self.size).map_err(|_too_large| self.misuse("too large to map"))?;
        let start = self.mapped_range(0, length)?;
        let _exclusive = self.host.write().unwrap_or_else(PoisonError::into_inner);
        // SAFETY: `length` bytes from `start` are mapped as long as `self` lives, and the lock makes this the only
        // reference.
        let bytes = unsafe { std::slice::from_raw_parts_mut(start, length) };
        Ok(f(bytes))
    }

    /// Its memory.
    pub(crate) fn block(&self) -> &Arc<MemoryBlock> {
        &self.block
    }

    /// The address of a mapped byte range that was checked to fit.
    fn mapped_range(&self, offset: u64, length: usize) -> Result<*mut u8, GpuError> {
        let mapped: MappedPointer =
            self.block.raw.mapped.ok_or_else(|| self.misuse("a Device buffer is not mapped"))?;
        let fits = u64::try_from(length).ok().and_then(|n| offset.checked_add(n)).is_some_and(|end| end <= self.size);
        let offset = usize::try_from(offset)
            .ok()
            .filter(|_| fits)
            .ok_or_else(|| self.misuse(&format!("{length} bytes at {offset} do not fit in {} bytes", self.size)))?;
        // SAFETY: `offset` is within the mapped buffer, or one past its end when `length` is 0.
        Ok(unsafe { mapped.as_ptr().add(offset) })
    }

    fn misuse(&self, message: &str) -> GpuError {
        GpuError::Usage { name: self.name.clone(), message: message.to_owned() }
    }
}

impl DeviceRange for Buffer {
    fn address(&self) -> u64 {
        Self::address(self)
    }

    fn size(&self) -> u64 {
        self.size
    }

    fn name(&self) -> &str {
        &self.name
    }
}

impl ToRangeParts for Buffer {
    fn parts(&self) -> RangeParts {
        RangeParts {
            buffer: self.block.buffer(),
            offset: 0,
            device: Arc::as_ptr(&self.block.device),
            kept: HeldResource::Block(Arc::clone(&self.block)),
        }
    }
}

impl Drop for Buffer {
    fn drop(&mut self) {
        self.block.released();
    }
}
