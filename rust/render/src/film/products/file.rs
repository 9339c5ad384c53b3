// SPDX-License-Identifier: Apache-2.0
//! Writes a product's file from the images of a finished picture.

use super::cryptomatte::{self, CryptomatteLayer};
use super::deep::DeepImage;
use super::plan::is_input;
use super::times;
use crate::film::picture::{PictureAttribute, PictureAttributes, exr_text, layer_attributes};
use crate::job::aov::AovKind;
use crate::job::product::{FileChannel, FileCompression, HeaderValue, ProductFile, SampleFormat};
use crate::job::publish::PublishedImages;
use crate::job::request::RenderRequest;
use exr::compression::Compression;
use exr::image::{Blocks, Layers};
use exr::meta::attribute::{AttributeValue, Chromaticities, IntegerBounds, LineOrder};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, Layer, LayerAttributes, Vec2,
    WritableImage as _, f16,
};
use glam::{DMat4, DVec4};
use oocpt_abi::IdSlot;
use oocpt_core::camera::Camera;
use oocpt_core::file_space::FileSpace;
use oocpt_core::scene::PrimNames;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{BufWriter, Read as _};
use std::path::Path;

/// The first bytes of an EXR file.
const MAGIC: [u8; 4] = [0x76, 0x2f, 0x31, 0x01];

/// The reasons why a product is not written; each continues "the product is not written: ".
#[derive(Debug, thiserror::Error)]
pub(crate) enum ProductError {
    /// The render has no such image.
    #[error("there is no image {}", .0.token())]
    Image(AovKind),
    /// The file is there and is no picture.
    #[error("{0} is there and is no EXR file; it is not overwritten")]
    Foreign(String),
    /// The scene reads the file.
    #[error("the scene reads {0}; it is not overwritten")]
    Input(String),
    /// The file cannot be written.
    #[error("{0}: {1}")]
    File(String, String),
}

/// Writes `file` of the rendered part of the images of `request`. The file is whole, or what was there stays. `inputs`
/// are names of files that the scene reads.
pub(crate) fn write(
    file: &ProductFile,
    request: &RenderRequest,
    images: &PublishedImages,
    (attributes, names): (&PictureAttributes, Option<&PrimNames>),
    inputs: &[&str],
) -> Result<Vec<String>, ProductError> {
    let name = || file.path.display().to_string();
    if is_input(&file.path, inputs) {
        return Err(ProductError::Input(name()));
    }
    if !may_be_replaced(&file.path) {
        return Err(ProductError::Foreign(name()));
    }
    let file_error = |error: std::io::Error| ProductError::File(name(), error.to_string());
    if let Some(folder) = file.path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).map_err(file_error)?;
    }
    if let Some(limits) = file.deep {
        let limits = request.deep().unwrap_or(limits);
        let missing = || ProductError::Image(AovKind::Deep(limits));
        let rows = rows(request, images, AovKind::Deep(limits)).ok_or_else(missing)?;
        let compression = compression(file.compression);
        let image = DeepImage::new((file, compression), limits, rows, names).ok_or_else(missing)?;
        let (layer, shared) = header_of(file, request, (attributes, &image.manifests()));
        oocpt_files::replace_by(&file.path, |out| image.write(out, layer, shared)).map_err(file_error)?;
        return Ok(image.warning().into_iter().collect());
    }
    let mattes = mattes(file, request, images, names)?;
    let image = image(file, request, images, (attributes, &mattes))?;
    let written = oocpt_files::replace_by(&file.path, |out| {
        let done = image.write().to_buffered(BufWriter::new(out));
        done.map_err(|error| std::io::Error::other(error.to_string()))
    });
    written.map_err(file_error)?;
    let short = mattes.iter().filter(|(_, matte)| matte.unnamed > 0);
    Ok(short.map(|(layer, matte)| format!("{layer}: {} names are not in the manifest", matte.unnamed)).collect())
}

/// What the header of a file says beside its channels, with the attributes of OocPT and those of manifests.
fn header_of(
    file: &ProductFile,
    request: &RenderRequest,
    (attributes, manifests): (&PictureAttributes, &[(String, String)]),
) -> (LayerAttributes, ImageAttributes) {
    let mut layer = layer_attributes(attributes);
    for (name, value) in manifests {
        layer.other.insert(exr_text(name.as_str()), AttributeValue::Text(exr_text(value.as_str())));
    }
    if let Some(space) = file.space {
        let named = ("renderingColorSpace".to_owned(), PictureAttribute::Text(space.name().to_owned()));
        layer.other.extend(layer_attributes(&PictureAttributes::from([named])).other);
    }
    for (name, value) in &file.header {
        let value = match value {
            HeaderValue::Text(text) => AttributeValue::Text(exr_text(text.as_str())),
            HeaderValue::Whole(number) => AttributeValue::I32(*number),
            HeaderValue::Real(number) => AttributeValue::F64(*number),
        };
        layer.other.insert(exr_text(name.as_str()), value);
    }
    let [world_to_camera, world_to_ndc] = matrices(&request.camera, file);
    (layer.world_to_camera, layer.world_to_normalized_device) = (Some(world_to_camera), Some(world_to_ndc));
    layer.layer_position = Vec2(file.data_corner[0], file.data_corner[1]);
    let [columns, rows] = file.display_size.map(|side| side as usize);
    let mut shared = ImageAttributes::new(IntegerBounds::new(Vec2(0, 0), Vec2(columns, rows)));
    shared.pixel_aspect = file.pixel_aspect;
    shared.chromaticities = file.space.map(chromaticities);
    layer.software_name = Some(exr_text(concat!("OocPT ", env!("CARGO_PKG_VERSION"))));
    times::add(file, &mut layer, &mut shared);
    (layer, shared)
}

