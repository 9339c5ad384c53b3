// SPDX-License-Identifier: Apache-2.0
//! What the settings of a product say of its file: tiles, parts, and attributes of the scene's for the header. Pure.

use crate::job::product::{FileStorage, HeaderValue, RenderProduct, setting};

/// Most attributes of a scene's in a header.
const MAX_ATTRIBUTES: usize = 64;
/// Most bytes of a name, and of a text: every reader of the file takes the header into memory.
const MAX_NAME: usize = 96;
const MAX_TEXT: usize = 4096;
/// Sides of tiles, pixels.
const TILE_SIDES: std::ops::RangeInclusive<u32> = 8..=4096;
const DEFAULT_TILE: u32 = 64;

/// Settings that say whether a file has tiles, by those who write scenes: OocPT's, Karma's, Arnold's.
const TILED: [&str; 4] = ["oocpt:tiled", "driver:parameters:OpenEXR:tiled", "arnold:driver_exr:tiled", "arnold:tiled"];
/// The same by a word.
const STORAGE: [&str; 2] = ["driver:parameters:OpenEXR:storage", "karma:image_mode"];
const TILE_SIZE: [&str; 2] = ["oocpt:tileSize", "driver:parameters:OpenEXR:tilesize"];
/// Settings that say whether each layer is a part of its own.
const PARTS: [&str; 4] =
    ["oocpt:multipart", "driver:parameters:OpenEXR:multipart", "arnold:driver_exr:multipart", "arnold:multipart"];
/// Settings of Karma's that become attributes of their last name.
const NOTES: [&str; 3] = ["driver:parameters:artist", "driver:parameters:comment", "driver:parameters:hostname"];
/// Settings that become attributes called by the rest of the name: Karma's and `RenderMan`'s.
const ATTRIBUTES: [&str; 3] =
    ["driver:parameters:OpenEXR:", "driver:parameters:exrheader_", "ri:displayDriver:exrheader_"];
/// Settings among these that are about the file.
const OPTIONS: [&str; 8] =
    ["tiled", "storage", "tilesize", "multipart", "compression", "dwa_compression", "asrgba", "autocrop"];
/// Attributes that `OpenEXR` defines, of other types than text, or that a product has of itself.
const RESERVED: [&str; 48] = [
    "adoptedNeutral",
    "altitude",
    "aperture",
    "channels",
    "chromaticities",
    "chunkCount",
    "compression",
    "dataWindow",
    "deepImageState",
    "displayWindow",
    "dwaCompressionLevel",
    "envmap",
    "expTime",
    "focus",
    "frame",
    "framesPerSecond",
    "idManifest",
    "imageCounter",
    "isoSpeed",
    "keyCode",
    "latitude",
    "lineOrder",
    "lookModTransform",
    "longitude",
    "maxSamplesPerPixel",
    "multiView",
    "name",
    "near",
    "far",
    "fieldOfView",
    "originalDataWindow",
    "pixelAspectRatio",
    "preview",
    "renderingTransform",
    "screenWindowCenter",
    "screenWindowWidth",
    "software",
    "tiles",
    "timeCode",
    "type",
    "utcOffset",
    "version",
    "view",
    "whiteLuminance",
    "worldToCamera",
    "worldToNDC",
    "wrapmodes",
    "xDensity",
];
/// Those that it defines as text.
const TEXTS: [&str; 4] = ["owner", "comments", "capDate", "reelName"];

/// How the pixels of a product's file are stored.
pub(super) fn storage(product: &RenderProduct, warnings: &mut Vec<String>) -> FileStorage {
    let is_on = |names: &[&str]| setting(&product.settings, names).is_some_and(|text| matches!(text, "true" | "1"));
    let mode = setting(&product.settings, &STORAGE).unwrap_or_default();
    let is_tiled = is_on(&TILED) || matches!(mode, "tiled" | "tile");
    let size = setting(&product.settings, &TILE_SIZE).filter(|_| is_tiled);
    let side = size.map_or(Some(DEFAULT_TILE), |text| text.parse().ok().filter(|side| TILE_SIDES.contains(side)));
    if side.is_none() {
        let text = format!("tiles have {} to {} pixels a side", TILE_SIDES.start(), TILE_SIDES.end());
        warnings.push(format!("{}: {text}; {DEFAULT_TILE} is used", product.prim));
    }
    FileStorage { tiles: is_tiled.then_some(side.unwrap_or(DEFAULT_TILE)), has_parts: is_on(&PARTS) }
}

/// The name of the attribute that a setting becomes.
fn attribute_name(key: &str) -> Option<&str> {
    if NOTES.contains(&key) {
        return key.rsplit(':').next();
    }
    let name = ATTRIBUTES.iter().find_map(|prefix| key.strip_prefix(prefix))?;
    (!OPTIONS.contains(&name)).then_some(name)
}

