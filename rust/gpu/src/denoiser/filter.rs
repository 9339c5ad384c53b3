// SPDX-License-Identifier: Apache-2.0
//! Filters of the library and the buffers that they read and write. Any thread.

use super::library::{DEVICE_STORAGE, FLOAT3, OidnHandle};
use super::opened::OpenDenoiser;
use super::{DenoiseOptions, DenoiseQuality, DenoiserError, FloatImage};
use std::ffi::{CStr, c_int, c_void};
use std::mem::size_of;
use std::sync::Arc;

/// What runs a filter.
pub(super) struct FilterWork<'a> {
    /// Whether it is to go on.
    pub(super) goes_on: &'a dyn Fn() -> bool,
}

/// Asks the caller whether the filter goes on.
unsafe extern "C" fn monitor(user: *mut c_void, _progress: f64) -> bool {
    // SAFETY: `run` gives the filter a pointer to its `FilterWork`, and takes it back.
    let work = unsafe { &*user.cast::<FilterWork<'_>>() };
    // A panic must not cross the library.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work.goes_on)).unwrap_or(false)
}

/// A filter of the library that is ready to run, released when dropped. It keeps its buffers.
#[derive(Debug)]
pub(super) struct OidnFilter {
    opened: Arc<OpenDenoiser>,
    filter: OidnHandle,
}

// SAFETY: as for the device.
unsafe impl Send for OidnFilter {}

impl OidnFilter {
    /// The filters of a picture, in their order: `color` is filtered in place, guided by `guides`, albedo and normals.
    /// For the highest quality these are filtered before, into `clean`, which may be the same.
    pub(super) fn of_picture(
        opened: &Arc<OpenDenoiser>,
        (color, guides, clean): (OidnImage<'_>, [OidnImage<'_>; 2], [OidnImage<'_>; 2]),
        size: [usize; 2],
        options: DenoiseOptions,
    ) -> Result<Vec<Self>, DenoiserError> {
        let is_clean = options.quality == DenoiseQuality::High;
        let mut filters = Vec::with_capacity(3);
        if is_clean {
            for (name, guide, clean) in [(c"albedo", guides[0], clean[0]), (c"normal", guides[1], clean[1])] {
                filters.push(Self::new(opened, &[(name, guide), (c"output", clean)], &[], size, options)?);
            }
        }
        let [albedo, normal] = if is_clean { clean } else { guides };
        let images = [(c"color", color), (c"albedo", albedo), (c"normal", normal), (c"output", color)];
        let flags = [(c"hdr", true), (c"cleanAux", is_clean)];
        filters.push(Self::new(opened, &images, &flags, size, options)?);
        Ok(filters)
    }

    fn new(
        opened: &Arc<OpenDenoiser>,
        images: &[(&CStr, OidnImage<'_>)],
        flags: &[(&CStr, bool)],
        size: [usize; 2],
        options: DenoiseOptions,
    ) -> Result<Self, DenoiserError> {
        let library = &opened.library;
        // SAFETY: the device is alive, and the name ends with a zero.
        let filter = opened.made(unsafe { (library.new_filter)(opened.device, c"RT".as_ptr()) })?;
        let filter = Self { opened: Arc::clone(opened), filter };
        for (name, image) in images {
            filter.image(name, *image, size)?;
        }
        for (name, value) in flags {
            // SAFETY: the filter is alive, and the name ends with a zero.
            unsafe { (library.set_filter_bool)(filter.filter, name.as_ptr(), *value) };
        }
        filter.int(c"quality", options.quality as c_int);
        if let Some(mib) = options.most_mib {
            filter.int(c"maxMemoryMB", c_int::try_from(mib).unwrap_or(c_int::MAX));
        }
        // SAFETY: the filter and its images are alive.
        unsafe { (library.commit_filter)(filter.filter) };
        opened.ok()?;
        Ok(filter)
    }

    fn image(&self, name: &CStr, image: OidnImage<'_>, [width, height]: [usize; 2]) -> Result<(), DenoiserError> {
        let OidnImage { buffer, floats } = image;
        let stride = floats * size_of::<f32>();
        let bytes = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(stride));
        if floats < 3 || bytes.is_none_or(|bytes| bytes > buffer.bytes) {
            return Err(DenoiserError::Size(buffer.bytes / size_of::<f32>(), width, height));
        }
        let set = self.opened.library.set_filter_image;
        // SAFETY: filter and buffer are alive, the buffer has such pixels, and the name ends with a zero. A stride of 0
        // is that of rows without gaps.
        unsafe { set(self.filter, name.as_ptr(), buffer.handle, FLOAT3, width, height, 0, stride, 0) };
        Ok(())
    }

    fn int(&self, name: &CStr, value: c_int) {
        // SAFETY: the filter is alive, and the name ends with a zero.
        unsafe { (self.opened.library.set_filter_int)(self.filter, name.as_ptr(), value) };
    }

    /// Runs the filter, and returns when it is done.
    pub(super) fn run(&self, work: &FilterWork<'_>) -> Result<(), DenoiserError> {
        let library = &self.opened.library;
        let user: *const FilterWork<'_> = work;
        // SAFETY: the filter calls back while it runs, and `work` outlives that.
        unsafe { (library.set_filter_monitor)(self.filter, Some(monitor), user.cast_mut().cast()) };
        // SAFETY: the filter and its images are alive.
        unsafe { (library.execute_filter)(self.filter) };
        // SAFETY: the device is alive.
        unsafe { (library.sync_device)(self.opened.device) };
        // SAFETY: nothing is called back any more.
        unsafe { (library.set_filter_monitor)(self.filter, None, std::ptr::null_mut()) };
        self.opened.ok()
    }
}

impl Drop for OidnFilter {
    fn drop(&mut self) {
        // SAFETY: nobody else has the handle.
        unsafe { (self.opened.library.release_filter)(self.filter) };
    }
}

/// An image at the start of a buffer: rows without gaps, of pixels of so many floats, of which three count.
#[derive(Clone, Copy, Debug)]
pub(super) struct OidnImage<'a> {
    pub(super) buffer: &'a OidnBuffer,
    floats: usize,
}

/// A buffer of the library, released when dropped.
#[derive(Debug)]
pub(super) struct OidnBuffer {
    opened: Arc<OpenDenoiser>,
    handle: OidnHandle,
    bytes: usize,
}

// SAFETY: as for the device.
unsafe impl Send for OidnBuffer {}

impl OidnBuffer {
    /// Takes over what a call made.
    pub(super) fn own(opened: &Arc<OpenDenoiser>, handle: OidnHandle, bytes: usize) -> Result<Self, DenoiserError> {
        let handle = opened.made(handle)?;
        let buffer = Self { opened: Arc::clone(opened), handle, bytes };
        opened.ok().map(|()| buffer)
    }

    /// New memory of the device, which the host cannot reach.
    pub(super) fn on_device(opened: &Arc<OpenDenoiser>, bytes: usize) -> Result<Self, DenoiserError> {
        // SAFETY: the device is alive.
        let handle = unsafe { (opened.library.new_buffer_with_storage)(opened.device, bytes, DEVICE_STORAGE) };
        Self::own(opened, handle, bytes)
    }

    /// A copy of an image, which has been checked: three floats a pixel.
    pub(super) fn copy_of(opened: &Arc<OpenDenoiser>, image: FloatImage<'_>) -> Result<Self, DenoiserError> {
        let packed: Vec<f32> = image.floats.chunks_exact(image.stride).flat_map(|pixel| &pixel[..3]).copied().collect();
        let bytes = size_of_val(&packed[..]);
        // SAFETY: the device is alive.
        let buffer = Self::own(opened, unsafe { (opened.library.new_buffer)(opened.device, bytes) }, bytes)?;
        // SAFETY: both have so many bytes.
        unsafe { (opened.library.write_buffer)(buffer.handle, 0, bytes, packed.as_ptr().cast()) };
        opened.ok()?;
        Ok(buffer)
    }

    /// The image of the buffer whose pixels have so many floats.
    pub(super) fn image(&self, floats: usize) -> OidnImage<'_> {
        OidnImage { buffer: self, floats }
    }

    /// Copies so many pixels of three floats to the first three floats of every `stride`.
    pub(super) fn read(&self, pixels: usize, out: &mut [f32], stride: usize) -> Result<(), DenoiserError> {
        let mut packed = vec![0.0_f32; (3 * pixels).min(self.bytes / size_of::<f32>())];
        let bytes = size_of_val(&packed[..]);
        // SAFETY: both have so many bytes.
        unsafe { (self.opened.library.read_buffer)(self.handle, 0, bytes, packed.as_mut_ptr().cast()) };
        self.opened.ok()?;
        for (out, pixel) in out.chunks_exact_mut(stride).zip(packed.chunks_exact(3)) {
            out[..3].copy_from_slice(pixel);
        }
        Ok(())
    }
}

impl Drop for OidnBuffer {
    fn drop(&mut self) {
        // SAFETY: nobody else has the handle; filters that use the buffer keep it.
        unsafe { (self.opened.library.release_buffer)(self.handle) };
    }
}
