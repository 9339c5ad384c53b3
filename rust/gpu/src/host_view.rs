// SPDX-License-Identifier: Apache-2.0
//! Device memory as the host sees it, by device address: for passes that run on the host where the device is a
//! processor, whose memory is the host's.
//!
//! Every look is checked against the bounds of the buffer or arena that the address lies in: an address that is wrong,
//! or an index from a broken tree, finds nothing. What a view gives are copies and atomic words, never references to
//! bytes, so that what a submission writes meanwhile can only make numbers wrong. While a view lives nothing that it
//! sees is destroyed, or given to someone else. Any thread.

use std::marker::PhantomData;
use std::mem::size_of;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use bytemuck::AnyBitPattern;

use crate::buffer::Buffer;
use crate::device::mapped::MappedPointer;
use crate::gpu::Gpu;
use crate::submit::open_device::OpenDevice;

#[derive(Clone, Copy, Debug)]
struct MappedSpan {
    start: u64,
    bytes: u64,
    at: MappedPointer,
    is_written: bool,
}

/// See the module. The caller sees to it that no submission in flight writes what it reads, or uses what it writes.
#[derive(Debug)]
pub struct HostView {
    opened: Arc<OpenDevice>,
    /// In the order of addresses.
    spans: Vec<MappedSpan>,
}

impl Gpu {
    /// Whether [`Gpu::host_view`] gives a view.
    #[must_use]
    pub fn has_host_memory(&self) -> bool {
        self.device().report.host_memory
    }

    /// A view of all memory that there is now. `written` are the buffers that are read and written by words; all others
    /// are read only. None where device memory is not the host's.
    #[must_use]
    pub fn host_view(&self, written: &[&Buffer]) -> Option<HostView> {
        let device = self.device();
        if !device.report.host_memory {
            return None;
        }
        let mut written: Vec<u64> = written.iter().map(|buffer| buffer.address()).collect();
        written.sort_unstable();
        let span = |(start, bytes, at)| {
            let is_written = written.binary_search(&start).is_ok();
            MappedSpan { start, bytes, at, is_written }
        };
        let spans = device.host_memory.look().into_iter().map(span).collect();
        Some(HostView { opened: Arc::clone(self.opened()), spans })
    }
}

impl HostView {
    /// The span that `address` lies in, and how far in it.
    #[inline]
    fn find(&self, address: u64) -> Option<(&MappedSpan, u64)> {
        let after = self.spans.partition_point(|span| span.start <= address);
        let span = self.spans.get(after.checked_sub(1)?)?;
        let offset = address - span.start;
        (offset < span.bytes).then_some((span, offset))
    }

    /// The bytes from `address` to the end of its buffer; none where there is no memory, or where it is written.
    #[inline]
    #[must_use]
    pub fn bytes(&self, address: u64) -> HostBytes<'_> {
        let found = self.find(address).filter(|(span, _)| !span.is_written);
        let (at, bytes) = found.and_then(|(span, offset)| span.rest(offset)).unwrap_or((std::ptr::null_mut(), 0));
        HostBytes { at, bytes, view: PhantomData }
    }

    /// As [`HostView::bytes`], for addresses that mostly lie in the same few buffers: `near` is the one that the last
    /// such call found, and is tried first.
    #[inline(always)]
    #[must_use]
    pub fn bytes_near<'v>(&'v self, address: u64, near: &mut HostSpan<'v>) -> HostBytes<'v> {
        let offset = address.wrapping_sub(near.start);
        if offset >= near.all.bytes as u64 {
            *near = self.span_at(address);
        }
        near.all.from(address.wrapping_sub(near.start))
    }

    /// The buffer that `address` lies in, if it is one that is read.
    #[inline(never)]
    fn span_at(&self, address: u64) -> HostSpan<'_> {
        let found = self.find(address).filter(|(span, _)| !span.is_written);
        found.and_then(|(span, _)| Some((span, span.rest(0)?))).map_or(HostSpan::NONE, |(span, (at, bytes))| HostSpan {
            start: span.start,
            all: HostBytes { at, bytes, view: PhantomData },
        })
    }

    /// The words from `address` to the end of its buffer, which is one of those that are written; else none.
    #[must_use]
    pub fn words(&self, address: u64) -> HostWords<'_> {
        let found = self.find(address).filter(|(span, _)| span.is_written && address.is_multiple_of(4));
        let (at, bytes) = found.and_then(|(span, offset)| span.rest(offset)).unwrap_or((std::ptr::null_mut(), 0));
        let is_aligned = at.cast::<AtomicU32>().is_aligned();
        HostWords { at: at.cast(), count: if is_aligned { bytes / 4 } else { 0 }, view: PhantomData }
    }
}

