// SPDX-License-Identifier: Apache-2.0
//! How often files are decoded, and what is kept of them: on disk, in memory, from render to render.

use super::harness::{encoded, noise, texture};
use crate::textures::{
    ColorTransform, ImageError, ImageInfo, ImageLibrary, PAUSES, SourceImage, TextureCache, TextureImage,
};
use oocpt_core::scene::AssetRef;
use oocpt_core::settings::Settings;
use oocpt_core::texture::{ColorSpace, TexelFormat, Wrap};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

const SIZE: [u32; 2] = [1000, 700];

/// A file that is decoded from top to bottom, and counts how often.
#[derive(Debug)]
struct Stripes {
    decoded: Arc<AtomicU32>,
    rows: u32,
}

impl SourceImage for Stripes {
    fn info(&self) -> ImageInfo {
        let levels = vec![SIZE];
        ImageInfo { levels, channels: 3, format: TexelFormat::U8, tile_friendly: false, is_srgb: None, wrap: None }
    }

    fn read(&self, _: u32, _: [u32; 2], _: [u32; 2], _: &mut [u8]) -> Result<(), ImageError> {
        Err(ImageError("parts of it are dear".into()))
    }

    fn decode(&self, _: u32, sink: &mut dyn FnMut(u32, &[u8]) -> bool) -> Result<(), ImageError> {
        self.decoded.fetch_add(1, Ordering::Relaxed);
        for top in 0..self.rows {
            let y = SIZE[1] - 1 - top;
            let row: Vec<u8> = (0..SIZE[0]).flat_map(|x| (0..3).map(move |c| noise(0, x, y, c))).collect();
            if !sink(top, &row) {
                break;
            }
        }
        if self.rows < SIZE[1] { Err(ImageError("breaks off".into())) } else { Ok(()) }
    }
}

/// Halves what is there.
#[derive(Debug)]
struct Half;

impl ColorTransform for Half {
    fn apply(&self, texels: &mut [f32], _: u32) -> Result<(), ImageError> {
        texels.iter_mut().for_each(|value| *value *= 0.5);
        Ok(())
    }
}

#[derive(Debug, Default)]
struct Library {
    decoded: Arc<AtomicU32>,
    opened: AtomicU32,
    breaks: bool,
    config: String,
}

impl Library {
    fn decoded(&self) -> u32 {
        self.decoded.load(Ordering::Relaxed)
    }
}

impl ImageLibrary for Library {
    fn open(&self, _: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        self.opened.fetch_add(1, Ordering::Relaxed);
        let rows = if self.breaks { SIZE[1] - 1 } else { SIZE[1] };
        Ok(Arc::new(Stripes { decoded: Arc::clone(&self.decoded), rows }))
    }

    fn identity(&self, asset: &AssetRef) -> Result<String, ImageError> {
        Ok(format!("test:{}", asset.resolved))
    }

    fn color_config(&self) -> String {
        self.config.clone()
    }

    fn color_transform(&self, name: &str) -> Result<Arc<dyn ColorTransform>, ImageError> {
        if name == "half" { Ok(Arc::new(Half)) } else { Err(ImageError(format!("{name} is not known"))) }
    }
}

/// A cache folder that is gone at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("oocpt-kept-{name}-{}", std::process::id()));
        if path.exists() {
            std::fs::remove_dir_all(&path).expect("removed");
        }
        Self(path)
    }

    fn settings(&self) -> Settings {
        Settings { texture_cache: self.0.to_string_lossy().into_owned(), ..Settings::default() }
    }

    fn entries(&self) -> Vec<PathBuf> {
        let files = std::fs::read_dir(&self.0).into_iter().flatten().flatten();
        files.map(|file| file.path()).collect()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        if self.0.exists() {
            std::fs::remove_dir_all(&self.0).expect("removed");
        }
    }
}

fn no_disk() -> Settings {
    Settings { texture_cache: "0".into(), ..Settings::default() }
}

