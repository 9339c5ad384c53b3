// SPDX-License-Identifier: Apache-2.0
//! What C++ relies on.

use std::collections::BTreeSet;

use crate::{ControlMesh, Error, PackedValues, SubdivisionScheme, SurfaceData};

/// Most pieces of an edge. A quad that is cut into as many along each side has 2^23 triangles.
pub const MAX_RATE: i32 = 2048;
/// Most points of a face.
pub const MAX_FACE_POINTS: usize = 256;
/// Most faces around a point; with sharp edges at it, and where many points have many faces, fewer.
pub const MAX_VALENCE: u16 = 256;
/// Largest work of a mesh at its points with many faces. It grows with the third power of the faces, once for all
/// points that are alike; with the fourth where sharpness makes all faces differ. Some seconds.
const MAX_WORK: u64 = 1 << 28;
/// Points with more faces than this, and faces with more points, count.
const MANY: u64 = 8;

/// A length as C++ counts.
pub(crate) fn int(length: usize) -> Result<i32, Error> {
    i32::try_from(length).map_err(|_too_large| Error::Invalid("more than can be numbered"))
}

fn ensure(holds: bool, reason: &'static str) -> Result<(), Error> {
    if holds { Ok(()) } else { Err(Error::Invalid(reason)) }
}

fn below(indices: &[i32], count: usize) -> bool {
    indices.iter().all(|&index| usize::try_from(index).is_ok_and(|index| index < count))
}

/// Checks a control mesh.
pub(crate) fn control(control: &ControlMesh<'_>) -> Result<(), Error> {
    int(control.point_count)?;
    int(control.face_points.len())?;
    ensure(below(control.face_points, control.point_count), "a corner of a face names no point")?;
    ensure(below(control.crease_pairs, control.point_count), "a crease names no point")?;
    ensure(below(control.corner_points, control.point_count), "a corner names no point")?;
    ensure(below(control.holes, control.face_counts.len()), "a hole names no face")?;
    ensure(control.crease_pairs.len() == 2 * control.crease_weights.len(), "one sharpness for each sharp edge")?;
    ensure(control.corner_points.len() == control.corner_weights.len(), "one sharpness for each sharp point")?;
    let mut weights = control.crease_weights.iter().chain(control.corner_weights);
    ensure(weights.all(|weight| weight.is_finite() && *weight >= 0.0), "a sharpness is not a number from 0 on")?;
    for channel in control.channels {
        int(channel.count)?;
        ensure(channel.corners.len() == control.face_points.len(), "one value for each corner")?;
        ensure(below(channel.corners, channel.count), "a corner names no value")?;
    }
    faces(control)
}

fn faces(control: &ControlMesh<'_>) -> Result<(), Error> {
    let mut valences = vec![0_u16; control.point_count];
    // The last face that each point was seen in.
    let mut seen = vec![u32::MAX; control.point_count];
    let mut first = 0_usize;
    for (face, &count) in (0..).zip(control.face_counts) {
        let count = usize::try_from(count).unwrap_or(0);
        ensure((3..=MAX_FACE_POINTS).contains(&count), "a face has too few or too many points")?;
        let is_whole = control.rules.scheme != SubdivisionScheme::Loop || count == 3;
        ensure(is_whole, "Loop's scheme subdivides triangles only")?;
        let Some(points) = control.face_points.get(first..first + count) else {
            return Err(Error::Invalid("faces have more corners than there are"));
        };
        for &point in points {
            let point = usize::try_from(point).unwrap_or(usize::MAX);
            let (Some(seen), Some(valence)) = (seen.get_mut(point), valences.get_mut(point)) else { continue };
            ensure(*seen != face, "a face has a point twice")?;
            *seen = face;
            *valence = valence.saturating_add(1);
        }
        first += count;
    }
    ensure(first == control.face_points.len(), "corners that belong to no face")?;
    ensure(valences.iter().all(|&valence| valence <= MAX_VALENCE), "too many faces meet at a point")?;
    ensure(work(control, &valences) <= MAX_WORK, "too many faces meet at too many points")
}

/// What evaluation takes around points with many faces and in faces with many points, measured in nanoseconds or so.
fn work(control: &ControlMesh<'_>, valences: &[u16]) -> u64 {
    let mut is_sharp = vec![false; valences.len()];
    for &point in control.crease_pairs.iter().chain(control.corner_points) {
        if let Some(is_sharp) = usize::try_from(point).ok().and_then(|point| is_sharp.get_mut(point)) {
            *is_sharp = true;
        }
    }
    let mut alike = BTreeSet::new();
    let mut total = 0_u64;
    for (&valence, is_sharp) in valences.iter().zip(is_sharp) {
        let valence = u64::from(valence);
        if valence <= MANY {
            continue;
        }
        if is_sharp {
            total = total.saturating_add(valence.pow(4));
        } else if alike.insert((false, valence)) {
            total = total.saturating_add(8 * valence.pow(3));
        }
    }
    for count in control.face_counts.iter().filter_map(|&count| u64::try_from(count).ok()) {
        if count > MANY && alike.insert((true, count)) {
            total = total.saturating_add(8 * count.pow(3));
        }
    }
    total
}

/// Checks the rates of edges.
pub(crate) fn rates(rates: &[i32], edges: usize) -> Result<(), Error> {
    ensure(rates.len() == edges, "one rate for each edge")?;
    ensure(rates.iter().all(|rate| (1..=MAX_RATE).contains(rate)), "a rate is out of range")
}

/// Checks the lengths of values.
pub(crate) fn data(data: &SurfaceData<'_>, points: usize, channels: &[usize]) -> Result<(), Error> {
    let fits = |values: &PackedValues<'_>, count: usize| values.floats.len() == values.width * count;
    ensure(data.positions.len() == 3 * points, "one position for each point")?;
    ensure(fits(&data.vertex, points) && fits(&data.varying, points), "one value for each point")?;
    ensure(data.channels.len() == channels.len(), "one array for each channel")?;
    let all = data.channels.iter().zip(channels);
    ensure(all.into_iter().all(|(values, &count)| values.width > 0 && fits(values, count)), "values of a channel")
}
