// SPDX-License-Identifier: Apache-2.0
//! The images of a frame on the device and their way to the host.

pub(crate) mod adaptive;
pub(crate) mod denoised;
mod exr_header;
pub(crate) mod filtered;
mod in_place;
pub(crate) mod measure;
pub mod picture;
mod picture_attribute;
pub(crate) mod products;
pub(crate) mod reference;

use crate::denoiser::DenoisedPicture;
use crate::error::RenderError;
use crate::film::adaptive::AdaptiveBuffers;
use crate::film::filtered::FilteredPlanes;
use crate::film::in_place::FilmDenoiser;
use crate::job::RenderJob;
use crate::job::aov::{AovKind, AovRequest};
use crate::job::expression::ExpressionId;
use crate::job::primvar::PrimvarImage;
use crate::job::publish::{PictureExtent, PublishedImages};
use crate::job::request::RenderRequest;
use crate::job::window::{FilmWindow, PictureLayout, PixelWindow};
use crate::sync::lock;
use crate::wave::{ERROR_SLOTS, LAST_SLOT, Wave, WavePiece, pieces};
use oocpt_abi::{
    ERROR_GROUPS, ERROR_SUMS_BYTES, ErrorSums, ExactPixel, FilmPixel, FrameConstants, NO_INDEX, PlaneOffsets,
    PushConstants, WORKGROUP_SIZE, WavefrontCounters,
};
use oocpt_core::adaptive::STREAMS;
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::{Buffer, BufferUsage, CommandList, Gpu, GpuError};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Arc, Mutex};

/// Workgroups of `measure_error` for an image of so many pixels.
pub(crate) fn error_groups(pixels: u64) -> u32 {
    let groups = pixels.div_ceil(u64::from(WORKGROUP_SIZE)).clamp(1, u64::from(ERROR_GROUPS));
    u32::try_from(groups).unwrap_or(ERROR_GROUPS)
}

/// What a film has beside the sums of a plain one.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FilmSums {
    /// Two streams of samples a pixel, for adaptive sampling.
    pub(crate) adaptive: bool,
    /// Exact sums, which merge.
    pub(crate) exact: bool,
    /// Sums of images that are filtered with the samples, if any is wanted.
    pub(crate) filtered: bool,
}

impl FilmSums {
    /// Those of a job.
    pub(crate) fn of(job: &RenderJob, exact: bool) -> Self {
        Self { adaptive: job.settings.adaptive_sampling, exact, filtered: job.settings.filter_aovs }
    }
}

/// All pixels: the first, and their number.
fn everywhere(pixels: u64) -> [u32; 2] {
    // The request was validated: at most 2^28 pixels.
    [0, u32::try_from(pixels).unwrap_or(u32::MAX)]
}

/// Bytes of device memory that a film takes for each pixel.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct FilmBytes {
    /// What is known of its samples.
    pub(crate) records: u64,
    /// Sums of filtered images.
    pub(crate) sums: u64,
    /// Images, as they are copied to the host.
    pub(crate) copied: u64,
    /// Lists of adaptive samples, and images before they are copied.
    pub(crate) rest: u64,
}

impl FilmBytes {
    /// Of what goes on to the next samples.
    pub(crate) fn kept(self) -> u64 {
        self.records + self.sums
    }

    /// Of device memory in all; images are copied to memory of the host.
    pub(crate) fn all(self) -> u64 {
        self.kept() + self.rest
    }

    /// Of the largest buffer.
    pub(crate) fn largest(self) -> u64 {
        self.records.max(self.sums).max(self.copied)
    }
}

