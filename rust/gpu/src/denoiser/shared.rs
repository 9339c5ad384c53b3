// SPDX-License-Identifier: Apache-2.0
//! Filters that work in the memory of buffers, without a copy: of a GPU that the library imports it from, or of the
//! processor where both are it.

use super::filter::{FilterWork, OidnBuffer, OidnFilter};
use super::library::OPAQUE_FD;
use super::opened::OpenDenoiser;
use super::{DenoiseOptions, DenoiseQuality, DenoiserDevice, DenoiserError};
use crate::buffer::Buffer;
use crate::memory::block::MemoryBlock;
use std::sync::Arc;

/// A picture in buffers of the device ([`BufferUsage::Exported`](crate::BufferUsage::Exported)); row after row, without
/// gaps.
#[derive(Clone, Copy, Debug)]
pub struct PictureBuffers<'a> {
    /// Columns and rows of each image.
    pub size: [usize; 2],
    /// Four floats a pixel: linear light without upper bound, which is denoised in place, and alpha, which stays.
    pub color: &'a Buffer,
    /// Three floats a pixel: reflectances of what is seen, from 0 to 1.
    pub albedo: &'a Buffer,
    /// Three floats a pixel: normals of what is seen, from -1 to 1.
    pub normal: &'a Buffer,
}

/// The filters of a picture in buffers; they keep the memory.
#[derive(Debug)]
pub struct SharedFilters {
    // Dropped in this order.
    filters: Vec<OidnFilter>,
    _buffers: Vec<OidnBuffer>,
    _memory: Vec<Arc<MemoryBlock>>,
    options: DenoiseOptions,
}

impl DenoiserDevice {
    /// Filters that denoise a picture in its buffers; `None` if the library's device does not reach them. Guides stay
    /// as they are: clean ones are in memory of the library, 24 bytes a pixel.
    ///
    /// # Errors
    /// [`DenoiserError::Size`] if a buffer is too small, [`DenoiserError::Failed`].
    pub fn share(
        &self,
        picture: &PictureBuffers<'_>,
        options: DenoiseOptions,
    ) -> Result<Option<SharedFilters>, DenoiserError> {
        let opened = &self.opened;
        let blocks = [picture.color, picture.albedo, picture.normal].map(Buffer::block);
        let mut buffers = Vec::with_capacity(5);
        for block in blocks {
            let Some(buffer) = import(opened, block) else { return Ok(None) };
            buffers.push(buffer);
        }
        let is_clean = options.quality == DenoiseQuality::High;
        if is_clean {
            let bytes = picture.size[0].saturating_mul(picture.size[1]).saturating_mul(3 * size_of::<f32>());
            buffers.push(OidnBuffer::on_device(opened, bytes)?);
            buffers.push(OidnBuffer::on_device(opened, bytes)?);
        }
        let guide = |at: usize| buffers[at].image(3);
        let guides = [guide(1), guide(2)];
        let clean = if is_clean { [guide(3), guide(4)] } else { guides };
        let images = (buffers[0].image(4), guides, clean);
        let filters = OidnFilter::of_picture(opened, images, picture.size, options)?;
        Ok(Some(SharedFilters { filters, _buffers: buffers, _memory: blocks.map(Arc::clone).to_vec(), options }))
    }
}

impl SharedFilters {
    /// How they filter.
    #[must_use]
    pub fn options(&self) -> DenoiseOptions {
        self.options
    }

    /// Denoises what the picture's buffers hold. The caller ensures that no submission in flight uses them. `goes_on`
    /// is asked from time to time.
    ///
    /// # Errors
    /// [`DenoiserError::Cancelled`], [`DenoiserError::Failed`]; the colour may have been written in parts.
    pub fn run(&mut self, goes_on: &dyn Fn() -> bool) -> Result<(), DenoiserError> {
        self.filters.iter().try_for_each(|filter| filter.run(&FilterWork { goes_on }))
    }
}

