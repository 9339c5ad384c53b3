// SPDX-License-Identifier: Apache-2.0
//! The channels that a render var becomes: names of sources as users of hdPrman, Karma and Arnold write them. Pure.

use super::cryptomatte;
use crate::job::aov::AovKind;
use crate::job::expression::{ExpressionId, has_paths};
use crate::job::product::{CryptomatteKind, FileChannel, ProductVar, SampleFormat};

/// A source and the names that it goes by.
#[derive(Clone, Copy)]
struct SourceRow {
    names: &'static [&'static str],
    kind: AovKind,
    /// Its components, by their names in a file; more than one.
    parts: &'static str,
    /// The first component.
    first: usize,
}

const fn row(kind: AovKind, parts: &'static str, first: usize, names: &'static [&'static str]) -> SourceRow {
    SourceRow { names, kind, parts, first }
}

/// Names of raw and intrinsic sources; compared without regard to case where none is alike in its case.
const ROWS: [SourceRow; 18] = [
    row(AovKind::Color, "RGBA", 0, &["color", "Ci", "C", "rgba", "rgb", "beauty", "combined"]),
    row(AovKind::Color, "A", 3, &["a", "alpha"]),
    row(AovKind::CameraDepth, "Z", 0, &["z", "cameraDepth", "linearDepth", "hitPz", "ray:hitPz"]),
    row(AovKind::Depth, "Z", 0, &["depth"]),
    row(AovKind::Normal, "XYZ", 0, &["normal", "N", "Nn", "__Nworld", "hitN", "ray:hitN"]),
    row(AovKind::Neye, "XYZ", 0, &["Neye"]),
    row(AovKind::Albedo, "RGB", 0, &["albedo"]),
    row(AovKind::Motion, "XYZ", 0, &["motion", "motionvector"]),
    row(AovKind::PrimId, "I", 0, &["primId", "id"]),
    row(AovKind::InstanceId, "I", 0, &["instanceId"]),
    row(AovKind::ElementId, "I", 0, &["elementId"]),
    row(AovKind::SampleCount, "N", 0, &["sampleCount"]),
    row(AovKind::Position, "XYZ", 0, &["position", "P", "Pworld", "__Pworld", "worldPosition", "hitP", "ray:hitP"]),
    row(AovKind::Peye, "XYZ", 0, &["Peye"]),
    row(AovKind::GeometricNormal, "XYZ", 0, &["Ng", "hitNg", "ray:hitNg", "geometricNormal"]),
    row(AovKind::Denoised, "RGBA", 0, &["denoised", "denoisedColor", "denoise"]),
    row(AovKind::Variance, "RGB", 0, &["variance", "var"]),
    row(AovKind::Error, "E", 0, &["error", "relativeError"]),
];
/// Path expressions for all light: they are the colour, which has alpha.
const ALL_LIGHT: [&str; 5] = ["C.*", "C.*[<L.>O]", "C.*[LO]", "C[<.>]*[<L.>O]", "C.*[<O.><L.>]"];

/// The source of a var, or why there is none.
fn source(var: &ProductVar) -> Result<SourceRow, String> {
    let name = var.source_name.trim();
    // hdPrman's users also write path expressions as raw sources.
    let expression = name.strip_prefix("color ").unwrap_or(name).trim_start();
    let expression = expression.strip_prefix("lpe:").map(|rest| ("lpe", rest)).unwrap_or((&*var.source_type, name));
    match expression {
        ("lpe", path) => {
            let expression = ExpressionId::of(path)?;
            let part = row(AovKind::Light(expression), "RGB", 0, &[]);
            Ok(if ALL_LIGHT.contains(&&*expression.text()) { ROWS[0] } else { part })
        }
        ("" | "raw" | "intrinsic", name) => {
            let alike = |same: fn(&str, &str) -> bool| ROWS.iter().find(|row| row.names.iter().any(|n| same(n, name)));
            let found = alike(|a, b| a == b).or_else(|| alike(str::eq_ignore_ascii_case));
            found.copied().ok_or_else(|| format!("there is no source {name}; did you mean {}?", nearest(name)))
        }
        ("primvar", name) => Err(format!("the primvar {name}: sources of the type primvar are not supported")),
        (kind, _) => Err(format!("there is no sourceType {kind}; there are raw, intrinsic, lpe and primvar")),
    }
}

/// The name of a source that is nearest to `name`.
fn nearest(name: &str) -> &'static str {
    let names = ROWS.iter().flat_map(|row| row.names.iter().copied()).chain(CRYPTOMATTE.map(|(name, _)| name));
    let short: String = name.chars().take(64).collect();
    names.min_by_key(|known| strsim::damerau_levenshtein(known, &short)).unwrap_or("color")
}

/// What a user should know of a channel that is there.
pub(super) fn remark(channel: &FileChannel) -> Option<String> {
    let expression = channel.kind.expression().filter(|_| channel.component == 0)?;
    (!has_paths(expression)).then(|| format!("is black: no light path is of {}", expression.text()))
}

