// SPDX-License-Identifier: Apache-2.0
//! Decides which files are written of which pictures, and says what of the products is left out and why. Pure.

use super::{channels, frame_name, header};
use crate::job::aov::{AovKind, AovRequest};
use crate::job::deep::DeepLimits;
use crate::job::expression::{ExpressionId, fit_together};
use crate::job::product::{
    FileChannel, FileCompression, FileTimes, ProductFile, ProductPicture, ProductVar, RenderProduct, setting,
};
use crate::job::request::RenderRequest;
use oocpt_abi::MAX_SHOWN_PRIMVARS;
use oocpt_core::file_space::FileSpace;
use std::path::{Path, PathBuf};

/// Most products of a render.
const MAX_PRODUCTS: usize = 256;
/// Most channels of a file.
const MAX_CHANNELS: usize = 1024;
/// Most bytes of a file's name.
const MAX_NAME_BYTES: usize = 4096;
/// Ratios that readers of `OpenEXR` take.
const PIXEL_ASPECTS: std::ops::RangeInclusive<f32> = 1e-6..=1e6;
/// Most characters of a warning, which may quote what a scene says.
const MAX_WARNING: usize = 400;

/// The files of a render.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ProductPlan {
    /// Those of the host's picture.
    pub(crate) of_host: Vec<ProductFile>,
    /// Pictures that are rendered before it.
    pub(crate) before: Vec<ProductPicture>,
    /// What is left out: a line each, which begins with the prim.
    pub(crate) warnings: Vec<String>,
}

/// Plans the files of a scene's products.
pub(crate) fn plan(products: &[RenderProduct]) -> ProductPlan {
    let mut plan = ProductPlan::default();
    let (mut paths, mut parts) = (Vec::<PathBuf>::new(), PlannedParts::default());
    for product in products.iter().take(MAX_PRODUCTS) {
        match file_of(product, (&paths, &mut parts), &mut plan.warnings) {
            Ok(file) => {
                paths.push(file.path.clone());
                plan.add(file, product.picture.as_ref());
            }
            Err(text) => plan.warnings.push(format!("{}: the product is not written: {text}", product.prim)),
        }
    }
    if let Some(first) = products.get(MAX_PRODUCTS) {
        plan.warnings.push(format!("{}: only {MAX_PRODUCTS} products are written", first.prim));
    }
    plan.warnings.iter_mut().for_each(shorten);
    plan
}

/// Leaves the beginning of a long warning.
fn shorten(warning: &mut String) {
    if let Some((end, _)) = warning.char_indices().nth(MAX_WARNING) {
        warning.truncate(end);
        warning.push_str(" ...");
    }
}

impl ProductPlan {
    fn add(&mut self, file: ProductFile, picture: Option<&RenderRequest>) {
        let Some(picture) = picture else {
            self.of_host.push(file);
            return;
        };
        let is_same =
            |have: &&mut ProductPicture| RenderRequest { aovs: Vec::new(), ..have.request.clone() } == *picture;
        if let Some(have) = self.before.iter_mut().find(is_same) {
            add_kinds(&mut have.request, &file);
            have.files.push(file);
        } else {
            let mut request = picture.clone();
            add_kinds(&mut request, &file);
            self.before.push(ProductPicture { request, files: vec![file] });
        }
    }
}

/// Adds the images that a file needs.
pub(crate) fn add_kinds(request: &mut RenderRequest, file: &ProductFile) {
    for FileChannel { kind, .. } in file.channels.iter().cloned() {
        if let Some(limits) = kind.deep() {
            request.add_deep(limits);
        } else if request.aovs.iter().all(|aov| aov.kind != kind) {
            request.aovs.push(AovRequest { kind, clear: kind.default_clear() });
        }
    }
}

