// SPDX-License-Identifier: Apache-2.0
//! What a film file says of itself before its planes.

use crate::identity::FilmIdentity;
use crate::ranges::{self, SampleRange, joined};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;

/// Most pixels of a film, and so of a picture.
pub const MAX_PIXELS: u64 = 1 << 28;

/// What the planes of a film are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub enum FilmKind {
    /// Exact sums, which merge.
    #[default]
    Exact,
    /// The sums of a render in the order of its samples, from which that render goes on: a checkpoint.
    Sums,
}

/// How a picture is made of the film's means.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FilmView {
    /// Factor of the colour.
    pub exposure: f32,
    /// Colour under the picture.
    pub clear_color: [f32; 4],
    /// Summand that keeps the relative error of a black pixel finite, in units of the film.
    pub error_floor: f32,
}

/// What a film file says of itself before its planes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FilmHeader {
    /// What the planes are.
    pub kind: FilmKind,
    /// What samples depend on.
    pub identity: FilmIdentity,
    /// How a picture is made of it.
    pub view: FilmView,
    /// Samples of each plane, in ascending order: first those from sample 0 to the end of an octave, if the film has
    /// them, then those of single octaves. Empty for checkpoints.
    pub planes: Vec<Vec<SampleRange>>,
    /// Samples that were not finite.
    pub nonfinite: u64,
    /// Time that it took, summed over parts.
    pub milliseconds: u64,
    /// Largest amount of device memory.
    pub device_bytes: u64,
    /// Devices and drivers, in words.
    pub devices: BTreeSet<String>,
}

impl FilmHeader {
    /// Width and height of the planes.
    #[must_use]
    pub fn size(&self) -> [u32; 2] {
        let [_, _, width, height] = self.identity.request.window;
        [width, height]
    }

    /// Pixels of a plane.
    #[must_use]
    pub fn pixels(&self) -> u64 {
        let [width, height] = self.size();
        u64::from(width) * u64::from(height)
    }

    /// All samples, in ascending order; ranges that meet are one.
    #[must_use]
    pub fn samples(&self) -> Vec<SampleRange> {
        joined(self.planes.iter().flatten().copied())
    }

    /// End of the samples from 0 on that the first plane has; 0 without any.
    #[must_use]
    pub fn whole(&self) -> u32 {
        self.planes
            .first()
            .and_then(|plane| plane.first())
            .filter(|range| range.begin == 0)
            .map_or(0, |range| range.end)
    }

    /// What is wrong with it, if anything.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        let [x, y, width, height] = self.identity.request.window;
        let [all_x, all_y] = self.identity.request.size;
        let fits = |at: u32, side: u32, all: u32| at.checked_add(side).is_some_and(|end| end <= all);
        if self.pixels() == 0 || self.pixels() > MAX_PIXELS || !fits(x, width, all_x) || !fits(y, height, all_y) {
            return Err("its window is no part of a picture");
        }
        ranges::check(&self.planes)
    }

    /// What forbids to merge this film with another, in words.
    #[must_use]
    pub fn differences(&self, other: &Self) -> Vec<String> {
        let mut all = self.identity.differences(&other.identity);
        if self.kind != other.kind {
            all.push("one is a checkpoint, the other has sums that merge".to_owned());
        }
        let (mine, its) = (&self.view, &other.view);
        if mine.exposure.to_bits() != its.exposure.to_bits() {
            all.push(format!("exposure: {} and {}", mine.exposure, its.exposure));
        }
        if mine.clear_color != its.clear_color {
            all.push(format!("clear colour: {:?} and {:?}", mine.clear_color, its.clear_color));
        }
        if mine.error_floor.to_bits() != its.error_floor.to_bits() {
            all.push(format!("error floor: {} and {}", mine.error_floor, its.error_floor));
        }
        all
    }
}
