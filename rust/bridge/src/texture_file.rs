// SPDX-License-Identifier: Apache-2.0
//! Texture files without a render: `oocpt texture` has them looked at and converted inside a host, so that the host's
//! resolver and readers give the entries of the cache the keys that its renders look for. Any thread, several files at
//! once.

use crate::ffi_images::ImageSource;
use crate::guard::{BridgeError, guard};
use crate::images::HostImages;
use crate::logging;
use crate::settings::SettingLayers;
use cxx::UniquePtr;
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::ColorSpace;
use oocpt_render::textures::{FileReport, ImageError, ImageLibrary, TextureFile};
use serde::Serialize;
use std::sync::Arc;

/// What is said of a file.
#[derive(Serialize)]
#[serde(untagged)]
enum FileAnswer {
    Report(Box<FileReport>),
    Failed { error: String },
}

/// Looks at a file (`info`) or puts it into the cache (`convert`); the answer is a JSON object with what the file is,
/// or with `error`. The
/// cache is where `OOCPT_TEXTURE_CACHE` says. `color_space` is a `sourceColorSpace`.
pub(crate) fn texture_file(
    images: UniquePtr<ImageSource>,
    command: &str,
    resolved: &str,
    color_space: &str,
) -> Result<String, BridgeError> {
    guard("texture_file", || {
        logging::install();
        let result = run(Arc::new(HostImages::new(images)), command, resolved, color_space);
        let answer = match result {
            Ok(report) => FileAnswer::Report(Box::new(report)),
            Err(error) => FileAnswer::Failed { error: error.0 },
        };
        // Numbers and texts are always JSON.
        Ok(serde_json::to_string(&answer).unwrap_or_else(|_| r#"{"error": "nothing can be said of it"}"#.to_owned()))
    })
}

fn run(
    library: Arc<dyn ImageLibrary>,
    command: &str,
    resolved: &str,
    color_space: &str,
) -> Result<FileReport, ImageError> {
    let (layers, _warnings) = SettingLayers::new(|name| std::env::var(name).ok());
    let asset = AssetRef { authored: resolved.into(), resolved: resolved.into() };
    let (settings, color_space) = (layers.settings(), space(color_space));
    let file = TextureFile { library: &library, asset: &asset, color_space: &color_space, settings: &settings };
    match command {
        "info" => file.inspect(),
        "convert" => file.fill(),
        _ => Err(ImageError(format!("`{command}` is nothing that can be done with a file"))),
    }
}

/// What a `sourceColorSpace` means.
fn space(name: &str) -> ColorSpace {
    match name {
        "" | "auto" => ColorSpace::Auto,
        "raw" => ColorSpace::Raw,
        "sRGB" => ColorSpace::Srgb,
        name => ColorSpace::Named(name.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_are_reported_as_json() {
        let said = |command, path| texture_file(UniquePtr::null(), command, path, "auto").expect("no panic");
        assert_eq!(said("info", ""), r#"{"error":"cannot be found"}"#, "an unresolved path");
        assert_eq!(said("info", "/a.png"), r#"{"error":"cannot be read: the host gives no files"}"#, "no source");
        assert!(said("eat", "/a.png").contains("`eat` is nothing"), "an unknown command");
    }

    #[test]
    fn color_spaces_go_by_the_names_of_usd() {
        assert_eq!([space(""), space("auto"), space("raw")], [ColorSpace::Auto, ColorSpace::Auto, ColorSpace::Raw]);
        assert_eq!([space("sRGB"), space("ACEScg")], [ColorSpace::Srgb, ColorSpace::Named("ACEScg".into())]);
    }
}