/// What is wrong with the name of an AOV: says the nearest one.
pub fn unknown_aov(name: &str) -> Option<String> {
    let var = ProductVar { source_name: name.to_owned(), ..ProductVar::default() };
    if cryptomatte_of(&var).is_some() { None } else { source(&var).err() }
}

/// A setting of a var or a product under one of its names.
pub(super) fn setting<'a>(settings: &'a [(String, String)], names: &[&str]) -> Option<&'a str> {
    names.iter().find_map(|name| settings.iter().find(|(key, _)| key == name)).map(|(_, value)| value.trim())
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
    if let Some(kind) = cryptomatte_of(var) {
        return free(of_cryptomatte(kind, layer_name(var)), before);
    }
    let row = source(var)?;
    let is_id = matches!(row.kind, AovKind::PrimId | AovKind::InstanceId | AovKind::ElementId);
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

/// Names of Cryptomatte sources; case does not matter.
const CRYPTOMATTE: [(&str, CryptomatteKind); 6] = [
    ("crypto_object", CryptomatteKind::Object),
    ("CryptoObject", CryptomatteKind::Object),
    ("crypto_material", CryptomatteKind::Material),
    ("CryptoMaterial", CryptomatteKind::Material),
    ("crypto_asset", CryptomatteKind::Asset),
    ("CryptoAsset", CryptomatteKind::Asset),
];

fn cryptomatte_of(var: &ProductVar) -> Option<CryptomatteKind> {
    let is_source = matches!(&*var.source_type, "" | "raw" | "intrinsic");
    let same = |(name, _): &&(&str, _)| name.eq_ignore_ascii_case(var.source_name.trim());
    CRYPTOMATTE.iter().find(same).filter(|_| is_source).map(|(_, kind)| *kind)
}

/// The channels of a Cryptomatte layer: floats, whatever type the var has, since their bits are hashes.
fn of_cryptomatte(kind: CryptomatteKind, name: String) -> Vec<FileChannel> {
    let image = match kind {
        CryptomatteKind::Object | CryptomatteKind::Asset => AovKind::CryptoObject,
        CryptomatteKind::Material => AovKind::CryptoMaterial,
    };
    let channel = |component: usize| FileChannel {
        name: format!("{name}{:02}.{}", component / 4, ["R", "G", "B", "A"][component % 4]),
        kind: image,
        cryptomatte: Some((kind, name.clone())),
        component,
        format: SampleFormat::Float,
    };
    (0..cryptomatte::CHANNELS).map(channel).collect()
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
        }
    }

    fn names(channels: &[FileChannel]) -> Vec<&str> {
        channels.iter().map(|channel| channel.name.as_str()).collect()
    }

    #[test]
    fn names_of_other_renderers_are_known() {
        let kind = |source: &str, kind: &str| of_var(&var("x", "color3f", source, kind), &[]).map(|c| c[0].kind);
        for (source, expected) in [("Ci", AovKind::Color), ("C.*[<L.>O]", AovKind::Color), ("lpe:C.*", AovKind::Color)]
        {
            let source_type = if source.starts_with("C.") { "lpe" } else { "raw" };
            assert_eq!(kind(source, source_type), Ok(expected), "{source}");
        }
        assert_eq!(kind("N", "raw"), Ok(AovKind::Normal));
        assert_eq!(kind("Z", "raw"), Ok(AovKind::CameraDepth));
        assert_eq!(kind("depth", ""), Ok(AovKind::Depth));
        assert_eq!(kind("P", "raw"), Ok(AovKind::Position));
        assert_eq!(kind("ray:hitNg", "intrinsic"), Ok(AovKind::GeometricNormal));
        assert_eq!(kind("Peye", "raw"), Ok(AovKind::Peye));
        assert_eq!([kind("variance", "raw"), kind("error", "")], [Ok(AovKind::Variance), Ok(AovKind::Error)]);
        assert_eq!(kind("PRIMID", "intrinsic"), Ok(AovKind::PrimId), "whatever its case");
        assert!(kind("albdo", "raw").is_err_and(|text| text.contains("albedo")), "the nearest");
        let part = AovKind::from_token("lpe:C<RD>L").expect("an expression");
        assert_eq!([kind("C<RD> L", "lpe"), kind("color lpe:C<RD>L", "raw")], [Ok(part), Ok(part)], "not all light");
        assert!(kind("C<RD", "lpe").is_err_and(|text| text.contains("C<RD: character 5")), "no expression");
        assert!(kind("shadows;C<RD>L", "lpe").is_err_and(|text| text.contains("shadows")), "an option");
        assert!(kind("unoccluded;C<RD>L", "lpe").is_ok(), "one that there is");
        let [black, lit] = ["CV", "CO"].map(|text| of_var(&var("x", "color3f", text, "lpe"), &[]).expect(text));
        assert_eq!([black.iter().filter_map(remark).count(), lit.iter().filter_map(remark).count()], [1, 0]);
        assert!(kind("st", "primvar").is_err() && kind("color", "sparkle").is_err());
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