/// Why there cannot be such an attribute.
fn refusal(name: &str) -> Option<&'static str> {
    let is_plain = name.chars().all(|c| c.is_ascii_graphic()) && (1..=MAX_NAME).contains(&name.len());
    if !is_plain {
        Some("is no name of up to 96 plain characters")
    } else if RESERVED.contains(&name) || name.starts_with("oocpt:") || name.starts_with("cryptomatte/") {
        Some("has another meaning")
    } else {
        None
    }
}

/// Attributes of the scene's for the header of a product's file: names and values.
pub(super) fn attributes(product: &RenderProduct, warnings: &mut Vec<String>) -> Vec<(String, HeaderValue)> {
    let mut found: Vec<(String, HeaderValue)> = Vec::new();
    for (key, text) in &product.settings {
        let Some(name) = attribute_name(key).filter(|_| !text.is_empty()) else { continue };
        if let Some(why) = refusal(name) {
            let short: String = name.chars().take(MAX_NAME).collect();
            warnings.push(format!("{}: no attribute of the file: {short:?} {why}", product.prim));
        } else if found.len() >= MAX_ATTRIBUTES {
            warnings.push(format!("{}: a file has {MAX_ATTRIBUTES} attributes of the scene at most", product.prim));
            break;
        } else if found.iter().all(|(have, _)| have != name) {
            let number = product.numbers.iter().find(|(have, _)| have == key && !TEXTS.contains(&name));
            let value = number.map_or_else(|| HeaderValue::Text(shortened(text)), |(_, number)| number.clone());
            found.push((name.to_owned(), value));
        }
    }
    found
}

/// The text as far as there is room for it. Readers differ about characters beyond ASCII.
fn shortened(text: &str) -> String {
    text.chars().take(MAX_TEXT).map(|c| if c.is_ascii() && c != '\0' { c } else { '?' }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product(settings: &[(&str, &str)]) -> RenderProduct {
        let settings = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
        RenderProduct { prim: "/p".into(), settings, ..RenderProduct::default() }
    }

    #[test]
    fn tiles_and_parts_go_by_the_names_of_other_renderers() {
        let mut warnings = Vec::new();
        let mut of = |settings: &[(&str, &str)]| storage(&product(settings), &mut warnings);
        assert_eq!(of(&[]), FileStorage::default(), "lines, one part");
        for (key, value) in [
            ("oocpt:tiled", "true"),
            ("arnold:driver_exr:tiled", "1"),
            ("driver:parameters:OpenEXR:storage", "tiled"),
            ("karma:image_mode", "tile"),
        ] {
            assert_eq!(of(&[(key, value)]), FileStorage { tiles: Some(64), has_parts: false }, "{key}");
        }
        assert_eq!(of(&[("arnold:driver_exr:tiled", "false"), ("oocpt:tileSize", "32")]), FileStorage::default());
        assert!(of(&[("driver:parameters:OpenEXR:multipart", "true")]).has_parts);
        assert_eq!(of(&[("oocpt:tiled", "true"), ("oocpt:tileSize", "32")]).tiles, Some(32));
        for size in ["0", "7", "-3", "1e9", "x", "4097"] {
            assert_eq!(of(&[("oocpt:tiled", "true"), ("oocpt:tileSize", size)]).tiles, Some(64), "{size}");
        }
        assert_eq!(warnings.len(), 6, "{warnings:?}");
    }

    #[test]
    fn attributes_of_a_scene_are_few_short_and_its_own() {
        let long = "x".repeat(MAX_NAME + 1);
        let prefix = ATTRIBUTES[0];
        let key = |name: &str| format!("{prefix}{name}");
        let mut settings = vec![
            ("driver:parameters:artist".to_owned(), "Zo\u{eb}".to_owned()),
            ("driver:parameters:comment".to_owned(), String::new()),
            (key("compression"), "zips".to_owned()),
            (key("shot:take"), "7".to_owned()),
            (key("owner"), "8".to_owned()),
            (key("notes"), "n".repeat(10_000)),
        ];
        settings.extend(
            ["channels", "oocpt:samples", "cryptomatte/x/name", "a b", "", &long].map(|n| (key(n), "1".into())),
        );
        let numbers = ["shot:take", "owner"].map(|name| (key(name), HeaderValue::Whole(7))).to_vec();
        let mut product = RenderProduct { prim: "/p".into(), settings, numbers, ..RenderProduct::default() };
        let mut warnings = Vec::new();
        let found = attributes(&product, &mut warnings);
        let text = |text: &str| HeaderValue::Text(text.to_owned());
        let expected = [("artist", text("Zo?")), ("shot:take", HeaderValue::Whole(7)), ("owner", text("8"))];
        assert_eq!(found[..3], expected.map(|(name, value)| (name.to_owned(), value)));
        assert_eq!(found[3..], [("notes".to_owned(), text(&"n".repeat(MAX_TEXT)))]);
        assert_eq!(warnings.len(), 6, "{warnings:?}");
        product.settings = (0..100).map(|at| (key(&format!("n{at}")), "1".to_owned())).collect();
        warnings.clear();
        assert_eq!((attributes(&product, &mut warnings).len(), warnings.len()), (MAX_ATTRIBUTES, 1));
    }
}
