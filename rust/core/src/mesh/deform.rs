// SPDX-License-Identifier: Apache-2.0
//! Points that move while the shutter is open, as poses at keys; between keys points move linearly.
//!
//! The first pose is that of the shutter's opening, the last one that of its closing, so that boxes hold no more than
//! what is seen. Faces and their triangles are decided once and are the same for all poses. Pure.

use glam::DVec3;
use oocpt_abi::AttributeRate;

use super::leaf::round::is_width;
use super::normals::build_normals;
use super::pose::PointsPose;
use super::primvar::{PrimvarLayout, TriangleSource, extend_points};
use super::topology::{MeshTopology, read_point};
use super::unsorted::UnsortedMesh;
use super::{Aabb, Attribute, LeafKind, Triangle};
use crate::array::{ArrayView, TypedArray};
use crate::desc::{DroppedData, MeshDesc, PointsMotion, PointsSample, PrimShape};

/// Largest number of poses of a prim.
const MAX_POSES: usize = 16;
/// Number of poses of points that accelerate: a parabola in four pieces.
const ACCELERATED_POSES: usize = 5;
/// Poses nearer to each other than this part of the shutter count as one.
const MIN_TIME: f64 = 1e-6;

/// The items of an asset at its later keys.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshKeys {
    /// Times of all keys, the first is 0 and the last 1; empty if nothing moves.
    pub times: Vec<f32>,
    /// Vertices of all items at the second key, then at the third and so on.
    pub vertices: Vec<[[f32; 3]; 3]>,
    /// Normals by corner at the second key and so on; empty if those of the asset are for all keys.
    pub normals: Vec<[[f32; 3]; 3]>,
}

impl PointsPose {
    /// A pose with points at a time of the shutter, and no other changes.
    pub(crate) fn at(time: f32, points: Vec<[f32; 3]>) -> Self {
        Self { time, points, normals: None, widths: None, radii: None }
    }

    /// Everything that moves, as bits.
    fn bits(&self, with_normals: bool) -> Vec<u32> {
        let bits = self.points.iter().flatten().map(|v| v.to_bits());
        let array = |array: &Option<TypedArray>| {
            let bytes = array.as_ref().map(|array| array.view().bytes().to_vec()).unwrap_or_default();
            bytes.into_iter().map(u32::from)
        };
        let none = None;
        bits.chain(array(&self.widths)).chain(array(if with_normals { &self.normals } else { &none })).collect()
    }
}

impl MeshKeys {
    /// The vertices of item `at` of `count` at each of the later keys.
    pub(super) fn of(&self, at: usize, count: usize) -> impl Iterator<Item = &[[f32; 3]; 3]> {
        self.vertices.iter().skip(at).step_by(count.max(1))
    }

    /// The items `order` of `count`.
    pub(super) fn arranged(&self, order: &[u32], count: usize) -> Self {
        let pick = |values: &[[[f32; 3]; 3]]| {
            let keys = values.chunks(count.max(1));
            keys.flat_map(|key| order.iter().filter_map(|&item| key.get(item as usize).copied())).collect()
        };
        Self { times: self.times.clone(), vertices: pick(&self.vertices), normals: pick(&self.normals) }
    }
}

