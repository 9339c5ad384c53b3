// SPDX-License-Identifier: Apache-2.0
//! Synthetic rays: which units a path's ray crosses, in order, and where it hits. A function of the path and bounce.

use super::random::Random;
use super::scene::SceneOptions;
use oocpt_core::residency::UnitId;

/// Units a ray crosses at most, those behind its hit included.
const CROSSED_MAX: usize = 12;
/// Absent units a ray remembers, as in the renderer.
const PENDING: usize = 4;

/// A ray of a path in a slot.
#[derive(Clone, Debug)]
pub(crate) struct Ray {
    path: u32,
    bounce: u8,
    units: [UnitId; CROSSED_MAX],
    count: u8,
    /// Place of the unit it hits; those after it matter only until it is visited.
    hit: u8,
    visited: u16,
    /// The absent units it remembers, nearest first; none = it can go on.
    pub(crate) pending: Pending,
}

/// Up to [`PENDING`] units.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pending {
    units: [UnitId; PENDING],
    count: u8,
}

impl Pending {
    pub(crate) fn as_slice(&self) -> &[UnitId] {
        &self.units[..usize::from(self.count)]
    }
}

impl Ray {
    /// The camera ray of a path: the camera stands at the middle of an edge, a path's number runs over the image in
    /// rows, rows near the horizon see further.
    pub(crate) fn camera(options: &SceneOptions, path: u32) -> Self {
        let columns = 256;
        let rows = options.paths.div_ceil(columns).max(1);
        let across = f64::from(path % columns) / f64::from(columns) * 2.0 - 1.0;
        let far = f64::from(path / columns) / f64::from(rows);
        let side = f64::from(options.side);
        let to = (side * (0.5 + 0.5 * across * far), side * far);
        Self::between(options, (path, 0), (side * 0.5, 0.0), to)
    }

    /// The path's next ray, `None` at its end.
    pub(crate) fn next(&self, options: &SceneOptions) -> Option<Self> {
        let bounce = self.bounce + 1;
        if bounce >= options.bounces {
            return None;
        }
        let mut random = Random::of([options.seed ^ 3, u64::from(self.path), u64::from(bounce)]);
        let side = options.side.max(1);
        let mut from = self.units[usize::from(self.hit)];
        if random.fraction() < options.scattered {
            let units = side * side;
            // A popular unit may be anywhere: the multiplication by an odd number spreads small ids.
            let spread = |id: u32| u32::try_from(u64::from(id) * 2_654_435_761 % u64::from(units)).unwrap_or(0);
            from = if options.popular { spread(random.zipf(units)) } else { random.below(units) };
        }
        let from = (f64::from(from % side) + 0.5, f64::from(from / side) + 0.5);
        let length = 2.0 * f64::from(options.crossed) * random.fraction();
        let (dx, dy) = (random.fraction() * 2.0 - 1.0, random.fraction() * 2.0 - 1.0);
        let scale = length / (dx.abs() + dy.abs()).max(1e-3);
        Some(Self::between(options, (self.path, bounce), from, (from.0 + dx * scale, from.1 + dy * scale)))
    }

    /// A ray over the units between two points, and up to three more behind.
    fn between(options: &SceneOptions, (path, bounce): (u32, u8), from: (f64, f64), to: (f64, f64)) -> Self {
        let mut ray =
            Self { path, bounce, units: [0; CROSSED_MAX], count: 0, hit: 0, visited: 0, pending: Pending::default() };
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let steps = (dx.abs() + dy.abs()).ceil().max(1.0);
        let mut done = 0.0;
        while done <= steps + 3.0 && usize::from(ray.count) < CROSSED_MAX {
            let t = done / steps;
            let (x, y) = (cell(from.0 + dx * t, options.side), cell(from.1 + dy * t, options.side));
            let unit = y * options.side.max(1) + x;
            let count = usize::from(ray.count);
            if !ray.units[..count].contains(&unit) {
                if done <= steps {
                    ray.hit = ray.count;
                }
                ray.units[count] = unit;
                ray.count += 1;
            }
            done += 1.0;
        }
        ray
    }

    /// Visits all it needs that is resident, calls `visit` for each, and remembers what is absent.
    pub(crate) fn trace(&mut self, resident: &[bool], mut visit: impl FnMut(UnitId)) {
        for index in 0..self.needed() {
            let unit = self.units[usize::from(index)];
            if self.visited & (1 << index) == 0 && resident[unit as usize] {
                self.visited |= 1 << index;
                visit(unit);
                if index == self.hit {
                    break;
                }
            }
        }
        self.pending.count = 0;
        let open = (0..self.needed()).filter(|index| self.visited & (1 << index) == 0);
        for (index, place) in open.zip(&mut self.pending.units) {
            *place = self.units[usize::from(index)];
            self.pending.count += 1;
        }
    }

    /// Units from the first on that matter now.
    fn needed(&self) -> u8 {
        if self.visited & (1 << self.hit) == 0 { self.count } else { self.hit + 1 }
    }
}

#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped before the cast")]
fn cell(x: f64, side: u32) -> u32 {
    x.clamp(0.0, f64::from(side.max(1) - 1)).floor() as u32
}