/// The memory of a buffer as one of the library's; `None` if its device does not reach it.
fn import(opened: &Arc<OpenDenoiser>, block: &MemoryBlock) -> Option<OidnBuffer> {
    let library = &opened.library;
    let (handle, bytes) = if opened.is_processor() {
        let bytes = usize::try_from(block.raw.bytes).ok()?;
        let at = block.raw.seen?.as_ptr();
        // SAFETY: the device is alive, and so many bytes are mapped from there on as long as the block lives, which
        // `SharedFilters` holds.
        (unsafe { (library.new_shared_buffer)(opened.device, at.cast(), bytes) }, bytes)
    } else if opened.imports() {
        let (file, bytes) = block.export()?;
        let bytes = usize::try_from(bytes).ok()?;
        // The library takes the descriptor over. Where it fails, nobody knows how far it came, so the descriptor is not
        // closed: it may be another file's by now.
        // SAFETY: the device is alive, and the descriptor is of so many bytes of opaque memory.
        (unsafe { (library.new_shared_buffer_from_fd)(opened.device, OPAQUE_FD, file, bytes) }, bytes)
    } else {
        return None;
    };
    let buffer = OidnBuffer::own(opened, handle, bytes);
    buffer.inspect_err(|error| tracing::trace!(%error, "the denoiser imports no memory")).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::denoiser::tests::{library, noise};
    use crate::denoiser::{FloatImage, NoisyPicture};
    use crate::tests::open;
    use crate::{BufferUsage, DeviceKind, Gpu};
    use std::time::Duration;

    const SIZE: [usize; 2] = [64, 48];

    /// A buffer that can be exported, with these numbers.
    fn exported(gpu: &Arc<Gpu>, floats: &[f32]) -> Buffer {
        let buffer = Buffer::new(gpu, "image", size_of_val(floats) as u64, BufferUsage::Exported).expect("memory");
        write(gpu, floats, &buffer);
        buffer
    }

    fn write(gpu: &Arc<Gpu>, floats: &[f32], buffer: &Buffer) {
        let staged = Buffer::new(gpu, "staged", buffer.size(), BufferUsage::Upload).expect("memory");
        staged.write(0, bytemuck::cast_slice(floats)).expect("mapped");
        copy(gpu, &staged, buffer);
    }

    fn copy(gpu: &Arc<Gpu>, from: &Buffer, to: &Buffer) {
        let mut commands = gpu.commands("copy").expect("a command list");
        commands.copy(from, 0, to, 0, from.size());
        assert!(commands.submit().expect("submitted").wait(Duration::from_secs(20)).expect("done"));
    }

    fn read(gpu: &Arc<Gpu>, buffer: &Buffer) -> Vec<f32> {
        let copied = Buffer::new(gpu, "copied", buffer.size(), BufferUsage::Readback).expect("memory");
        copy(gpu, buffer, &copied);
        copied.map(|bytes| bytemuck::pod_collect_to_vec(bytes)).expect("mapped")
    }

    #[test]
    fn a_picture_in_buffers_is_denoised_to_the_bits_of_its_copy_and_its_guides_stay() {
        let gpu = open();
        let denoiser = DenoiserDevice::open(Some(&library()), Some(gpu.report().uuid)).expect("Open Image Denoise");
        let noisy = noise(SIZE[0] * SIZE[1]);
        let guide: Vec<f32> = noisy.chunks_exact(4).flat_map(|pixel| [0.1 * pixel[0], 0.5, 0.25]).collect();
        for quality in [DenoiseQuality::Fast, DenoiseQuality::High] {
            let options = DenoiseOptions { quality, most_mib: None };
            let [color, albedo, normal] = [&noisy, &guide, &guide].map(|image| exported(&gpu, image));
            let picture = PictureBuffers { size: SIZE, color: &color, albedo: &albedo, normal: &normal };
            let shared = denoiser.share(&picture, options).expect("no failure");
            let is_one = gpu.report().kind == DeviceKind::Cpu && denoiser.opened.is_processor();
            assert_eq!(shared.is_some(), is_one || denoiser.opened.imports(), "{}", denoiser.name());
            let Some(mut shared) = shared else { return };
            assert_eq!(shared.run(&|| false), Err(DenoiserError::Cancelled), "given up");
            write(&gpu, &noisy, &color);
            shared.run(&|| true).expect("denoised");
            let mut out = noisy.clone();
            let [noisy_image, guide_image] =
                [(&noisy, 4), (&guide, 3)].map(|(floats, stride)| FloatImage { floats, stride });
            let copies = NoisyPicture { size: SIZE, color: noisy_image, albedo: guide_image, normal: guide_image };
            denoiser.denoise(&copies, (&mut out, 4), options, &|| true).expect("denoised");
            assert!(out != noisy && read(&gpu, &color) == out, "{quality:?}");
            assert!(read(&gpu, &albedo) == guide && read(&gpu, &normal) == guide, "{quality:?}");
        }
        assert_eq!(gpu.take_validation_messages(), Vec::<String>::new());
    }

    #[test]
    fn buffers_that_are_smaller_than_the_picture_are_refused() {
        let gpu = open();
        let denoiser = DenoiserDevice::open(Some(&library()), Some(gpu.report().uuid)).expect("Open Image Denoise");
        let pixels = SIZE[0] * SIZE[1];
        let [color, guide] = [4, 3].map(|floats| exported(&gpu, &vec![0.5; floats * pixels]));
        let small = exported(&gpu, &vec![0.5; 3 * pixels - 4]);
        let options = DenoiseOptions { quality: DenoiseQuality::Fast, most_mib: None };
        for [color, albedo, normal] in [[&guide, &guide, &guide], [&color, &small, &guide], [&color, &guide, &small]] {
            let picture = PictureBuffers { size: SIZE, color, albedo, normal };
            let refused = denoiser.share(&picture, options);
            assert!(matches!(refused, Ok(None) | Err(DenoiserError::Size(..))), "{refused:?}");
        }
        let huge = PictureBuffers { size: [usize::MAX, 2], color: &color, albedo: &guide, normal: &guide };
        assert!(!matches!(denoiser.share(&huge, options), Ok(Some(_))));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn memory_is_exported_where_it_was_asked_for_and_has_what_the_buffer_has() {
        use std::fs::File;
        use std::io::Read as _;
        use std::os::fd::FromRawFd as _;
        let gpu = open();
        let floats: Vec<f32> = (0..4096_u16).map(f32::from).collect();
        let exported = exported(&gpu, &floats);
        let plain = Buffer::new(&gpu, "plain", 4096, BufferUsage::Device).expect("memory");
        assert_eq!(plain.block().export(), None, "not asked for");
        let Some((file, bytes)) = exported.block().export() else {
            assert!(!gpu.report().capabilities.external_memory_fd, "the driver can");
            return;
        };
        // SAFETY: the descriptor is new, and nobody else's.
        let mut file = unsafe { File::from_raw_fd(file) };
        assert!(bytes >= exported.size(), "{bytes}");
        if gpu.report().kind == DeviceKind::Cpu {
            let mut all = Vec::new();
            file.read_to_end(&mut all).expect("a file of memory");
            let image: &[u8] = bytemuck::cast_slice(&floats);
            assert!(all.windows(image.len()).any(|window| window == image), "{} bytes", all.len());
        }
    }
}