impl MappedSpan {
    #[inline]
    fn rest(&self, offset: u64) -> Option<(*mut u8, usize)> {
        let bytes = usize::try_from(self.bytes - offset).ok()?;
        let offset = usize::try_from(offset).ok()?;
        // SAFETY: `offset` is less than the span's bytes, which are mapped in one piece.
        Some((unsafe { self.at.as_ptr().add(offset) }, bytes))
    }
}

impl Drop for HostView {
    fn drop(&mut self) {
        // After the last one goes what was retired meanwhile.
        if self.opened.device.host_memory.look_away() {
            self.opened.collect();
        }
    }
}

/// A buffer that is read, whole: what [`HostView::bytes_near`] found last.
#[derive(Clone, Copy, Debug)]
pub struct HostSpan<'v> {
    start: u64,
    all: HostBytes<'v>,
}

impl HostSpan<'_> {
    /// No buffer.
    pub const NONE: Self = Self { start: 0, all: HostBytes::NONE };
}

/// Memory that is read.
#[derive(Clone, Copy, Debug)]
pub struct HostBytes<'v> {
    at: *const u8,
    bytes: usize,
    view: PhantomData<&'v HostView>,
}

// SAFETY: the view keeps the memory, which any thread may read; nothing is lent by reference.
unsafe impl Send for HostBytes<'_> {}
// SAFETY: as for Send.
unsafe impl Sync for HostBytes<'_> {}

impl HostBytes<'_> {
    /// No memory.
    pub const NONE: Self = Self { at: std::ptr::null(), bytes: 0, view: PhantomData };

    /// What is left from byte `offset` on; none behind the end.
    #[inline(always)]
    fn from(self, offset: u64) -> Self {
        let Some(offset) = usize::try_from(offset).ok().filter(|&offset| offset < self.bytes) else {
            return Self::NONE;
        };
        // SAFETY: `offset` is inside the mapped bytes.
        let at = unsafe { self.at.add(offset) };
        Self { at, bytes: self.bytes - offset, view: PhantomData }
    }

    /// Whether there is none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// Asks the processor to bring `count` of `T` near, from the `index`-th on; nothing where they do not fit.
    #[inline(always)]
    pub fn prefetch<T>(&self, index: usize, count: usize) {
        let (Some(at), Some(bytes)) = (index.checked_mul(size_of::<T>()), count.checked_mul(size_of::<T>())) else {
            return;
        };
        if bytes == 0 || bytes > self.bytes || at > self.bytes - bytes {
            return;
        }
        // SAFETY: `at` is inside the mapped bytes.
        prefetch(unsafe { self.at.add(at) }, bytes);
    }

    /// A copy of the `index`-th `T` from here; none where it does not fit.
    #[inline]
    #[must_use]
    pub fn get<T: AnyBitPattern>(&self, index: usize) -> Option<T> {
        self.at_byte(index.checked_mul(size_of::<T>())?)
    }

    /// As [`HostBytes::get`], for the numbers that tables have.
    #[inline(always)]
    #[must_use]
    pub fn item<T: AnyBitPattern>(&self, index: u32) -> Option<T> {
        // Below 2^32 times the size of a `T`: no overflow.
        let end = (u64::from(index) + 1) * size_of::<T>() as u64;
        if end > self.bytes as u64 {
            return None;
        }
        let at = usize::try_from(end).ok()? - size_of::<T>();
        // SAFETY: size_of::<T>() bytes from `at` on are mapped.
        let from = unsafe { self.at.add(at) }.cast::<T>();
        // SAFETY: as in `at_byte`.
        Some(unsafe { from.read_unaligned() })
    }

    /// A copy of the `T` that begins at byte `at` from here; none where it does not fit.
    #[inline]
    #[must_use]
    pub fn at_byte<T: AnyBitPattern>(&self, at: usize) -> Option<T> {
        // `at` is below `bytes`, which is at most isize::MAX: no overflow.
        if at >= self.bytes || self.bytes - at < size_of::<T>() {
            return None;
        }
        // SAFETY: `at` is inside the mapped bytes.
        let from = unsafe { self.at.add(at) }.cast::<T>();
        // SAFETY: size_of::<T>() bytes from there are mapped, any bits are a T, and no host thread writes them: a view
        // reads only what it does not write. A submission that does so in spite of the contract makes wrong numbers.
        Some(unsafe { from.read_unaligned() })
    }
}

