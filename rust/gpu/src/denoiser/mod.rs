// SPDX-License-Identifier: Apache-2.0
//! Open Image Denoise made safe: a filter for noisy pictures, on the processor or on a GPU, loaded at run time.
//!
//! A [`DenoiserDevice`] holds a device of the library. Images are rows of 32-bit floats in host memory; on a GPU they
//! are copied there and back. One thread at a time.

mod library;

use library::{CANCELLED, CPU, FLOAT3, NO_ERROR, OidnHandle, OidnLibrary};
use std::ffi::{CStr, c_char, c_int, c_void};
use std::mem::size_of;
use std::path::Path;

/// The reasons why a picture is not denoised.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DenoiserError {
    /// The library cannot be loaded; the text is the loader's.
    #[error("Open Image Denoise 2 is not there ({0})")]
    Missing(String),
    /// The library refuses its task; the text is its own.
    #[error("Open Image Denoise: {0}")]
    Failed(String),
    /// An image has fewer numbers than its size says, or none.
    #[error("{0} floats are no image of {1} x {2}")]
    Size(usize, usize, usize),
    /// The caller wanted no more of it.
    #[error("denoising was given up")]
    Cancelled,
}

/// How much work is spent on a picture (`OIDN_QUALITY_*`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DenoiseQuality {
    /// For pictures on the way.
    Fast = 4,
    /// For the last one.
    High = 6,
}

/// Three floats of each pixel of an image: the first of every `stride`.
#[derive(Clone, Copy, Debug)]
pub struct FloatImage<'a> {
    /// Row after row, without gaps.
    pub floats: &'a [f32],
    /// Floats of a pixel, at least 3.
    pub stride: usize,
}

/// A picture to be denoised, and what guides the filter.
#[derive(Clone, Copy, Debug)]
pub struct NoisyPicture<'a> {
    /// Columns and rows of each image.
    pub size: [usize; 2],
    /// Linear light without upper bound.
    pub color: FloatImage<'a>,
    /// Reflectances of what is seen, from 0 to 1.
    pub albedo: FloatImage<'a>,
    /// Normals of what is seen, from -1 to 1.
    pub normal: FloatImage<'a>,
}

/// A device of the library.
#[derive(Debug)]
pub struct DenoiserDevice {
    library: OidnLibrary,
    device: OidnHandle,
    name: String,
}

// SAFETY: the library's functions may be called from any thread, one at a time for each device: every method that calls
// one takes `&mut self`.
unsafe impl Send for DenoiserDevice {}

impl DenoiserDevice {
    /// Loads the library, from `file` if one is named, and opens its device for the GPU whose UUID is given
    /// (`VkPhysicalDeviceIDProperties::deviceUUID`), or the processor if that is none of the library's.
    ///
    /// # Errors
    /// [`DenoiserError::Missing`], [`DenoiserError::Failed`].
    pub fn open(file: Option<&Path>, uuid: Option<[u8; 16]>) -> Result<Self, DenoiserError> {
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
        let name = name(&library, device);
        tracing::debug!(name, file = %library.file.display(), "denoiser opened");
        Ok(Self { library, device, name })
    }

    /// The library's version and the kind of its device.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Denoises a picture into `out`, rows of `stride` floats a pixel of which the first three are written. For
    /// [`DenoiseQuality::High`] its guides are denoised first. The filter keeps its memory within `mib`, if given.
    /// `goes_on` is asked from time to time.
    ///
    /// # Errors
    /// [`DenoiserError`]; `out` may have been written in parts.
    pub fn denoise(
        &mut self,
        picture: &NoisyPicture<'_>,
        (out, stride): (&mut [f32], usize),
        (quality, mib): (DenoiseQuality, Option<u32>),
        goes_on: &dyn Fn() -> bool,
    ) -> Result<(), DenoiserError> {
        let size = picture.size;
        for image in [picture.color, picture.albedo, picture.normal, FloatImage { floats: out, stride }] {
            check(image, size)?;
        }
        let color = DeviceImage::of(self, picture.color, size)?;
        let albedo = DeviceImage::of(self, picture.albedo, size)?;
        let normal = DeviceImage::of(self, picture.normal, size)?;
        let work = FilterWork { quality, mib, goes_on };
        let is_clean = quality == DenoiseQuality::High;
        if is_clean {
            for (name, image) in [(c"albedo", &albedo), (c"normal", &normal)] {
                self.run(&[(name, image), (c"output", image)], &[], &work)?;
            }
        }
        let images = [(c"color", &color), (c"albedo", &albedo), (c"normal", &normal), (c"output", &color)];
        self.run(&images, &[(c"hdr", true), (c"cleanAux", is_clean)], &work)?;
        color.read(out, stride)
    }