/// What a new process would open.
fn open(library: &Arc<Library>, settings: &Settings, space: ColorSpace) -> (Arc<TextureImage>, Vec<String>) {
    let library: Arc<dyn ImageLibrary> = Arc::clone(library) as Arc<dyn ImageLibrary>;
    let mut cache = TextureCache::default();
    cache.keep_in(settings);
    let set = cache.sync(Some(&library), &[texture("file", [Wrap::Repeat; 2], space)]);
    (Arc::clone(set.images().next().expect("it opens").0), set.warnings.clone())
}

fn all_tiles(image: &TextureImage) -> Vec<Vec<u8>> {
    (0..image.layout().tile_count()).map(|tile| image.tile(tile)).collect()
}

/// The first tile of a level.
fn tile_of(image: &TextureImage, level: u32) -> u32 {
    image.layout().first_tile(level)
}

#[test]
fn a_file_is_decoded_once_for_all_its_tiles_and_never_again() {
    let folder = Folder::new("once");
    let library = Arc::new(Library::default());
    let (image, _) = open(&library, &folder.settings(), ColorSpace::Auto);
    (0..image.layout().tile_count()).for_each(|tile| image.expect(tile));
    let tiles = all_tiles(&image);
    assert_eq!((library.decoded(), folder.entries().len()), (1, 1), "one decoding, one file");
    let texel = tiles[0][..4].to_vec();
    assert_eq!(texel, [noise(0, 0, 0, 0), noise(0, 0, 0, 1), noise(0, 0, 0, 2), 255], "the lowest left texel");
    let (again, _) = open(&library, &folder.settings(), ColorSpace::Auto);
    assert!(all_tiles(&again) == tiles, "the same from disk");
    assert_eq!((library.decoded(), library.opened.load(Ordering::Relaxed)), (1, 1), "not even opened");
    let (raw, _) = open(&library, &folder.settings(), ColorSpace::Raw);
    assert!(all_tiles(&raw) != tiles, "means of other values");
    let (in_memory, _) = open(&library, &no_disk(), ColorSpace::Auto);
    (0..in_memory.layout().tile_count()).for_each(|tile| in_memory.expect(tile));
    let before = library.decoded();
    assert!(all_tiles(&in_memory) == tiles, "the same from memory");
    assert_eq!(library.decoded(), before + 1, "one decoding");
}

#[test]
fn threads_that_ask_at_the_same_time_wait_for_one_decoding() {
    let folder = Folder::new("threads");
    let library = Arc::new(Library::default());
    let (image, _) = open(&library, &folder.settings(), ColorSpace::Auto);
    image.expect(0);
    std::thread::scope(|scope| {
        for tile in 0..8 {
            let image = &image;
            scope.spawn(move || assert!(image.tile(tile).iter().any(|byte| *byte != 0), "tile {tile}"));
        }
    });
    assert_eq!(library.decoded(), 1, "one decoding");
}

#[test]
fn only_visible_levels_are_cached_until_finer_ones_are_needed() {
    let folder = Folder::new("levels");
    let library = Arc::new(Library::default());
    let (image, _) = open(&library, &folder.settings(), ColorSpace::Auto);
    let far = image.tile(tile_of(&image, 3));
    let bytes = |folder: &Folder| folder.entries()[0].metadata().expect("there").len();
    let few = bytes(&folder);
    image.tile(tile_of(&image, 2));
    assert_eq!(library.decoded(), 1, "a level finer is there");
    let near = image.tile(tile_of(&image, 0));
    assert_eq!(library.decoded(), 2, "all of it is not");
    assert!(bytes(&folder) > 8 * few, "{few} and {} bytes", bytes(&folder));
    let (again, _) = open(&library, &folder.settings(), ColorSpace::Auto);
    assert!(again.tile(tile_of(&again, 0)) == near && again.tile(tile_of(&again, 3)) == far, "the same from disk");
    assert_eq!(library.decoded(), 2, "and no more decoding");
}