/// The poses of a prim, two or more, or none if nothing moves; an error with the reason if its motion cannot be used.
pub(super) fn poses(desc: &MeshDesc) -> Result<Vec<PointsPose>, String> {
    let PointsMotion { samples, velocities, accelerations, seconds } = &desc.point_motion;
    let present = |array: &Option<TypedArray>| array.clone().filter(|array| !array.is_empty());
    let poses = match present(velocities) {
        Some(velocities) => by_rates(desc, &velocities, present(accelerations).as_ref(), *seconds)?,
        None if samples.len() > 1 => by_samples(desc, samples)?,
        None => Vec::new(),
    };
    let points = desc.points.view();
    let is_usable = |at: usize| !read_point(points.vec3(at))[0].is_nan();
    let breaks = |pose: &PointsPose| pose.points.iter().enumerate().any(|(at, p)| p[0].is_nan() && is_usable(at));
    if poses.iter().any(breaks) {
        return Err("has points that are not finite, or too far away, while the shutter is open".to_owned());
    }
    // Normals turn ribbons.
    let with_normals = matches!(desc.shape, PrimShape::Curves(_));
    let bits = |pose: &PointsPose| pose.bits(with_normals);
    let moves = poses.windows(2).any(|pair| bits(&pair[0]) != bits(&pair[1]));
    Ok(if moves { poses } else { Vec::new() })
}

#[expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "few keys, in single precision")]
fn by_rates(
    desc: &MeshDesc,
    velocities: &TypedArray,
    accelerations: Option<&TypedArray>,
    [open, close]: [f64; 2],
) -> Result<Vec<PointsPose>, String> {
    let (points, velocities) = (desc.points.view(), velocities.view());
    let accelerations = accelerations.map(TypedArray::view);
    let fits = |rates: &ArrayView<'_>| rates.len() == points.len() && rates.vec3(0).is_some();
    if !fits(&velocities) || !accelerations.as_ref().is_none_or(fits) {
        return Err("has not one velocity or acceleration for each point".to_owned());
    }
    if !(open.is_finite() && close.is_finite() && open < close) {
        return Err("moves in a shutter that is open for no usable time".to_owned());
    }
    let count = if accelerations.is_some() { ACCELERATED_POSES } else { 2 };
    let pose = |key: usize| {
        let time = key as f64 / (count - 1) as f64;
        let seconds = open + time * (close - open);
        let moved = |at: usize| {
            let acceleration = accelerations.as_ref().map_or(Some(DVec3::ZERO), |rates| rates.vec3(at));
            let place = points.vec3(at)? + velocities.vec3(at)? * seconds + acceleration? * (0.5 * seconds * seconds);
            Some(place)
        };
        let points = (0..points.len()).map(|at| read_point(moved(at))).collect();
        PointsPose::at(time as f32, points)
    };
    Ok((0..count).map(pose).collect())
}

#[expect(clippy::cast_possible_truncation, reason = "times of keys are in single precision")]
fn by_samples(desc: &MeshDesc, samples: &[PointsSample]) -> Result<Vec<PointsPose>, String> {
    let times: Vec<f64> = samples.iter().map(|sample| sample.time).collect();
    if !times.iter().all(|time| time.is_finite() && time.abs() < 1e6)
        || times.windows(2).any(|pair| pair[1] - pair[0] <= MIN_TIME)
    {
        return Err("has samples of its points that are not in the order of time".to_owned());
    }
    let count = desc.points.len();
    if samples.iter().any(|sample| sample.points.len() != count || sample.points.view().vec3(0).is_none()) {
        return Err("has samples with other numbers of points".to_owned());
    }
    let own = desc.normals.as_ref().map(|normals| normals.values.len());
    let with_normals = own.is_some() && samples.iter().all(|s| s.normals.as_ref().map(TypedArray::len) == own);
    let with_widths = check_widths(desc, samples)?;
    let inside = times.iter().copied().filter(|time| *time > MIN_TIME && *time < 1.0 - MIN_TIME);
    let mut keys: Vec<f64> = [0.0].into_iter().chain(inside).chain([1.0]).collect();
    if keys.len() > MAX_POSES {
        let last = keys.len() - 1;
        keys = (0..MAX_POSES).filter_map(|at| keys.get(at * last / (MAX_POSES - 1)).copied()).collect();
    }
    let pose = |time: f64| {
        let after = times.iter().position(|other| *other > time).unwrap_or(times.len() - 1).max(1);
        let (from, to) = (samples.get(after - 1)?, samples.get(after)?);
        let part = ((time - from.time) / (to.time - from.time)).clamp(0.0, 1.0);
        let between = |a: &TypedArray, b: &TypedArray| {
            let (a, b) = (a.view(), b.view());
            // A key at the time of a sample is exactly that sample.
            let mix = move |at: usize| match (a.vec3(at)?, b.vec3(at)?) {
                (a, _) if part <= 0.0 => Some(a),
                (_, b) if part >= 1.0 => Some(b),
                (a, b) => Some(a + (b - a) * part),
            };
            (0..a.len()).map(|at| read_point(mix(at))).collect::<Vec<_>>()
        };
        let normals = match (&from.normals, &to.normals) {
            (Some(a), Some(b)) if with_normals => Some(TypedArray::of(between(a, b))),
            _ => None,
        };
        let widths = match (&from.widths, &to.widths) {
            (Some(a), Some(b)) if with_widths => Some(TypedArray::of(scalars_between(a, b, part))),
            _ => None,
        };
        Some(PointsPose { normals, widths, ..PointsPose::at(time as f32, between(&from.points, &to.points)) })
    };
    Ok(keys.into_iter().filter_map(pose).collect())
}

