// SPDX-License-Identifier: Apache-2.0
//! Ranges of device memory that operations work on; a range can keep its owner alive.
//!
//! [`DeviceRange`] is implemented by [`Buffer`](crate::Buffer), [`HeapRange`](crate::HeapRange) and
//! [`StagingSlice`](crate::StagingSlice) only. Any thread.

/// A range of device memory: a whole [`Buffer`](crate::Buffer), a [`HeapRange`](crate::HeapRange) or a
/// [`StagingSlice`](crate::StagingSlice). Sealed.
pub trait DeviceRange: sealed::ToRangeParts {
    /// Device address of the first byte, as shaders use it.
    fn address(&self) -> u64;
    /// Size in bytes.
    fn size(&self) -> u64;
    /// Name that it was created with.
    fn name(&self) -> &str;

    /// Lends bytes from an offset on to a function, if the range lies in host memory of a heap
    /// ([`BufferUsage::Shared`](crate::BufferUsage::Shared)); otherwise it does nothing and returns false. Threads are
    /// serialised. Every submission made after this returns sees the bytes; the caller ensures that no submission in
    /// flight uses them.
    ///
    /// # Errors
    /// [`GpuError::Usage`](crate::GpuError::Usage) when the bytes do not fit the range.
    fn fill(&self, _offset: u64, _bytes: usize, _fill: &mut dyn FnMut(&mut [u8])) -> Result<bool, crate::GpuError> {
        Ok(false)
    }
}

pub(crate) mod sealed {
    /// Buffer and offset of a range.
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
