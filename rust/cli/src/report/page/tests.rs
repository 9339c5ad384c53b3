// SPDX-License-Identifier: Apache-2.0
//! Pages of reports that are as they should be, and of reports that strangers made.

use super::*;
use oocpt_core::convergence::ErrorEstimate;
use oocpt_core::inventory::{BufferUse, FeatureUse, PassUse, PrimvarUse, RenderInventory};
use oocpt_core::stats::{RenderUsage, TrueError, WorstPixel};
use oocpt_render::chunk_report::{ReportCamera, ReportChunk, ReportInstance};
use oocpt_render::error_report::ErrorReportHeader;
use oocpt_render::picture::PictureAttribute;

const HOSTILE: &str =
    "</title></style></script><script>alert(1)</script>\"' onload='x' & \u{0}\u{7}\u{1b}\u{202e}<img src=x>";
const HEADER: &str = r#"{"oocptErrorReport":1,"renderer":"OocPT","device":"d","width":4,"height":3,"samplesTarget":2,"maxBounces":5,"seed":9,"geometryBudgetKib":0,"reference":""}"#;
/// Elements that the page is made of, those of charts included.
const ELEMENTS: [&str; 34] = [
    "html",
    "head",
    "meta",
    "title",
    "style",
    "body",
    "h1",
    "h2",
    "h3",
    "table",
    "tr",
    "th",
    "td",
    "p",
    "section",
    "figure",
    "figcaption",
    "img",
    "details",
    "summary",
    "svg",
    "rect",
    "polyline",
    "line",
    "text",
    "circle",
    "path",
    "polygon",
    "g",
    "defs",
    "clipPath",
    "ellipse",
    "tspan",
    "desc",
];

fn rows(count: u32, scale: f64) -> Vec<ErrorRow> {
    let row = |k: u32| ErrorRow {
        samples: k + 1,
        seconds: scale * f64::from(k + 1),
        seconds_tracing: scale * f64::from(k + 1),
        rays: u64::from(k) << 20,
        estimate: Some(ErrorEstimate {
            rel_mse: scale / f64::from(k + 1),
            low: 0.5 * scale / f64::from(k + 1),
            high: 2.0 * scale / f64::from(k + 1),
        }),
        gpu_bytes: 300 << 20,
        host_peak_bytes: 1 << 30,
        bytes_paged: u64::from(k) << 20,
        worst: vec![WorstPixel { x: 3, y: 4, error: 1.0 }],
        ..ErrorRow::default()
    };
    (0..count).map(row).collect()
}

fn named(name: &str, rows: Vec<ErrorRow>) -> PageReport {
    let inventory = RenderInventory {
        features: [("domes", true), ("motion", false)]
            .map(|(what, present)| FeatureUse { what: format!("{what}{name}"), present, ..FeatureUse::default() })
            .to_vec(),
        passes: vec![PassUse { name: name.to_owned(), made: true, ..PassUse::default() }],
        buffers: vec![BufferUse { name: name.to_owned(), bytes: u64::MAX, saved: u64::MAX }; 2],
        primvars: vec![PrimvarUse { name: name.to_owned(), ..PrimvarUse::default() }],
        ..RenderInventory::default()
    };
    let header = ErrorReportHeader {
        renderer: name.to_owned(),
        device: name.to_owned(),
        reference: name.to_owned(),
        width: 64,
        height: 48,
        samples_target: u32::MAX,
        ..ErrorReportHeader::default()
    };
    let usage = Some(RenderUsage { gpu_peak_bytes: 300 << 20, loads: 7, ..RenderUsage::default() });
    let report = ErrorReport { header, inventory: Some(inventory), rows, usage };
    let attributes = vec![(name.to_owned(), PictureAttribute::Text(name.to_owned()))];
    PageReport { name: name.to_owned(), report, attributes, ..PageReport::default() }
}

/// Names of the page's elements in order; panics where they do not nest, or where one is not among [`ELEMENTS`].
fn elements(page: &str) -> Vec<&str> {
    let (mut open, mut found) = (Vec::new(), Vec::new());
    for tag in page.split('<').skip(2) {
        let (inside, _) = tag.split_once('>').unwrap_or_else(|| panic!("a tag without an end: {tag}"));
        let name = inside.trim_start_matches('/').split([' ', '/', '\n']).next().expect("a name");
        assert!(ELEMENTS.contains(&name), "an element {name:?} in {tag}");
        if inside.starts_with('/') {
            assert_eq!(open.pop(), Some(name), "elements nest");
            continue;
        }
        found.push(name);
        if !inside.ends_with('/') && !["meta", "img"].contains(&name) {
            open.push(name);
        }
    }
    assert!(open.is_empty(), "left open: {open:?}");
    found
}

#[test]
fn a_page_shows_what_the_report_says() {
    let reports = [named("forest", rows(8, 0.1)), named("city", rows(5, 0.2))];
    let page = html::page(&reports).expect("a page");
    let found = elements(&page);
    assert_eq!(found.iter().filter(|name| **name == "svg").count(), 2, "error and memory over time");
    for text in ["8 of 4294967295", "1.25e-2 (6.25e-3 to 2.50e-2)", "300 MiB", "forest, city", "3, 4", "motionforest"] {
        assert!(page.contains(text), "{text} in {page}");
    }
    let (made, left) = page.split_once("What was left out").expect("a part of its own");
    assert!(made.contains("domesforest") && left.contains("motionforest"), "features made, and left out");
    assert!(page.contains("var(--curve0)") && page.contains("var(--paper)"), "charts have the page's colours");
    assert!(!page.contains("#14141A") && !page.contains("#56B4E9\""), "and none of their own");
}