    /// Runs one filter over images.
    fn run(
        &self,
        images: &[(&CStr, &DeviceImage<'_>)],
        flags: &[(&CStr, bool)],
        work: &FilterWork<'_>,
    ) -> Result<(), DenoiserError> {
        let library = &self.library;
        // SAFETY: the device is alive, and the name ends with a zero.
        let filter = unsafe { (library.new_filter)(self.device, c"RT".as_ptr()) };
        if filter.is_null() {
            return Err(failure(library, self.device));
        }
        let filter = OidnFilter { library, filter };
        for (name, image) in images {
            filter.image(name, image);
        }
        for (name, value) in flags {
            // SAFETY: the filter is alive, and the name ends with a zero.
            unsafe { (library.set_filter_bool)(filter.filter, name.as_ptr(), *value) };
        }
        filter.int(c"quality", work.quality as c_int);
        if let Some(mib) = work.mib {
            filter.int(c"maxMemoryMB", c_int::try_from(mib).unwrap_or(c_int::MAX));
        }
        let user: *const FilterWork<'_> = work;
        // SAFETY: the filter calls back while it runs, and `work` outlives it.
        unsafe { (library.set_filter_monitor)(filter.filter, monitor, user.cast_mut().cast()) };
        // SAFETY: the filter and its images are alive.
        unsafe { (library.commit_filter)(filter.filter) };
        ok(library, self.device)?;
        // SAFETY: as above; it returns when the filter is done.
        unsafe { (library.execute_filter)(filter.filter) };
        ok(library, self.device)
    }
}

impl Drop for DenoiserDevice {
    fn drop(&mut self) {
        release(&self.library, self.device);
    }
}

/// How a filter is to work.
struct FilterWork<'a> {
    quality: DenoiseQuality,
    mib: Option<u32>,
    goes_on: &'a dyn Fn() -> bool,
}

/// Asks the caller whether the filter goes on.
unsafe extern "C" fn monitor(user: *mut c_void, _progress: f64) -> bool {
    // SAFETY: `run` gives the filter a pointer to its `FilterWork`, which outlives the filter.
    let work = unsafe { &*user.cast::<FilterWork<'_>>() };
    // A panic must not cross the library.
    std::panic::catch_unwind(std::panic::AssertUnwindSafe(work.goes_on)).unwrap_or(false)
}

/// A filter of the library, released when dropped.
struct OidnFilter<'a> {
    library: &'a OidnLibrary,
    filter: OidnHandle,
}

impl OidnFilter<'_> {
    fn image(&self, name: &CStr, image: &DeviceImage<'_>) {
        let [width, height] = image.size;
        // SAFETY: filter and buffer are alive, the buffer has three floats for each pixel, and the name ends with a
        // zero. Strides of 0 are those of rows and pixels without gaps.
        unsafe {
            (self.library.set_filter_image)(self.filter, name.as_ptr(), image.buffer, FLOAT3, width, height, 0, 0, 0);
        }
    }

    fn int(&self, name: &CStr, value: c_int) {
        // SAFETY: the filter is alive, and the name ends with a zero.
        unsafe { (self.library.set_filter_int)(self.filter, name.as_ptr(), value) };
    }
}

impl Drop for OidnFilter<'_> {
    fn drop(&mut self) {
        // SAFETY: nobody else has the handle.
        unsafe { (self.library.release_filter)(self.filter) };
    }
}

