// SPDX-License-Identifier: Apache-2.0
//! The page as HTML. `maud` escapes every text, and [`clean`] takes out what no page shows. The page's policy forbids
//! scripts and addresses, so that even a fault here could load nothing.

use super::picture::EmbeddedPicture;
use super::text::clean;
use super::{PageReport, charts};
use crate::report::error_plot::time_to;
use anyhow::Result;
use maud::{DOCTYPE, Markup, PreEscaped, html};
use oocpt_core::convergence::ErrorEstimate;
use oocpt_core::inventory::RenderInventory;
use oocpt_core::stats::RenderUsage;

/// Longest list.
const MAX_LIST: usize = 300;
const POLICY: &str = "default-src 'none'; img-src data:; style-src 'unsafe-inline'";
const STYLE: &str = include_str!("style.css");

/// The whole page.
pub(super) fn page(reports: &[PageReport]) -> Result<String> {
    let names = reports.iter().map(|of| clean(&of.name)).collect::<Vec<_>>().join(", ");
    let memory = charts::memory(reports)?;
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width";
                title { "OocPT: " (names) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                h1 { (names) }
                (figures(reports))
                h2 { "Error over time" }
                (PreEscaped(charts::error(reports)?))
                p class="note" {
                    "relMSE, against a reference where there is one, else as estimated with its 95 % interval. The \
                     dashed line falls as the inverse of the time."
                }
                h2 { "Memory over time" }
                @match memory {
                    Some(chart) => (PreEscaped(chart)),
                    None => p class="note" { "These reports have none: an older version wrote them." },
                }
                @for report in reports { (section(report, reports.len() > 1)) }
            }
        }
    };
    Ok(page.into_string())
}

/// One row for each number, one column for each report.
fn figures(reports: &[PageReport]) -> Markup {
    let rows: Vec<Vec<(&str, String)>> = reports.iter().map(numbers).collect();
    html! {
        table {
            @if reports.len() > 1 {
                tr { th {} @for of in reports { th { (clean(&of.name)) } } }
            }
            @for (number, (what, _)) in rows.first().into_iter().flatten().enumerate() {
                tr {
                    th scope="row" { (what) }
                    @for column in &rows { td { (column.get(number).map_or("", |(_, value)| value.as_str())) } }
                }
            }
        }
    }
}

/// The numbers of one report in words; each report has the same ones.
fn numbers(of: &PageReport) -> Vec<(&'static str, String)> {
    let (header, last) = (&of.report.header, of.last());
    let none = || "–".to_owned();
    let of_row = |text: &dyn Fn(&oocpt_core::stats::ErrorRow) -> String| last.map_or_else(none, text);
    let usage = |text: &dyn Fn(&RenderUsage) -> String| of.report.usage.as_ref().map_or_else(none, text);
    let estimate = |e: ErrorEstimate| format!("{:.2e} ({:.2e} to {:.2e})", e.rel_mse, e.low, e.high);
    let to = |target: f64| time_to(&of.report.rows, target).map_or_else(none, seconds);
    vec![
        ("renderer", clean(&header.renderer)),
        ("device", clean(&header.device)),
        ("picture", format!("{} × {}", header.width, header.height)),
        ("window", header.window.map_or_else(none, |[x0, y0, x1, y1]| format!("{x0}, {y0} to {x1}, {y1}"))),
        ("samples", of_row(&|row| format!("{} of {}", row.samples, header.samples_target))),
        (
            "ended",
            if of.report.usage.is_some() { "yes".to_owned() } else { "no: stopped, killed, or under way".to_owned() },
        ),
        ("bounces, seed", format!("{}, {}", header.max_bounces, header.seed)),
        ("limit of geometry", bound(header.geometry_budget_kib)),
        ("reference", if header.reference.is_empty() { none() } else { clean(&header.reference) }),
        ("seconds", usage(&|used| seconds(used.seconds_total))),
        ("seconds tracing", of_row(&|row| seconds(row.seconds_tracing))),
        (
            "seconds loading, compiling",
            usage(&|used| format!("{}, {}", seconds(used.seconds_loading), seconds(used.seconds_compiling))),
        ),
        ("rays", of_row(&|row| row.rays.to_string())),
        ("relMSE, estimated", of_row(&|row| row.estimate.map_or_else(none, estimate))),
        ("relMSE, true", of_row(&|row| row.truth.map_or_else(none, |truth| format!("{:.2e}", truth.rel_mse)))),
        ("seconds to relMSE 1e-1, 1e-2, 1e-3", [1e-1, 1e-2, 1e-3].map(to).join(", ")),
        ("device memory, most", usage(&|used| bytes(used.gpu_peak_bytes))),
        ("memory of the process, most", usage(&|used| bytes(used.host_peak_bytes))),
        (
            "scene on the device",
            usage(&|used| format!("{}, of this textures {}", bytes(used.scene_bytes), bytes(used.texture_scene_bytes))),
        ),
        ("fits, or is streamed", usage(&|used| if used.in_core { "fits" } else { "is streamed" }.to_owned())),
        ("chunks, loads, of these again", usage(&|used| format!("{}, {}, {}", used.chunks, used.loads, used.reloads))),
        ("sent to the device", usage(&|used| bytes(used.bytes_paged))),
    ]
}