/// Returns true if the widths of `samples` are to be used; an error if they cannot be.
fn check_widths(desc: &MeshDesc, samples: &[PointsSample]) -> Result<bool, String> {
    let Some(own) = desc.widths.as_ref().filter(|_| samples.iter().any(|sample| sample.widths.is_some())) else {
        return Ok(false);
    };
    let own = own.values.view();
    let fits = |widths: &ArrayView<'_>| widths.len() == own.len() && widths.scalar(0).is_some();
    // A prim without widths at the frame's own time is not visible, whatever its later widths are.
    let is_usable =
        |at: usize, width: Option<f64>| width.is_some_and(is_width) || !own.scalar(at).is_some_and(is_width);
    for sample in samples {
        let Some(widths) = sample.widths.as_ref().map(TypedArray::view).filter(fits) else {
            return Err("has samples with other numbers of widths".to_owned());
        };
        if !(0..own.len()).all(|at| is_usable(at, widths.scalar(at))) {
            return Err(
                "has widths that are negative, or not finite, or too large, while the shutter is open".to_owned()
            );
        }
    }
    Ok(true)
}

#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
fn scalars_between(a: &TypedArray, b: &TypedArray, part: f64) -> Vec<f32> {
    let (a, b) = (a.view(), b.view());
    let mix = |at: usize| match (a.scalar(at).unwrap_or(f64::NAN), b.scalar(at).unwrap_or(f64::NAN)) {
        (a, _) if part <= 0.0 => a,
        (_, b) if part >= 1.0 => b,
        (a, b) => a + (b - a) * part,
    };
    (0..a.len()).map(|at| mix(at) as f32).collect()
}