fn file_of(
    product: &RenderProduct,
    (taken, parts): (&[PathBuf], &mut PlannedParts),
    warnings: &mut Vec<String>,
) -> Result<ProductFile, String> {
    let has_deep_driver = setting(&product.settings, &["arnold:driver"]) == Some("driver_deepexr");
    let deep = match &*product.kind {
        // Arnold's users also write the name of the renderer.
        "" | "raster" | "arnold" if !has_deep_driver => None,
        "" | "raster" | "arnold" => Some(deep_limits(product, warnings)),
        "deepRaster" | "deep" => Some(deep_limits(product, warnings)),
        kind => return Err(format!("its productType {kind} is not supported")),
    };
    if !product.missing.is_empty() {
        return Err(product.missing.clone());
    }
    let path = path_of(product)?;
    if taken.contains(&path) {
        return Err(format!("another product is {}", path.display()));
    }
    if let Some(picture) = &product.picture {
        picture.validate().map_err(|error| error.to_string())?;
    }
    if !PIXEL_ASPECTS.contains(&product.pixel_aspect) {
        return Err("its pixelAspectRatio is not from 1e-6 to 1e6".to_owned());
    }
    let mut channels = channels_of(product, (deep, parts), warnings)?;
    if let Some(limits) = deep {
        channels::complete_deep(&mut channels, limits);
    }
    let mut compression = compression_of(product, warnings);
    if deep.is_some() && !compression.is_of_deep_images() {
        // Without a word where nobody asked: zip is what is used where nothing is said.
        if setting(&product.settings, &COMPRESSION).is_some() {
            warnings.push(format!("{}: deep images are compressed by none or zips; zips is used", product.prim));
        }
        compression = FileCompression::Zips;
    }
    if compression.is_lossy() && channels.iter().any(|channel| channel.cryptomatte.is_some()) {
        warnings.push(format!("{}: Cryptomatte needs exact numbers; zip is used", product.prim));
        compression = FileCompression::Zip;
    }
    Ok(ProductFile {
        prim: product.prim.clone(),
        path,
        channels,
        deep,
        compression,
        storage: header::storage(product, warnings),
        header: header::attributes(product, warnings),
        space: space_of(product, warnings),
        pixel_aspect: product.pixel_aspect,
        display_size: product.display_size,
        data_corner: product.data_corner,
        times: FileTimes { frame: product.frame, rate: product.rate, shutter: product.shutter },
        is_temporary: setting(&product.settings, &["oocpt:temporary"]) == Some("true"),
    })
}

fn path_of(product: &RenderProduct) -> Result<PathBuf, String> {
    let name = product.name.trim();
    if name.is_empty() {
        return Err("it has no productName".to_owned());
    }
    if name.len() > MAX_NAME_BYTES || name.contains('\0') {
        return Err("its productName is no name of a file".to_owned());
    }
    let resolved = frame_name::resolve(name, product.frame)
        .ok_or_else(|| format!("the host does not tell the frame that {name} is to be named by"))?;
    let path = PathBuf::from(resolved);
    let is_exr = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("exr"));
    if is_exr { Ok(path) } else { Err(format!("{} is no EXR file by its name", path.display())) }
}

/// The light path expressions and primvars of all products so far, whichever picture they are of: one automaton has
/// all expressions, and there are few primvars.
#[derive(Debug, Default)]
struct PlannedParts(Vec<ExpressionId>, Vec<AovKind>);

impl PlannedParts {
    /// These channels, if their expression or primvar has room.
    fn take(&mut self, channels: Vec<FileChannel>) -> Result<Vec<FileChannel>, String> {
        let new = channels.first().and_then(|channel| channel.kind.expression()).filter(|id| !self.0.contains(id));
        if let Some(new) = new {
            self.0.push(new);
            fit_together(&self.0).inspect_err(|_| self.0.truncate(self.0.len() - 1))?;
        }
        let primvar = channels.first().map(|channel| channel.kind).filter(|kind| kind.primvar().is_some());
        if let Some(new) = primvar.filter(|kind| !self.1.contains(kind)) {
            if self.1.len() >= MAX_SHOWN_PRIMVARS as usize {
                return Err(format!("a render shows {MAX_SHOWN_PRIMVARS} primvars at most"));
            }
            self.1.push(new);
        }
        Ok(channels)
    }
}

