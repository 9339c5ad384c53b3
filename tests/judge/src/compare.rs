// SPDX-License-Identifier: Apache-2.0
//! Exact comparison of AOV buffers with the judge's first hits. Ambiguous pixels are counted, and limited, not judged.

use crate::first_hit::FirstHit;

/// At most this share of the pixels may be ambiguous; more means a scene that tests nothing.
const MAX_AMBIGUOUS: f64 = 0.1;

/// Why a buffer was refused.
#[derive(Debug, Clone, PartialEq)]
pub enum Mismatch {
    /// The buffer does not have one entry per pixel.
    Length {
        /// Entries expected.
        expected: usize,
        /// Entries found.
        found: usize,
    },
    /// Too many pixels could not be judged.
    Ambiguous {
        /// Pixels that could not be judged.
        pixels: usize,
        /// All pixels.
        of: usize,
    },
    /// Nothing at all was hit: such a picture proves nothing.
    Empty,
    /// Some pixels are wrong.
    Wrong {
        /// How many.
        pixels: usize,
        /// The first few, in words.
        first: Vec<String>,
    },
}

impl std::fmt::Display for Mismatch {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Length { expected, found } => write!(f, "the buffer has {found} entries, not {expected}"),
            Self::Ambiguous { pixels, of } => write!(f, "{pixels} of {of} pixels are ambiguous"),
            Self::Empty => write!(f, "no pixel hits anything"),
            Self::Wrong { pixels, first } => write!(f, "{pixels} pixels are wrong:\n  {}", first.join("\n  ")),
        }
    }
}

impl std::error::Error for Mismatch {}

type Hits = [(Option<FirstHit>, bool)];

fn compare(
    hits: &Hits,
    found: usize,
    mut wrong: impl FnMut(usize, Option<&FirstHit>) -> Option<String>,
) -> Result<(), Mismatch> {
    if hits.len() != found {
        return Err(Mismatch::Length { expected: hits.len(), found });
    }
    if hits.iter().all(|(hit, _)| hit.is_none()) {
        return Err(Mismatch::Empty);
    }
    let ambiguous = hits.iter().filter(|(_, ambiguous)| *ambiguous).count();
    if ambiguous as f64 > MAX_AMBIGUOUS * hits.len() as f64 {
        return Err(Mismatch::Ambiguous { pixels: ambiguous, of: hits.len() });
    }
    let (mut pixels, mut first) = (0, Vec::new());
    for (index, (hit, _)) in hits.iter().enumerate().filter(|(_, (_, ambiguous))| !ambiguous) {
        if let Some(reason) = wrong(index, hit.as_ref()) {
            pixels += 1;
            if first.len() < 8 {
                first.push(format!("pixel {index}: {reason}"));
            }
        }
    }
    if pixels == 0 { Ok(()) } else { Err(Mismatch::Wrong { pixels, first }) }
}

/// Ids must be equal; `-1` where nothing is hit. `which`: 0 = prim, 1 = instance, 2 = element.
///
/// # Errors
/// A [`Mismatch`] that names the first wrong pixels.
pub fn compare_ids(hits: &Hits, which: usize, buffer: &[i32]) -> Result<(), Mismatch> {
    compare(hits, buffer.len(), |index, hit| {
        let expected = hit.map_or(-1, |hit| hit.ids[which]);
        (buffer[index] != expected).then(|| format!("id {} instead of {expected}", buffer[index]))
    })
}

/// Depth or camera depth, as `read` picks it, within `tolerance` relative; `clear` where nothing is hit.
///
/// # Errors
/// A [`Mismatch`] that names the first wrong pixels.
pub fn compare_depth(
    hits: &Hits,
    read: impl Fn(&FirstHit) -> f64,
    clear: f32,
    tolerance: f64,
    buffer: &[f32],
) -> Result<(), Mismatch> {
    compare(hits, buffer.len(), |index, hit| {
        let value = f64::from(buffer[index]);
        let expected = hit.map_or(f64::from(clear), &read);
        let allowed = if hit.is_some() { tolerance * expected.abs().max(1e-6) } else { 0.0 };
        // Written so that a NaN is wrong.
        let right = (value - expected).abs() <= allowed;
        (!right).then(|| format!("depth {value} instead of {expected}"))
    })
}