#[test]
fn a_damaged_entry_is_made_again() {
    let folder = Folder::new("damaged");
    let library = Arc::new(Library::default());
    let (image, _) = open(&library, &folder.settings(), ColorSpace::Auto);
    let whole = image.tile(0);
    let path = &folder.entries()[0];
    let mut bytes = std::fs::read(path).expect("there");
    bytes[5000] ^= 1;
    std::fs::write(path, bytes).expect("written");
    let (again, _) = open(&library, &folder.settings(), ColorSpace::Auto);
    assert_eq!(library.decoded(), 1, "its directory is whole");
    assert!((0..again.layout().tile_count()).all(|tile| again.tile(tile) == image.tile(tile)), "every tile");
    assert!(again.tile(0) == whole && again.take_complaint().is_none(), "nothing is said");
    assert!(library.decoded() >= 2, "it was decoded again");
}

#[test]
fn a_truncated_file_is_given_up_and_not_cached() {
    for settings in [Folder::new("torn").settings(), no_disk()] {
        let library = Arc::new(Library { breaks: true, ..Library::default() });
        let (image, _) = open(&library, &settings, ColorSpace::Auto);
        let tiles = all_tiles(&image);
        assert!(tiles.iter().flatten().all(|byte| *byte == 0) && image.is_broken(0), "nothing is shown");
        assert!(image.take_complaint().is_some_and(|text| text.contains("breaks off")), "one complaint");
        let tries = 1 + u32::try_from(PAUSES.len()).expect("few");
        assert_eq!(library.decoded(), tries, "it was tried again after each pause, and not for each tile");
        let left = std::fs::read_dir(&settings.texture_cache).into_iter().flatten().count();
        assert_eq!(left, 0, "nothing is left on disk");
    }
}

#[test]
fn named_colour_spaces_go_through_their_conversion() {
    let folder = Folder::new("named");
    let library = Arc::new(Library::default());
    let (image, warnings) = open(&library, &folder.settings(), ColorSpace::Named("half".into()));
    let (tile, byte) = (image.tile(0), noise(0, 0, 0, 0));
    let expected = half::f16::from_f32(f32::from(byte) / 255.0 * 0.5);
    assert_eq!((tile[..2].to_vec(), warnings.len()), (expected.to_ne_bytes().to_vec(), 0), "linear, in half precision");
    assert_eq!(image.info().format, TexelFormat::F16, "8 bits are too few for linear values");
    let (again, _) = open(&library, &folder.settings(), ColorSpace::Named("half".into()));
    assert!(again.tile(0) == tile && library.decoded() == 1, "the same from disk");
    let other = Arc::new(Library { config: "another".into(), ..Library::default() });
    open(&other, &folder.settings(), ColorSpace::Named("half".into())).0.tile(0);
    assert_eq!(other.decoded(), 1, "names may mean something else there");
    let (unknown, warnings) = open(&library, &folder.settings(), ColorSpace::Named("nobody's".into()));
    assert!(warnings.len() == 1 && warnings[0].contains("nobody's"), "one warning: {warnings:?}");
    let (auto, _) = open(&library, &no_disk(), ColorSpace::Auto);
    assert!(unknown.tile(0) == auto.tile(0), "and the file's own colour space");
}

#[test]
fn host_texels_match_device_tiles() {
    let library = Arc::new(Library::default());
    let (image, _) = open(&library, &no_disk(), ColorSpace::Raw);
    let view: &dyn SourceImage = &*image;
    assert_eq!(view.info().levels.len() as u32, image.layout().levels(), "all levels");
    for (level, at, size) in
        [(0, [0, 0], [1, 1]), (0, [100, 90], [300, 260]), (0, [0, 699], [1000, 1]), (2, [5, 3], [200, 150])]
    {
        let mut out = vec![0; (size[0] * size[1] * 3) as usize];
        view.read(level, at, size, &mut out).expect("there");
        if level == 0 {
            let expected: Vec<u8> = (at[1]..at[1] + size[1])
                .flat_map(|y| (at[0]..at[0] + size[0]).map(move |x| (x, y)))
                .flat_map(|(x, y)| (0..3).flat_map(move |c| encoded(noise(0, x, y, c), TexelFormat::U8)))
                .collect();
            assert!(out == expected, "{at:?}, {size:?}");
        }
        let mean = out.iter().map(|byte| f64::from(*byte)).sum::<f64>() / out.len() as f64;
        assert!(size[0] < 100 || (mean - 127.5).abs() < 3.0, "level {level}: {mean}");
    }
}