/// What belongs to one render: its pictures, and what it is made of.
fn section(of: &PageReport, has_title: bool) -> Markup {
    html! {
        section {
            @if has_title { h2 { (clean(&of.name)) } }
            @if let Some(shown) = &of.picture { (picture(shown, "the picture", "The picture.")) }
            @if let Some(([loads, rays], words)) = &of.chunks {
                h3 { "Chunks" }
                (picture(loads, "boxes of chunks by loads", "Boxes of the chunks from the camera, by loads."))
                (picture(rays, "boxes of chunks by rays", "The same by the rays that visited them."))
                @for line in words.lines() { p class="note" { (clean(line)) } }
            }
            @if let Some(last) = of.last().filter(|last| !last.worst.is_empty()) {
                p class="note" {
                    "Pixels with the largest error: "
                    (last.worst.iter().take(8).map(|w| format!("{}, {}", w.x, w.y)).collect::<Vec<_>>().join("; ")) "."
                }
            }
            @if !of.attributes.is_empty() {
                details {
                    summary { "What the picture's file says" }
                    table { @for (name, value) in of.attributes.iter().take(MAX_LIST) {
                        tr { th scope="row" { (clean(name)) } td { (clean(&value.to_string())) } }
                    } }
                }
            }
            @if let Some(inventory) = &of.report.inventory { (made_of(inventory)) }
        }
    }
}

fn picture(of: &EmbeddedPicture, alt: &str, caption: &str) -> Markup {
    html! {
        figure {
            img src=(of.address) width=(of.size[0]) height=(of.size[1]) alt=(alt);
            figcaption { (caption) }
        }
    }
}

/// The parts of a render, and those that were left out.
fn made_of(inventory: &RenderInventory) -> Markup {
    let features = |present| inventory.features.iter().filter(move |f| f.present == present).map(|f| clean(&f.what));
    let passes = |made| inventory.passes.iter().filter(move |p| p.made == made).map(|p| clean(&p.name));
    let unread = |p: &&oocpt_core::inventory::PrimvarUse| p.made == 0;
    let primvars = inventory.primvars.iter().filter(unread).map(|p| clean(&p.name));
    let saved: u64 = inventory.buffers.iter().map(|b| b.saved).fold(0, u64::saturating_add);
    let taken = inventory.buffers.iter().filter(|b| b.bytes > 0);
    html! {
        h3 { "What it is made of" }
        table {
            tr { th scope="row" { "features" } td { (list(features(true))) } }
            tr { th scope="row" { "passes" } td { (list(passes(true))) } }
            tr { th scope="row" { "buffers" } td {
                (list(taken.map(|b| format!("{} ({})", clean(&b.name), bytes(b.bytes)))))
            } }
            tr { th scope="row" { "paths in flight" } td { (inventory.paths) } }
            tr { th scope="row" { "rays are walked by" } td {
                (clean(&inventory.traversal.backend)) ": " (clean(&inventory.traversal.why))
            } }
        }
        h3 { "What was left out" }
        table {
            tr { th scope="row" { "features" } td { (list(features(false))) } }
            tr { th scope="row" { "passes" } td { (list(passes(false))) } }
            tr { th scope="row" { "primvars that nothing reads" } td { (list(primvars)) } }
            tr { th scope="row" { "device memory" } td { (bytes(saved)) } }
        }
    }
}

/// Texts in a row, `–` without any.
fn list(texts: impl Iterator<Item = String>) -> String {
    let mut texts: Vec<String> = texts.collect();
    let more = texts.len().saturating_sub(MAX_LIST);
    texts.truncate(MAX_LIST);
    if more > 0 {
        texts.push(format!("and {more} more"));
    }
    if texts.is_empty() { "–".to_owned() } else { texts.join("; ") }
}

fn bound(kib: u32) -> String {
    if kib == 0 { "none".to_owned() } else { bytes(u64::from(kib) << 10) }
}

fn seconds(value: f64) -> String {
    if value.abs() < 1e6 { format!("{value:.3}") } else { format!("{value:.3e}") }
}

/// Bytes in the unit that leaves few digits.
fn bytes(count: u64) -> String {
    let units = [("GiB", 30), ("MiB", 20), ("KiB", 10)];
    #[expect(clippy::cast_precision_loss, reason = "three digits are shown")]
    let shown = units.iter().find(|(_, shift)| count >> shift > 0).map(|(unit, shift)| {
        let value = count as f64 / (1_u64 << shift) as f64;
        format!("{value:.digits$} {unit}", digits = if value < 100.0 { 1 } else { 0 })
    });
    shown.unwrap_or_else(|| format!("{count} bytes"))
}
