// SPDX-License-Identifier: Apache-2.0
//! Where mapped memory lies. Any thread.

use std::ptr::NonNull;

/// The address of mapped memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mapped(pub(crate) NonNull<u8>);

// SAFETY: a mapped address may be used from any thread; who may access the bytes when is decided by the owner (`Buffer`
// locks).
unsafe impl Send for Mapped {}
// SAFETY: as for Send: sharing the address gives no access by itself.
unsafe impl Sync for Mapped {}

impl Mapped {
    pub(crate) fn as_ptr(self) -> *mut u8 {
        self.0.as_ptr()
    }
}
