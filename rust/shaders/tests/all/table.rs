// SPDX-License-Identifier: Apache-2.0
//! The table of passes: every shader has its row, and `shaders/README.md` shows it as it is.

use oocpt_abi::Features;
use oocpt_shaders::{ALL, PASSES, Pass, PassImage, document};
use std::path::Path;

#[test]
fn every_wavefront_shader_has_one_row() {
    for module in ALL.iter().filter(|module| !module.name.starts_with("light_")) {
        let rows = PASSES.iter().filter(|row| row.module.name == module.name).count();
        assert_eq!(rows, 1, "{}", module.name);
    }
    for (index, row) in PASSES.iter().enumerate() {
        assert_eq!(row.pass as usize, index, "{}: a pass is its row", row.module.name);
        assert_eq!(row.pass.name(), row.module.name);
    }
}

#[test]
fn conditions_take_features_and_images() {
    let has = |pass: Pass, features, image| pass.info().when.holds(features, |wanted| Some(wanted) == image);
    let textured = Features::STREAMING | Features::TEXTURES;
    assert!(has(Pass::Resolve, Features::empty(), None));
    assert!(!has(Pass::CountDemand, Features::TEXTURES, None) && has(Pass::CountDemand, Features::STREAMING, None));
    assert!(has(Pass::ResolveMaterials, textured, None) && !has(Pass::ResolveLights, textured, None));
    let lights = textured | Features::MESH_LIGHT_VALUES;
    assert!(!has(Pass::ResolveMaterials, lights, None) && has(Pass::ResolveLights, lights, None), "one of the two");
    assert!(!has(Pass::ShadeAovs, lights, None) && has(Pass::ShadeAovs, lights, Some(PassImage::FirstHits)));
    assert!(!has(Pass::CountSamples, lights, Some(PassImage::PixelCentres)));
}

#[test]
fn the_readme_of_the_shaders_has_the_table() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shaders/README.md");
    let text = std::fs::read_to_string(path).expect("the README");
    let table = document();
    assert!(text.contains(&table), "shaders/README.md: the table of passes is not this one:\n\n{table}");
}
