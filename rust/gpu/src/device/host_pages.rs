// SPDX-License-Identifier: Apache-2.0
//! Pages of this process that are lent to a driver: it pins them several times faster than it allocates memory of its
//! own, and several threads touch them before. Linux only; elsewhere there are none. Any thread.

use std::ptr::NonNull;

use crate::device::mapped::MappedPointer;

/// Pages, as plain parts: the owner of the last copy frees them exactly once.
#[derive(Clone, Copy, Debug)]
pub(crate) struct HostPages {
    pub(crate) at: MappedPointer,
    bytes: usize,
}

/// Bytes for which it pays to use another thread for touching.
const TOUCHED_AT_ONCE: usize = 16 << 20;
/// Largest number of threads that touch pages, including the caller's.
const MAX_THREADS: usize = 4;

#[cfg(target_os = "linux")]
mod system {
    use rustix::mm::{Advice, MapFlags, ProtFlags, madvise, mmap_anonymous, munmap};
    use std::ffi::c_void;

    pub(super) fn map(bytes: usize) -> Option<*mut c_void> {
        let flags = ProtFlags::READ | ProtFlags::WRITE;
        // SAFETY: no address is asked for, so nothing that is there is mapped over.
        let at = unsafe { mmap_anonymous(std::ptr::null_mut(), bytes, flags, MapFlags::PRIVATE) }.ok()?;
        // A child that shares pinned pages would be given them, and this process others, which the device does not see.
        // SAFETY: the pages were just mapped, and nobody uses them.
        let is_own = unsafe { madvise(at, bytes, Advice::LinuxDontFork) };
        if is_own.is_err() {
            unmap(at, bytes);
            return None;
        }
        // Large pages are touched and pinned faster; where there are none, small ones do.
        // SAFETY: as above.
        if let Err(error) = unsafe { madvise(at, bytes, Advice::LinuxHugepage) } {
            tracing::trace!(%error, "no large pages");
        }
        Some(at)
    }

    /// Makes the kernel allocate these pages; older kernels do so when the pages are written.
    pub(super) fn touch(at: *mut c_void, bytes: usize) {
        // SAFETY: the caller's own pages; they keep what is in them.
        if let Err(error) = unsafe { madvise(at, bytes, Advice::LinuxPopulateWrite) } {
            tracing::trace!(%error, "pages are made when they are written");
        }
    }

    pub(super) fn unmap(at: *mut c_void, bytes: usize) {
        // SAFETY: exactly what `map` made, and the caller says that nobody uses it.
        if let Err(error) = unsafe { munmap(at, bytes) } {
            tracing::warn!(%error, "munmap failed");
        }
    }
}

#[cfg(not(target_os = "linux"))]
mod system {
    use std::ffi::c_void;

    pub(super) fn map(_bytes: usize) -> Option<*mut c_void> {
        None
    }

    pub(super) fn touch(_at: *mut c_void, _bytes: usize) {}

    pub(super) fn unmap(_at: *mut c_void, _bytes: usize) {}
}

impl HostPages {
    /// Alignment of sizes: no system that we support has larger pages.
    pub(crate) const GRANULE: u64 = 64 << 10;

    /// Pages of `bytes`, a multiple of [`Self::GRANULE`], filled with zeros. `None` if the system has none.
    pub(crate) fn new(bytes: usize) -> Option<Self> {
        let at = system::map(bytes)?;
        let pages = Self { at: MappedPointer(NonNull::new(at.cast())?), bytes };
        pages.touch();
        Some(pages)
    }

    fn touch(self) {
        let threads = (self.bytes / TOUCHED_AT_ONCE).clamp(1, MAX_THREADS);
        let part = self.bytes.div_ceil(threads).next_multiple_of(TOUCHED_AT_ONCE);
        std::thread::scope(|scope| {
            for start in (0..self.bytes).step_by(part).skip(1) {
                let make = move || self.touch_part(start, part);
                if std::thread::Builder::new().spawn_scoped(scope, make).is_err() {
                    return;
                }
            }
            self.touch_part(0, part);
        });
    }

    fn touch_part(self, start: usize, bytes: usize) {
        let bytes = bytes.min(self.bytes - start);
        system::touch(self.at.as_ptr().wrapping_add(start).cast(), bytes);
    }

    /// Frees the pages. No user is left, including the device, and no other copy is used later.
    pub(crate) fn free(self) {
        system::unmap(self.at.as_ptr().cast(), self.bytes);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn pages_hold_zeros_and_take_bytes() {
        for bytes in [1 << 16, TOUCHED_AT_ONCE + (1 << 16), 5 * TOUCHED_AT_ONCE] {
            let pages = HostPages::new(bytes).expect("pages");
            // SAFETY: the pages are this test's own, and of that size.
            let all = unsafe { std::slice::from_raw_parts_mut(pages.at.as_ptr(), bytes) };
            assert!(all.iter().all(|byte| *byte == 0), "{bytes}");
            all[bytes - 1] = 7;
            assert_eq!((all[0], all[bytes - 1]), (0, 7));
            pages.free();
        }
        assert!(HostPages::new(usize::MAX >> 16 << 16).is_none(), "more than there is");
    }
}
