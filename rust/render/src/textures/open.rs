// SPDX-License-Identifier: Apache-2.0
//! Opens the image that a texture reads.

use super::image::{ImageError, ImageLibrary};
use super::tiles::{ImageStores, TextureImage, WantedImage};
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::TextureRef;
use std::sync::Arc;

/// `None`: a member of a set that does not exist.
pub(super) type OpenedMember = Result<Option<Arc<TextureImage>>, ImageError>;

/// Opens a member of a set of files; 0 for a single file.
pub(super) fn open(
    library: Option<&Arc<dyn ImageLibrary>>,
    texture: &TextureRef,
    member: u32,
    stores: &ImageStores,
) -> OpenedMember {
    let Some(library) = library else { return Err(ImageError("nobody here can open images".into())) };
    let asset = &texture.asset;
    if asset.resolved.is_empty() {
        return Err(ImageError("the file was not found".into()));
    }
    let name = |text: &str| text.replace("<UDIM>", &member.to_string()).into();
    let file = match member {
        0 => asset.clone(),
        _ => AssetRef { authored: name(&asset.authored), resolved: name(&asset.resolved) },
    };
    let wanted = WantedImage {
        name: &named(texture),
        library,
        asset,
        member,
        file: &file,
        color_space: &texture.color_space,
        is_ptex: texture.is_ptex,
    };
    Ok(TextureImage::open(&wanted, stores)?.map(Arc::new))
}

/// What messages call a texture.
pub(super) fn named(texture: &TextureRef) -> Arc<str> {
    format!("{}: texture {}", texture.prim, texture.asset.authored).into()
}
