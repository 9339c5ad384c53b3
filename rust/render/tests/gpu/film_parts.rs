// SPDX-License-Identifier: Apache-2.0
//! Parts of films: ranges of samples that are rendered apart merge to the bits of the whole, and to its error.

use crate::checkpoints::{Folder, by, open, view};
use crate::scenes::{features, nested, prim, sphere};
use crate::support::{TIMEOUT, read, render, render_with_messages};
use glam::DMat4;
use oocpt_abi::PrimMask;
use oocpt_core::MeshDesc;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{SampleSpan, Settings, TraversalKind};
use oocpt_film::{FilmPicture, FilmReader, picture};
use oocpt_render::{AovKind, Severity};
use std::path::{Path, PathBuf};
use std::time::Instant;

fn part(settings: &Settings, begin: u32, end: u32, file: &Path) -> Settings {
    let film_part = file.to_string_lossy().into_owned();
    Settings { film_part, span: SampleSpan { begin, end }, ..settings.clone() }
}

/// Renders samples up to the cuts, each range by the next way, and gives the picture of the merged parts.
fn merged(
    folder: &Folder,
    name: &str,
    build: fn(&mut SceneDb),
    ways: &[(Settings, bool)],
    cuts: &[u32],
) -> FilmPicture {
    let mut begin = 0;
    let mut files: Vec<PathBuf> = Vec::new();
    for ((end, (way, streams)), at) in cuts.iter().zip(ways.iter().cycle()).zip(0..) {
        let file = folder.file(&format!("{name}{at}"));
        let session = open(build, part(way, begin, *end, &file), *streams);
        render(&session, &view());
        assert_eq!(session.timings().paths, u64::from(end - begin) * view().pixels(), "{name}: these samples alone");
        assert_eq!(session.stats().samples_completed, *end, "{name}: the end of the range");
        files.push(file);
        begin = *end;
    }
    // The order of the files is nobody's business.
    files.reverse();
    picture(&files, false).expect("parts of one film")
}

fn bits(picture: &FilmPicture) -> Vec<u32> {
    picture.rgba.iter().map(|value| value.to_bits()).collect()
}

/// Cuts of 22 samples: whole, and in 2, 3, 7 unequal parts.
const CUTS: [&[u32]; 4] = [&[22], &[5, 22], &[1, 16, 22], &[2, 3, 7, 8, 13, 21, 22]];

fn parts_merge(name: &str, build: fn(&mut SceneDb), ways: &[(Settings, bool)], cuts: &[&[u32]]) {
    let folder = Folder::new(&format!("parts-{name}"));
    let whole = merged(&folder, "whole", build, &ways[..1], CUTS[0]);
    let octaves: Vec<u32> = whole.errors.iter().map(|row| row.samples).collect();
    assert_eq!((whole.samples, &*octaves), (22, &[2, 4, 8, 16, 22][..]), "{name}: octaves, and the end");
    for cuts in cuts {
        let found = merged(&folder, &format!("in{}", cuts.len()), build, ways, cuts);
        assert!(bits(&found) == bits(&whole), "{name}: other bits in {} parts", cuts.len());
        assert_eq!(found.errors, whole.errors, "{name}: the error in {} parts", cuts.len());
    }
    // The film of a plain render is the same but for rounding.
    let (way, streams) = &ways[0];
    let plain = open(build, Settings { samples_per_pixel: 22, ..way.clone() }, *streams);
    render(&plain, &view());
    let color: Vec<f32> = read(&plain, &view(), AovKind::Color);
    let near = |(a, b): (&f32, &f32)| (a - b).abs() <= 1e-5 * b.abs().max(1e-3);
    assert!(whole.rgba.iter().zip(&color).all(near), "{name}: the picture of a plain render");
    let row = plain.stats().error.expect("it is told");
    let [film, device] = [whole.error(), row.estimate].map(|estimate| estimate.expect("an estimate").rel_mse);
    assert!((film / device - 1.0).abs() < 1e-3, "{name}: relMSE {film:e}, of the device {device:e}");
}

#[test]
fn parts_of_a_film_merge_to_the_bits_of_the_whole() {
    parts_merge("core", features, &[(by(TraversalKind::Compute), false)], &CUTS[1..]);
}

#[test]
fn parts_that_are_streamed_or_traced_natively_merge_too() {
    let (core, native) = (by(TraversalKind::Compute), by(TraversalKind::Auto));
    let ways = [(core.clone(), true), (native.clone(), false), (native, true), (core, false)];
    parts_merge("ways", nested, &ways, &CUTS[2..]);
}

