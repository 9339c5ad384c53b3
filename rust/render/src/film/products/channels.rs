// SPDX-License-Identifier: Apache-2.0
//! The channels that a render var becomes. Pure.

use super::{cryptomatte, sources};
use crate::job::aov::AovKind;
use crate::job::deep::DeepLimits;
use crate::job::expression::has_paths;
use crate::job::product::{CryptomatteKind, DeepPart, FileChannel, MatteLayer, ProductVar, SampleFormat, setting};

/// What a user should know of a var that is there.
pub(super) fn remark_of_names(var: &ProductVar) -> Option<String> {
    let primvar = sources::cryptomatte(var).ok().flatten()?.primvar?;
    let is_unused = var.naming.as_ref().is_none_or(|naming| naming.texts.is_empty());
    is_unused.then(|| format!("nothing has a text in the primvar {primvar}; names are those of its own"))
}

/// What a user should know of a channel that is there.
pub(super) fn remark(channel: &FileChannel) -> Option<String> {
    let expression = channel.kind.expression().filter(|_| channel.component == 0)?;
    (!has_paths(expression)).then(|| format!("is black: no light path is of {}", expression.text()))
}

/// Components of a data type, and the format of its numbers.
fn data_type(name: &str) -> (usize, SampleFormat) {
    let base = name.split(['[', ' ']).next().unwrap_or(name);
    let components = base.chars().find_map(|c| c.to_digit(10)).map_or(1, |count| count as usize);
    let is_half = base.starts_with("half") || (base.ends_with('h') && base.contains(|c: char| c.is_ascii_digit()));
    let format = match base {
        _ if is_half => SampleFormat::Half,
        _ if base.starts_with("int") || base.starts_with("uint") => SampleFormat::Uint,
        _ => SampleFormat::Float,
    };
    (components, format)
}

/// The channels of a var in a file that has `before`; or why there are none.
pub(super) fn of_var(var: &ProductVar, before: &[FileChannel]) -> Result<Vec<FileChannel>, String> {
    if let Some(source) = sources::cryptomatte(var)? {
        let level = source.level;
        let naming = var.naming.clone();
        let mut channels = of_cryptomatte(MatteLayer { kind: source.kind, name: layer_name(var), naming }, level);
        // Arnold's users list a layer of ranks beside the whole.
        channels.retain(|channel| level.is_none() || !before.contains(channel));
        return free(channels, before);
    }
    let row = sources::source(var)?;
    let is_id = row.kind.is_id();
    let (components, format) = match (var.data_type.trim(), is_id) {
        ("", false) => (4, SampleFormat::Float),
        ("", true) => (1, SampleFormat::Uint),
        (name, _) => data_type(name),
    };
    let format = match setting(&var.settings, &["driver:parameters:aov:format"]).map(|name| data_type(name).1) {
        Some(other) => other,
        // Half floats have 11 bits: ids would not be exact.
        None if is_id && format == SampleFormat::Half => SampleFormat::Float,
        None => format,
    };
    let name = layer_name(var);
    // Colour has alpha only in types of four components.
    let count = if row.parts == "RGBA" && components < 4 { 3 } else { row.parts.len() };
    let is_free = |name: &str| before.iter().all(|channel| channel.name != name);
    let is_root = match row.parts {
        _ if row.kind.primvar().is_some() => false,
        "RGBA" => ["R", "G", "B"].into_iter().all(is_free) && (count == 3 || is_free("A")),
        "A" => is_free("A"),
        "Z" => row.kind == AovKind::CameraDepth && is_free("Z"),
        _ => false,
    };
    let channels = row.parts.chars().take(count).enumerate().map(|(at, part)| FileChannel {
        name: match (is_root, row.parts.len()) {
            (true, _) => part.to_string(),
            (false, 1) => name.clone(),
            (false, _) => format!("{name}.{part}"),
        },
        kind: row.kind,
        cryptomatte: None,
        component: row.first + at,
        format,
    });
    free(channels.collect(), before)
}

