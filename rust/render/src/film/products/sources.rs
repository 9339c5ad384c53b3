// SPDX-License-Identifier: Apache-2.0
//! Names of the sources of render vars, as users of hdPrman, Karma and Arnold write them. Pure.

use crate::job::aov::AovKind;
use crate::job::expression::ExpressionId;
use crate::job::primvar::PrimvarImage;
use crate::job::product::{CryptomatteKind, ProductVar, setting};

/// A source and the names that it goes by.
#[derive(Clone, Copy)]
pub(super) struct SourceRow {
    names: &'static [&'static str],
    pub(super) kind: AovKind,
    /// Its components, by their names in a file; more than one.
    pub(super) parts: &'static str,
    /// The first component.
    pub(super) first: usize,
}

const fn row(kind: AovKind, parts: &'static str, first: usize, names: &'static [&'static str]) -> SourceRow {
    SourceRow { names, kind, parts, first }
}

/// Names of raw and intrinsic sources; compared without regard to case where none is alike in its case.
const ROWS: [SourceRow; 25] = [
    row(AovKind::Color, "RGBA", 0, &["color", "Ci", "C", "rgba", "rgb", "beauty", "combined"]),
    row(AovKind::Color, "A", 3, &["a", "alpha", "opacity"]),
    row(AovKind::CameraDepth, "Z", 0, &["z", "cameraDepth", "linearDepth", "hitPz", "ray:hitPz"]),
    row(AovKind::Depth, "Z", 0, &["depth"]),
    row(AovKind::Normal, "XYZ", 0, &["normal", "normals", "N", "Nn", "__Nworld", "hitN", "ray:hitN"]),
    row(AovKind::Neye, "XYZ", 0, &["Neye"]),
    row(AovKind::Albedo, "RGB", 0, &["albedo", "diffuse_albedo"]),
    row(AovKind::Motion, "XYZ", 0, &["motion", "motionvector"]),
    row(AovKind::MotionBoth, "XYZW", 0, &["motionBoth"]),
    row(AovKind::MotionBoth, "XY", 0, &["motionBack"]),
    row(AovKind::MotionBoth, "XY", 2, &["motionFore"]),
    row(AovKind::PrimId, "I", 0, &["primId", "id"]),
    row(AovKind::InstanceId, "I", 0, &["instanceId"]),
    row(AovKind::ElementId, "I", 0, &["elementId"]),
    row(AovKind::MaterialId, "I", 0, &["materialId"]),
    row(AovKind::Shadow, "RGB", 0, &["shadow", "shadows", "occluded", "shadow_matte"]),
    row(AovKind::ShadowCatcher, "A", 0, &["shadowCatcher", "shadow_catcher"]),
    row(AovKind::LoadWaits, "N", 0, &["loadWaits", "chunkLoads"]),
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

/// Parts of light that have names: what they are before the light at the end, and names of Arnold and of `RenderMan`.
const PARTS: [(&str, &[&str]); 11] = [
    ("C.", &["direct"]),
    ("C..+", &["indirect"]),
    ("C<RD>.*", &["diffuse"]),
    ("C<RD>", &["diffuse_direct", "directDiffuse"]),
    ("C<RD>.+", &["diffuse_indirect", "indirectDiffuse"]),
    ("C<R[^D]>.*", &["specular"]),
    ("C<R[^D]>", &["specular_direct", "directSpecular"]),
    ("C<R[^D]>.+", &["specular_indirect", "indirectSpecular"]),
    ("C<T.>.*", &["transmission"]),
    ("C", &["emission"]),
    ("C.*", &["RGBA"]),
];

/// The light path expression that a name of a part stands for, or the part of a light group: Arnold's users write
/// `RGBA_key` and `diffuse_key` for the lights of the group `key`.
fn named_part(name: &str) -> Option<String> {
    if name.eq_ignore_ascii_case("background") {
        return Some("CB".to_owned());
    }
    let with = |end: &str, found: &str| {
        let is_named = |names: &[&str]| names.iter().any(|known| known.eq_ignore_ascii_case(found));
        PARTS.iter().find(|(_, names)| is_named(names)).map(|(path, _)| format!("{path}{end}"))
    };
    with("[LO]", name).or_else(|| {
        // The longest name wins.
        let mut ends = name.match_indices('_').rev().filter(|(at, _)| at + 1 < name.len());
        ends.find_map(|(at, _)| {
            let group = &name[at + 1..];
            let is_group = group != "albedo" && !group.contains(['\'', '"', '\\']);
            is_group.then(|| with(&format!("<[LO].'{group}'>"), &name[..at])).flatten()
        })
    })
}

/// The share of the luminance where one number of a shadow is asked for.
fn of_type(found: SourceRow, data_type: &str) -> SourceRow {
    let is_one = matches!(data_type.trim(), "float" | "half" | "double");
    if found.kind == AovKind::Shadow && is_one { row(found.kind, "Y", 3, &[]) } else { found }
}

fn of_expression(path: &str) -> Result<SourceRow, String> {
    let expression = ExpressionId::of(path)?;
    let part = row(AovKind::Light(expression), "RGB", 0, &[]);
    Ok(if ALL_LIGHT.contains(&&*expression.text()) { ROWS[0] } else { part })
}

/// The primvar that a name of a raw source stands for: texture coordinates, the rest position, and Hydra's names.
fn primvar_name(name: &str) -> Option<&str> {
    match name {
        "st" | "uv" | "UV" => Some("st"),
        "Pref" => Some(name),
        _ => name.strip_prefix("primvars:"),
    }
}

/// As many components of a primvar as the type of the var has. Whole numbers are not filtered.
fn of_primvar(name: &str, data_type: &str) -> Result<SourceRow, String> {
    let base = data_type.trim();
    if matches!(base, "string" | "token" | "asset" | "bool") || base.starts_with("matrix") {
        return Err(format!("the primvar {name}: values of the type {base} cannot be shown"));
    }
    let components = match base {
        "" => 4,
        _ => base.chars().find_map(|c| c.to_digit(10)).map_or(1, |count| count.clamp(1, 4) as usize),
    };
    let is_color = base.is_empty() || base.starts_with("color");
    let parts = if is_color { "RGBA" } else { "XYZW" };
    let image = PrimvarImage::of(name, base.starts_with("int") || base.starts_with("uint"))?;
    Ok(row(AovKind::Primvar(image), &parts[..components], 0, &[]))
}

/// The source of a var, or why there is none.
pub(super) fn source(var: &ProductVar) -> Result<SourceRow, String> {
    let name = var.source_name.trim();
    // hdPrman's users also write path expressions as raw sources.
    let expression = name.strip_prefix("color ").unwrap_or(name).trim_start();
    let expression = expression.strip_prefix("lpe:").map(|rest| ("lpe", rest)).unwrap_or((&*var.source_type, name));
    match expression {
        ("lpe", path) => of_expression(path),
        ("" | "raw" | "intrinsic", name) => {
            let alike = |same: fn(&str, &str) -> bool| ROWS.iter().find(|row| row.names.iter().any(|n| same(n, name)));
            let found = alike(|a, b| a == b).or_else(|| alike(str::eq_ignore_ascii_case)).copied().map(Ok);
            let found = found.map(|row| row.map(|row| of_type(row, &var.data_type)));
            let found = found.or_else(|| named_part(name).map(|path| of_expression(&path)));
            let found = found.or_else(|| primvar_name(name).map(|name| of_primvar(name, &var.data_type)));
            found.unwrap_or_else(|| Err(format!("there is no source {name}; did you mean {}?", nearest(name))))
        }
        ("primvar", name) => of_primvar(name, &var.data_type),
        (kind, _) => Err(format!("there is no sourceType {kind}; there are raw, intrinsic, lpe and primvar")),
    }
}

/// The name of a source that is nearest to `name`.
fn nearest(name: &str) -> &'static str {
    let names = ROWS.iter().flat_map(|row| row.names.iter().copied()).chain(CRYPTOMATTE.map(|(name, _)| name));
    let names = names.chain(PARTS.iter().flat_map(|(_, names)| names.iter().copied()));
    let short: String = name.chars().take(64).collect();
    names.min_by_key(|known| strsim::damerau_levenshtein(known, &short)).unwrap_or("color")
}

/// What is wrong with the name of an AOV: says the nearest one.
pub fn unknown_aov(name: &str) -> Option<String> {
    let var = ProductVar { source_name: name.to_owned(), ..ProductVar::default() };
    match cryptomatte(&var) {
        Ok(Some(_)) => None,
        Ok(None) => source(&var).err(),
        Err(text) => Some(text),
    }
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

/// What a var of Cryptomatte asks for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MatteSource {
    pub(super) kind: CryptomatteKind,
    /// The layer of ranks that it is alone, as Arnold's users list them.
    pub(super) level: Option<usize>,
    /// The primvar of text that is to name things.
    pub(super) primvar: Option<String>,
}

/// The setting of a var that names the primvar.
const NAMING: [&str; 1] = ["oocpt:cryptomattePrimvar"];
/// Most bytes of the name of a primvar.
const MAX_PRIMVAR: usize = 256;

/// Whether a var of the type `primvar` is a Cryptomatte: of a primvar of text, or with Karma's switch.
fn is_matte_of_primvar(var: &ProductVar) -> bool {
    let is_switch = |key: &str| key.starts_with("driver:parameters:aov:") && key.ends_with("cryptomatte");
    let is_on = |(key, value): &(String, String)| is_switch(key) && matches!(value.trim(), "true" | "1");
    let is_text = matches!(var.data_type.trim().trim_end_matches("[]"), "string" | "token");
    var.source_type == "primvar" && (is_text || var.settings.iter().any(is_on))
}

/// What a var of Cryptomatte asks for; `None` if it is none.
///
/// # Errors
/// What cannot be named by the primvar that it names.
pub(super) fn cryptomatte(var: &ProductVar) -> Result<Option<MatteSource>, String> {
    let name = var.source_name.trim();
    if is_matte_of_primvar(var) {
        let primvar = Some(checked(name)?);
        return Ok(Some(MatteSource { kind: CryptomatteKind::Object, level: None, primvar }));
    }
    if !matches!(&*var.source_type, "" | "raw" | "intrinsic") {
        return Ok(None);
    }
    // `CryptoObject:NAME`, where there are no settings.
    let (name, primvar) = name.split_once(':').map_or((name, None), |(name, primvar)| (name, Some(primvar)));
    let kind = |name: &str| CRYPTOMATTE.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|row| row.1);
    let ranks = || {
        let level = ["00", "01", "02"].iter().position(|level| name.ends_with(level))?;
        Some((kind(&name[..name.len() - 2])?, Some(level)))
    };
    let Some((kind, level)) = kind(name).map(|kind| (kind, None)).or_else(ranks) else { return Ok(None) };
    let primvar = primvar.or_else(|| setting(&var.settings, &NAMING).filter(|name| !name.is_empty()));
    let primvar = primvar.map(checked).transpose()?;
    if kind == CryptomatteKind::Material && primvar.is_some() {
        return Err("a primvar names objects and assets, not materials".to_owned());
    }
    Ok(Some(MatteSource { kind, level, primvar }))
}

