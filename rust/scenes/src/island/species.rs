// SPDX-License-Identifier: Apache-2.0
//! The species of the island and their clumps: which meshes, how many, how large, where. A table more than a program.

use glam::{DQuat, DVec3};

use super::land::Habitat;
use super::plants::{Group, Item, Place, Plants, Species};
use super::random::Random;

/// Upright, turned about y.
fn upright(at: DVec3, yaw: f64, scale: f64) -> Place {
    Place { at, turn: DQuat::from_rotation_y(yaw), scale }
}

/// A spot of a sunflower disk, with jitter: things spread out, none on top of another.
fn on_disk(part: f64, radius: f64, scale: [f64; 2], random: &mut Random) -> Place {
    let angle = part * 977.0 + 0.3 * random.normal();
    let out = radius * part.sqrt() * random.range(0.85, 1.1);
    upright(DVec3::new(angle.cos() * out, 0.0, angle.sin() * out), random.angle(), random.range(scale[0], scale[1]))
}

/// Lying anyhow.
fn lying(part: f64, radius: f64, scale: [f64; 2], random: &mut Random) -> Place {
    let mut place = on_disk(part, radius, scale, random);
    // Sticks stand along y; laid down they point anywhere in the plane.
    place.turn *= DQuat::from_rotation_x(1.5 + 0.1 * random.normal());
    place.at.y += 0.01;
    place
}

/// On the upper half of a ball of `radius` that sits on the ground, turned outward.
fn on_dome(part: f64, radius: f64, random: &mut Random) -> Place {
    let (angle, y) = (part * 977.0 + 0.2 * random.normal(), (1.0 - part).clamp(0.0, 1.0));
    let out = (1.0 - y * y).sqrt();
    let direction = DVec3::new(angle.cos() * out, y, angle.sin() * out);
    let at = direction * radius * random.range(0.7, 1.05) + DVec3::Y * 0.25 * radius;
    Place { at, turn: DQuat::from_rotation_arc(DVec3::Y, direction), scale: random.range(0.8, 1.2) }
}

/// A frond at the top of a stem of `height`.
fn at_crown(part: f64, height: f64, random: &mut Random) -> Place {
    let yaw = part * std::f64::consts::TAU * 3.0 + 0.25 * random.normal();
    let pitch = 0.75 - 1.25 * part + 0.1 * random.normal();
    let turn = DQuat::from_rotation_y(yaw) * DQuat::from_rotation_z(pitch);
    Place { at: DVec3::Y * height, turn, scale: random.range(0.85, 1.1) }
}

impl Plants {
    /// Fills the clumps and the species.
    pub(crate) fn add_species(&mut self, seed: u64) {
        let palms = self.add_palms(seed);
        let (bushes, ferns) = self.add_bushes(seed);
        let groves = self.add_groves([&palms, &bushes, &ferns], seed);
        let tufts = self.all("tuft");
        let patch = |part: f64, random: &mut Random| on_disk(part, 0.9, [0.6, 1.3], random);
        let grass = self.add_clumps("grass", 3, &[Group { items: &tufts, count: 24, place: &patch }], seed);
        let debris = self.add_debris(seed);
        let pebbles = self.all("pebble");
        let rocks = self.all("rock");
        let plant = |name, habitat, share, variants, scale| Species {
            name,
            habitat,
            share,
            variants,
            scale,
            is_log: false,
            sink: 0.04,
            lean: 0.4,
            clearing: 5.0,
        };
        self.add(Species {
            sink: 0.2,
            lean: 0.0,
            clearing: 11.0,
            ..plant("Palms", Habitat::Dunes, 0.03, palms, [0.75, 1.25])
        });
        self.add(Species { lean: 0.2, clearing: 14.0, ..plant("Groves", Habitat::Hills, 0.16, groves, [0.8, 1.2]) });
        self.add(plant("Bushes", Habitat::Hills, 0.10, bushes, [0.6, 1.5]));
        self.add(plant("Ferns", Habitat::Hills, 0.10, ferns, [0.7, 1.4]));
        self.add(plant("Grass", Habitat::Meadow, 0.15, grass, [0.7, 1.3]));
        self.add(Species {
            lean: 1.0,
            sink: 0.0,
            clearing: 2.0,
            ..plant("Debris", Habitat::Tideline, 0.10, debris, [0.7, 1.4])
        });
        let rocks = plant("Rocks", Habitat::Stony, 0.006, rocks, [0.12, 2.2]);
        self.add(Species { is_log: true, sink: 0.3, lean: 1.0, clearing: 7.0, ..rocks });
        let pebbles = plant("Pebbles", Habitat::Beach, 0.0, pebbles, [0.008, 0.16]);
        self.add(Species { is_log: true, sink: 0.2, lean: 1.0, clearing: 1.2, ..pebbles });
    }