/// The channels of a var in a deep image that has `before`; or why there are none.
pub(super) fn of_deep_var(
    var: &ProductVar,
    limits: DeepLimits,
    before: &[FileChannel],
) -> Result<Vec<FileChannel>, String> {
    let channel = |name: &str, part: DeepPart, format| deep_channel(name, part, format, limits);
    let layer = layer_name(var);
    if let Some(source) = sources::cryptomatte(var)? {
        if source.kind == CryptomatteKind::Material {
            return Err("deep samples are told apart by objects, not by materials".to_owned());
        }
        let named = FileChannel {
            cryptomatte: Some(MatteLayer { kind: source.kind, name: layer.clone(), naming: var.naming.clone() }),
            ..channel(&layer, DeepPart::Name, SampleFormat::Uint)
        };
        return free(vec![named], before);
    }
    let half = data_type(var.data_type.trim()).1 == SampleFormat::Half;
    let format = if half { SampleFormat::Half } else { SampleFormat::Float };
    let row = sources::source(var)?;
    let channels = match row.kind {
        AovKind::Color if row.first == 0 => vec![
            channel("R", DeepPart::Red, format),
            channel("G", DeepPart::Green, format),
            channel("B", DeepPart::Blue, format),
        ],
        AovKind::Color => vec![channel("A", DeepPart::Alpha, format)],
        AovKind::CameraDepth => vec![channel("Z", DeepPart::Depth, SampleFormat::Float)],
        AovKind::PrimId => vec![channel(&layer, DeepPart::Prim, SampleFormat::Uint)],
        AovKind::InstanceId => vec![channel(&layer, DeepPart::Instance, SampleFormat::Uint)],
        _ => return Err(format!("deep samples have no {}", var.source_name.trim())),
    };
    free(channels, before)
}

/// Adds alpha and depth, which every deep image has.
pub(super) fn complete_deep(channels: &mut Vec<FileChannel>, limits: DeepLimits) {
    let format = channels.iter().find(|channel| channel.name == "R").map_or(SampleFormat::Float, |red| red.format);
    for (name, part, format) in [("A", DeepPart::Alpha, format), ("Z", DeepPart::Depth, SampleFormat::Float)] {
        if channels.iter().all(|channel| channel.name != name) {
            channels.push(deep_channel(name, part, format, limits));
        }
    }
}

fn deep_channel(name: &str, part: DeepPart, format: SampleFormat, limits: DeepLimits) -> FileChannel {
    let (name, kind) = (name.to_owned(), AovKind::Deep(limits));
    FileChannel { name, kind, cryptomatte: None, component: part as usize, format }
}

/// The channels, if the file has none of their names.
fn free(channels: Vec<FileChannel>, before: &[FileChannel]) -> Result<Vec<FileChannel>, String> {
    let is_free = |name: &str| before.iter().all(|channel| channel.name != name);
    match channels.iter().find(|channel| channel.name.is_empty() || !is_free(&channel.name)) {
        Some(channel) => Err(format!("the file has a channel named '{}' already", channel.name)),
        None => Ok(channels),
    }
}

/// The name of a var's layer.
fn layer_name(var: &ProductVar) -> String {
    let named = setting(&var.settings, &["driver:parameters:aov:name"]).filter(|name| !name.is_empty());
    let name = named.unwrap_or_else(|| var.prim.rsplit('/').next().unwrap_or("color"));
    name.chars().filter(|c| !c.is_control()).take(MAX_NAME_CHARS).collect()
}

/// The channels of a Cryptomatte layer: floats, whatever type the var has, since their bits are hashes.
/// With a level only those of its two ranks, whose var may be called by the level.
fn of_cryptomatte(layer: MatteLayer, level: Option<usize>) -> Vec<FileChannel> {
    let of_level = level.and_then(|level| layer.name.strip_suffix(&format!("{level:02}")));
    let name = of_level.filter(|rest| !rest.is_empty()).unwrap_or(&layer.name).to_owned();
    let layer = MatteLayer { name, ..layer };
    let image = match layer.kind {
        CryptomatteKind::Object | CryptomatteKind::Asset => AovKind::CryptoObject,
        CryptomatteKind::Material => AovKind::CryptoMaterial,
    };
    let channel = |component: usize| FileChannel {
        name: format!("{}{:02}.{}", layer.name, component / 4, ["R", "G", "B", "A"][component % 4]),
        kind: image,
        cryptomatte: Some(layer.clone()),
        component,
        format: SampleFormat::Float,
    };
    let all = 0..cryptomatte::CHANNELS;
    level.map_or(all, |level| 4 * level..4 * level + 4).map(channel).collect()
}