/// An image in memory of the library's device: three floats a pixel, without gaps.
struct DeviceImage<'a> {
    library: &'a OidnLibrary,
    device: OidnHandle,
    buffer: OidnHandle,
    size: [usize; 2],
}

impl<'a> DeviceImage<'a> {
    /// A copy of `image`, which has been checked.
    fn of(denoiser: &'a DenoiserDevice, image: FloatImage<'_>, size: [usize; 2]) -> Result<Self, DenoiserError> {
        let (library, device) = (&denoiser.library, denoiser.device);
        let packed: Vec<f32> = image.floats.chunks_exact(image.stride).flat_map(|pixel| &pixel[..3]).copied().collect();
        let bytes = packed.len() * size_of::<f32>();
        // SAFETY: the device is alive.
        let buffer = unsafe { (library.new_buffer)(device, bytes) };
        if buffer.is_null() {
            return Err(failure(library, device));
        }
        let copy = Self { library, device, buffer, size };
        // SAFETY: both have so many bytes.
        unsafe { (library.write_buffer)(buffer, 0, bytes, packed.as_ptr().cast()) };
        ok(library, device)?;
        Ok(copy)
    }

    /// Copies the image to the first three floats of every `stride`.
    fn read(&self, out: &mut [f32], stride: usize) -> Result<(), DenoiserError> {
        let [width, height] = self.size;
        let mut packed = vec![0.0_f32; width * height * 3];
        // SAFETY: both have so many bytes.
        unsafe { (self.library.read_buffer)(self.buffer, 0, size_of_val(&packed[..]), packed.as_mut_ptr().cast()) };
        ok(self.library, self.device)?;
        for (out, pixel) in out.chunks_exact_mut(stride).zip(packed.chunks_exact(3)) {
            out[..3].copy_from_slice(pixel);
        }
        Ok(())
    }
}

impl Drop for DeviceImage<'_> {
    fn drop(&mut self) {
        // SAFETY: nobody else has the handle, and filters that used it are released.
        unsafe { (self.library.release_buffer)(self.buffer) };
    }
}

