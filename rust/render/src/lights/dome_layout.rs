// SPDX-License-Identifier: Apache-2.0
//! Layouts of a dome's picture: all but longitude and latitude are resampled to that once, when the file is read, so
//! that sampling is the same for all. Pure.
//!
//! In the frame of the dome (+y is up), with picture coordinates a, b from -1 to 1, to the right and up:
//! - mirrored ball: the reflection that a camera far away on +z sees in a mirror ball, in parallel projection: the
//!   ball's normal is `n = (a, b, sqrt(1 - a^2 - b^2))`, the direction the mirror image of +z about it. The middle is
//!   +z, the rim all -z.
//! - angular: the same azimuth, and the radius grows with the angle to +z: `(d.x, d.y) r / |(d.x, d.y)|`, `r =
//!   acos(d.z) / pi` (Debevec 1998, "Rendering Synthetic Objects into Real Scenes"; his `angmap.cal`).
//! - vertical cross: six faces of a cube on a grid of three columns and four rows; the middle column holds, from above,
//!   +y, +z, -y, -z, unfolded about the x axis; beside +z are -x on the left and +x on the right.

use crate::job::light_files::LightPicture;
use oocpt_core::DomeFormat;
use std::f64::consts::PI;

/// Most rows of a resampled picture.
const MAX_ROWS: u32 = 4096;
/// Samples of a texel along each axis.
const LOOKS: u32 = 2;

/// Resamples the picture to longitude and latitude. Call [`super::picture::fault`] before.
pub(super) fn to_latlong(picture: LightPicture, format: DomeFormat) -> LightPicture {
    let place: fn([f64; 3]) -> PicturePlace = match format {
        DomeFormat::Automatic | DomeFormat::Latlong | DomeFormat::Other => return picture,
        DomeFormat::MirroredBall => mirrored_ball,
        DomeFormat::Angular => angular,
        DomeFormat::CubeMapVerticalCross => vertical_cross,
    };
    let side = picture.width.max(picture.height);
    let height = (if format == DomeFormat::CubeMapVerticalCross { side - side / 4 } else { side }).clamp(1, MAX_ROWS);
    let width = 2 * height;
    let steps = |cells: u32| f64::from(cells * LOOKS);
    let mut texels = Vec::with_capacity(width as usize * height as usize);
    for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
        let mut sum = [0.0; 3];
        for (down, right) in (0..LOOKS).flat_map(|down| (0..LOOKS).map(move |right| (down, right))) {
            let s = (f64::from(column * LOOKS + right) + 0.5) / steps(width);
            let t = (f64::from(row * LOOKS + down) + 0.5) / steps(height);
            let ((sin_a, cos_a), (sin_t, cos_t)) = (((0.5 - s) * 2.0 * PI).sin_cos(), (t * PI).sin_cos());
            let seen = look(&picture, &place([sin_t * sin_a, cos_t, sin_t * cos_a]));
            sum = [0, 1, 2].map(|k| sum[k] + seen[k] / f64::from(LOOKS * LOOKS));
        }
        texels.push(sum.map(super::narrow));
    }
    LightPicture { width, height, texels }
}

/// A place of a picture in fractions of its sides, from the upper left, and the region that samples stay inside of.
struct PicturePlace {
    at: [f64; 2],
    part: PictureRegion,
}

/// A region of a picture.
enum PictureRegion {
    /// The disk that touches its sides.
    Disk,
    /// The box between two corners, in fractions of the sides.
    Box([f64; 2], [f64; 2]),
}

/// The place in the disk of radius `r` in the azimuth of a direction.
fn in_disk(d: [f64; 3], r: f64) -> PicturePlace {
    let across = d[0].hypot(d[1]);
    let [a, b] = if across > 0.0 { [d[0] / across * r, d[1] / across * r] } else { [r, 0.0] };
    PicturePlace { at: [0.5 + 0.5 * a, 0.5 - 0.5 * b], part: PictureRegion::Disk }
}

fn mirrored_ball(d: [f64; 3]) -> PicturePlace {
    // The normal is half way between the direction and +z: its component across is the sine of half the angle.
    in_disk(d, (0.5 * (1.0 - d[2])).clamp(0.0, 1.0).sqrt())
}

