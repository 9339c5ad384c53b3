// SPDX-License-Identifier: Apache-2.0
//! What operations work on: a stretch of device memory with an owner that can be kept alive.
//!
//! [`DeviceRange`] is implemented by [`Buffer`](crate::Buffer), [`HeapRange`](crate::HeapRange) and
//! [`StagingSlice`](crate::StagingSlice) only. Any thread.

/// A stretch of device memory: a whole [`Buffer`](crate::Buffer), a [`HeapRange`](crate::HeapRange) or a
/// [`StagingSlice`](crate::StagingSlice). Sealed.
pub trait DeviceRange: sealed::ToRangeParts {
    /// Device address of the first byte, as shaders use it.
    fn address(&self) -> u64;
    /// Size in bytes.
    fn size(&self) -> u64;
    /// The name it was made with.
    fn name(&self) -> &str;

    /// Lends bytes from an offset on to a function, if the range lies in host memory of a heap
    /// ([`BufferUsage::Shared`](crate::BufferUsage::Shared)); false, and nothing happens, if not. Threads take turns.
    /// Seen by every submission made after this returns; no submission in flight uses these bytes: the caller sees to
    /// that.
    ///
    /// # Errors
    /// [`GpuError::Usage`](crate::GpuError::Usage) when the bytes do not fit the range.
    fn fill(&self, _offset: u64, _bytes: usize, _fill: &mut dyn FnMut(&mut [u8])) -> Result<bool, crate::GpuError> {
        Ok(false)
    }
}

pub(crate) mod sealed {
    /// Where the range really is.
    #[derive(Debug)]
    pub struct RangeParts {
        pub(crate) buffer: ash::vk::Buffer,
        /// First byte of the range in `buffer`.
        pub(crate) offset: u64,
        pub(crate) device: *const crate::device::logical::LogicalDevice,
        pub(crate) kept: crate::submit::kept::HeldResource,
    }

    /// Implemented inside this crate only.
    pub trait ToRangeParts {
        #[doc(hidden)]
        fn parts(&self) -> RangeParts;
    }
}