/// Whether an image has the numbers that its size says.
fn check(image: FloatImage<'_>, [width, height]: [usize; 2]) -> Result<(), DenoiserError> {
    let floats = width.checked_mul(height).and_then(|pixels| pixels.checked_mul(image.stride));
    let is_whole = image.stride >= 3 && !image.floats.is_empty() && floats == Some(image.floats.len());
    if is_whole { Ok(()) } else { Err(DenoiserError::Size(image.floats.len(), width, height)) }
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

/// The error that the library has for the device, if any; it is asked for after every call that may fail.
fn ok(library: &OidnLibrary, device: OidnHandle) -> Result<(), DenoiserError> {
    let mut said: *const c_char = std::ptr::null();
    // SAFETY: the device is alive or null, which asks for the thread's error.
    let code = unsafe { (library.device_error)(device, &raw mut said) };
    match code {
        NO_ERROR => Ok(()),
        CANCELLED => Err(DenoiserError::Cancelled),
        _ => {
            // SAFETY: the library's text stays until its next call for this device.
            Err(DenoiserError::Failed(unsafe { library::text(said) }))
        }
    }
}

/// The error of a call that gave nothing.
fn failure(library: &OidnLibrary, device: OidnHandle) -> DenoiserError {
    ok(library, device).err().unwrap_or_else(|| DenoiserError::Failed("it gives no reason".to_owned()))
}

/// Version and device.
fn name(library: &OidnLibrary, device: OidnHandle) -> String {
    let number = |name: &CStr| {
        // SAFETY: the device is alive, and the name ends with a zero.
        unsafe { (library.device_int)(device, name.as_ptr()) }
    };
    let version = number(c"version");
    let kind = match number(c"type") {
        CPU => "CPU",
        2 => "SYCL",
        3 => "CUDA",
        4 => "HIP",
        _ => "another device",
    };
    format!("Open Image Denoise {}.{}.{}, {kind}", version / 10_000, version / 100 % 100, version % 100)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The library that tests use, for a GPU that there is not: on the processor.
    fn denoiser() -> DenoiserDevice {
        let file = std::env::var_os("OOCPT_DENOISER_LIBRARY").expect("a file, which `cargo xtask test` names");
        DenoiserDevice::open(Some(Path::new(&file)), Some([7; 16])).expect("Open Image Denoise")
    }

    #[test]
    fn a_library_that_is_not_there_is_told() {
        let error = DenoiserDevice::open(Some(Path::new("/nowhere/libOpenImageDenoise.so")), None).err();
        assert!(matches!(&error, Some(DenoiserError::Missing(text)) if text.contains("/nowhere/")), "{error:?}");
    }

    #[test]
    fn a_library_that_is_another_is_told() {
        let error = DenoiserDevice::open(Some(Path::new("libm.so.6")), None).err();
        assert!(matches!(&error, Some(DenoiserError::Missing(text)) if text.contains("oidnNewDevice")), "{error:?}");
    }

    #[test]
    fn images_of_a_wrong_size_are_refused() {
        let size = |floats: &[f32], stride: usize, size| check(FloatImage { floats, stride }, size);
        assert_eq!(size(&[0.0; 12], 3, [2, 2]), Ok(()));
        assert_eq!(size(&[0.0; 11], 3, [2, 2]), Err(DenoiserError::Size(11, 2, 2)));
        assert!(size(&[0.0; 8], 2, [2, 2]).is_err(), "two floats are no colour");
        assert!(size(&[], 3, [0, 0]).is_err(), "nothing");
        assert!(size(&[0.0; 12], 3, [usize::MAX, 2]).is_err(), "more than can be counted");
    }

    /// Noise of mean 1 over grey, in pixels of four floats.
    fn noise(pixels: usize) -> Vec<f32> {
        let mut state = 1_u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            #[expect(clippy::cast_precision_loss, reason = "24 bits")]
            let unit = (state >> 8) as f32 / 16_777_216.0;
            2.0 * unit
        };
        (0..pixels).flat_map(|_| [next(), next(), next(), 0.25]).collect()
    }

    #[test]
    fn noise_over_grey_becomes_grey_and_a_filter_that_is_given_up_says_so() {
        let mut denoiser = denoiser();
        let name = denoiser.name();
        assert!(name.starts_with("Open Image Denoise 2.") && name.ends_with(", CPU"), "{name}");
        let size = [96, 64];
        let color = noise(size[0] * size[1]);
        let flat = vec![0.5; color.len() / 4 * 3];
        let image = |floats| FloatImage { floats, stride: 3 };
        let picture = NoisyPicture {
            size,
            color: FloatImage { floats: &color, stride: 4 },
            albedo: image(&flat),
            normal: image(&flat),
        };
        for quality in [DenoiseQuality::Fast, DenoiseQuality::High] {
            let mut out = color.clone();
            denoiser.denoise(&picture, (&mut out, 4), (quality, Some(512)), &|| true).expect("a picture");
            let spread = |floats: &[f32]| {
                let squares = floats.chunks_exact(4).map(|pixel| (pixel[1] - 1.0).powi(2)).sum::<f32>();
                squares / 6144.0
            };
            assert!(spread(&color) > 0.3 && spread(&out) < 0.02, "{} {}", spread(&color), spread(&out));
            assert!(out.chunks_exact(4).all(|pixel| pixel[3] == 0.25), "the fourth float stays");
            let given_up = denoiser.denoise(&picture, (&mut out, 4), (quality, None), &|| false);
            assert_eq!(given_up, Err(DenoiserError::Cancelled));
        }
        let short = NoisyPicture { albedo: image(&flat[3..]), ..picture };
        let mut out = color.clone();
        let refused = denoiser.denoise(&short, (&mut out, 4), (DenoiseQuality::Fast, None), &|| true);
        assert!(matches!(refused, Err(DenoiserError::Size(..))), "{refused:?}");
    }
}