fn channels_of(
    product: &RenderProduct,
    (deep, parts): (Option<DeepLimits>, &mut PlannedParts),
    warnings: &mut Vec<String>,
) -> Result<Vec<FileChannel>, String> {
    let default = [ProductVar {
        prim: product.prim.clone(),
        data_type: "color4f".to_owned(),
        source_name: "color".to_owned(),
        ..ProductVar::default()
    }];
    let vars = if product.vars.is_empty() { &default[..] } else { &product.vars };
    let mut all = Vec::new();
    for var in vars {
        let channels = match deep {
            Some(limits) => channels::of_deep_var(var, limits, &all),
            None => channels::of_var(var, &all).and_then(|channels| parts.take(channels)),
        };
        match channels {
            Ok(channels) if all.len() + channels.len() <= MAX_CHANNELS => {
                let remarks = channels.iter().filter_map(channels::remark).chain(channels::remark_of_names(var));
                warnings.extend(remarks.map(|text| format!("{}: {text}", var.prim)));
                all.extend(channels);
            }
            Ok(_) => warnings.push(format!("{}: left out: {MAX_CHANNELS} channels are the most of a file", var.prim)),
            Err(text) => warnings.push(format!("{}: left out of {}: {text}", var.prim, product.name.trim())),
        }
    }
    if all.is_empty() { Err("nothing of what it asks for is there".to_owned()) } else { Ok(all) }
}

/// The limits of a deep image, by settings of the product.
fn deep_limits(product: &RenderProduct, warnings: &mut Vec<String>) -> DeepLimits {
    let mut limits = DeepLimits::default();
    let mut take = |name: &str, of: &dyn Fn(DeepLimits, f32) -> Option<DeepLimits>| {
        let Some(text) = setting(&product.settings, &[name]) else { return };
        match text.parse().ok().and_then(|number| of(limits, number)) {
            Some(changed) => limits = changed,
            None => warnings.push(format!("{}: {name} cannot be {text}; it is left out", product.prim)),
        }
    };
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers in 1..=64")]
    take("oocpt:deepSamples", &|limits, number| {
        let is_whole = number.fract() == 0.0 && (1.0..=64.0).contains(&number);
        is_whole.then(|| limits.with_samples(number as u8)).flatten()
    });
    take("oocpt:deepTolerance", &|limits, part| limits.with_depths(part, limits.depths()[1]));
    for name in DEEP_DISTANCE {
        take(name, &|limits, distance| limits.with_depths(limits.depths()[0], distance));
    }
    limits
}

/// Settings that name the distance below which deep samples are one: OocPT's, Arnold's.
const DEEP_DISTANCE: [&str; 3] =
    ["arnold:depth_tolerance", "arnold:driver_deepexr:depth_tolerance", "oocpt:deepDistance"];

/// Settings that name the compression, by those who write scenes: OocPT's, Karma's, Arnold's.
const COMPRESSION: [&str; 4] = [
    "oocpt:compression",
    "driver:parameters:OpenEXR:compression",
    "arnold:compression",
    "arnold:driver_exr:compression",
];

fn compression_of(product: &RenderProduct, warnings: &mut Vec<String>) -> FileCompression {
    let Some(name) = setting(&product.settings, &COMPRESSION) else { return FileCompression::Zip };
    // OpenImageIO's names may have a level behind a colon.
    match name.split(':').next().unwrap_or(name).to_lowercase().as_str() {
        "none" | "" => FileCompression::None,
        "rle" => FileCompression::Rle,
        "zips" => FileCompression::Zips,
        "zip" => FileCompression::Zip,
        "piz" => FileCompression::Piz,
        "pxr24" => FileCompression::Pxr24,
        "b44" => FileCompression::B44,
        "b44a" => FileCompression::B44a,
        "dwaa" => FileCompression::Dwaa,
        "dwab" => FileCompression::Dwab,
        _ => {
            warnings.push(format!("{}: there is no compression {name}; zip is used", product.prim));
            FileCompression::Zip
        }
    }
}