/// Longest name of a layer, characters: EXR allows 255 bytes of a channel's.
const MAX_NAME_CHARS: usize = 60;

#[cfg(test)]
mod tests {
    use super::*;

    fn var(name: &str, data_type: &str, source: &str, kind: &str) -> ProductVar {
        let text = str::to_owned;
        ProductVar {
            prim: format!("/Render/Vars/{name}"),
            data_type: text(data_type),
            source_name: text(source),
            source_type: text(kind),
            settings: Vec::new(),
            naming: None,
        }
    }

    fn names(channels: &[FileChannel]) -> Vec<&str> {
        channels.iter().map(|channel| channel.name.as_str()).collect()
    }

    #[test]
    fn a_part_of_no_light_is_remarked() {
        let [black, lit] = ["CV", "CO"].map(|text| of_var(&var("x", "color3f", text, "lpe"), &[]).expect(text));
        assert_eq!([black.iter().filter_map(remark).count(), lit.iter().filter_map(remark).count()], [1, 0]);
    }

    #[test]
    fn layers_of_ranks_are_channels_of_one_cryptomatte() {
        let of = |source: &str, before: &[FileChannel]| of_var(&var(source, "color4f", source, "raw"), before);
        let first = of("crypto_asset00", &[]).expect("channels");
        assert_eq!(names(&first), ["crypto_asset00.R", "crypto_asset00.G", "crypto_asset00.B", "crypto_asset00.A"]);
        let third = of("crypto_asset02", &first).expect("channels");
        assert_eq!((third[0].name.as_str(), third[0].component), ("crypto_asset02.R", 8));
        assert_eq!(first[0].cryptomatte, third[0].cryptomatte, "one manifest");
        let all = of("crypto_asset", &[]).expect("channels");
        assert_eq!(all[..4], first[..]);
        assert_eq!(of("crypto_asset00", &all), Ok(Vec::new()), "they are there already");
    }

    #[test]
    fn the_first_colour_has_the_names_that_viewers_show() {
        let mut all = Vec::new();
        for (name, data_type, source) in [
            ("beauty", "color4h", "Ci"),
            ("again", "color3f", "Ci"),
            ("N", "normal3f", "N"),
            ("depth", "float", "z"),
            ("ids", "int", "primId"),
            ("ids", "half", "instanceId"),
        ] {
            match of_var(&var(name, data_type, source, "raw"), &all) {
                Ok(channels) => all.extend(channels),
                Err(text) => assert!(text.contains("'ids' already"), "{text}"),
            }
        }
        let expected = ["R", "G", "B", "A", "again.R", "again.G", "again.B", "N.X", "N.Y", "N.Z", "Z", "ids"];
        assert_eq!(names(&all), expected);
        assert_eq!([all[0].format, all[4].format, all[11].format], {
            [SampleFormat::Half, SampleFormat::Float, SampleFormat::Uint]
        });
        let alpha = of_var(&var("a", "float", "a", "raw"), &all[4..]).expect("a channel");
        assert_eq!((alpha[0].name.as_str(), alpha[0].component), ("A", 3));
    }

    #[test]
    fn settings_of_the_driver_name_and_format_a_layer() {
        let mut var = var("x", "color3f", "albedo", "raw");
        let text = str::to_owned;
        var.settings = vec![
            (text("driver:parameters:aov:name"), text("diffuse_albedo")),
            (text("driver:parameters:aov:format"), text("color3h")),
        ];
        let channels = of_var(&var, &[]).expect("channels");
        assert_eq!(names(&channels), ["diffuse_albedo.R", "diffuse_albedo.G", "diffuse_albedo.B"]);
        assert_eq!(channels[0].format, SampleFormat::Half);
    }
}