    /// One trunk, fronds and nuts at its top: the bend of a trunk is known, so each variant has a trunk of its own.
    fn add_palms(&mut self, seed: u64) -> Vec<Item> {
        let (trunks, fronds, nuts) = (self.all("palm_trunk"), self.all("palm_frond"), self.all("coconut"));
        let foot = |_: f64, _: &mut Random| upright(DVec3::ZERO, 0.0, 1.0);
        let crown = |part: f64, random: &mut Random| at_crown(part, 0.0, random);
        let nut = |part: f64, random: &mut Random| {
            let angle = part * std::f64::consts::TAU + random.unit();
            upright(DVec3::new(0.2 * angle.cos(), -0.25, 0.2 * angle.sin()), angle, random.range(0.8, 1.1))
        };
        // The head is a clump of its own, which the palm puts at the end of its trunk.
        let heads = self.add_clumps(
            "palm_head",
            3,
            &[Group { items: &fronds, count: 15, place: &crown }, Group { items: &nuts, count: 4, place: &nut }],
            seed,
        );
        let mut palms = Vec::new();
        for (trunk, head) in trunks.iter().zip(&heads) {
            let top = self.trunk_top(*trunk, seed);
            let at_top = move |_: f64, random: &mut Random| upright(top, random.angle(), 1.0);
            let groups = [
                Group { items: &[*trunk], count: 1, place: &foot },
                Group { items: &[*head], count: 1, place: &at_top },
            ];
            palms.extend(self.add_clumps(&format!("palm_{}", palms.len()), 1, &groups, seed));
        }
        palms
    }

    /// Bushes of leaves and flowers; clumps of ferns.
    fn add_bushes(&mut self, seed: u64) -> (Vec<Item>, Vec<Item>) {
        let (leaves, flowers, ferns) = (self.all("leaves"), self.all("flower"), self.all("fern"));
        let dome = |part: f64, random: &mut Random| on_dome(part, 0.8, random);
        let outside = |part: f64, random: &mut Random| on_dome(part, 1.15, random);
        let groups =
            [Group { items: &leaves, count: 26, place: &dome }, Group { items: &flowers, count: 6, place: &outside }];
        let bushes = self.add_clumps("bush", 4, &groups, seed);
        let ring = |part: f64, random: &mut Random| {
            let turn = DQuat::from_rotation_y(part * 9.0 * 2.4 + 0.2 * random.normal());
            Place { at: DVec3::ZERO, turn, scale: random.range(0.7, 1.2) }
        };
        let ferns = self.add_clumps("ferns", 3, &[Group { items: &ferns, count: 9, place: &ring }], seed);
        (bushes, ferns)
    }

    /// Groves: palms, bushes and ferns together, the deepest nesting.
    fn add_groves(&mut self, [palms, bushes, ferns]: [&[Item]; 3], seed: u64) -> Vec<Item> {
        let wide = |part: f64, random: &mut Random| on_disk(part, 4.2, [0.8, 1.6], random);
        let inner = |part: f64, random: &mut Random| on_disk(part, 2.5, [0.7, 1.05], random);
        let groups = [
            Group { items: palms, count: 2, place: &inner },
            Group { items: bushes, count: 5, place: &wide },
            Group { items: ferns, count: 8, place: &wide },
        ];
        self.add_clumps("grove", 4, &groups, seed)
    }

    /// What the tide left.
    fn add_debris(&mut self, seed: u64) -> Vec<Item> {
        let (sticks, shells, litter) = (self.all("stick"), self.all("shell"), self.all("litter"));
        let flat = |part: f64, random: &mut Random| lying(part, 1.1, [0.5, 1.2], random);
        let spread = |part: f64, random: &mut Random| on_disk(part, 1.1, [0.6, 1.6], random);
        let groups = [
            Group { items: &sticks, count: 6, place: &flat },
            Group { items: &shells, count: 8, place: &spread },
            Group { items: &litter, count: 10, place: &spread },
        ];
        self.add_clumps("debris", 3, &groups, seed)
    }
}