/// The keys of items that come from `layout.sources`; `triangles` and `normals` become those of the first one.
pub(super) fn read_keys(
    loose: UnsortedMesh<'_>,
    layout: PrimvarLayout<'_>,
    triangles: &mut [Triangle],
    normals: &mut Option<Attribute<[f32; 3]>>,
) -> MeshKeys {
    let UnsortedMesh { desc, topology, kind, radii, poses, .. } = loose;
    let vertices = |pose: &PointsPose| {
        vertices_at(layout, layout.sources, kind, &pose.points, pose.radii.as_deref().unwrap_or(radii))
    };
    let posed: Vec<Vec<[[f32; 3]; 3]>> = poses.iter().map(vertices).collect();
    let Some((first, later)) = posed.split_first() else { return MeshKeys::default() };
    let mut at_keys = Vec::new();
    if normals.is_some() {
        for (pose, vertices) in poses.iter().zip(&posed) {
            let topology = MeshTopology { points: pose.points.clone(), ..topology.clone() };
            let mut desc = desc.clone();
            if let (Some(values), Some(normals)) = (&pose.normals, &mut desc.normals) {
                normals.values = values.clone();
            }
            let moved = triangles.iter().zip(vertices).map(|(item, &vertices)| Triangle { vertices, ..*item });
            let moved: Vec<Triangle> = moved.collect();
            at_keys.extend(build_normals(&desc, &topology, layout, &moved, &mut DroppedData::default()));
        }
    }
    let mut keys = MeshKeys { times: poses.iter().map(|pose| pose.time).collect(), ..MeshKeys::default() };
    if at_keys.len() == poses.len() && at_keys.windows(2).any(|pair| pair[0] != pair[1]) {
        let point = |triangle: usize, corner: usize| {
            let source = layout.sources.get(triangle);
            source.and_then(|source| source.corners.get(corner)).map_or(0, |&corner| layout.point(corner))
        };
        let mut by_corner = at_keys.iter().map(|values| by_corner(values, triangles.len(), point));
        let values = by_corner.next().unwrap_or_default().into_flattened();
        *normals = Some(Attribute { rate: AttributeRate::FaceVarying, values });
        keys.normals = by_corner.flatten().collect();
    }
    triangles.iter_mut().zip(first).for_each(|(item, &vertices)| item.vertices = vertices);
    keys.vertices = later.concat();
    keys
}

/// The vertices of items at a pose. `radii`: by point, for kinds that have radii.
fn vertices_at(
    layout: PrimvarLayout<'_>,
    sources: &[TriangleSource],
    kind: LeafKind,
    points: &[[f32; 3]],
    radii: &[f32],
) -> Vec<[[f32; 3]; 3]> {
    let points = extend_points(layout, points.to_vec());
    let place = |point: u32| points.get(point as usize).copied().unwrap_or([f32::NAN; 3]);
    let radius = |point: u32| radii.get(point as usize).copied().unwrap_or(0.0);
    let item = |source: &TriangleSource| {
        let corners = source.corners.map(|corner| layout.point(corner));
        kind.vertices(corners.map(place), corners.map(radius))
    };
    sources.iter().map(item).collect()
}

/// The values of an attribute at the corners of `count` triangles, given the points of the corners.
fn by_corner(
    attribute: &Attribute<[f32; 3]>,
    count: usize,
    points: impl Fn(usize, usize) -> u32,
) -> Vec<[[f32; 3]; 3]> {
    let value = |triangle: usize, corner: usize| {
        let at = match attribute.rate {
            AttributeRate::Constant => 0,
            AttributeRate::Uniform => triangle,
            AttributeRate::Vertex => points(triangle, corner) as usize,
            AttributeRate::FaceVarying => 3 * triangle + corner,
        };
        attribute.values.get(at).copied().unwrap_or([0.0, 0.0, 1.0])
    };
    (0..count).map(|triangle| [0, 1, 2].map(|corner| value(triangle, corner))).collect()
}

/// The box of an item over all of its keys.
pub(super) fn swept(item: &Triangle, kind: LeafKind, keys: &MeshKeys, at: usize, count: usize) -> Aabb {
    let own = item.bounds(kind);
    if keys.times.is_empty() {
        return own;
    }
    let all = keys.of(at, count).fold(own, |b, &vertices| b.union(&Triangle { vertices, ..*item }.bounds(kind)));
    padded(all, &all)
}

/// The box of a moving item or of a part of one. `whole`: the box of the whole item.
pub(super) fn padded(all: Aabb, whole: &Aabb) -> Aabb {
    // A vertex between its keys, `a + f (b - a)`, rounds three times, by at most five units of the largest coordinate.
    let size = whole.min.iter().chain(&whole.max).fold(0.0_f32, |size, v| size.max(v.abs()));
    let pad = size * (8.0 / 16_777_216.0);
    Aabb { min: all.min.map(|v| v - pad), max: all.max.map(|v| v + pad) }
}