/// Asks the processor to bring bytes near, one at least.
#[inline(always)]
fn prefetch(at: *const u8, bytes: usize) {
    #[cfg(target_arch = "x86_64")]
    {
        use std::arch::x86_64::{_MM_HINT_T0, _mm_prefetch};
        /// Bytes of a line of the caches of all processors that there is a prefetch for here.
        const LINE: usize = 64;
        let mut byte = 0;
        while byte < bytes {
            // SAFETY: SSE is part of x86-64, and a prefetch reads nothing that a program sees, wherever it points.
            unsafe { _mm_prefetch::<_MM_HINT_T0>(at.wrapping_add(byte).cast()) };
            byte += LINE;
        }
        // What they end with, where they do not begin with a line.
        // SAFETY: as above.
        unsafe { _mm_prefetch::<_MM_HINT_T0>(at.wrapping_add(bytes - 1).cast()) };
    }
}

/// Memory that is read and written, word by word; each word is atomic.
#[derive(Clone, Copy, Debug)]
pub struct HostWords<'v> {
    at: *const AtomicU32,
    count: usize,
    view: PhantomData<&'v HostView>,
}

// SAFETY: the view keeps the memory, whose words are used as atomics alone.
unsafe impl Send for HostWords<'_> {}
// SAFETY: as for Send.
unsafe impl Sync for HostWords<'_> {}

impl HostWords<'_> {
    #[inline]
    fn word(&self, index: usize) -> Option<&AtomicU32> {
        if index >= self.count {
            return None;
        }
        // SAFETY: `index` is inside the mapped words.
        let at = unsafe { self.at.add(index) };
        // SAFETY: the word is mapped and aligned, the view keeps it, and host threads use it as an atomic alone.
        Some(unsafe { &*at })
    }

    /// Asks the processor to bring `count` words near; nothing where they do not fit.
    #[inline(always)]
    pub fn prefetch(&self, index: usize, count: usize) {
        if count > 0 && count <= self.count && index <= self.count - count {
            // SAFETY: `index` is inside the mapped words.
            prefetch(unsafe { self.at.add(index) }.cast(), 4 * count);
        }
    }

    /// A word; 0 where there is none.
    #[inline]
    #[must_use]
    pub fn load(&self, index: usize) -> u32 {
        self.word(index).map_or(0, |word| word.load(Ordering::Relaxed))
    }

    /// `N` words; zeros where not all of them are there.
    #[inline(always)]
    #[must_use]
    pub fn load_all<const N: usize>(&self, index: usize) -> [u32; N] {
        let mut words = [0; N];
        if N <= self.count && index <= self.count - N {
            for (i, word) in words.iter_mut().enumerate() {
                *word = self.load(index + i);
            }
        }
        words
    }

    /// Writes a word; false where there is none.
    #[inline]
    pub fn store(&self, index: usize, value: u32) -> bool {
        self.word(index).map(|word| word.store(value, Ordering::Relaxed)).is_some()
    }

    /// Adds to a word, and gives what it was.
    #[inline]
    #[must_use]
    pub fn add(&self, index: usize, value: u32) -> Option<u32> {
        self.word(index).map(|word| word.fetch_add(value, Ordering::Relaxed))
    }

    /// Sets bits of a word, and gives what it was. Other threads that do so see what this one wrote before.
    #[inline]
    #[must_use]
    pub fn or(&self, index: usize, bits: u32) -> Option<u32> {
        self.word(index).map(|word| word.fetch_or(bits, Ordering::AcqRel))
    }
}
