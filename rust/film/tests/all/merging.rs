// SPDX-License-Identifier: Apache-2.0
//! Parts of a film merge to the bits of the whole.

use crate::support::{Folder, bytes, film, header, parts, plane};
use oocpt_film::{ExactFilm, ExactSums as _, FilmReader, SampleRange, merge, missing, picture};
use std::path::PathBuf;

/// More than three tiles, of no round size.
const SIZE: [u32; 2] = [131, 97];
const SAMPLES: u32 = 45;

/// The file of the whole film, of its parts, and of what they merge to.
fn compare(name: &str, cuts: &[u32], order: impl Fn(&mut Vec<PathBuf>)) {
    let folder = Folder::new(name);
    let whole = parts(&folder, SIZE, &[0, SAMPLES]).remove(0);
    let mut files = parts(&folder, SIZE, cuts);
    order(&mut files);
    let merged = folder.path("merged.film");
    let header = merge(&files, &merged).expect("they merge");
    assert_eq!(header.samples(), [SampleRange::new(0, SAMPLES)]);
    assert!(bytes(&merged) == bytes(&whole), "{cuts:?}: every byte, the errors among them");
    let [one, many] = [&[whole][..], &files].map(|films| picture(films, false).expect("whole"));
    assert_eq!(one.errors, many.errors, "at 2, 4, 8, 16, 32 and {SAMPLES} samples");
    assert_eq!(one.errors.iter().map(|error| error.samples).collect::<Vec<_>>(), [2, 4, 8, 16, 32, SAMPLES]);
    assert!(one.error().is_some_and(|error| error.rel_mse > 0.0) && one.error() == many.error(), "{:?}", one.error());
    assert!(one.rgba == many.rgba, "the same picture");
}

#[test]
fn two_parts_merge_to_the_whole() {
    compare("two", &[0, 27, SAMPLES], |_| {});
}

#[test]
fn three_parts_in_any_order_merge_to_the_whole() {
    compare("three", &[0, 1, 32, SAMPLES], |files| files.rotate_left(1));
}

#[test]
fn seven_parts_of_any_length_merge_to_the_whole() {
    compare("seven", &[0, 3, 4, 11, 12, 31, 40, SAMPLES], |files| files.reverse());
}

#[test]
fn merged_films_merge() {
    let folder = Folder::new("again");
    let files = parts(&folder, [7, 5], &[0, 2, 9, 21, 32]);
    let [left, right, all] = ["left", "right", "all"].map(|name| folder.path(name));
    merge(&[files[0].clone(), files[3].clone()], &left).expect("a film with a hole");
    merge(&files[1..3], &right).expect("a film without sample 0");
    assert_eq!(FilmReader::open(&left).expect("there").header().samples().len(), 2, "two ranges");
    merge(&[right, left], &all).expect("the whole");
    film([7, 5], SampleRange::new(0, 32)).write(&files[0]).expect("it can be written");
    assert!(bytes(&all) == bytes(&files[0]), "the whole film at once");
}

#[test]
fn threads_change_nothing() {
    let folder = Folder::new("threads");
    let files = parts(&folder, SIZE, &[0, 5, 20]);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        pool.install(|| picture(&files, false).expect("whole"))
    };
    let [one, many] = [with(1), with(7)];
    assert!(one.errors == many.errors && one.rgba == many.rgba, "the same bits");
}

#[test]
fn a_film_goes_on_from_its_file() {
    let folder = Folder::new("goes-on");
    let [path, whole] = ["film", "whole"].map(|name| folder.path(name));
    film([9, 4], SampleRange::new(0, 11)).write(&path).expect("it can be written");
    let mut read = ExactFilm::read(&path, 1 << 20).expect("it is small");
    for piece in SampleRange::new(11, 30).pieces() {
        read.add(piece, plane([9, 4], piece)).expect("it goes on");
    }
    read.write(&path).expect("it can be written");
    film([9, 4], SampleRange::new(0, 30)).write(&whole).expect("it can be written");
    assert!(bytes(&path) == bytes(&whole), "as if it had never stopped");
    let said = ExactFilm::read(&path, 1000).expect_err("it is too large").to_string();
    assert!(said.contains("more than 1000"), "{said}");
}

