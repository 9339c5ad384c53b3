// SPDX-License-Identifier: Apache-2.0
//! What stands on the island: meshes, clumps of meshes (and of clumps), and the species that scatter them.
//!
//! All variants of a species hold the same number of meshes, so that the number of instances comes out exactly.

use glam::{DQuat, DVec3};
use rayon::prelude::*;

use super::land::Habitat;
use super::random::Random;
use super::soup::{Soup, flower, frond, leaves, lump, trunk, trunk_at, tuft};

/// A uniform scale, then a turn, then a shift.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Place {
    pub(crate) at: DVec3,
    pub(crate) turn: DQuat,
    pub(crate) scale: f64,
}

impl Place {
    /// First `inner`, then this.
    pub(crate) fn of(&self, inner: &Self) -> Self {
        Self {
            at: self.at + self.turn * (inner.at * self.scale),
            turn: self.turn * inner.turn,
            scale: self.scale * inner.scale,
        }
    }
}

/// What a part or a species shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Item {
    /// Index into [`Plants::shapes`].
    Shape(usize),
    /// Index into [`Plants::clumps`].
    Clump(usize),
}

/// A few things that always stand together.
#[derive(Debug)]
pub(crate) struct Clump {
    pub(crate) name: String,
    /// Clumps among them come earlier in [`Plants::clumps`].
    pub(crate) parts: Vec<(Item, Place)>,
}

/// A thing that grows in one habitat.
#[derive(Debug)]
pub(crate) struct Species {
    pub(crate) name: &'static str,
    pub(crate) habitat: Habitat,
    /// Part of all instances, counted as meshes; 0 = what is left over.
    pub(crate) share: f64,
    /// Shown in turn.
    pub(crate) variants: Vec<Item>,
    /// Least and greatest scale.
    pub(crate) scale: [f64; 2],
    /// True: as many small ones as there are few large ones (even in the logarithm), false: even.
    pub(crate) is_log: bool,
    /// Metres to sink into the ground at scale 1.
    pub(crate) sink: f64,
    /// How much it follows the slope, 0 = upright.
    pub(crate) lean: f64,
    /// Kept free around the camera, metres.
    pub(crate) clearing: f64,
}

/// A named mesh.
#[derive(Debug)]
pub(crate) struct Shape {
    pub(crate) name: String,
    pub(crate) soup: Soup,
}

/// All of it.
#[derive(Debug)]
pub(crate) struct Plants {
    pub(crate) shapes: Vec<Shape>,
    pub(crate) clumps: Vec<Clump>,
    pub(crate) species: Vec<Species>,
}

type Maker = fn(u64, &mut Random) -> Soup;

/// (name, variants, quads relative to the others, maker).
const SHAPES: &[(&str, u64, f64, Maker)] = &[
    ("pebble", 8, 0.6, pebble),
    ("shell", 3, 0.6, |quads, random| {
        let size = DVec3::new(0.03, 0.012, 0.024) * random.range(0.7, 1.3);
        lump(quads, DVec3::ZERO, size, 0.1, DVec3::new(0.72, 0.60, 0.52), random)
    }),
    ("stick", 3, 0.4, |quads, random| {
        trunk(quads, random.range(0.3, 0.9), 0.011, random.range(0.05, 0.3), DVec3::new(0.33, 0.27, 0.21))
    }),
    ("litter", 2, 0.3, |quads, random| {
        let mut soup = Soup::of_color(DVec3::new(0.30, 0.20, 0.09));
        leaves(&mut soup, quads.max(4), DVec3::ZERO, DVec3::new(0.12, 0.02, 0.12), 1.0, random);
        soup
    }),
    ("rock", 4, 4.0, |quads, random| {
        let size = DVec3::new(1.0, random.range(0.5, 0.8), random.range(0.7, 1.0));
        lump(quads, DVec3::ZERO, size, 0.28, DVec3::new(0.19, 0.17, 0.16), random)
    }),
    ("palm_trunk", 3, 2.0, |quads, random| {
        trunk(quads, PALM_HEIGHT, 0.15, palm_bend(random), DVec3::new(0.26, 0.20, 0.15))
    }),
    ("palm_frond", 3, 1.6, |quads, random| {
        let droop = random.range(0.6, 1.0);
        frond(quads, 3.4, droop, DVec3::new(0.12, 0.20, 0.04), random)
    }),
    ("coconut", 1, 0.4, |quads, random| {
        lump(quads, DVec3::ZERO, DVec3::new(0.13, 0.16, 0.13), 0.05, DVec3::new(0.20, 0.15, 0.05), random)
    }),
    ("leaves", 4, 1.5, |quads, random| {
        let tint = DVec3::new(0.07, 0.15, 0.035) * random.range(0.7, 1.5);
        let mut soup = Soup::of_color(tint);
        leaves(&mut soup, quads.max(6), DVec3::ZERO, DVec3::splat(0.34), 1.0, random);
        soup
    }),
    ("flower", 2, 0.5, |quads, random| {
        let color = if random.unit() < 0.5 { DVec3::new(0.62, 0.07, 0.10) } else { DVec3::new(0.75, 0.45, 0.08) };
        flower(quads, 0.12, color, random)
    }),
    ("fern", 3, 0.9, |quads, random| frond(quads, 0.9, 0.7, DVec3::new(0.10, 0.21, 0.04), random)),
    ("tuft", 4, 0.9, |quads, random| {
        let color = DVec3::new(0.22, 0.27, 0.07) * random.range(0.8, 1.3);
        tuft(quads, 0.55, color, random)
    }),
];

