// SPDX-License-Identifier: Apache-2.0
//! Files one by one: what is said of them, and filling the cache.

use super::harness::{Procedural, image};
use crate::textures::{FileReport, ImageError, ImageInfo, ImageLibrary, SourceImage, TextureFile};
use oocpt_core::scene::AssetRef;
use oocpt_core::settings::Settings;
use oocpt_core::texture::{ColorSpace, TexelFormat};
use std::path::PathBuf;
use std::sync::Arc;

/// One image under any name but "gone"; those under "broken" break off.
#[derive(Debug)]
struct Library(Arc<Procedural>);

#[derive(Debug)]
struct Broken(Arc<Procedural>);

impl SourceImage for Broken {
    fn info(&self) -> ImageInfo {
        self.0.info()
    }

    fn read(&self, _: u32, _: [u32; 2], _: [u32; 2], _: &mut [u8]) -> Result<(), ImageError> {
        Err(ImageError("ends early".into()))
    }
}

impl ImageLibrary for Library {
    fn open(&self, asset: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
        match &*asset.resolved {
            "gone" => Err(ImageError("cannot be found".into())),
            "broken" => Ok(Arc::new(Broken(Arc::clone(&self.0)))),
            _ => Ok(Arc::clone(&self.0) as Arc<dyn SourceImage>),
        }
    }

    fn identity(&self, asset: &AssetRef) -> Result<String, ImageError> {
        Ok(format!("file:{}", asset.resolved))
    }
}

/// Asks for one file of a library with one image.
struct Bench {
    library: Arc<dyn ImageLibrary>,
    settings: Settings,
}

impl Bench {
    fn new(name: &str, image: Arc<Procedural>) -> Self {
        let folder = std::env::temp_dir().join(format!("oocpt-file-{name}-{}", std::process::id()));
        let texture_cache = folder.to_str().expect("UTF-8").to_owned();
        Self { library: Arc::new(Library(image)), settings: Settings { texture_cache, ..Settings::default() } }
    }

    fn ask(&self, is_filled: bool, name: &str, color_space: ColorSpace) -> Result<FileReport, ImageError> {
        let asset = AssetRef { authored: name.into(), resolved: name.into() };
        let Self { library, settings } = self;
        let file = TextureFile { library, asset: &asset, color_space: &color_space, settings };
        if is_filled { file.fill() } else { file.inspect() }
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        let folder = PathBuf::from(&self.settings.texture_cache);
        if folder.exists() {
            std::fs::remove_dir_all(folder).expect("it is ours");
        }
    }
}

#[test]
fn prefilled_entries_are_found_by_renders() {
    let bench = Bench::new("fill", image([300, 200], 3, TexelFormat::U8));
    let before = bench.ask(false, "a", ColorSpace::Auto).expect("it is there");
    assert_eq!((before.size, before.levels, before.channels, before.format), ([300, 200], 1, 3, "u8"), "what it is");
    assert!(before.is_srgb && before.why.contains("8 bits") && !before.is_direct, "{before:?}");
    assert_eq!((before.cache.bytes, before.cache.first_level), (None, None), "nothing yet");
    assert_eq!(before.cache.key, "file:a as Auto", "the key of renders");
    let filled = bench.ask(true, "a", ColorSpace::Auto).expect("it is decoded");
    assert_eq!(filled.cache.first_level, Some(0), "all levels");
    let length = std::fs::metadata(&filled.cache.path).expect("it is there").len();
    assert_eq!(filled.cache.bytes, Some(length), "where it says, as large as it says");
    assert!(length > 300 * 200 * 3, "every texel");
    assert_eq!(bench.ask(false, "a", ColorSpace::Auto).expect("there"), filled, "and it stays");
    assert_eq!(bench.ask(true, "a", ColorSpace::Auto).expect("there"), filled, "once is enough");
    let raw = bench.ask(false, "a", ColorSpace::Raw).expect("there");
    assert!(raw.cache.bytes.is_none() && !raw.is_srgb, "read otherwise it is another entry: {raw:?}");
}

#[test]
fn textures_that_cannot_be_cached_are_errors() {
    let mut bench = Bench::new("errors", image([70, 70], 1, TexelFormat::F16));
    let error = |bench: &Bench, is_filled, name| {
        bench.ask(is_filled, name, ColorSpace::Auto).expect_err("it cannot be").to_string()
    };
    assert_eq!(error(&bench, true, "gone"), "cannot be found", "no file");
    assert_eq!(error(&bench, false, "gone"), "cannot be found", "no file");
    assert!(error(&bench, true, "broken").contains("ends early"), "its own reason");
    bench.ask(false, "broken", ColorSpace::Auto).expect("its head is whole");
    let named = bench.ask(true, "a", ColorSpace::Named("none".into())).expect_err("no such space").to_string();
    assert!(named.contains("`none` is not known"), "{named}");
    let folder = std::mem::replace(&mut bench.settings.texture_cache, "0".to_owned());
    assert!(error(&bench, true, "a").contains("turned off"), "no cache");
    bench.settings.texture_cache = "/dev/null/cache".to_owned();
    assert!(error(&bench, true, "a").contains("cannot be written"), "no folder");
    bench.settings.texture_cache = folder;
    bench.ask(true, "a", ColorSpace::Auto).expect("all is well");
}

#[test]
fn tiled_files_with_all_levels_need_no_cache() {
    let plain = image([256, 128], 4, TexelFormat::U8);
    let levels = (0..9).map(|level| [(256 >> level).max(1), (128 >> level).max(1)]).collect();
    let info = ImageInfo { levels, ..plain.info() };
    let bench = Bench::new("tiled", Arc::new(Procedural { info, byte: plain.byte }));
    let report = bench.ask(true, "a", ColorSpace::Auto).expect("it is there");
    assert!(report.is_direct && report.is_tiled && report.levels == 9 && report.cache.bytes.is_none(), "{report:?}");
    assert!(!PathBuf::from(&bench.settings.texture_cache).exists(), "nothing was written");
}