#[test]
fn a_part_that_ends_early_has_its_whole_octaves() {
    let folder = Folder::new("parts-early");
    let file = folder.file("part");
    let settings = Settings { time_limit_secs: 0.3, ..part(&by(TraversalKind::Compute), 0, 1 << 20, &file) };
    let session = open(nested, settings, false);
    let messages = render_with_messages(&session, &view());
    let [message] = &*messages else { panic!("one message: {messages:?}") };
    assert!(message.severity == Severity::Warning && message.text.contains("ended early"), "{message:?}");
    let samples = FilmReader::open(&file).expect("a film").header().samples();
    let [range] = &*samples else { panic!("one range: {samples:?}") };
    let done = session.stats().samples_completed;
    assert!(range.begin == 0 && range.end <= done && 2 * range.end > done, "{range} of {done}");
    let whole = merged(&folder, "whole", nested, &[(by(TraversalKind::Compute), false)], &[range.end]);
    assert!(bits(&picture(&[file], false).expect("a film")) == bits(&whole), "the same samples");
}

#[test]
fn samples_that_do_not_merge_are_refused_in_words() {
    let folder = Folder::new("parts-refused");
    let (file, way) = (folder.file("part"), by(TraversalKind::Compute));
    let plain = part(&way, 0, 16, &file);
    for (what, settings) in [
        ("adaptiveSampling", Settings { adaptive_sampling: true, ..plain.clone() }),
        ("stragglerRoulette", Settings { straggler_roulette: true, ..plain.clone() }),
        ("mitchell", Settings { pixel_filter: PixelFilterKind::Mitchell, ..plain.clone() }),
        ("shows images on the way", Settings { interactive: true, ..plain.clone() }),
    ] {
        let session = open(nested, settings, false);
        let messages = render_with_messages(&session, &view());
        let [message] = &*messages else { panic!("{what}: one message: {messages:?}") };
        assert!(message.severity == Severity::Error && message.text.contains(what), "{what}: {message:?}");
        assert!(!file.exists(), "{what}: no part");
    }
    let caught = |db: &mut SceneDb| {
        let ball = sphere(prim("/ball", DMat4::IDENTITY), 1, 6, 0.5);
        db.upsert_mesh(MeshDesc { mask: PrimMask::SHADOW_CATCHER, ..ball });
    };
    let messages = render_with_messages(&open(caught, plain.clone(), false), &view());
    assert!(matches!(&*messages, [one] if one.text.contains("shadow catchers")), "{messages:?}");
    assert!(!file.exists(), "no part");
    let other = folder.file("other");
    render(&open(nested, plain, false), &view());
    render(&open(nested, Settings { seed: 7, ..part(&way, 16, 20, &other) }, false), &view());
    let error = picture(&[file, other], false).expect_err("other samples").to_string();
    assert!(error.contains("oocpt:seed: ") && error.contains("other"), "{error}");
}

#[test]
fn a_part_that_was_killed_goes_on_from_its_last_octave() {
    let folder = Folder::new("parts-killed");
    let (file, copy, way) = (folder.file("part"), folder.file("copy"), by(TraversalKind::Compute));
    let session = open(nested, Settings { checkpoint_secs: 0.0, ..part(&way, 3, 1 << 20, &file) }, false);
    session.render(view());
    let end = Instant::now() + TIMEOUT;
    let has = |file: &Path| FilmReader::open(file).ok().and_then(|film| film.header().samples().last().copied());
    let killed = loop {
        assert!(Instant::now() < end, "no octave was done in time: {:?}", session.take_messages());
        if let Some(range) = has(&file).filter(|range| range.end > 4) {
            std::fs::copy(&file, &copy).expect("a copy");
            break range;
        }
        std::thread::sleep(std::time::Duration::from_millis(2));
    };
    drop(session);
    let kept = has(&copy).expect("a part").end;
    assert!(killed.begin == 3 && kept.is_power_of_two(), "3..{kept}");
    let all = kept + 5;
    let resumed = open(nested, part(&way, 3, all, &copy), false);
    render(&resumed, &view());
    assert_eq!(resumed.timings().paths, 5 * view().pixels(), "what the file lacks");
    let first = folder.file("first");
    render(&open(nested, part(&way, 0, 3, &first), false), &view());
    let whole = merged(&folder, "whole", nested, &[(way, false)], &[all]);
    assert!(bits(&picture(&[first, copy], false).expect("a film")) == bits(&whole), "the same bits");
}