/// What a film with the images of `job` takes.
pub(crate) fn bytes_a_pixel(job: &RenderJob) -> FilmBytes {
    let (kinds, FilmSums { adaptive, filtered, .. }) = (job.request.kinds(), FilmSums::of(job, false));
    let has_light = kinds.iter().any(|kind| kind.is_of_light());
    let planes = filtered::filtered(&kinds, filtered);
    let adaptive = adaptive && has_light;
    let is_plane = |kind: &&AovKind| !matches!(kind, AovKind::Color | AovKind::Denoised);
    let images = kinds.iter().filter(is_plane).map(|kind| kind.pixel_bytes() as u64);
    let images = images.sum::<u64>();
    if !has_light && planes.is_empty() {
        return FilmBytes { copied: images, rest: images, ..FilmBytes::default() };
    }
    let records = film_bytes(1, adaptive);
    let sums = filtered::sums_bytes(&planes, records / size_of::<FilmPixel>() as u64);
    let lists = if adaptive { AdaptiveBuffers::BYTES } else { 0 };
    let copied = images + AovKind::Color.pixel_bytes() as u64;
    FilmBytes { records, sums, copied, rest: lists + copied }
}

/// Film, resolved colour and the planes of the other images.
#[derive(Debug)]
pub(crate) struct Film {
    gpu: Arc<Gpu>,
    pixels: u64,
    kinds: Vec<AovKind>,
    /// `FilmPixel` per pixel and stream, then what `measure_error` says of them; only with samples.
    film: Option<Buffer>,
    /// With samples: what `measure_error` said and the counters at each octave of samples, and at the end.
    errors: Option<Buffer>,
    color: Option<Buffer>,
    /// Behind `film` are exact sums of each pixel, at this byte.
    exact: Option<u64>,
    /// Only with colour and adaptive sampling; `film` is then twice as long.
    adaptive: Option<AdaptiveBuffers>,
    planes: Vec<(AovKind, Buffer)>,
    /// Those of `planes` that are filtered with the samples.
    filtered: Option<FilteredPlanes>,
    /// The pixels whose error is measured: the first, and their number.
    measured: [u32; 2],
    /// The bits of told relMSE over the mean of `s` of the pixels ([`ErrorSums`]), as known last.
    error_scale: AtomicU32,
    /// Keeps the memory that it works in.
    denoiser: FilmDenoiser,
    /// One copy of every wanted image, then the counters.
    readback: Buffer,
}

/// Bytes of what is known of so many pixels.
fn film_bytes(pixels: u64, adaptive: bool) -> u64 {
    let streams = if adaptive { STREAMS as u64 } else { 1 };
    pixels * streams * size_of::<FilmPixel>() as u64
}

/// The image of `kind`, one of `kinds`.
fn plane(gpu: &Arc<Gpu>, kinds: &[AovKind], kind: AovKind, pixels: u64) -> Result<Buffer, GpuError> {
    Buffer::new(gpu, kind.token(), pixels * kind.pixel_bytes() as u64, in_place::usage(kinds, kind))
}

/// The images but for the colour, and the buffer to which all are copied.
fn images(gpu: &Arc<Gpu>, kinds: &[AovKind], pixels: u64) -> Result<(Vec<(AovKind, Buffer)>, Buffer), GpuError> {
    let of_device = || kinds.iter().copied().filter(|kind| *kind != AovKind::Denoised);
    let others = of_device().filter(|kind| *kind != AovKind::Color);
    let planes = others.map(|kind| Ok((kind, plane(gpu, kinds, kind, pixels)?))).collect::<Result<_, GpuError>>()?;
    let bytes: u64 = of_device().map(|kind| pixels * kind.pixel_bytes() as u64).sum();
    let bytes = bytes + size_of::<WavefrontCounters>() as u64;
    Ok((planes, Buffer::new(gpu, "readback", bytes, BufferUsage::Readback)?))
}