#[test]
fn text_of_strangers_is_text() {
    let page = html::page(&[named(HOSTILE, rows(3, 0.1)), named(HOSTILE, rows(3, 0.1))]).expect("a page");
    let found = elements(&page);
    assert!(!found.contains(&"script") && page.matches("<img").count() == 0, "no element is made of it");
    assert!(page.contains("&lt;script&gt;alert(1)"), "it is shown");
    let is_bad = |c: char| (c.is_control() && c != '\n' && c != '\t') || c == '\u{202e}';
    assert!(!page.contains(is_bad), "without what cannot be shown");
    assert!(page.contains("script-src") || page.contains("default-src 'none'"), "and the page forbids scripts");
    let long = text::clean(&"x".repeat(100_000));
    assert!(long.chars().count() <= 201 && long.ends_with('…'), "long texts are cut");
}

#[test]
fn numbers_of_strangers_are_numbers() {
    let mut hostile = rows(12, 0.1);
    let numbers = [f64::MAX, f64::MIN_POSITIVE, 5e-324, -1.0, f64::NAN, f64::INFINITY, 0.0, 1e300, -0.0];
    for (row, number) in hostile.iter_mut().zip(numbers) {
        (row.seconds, row.seconds_tracing, row.rays) = (number, number, u64::MAX);
        row.estimate = Some(ErrorEstimate { rel_mse: number, low: -number, high: number });
        row.truth = Some(TrueError { rel_mse: number, rmse: number, flip: number });
        (row.gpu_bytes, row.bytes_paged) = (u64::MAX, u64::MAX);
    }
    let many = named("many", rows(100_000, 1e-3));
    let page = html::page(&[named("numbers", hostile), many, named("none", Vec::new())]).expect("a page");
    elements(&page);
    assert!(page.len() < 1 << 20, "a report of 100 000 rows is {} bytes of page", page.len());
    let points = |svg: &str| svg.matches("NaN").count() + svg.matches("inf").count();
    assert_eq!(
        page.split("<svg").skip(1).map(|rest| points(rest.split("</svg>").next().unwrap_or(""))).sum::<usize>(),
        0
    );
    elements(&html::page(&[PageReport::default()]).expect("a page of nothing"));
}

#[test]
fn files_belong_to_the_report_before_them() {
    let folder = std::env::temp_dir().join(format!("oocpt-page-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let path = |name: &str| folder.join(name);
    for name in ["a.jsonl", "b.jsonl"] {
        std::fs::write(path(name), HEADER).expect("a report");
    }
    image::RgbImage::from_pixel(5, 2, image::Rgb([9; 3])).save(path("other.png")).expect("a picture");
    image::RgbImage::new(7, 7).save(path("a.png")).expect("a picture that another one is named for");
    image::Rgb32FImage::from_pixel(3000, 2, image::Rgb([f32::NAN, 0.5, 9e30])).save(path("b.exr")).expect("a picture");
    let chunks = ChunkReport {
        version: 1,
        width: 4000,
        height: 30,
        camera: ReportCamera {
            o_x: [1.0, 0.0, 0.0],
            o_y: [0.0, 1.0, 0.0],
            d: [0.0, 0.0, -1.0],
            ..ReportCamera::default()
        },
        instances: vec![ReportInstance { bounds: [[0.0, 0.0, -9.0], [2000.0, 30.0, -5.0]], chunk: 0 }],
        chunks: vec![ReportChunk { loads: 3, rays: 5, bytes: 1 << 20, ..ReportChunk::default() }],
        ..ChunkReport::default()
    };
    chunks.write(&path("c.json")).expect("a report of chunks");
    let files = ["a.jsonl", "other.png", "c.json", "b.jsonl"].map(path);
    let reports = gather(&files).expect("files");
    let sizes: Vec<_> = reports.iter().map(|of| of.picture.as_ref().map(|picture| picture.size)).collect();
    assert_eq!(sizes, [Some([5, 2]), Some([1280, 1])], "the one that is named, and the one beside the report");
    let ([loads, _], words) = reports[0].chunks.as_ref().expect("chunks");
    assert_eq!(loads.size, [1280, 9 + crate::report::paint::LEGEND], "as wide as a page");
    assert!(words.contains("3 loads") && reports[1].chunks.is_none(), "{words}");
    let page = html::page(&reports).expect("a page");
    assert_eq!(elements(&page).iter().filter(|name| **name == "img").count(), 4, "pictures and views of chunks");
    assert!(page.matches("src=\"data:image/png;base64,").count() == 4 && !page.contains("src=\"http"), "all inside");
    let first = gather(&[path("other.png")]).expect_err("no report").to_string();
    assert!(first.contains("comes before it"), "{first}");
    std::fs::write(path("a.exr"), b"no picture").expect("a file");
    assert!(gather(&[path("a.jsonl")]).expect_err("a broken picture").to_string().contains("a.exr"));
    std::fs::remove_dir_all(&folder).expect("it is there");
}
