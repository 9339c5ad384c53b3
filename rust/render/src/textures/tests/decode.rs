// SPDX-License-Identifier: Apache-2.0
//! Images that give whole levels through [`SourceImage::read`], and libraries that know neither identities nor colour
//! spaces.

use super::harness::{Procedural, encoded, image, noise};
use crate::textures::{BAND_BYTES, ImageError, ImageLibrary, SourceImage};
use oocpt_core::scene::AssetRef;
use oocpt_core::texture::TexelFormat;
use std::sync::Arc;

/// All bands of the level: first row and bytes.
fn bands(image: &Procedural, level: u32) -> Vec<(u32, Vec<u8>)> {
    let mut bands = Vec::new();
    let mut keep = |top: u32, rows: &[u8]| {
        bands.push((top, rows.to_vec()));
        true
    };
    image.decode(level, &mut keep).expect("nothing can fail");
    bands
}

#[test]
fn a_level_is_decoded_from_the_top_down() {
    // More than one band, the last of which is not full.
    let size = [1500, 1201];
    let image = image(size, 3, TexelFormat::U8);
    let bands = bands(&image, 0);
    assert!(bands.len() > 1, "{} bands", bands.len());
    assert!(bands.iter().all(|(_, rows)| rows.len() <= BAND_BYTES), "bounded");
    let mut y = 0;
    for (top, rows) in &bands {
        assert_eq!(*top, y, "bands follow on each other");
        for row in rows.chunks_exact(3 * 1500) {
            // Row 0 of an image is its lowest.
            let from_below = size[1] - 1 - y;
            let expected: Vec<u8> = (0..size[0])
                .flat_map(|x| (0..3).flat_map(move |c| encoded(noise(0, x, from_below, c), TexelFormat::U8)))
                .collect();
            assert_eq!(row, expected, "row {y} from the top");
            y += 1;
        }
    }
    assert_eq!(y, size[1], "all rows");
}

#[test]
fn rows_longer_than_a_band_are_read_singly() {
    let image = image([1 << 19, 2], 4, TexelFormat::F32);
    let tops: Vec<(u32, usize)> = bands(&image, 0).iter().map(|(top, rows)| (*top, rows.len())).collect();
    assert_eq!(tops, [(0, 16 << 19), (1, 16 << 19)], "a row each");
}

#[test]
fn the_sink_may_stop_and_levels_have_to_be_there() {
    let image = image([1500, 1201], 3, TexelFormat::U8);
    let mut count = 0;
    let mut stop = |_: u32, _: &[u8]| {
        count += 1;
        false
    };
    image.decode(0, &mut stop).expect("stopping is no error");
    assert_eq!(count, 1, "no more bands");
    assert!(image.decode(1, &mut |_, _| true).is_err(), "no such level");
}

#[test]
fn libraries_of_tests_know_neither_identities_nor_color_spaces() {
    #[derive(Debug)]
    struct Nothing;
    impl ImageLibrary for Nothing {
        fn open(&self, _: &AssetRef) -> Result<Arc<dyn SourceImage>, ImageError> {
            Err(ImageError("nothing".into()))
        }
    }
    let asset = AssetRef { authored: "a.png".into(), resolved: "/a.png".into() };
    assert_eq!(Nothing.identity(&asset).expect_err("none").to_string(), "a.png has no identity");
    assert!(Nothing.color_transform("ACEScg").expect_err("none").to_string().contains("`ACEScg`"), "the name is told");
}
