// SPDX-License-Identifier: Apache-2.0
//! Render products: files that a batch render writes of its pictures. Plain data.

use crate::job::aov::AovKind;
use crate::job::deep::DeepLimits;
use crate::job::request::RenderRequest;
use oocpt_core::file_space::FileSpace;
use oocpt_core::scene::NamingPrimvar;
use std::path::PathBuf;
use std::sync::Arc;

/// A render product as the scene has it (`UsdRenderProduct`); nothing of it is checked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RenderProduct {
    /// Path of the prim, for messages.
    pub prim: String,
    /// `productType`.
    pub kind: String,
    /// `productName`: a file, which may have a placeholder for the number of the frame.
    pub name: String,
    /// `orderedVars`.
    pub vars: Vec<ProductVar>,
    /// What the host does not have of it, so that there is no picture; continues "the product is not written: ".
    pub missing: String,
    /// Its namespaced settings as text.
    pub settings: Vec<(String, String)>,
    /// Those of these that are numbers.
    pub numbers: Vec<(String, HeaderValue)>,
    /// `renderingColorSpace` of the render settings: the linear space that colours are written in; empty for Rec. 709.
    pub color_space: String,
    /// Width of a pixel over its height.
    pub pixel_aspect: f32,
    /// Columns and rows of the picture that is displayed (`resolution`).
    pub display_size: [u32; 2],
    /// The corner of the pixels in that picture, from its upper left corner, y down. Negative: overscan.
    pub data_corner: [i32; 2],
    /// The frame, if the host tells it.
    pub frame: Option<f64>,
    /// Time codes, which frames are numbered by, per second, if the host tells it.
    pub rate: Option<f64>,
    /// Time codes from the frame to the opening and the closing of the shutter that counts; alike if nothing moves.
    pub shutter: [f64; 2],
    /// The picture it is written of, without images. `None`: the one that the host asks for.
    pub picture: Option<RenderRequest>,
}

/// The value of an attribute of a scene's in the header of a file.
#[derive(Clone, Debug, PartialEq)]
pub enum HeaderValue {
    /// A text.
    Text(String),
    /// A whole number.
    Whole(i32),
    /// A number.
    Real(f64),
}

/// A `UsdRenderVar` of a product.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ProductVar {
    /// Path of the prim; its last name is the layer's.
    pub prim: String,
    /// `dataType`.
    pub data_type: String,
    /// `sourceName`.
    pub source_name: String,
    /// `sourceType`.
    pub source_type: String,
    /// Its namespaced settings as text.
    pub settings: Vec<(String, String)>,
    /// The texts of the primvar that names what it shows, if it is a Cryptomatte with one ([`crate::naming_primvar`]).
    pub naming: Option<Arc<NamingPrimvar>>,
}

/// A setting of a var or a product under one of its names.
pub(crate) fn setting<'a>(settings: &'a [(String, String)], names: &[&str]) -> Option<&'a str> {
    names.iter().find_map(|name| settings.iter().find(|(key, _)| key == name)).map(|(_, value)| value.trim())
}

impl FileChannel {
    /// The part of a file of several parts that it is in: its layer.
    pub(crate) fn part(&self) -> &str {
        match (&self.cryptomatte, self.name.rsplit_once('.')) {
            (Some(layer), _) => &layer.name,
            (None, Some((layer, _))) => layer,
            (None, None) if matches!(&*self.name, "R" | "G" | "B" | "A") => "rgba",
            (None, None) => &self.name,
        }
    }
}

/// How the numbers of a channel are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SampleFormat {
    /// IEEE 754 binary16.
    Half,
    /// IEEE 754 binary32.
    Float,
    /// 32 bits without a sign; -1 is the largest one.
    Uint,
}

/// What a Cryptomatte layer tells apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CryptomatteKind {
    /// Placements of prims.
    Object,
    /// Materials.
    Material,
    /// Outermost instances, or parents of prims.
    Asset,
}

/// A Cryptomatte layer.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct MatteLayer {
    pub(crate) kind: CryptomatteKind,
    pub(crate) name: String,
    /// Names things that have a text of it.
    pub(crate) naming: Option<Arc<NamingPrimvar>>,
}

/// What a channel of a deep image has of a sample.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DeepPart {
    Red,
    Green,
    Blue,
    Alpha,
    Depth,
    Prim,
    Instance,
    /// The hash of a name, as Cryptomatte has it.
    Name,
}

impl DeepPart {
    const ALL: [Self; 8] =
        [Self::Red, Self::Green, Self::Blue, Self::Alpha, Self::Depth, Self::Prim, Self::Instance, Self::Name];

    /// The part that a channel has.
    pub(crate) fn of(channel: &FileChannel) -> Self {
        Self::ALL.get(channel.component).copied().unwrap_or(Self::Depth)
    }
}

/// A channel of a file: one component of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct FileChannel {
    pub(crate) name: String,
    pub(crate) kind: AovKind,
    /// It is one of a Cryptomatte layer, which is made of the image: components are those of the layer.
    pub(crate) cryptomatte: Option<MatteLayer>,
    pub(crate) component: usize,
    pub(crate) format: SampleFormat,
}

/// The compression of an EXR file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum FileCompression {
    None,
    Rle,
    Zips,
    Zip,
    Piz,
    Pxr24,
    B44,
    B44a,
    Dwaa,
    Dwab,
}

impl FileCompression {
    /// Whether deep images are written with it: `OpenEXR` defines only these and `rle` for them.
    pub(crate) fn is_of_deep_images(self) -> bool {
        matches!(self, Self::None | Self::Zips)
    }

    /// Whether floats come back with other bits.
    pub(crate) fn is_lossy(self) -> bool {
        matches!(self, Self::Pxr24 | Self::B44 | Self::B44a | Self::Dwaa | Self::Dwab)
    }
}

/// How the pixels of a file are stored.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct FileStorage {
    /// The side of its tiles; lines without one.
    pub(crate) tiles: Option<u32>,
    /// Each layer is a part of its own.
    pub(crate) has_parts: bool,
}

/// When the picture of a file is of.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct FileTimes {
    pub(crate) frame: Option<f64>,
    /// Frames per second.
    pub(crate) rate: Option<f64>,
    /// Frames to the opening and the closing of the shutter.
    pub(crate) shutter: [f64; 2],
}

/// A file that is to be written of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProductFile {
    /// The prim, for messages.
    pub(crate) prim: String,
    pub(crate) path: PathBuf,
    pub(crate) channels: Vec<FileChannel>,
    /// The limits of its pixels, if it is a deep image; `FileChannel::component` is then a [`DeepPart`].
    pub(crate) deep: Option<DeepLimits>,
    pub(crate) compression: FileCompression,
    pub(crate) storage: FileStorage,
    /// Attributes of the scene's, by name.
    pub(crate) header: Vec<(String, HeaderValue)>,
    /// The space of its colours, if that is not linear Rec. 709.
    pub(crate) space: Option<&'static FileSpace>,
    pub(crate) pixel_aspect: f32,
    pub(crate) display_size: [u32; 2],
    pub(crate) data_corner: [i32; 2],
    pub(crate) times: FileTimes,
    /// A command line moves it to its place: its name is nobody's.
    pub(crate) is_temporary: bool,
}

/// A picture that is rendered before the host's, and the files that are written of it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ProductPicture {
    pub(crate) request: RenderRequest,
    pub(crate) files: Vec<ProductFile>,
}