#[test]
fn what_does_not_fit_a_film_is_refused() {
    let size = [3, 2];
    let mut film = film(size, SampleRange::new(0, 5));
    let all = |range| plane(size, range);
    let range = SampleRange::new;
    assert!(film.add(range(5, 9), all(range(5, 9))).is_err(), "of two octaves");
    assert!(film.add(range(4, 6), all(range(4, 6))).is_err(), "sample 4 is there");
    assert!(film.add(range(5, 7), all(range(5, 8))).is_err(), "other samples than it says");
    assert!(film.add(range(5, 7), all(range(5, 7))[..5].to_vec()).is_err(), "a pixel is missing");
    film.add(range(5, 8), all(range(5, 8))).expect("that fits");
    assert_eq!(film.header().planes, [[range(0, 8)]], "three octaves are one plane");
}

#[test]
fn the_picture_is_that_of_the_means() {
    let folder = Folder::new("picture");
    let size = [6, 3];
    let files = parts(&folder, size, &[0, 6]);
    let picture = picture(&files, false).expect("whole");
    assert_eq!((picture.samples, picture.rgba.len()), (6, 72));
    for (pixel, (rgba, sums)) in picture.rgba.chunks_exact(4).zip(plane(size, SampleRange::new(0, 6))).enumerate() {
        let alpha = sums.alpha_mean() as f32;
        for (channel, clear) in [0.1, 0.2, 0.3].into_iter().enumerate() {
            let expected = sums.mean()[channel] as f32 * 1.7 + clear * (1.0 - alpha);
            assert_eq!(rgba[channel].to_bits(), expected.to_bits(), "pixel {pixel}, channel {channel}");
        }
        assert!((rgba[3] - (alpha + 0.25 * (1.0 - alpha))).abs() < 1e-6, "alpha of pixel {pixel}");
    }
}

#[test]
fn a_film_in_memory_has_the_picture_of_its_file_in_whatever_order_samples_came() {
    let folder = Folder::new("memory");
    let size = [9, 500]; // more pixels than a tile
    let range = SampleRange::new;
    for (name, ranges) in [
        ("whole", &[range(8, 11), range(0, 1), range(4, 8), range(1, 2), range(2, 3), range(3, 4)][..]),
        ("octave", &[range(2, 4), range(1, 2), range(0, 1)]),
        ("holes", &[range(9, 11), range(0, 1), range(20, 22)]),
        ("end", &[range(5, 7)]),
    ] {
        let mut film = ExactFilm::new(header(size)).expect("a sound header");
        for range in ranges {
            film.add(*range, plane(size, *range)).expect("it fits");
        }
        let path = folder.path(name);
        film.write(&path).expect("it can be written");
        let (have, expected) = (film.picture(), picture(&[path], true).expect("its own file"));
        assert!(have.rgba == expected.rgba && have.errors == expected.errors, "{name}: the same bits");
        assert_eq!((have.samples, have.missing), (expected.samples, expected.missing), "{name}");
    }
    let empty = ExactFilm::new(header(size)).expect("a sound header").picture();
    assert_eq!((empty.samples, empty.rgba.len()), (0, 0), "nothing");
}

#[test]
fn missing_samples_are_told() {
    let folder = Folder::new("holes");
    let files = parts(&folder, [4, 4], &[2, 5, 9, 12]);
    let some = [files[0].clone(), files[2].clone()];
    let said = picture(&some, false).expect_err("samples are missing").to_string();
    assert!(said.ends_with("samples 0..2, 5..9 are missing"), "{said}");
    let partial = picture(&some, true).expect("what is there");
    assert_eq!((partial.samples, partial.error()), (6, None), "nothing is known of the error");
    let mut expected = plane([4, 4], SampleRange::new(2, 5));
    expected.iter_mut().zip(plane([4, 4], SampleRange::new(9, 12))).for_each(|(sum, pixel)| sum.merge(&pixel));
    let red = expected.iter().map(|sum| sum.mean()[0] as f32 * 1.7 + 0.1 * (1.0 - sum.alpha_mean() as f32));
    assert!(partial.rgba.iter().step_by(4).copied().eq(red), "the mean of what is there");
    let range = SampleRange::new;
    assert_eq!(missing(&[range(2, 5), range(9, 12)], 16), [range(0, 2), range(5, 9), range(12, 16)]);
    assert_eq!(missing(&[range(0, 20)], 16), []);
    assert_eq!(missing(&[range(20, 30)], 16), [range(0, 16)]);
}

