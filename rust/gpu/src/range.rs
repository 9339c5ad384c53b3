// SPDX-License-Identifier: Apache-2.0
//! What operations work on: a stretch of device memory with an owner that can be kept alive.
//!
//! [`DeviceRange`] is implemented by [`Buffer`](crate::Buffer), [`HeapRange`](crate::HeapRange) and
//! [`StagingSlice`](crate::StagingSlice) only. Any thread.

/// A stretch of device memory: a whole [`Buffer`](crate::Buffer), a [`HeapRange`](crate::HeapRange) or a
/// [`StagingSlice`](crate::StagingSlice). Sealed.
pub trait DeviceRange: sealed::Parts {
    /// Device address of the first byte, as shaders use it.
    fn address(&self) -> u64;
    /// Size in bytes.
    fn size(&self) -> u64;
    /// The name it was made with.
    fn name(&self) -> &str;
}

pub(crate) mod sealed {
    /// Where the range really is.
    #[derive(Debug)]
    pub struct RangeParts {
        pub(crate) buffer: ash::vk::Buffer,
        /// First byte of the range in `buffer`.
        pub(crate) offset: u64,
        pub(crate) device: *const crate::device::Device,
        pub(crate) kept: crate::kept::Kept,
    }

    /// Implemented inside this crate only.
    pub trait Parts {
        #[doc(hidden)]
        fn parts(&self) -> RangeParts;
    }
}