fn angular(d: [f64; 3]) -> PicturePlace {
    in_disk(d, d[2].clamp(-1.0, 1.0).acos() / PI)
}

fn vertical_cross([x, y, z]: [f64; 3]) -> PicturePlace {
    let [ax, ay, az] = [x, y, z].map(f64::abs);
    // Column and row of the face, and the place on it from -1 to 1, to the right and down.
    let (column, row, right, down) = if az >= ax && az >= ay {
        if z > 0.0 { (1.0, 1.0, x / az, -y / az) } else { (1.0, 3.0, x / az, y / az) }
    } else if ay >= ax {
        if y > 0.0 { (1.0, 0.0, x / ay, z / ay) } else { (1.0, 2.0, x / ay, -z / ay) }
    } else if x > 0.0 {
        (2.0, 1.0, -z / ax, -y / ax)
    } else {
        (0.0, 1.0, z / ax, -y / ax)
    };
    let at = [(column + 0.5 + 0.5 * right) / 3.0, (row + 0.5 + 0.5 * down) / 4.0];
    PicturePlace { at, part: PictureRegion::Box([column / 3.0, row / 4.0], [(column + 1.0) / 3.0, (row + 1.0) / 4.0]) }
}

/// Interpolates between the middles of texels that are inside of the region.
fn look(picture: &LightPicture, place: &PicturePlace) -> [f64; 3] {
    let size = [f64::from(picture.width), f64::from(picture.height)];
    let at = match place.part {
        PictureRegion::Disk => {
            // All four texels are within the disk: the area around it is black, as a rule.
            let most = [0, 1].map(|k| (1.0 - 3.0 / size[k]).max(0.0));
            let off = [0, 1].map(|k| 2.0 * place.at[k] - 1.0);
            let radius = off[0].hypot(off[1]);
            let shrink = if radius > most[0].min(most[1]) { most[0].min(most[1]) / radius } else { 1.0 };
            [0, 1].map(|k| (0.5 + 0.5 * off[k] * shrink) * size[k])
        }
        PictureRegion::Box(from, to) => [0, 1].map(|k| {
            let (low, high) = (from[k] * size[k] + 0.5, to[k] * size[k] - 0.5);
            if low < high { (place.at[k] * size[k]).clamp(low, high) } else { 0.5 * (low + high) }
        }),
    };
    let low = at.map(|x| (x - 0.5).floor());
    let share = [0, 1].map(|k| at[k] - 0.5 - low[k]);
    let texel = |x: f64, y: f64| {
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped to the picture's texels")]
        let [x, y] = [(x, size[0]), (y, size[1])].map(|(x, size)| x.clamp(0.0, size - 1.0) as usize);
        let texel = picture.texels.get(y * picture.width as usize + x).copied().unwrap_or_default();
        // NaN and negative light become 0; infinite light is bounded.
        texel.map(|c| if c > 0.0 { f64::from(c.min(1e30)) } else { 0.0 })
    };
    let row = |y: f64| {
        let (a, b) = (texel(low[0], y), texel(low[0] + 1.0, y));
        [0, 1, 2].map(|k| a[k] + (b[k] - a[k]) * share[0])
    };
    let (above, below) = (row(low[1]), row(low[1] + 1.0));
    [0, 1, 2].map(|k| above[k] + (below[k] - above[k]) * share[1])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A picture of `width` x `height` whose texels are the value of `of` for the direction that they show, or black.
    fn picture(width: u32, height: u32, direction: impl Fn(f64, f64) -> Option<[f64; 3]>) -> LightPicture {
        let texels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let texel = |(x, y): (u32, u32)| {
            let a = (f64::from(x) + 0.5) / f64::from(width) * 2.0 - 1.0;
            let b = 1.0 - (f64::from(y) + 0.5) / f64::from(height) * 2.0;
            direction(a, b).map_or([0.0; 3], |d| d.map(|x| super::super::narrow(0.5 + 0.5 * x)))
        };
        LightPicture { width, height, texels: texels.map(texel).collect() }
    }

    /// Greatest difference of the resampled picture from one whose colours are its own directions.
    fn worst(made: &LightPicture, counts: impl Fn([f64; 3]) -> bool) -> f64 {
        let mut worst = 0.0_f64;
        for (at, texel) in (0_u32..).zip(&made.texels) {
            let s = (f64::from(at % made.width) + 0.5) / f64::from(made.width);
            let t = (f64::from(at / made.width) + 0.5) / f64::from(made.height);
            let (longitude, theta) = ((0.5 - s) * 2.0 * PI, t * PI);
            let d = [theta.sin() * longitude.sin(), theta.cos(), theta.sin() * longitude.cos()];
            for k in 0..3 {
                if counts(d) {
                    worst = worst.max((f64::from(texel[k]) - 0.5 - 0.5 * d[k]).abs());
                }
            }
        }
        worst
    }

    #[test]
    fn a_mirrored_ball_shows_what_its_normals_reflect() {
        let ball = picture(256, 256, |a, b| {
            let r2 = a * a + b * b;
            // The mirror image of +z about the normal.
            let n = [a, b, (1.0 - r2).max(0.0).sqrt()];
            (r2 <= 1.0).then(|| [2.0 * n[2] * n[0], 2.0 * n[2] * n[1], 2.0 * n[2] * n[2] - 1.0])
        });
        let made = to_latlong(ball, DomeFormat::MirroredBall);
        assert_eq!((made.width, made.height), (512, 256), "as fine as the picture");
        // The rim, where all directions about -z meet, is as coarse as its texels.
        assert!(worst(&made, |d| d[2] > -0.7) < 0.01, "{}", worst(&made, |d| d[2] > -0.7));
        assert!(worst(&made, |_| true) < 0.3, "{}", worst(&made, |_| true));
    }

    #[test]
    fn an_angular_picture_shows_angles_to_its_middle() {
        let angular = picture(256, 128, |a, b| {
            let (r, theta) = (a.hypot(b), PI * a.hypot(b));
            (r <= 1.0).then(|| [theta.sin() * a / r, theta.sin() * b / r, theta.cos()])
        });
        let made = to_latlong(angular, DomeFormat::Angular);
        assert!(worst(&made, |d| d[2] > -0.9) < 0.01, "{}", worst(&made, |d| d[2] > -0.9));
        assert!(worst(&made, |_| true) < 0.1, "{}", worst(&made, |_| true));
    }

    #[test]
    fn a_vertical_cross_is_the_six_faces_of_a_cube() {
        let cross = picture(192, 256, |a, b| {
            let (x, y) = ((a + 1.0) * 1.5, (1.0 - b) * 2.0);
            let (u, v) = (2.0 * x.fract() - 1.0, 1.0 - 2.0 * y.fract());
            let d = match (x.floor(), y.floor()) {
                (1.0, 0.0) => [u, 1.0, -v],
                (1.0, 1.0) => [u, v, 1.0],
                (1.0, 2.0) => [u, -1.0, v],
                (1.0, 3.0) => [u, -v, -1.0],
                (0.0, 1.0) => [-1.0, v, u],
                (2.0, 1.0) => [1.0, v, -u],
                _ => return None,
            };
            let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
            Some(d.map(|x: f64| x / length))
        });
        let made = to_latlong(cross, DomeFormat::CubeMapVerticalCross);
        assert!(worst(&made, |_| true) < 0.02, "{}", worst(&made, |_| true));
    }

    #[test]
    fn pictures_of_any_size_and_value_give_numbers() {
        for (width, height) in [(1, 1), (1, 7), (5, 1), (3, 4), (2, 2)] {
            let texels = vec![[f32::NAN, f32::INFINITY, -1.0]; (width * height) as usize];
            for format in [DomeFormat::MirroredBall, DomeFormat::Angular, DomeFormat::CubeMapVerticalCross] {
                let made = to_latlong(LightPicture { width, height, texels: texels.clone() }, format);
                assert_eq!(made.texels.len(), (made.width * made.height) as usize, "{width} x {height}");
                let sound = |texel: &[f32; 3]| texel[0] == 0.0 && texel[1].is_finite() && texel[2] == 0.0;
                assert!(made.texels.iter().all(sound), "{width} x {height} {format:?}");
            }
        }
    }
}