/// The picture as it is written: one layer, or one for each part.
fn image(
    file: &ProductFile,
    request: &RenderRequest,
    images: &PublishedImages,
    (attributes, mattes): (&PictureAttributes, &BTreeMap<String, CryptomatteLayer>),
) -> Result<Image<Layers<AnyChannels<FlatSamples>>>, ProductError> {
    let mut parts: Vec<(&str, Vec<&FileChannel>)> = Vec::new();
    for channel in &file.channels {
        let name = if file.storage.has_parts { channel.part() } else { "" };
        match parts.iter_mut().find(|(have, _)| *have == name) {
            Some((_, channels)) => channels.push(channel),
            None => parts.push((name, vec![channel])),
        }
    }
    let blocks = file.storage.tiles.map_or(Blocks::ScanLines, |side| Blocks::Tiles(Vec2(side as usize, side as usize)));
    let line_order = if file.storage.tiles.is_some() { LineOrder::Unspecified } else { LineOrder::Increasing };
    let encoding = Encoding { compression: compression(file.compression), blocks, line_order };
    let size = Vec2(request.part().width as usize, request.part().height as usize);
    let mut shared = ImageAttributes::new(IntegerBounds::zero());
    let layers = parts.into_iter().map(|(name, channels)| {
        let is_here = |matte: &str| channels.iter().any(|c| c.cryptomatte.as_ref().is_some_and(|l| l.name == matte));
        let manifests = mattes.iter().filter(|(matte, _)| is_here(matte)).flat_map(|(_, matte)| &matte.attributes);
        let (mut layer, of_image) = header_of(file, request, (attributes, &manifests.cloned().collect::<Vec<_>>()));
        shared = of_image;
        layer.layer_name = (!name.is_empty()).then(|| exr_text(name));
        let channels = channels.into_iter().map(|channel| written_channel(file, channel, request, images, mattes));
        let channels = AnyChannels::sort(channels.collect::<Result<_, ProductError>>()?);
        Ok(Layer::new(size, layer, encoding, channels))
    });
    let layers = layers.collect::<Result<Vec<_>, ProductError>>()?;
    Ok(Image::from_layers(shared, layers))
}

/// A channel with its numbers.
fn written_channel(
    file: &ProductFile,
    channel: &FileChannel,
    request: &RenderRequest,
    images: &PublishedImages,
    mattes: &BTreeMap<String, CryptomatteLayer>,
) -> Result<AnyChannel<FlatSamples>, ProductError> {
    if let Some(matte) = channel.cryptomatte.as_ref().and_then(|layer| mattes.get(&layer.name)) {
        let component = matte.pixels.iter().skip(channel.component).step_by(cryptomatte::CHANNELS);
        let samples = FlatSamples::F32(component.copied().collect());
        return Ok(AnyChannel::new(exr_text(channel.name.as_str()), samples));
    }
    let rows = rows(request, images, channel.kind).ok_or(ProductError::Image(channel.kind))?;
    let is_color = matches!(channel.kind, AovKind::Color | AovKind::Denoised | AovKind::Albedo | AovKind::Light(_));
    let space = file.space.filter(|_| is_color);
    let row = space.and_then(|space| space.from_rec709().get(channel.component).copied());
    Ok(AnyChannel::new(exr_text(channel.name.as_str()), samples(&rows, channel, row)))
}

/// The attributes `worldToCamera` and `worldToNDC` as `OpenEXR` defines them, for points as row vectors: view space
/// looks along -z with +y up, and NDC goes from (0, 0) in the upper left corner of the display window to (1, 1).
#[expect(clippy::cast_possible_truncation, reason = "matrices of a file are of single precision")]
fn matrices(camera: &Camera, file: &ProductFile) -> [[f32; 16]; 2] {
    let view = camera.world_from_view.inverse();
    let [x0, y0, x1, y1] = camera.display_window.map(f64::from);
    // From pixels of the camera's picture to those of the file's.
    let shift = [0, 1].map(|at| f64::from(file.data_corner[at]) - f64::from(camera.data_window[at]));
    let [width, height] = file.display_size.map(|side| f64::from(side.max(1)));
    let of_window = DMat4::from_cols(
        DVec4::X * (0.5 * (x1 - x0) / width),
        DVec4::Y * (0.5 * (y0 - y1) / height),
        DVec4::Z,
        DVec4::new((0.5 * (x0 + x1) + shift[0]) / width, (0.5 * (y0 + y1) + shift[1]) / height, 0.0, 1.0),
    );
    [view, of_window * camera.projection * view].map(|matrix| matrix.to_cols_array().map(|number| number as f32))
}

