// SPDX-License-Identifier: Apache-2.0
//! Decides into how many pieces the edges of a subdivision surface are cut. Pure.

use glam::{DVec3, DVec4, Vec4Swizzles as _};
use oocpt_subdiv::MAX_RATE;
use xxhash_rust::xxh3::Xxh3;

/// Largest number of pieces of an edge of a surface that is smooth between its points. One that is displaced may have
/// more.
pub(super) const MAX_PIECES: i32 = 256;
/// What is out of the picture is seen in reflections and shadows only: its edges may be so many times longer.
pub(crate) const OUT_OF_PICTURE: f64 = 4.0;

/// The rate at which the limit surface of a mesh is cut: no piece of an edge of the control mesh is longer than the
/// given number of pixels where the surface is nearest to the camera.
///
/// Everything is in object space. A length covers its units times [`Self::density`] pixels, or near a view its units
/// times `focal / distance`; the larger number counts.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DicingRate {
    /// Longest piece in pixels; 0 = edges are cut by the refine level.
    pub pixels: f64,
    /// Least number of pixels of a unit of length.
    pub density: f64,
    /// Pixels of a unit of length at distance 1.
    pub focal: f64,
    /// Positions of the camera as the nearest placements see it, in object space.
    pub eyes: Vec<CameraEye>,
    /// For each eye the inner sides of the picture, in object space: `dot(normal, p) + w` is negative outside, in units
    /// of length. An edge counts as outside if it is farther out than twice its length. Empty: all is in the picture.
    pub views: Vec<[DVec4; 5]>,
}

/// A position of the camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraEye {
    /// Position in object space.
    pub position: DVec3,
    /// Smallest distance that counts; above zero.
    pub nearest: f64,
}

impl DicingRate {
    /// Number of pieces of the edge from `a` to `b`, at least `least` and at most `MAX_PIECES`. The same for both
    /// directions.
    #[must_use]
    pub fn pieces(&self, a: DVec3, b: DVec3, least: i32) -> i32 {
        self.pieces_up_to(a, b, least, MAX_PIECES)
    }

    /// As [`Self::pieces`], with another limit.
    pub(crate) fn pieces_up_to(&self, a: DVec3, b: DVec3, least: i32, most: i32) -> i32 {
        let most = most.clamp(1, MAX_RATE);
        let least = least.clamp(1, most);
        if self.pixels <= 0.0 {
            return least;
        }
        let pieces = (a.distance(b) * self.density_of(a, b) / self.pixels).ceil();
        // NaN gives the smaller number.
        if pieces >= f64::from(most) { most } else { whole(pieces).max(least) }
    }

    /// The power of two that is nearest to the number of pieces of the edge from `a` to `b`; 0 for no more than one.
    pub(crate) fn octave(&self, a: DVec3, b: DVec3) -> i32 {
        let octave = (a.distance(b) * self.density_of(a, b) / self.pixels).log2().round();
        // NaN gives 0.
        if octave >= 30.0 { 30 } else { whole(octave).max(0) }
    }

    /// Pixels of a unit of length between `a` and `b`; 0 if no camera sees it.
    #[must_use]
    pub fn density_of(&self, a: DVec3, b: DVec3) -> f64 {
        let density = |(at, eye): (usize, &CameraEye)| {
            let in_picture = self.focal / distance(eye.position, a, b).max(eye.nearest);
            let is_seen = self.views.get(at).is_none_or(|sides| is_in_view(sides, a, b));
            if is_seen { in_picture } else { in_picture / OUT_OF_PICTURE }
        };
        if self.pixels > 0.0 { self.eyes.iter().enumerate().map(density).fold(self.density, f64::max) } else { 0.0 }
    }

    /// Adds everything that [`Self::pieces`] depends on to the hash.
    pub(crate) fn hash(&self, hasher: &mut Xxh3) {
        let mut add = |number: f64| hasher.update(&number.to_le_bytes());
        [self.pixels, self.density, self.focal].into_iter().for_each(&mut add);
        for eye in &self.eyes {
            eye.position.to_array().into_iter().for_each(&mut add);
            add(eye.nearest);
        }
        self.views.as_flattened().iter().for_each(|side| side.to_array().into_iter().for_each(&mut add));
    }
}

/// Whether some of the faces at an edge may be in the picture. The same for both directions.
fn is_in_view(sides: &[DVec4; 5], a: DVec3, b: DVec3) -> bool {
    let room = -2.0 * a.distance(b);
    sides.iter().all(|side| f64::max(side.xyz().dot(a), side.xyz().dot(b)) + side.w >= room)
}

/// The distance of a point from a segment, with the same bits for both orders of its ends.
fn distance(point: DVec3, a: DVec3, b: DVec3) -> f64 {
    let (a, b) = if a.to_array() <= b.to_array() { (a, b) } else { (b, a) };
    let along = b - a;
    let share = (point - a).dot(along) / along.length_squared();
    // A segment without length gives NaN, which `clamp` keeps.
    let share = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) };
    point.distance(a + along * share)
}

#[expect(clippy::cast_possible_truncation, reason = "below MAX_RATE")]
fn whole(value: f64) -> i32 {
    value as i32
}
