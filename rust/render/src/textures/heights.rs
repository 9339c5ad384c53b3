// SPDX-License-Identifier: Apache-2.0
//! Textures that displace surfaces or cut them out, read through the same cache as those that the device sees. Called
//! by the threads that build meshes during a commit; decoding uses no rayon pool, so nobody waits in a circle.

use super::convert::make_finite;
use super::disk::DiskCache;
use super::image::{ImageLibrary, SourceImage};
use super::set::open;
use super::texels::StoredTexels;
use super::tiles::{ImageStores, TextureImage};
use crate::sync::lock;
use oocpt_abi::TILE_SIDE;
use oocpt_core::settings::Settings;
use oocpt_core::texture::{HeightFiles, HeightImage, TexelFormat, TextureRef, TileLayout, Wrap};
use std::sync::{Arc, Mutex};

/// See the module.
#[derive(Debug)]
pub(crate) struct HeightTextures {
    library: Arc<dyn ImageLibrary>,
    disk: Mutex<HeightDisk>,
}

/// The cache on disk, and the settings that it is made from.
#[derive(Debug, Default)]
struct HeightDisk {
    folder: Option<(String, u32)>,
    cache: Option<Arc<DiskCache>>,
}

impl HeightTextures {
    pub(crate) fn new(library: Arc<dyn ImageLibrary>) -> Self {
        Self { library, disk: Mutex::default() }
    }

    /// Keeps decoded images where the settings say, from now on.
    pub(crate) fn keep_in(&self, settings: &Settings) {
        let folder = (settings.texture_cache.clone(), settings.texture_cache_mib);
        let mut disk = lock(&self.disk);
        if disk.folder.as_ref() != Some(&folder) {
            disk.folder = Some(folder);
            disk.cache = None;
        }
    }

    /// The cache; opened by the first texture.
    fn disk(&self) -> Option<Arc<DiskCache>> {
        let mut disk = lock(&self.disk);
        if disk.cache.is_none() {
            let (path, mib) = disk.folder.clone()?;
            disk.cache = DiskCache::of_setting(&path, mib).map(Arc::new);
        }
        disk.cache.clone()
    }
}

impl HeightFiles for HeightTextures {
    fn open(&self, texture: &TextureRef, member: u32) -> Result<Option<Arc<dyn HeightImage>>, String> {
        let stores = ImageStores { disk: self.disk(), ..ImageStores::default() };
        let image = open(Some(&self.library), texture, member, &stores).map_err(|error| error.to_string())?;
        Ok(image.map(|image| Arc::new(OpenHeight(image)) as Arc<dyn HeightImage>))
    }
}

/// An open image. Decoded rows live as long as it does, which is a commit.
#[derive(Debug)]
struct OpenHeight(Arc<TextureImage>);

impl HeightImage for OpenHeight {
    fn layout(&self) -> TileLayout {
        *self.0.layout()
    }

    fn wrap(&self) -> Option<[Wrap; 2]> {
        self.0.info().wrap
    }

    fn channel(&self, level: u32, channel: u8) -> Result<Vec<f32>, String> {
        let mut out = read_channel(&self.0, level, channel)?;
        make_finite(&mut out);
        Ok(out)
    }

    fn rows(&self, channel: u8, sink: &mut dyn FnMut(&[f32])) -> Result<(), String> {
        if has_curve_of_device(&self.0, channel) {
            return Err("its curve is the device's own".into());
        }
        read_channel_by_bands(&self.0, 0, channel, sink)
    }
}

/// The curve of floats is worked out by the device, which may round otherwise.
pub(super) fn has_curve_of_device(image: &TextureImage, channel: u8) -> bool {
    image.is_srgb() && image.info().format != TexelFormat::U8 && channel < 3
}

/// A channel of a level of an image, row by row.
fn read_channel(image: &TextureImage, level: u32, channel: u8) -> Result<Vec<f32>, String> {
    let mut out = Vec::new();
    read_channel_by_bands(image, level, channel, &mut |band| out.extend_from_slice(band))?;
    Ok(out)
}

/// Most texels that are decoded at once, unless a row of a tile has more.
const BAND_TEXELS: u32 = 1 << 20;

/// A channel of a level of an image, from the bottom on, in bands of whole rows: what is held of it is one band.
pub(super) fn read_channel_by_bands(
    image: &TextureImage,
    level: u32,
    channel: u8,
    sink: &mut dyn FnMut(&[f32]),
) -> Result<(), String> {
    let info = SourceImage::info(image);
    let texels = StoredTexels::new(&info, image.is_srgb());
    let [width, height] = image.layout().level_size(level);
    let most = (BAND_TEXELS / width.max(1)).clamp(TILE_SIDE / 8, TILE_SIDE);
    let (mut raw, mut values, mut band) = (Vec::new(), Vec::new(), Vec::new());
    for bottom in (0..height).step_by(most as usize) {
        let rows = most.min(height - bottom);
        let count = width as usize * rows as usize;
        raw.clear();
        raw.resize(count * texels.file_bytes(), 0);
        image.read(level, [0, bottom], [width, rows], &mut raw).map_err(|error| error.to_string())?;
        values.clear();
        values.resize(count * texels.channels(), 0.0);
        texels.decode(&raw, &mut values);
        band.clear();
        band.extend(values.chunks_exact(texels.channels()).map(|texel| picked(texel, channel)));
        sink(&band);
    }
    Ok(())
}

/// A channel of a texel, as `oocpt_core::texture::expand` says.
fn picked(texel: &[f32], channel: u8) -> f32 {
    match (texel, channel) {
        ([r] | [r, _], 0..=2) => *r,
        ([_] | [_, _, _], 3) => 1.0,
        ([_, a], _) => *a,
        (texel, channel) => texel.get(usize::from(channel)).copied().unwrap_or(0.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use oocpt_core::texture::expand;

    #[test]
    fn height_channels_expand_as_on_the_device() {
        let texel = [0.1_f32, 0.2, 0.3, 0.4];
        for count in 1..=4 {
            let wide: Vec<f64> = texel[..count].iter().map(|v| f64::from(*v)).collect();
            for channel in 0..4_u8 {
                let expected = expand(&wide)[usize::from(channel)];
                let found = f64::from(picked(&texel[..count], channel));
                assert!((found - expected).abs() < 1e-9, "channel {channel} of {count}: {found}");
            }
        }
    }
}