/// Height of a palm's trunk, metres.
const PALM_HEIGHT: f64 = 8.0;

fn palm_bend(random: &mut Random) -> f64 {
    random.range(0.08, 0.3)
}

/// The stream that makes shape number `k`.
fn shape_stream(seed: u64, k: usize) -> Random {
    Random::new(&[seed, 0x5a, k as u64])
}

fn pebble(quads: u64, random: &mut Random) -> Soup {
    let size = DVec3::new(1.0, random.range(0.45, 0.75), random.range(0.7, 1.0));
    let grey = DVec3::new(0.30, 0.27, 0.24) * random.range(0.5, 1.6);
    lump(quads, DVec3::ZERO, size, 0.12, grey, random)
}

/// Quads of a kind of shape relative to the others, by shape.
pub(crate) fn weights() -> Vec<f64> {
    SHAPES.iter().flat_map(|&(_, variants, weight, _)| (0..variants).map(move |_| weight)).collect()
}

impl Plants {
    /// Everything but the meshes, which come with [`Plants::make_shapes`].
    pub(crate) fn new(seed: u64) -> Self {
        let names = SHAPES.iter().flat_map(|&(name, variants, ..)| (0..variants).map(move |k| format!("{name}_{k}")));
        let shapes = names.map(|name| Shape { name, soup: Soup::default() }).collect();
        let mut plants = Self { shapes, clumps: Vec::new(), species: Vec::new() };
        plants.add_species(seed);
        plants
    }

    /// Makes the meshes, `unit` quads times their weight each, in parallel.
    pub(crate) fn make_shapes(&mut self, unit: f64, seed: u64) {
        let makers: Vec<(f64, Maker)> =
            SHAPES.iter().flat_map(|&(_, n, weight, maker)| (0..n).map(move |_| (weight, maker))).collect();
        self.shapes.par_iter_mut().zip(makers).enumerate().for_each(|(k, (shape, (weight, maker)))| {
            #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "positive and moderate")]
            let quads = (unit * weight).max(8.0) as u64;
            shape.soup = maker(quads, &mut shape_stream(seed, k));
        });
    }

    /// The variants of a kind of shape.
    pub(crate) fn all(&self, kind: &str) -> Vec<Item> {
        let is_kind = |shape: &Shape| shape.name.rsplit_once('_').is_some_and(|(name, _)| name == kind);
        self.shapes.iter().enumerate().filter(|(_, s)| is_kind(s)).map(|(k, _)| Item::Shape(k)).collect()
    }

    /// Adds `variants` clumps of the same `groups`.
    pub(crate) fn add_clumps(&mut self, name: &str, variants: u64, groups: &[Group<'_>], seed: u64) -> Vec<Item> {
        let first = self.clumps.len();
        for variant in 0..variants {
            let mut random = Random::new(&[seed, 0xc1, first as u64, variant]);
            let mut parts = Vec::new();
            for group in groups {
                let skip = random.range(0.0, 8.0).floor();
                let shown = group.items.iter().cycle().skip(usize::from(skip > 3.0) + usize::from(skip > 5.0));
                for (k, item) in (0..group.count).zip(shown) {
                    let part = (f64::from(k) + 0.5) / f64::from(group.count);
                    parts.push((*item, (group.place)(part, &mut random)));
                }
            }
            self.clumps.push(Clump { name: format!("{name}_{variant}"), parts });
        }
        (first..self.clumps.len()).map(Item::Clump).collect()
    }

    /// Where the trunk of a palm ends.
    pub(crate) fn trunk_top(&self, trunk: Item, seed: u64) -> DVec3 {
        match trunk {
            Item::Shape(k) => trunk_at(1.0, PALM_HEIGHT, palm_bend(&mut shape_stream(seed, k))),
            Item::Clump(_) => DVec3::ZERO,
        }
    }

    /// Adds a species.
    pub(crate) fn add(&mut self, species: Species) {
        self.species.push(species);
    }

    /// All shapes of an item with their places, clumps taken apart.
    pub(crate) fn flat(&self, item: Item) -> Vec<(usize, Place)> {
        match item {
            Item::Shape(shape) => {
                vec![(shape, Place { at: DVec3::ZERO, turn: DQuat::IDENTITY, scale: 1.0 })]
            }
            Item::Clump(clump) => {
                let parts = &self.clumps[clump].parts;
                let inner = |(item, place): &(Item, Place)| {
                    let place = *place;
                    self.flat(*item).into_iter().map(move |(shape, inner)| (shape, place.of(&inner)))
                };
                parts.iter().flat_map(inner).collect()
            }
        }
    }
}

/// Equal parts of a clump.
pub(crate) struct Group<'a> {
    /// Shown in turn.
    pub(crate) items: &'a [Item],
    /// How many.
    pub(crate) count: u32,
    /// Where the part goes that has this fraction of the others before it.
    pub(crate) place: &'a dyn Fn(f64, &mut Random) -> Place,
}