impl Film {
    /// Memory for the images of `request`.
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        request: &RenderRequest,
        FilmSums { adaptive, exact, filtered }: FilmSums,
    ) -> Result<Self, GpuError> {
        let (pixels, kinds) = (request.pixels(), request.kinds());
        let has_light = kinds.iter().any(|kind| kind.is_of_light());
        let of_samples = filtered::filtered(&kinds, filtered);
        let has_color = has_light || !of_samples.is_empty();
        let parts = error_groups(pixels) as usize * size_of::<ErrorSums>();
        let adaptive = (has_light && adaptive).then(|| AdaptiveBuffers::new(gpu, pixels)).transpose()?;
        let film_bytes = film_bytes(pixels, adaptive.is_some());
        let records = film_bytes / size_of::<FilmPixel>() as u64;
        let filtered = FilteredPlanes::new(gpu, of_samples, records)?;
        // The shader of the exact sums counts on the largest number of parts.
        let exact = (has_light && exact).then(|| film_bytes + u64::from(ERROR_GROUPS * ERROR_SUMS_BYTES));
        let exact_end = exact.map(|at| at + pixels * size_of::<ExactPixel>() as u64);
        let film_bytes = exact_end.unwrap_or(film_bytes + parts as u64);
        let film = has_color.then(|| Buffer::new(gpu, "film", film_bytes, BufferUsage::Device)).transpose()?;
        let error_bytes = u64::from(ERROR_SLOTS) * (parts + size_of::<WavefrontCounters>()) as u64;
        let errors = has_color.then(|| Buffer::new(gpu, "errors", error_bytes, BufferUsage::Readback)).transpose()?;
        let color = has_color.then(|| plane(gpu, &kinds, AovKind::Color, pixels)).transpose()?;
        let (planes, readback) = images(gpu, &kinds, pixels)?;
        let error_scale = AtomicU32::new(1.0_f32.to_bits());
        Ok(Self {
            gpu: Arc::clone(gpu),
            pixels,
            kinds,
            film,
            errors,
            color,
            exact,
            adaptive,
            planes,
            filtered,
            measured: everywhere(pixels),
            error_scale,
            denoiser: FilmDenoiser::default(),
            readback,
        })
    }

    /// The same film with the images of another request, which has its samples ([`RenderRequest::has_samples_of`]).
    pub(crate) fn with_images_of(self, gpu: &Arc<Gpu>, request: &RenderRequest) -> Result<Self, GpuError> {
        let Self { kinds: had, planes: old, readback: read, color, denoiser, .. } = self;
        drop((had, old, read, denoiser));
        let kinds = request.kinds();
        let (planes, readback) = images(gpu, &kinds, self.pixels)?;
        // It is made of the samples again.
        let usage = in_place::usage(&kinds, AovKind::Color);
        let color = match color {
            Some(color) if color.usage() != usage => {
                drop(color);
                Some(plane(gpu, &kinds, AovKind::Color, self.pixels)?)
            }
            color => color,
        };
        Ok(Self { kinds, planes, readback, color, denoiser: FilmDenoiser::default(), ..self })
    }

    /// Whether these images serve `request` too, wherever its window is.
    pub(crate) fn fits(&self, request: &RenderRequest, FilmSums { adaptive, exact, filtered }: FilmSums) -> bool {
        let same = self.pixels == request.pixels() && self.kinds == request.kinds();
        let filters = self.kinds.iter().any(|kind| kind.is_of_samples(filtered));
        same && self.exact.is_some() == (exact && self.has_light())
            && self.adaptive.is_some() == (adaptive && self.has_light())
            && self.filtered.is_some() == filters
    }

    /// Learns what of the film is measured, and decides the first samples of a render of `job`, if it is adaptive.
    pub(crate) fn begin(&mut self, job: &RenderJob) -> Result<(), RenderError> {
        self.measured = job.film_window.map_or_else(|| everywhere(self.pixels), FilmWindow::measured);
        let samples = job.settings.samples_per_pixel;
        #[cfg(feature = "faults")]
        if let Some(adaptive) = &mut self.adaptive {
            adaptive.is_naive = job.options.faults.naive_sampling;
        }
        self.adaptive.as_mut().map_or(Ok(()), |adaptive| adaptive.begin(job.request.part().size(), samples))
    }

    /// The first pixel whose error is measured, and their number.
    pub(crate) fn measured(&self) -> [u32; 2] {
        self.measured
    }

    /// What decides where samples go, if they do not go everywhere alike.
    pub(crate) fn adaptive(&self) -> Option<&AdaptiveBuffers> {
        self.adaptive.as_ref()
    }

    /// The push constants of a wave of samples, and how many pixels' samples follow each other in it.
    pub(crate) fn push(&self, frame: u64, wave: Wave) -> (PushConstants, u32) {
        // The request was validated: at most 2^28 pixels.
        let pixels = u32::try_from(self.pixels).unwrap_or(u32::MAX);
        let everywhere = || (PushConstants::wave(frame, wave.first, wave.count, pixels), pixels);
        self.adaptive.as_ref().map_or_else(everywhere, |adaptive| adaptive.push(frame, wave))
    }

    /// Cuts a wave where its film is to be measured, and leaves out paths from `end` on.
    pub(crate) fn pieces(&self, wave: Wave, end: u64) -> Vec<WavePiece> {
        let everywhere = || pieces(wave, self.pixels, end);
        self.adaptive.as_ref().map_or_else(everywhere, |adaptive| adaptive.piece(wave, end).into_iter().collect())
    }

    /// Whether an image is wanted that samples are for.
    pub(crate) fn has_color(&self) -> bool {
        self.film.is_some()
    }

    /// Whether colour is wanted, or what is told of its samples: otherwise these end where they meet something first.
    pub(crate) fn has_light(&self) -> bool {
        self.kinds.iter().any(|kind| kind.is_of_light())
    }

    /// Whether any image is wanted that is traced through pixel centres.
    pub(crate) fn has_planes(&self) -> bool {
        self.planes.iter().any(|(kind, _)| !self.is_sampled(*kind))
    }

    /// Whether an image is made of samples.
    fn is_sampled(&self, kind: AovKind) -> bool {
        kind.is_of_light() || self.filtered.as_ref().is_some_and(|filtered| filtered.has(kind))
    }

    /// The images that are filtered with the samples.
    pub(crate) fn filtered(&self) -> Option<&FilteredPlanes> {
        self.filtered.as_ref()
    }

    /// The light path expressions that images are wanted of, in the order of their values.
    pub(crate) fn expressions(&self) -> Vec<ExpressionId> {
        self.filtered.as_ref().map_or_else(Vec::new, FilteredPlanes::expressions)
    }

    /// Values that a sample has for these, for shadows and waits.
    pub(crate) fn light_words(&self) -> u32 {
        self.filtered.as_ref().map_or(0, FilteredPlanes::light_words)
    }

    /// Whether it is wanted how much of the light arrives that shadow rays ask for.
    pub(crate) fn has_shadows(&self) -> bool {
        self.filtered.as_ref().is_some_and(FilteredPlanes::has_shadows)
    }

    /// Whether some image is filtered of what samples meet first.
    pub(crate) fn filters_first_hits(&self) -> bool {
        self.filtered.as_ref().is_some_and(FilteredPlanes::has_first_hits)
    }

    /// Values that a sample has for filtered images.
    pub(crate) fn plane_words(&self) -> u32 {
        self.filtered.as_ref().map_or(0, FilteredPlanes::words)
    }

    /// Whether the variance of pixels is wanted, or their error.
    pub(crate) fn has_spread(&self) -> bool {
        self.kinds.contains(&AovKind::Variance) || self.has_errors()
    }

    /// Whether the error of each pixel is wanted.
    pub(crate) fn has_errors(&self) -> bool {
        self.kinds.contains(&AovKind::Error)
    }

    /// Takes what is known of the error of the picture for that of its pixels: told relMSE over the mean of `s`.
    pub(crate) fn scale_errors(&self, scale: f32) {
        self.error_scale.store(scale.to_bits(), Ordering::Relaxed);
    }

    /// The bits of what [`Self::scale_errors`] was given last; at first those of 1, which is right of independent
    /// samples.
    pub(crate) fn error_scale(&self) -> u32 {
        self.error_scale.load(Ordering::Relaxed)
    }

    /// Whether some of these tells how surfaces are shaded, or shows a primvar.
    pub(crate) fn has_shaded_planes(&self) -> bool {
        let shaded = [AovKind::Normal, AovKind::Neye, AovKind::Albedo];
        self.planes.iter().any(|(kind, _)| shaded.contains(kind) || kind.primvar().is_some())
    }

    /// Whether it is wanted how what is seen moves over the image.
    pub(crate) fn has_motion(&self) -> bool {
        self.kinds.contains(&AovKind::Motion) || self.kinds.contains(&AovKind::MotionBoth)
    }

    /// Whether sums that merge are wanted.
    pub(crate) fn has_exact_sums(&self) -> bool {
        self.exact.is_some()
    }

    /// The buffer that ends with the exact sums of each pixel, and the byte at which they begin.
    pub(crate) fn exact_records(&self) -> Option<(&Buffer, u64)> {
        Some((self.film.as_ref()?, self.exact?))
    }

    /// Paths after which an octave of samples ends, if sums of each are kept apart.
    pub(crate) fn octave_cuts(&self) -> Vec<u64> {
        let all = || (0..LAST_SLOT).filter_map(|octave| self.pixels.checked_shl(octave)).collect();
        self.exact.map_or_else(Vec::new, |_| all())
    }

    /// Whether the number of samples is wanted.
    pub(crate) fn has_counts(&self) -> bool {
        self.kinds.contains(&AovKind::SampleCount)
    }

    /// Lists the images, and those that nobody wants.
    pub(crate) fn list(&self, inventory: &mut RenderInventory) {
        for buffer in self.film.iter().chain(&self.errors).chain(&self.color) {
            inventory.add(buffer.name(), buffer.size());
        }
        let of_device = |kind: &AovKind| !matches!(kind, AovKind::Color | AovKind::Denoised);
        for kind in AovKind::ALL.into_iter().filter(of_device) {
            match self.planes.iter().find(|(have, _)| *have == kind) {
                Some((_, plane)) => inventory.add(&format!("image {}", kind.token()), plane.size()),
                None => {
                    inventory.leave_out(&format!("image {}", kind.token()), self.pixels * kind.pixel_bytes() as u64)
                }
            }
        }
        for (kind, plane) in self.planes.iter().filter(|(kind, _)| !AovKind::ALL.contains(kind)) {
            inventory.add(&format!("image {}", kind.name()), plane.size());
        }
        match &self.adaptive {
            Some(adaptive) => adaptive.buffers().for_each(|buffer| inventory.add(buffer.name(), buffer.size())),
            None => inventory.leave_out("adaptive sampling", 160 * self.pixels),
        }
        match &self.filtered {
            Some(filtered) => inventory.add(filtered.sums.name(), filtered.sums.size()),
            None => {
                let all = filtered::sums_bytes(&filtered::filtered(&AovKind::ALL, true), self.pixels);
                inventory.leave_out("plane_sums", all);
            }
        }
        inventory.add(self.readback.name(), self.readback.size());
        let absent = AovKind::ALL.iter().filter(|kind| !self.kinds.contains(kind) && **kind != AovKind::Denoised);
        inventory
            .leave_out(self.readback.name(), self.pixels * absent.map(|kind| kind.pixel_bytes() as u64).sum::<u64>());
    }

    /// Writes addresses and clear values into a frame block.
    pub(crate) fn bind(&self, frame: &mut FrameConstants, aovs: &[AovRequest]) {
        frame.film = self.film.as_ref().map_or(0, Buffer::address);
        frame.color = self.color.as_ref().map_or(0, Buffer::address);
        frame.plane_at = PlaneOffsets::NONE;
        (frame.shadow_at, frame.catcher_at) = (NO_INDEX, NO_INDEX);
        if let Some(filtered) = &self.filtered {
            filtered.bind(frame);
        }
        frame.adaptive = self.adaptive.as_ref().map_or(0, AdaptiveBuffers::address);
        let parts = self.planes.iter().filter(|(kind, _)| kind.expression().is_some());
        for ((_, plane), address) in parts.zip(&mut frame.light_images) {
            *address = plane.address();
        }
        for (kind, plane) in &self.planes {
            let address = match kind {
                AovKind::Color | AovKind::Denoised | AovKind::Primvar(_) | AovKind::Light(_) => continue,
                AovKind::Deep(_) => &mut frame.deep_image,
                AovKind::Depth => &mut frame.aov.depth,
                AovKind::CameraDepth => &mut frame.aov.camera_depth,
                AovKind::PrimId => &mut frame.aov.prim_id,
                AovKind::InstanceId => &mut frame.aov.instance_id,
                AovKind::ElementId => &mut frame.aov.element_id,
                AovKind::Normal => &mut frame.aov.normal,
                AovKind::Neye => &mut frame.aov.neye,
                AovKind::Albedo => &mut frame.aov.albedo,
                AovKind::Motion => &mut frame.aov.motion,
                AovKind::MotionBoth => &mut frame.aov.motion_both,
                AovKind::SampleCount => &mut frame.aov.sample_count,
                AovKind::Position => &mut frame.aov.position,
                AovKind::Peye => &mut frame.aov.peye,
                AovKind::GeometricNormal => &mut frame.aov.geometric_normal,
                AovKind::Variance => &mut frame.aov.variance,
                AovKind::Error => &mut frame.aov.error,
                AovKind::CryptoObject => &mut frame.aov.crypto_object,
                AovKind::CryptoMaterial => &mut frame.aov.crypto_material,
                AovKind::MaterialId => &mut frame.aov.material_id,
                AovKind::Shadow => &mut frame.aov.shadow,
                AovKind::ShadowCatcher => &mut frame.aov.shadow_catcher,
                AovKind::LoadWaits => &mut frame.aov.load_waits,
            };
            *address = plane.address();
        }
        self.bind_primvars(frame);
        for aov in aovs {
            bind_clear(frame, aov);
        }
    }

    /// The primvars that are shown, in the order of their images.
    pub(crate) fn primvars(&self) -> impl Iterator<Item = PrimvarImage> {
        self.planes.iter().filter_map(|(kind, _)| kind.primvar())
    }

    fn bind_primvars(&self, frame: &mut FrameConstants) {
        let shown = self.planes.iter().filter(|(kind, _)| kind.primvar().is_some());
        let targets = frame.primvar_images.iter_mut().zip(&mut frame.primvar_at);
        for ((kind, plane), (image, at)) in shown.zip(targets) {
            *image = plane.address();
            *at = self.filtered.as_ref().and_then(|filtered| filtered.place_of(*kind)).unwrap_or(NO_INDEX);
        }
    }

    /// A record for each pixel, and what else follows them; only with colour.
    pub(crate) fn records(&self) -> Option<&Buffer> {
        self.film.as_ref()
    }

    /// Copies what is known of the samples of `pixels` to another film of the same images; both have their windows.
    pub(crate) fn copy_pixels(
        &self,
        commands: &mut CommandList,
        from: PixelWindow,
        (into, to): (&Self, PixelWindow),
        pixels: PixelWindow,
    ) {
        let inside = |of: PixelWindow| PixelWindow { x: pixels.x - of.x, y: pixels.y - of.y, ..pixels };
        let places = || inside(from).rows(from.width, 1).zip(inside(to).rows(to.width, 1));
        let mut copy = |[source, target]: [(&Buffer, u64); 2], bytes: u64| {
            for (row, target_row) in places() {
                let [at, target_at] = [row.start, target_row.start].map(|pixel| pixel as u64 * bytes);
                let length = row.len() as u64 * bytes;
                commands.copy(source.0, source.1 + at, target.0, target.1 + target_at, length);
            }
        };
        if let (Some(film), Some(target)) = (&self.film, &into.film) {
            copy([(film, 0), (target, 0)], size_of::<FilmPixel>() as u64);
        }
        if let (Some(have), Some(target)) = (&self.filtered, &into.filtered) {
            for ((at, bytes), (target_at, _)) in have.parts().into_iter().zip(target.parts()) {
                copy([(&have.sums, at), (&target.sums, target_at)], bytes);
            }
        }
    }

    /// Forgets all samples.
    pub(crate) fn clear(&self, commands: &mut CommandList) {
        if let Some(film) = &self.film {
            commands.fill(film, 0, film.size(), 0);
        }
        if let Some(FilteredPlanes { sums, .. }) = &self.filtered {
            commands.fill(sums, 0, sums.size(), 0);
        }
    }

    /// Copies every image and the counters to where the host can read them.
    pub(crate) fn copy_out(&self, commands: &mut CommandList, counters: &Buffer) {
        self.denoiser.is_made();
        let color = self.color.as_ref().filter(|_| self.kinds.contains(&AovKind::Color));
        let sources = color.into_iter().chain(self.planes.iter().map(|(_, plane)| plane));
        commands.concurrent(|c| {
            let mut offset = 0;
            for source in sources {
                c.copy(source, 0, &self.readback, offset, source.size());
                offset += source.size();
            }
            c.copy(counters, 0, &self.readback, offset, size_of::<WavefrontCounters>() as u64);
        });
    }

    /// Copies what `measure_error` wrote, and the counters, to a slot below [`ERROR_SLOTS`] where the host can read
    /// them.
    pub(crate) fn copy_error(&self, commands: &mut CommandList, counters: &Buffer, slot: u32) {
        let (Some(film), Some(errors)) = (&self.film, &self.errors) else { return };
        let behind = film_bytes(self.pixels, self.adaptive.is_some());
        let bytes = u64::from(error_groups(self.pixels)) * size_of::<ErrorSums>() as u64;
        let at = u64::from(slot.min(ERROR_SLOTS - 1)) * (errors.size() / u64::from(ERROR_SLOTS));
        commands.concurrent(|c| {
            c.copy(film, behind, errors, at, bytes);
            c.copy(counters, 0, errors, at + bytes, size_of::<WavefrontCounters>() as u64);
        });
    }

    /// Device memory in use, by all that is on the device.
    pub(crate) fn device_bytes(&self) -> u64 {
        self.gpu.memory().used
    }

    /// What [`Film::copy_error`] copied to a slot, once its commands are done.
    pub(crate) fn error(&self, slot: u32) -> Result<Option<(Vec<ErrorSums>, WavefrontCounters)>, GpuError> {
        let Some(errors) = &self.errors else { return Ok(None) };
        let groups = error_groups(self.pixels) as usize;
        errors.map(|bytes| {
            let slots = bytes.len() / ERROR_SLOTS as usize;
            let slot = &bytes[slots * slot.min(ERROR_SLOTS - 1) as usize..][..slots];
            let (parts, counters) = slot.split_at(groups * size_of::<ErrorSums>());
            Some((bytemuck::pod_collect_to_vec(parts), bytemuck::pod_read_unaligned(counters)))
        })
    }

    /// Publishes what [`Film::copy_out`] copied, once its commands are done, as images of `generation` with this
    /// layout, unless these would be no whole picture ([`PublishedImages::begin`]); returns the counters. The denoised
    /// picture is `denoised`, or the colour.
    pub(crate) fn publish(
        &self,
        published: &Mutex<PublishedImages>,
        (generation, layout): (u64, &PictureLayout),
        extent: PictureExtent,
        denoised: Option<&DenoisedPicture>,
    ) -> Result<WavefrontCounters, GpuError> {
        let mut counters = WavefrontCounters::default();
        self.readback.map(|bytes| {
            let mut published = lock(published);
            let is_shown = published.begin(generation, &self.kinds, layout, extent);
            for kind in self.kinds.iter().filter(|_| is_shown) {
                let there = if self.is_sampled(*kind) { extent.samples } else { extent.planes };
                match denoised.filter(|_| *kind == AovKind::Denoised) {
                    None => published.put(*kind, self.image(bytes, *kind), there),
                    Some(DenoisedPicture { rgba: Some(rgba), .. }) => {
                        published.put(*kind, bytemuck::cast_slice(rgba), there);
                    }
                    Some(_) => self.denoiser.look(|image| published.put(*kind, image, there))?,
                }
            }
            let counters_at = bytes.len() - size_of::<WavefrontCounters>();
            counters = bytemuck::pod_read_unaligned(&bytes[counters_at..]);
            Ok::<(), GpuError>(())
        })??;
        Ok(counters)
    }

    /// Gives the images that were copied out and guide a denoiser to `look`: colour, albedo, normals.
    pub(crate) fn look_at_guides<R>(&self, look: impl FnOnce([&[f32]; 3]) -> R) -> Result<Option<R>, GpuError> {
        let kinds = [AovKind::Color, AovKind::Albedo, AovKind::Normal];
        if !kinds.iter().all(|kind| self.kinds.contains(kind)) {
            return Ok(None);
        }
        self.readback.map(|bytes| {
            // The buffer begins at a multiple of 4, and so do all images.
            let floats = |kind| bytemuck::try_cast_slice(self.image(bytes, kind)).unwrap_or_default();
            Some(look(kinds.map(floats)))
        })
    }

    /// The image of `kind` among the bytes that were copied out; of the denoised picture the colour.
    fn image<'a>(&self, copied: &'a [u8], kind: AovKind) -> &'a [u8] {
        let kind = if kind == AovKind::Denoised { AovKind::Color } else { kind };
        // Fits: the readback buffer is mapped whole.
        let pixels = usize::try_from(self.pixels).unwrap_or(usize::MAX);
        let before = self.kinds.iter().take_while(|have| **have != kind);
        let at: usize = before
            .filter(|have| **have != AovKind::Denoised)
            .map(|kind| pixels.saturating_mul(kind.pixel_bytes()))
            .sum();
        copied.get(at..at.saturating_add(pixels.saturating_mul(kind.pixel_bytes()))).unwrap_or_default()
    }
}

