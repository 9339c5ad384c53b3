// SPDX-License-Identifier: Apache-2.0
//! Where mapped memory lies. Any thread.

use std::ptr::NonNull;

/// The address of mapped memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MappedPointer(pub(crate) NonNull<u8>);

// SAFETY: a mapped address may be used from any thread; who may access the bytes when is decided by the owner (`Buffer`
// locks).
unsafe impl Send for MappedPointer {}
// SAFETY: as for Send: sharing the address gives no access by itself.
unsafe impl Sync for MappedPointer {}

impl MappedPointer {
    pub(crate) fn as_ptr(self) -> *mut u8 {
        self.0.as_ptr()
    }
}
