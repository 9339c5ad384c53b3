// SPDX-License-Identifier: Apache-2.0
//! Films of made-up samples, and folders for their files.

use oocpt_film::{ExactFilm, ExactPixel, ExactSums as _, FilmHeader, FilmIdentity, FilmRequest, FilmView, SampleRange};
use std::path::{Path, PathBuf};

/// A folder that is removed at the end.
pub(crate) struct Folder(PathBuf);

impl Folder {
    pub(crate) fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("oocpt-film-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        Self(folder)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        std::fs::remove_dir_all(&self.0).expect("own files can be removed");
    }
}

/// Bits that follow from a number (splitmix64).
pub(crate) fn scrambled(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// A number in 0..1.
#[expect(clippy::cast_precision_loss, reason = "24 bits")]
fn uniform(number: u64) -> f32 {
    (scrambled(number) >> 40) as f32 / 16_777_216.0
}

/// A sample of a picture: a gradient with noise, some black pixels, and fireflies.
pub(crate) fn sample(pixel: u64, index: u32) -> [f32; 4] {
    let number = |dimension: u64| uniform(pixel << 40 | u64::from(index) << 8 | dimension);
    if pixel.is_multiple_of(17) {
        return [0.0, 0.0, 0.0, number(5)];
    }
    let firefly = if number(0) > 0.999 { 5e4 } else { 1.0 };
    let base = 0.01 + uniform(pixel / 5);
    let channel = |k| base * (0.5 + number(k)) * firefly;
    [channel(1), channel(2) * 1e-3, channel(3) * 1e3, if number(4) > 0.2 { 1.0 } else { 0.0 }]
}

/// What a film of this size says of itself.
pub(crate) fn header([width, height]: [u32; 2]) -> FilmHeader {
    let request = FilmRequest {
        camera: "/World/Camera".to_owned(),
        size: [width + 3, height + 4],
        window: [2, 3, width, height],
    };
    let settings = [("oocpt:seed".to_owned(), "7".to_owned())].into();
    let identity = FilmIdentity { scene: "0123456789abcdef".to_owned(), request, settings, version: "0".to_owned() };
    let view = FilmView { exposure: 1.7, clear_color: [0.1, 0.2, 0.3, 0.25], error_floor: 0.01 };
    FilmHeader { identity, view, ..FilmHeader::default() }
}

/// The sums of a range of samples.
pub(crate) fn plane(size: [u32; 2], range: SampleRange) -> Vec<ExactPixel> {
    let pixels = u64::from(size[0]) * u64::from(size[1]);
    let sums = |pixel| {
        let mut sums = ExactPixel::default();
        for index in range.begin..range.end {
            assert!(sums.add_sample(sample(pixel, index)), "it is finite");
        }
        sums
    };
    (0..pixels).map(sums).collect()
}

/// A film of a range of samples.
pub(crate) fn film(size: [u32; 2], range: SampleRange) -> ExactFilm {
    let mut film = ExactFilm::new(header(size)).expect("a sound header");
    for piece in range.pieces() {
        film.add(piece, plane(size, piece)).expect("it fits");
    }
    film
}

/// Writes films of these ranges, and returns their files.
pub(crate) fn parts(folder: &Folder, size: [u32; 2], cuts: &[u32]) -> Vec<PathBuf> {
    let write = |cut: &[u32]| {
        let path = folder.path(&format!("part-{}-{}.film", cut[0], cut[1]));
        film(size, SampleRange::new(cut[0], cut[1])).write(&path).expect("it can be written");
        path
    };
    cuts.windows(2).map(write).collect()
}

/// The bytes of a file.
pub(crate) fn bytes(path: &Path) -> Vec<u8> {
    std::fs::read(path).expect("it is there")
}