/// The name of a primvar, without `primvars:`.
fn checked(name: &str) -> Result<String, String> {
    let name = name.strip_prefix("primvars:").unwrap_or(name);
    let is_name = !name.is_empty() && name.len() <= MAX_PRIMVAR && !name.chars().any(char::is_control);
    is_name.then(|| name.to_owned()).ok_or_else(|| "the primvar that is to name things has no name".to_owned())
}

/// Returns the name, without `primvars:`, of the primvar that a Cryptomatte var takes its names from: the one that the
/// var asks for, else Arnold's `crypto_object` or `crypto_asset`. Returns `None` for every other var.
pub fn naming_primvar(var: &ProductVar) -> Option<String> {
    let source = cryptomatte(var).ok().flatten()?;
    let usual = match source.kind {
        CryptomatteKind::Object => Some("crypto_object"),
        CryptomatteKind::Asset => Some("crypto_asset"),
        CryptomatteKind::Material => None,
    };
    source.primvar.or_else(|| usual.map(str::to_owned))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn var(source: &str, kind: &str) -> ProductVar {
        ProductVar { source_name: source.into(), source_type: kind.into(), ..ProductVar::default() }
    }

    fn kind(source_name: &str, source_type: &str) -> Result<AovKind, String> {
        source(&var(source_name, source_type)).map(|row| row.kind)
    }

    #[test]
    fn names_of_other_renderers_are_known() {
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
        assert_eq!([kind("occluded", "raw"), kind("materialId", "")], [Ok(AovKind::Shadow), Ok(AovKind::MaterialId)]);
        let shadow = |data_type: &str| {
            let var = ProductVar { data_type: data_type.into(), ..var("shadow", "raw") };
            source(&var).map(|row| (row.parts, row.first))
        };
        assert_eq!([shadow("color3f"), shadow("float")], [Ok(("RGB", 0)), Ok(("Y", 3))], "channels, or the luminance");
        assert_eq!(kind("PRIMID", "intrinsic"), Ok(AovKind::PrimId), "whatever its case");
        assert!(kind("albdo", "raw").is_err_and(|text| text.contains("albedo")), "the nearest");
        let part = AovKind::from_token("lpe:C<RD>L").expect("an expression");
        assert_eq!([kind("C<RD> L", "lpe"), kind("color lpe:C<RD>L", "raw")], [Ok(part), Ok(part)], "not all light");
        assert!(kind("C<RD", "lpe").is_err_and(|text| text.contains("C<RD: character 5")), "no expression");
        assert!(kind("shadows;C<RD>L", "lpe").is_err_and(|text| text.contains("shadows")), "an option");
        assert!(kind("unoccluded;C<RD>L", "lpe").is_ok(), "one that there is");
        assert!(kind("color", "sparkle").is_err());
    }

    #[test]
    fn parts_of_light_go_by_names_and_groups() {
        let part = |text: &str| Ok(AovKind::from_token(&format!("lpe:{text}")).expect("an expression"));
        for (name, path) in [
            ("direct", "C.[LO]"),
            ("Indirect", "C..+[LO]"),
            ("diffuse", "C<RD>.*[LO]"),
            ("directDiffuse", "C<RD>[LO]"),
            ("diffuse_indirect", "C<RD>.+[LO]"),
            ("specular", "C<R[^D]>.*[LO]"),
            ("emission", "C[LO]"),
            ("background", "CB"),
            ("RGBA_key", "C.*<[LO].'key'>"),
            ("RGBA_key_left", "C.*<[LO].'key_left'>"),
            ("diffuse_direct_rim", "C<RD><[LO].'rim'>"),
        ] {
            assert_eq!(kind(name, "raw"), part(path), "{name}");
        }
        assert_eq!([kind("RGBA", "raw"), kind("diffuse_albedo", "raw")], [Ok(AovKind::Color), Ok(AovKind::Albedo)]);
        for name in ["specular_albedo", "RGBA_", "RGBA_a'b", "custom_key", "coat"] {
            assert!(kind(name, "raw").is_err(), "{name}");
        }
    }

    #[test]
    fn a_primvar_has_the_components_of_the_type() {
        let of = |name: &str, kind: &str, data_type: &str| {
            let var = ProductVar { data_type: data_type.into(), ..var(name, kind) };
            source(&var).map(|row| (row.kind.name(), row.parts, row.kind.is_filterable()))
        };
        for (data_type, parts, is_mean) in [
            ("float", "X", true),
            ("texCoord2f", "XY", true),
            ("color3h", "RGB", true),
            ("float4", "XYZW", true),
            ("int", "X", false),
            ("float99", "XYZW", true),
        ] {
            assert_eq!(of("dust", "primvar", data_type), Ok(("primvars:dust".into(), parts, is_mean)), "{data_type}");
        }
        assert_eq!(of("UV", "raw", "float2"), Ok(("primvars:st".into(), "XY", true)));
        assert_eq!(of("primvars:dust", "raw", "int"), Ok(("primvars:dust".into(), "X", false)));
        assert!(of("name", "primvar", "asset").is_err() && of("", "primvar", "float").is_err());
    }

    #[test]
    fn layers_of_ranks_are_parts_of_a_cryptomatte() {
        let of = |name: &str, kind: &str| {
            cryptomatte(&var(name, kind)).expect("no error").map(|source| (source.kind, source.level))
        };
        assert_eq!(of("crypto_asset", "raw"), Some((CryptomatteKind::Asset, None)));
        assert_eq!(of("crypto_object01", ""), Some((CryptomatteKind::Object, Some(1))));
        assert_eq!(of("CRYPTOMATERIAL02", ""), Some((CryptomatteKind::Material, Some(2))));
        assert_eq!([of("crypto_asset03", ""), of("crypto_asset", "lpe"), of("crypto", "")], [None; 3]);
    }

    #[test]
    fn a_cryptomatte_may_be_named_by_a_primvar() {
        let of = |name: &str, kind: &str, data_type: &str, settings: &[(&str, &str)]| {
            let settings = settings.iter().map(|(key, value)| ((*key).to_owned(), (*value).to_owned())).collect();
            naming_primvar(&ProductVar { data_type: data_type.into(), settings, ..var(name, kind) })
        };
        let named = |name: &str| Some(name.to_owned());
        assert_eq!(of("CryptoObject", "raw", "", &[]), named("crypto_object"), "Arnold's, if nothing is named");
        assert_eq!(of("crypto_asset01", "", "", &[]), named("crypto_asset"));
        assert_eq!(of("crypto_object", "raw", "", &[(NAMING[0], " primvars:dept ")]), named("dept"));
        assert_eq!(of("CryptoAsset:user:dept", "", "", &[]), named("user:dept"));
        assert_eq!(of("dept", "primvar", "string", &[]), named("dept"), "text is shown by names");
        let karma = "driver:parameters:aov:cryptomatte";
        assert_eq!(of("primvars:dept", "primvar", "color3f", &[(karma, "1")]), named("dept"));
        for (name, kind, data_type, settings) in [
            ("dept", "primvar", "color3f", &[(karma, "false")][..]),
            ("CryptoMaterial", "raw", "", &[]),
            ("CryptoMaterial:dept", "raw", "", &[]),
            ("CryptoObject:", "raw", "", &[]),
            ("CryptoObject:a\nb", "raw", "", &[]),
            ("albedo:dept", "raw", "", &[]),
        ] {
            assert_eq!(of(name, kind, data_type, settings), None, "{name}");
        }
        assert!(unknown_aov("CryptoMaterial:dept").is_some_and(|text| text.contains("not materials")));
        assert_eq!(unknown_aov("CryptoObject:dept"), None);
    }
}