/// Normals (world or view, as `read` picks) within `tolerance` absolute per component; zero where nothing is hit.
///
/// # Errors
/// A [`Mismatch`] that names the first wrong pixels.
pub fn compare_normals(
    hits: &Hits,
    read: impl Fn(&FirstHit) -> glam::DVec3,
    tolerance: f64,
    buffer: &[[f32; 3]],
) -> Result<(), Mismatch> {
    compare(hits, buffer.len(), |index, hit| {
        let value = glam::DVec3::from(buffer[index].map(f64::from));
        let expected = hit.map_or(glam::DVec3::ZERO, &read);
        let right = (value - expected).abs().max_element() <= tolerance;
        (!right).then(|| format!("normal {value} instead of {expected}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::single;
    use glam::DVec3;

    fn hits() -> Vec<(Option<FirstHit>, bool)> {
        let hit = |id: i32| FirstHit {
            depth: 0.5,
            camera_depth: 2.0 + f64::from(id),
            ids: [id, 0, id + 1],
            normal: DVec3::Z,
            view_normal: DVec3::Z,
            color: None,
        };
        (0..20).map(|id| ((id % 4 != 0).then(|| hit(id)), id == 5)).collect()
    }

    #[test]
    fn equal_buffers_pass_and_each_planted_fault_fails() {
        let hits = hits();
        let mut ids: Vec<i32> = hits.iter().map(|(hit, _)| hit.map_or(-1, |hit| hit.ids[0])).collect();
        assert_eq!(compare_ids(&hits, 0, &ids), Ok(()));
        ids[5] = 99;
        assert_eq!(compare_ids(&hits, 0, &ids), Ok(()), "an ambiguous pixel is not judged");
        ids[6] += 1;
        assert!(
            matches!(compare_ids(&hits, 0, &ids), Err(Mismatch::Wrong { pixels: 1, .. })),
            "a wrong id must be seen"
        );
        assert!(
            matches!(compare_ids(&hits, 0, &ids[1..]), Err(Mismatch::Length { .. })),
            "a short buffer must be seen"
        );

        let read = |hit: &FirstHit| hit.camera_depth;
        let mut depth: Vec<f32> = hits.iter().map(|(hit, _)| hit.map_or(0.0, |hit| single(hit.camera_depth))).collect();
        assert_eq!(compare_depth(&hits, read, 0.0, 1e-6, &depth), Ok(()));
        depth[7] *= 1.0 + 1e-4;
        assert!(compare_depth(&hits, read, 0.0, 1e-6, &depth).is_err(), "a depth off by 1e-4 must be seen");
        depth[7] = f32::NAN;
        assert!(compare_depth(&hits, read, 0.0, 1e-6, &depth).is_err(), "a NaN must be seen");

        let mut normals: Vec<[f32; 3]> = hits.iter().map(|(hit, _)| [0.0, 0.0, f32::from(hit.is_some())]).collect();
        assert_eq!(compare_normals(&hits, |hit| hit.normal, 1e-5, &normals), Ok(()));
        normals[1][2] = -1.0;
        assert!(compare_normals(&hits, |hit| hit.normal, 1e-5, &normals).is_err(), "a flipped normal must be seen");
    }

    #[test]
    fn pictures_that_prove_nothing_are_refused() {
        let nothing = vec![(None, false); 4];
        assert_eq!(compare_ids(&nothing, 0, &[-1; 4]), Err(Mismatch::Empty));
        let mut unclear = hits();
        unclear.iter_mut().for_each(|(_, ambiguous)| *ambiguous = true);
        assert!(matches!(compare_ids(&unclear, 0, &[0; 20]), Err(Mismatch::Ambiguous { .. })), "all ambiguous");
    }
}
