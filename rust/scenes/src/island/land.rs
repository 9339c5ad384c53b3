// SPDX-License-Identifier: Apache-2.0
//! The ground of the island: heights, colours, and where what grows gladly. +x is right, -z is away from the camera, y
//! is up, the sea is y = 0; metres. Pure; any thread.

use glam::{DVec2, DVec3};

use super::random::Noise;

/// Half the side of the full-size island's square, metres.
pub(crate) const FULL_HALF: f64 = 1000.0;
/// Instances of the full-size island: Disney's Moana island, flattened.
pub(crate) const FULL_INSTANCES: f64 = 39.3e6;
/// Distance of the coast from the middle, in half sides.
const COAST: f64 = 0.80;
/// Width of the beach, in half sides.
pub(crate) const BEACH: f64 = 0.13;

/// Where a species grows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Habitat {
    /// All over the sand.
    Beach,
    /// A line on the sand where the tide leaves things.
    Tideline,
    /// The upper end of the beach.
    Dunes,
    /// Grassy slopes.
    Meadow,
    /// Wooded hills.
    Hills,
    /// Steep or stony ground, and the shallows.
    Stony,
}

/// The terrain.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Land {
    /// Half the side of the square that holds the island, metres.
    pub(crate) half: f64,
    hills: Noise,
    patches: Noise,
}