fn space_of(product: &RenderProduct, warnings: &mut Vec<String>) -> Option<&'static FileSpace> {
    FileSpace::named(&product.color_space).unwrap_or_else(|nearest| {
        let (prim, name) = (&product.prim, product.color_space.trim());
        let text = "is no linear space of colours that is known";
        warnings.push(format!(
            "{prim}: renderingColorSpace {name} {text}; did you mean {nearest}? lin_rec709_scene is used"
        ));
        None
    })
}

/// Whether a file is one of `inputs`, which are names of files that the scene reads; `<UDIM>` stands for four digits.
pub(super) fn is_input(path: &Path, inputs: &[&str]) -> bool {
    let real = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_not_there| path.to_path_buf());
    let path = real(path);
    let (folder, name) = (path.parent(), path.file_name().map(|name| name.to_string_lossy().into_owned()));
    inputs.iter().any(|input| match input.split_once("<UDIM>") {
        None => real(Path::new(input)) == path,
        Some((head, tail)) => {
            let start = Path::new(head);
            let prefix =
                start.file_name().filter(|_| !head.ends_with('/')).map(|name| name.to_string_lossy().into_owned());
            let start = if head.ends_with('/') { Some(start) } else { start.parent() };
            let number = name.as_deref().and_then(|name| name.strip_prefix(&*prefix.unwrap_or_default()));
            let number = number.and_then(|rest| rest.strip_suffix(tail));
            start.map(real).as_deref() == folder
                && number.is_some_and(|text| text.len() == 4 && text.bytes().all(|byte| byte.is_ascii_digit()))
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::job::product::HeaderValue;
    use glam::DMat4;
    use oocpt_core::camera::Camera;

    fn product(prim: &str, name: &str) -> RenderProduct {
        RenderProduct { prim: prim.into(), name: name.into(), pixel_aspect: 1.0, ..RenderProduct::default() }
    }

    fn picture(width: u32) -> RenderRequest {
        let camera = Camera {
            world_from_view: DMat4::IDENTITY,
            projection: DMat4::IDENTITY,
            display_window: [0.0, 0.0, 1.0, 1.0],
            data_window: [0, 0, 1, 1],
            lens_radius: 0.0,
            focus_distance: 0.0,
            clip_planes: Vec::new(),
            motion: Vec::new(),
            exposure_scale: 1.0,
        };
        RenderRequest { width, height: 1, camera, aovs: Vec::new(), window: None }
    }

    fn var(source: &str) -> ProductVar {
        ProductVar {
            prim: format!("/v/{source}"),
            data_type: "color3f".into(),
            source_name: source.into(),
            ..ProductVar::default()
        }
    }

    #[test]
    fn products_of_one_picture_share_it() {
        let of = |name: &str, width: u32, source: &str| RenderProduct {
            picture: Some(picture(width)),
            vars: vec![var(source)],
            ..product("/p", name)
        };
        let products =
            [of("a.exr", 8, "Ci"), of("b.exr", 9, "Ci"), of("c.exr", 8, "albedo"), product("/host", "d.exr")];
        let plan = plan(&products);
        assert_eq!(plan.warnings, Vec::<String>::new());
        assert_eq!(plan.before.iter().map(|before| before.files.len()).collect::<Vec<_>>(), [2, 1]);
        assert_eq!(plan.before[0].request.kinds(), [AovKind::Color, AovKind::Albedo], "the images of both");
        assert_eq!(plan.of_host.len(), 1);
    }

    #[test]
    fn a_few_primvars_are_shown() {
        let primvar = |name: &str| ProductVar { source_type: "primvar".into(), ..var(name) };
        let names = ["a", "b", "a", "c", "d", "e", "f"];
        let vars = names.iter().enumerate().map(|(at, n)| ProductVar { prim: format!("/v/{at}"), ..primvar(n) });
        let plan = plan(&[RenderProduct { vars: vars.collect(), ..product("/p", "a.exr") }]);
        assert_eq!(plan.of_host[0].channels.len(), 15, "one twice");
        let said = plan.warnings.iter().filter(|line| line.contains("4 primvars at most"));
        assert!(said.count() == 2 && plan.warnings.len() == 2, "{:?}", plan.warnings);
    }

    #[test]
    fn colours_are_written_in_the_space_that_is_named() {
        let of = |space: &str| plan(&[RenderProduct { color_space: space.into(), ..product("/p", "a.exr") }]);
        assert_eq!(of("acescg").of_host[0].space.map(FileSpace::name), Some("lin_ap1_scene"));
        for space in ["", "raw", "lin_rec709"] {
            assert!(of(space).of_host[0].space.is_none() && of(space).warnings.is_empty(), "{space:?}");
        }
        let unknown = of("lin_ap2");
        assert!(unknown.of_host[0].space.is_none(), "as without one");
        let [warning] = &unknown.warnings[..] else { panic!("{:?}", unknown.warnings) };
        assert!(warning.starts_with("/p: ") && warning.contains("did you mean lin_ap1_scene?"), "{warning}");
    }

    #[test]
    fn hostile_products_are_warnings() {
        let kind = RenderProduct { kind: "deepVolume".into(), ..product("/kind", "a.exr") };
        let huge = RenderProduct { picture: Some(picture(u32::MAX)), ..product("/huge", "h.exr") };
        let flat = RenderProduct { pixel_aspect: f32::NAN, ..product("/flat", "f.exr") };
        let empty = RenderProduct { vars: vec![var("nothing")], ..product("/empty", "e.exr") };
        let products = [
            kind,
            huge,
            flat,
            empty,
            product("/nameless", "  "),
            product("/script", "/etc/profile"),
            product("/zero", "a\0.exr"),
            product("/long", &format!("{}.exr", "x".repeat(5000))),
            product("/frame", "a.####.exr"),
            product("/good", "a.exr"),
            product("/twice", "a.exr"),
        ];
        let plan = plan(&products);
        assert_eq!(plan.of_host.len(), 1, "{:?}", plan.warnings);
        assert!(plan.before.is_empty());
        for product in products.iter().filter(|product| product.prim != "/good") {
            let says = |line: &String| line.starts_with(&format!("{}: ", product.prim));
            assert!(plan.warnings.iter().any(says), "{}: {:?}", product.prim, plan.warnings);
        }
        let many: Vec<RenderProduct> = (0..300).map(|at| product("/p", &format!("{at}.exr"))).collect();
        assert_eq!((super::plan(&many).of_host.len(), super::plan(&many).warnings.len()), (MAX_PRODUCTS, 1));
    }

    /// A pseudo-random number below `below`.
    fn next(random: &mut u64, below: usize) -> usize {
        *random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        usize::try_from(*random >> 33).expect("31 bits") % below
    }

    /// What products of strangers may say anywhere.
    const TEXTS: [&str; 34] = [
        "",
        "Ci",
        "C.*",
        "../../x.exr",
        "/dev/null",
        "/dev/zero.exr",
        "a.####.exr",
        "$F99999999999999999999.exr",
        "<F>.EXR",
        "lpe:",
        "color lpe:",
        "\u{202e}rxe.exr",
        "a\nb.exr",
        "N",
        "primId",
        "raster",
        "lpe",
        "primvar",
        "color3f",
        "half4",
        "int[]",
        "float99999999999",
        ".exr",
        "..",
        "\u{0}",
        "true",
        "tiled",
        "64",
        "-1",
        "channels",
        "crypto_object01",
        "RGBA_key",
        "diffuse_direct_'x'",
        "st",
    ];

    fn random_product(random: &mut u64) -> RenderProduct {
        let mut text = || TEXTS[next(random, TEXTS.len())].to_owned();
        let vars = [(); 3].map(|()| ProductVar {
            prim: text(),
            data_type: text(),
            source_name: text(),
            source_type: text(),
            settings: vec![("driver:parameters:aov:name".into(), text())],
            naming: None,
        });
        let mut settings = vec![(COMPRESSION[0].into(), text())];
        for key in ["oocpt:tiled", "oocpt:tileSize", "oocpt:multipart", "driver:parameters:OpenEXR:storage"] {
            settings.push((key.to_owned(), text()));
        }
        settings.push((format!("driver:parameters:OpenEXR:{}", text()), text()));
        let numbers = settings.iter().map(|(key, _)| (key.clone(), HeaderValue::Real(f64::NAN))).collect();
        let (prim, kind, name, color_space) = (text(), text(), text(), text());
        let sides = [0, 1, 7, 65_536, u32::MAX];
        RenderProduct {
            prim,
            kind: if next(random, 2) == 0 { "raster".into() } else { kind },
            name,
            vars: vars[..next(random, 4)].to_vec(),
            settings,
            numbers,
            color_space,
            pixel_aspect: [1.0, 2.5, -1.0, f32::NAN, 1e30][next(random, 5)],
            display_size: [sides[next(random, 5)], sides[next(random, 5)]],
            data_corner: [i32::MIN, i32::MAX],
            frame: [None, Some(f64::MAX), Some(-3.0)][next(random, 3)],
            rate: [None, Some(24.0), Some(1e-30)][next(random, 3)],
            shutter: [0.0, 0.5],
            missing: String::new(),
            picture: (next(random, 2) == 0).then(|| picture(sides[next(random, 5)])),
        }
    }

    #[test]
    fn random_products_are_exr_files_or_warnings() {
        let mut random = 5;
        let mut written = 0;
        for _ in 0..10_000 {
            let product = random_product(&mut random);
            let plan = plan(std::slice::from_ref(&product));
            let files: Vec<&ProductFile> =
                plan.of_host.iter().chain(plan.before.iter().flat_map(|p| &p.files)).collect();
            assert!(files.len() + plan.warnings.len() > 0, "{product:?}");
            assert!(plan.warnings.iter().all(|text| text.chars().count() < MAX_WARNING + 5), "{product:?}");
            for file in files {
                written += 1;
                let extension = file.path.extension().expect("one");
                assert!(extension.eq_ignore_ascii_case("exr") && !file.channels.is_empty(), "{product:?}");
                let mut names: Vec<&str> = file.channels.iter().map(|channel| channel.name.as_str()).collect();
                assert!(file.storage.tiles.is_none_or(|side| (8..=4096).contains(&side)), "{product:?}");
                assert!(file.header.iter().all(|(name, _)| name.len() <= 96 && name != "channels"), "{product:?}");
                names.sort_unstable();
                assert!(names.windows(2).all(|pair| pair[0] != pair[1]) && !names[0].is_empty(), "{names:?}");
            }
        }
        assert!(written > 100, "{written}");
    }

    fn deep(name: &str, vars: &[&str], settings: &[(&str, &str)]) -> RenderProduct {
        let settings = settings.iter().map(|(key, value)| ((*key).into(), (*value).into())).collect();
        let vars = vars.iter().map(|name| var(name)).collect();
        RenderProduct { kind: "deepRaster".into(), vars, settings, ..product("/deep", name) }
    }

    #[test]
    fn deep_images_have_alpha_and_depth_and_what_samples_have() {
        let all = plan(&[deep("a.exr", &["Ci", "primId", "CryptoObject", "albedo", "CryptoMaterial"], &[])]);
        let names: Vec<&str> = all.of_host[0].channels.iter().map(|channel| channel.name.as_str()).collect();
        assert_eq!(names, ["R", "G", "B", "primId", "CryptoObject", "A", "Z"]);
        assert_eq!(all.of_host[0].compression, FileCompression::Zips, "deep images have no zip");
        let told = ["/v/albedo: left out of a.exr: deep samples have no albedo", "not by materials"];
        assert_eq!(all.warnings.len(), 2, "{:?}", all.warnings);
        assert!(all.warnings.iter().zip(told).all(|(line, words)| line.contains(words)), "{:?}", all.warnings);
    }

    #[test]
    fn limits_of_deep_images_are_settings() {
        let limits = |settings: &[(&str, &str)]| {
            let plan = plan(&[deep("a.exr", &["Ci"], settings)]);
            let limits = plan.of_host[0].deep.expect("a deep image");
            (limits.samples(), limits.depths(), plan.warnings.len())
        };
        assert_eq!(limits(&[]), (16, [1e-3, 0.0], 0));
        assert_eq!(limits(&[("oocpt:deepSamples", "4"), ("oocpt:deepTolerance", "0.25")]), (4, [0.25, 0.0], 0));
        assert_eq!(limits(&[("arnold:depth_tolerance", "0.5")]), (16, [1e-3, 0.5], 0));
        for wrong in ["0", "65", "-3", "2.5", "NaN", "inf", "many", ""] {
            assert_eq!(limits(&[("oocpt:deepSamples", wrong)]), (16, [1e-3, 0.0], 1), "{wrong}");
        }
        for wrong in ["-1", "NaN", "inf", "1e99", "x"] {
            let of = |name: &str| limits(&[(name, wrong)]);
            assert_eq!([of("oocpt:deepTolerance"), of("oocpt:deepDistance")], [(16, [1e-3, 0.0], 1); 2], "{wrong}");
        }
    }

    #[test]
    fn arnolds_driver_of_deep_images_is_known() {
        let mut product = deep("a.exr", &["Ci"], &[("arnold:driver", "driver_deepexr")]);
        for (kind, driver, is_deep) in [("raster", "driver_deepexr", true), ("raster", "driver_exr", false)] {
            (product.kind, product.settings[0].1) = (kind.into(), driver.into());
            assert_eq!(plan(&[product.clone()]).of_host[0].deep.is_some(), is_deep, "{driver}");
        }
    }

    #[test]
    fn a_picture_has_one_deep_image_for_all_its_files() {
        let coarse = [("oocpt:deepSamples", "2"), ("oocpt:deepTolerance", "0.5")];
        let of = |name: &str, settings: &[(&str, &str)]| RenderProduct {
            picture: Some(picture(8)),
            ..deep(name, &["Ci"], settings)
        };
        let plan = plan(&[of("a.exr", &coarse), of("b.exr", &[("oocpt:deepSamples", "32")])]);
        let request = &plan.before[0].request;
        let limits = request.deep().expect("a deep image");
        assert_eq!((limits.samples(), limits.depths()), (32, [1e-3, 0.0]), "the finer one of each");
        assert_eq!(request.kinds(), [AovKind::Deep(limits)]);
    }

    #[test]
    fn files_that_the_scene_reads_are_known() {
        let folder = std::env::temp_dir().join(format!("oocpt-inputs-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let at = |name: &str| folder.join(name);
        std::fs::write(at("sky.exr"), "x").unwrap();
        std::fs::write(at("wood.1002.exr"), "x").unwrap();
        let [sky, wood] = ["sky.exr", "wood.<UDIM>.exr"].map(|name| at(name).display().to_string());
        let inputs = [sky.as_str(), wood.as_str()];
        assert!(is_input(&folder.join(".").join("sky.exr"), &inputs), "by another name");
        assert!(is_input(&at("wood.1002.exr"), &inputs));
        assert!(!is_input(&at("wood.exr"), &inputs) && !is_input(&at("out.exr"), &inputs));
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn compressions_go_by_the_names_of_other_renderers() {
        let mut with = product("/p", "a.exr");
        with.settings = vec![("driver:parameters:OpenEXR:compression".into(), "DWAA:45".into())];
        assert_eq!(plan(&[with.clone()]).of_host[0].compression, FileCompression::Dwaa);
        with.settings[0].1 = "best".into();
        let plan = plan(&[with]);
        assert_eq!((plan.of_host[0].compression, plan.warnings.len()), (FileCompression::Zip, 1));
    }
}
