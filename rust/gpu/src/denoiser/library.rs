// SPDX-License-Identifier: Apache-2.0
//! The functions of Open Image Denoise 2, loaded at run time: the renderer neither ships nor needs the library.
//!
//! Names, types and numbers are those of its C interface (`OpenImageDenoise/oidn.h`), which is stable within 2.x.

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::{Path, PathBuf};

/// Handles of the library: a device, a filter, a buffer.
pub(super) type OidnHandle = *mut c_void;

/// Decides from time to time whether the filter goes on; the number is its progress from 0 to 1.
pub(super) type ProgressMonitor = unsafe extern "C" fn(*mut c_void, f64) -> bool;

/// `OIDN_DEVICE_TYPE_CPU`.
pub(super) const CPU: c_int = 1;
/// `OIDN_FORMAT_FLOAT3`.
pub(super) const FLOAT3: c_int = 3;
/// `OIDN_STORAGE_DEVICE`: memory of the device, which the host cannot reach.
pub(super) const DEVICE_STORAGE: c_int = 2;
/// `OIDN_EXTERNAL_MEMORY_TYPE_FLAG_OPAQUE_FD`.
pub(super) const OPAQUE_FD: c_int = 1;
/// `OIDN_ERROR_NONE`.
pub(super) const NO_ERROR: c_int = 0;
/// `OIDN_ERROR_CANCELLED`.
pub(super) const CANCELLED: c_int = 6;

/// File names of the library where nobody names another: that of a host which has loaded it, and of the system.
const NAMES: [&str; 2] = ["libOpenImageDenoise.so.2", "libOpenImageDenoise.so"];

macro_rules! functions {
    ($($name:ident: $symbol:literal, fn($($type:ty),*) $(-> $result:ty)?;)+) => {
        /// The functions that are used.
        #[derive(Debug)]
        pub(super) struct OidnLibrary {
            $(pub(super) $name: unsafe extern "C" fn($($type),*) $(-> $result)?,)+
            /// The file, for messages.
            pub(super) file: PathBuf,
            /// Keeps the code of the functions in memory; dropped last.
            _library: libloading::Library,
        }

        impl OidnLibrary {
            fn from_loaded(library: libloading::Library, file: PathBuf) -> Result<Self, libloading::Error> {
                Ok(Self {
                    $($name: {
                        // SAFETY: the type is that of the function in the library's C interface.
                        let symbol = unsafe {
                            library.get::<unsafe extern "C" fn($($type),*) $(-> $result)?>($symbol)
                        }?;
                        *symbol
                    },)+
                    file,
                    _library: library,
                })
            }
        }
    };
}

functions! {
    new_device: b"oidnNewDevice\0", fn(c_int) -> OidnHandle;
    new_device_by_uuid: b"oidnNewDeviceByUUID\0", fn(*const c_void) -> OidnHandle;
    commit_device: b"oidnCommitDevice\0", fn(OidnHandle);
    release_device: b"oidnReleaseDevice\0", fn(OidnHandle);
    device_error: b"oidnGetDeviceError\0", fn(OidnHandle, *mut *const c_char) -> c_int;
    device_int: b"oidnGetDeviceInt\0", fn(OidnHandle, *const c_char) -> c_int;
    set_device_bool: b"oidnSetDeviceBool\0", fn(OidnHandle, *const c_char, bool);
    new_buffer: b"oidnNewBuffer\0", fn(OidnHandle, usize) -> OidnHandle;
    new_buffer_with_storage: b"oidnNewBufferWithStorage\0", fn(OidnHandle, usize, c_int) -> OidnHandle;
    new_shared_buffer: b"oidnNewSharedBuffer\0", fn(OidnHandle, *mut c_void, usize) -> OidnHandle;
    new_shared_buffer_from_fd: b"oidnNewSharedBufferFromFD\0", fn(OidnHandle, c_int, c_int, usize) -> OidnHandle;
    sync_device: b"oidnSyncDevice\0", fn(OidnHandle);
    read_buffer: b"oidnReadBuffer\0", fn(OidnHandle, usize, usize, *mut c_void);
    write_buffer: b"oidnWriteBuffer\0", fn(OidnHandle, usize, usize, *const c_void);
    release_buffer: b"oidnReleaseBuffer\0", fn(OidnHandle);
    new_filter: b"oidnNewFilter\0", fn(OidnHandle, *const c_char) -> OidnHandle;
    set_filter_image: b"oidnSetFilterImage\0",
        fn(OidnHandle, *const c_char, OidnHandle, c_int, usize, usize, usize, usize, usize);
    set_filter_bool: b"oidnSetFilterBool\0", fn(OidnHandle, *const c_char, bool);
    set_filter_int: b"oidnSetFilterInt\0", fn(OidnHandle, *const c_char, c_int);
    set_filter_monitor: b"oidnSetFilterProgressMonitorFunction\0", fn(OidnHandle, Option<ProgressMonitor>, *mut c_void);
    commit_filter: b"oidnCommitFilter\0", fn(OidnHandle);
    execute_filter: b"oidnExecuteFilter\0", fn(OidnHandle);
    release_filter: b"oidnReleaseFilter\0", fn(OidnHandle);
}

impl OidnLibrary {
    /// Loads the library from `file`, or from where the system looks for it. The error says what was tried.
    pub(super) fn load(file: Option<&Path>) -> Result<Self, String> {
        let files: Vec<PathBuf> =
            file.map_or_else(|| NAMES.iter().map(PathBuf::from).collect(), |file| vec![file.to_path_buf()]);
        let mut said = String::new();
        for file in files {
            // SAFETY: loading runs the library's initialisers; it is a well-known one that the user has installed or
            // named, as a Vulkan driver is.
            let loaded = unsafe { libloading::Library::new(&file) };
            match loaded.and_then(|library| Self::from_loaded(library, file)) {
                Ok(library) => return Ok(library),
                Err(error) if said.is_empty() => said = error.to_string(),
                Err(_) => {}
            }
        }
        Err(said)
    }
}

/// The text that the library points to.
///
/// # Safety
/// `text` is null or ends with a zero, and stays as it is meanwhile.
pub(super) unsafe fn text(text: *const c_char) -> String {
    if text.is_null() {
        return String::new();
    }
    // SAFETY: the caller's promise.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}