fn smooth(low: f64, high: f64, x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

fn bump(at: DVec2, center: [f64; 2], radius: f64) -> f64 {
    (-(at - DVec2::from(center)).length_squared() / (radius * radius)).exp()
}

impl Land {
    /// The land that suits `instances`: fewer things make a smaller island, so that they do not get lost.
    pub(crate) fn new(instances: u64, seed: u64) -> Self {
        #[expect(clippy::cast_precision_loss, reason = "a size, not a count")]
        let part = (instances as f64 / FULL_INSTANCES).cbrt().clamp(0.09, 1.0);
        Self { half: FULL_HALF * part, hills: Noise(seed ^ 0x11), patches: Noise(seed ^ 0x22) }
    }

    /// Distance inland from the coast in half sides; negative in the sea.
    pub(crate) fn inland(&self, x: f64, z: f64) -> f64 {
        let at = DVec2::new(x, z) / self.half;
        COAST + 0.07 * self.hills.at(at.x + 40.0, at.y, 0.55, 3) - at.length()
    }

    /// Height of the ground above the sea, metres.
    pub(crate) fn height(&self, x: f64, z: f64) -> f64 {
        let at = DVec2::new(x, z) / self.half;
        let inland = self.inland(x, z);
        if inland <= 0.0 {
            return self.half * (0.16 * inland).max(-0.08);
        }
        let rise = smooth(BEACH, 0.62, inland);
        let ridge = 1.0 - self.hills.at(at.x, at.y, 0.30, 6).abs();
        let peaks = 0.40 * bump(at, [-0.30, -0.22], 0.24)
            + 0.30 * bump(at, [0.16, -0.34], 0.20)
            + 0.17 * bump(at, [0.42, 0.00], 0.17);
        let hills = rise * (0.04 + 0.05 * ridge + peaks * (0.55 + 0.45 * ridge));
        let dunes = smooth(0.6 * BEACH, BEACH, inland) * (1.0 - rise) * 0.006;
        let ripples = 0.0006 * self.patches.at(at.x, at.y, 0.02, 3) * smooth(0.0, 0.04, inland);
        let rough = 0.02 * rise * self.hills.at(at.x + 9.0, at.y, 0.07, 4);
        self.half * (0.045 * inland + dunes + hills + ripples + rough)
    }

    /// Unit normal of the ground.
    pub(crate) fn normal(&self, x: f64, z: f64) -> DVec3 {
        let step = self.half * 1e-3;
        let slope_x = (self.height(x + step, z) - self.height(x - step, z)) / (2.0 * step);
        let slope_z = (self.height(x, z + step) - self.height(x, z - step)) / (2.0 * step);
        DVec3::new(-slope_x, 1.0, -slope_z).normalize()
    }

    /// Colour of the ground, linear.
    pub(crate) fn color(&self, x: f64, z: f64, normal: DVec3) -> DVec3 {
        let at = DVec2::new(x, z) / self.half;
        let inland = self.inland(x, z);
        let (sand, wet) = (DVec3::new(0.62, 0.50, 0.34), DVec3::new(0.30, 0.23, 0.15));
        let (grass, wood, rock) =
            (DVec3::new(0.17, 0.23, 0.06), DVec3::new(0.06, 0.12, 0.035), DVec3::new(0.22, 0.19, 0.17));
        let shade = (0.22 * self.patches.at(at.x, at.y, 0.05, 4)).exp();
        let green = grass.lerp(wood, smooth(-0.3, 0.4, self.patches.at(at.x + 3.0, at.y, 0.18, 3)));
        let ground = wet.lerp(sand, smooth(0.004, 0.03, inland));
        let edge = inland + 0.03 * self.patches.at(at.x + 7.0, at.y, 0.06, 3);
        let ground = ground.lerp(green, smooth(0.8 * BEACH, 1.15 * BEACH, edge));
        ground.lerp(rock, smooth(0.30, 0.42, 1.0 - normal.y)) * shade
    }

    /// How gladly `habitat` is grown at a place: 0 where it is not, and beyond that with log-normal patches, so that
    /// some places are a thousand times denser than others.
    pub(crate) fn density(&self, habitat: Habitat, x: f64, z: f64, stream: u64) -> f64 {
        let inland = self.inland(x, z);
        if inland < -0.03 {
            return 0.0;
        }
        let at = DVec2::new(x, z) / self.half;
        // Only asked for where it matters: a normal takes four heights.
        let slope = || 1.0 - self.normal(x, z).y;
        let hills = match smooth(BEACH, 1.5 * BEACH, inland) {
            above if above > 0.0 && matches!(habitat, Habitat::Meadow | Habitat::Hills) => {
                above * (1.0 - smooth(0.32, 0.45, slope()))
            }
            _ => 0.0,
        };
        let place = match habitat {
            Habitat::Beach => smooth(-0.01, 0.01, inland) * (1.0 - smooth(0.9 * BEACH, 1.2 * BEACH, inland)),
            Habitat::Tideline => bump(DVec2::new(inland, 0.0), [0.035, 0.0], 0.016),
            Habitat::Dunes => bump(DVec2::new(inland, 0.0), [1.05 * BEACH, 0.0], 0.035),
            Habitat::Meadow | Habitat::Hills => hills,
            Habitat::Stony => {
                0.15 * bump(DVec2::new(inland, 0.0), [0.0, 0.0], 0.02)
                    + smooth(0.1, 0.3, slope()) * smooth(0.05, 0.1, inland)
            }
        };
        if place <= 1e-9 {
            return 0.0;
        }
        // More towards the camera's side, as a set dresser would.
        let front = 0.35 + bump(at, [0.0, 0.62], 0.5);
        // Deviation of the logarithm about 1.7: one place in a hundred has 50 times the middle, one in a hundred 1/50.
        let patch = Noise(self.patches.0 ^ stream.wrapping_mul(0x9e37_79b9)).at(at.x, at.y, 0.12, 4);
        let wood = if habitat == Habitat::Meadow { -1.2 } else { 1.2 } * self.patches.at(at.x + 3.0, at.y, 0.18, 3);
        place * front * (4.8 * patch + wood * hills).exp()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_island_has_hills_a_beach_and_the_sea_around() {
        let land = Land::new(20_000, 1);
        let half = land.half;
        for (x, z) in [(half, 0.0), (-half, half), (0.0, -half), (0.0, half)] {
            assert!(land.height(x, z) < 0.0, "({x}, {z}) is in the sea");
        }
        let line: Vec<f64> = (-20..=20).map(|i| half * f64::from(i) / 20.0).collect();
        let heights = line.iter().flat_map(|&x| line.iter().map(move |&z| land.height(x, z)));
        let top = heights.fold(0.0, f64::max);
        assert!(top > 0.2 * half && top < 0.8 * half, "a mountain of {top} m on {half} m");
        let shore = (0..1000).map(|i| half * f64::from(i) / 1000.0).find(|&z| land.inland(0.0, z) < 0.5 * BEACH);
        let shore = shore.expect("the beach is on the way to the sea");
        let height = land.height(0.0, shore);
        assert!((0.0..0.02 * half).contains(&height), "the beach is flat: {height} m");
    }
}