#[test]
fn films_that_do_not_belong_together_are_refused_by_name() {
    let folder = Folder::new("foreign");
    let files = parts(&folder, [4, 4], &[0, 3, 8]);
    let refused = |name: &str, change: fn(&mut oocpt_film::FilmHeader), said: &str| {
        let mut header = header([4, 4]);
        change(&mut header);
        let path = folder.path(name);
        ExactFilm::new(header).expect("a sound header").write(&path).expect("it can be written");
        let out = folder.path("out");
        let error = merge(&[files[0].clone(), path], &out).expect_err(name).to_string();
        assert!(error.contains(&format!("{name}: does not merge with ")), "the file is named: {error}");
        assert!(error.ends_with(&format!("part-0-3.film: {said}")), "{error}");
        assert!(!out.exists(), "nothing is written");
    };
    refused("scene", |h| h.identity.scene = "ff".to_owned(), "scene: ff and 0123456789abcdef");
    refused("camera", |h| h.identity.request.camera.push('2'), "camera: /World/Camera2 and /World/Camera");
    refused("size", |h| h.identity.request.size[0] = 8, "size: 8 x 8 and 7 x 8");
    refused("window", |h| h.identity.request.window[0] = 1, "window: 4 x 4 at 1, 3 and 4 x 4 at 2, 3");
    refused("version", |h| h.identity.version.push('1'), "version: 01 and 0");
    refused("exposure", |h| h.view.exposure = 2.0, "exposure: 2 and 1.7");
    refused("floor", |h| h.view.error_floor = 0.5, "error floor: 0.5 and 0.01");
    refused(
        "settings",
        |h| h.identity.settings = [("oocpt:maxBounces".to_owned(), "5".to_owned())].into(),
        "oocpt:maxBounces: 5 and not told; oocpt:seed: not told and 7",
    );
    let over = merge(&[files[1].clone(), files[0].clone(), files[1].clone()], &folder.path("out"));
    let said = over.expect_err("a part twice").to_string();
    assert!(said.ends_with("both have samples 3..8"), "{said}");
    assert!(merge(&[], &folder.path("out")).is_err(), "nothing to merge");
}

/// 64 parts of 42 MB each, unpacked: all planes of the merged film would take 290 MB.
#[cfg(target_os = "linux")]
#[test]
fn memory_does_not_grow_with_the_number_of_parts() {
    use oocpt_film::ExactPixel;
    let folder = Folder::new("memory");
    let size = [512, 512];
    let write = |index: u32| {
        let path = folder.path(&format!("{index}"));
        let mut pixel = ExactPixel::default();
        pixel.add_sample([index as f32, 1.0, 0.5, 1.0]);
        let mut film = ExactFilm::new(header(size)).expect("a sound header");
        film.add(SampleRange::new(index, index + 1), vec![pixel; 512 * 512]).expect("it fits");
        film.write(&path).expect("it can be written");
        path
    };
    let files: Vec<PathBuf> = (0..64).map(write).collect();
    let kib = |name: &str| -> u64 {
        let status = std::fs::read_to_string("/proc/self/status").expect("Linux");
        let line = status.lines().find(|line| line.starts_with(name)).expect(name);
        line.split_whitespace().nth(1).and_then(|number| number.parse().ok()).expect("a number")
    };
    // The peak begins anew.
    std::fs::write("/proc/self/clear_refs", "5").expect("Linux");
    let before = kib("VmRSS");
    merge(&files, &folder.path("merged")).expect("they merge");
    let taken = kib("VmHWM").saturating_sub(before);
    assert!(taken < 100 << 10, "{taken} KiB");
}
