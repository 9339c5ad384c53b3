// SPDX-License-Identifier: Apache-2.0
//! An open device of the library. Any thread.

use super::DenoiserError;
use super::library::{self, CANCELLED, CPU, NO_ERROR, OPAQUE_FD, OidnHandle, OidnLibrary};
use std::ffi::{CStr, c_char};
use std::path::Path;

/// A device of the library, and the library itself.
#[derive(Debug)]
pub(super) struct OpenDenoiser {
    pub(super) library: OidnLibrary,
    pub(super) device: OidnHandle,
    /// The library's version and the kind of the device.
    pub(super) name: String,
}

// SAFETY: the library's functions may be called from any thread: it serialises those for one device, and keeps errors
// by thread.
unsafe impl Send for OpenDenoiser {}
// SAFETY: as for Send.
unsafe impl Sync for OpenDenoiser {}

impl OpenDenoiser {
    /// See [`super::DenoiserDevice::open`].
    pub(super) fn new(file: Option<&Path>, uuid: Option<[u8; 16]>) -> Result<Self, DenoiserError> {
        let library = OidnLibrary::load(file).map_err(DenoiserError::Missing)?;
        let on_gpu = uuid.and_then(|uuid| {
            // SAFETY: the pointer is to 16 bytes, which are read at once.
            let device = unsafe { (library.new_device_by_uuid)(uuid.as_ptr().cast()) };
            let is_open = !device.is_null() && commit(&library, device).is_ok();
            if !is_open {
                release(&library, device);
            }
            is_open.then_some(device)
        });
        let device = on_gpu.map_or_else(|| processor(&library), Ok)?;
        let mut opened = Self { library, device, name: String::new() };
        opened.name = opened.describe();
        tracing::debug!(opened.name, file = %opened.library.file.display(), "denoiser opened");
        Ok(opened)
    }

    /// The error of the last call of this thread that may fail, if it did.
    pub(super) fn ok(&self) -> Result<(), DenoiserError> {
        ok(&self.library, self.device)
    }

    /// The handle that a call gave, or why it gave none.
    pub(super) fn made(&self, handle: OidnHandle) -> Result<OidnHandle, DenoiserError> {
        if handle.is_null() { Err(failure(&self.library, self.device)) } else { Ok(handle) }
    }

    /// Returns true if the device is the processor, which reaches all memory of the host.
    pub(super) fn is_processor(&self) -> bool {
        self.number(c"type") == CPU
    }

    /// Returns true if the device imports memory by file descriptors.
    pub(super) fn imports(&self) -> bool {
        self.number(c"externalMemoryTypes") & OPAQUE_FD != 0
    }

    fn number(&self, name: &CStr) -> i32 {
        // SAFETY: the device is alive, and the name ends with a zero.
        unsafe { (self.library.device_int)(self.device, name.as_ptr()) }
    }

    fn describe(&self) -> String {
        let version = self.number(c"version");
        let kind = match self.number(c"type") {
            CPU => "CPU",
            2 => "SYCL",
            3 => "CUDA",
            4 => "HIP",
            _ => "another device",
        };
        format!("Open Image Denoise {}.{}.{}, {kind}", version / 10_000, version / 100 % 100, version % 100)
    }
}

impl Drop for OpenDenoiser {
    fn drop(&mut self) {
        release(&self.library, self.device);
    }
}

/// The device that is the processor.
fn processor(library: &OidnLibrary) -> Result<OidnHandle, DenoiserError> {
    // SAFETY: takes no pointer.
    let device = unsafe { (library.new_device)(CPU) };
    if !device.is_null() {
        // Threads that are bound to cores would wait for those of the host and of other programs.
        // SAFETY: the device is alive, and the name ends with a zero.
        unsafe { (library.set_device_bool)(device, c"setAffinity".as_ptr(), false) };
    }
    let ready = commit(library, device);
    if ready.is_err() {
        release(library, device);
    }
    ready.map(|()| device)
}

/// Makes a new device ready.
fn commit(library: &OidnLibrary, device: OidnHandle) -> Result<(), DenoiserError> {
    if device.is_null() {
        return Err(failure(library, device));
    }
    // SAFETY: the device is alive.
    unsafe { (library.commit_device)(device) };
    ok(library, device)
}

fn release(library: &OidnLibrary, device: OidnHandle) {
    if !device.is_null() {
        // SAFETY: nobody uses the device any more.
        unsafe { (library.release_device)(device) };
    }
}

/// The error that the library has for the device and this thread, if any; it is asked for after every call that may
/// fail.
fn ok(library: &OidnLibrary, device: OidnHandle) -> Result<(), DenoiserError> {
    let mut said: *const c_char = std::ptr::null();
    // SAFETY: the device is alive or null, which asks for the thread's error.
    let code = unsafe { (library.device_error)(device, &raw mut said) };
    match code {
        NO_ERROR => Ok(()),
        CANCELLED => Err(DenoiserError::Cancelled),
        _ => {
            // SAFETY: the library's text stays until this thread's next call for the device.
            Err(DenoiserError::Failed(unsafe { library::text(said) }))
        }
    }
}

/// The error of a call that gave nothing.
fn failure(library: &OidnLibrary, device: OidnHandle) -> DenoiserError {
    ok(library, device).err().unwrap_or_else(|| DenoiserError::Failed("it gives no reason".to_owned()))
}
