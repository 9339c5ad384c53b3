// SPDX-License-Identifier: Apache-2.0
//! What samples depend on: only films that agree in all of it merge.

use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What is rendered.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FilmRequest {
    /// The camera: its prim path, or what else tells it from others.
    pub camera: String,
    /// Width and height of the picture.
    pub size: [u32; 2],
    /// Column and row of the lower left pixel that is rendered, width and height of what is: the film's.
    pub window: [u32; 4],
}

/// What samples depend on. The device is not part of it: it is told in [`crate::FilmHeader::devices`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FilmIdentity {
    /// Hash of the scene's contents, 128 bits in hexadecimal digits.
    pub scene: String,
    /// What is rendered.
    pub request: FilmRequest,
    /// All settings that samples depend on, by their keys.
    pub settings: BTreeMap<String, String>,
    /// Version of the renderer.
    pub version: String,
}

impl FilmIdentity {
    /// The fields that differ, in words, with both values, this one's first.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut all = Vec::new();
        let mut compare = |name: &str, mine: &str, its: &str| {
            if mine != its {
                all.push(format!("{name}: {mine} and {its}"));
            }
        };
        compare("scene", &self.scene, &other.scene);
        let (mine, its) = (&self.request, &other.request);
        compare("camera", &mine.camera, &its.camera);
        compare("size", &size(mine.size), &size(its.size));
        compare("window", &window(mine.window), &window(its.window));
        let keys: std::collections::BTreeSet<_> = self.settings.keys().chain(other.settings.keys()).collect();
        for key in keys {
            let value = |of: &Self| of.settings.get(key).map_or("not told", String::as_str).to_owned();
            compare(key, &value(self), &value(other));
        }
        compare("version", &self.version, &other.version);
        all
    }
}

fn size([width, height]: [u32; 2]) -> String {
    format!("{width} x {height}")
}

fn window([x, y, width, height]: [u32; 4]) -> String {
    format!("{width} x {height} at {x}, {y}")
}