#[expect(clippy::cast_possible_truncation, reason = "clear values of ids are given as floats; the cast saturates")]
fn bind_clear(frame: &mut FrameConstants, aov: &AovRequest) {
    let [x, y, z, _] = aov.clear;
    let id = x.round() as i32;
    match aov.kind {
        AovKind::Color => frame.clear_color = aov.clear,
        AovKind::Depth => frame.aov_clear.depth = x,
        AovKind::CameraDepth => frame.aov_clear.camera_depth = x,
        AovKind::PrimId => frame.aov_clear.prim_id = id,
        AovKind::InstanceId => frame.aov_clear.instance_id = id,
        AovKind::ElementId => frame.aov_clear.element_id = id,
        AovKind::MaterialId => frame.aov_clear.material_id = id,
        AovKind::Normal => frame.aov_clear.normal = [x, y, z],
        AovKind::Neye => frame.aov_clear.neye = [x, y, z],
        AovKind::Albedo => frame.aov_clear.albedo = [x, y, z],
        AovKind::Motion => frame.aov_clear.motion = [x, y, z],
        AovKind::Position => frame.aov_clear.position = [x, y, z],
        AovKind::Peye => frame.aov_clear.peye = [x, y, z],
        AovKind::GeometricNormal => frame.aov_clear.geometric_normal = [x, y, z],
        // What is not there does not move.
        AovKind::MotionBoth => {}
        // Every pixel has one, and light and shadows that are not there are 0.
        AovKind::SampleCount
        | AovKind::Variance
        | AovKind::Error
        | AovKind::Shadow
        | AovKind::ShadowCatcher
        | AovKind::LoadWaits
        | AovKind::Denoised
        | AovKind::Primvar(_)
        | AovKind::Light(_) => {}
        // Nothing is no id.
        AovKind::CryptoObject | AovKind::CryptoMaterial | AovKind::Deep(_) => {}
    }
}
