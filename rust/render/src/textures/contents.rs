// SPDX-License-Identifier: Apache-2.0
//! What the files of a scene contain, as hashes: the same on every machine, wherever a file is and whenever it was
//! written. Each file is read once, and again when its size or time has changed. Any thread.

use crate::sync::lock;
use crate::textures::image::ImageLibrary;
use oocpt_abi::UDIM_PARTS;
use oocpt_core::scene::AssetRef;
use rustc_hash::FxHashMap;
use std::io::Read as _;
use std::path::Path;
use std::sync::{Arc, Mutex};
use xxhash_rust::xxh3::Xxh3;

const UDIM: &str = "<UDIM>";
/// Bytes that are read at once.
const READ_BYTES: usize = 1 << 20;

/// See the module.
#[derive(Debug, Default)]
pub(crate) struct FileContents {
    /// By the text that changes with the content ([`ImageLibrary::identity`]).
    hashes: Mutex<FxHashMap<String, String>>,
    /// What was said of each file since the last [`Self::begin`].
    said: Mutex<FxHashMap<Arc<str>, String>>,
}

impl FileContents {
    /// From now on files may be others than before.
    pub(crate) fn begin(&self) {
        lock(&self.said).clear();
    }

    /// What a file contains, or each member of a set of files; `images` finds them.
    pub(crate) fn of(&self, asset: &AssetRef, images: Option<&dyn ImageLibrary>) -> String {
        if asset.resolved.is_empty() {
            return lost(asset);
        }
        if let Some(said) = lock(&self.said).get(&asset.resolved) {
            return said.clone();
        }
        let text = if asset.resolved.contains(UDIM) {
            let members = (1001..1001 + UDIM_PARTS).filter_map(|number| {
                let name = |text: &str| text.replace(UDIM, &number.to_string()).into();
                let part = AssetRef { authored: name(&asset.authored), resolved: name(&asset.resolved) };
                Some(format!("{number} {}", self.of_file(&part, images)?))
            });
            members.collect::<Vec<_>>().join(", ")
        } else {
            self.of_file(asset, images).unwrap_or_else(|| lost(asset))
        };
        lock(&self.said).insert(Arc::clone(&asset.resolved), text.clone());
        text
    }

    /// What the names of colour spaces mean: the configuration that the host has, without files that it names.
    pub(crate) fn of_colors(&self, images: Option<&dyn ImageLibrary>) -> String {
        let config = images.map(ImageLibrary::color_config).unwrap_or_default();
        // Place, size and time of a file.
        let hash = config.rsplitn(3, ':').nth(2).and_then(|place| hash_of(Path::new(place)));
        hash.unwrap_or(config)
    }

    fn of_file(&self, asset: &AssetRef, images: Option<&dyn ImageLibrary>) -> Option<String> {
        let stamp = images.map(|images| images.identity(asset));
        let stamp = match stamp {
            Some(Ok(stamp)) => stamp,
            Some(Err(_)) | None => return hash_of(Path::new(&*asset.resolved)),
        };
        // `hash:` has the content already; `file:` the place, size and time of a plain file.
        let Some(plain) = stamp.strip_prefix("file:") else { return Some(stamp) };
        if let Some(hash) = lock(&self.hashes).get(&stamp) {
            return Some(hash.clone());
        }
        let place = plain.rsplitn(3, ':').nth(2)?;
        let hash = hash_of(Path::new(place))?;
        lock(&self.hashes).insert(stamp, hash.clone());
        Some(hash)
    }
}

/// A file that cannot be read gives what the scene says instead of it.
fn lost(asset: &AssetRef) -> String {
    format!("no file {}", asset.authored)
}

/// Hash and length of a file, as [`ImageLibrary::identity`] gives them of files that are not plain.
fn hash_of(path: &Path) -> Option<String> {
    let mut file = oocpt_files::open(path).ok()?;
    let mut hash = Xxh3::new();
    let (mut bytes, mut length) = (vec![0; READ_BYTES], 0_u64);
    loop {
        let read = file.read(&mut bytes).ok()?;
        if read == 0 {
            return Some(format!("hash:{:032x}:{length}", hash.digest128()));
        }
        hash.update(&bytes[..read]);
        length += read as u64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_known_by_their_content_alone() {
        let folder = std::env::temp_dir().join(format!("oocpt-contents-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let file = |name: &str, text: &str| {
            let path = folder.join(name);
            std::fs::write(&path, text).expect("a file");
            AssetRef { authored: name.into(), resolved: path.to_string_lossy().into() }
        };
        let contents = FileContents::default();
        let of = |asset: &AssetRef| contents.of(asset, None);
        let (a, b, c) = (file("a", "same"), file("b", "same"), file("c", "other"));
        assert_eq!(of(&a), of(&b), "another name");
        assert_ne!(of(&a), of(&c), "another content");
        let before = of(&a);
        file("a", "soma");
        assert_eq!(of(&a), before, "said once");
        contents.begin();
        assert_ne!(of(&a), before, "it was written anew");
        let set = file("t.<UDIM>.png", "no member");
        let none = of(&set);
        file("t.1012.png", "texels");
        contents.begin();
        let one = of(&set);
        assert_ne!(one, none, "a member that came");
        std::fs::rename(folder.join("t.1012.png"), folder.join("t.1013.png")).expect("its own");
        contents.begin();
        assert_ne!(of(&set), one, "a member elsewhere");
        let lost = AssetRef { authored: "lost".into(), resolved: "".into() };
        assert_eq!(of(&lost), "no file lost");
        std::fs::remove_dir_all(folder).expect("its own");
    }
}