/// The Cryptomatte layers of a file by name, top row first.
fn mattes(
    file: &ProductFile,
    request: &RenderRequest,
    images: &PublishedImages,
    names: Option<&PrimNames>,
) -> Result<BTreeMap<String, CryptomatteLayer>, ProductError> {
    let mut mattes = BTreeMap::new();
    for channel in &file.channels {
        let new = channel.cryptomatte.as_ref().filter(|layer| !mattes.contains_key(&layer.name));
        let Some(layer) = new else { continue };
        let (Some(names), Some(rows)) = (names, rows(request, images, channel.kind)) else {
            return Err(ProductError::Image(channel.kind));
        };
        let slots: Vec<IdSlot> = rows.iter().flat_map(|row| bytemuck::pod_collect_to_vec::<u8, IdSlot>(row)).collect();
        mattes.insert(layer.name.clone(), cryptomatte::layer(layer, names, &slots));
    }
    Ok(mattes)
}

/// The rendered rows of an image, top row first; `None` if there is no such image.
fn rows<'a>(request: &RenderRequest, images: &'a PublishedImages, kind: AovKind) -> Option<Vec<&'a [u8]>> {
    let bytes = request.image_pixels().saturating_mul(kind.pixel_bytes() as u64);
    let image = images.shown_image(kind).filter(|image| image.len() as u64 == bytes)?;
    request.part().rows(request.width, kind.pixel_bytes()).rev().map(|row| image.get(row)).collect()
}

/// Whether there is no file, or a picture.
fn may_be_replaced(path: &Path) -> bool {
    match std::fs::metadata(path) {
        Err(_) => true,
        // An empty file is what other programs reserve a name with.
        Ok(facts) if facts.is_file() && facts.len() == 0 => true,
        Ok(_) => {
            let mut start = [0; 4];
            let read = oocpt_files::open(path).and_then(|mut file| file.read_exact(&mut start));
            read.is_ok() && start == MAGIC
        }
    }
}

#[expect(clippy::cast_possible_truncation, reason = "the attribute has single precision")]
fn chromaticities(space: &FileSpace) -> Chromaticities {
    let [red, green, blue, white] = space.chromaticities.map(|[x, y]| Vec2(x as f32, y as f32));
    Chromaticities { red, green, blue, white }
}

/// The numbers of a channel, of rows of its image, top row first; with `of_color` the sum of the three components of
/// a pixel by these weights.
fn samples(rows: &[&[u8]], channel: &FileChannel, of_color: Option<[f64; 3]>) -> FlatSamples {
    let (bytes, offset) = (channel.kind.pixel_bytes(), 4 * channel.component);
    let is_id = channel.kind.is_id();
    let word = move |pixel: &[u8]| -> [u8; 4] {
        pixel.get(offset..offset + 4).and_then(|word| word.try_into().ok()).unwrap_or_default()
    };
    #[expect(
        clippy::cast_precision_loss,
        clippy::cast_possible_truncation,
        reason = "whoever asks for ids as floats gets what floats hold; sums are rounded to floats"
    )]
    let float = move |pixel: &[u8]| match of_color {
        Some(weights) => {
            let color = pixel.as_chunks::<4>().0.iter().map(|word| f64::from(f32::from_ne_bytes(*word)));
            color.zip(weights).map(|(component, weight)| component * weight).sum::<f64>() as f32
        }
        None if is_id => i32::from_ne_bytes(word(pixel)) as f32,
        None => f32::from_ne_bytes(word(pixel)),
    };
    #[expect(clippy::cast_possible_truncation, reason = "the cast saturates")]
    let whole = move |pixel: &[u8]| {
        let number = if is_id { i32::from_ne_bytes(word(pixel)) } else { float(pixel) as i32 };
        number.cast_unsigned()
    };
    let rows = || rows.par_iter().flat_map(move |row| row.par_chunks_exact(bytes));
    match channel.format {
        SampleFormat::Half => FlatSamples::F16(rows().map(|pixel| f16::from_f32(float(pixel))).collect()),
        SampleFormat::Float => FlatSamples::F32(rows().map(float).collect()),
        SampleFormat::Uint => FlatSamples::U32(rows().map(whole).collect()),
    }
}

fn compression(compression: FileCompression) -> Compression {
    match compression {
        FileCompression::None => Compression::Uncompressed,
        FileCompression::Rle => Compression::RLE,
        FileCompression::Zips => Compression::ZIP1,
        FileCompression::Zip => Compression::ZIP16,
        FileCompression::Piz => Compression::PIZ,
        FileCompression::Pxr24 => Compression::PXR24,
        FileCompression::B44 => Compression::B44,
        FileCompression::B44a => Compression::B44A,
        FileCompression::Dwaa => Compression::DWAA(None),
        FileCompression::Dwab => Compression::DWAB(None),
    }
}
