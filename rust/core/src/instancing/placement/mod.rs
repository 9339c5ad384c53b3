// SPDX-License-Identifier: Apache-2.0
//! The placement of one instance: its matrix from borrowed arrays in f64, the inverse, a conservative box. Pure and
//! without allocation: this is the inner loop of scene encoding.

mod moving;

use std::sync::Arc;

use glam::{DAffine3, DMat3, DQuat, DVec3};

use super::affine::{MATRIX_ERROR, MAX_MAGNITUDE, affine_of, is_regular, nearest, round_down, round_up};
use super::array_motion::VelocityMotion;
use super::arrays::InstanceArrays;
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::mesh::Aabb;

/// If the numbers of a record add up to less than this, all are well below [`MAX_MAGNITUDE`].
const USUAL_MAGNITUDE: f64 = 1e17;

/// A placed instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedInstance {
    /// Rows of the inverse matrix.
    pub(crate) object_from_parent: [[f32; 4]; 3],
    /// Box in the parent's frame, rounded outward.
    pub(crate) bounds: Aabb,
    /// True if the placement has a negative determinant.
    pub(crate) flips_handedness: bool,
}

impl PlacedInstance {
    /// In place of an instance that is not usable: its box is empty, and its map takes all points far away, so that no
    /// ray finds it.
    pub(crate) const NOWHERE: Self =
        Self { object_from_parent: [[0.0, 0.0, 0.0, 1e30]; 3], bounds: Aabb::EMPTY, flips_handedness: false };
}

/// The centre and the size of a placed instance in the parent's frame, as the partition needs them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InstanceFootprint {
    /// Centre of the target's box, placed.
    pub(crate) center: DVec3,
    /// Half sides of the placed box, without rounding errors.
    pub(crate) half: DVec3,
    /// Maximum norm of `|M| |M^-1|`: factor by which the rounding of the f32 map is magnified, per unit of distance.
    pub(crate) spread: f64,
    /// Distance (maximum norm) of the placed box's centre from the placed origin of the target.
    pub(crate) lever: f64,
}

/// The data that place the instances of one run: `before * T * R * S * M * after`.
#[derive(Clone, Debug)]
pub(crate) struct InstancePlacer<'a> {
    before: DAffine3,
    after: DAffine3,
    after_is_identity: bool,
    center: DVec3,
    half: DVec3,
    /// Largest number of a record.
    limit: f32,
    /// Origin of the parent's frame for rounding.
    origin: DVec3,
    translations: Option<ArrayView<'a>>,
    rotations: Option<ArrayView<'a>>,
    scales: Option<ArrayView<'a>>,
    transforms: Option<ArrayView<'a>>,
    drift: Option<VelocityMotion<'a>>,
    /// For a moving object: placers at two or more times.
    keys: Option<Arc<[KeyPlacer<'a>]>>,
}

/// A placer of one time of the shutter.
#[derive(Clone, Debug)]
pub(crate) struct KeyPlacer<'a> {
    pub(crate) time: f32,
    pub(crate) placer: InstancePlacer<'a>,
}

impl<'a> InstancePlacer<'a> {
    /// A placer of an object with the box `bounds` (not empty).
    pub(crate) fn new(before: DAffine3, after: DAffine3, arrays: Option<&'a InstanceArrays>, bounds: &Aabb) -> Self {
        let min = DVec3::from(bounds.min.map(f64::from));
        let max = DVec3::from(bounds.max.map(f64::from));
        let view = |get: fn(&InstanceArrays) -> &Option<TypedArray>| {
            arrays.and_then(|a| get(a).as_ref()).map(TypedArray::view)
        };
        Self {
            before,
            after,
            after_is_identity: after == DAffine3::IDENTITY,
            center: 0.5 * (min + max),
            half: 0.5 * (max - min),
            limit: MAX_MAGNITUDE,
            origin: DVec3::ZERO,
            translations: view(|a| &a.translations),
            rotations: view(|a| &a.rotations),
            scales: view(|a| &a.scales),
            transforms: view(|a| &a.transforms),
            drift: None,
            keys: None,
        }
    }

    /// The same placements relative to `origin`. Usability is decided in the parent's frame, so there is no limit here.
    pub(crate) fn seen_from(mut self, origin: DVec3) -> Self {
        self.before = DAffine3::from_translation(-origin) * self.before;
        self.limit = f32::MAX;
        self.origin += origin;
        let seen = |key: &KeyPlacer<'a>| KeyPlacer { time: key.time, placer: key.placer.clone().seen_from(origin) };
        self.keys = self.keys.map(|keys| keys.iter().map(seen).collect());
        self
    }

    /// Local matrix of instance `number`; `None` if an array is too short.
    #[inline]
    fn local(&self, number: usize) -> Option<DAffine3> {
        let mut m = DAffine3::IDENTITY;
        if let Some(translations) = &self.translations {
            m.translation = translations.vec3(number)?;
        }
        if let Some(drift) = &self.drift {
            m.translation += drift.offset(number)?;
        }
        if let Some(rotations) = &self.rotations {
            let q = usual_halves(rotations, number).or_else(|| rotations.quat(number));
            m.matrix3 = rotation(q.or_else(|| rotations.vec4(number).map(DQuat::from_vec4))?);
        }
        if let Some(turn) = self.drift.as_ref().and_then(|drift| drift.turn(number)) {
            m.matrix3 = DMat3::from_quat(turn) * m.matrix3;
        }
        if let Some(scales) = &self.scales {
            let s = scales.vec3(number)?;
            m.matrix3.x_axis *= s.x;
            m.matrix3.y_axis *= s.y;
            m.matrix3.z_axis *= s.z;
        }
        if let Some(transforms) = &self.transforms {
            m *= affine_of(&transforms.matrix(number)?)?;
        }
        Some(m)
    }

    /// Reads a byte of all data that [`InstancePlacer::matrix`] will need: for loops that access memory in random
    /// order.
    #[inline]
    pub(crate) fn touch(&self, number: usize) -> u8 {
        let views = [&self.translations, &self.rotations, &self.scales, &self.transforms];
        views.into_iter().flatten().fold(0, |sum, view| sum ^ view.touch(number))
    }

    /// Matrix of instance `number` in f64, or of the single placement of a run without instances.
    #[inline]
    pub(crate) fn matrix(&self, number: Option<usize>) -> Option<DAffine3> {
        let Some(number) = number else {
            return Some(self.before * self.after);
        };
        let m = self.before * self.local(number)?;
        Some(if self.after_is_identity { m } else { m * self.after })
    }

    /// Places instance `number` (see [`InstancePlacer::matrix`]); `None` if its matrix is singular, not finite, or too
    /// extreme for single precision.
    #[inline]
    pub(crate) fn place(&self, number: Option<usize>) -> Option<PlacedInstance> {
        let m = self.matrix(number)?;
        let inverse = InversePlacement::of(&m)?;
        let placed = self.rounded(&inverse, &self.placed_box(&m, &inverse).0)?;
        if self.keys.is_none() {
            return Some(placed);
        }
        let ([min, max], _, flips_handedness) = self.swept(number)?;
        let bounds = Aabb { min: min.to_array().map(round_down), max: max.to_array().map(round_up) };
        Some(PlacedInstance { bounds, flips_handedness, ..placed })
    }

    /// As [`InstancePlacer::place`], for partitioning: lower and upper corner of the box before it is rounded outward,
    /// and the footprint for chunks.
    #[inline]
    pub(crate) fn measure(&self, number: Option<usize>) -> Option<([DVec3; 2], InstanceFootprint)> {
        let m = self.matrix(number)?;
        let inverse = InversePlacement::of(&m)?;
        let (corners, footprint) = self.placed_box(&m, &inverse);
        // NaN fails the comparison. Values that are not clearly far below the limit are computed exactly.
        let size = |v: DVec3| v.abs().element_sum();
        let [a, b, c] = inverse.rows.map(size);
        let sum = a + b + c + size(inverse.offset) + size(corners[0]) + size(corners[1]);
        let sound = sum <= USUAL_MAGNITUDE || self.rounded(&inverse, &corners).is_some();
        if sound && self.keys.is_some() {
            let (corners, footprint, _) = self.swept(number)?;
            return Some((corners, footprint));
        }
        sound.then_some((corners, footprint))
    }

    /// The result of [`InstancePlacer::measure`] for a usable instance, without its box.
    #[inline]
    pub(crate) fn footprint(&self, number: Option<usize>) -> Option<InstanceFootprint> {
        if self.keys.is_some() {
            return self.measure(number).map(|(_, footprint)| footprint);
        }
        let m = self.matrix(number)?;
        Some(self.placed_box(&m, &InversePlacement::of(&m)?).1)
    }

    /// The placement in single precision; `None` if a number is too large.
    #[inline]
    fn rounded(&self, inverse: &InversePlacement, [min, max]: &[DVec3; 2]) -> Option<PlacedInstance> {
        let row = |k: usize| inverse.rows[k].extend(inverse.offset[k]).to_array().map(nearest);
        let object_from_parent = [row(0), row(1), row(2)];
        let bounds = Aabb { min: min.to_array().map(round_down), max: max.to_array().map(round_up) };
        // NaN fails the comparison too.
        let below = |numbers: &[f32]| numbers.iter().fold(true, |sound, v| sound & (v.abs() <= self.limit));
        let sound = below(object_from_parent.as_flattened()) & below(&bounds.min) & below(&bounds.max);
        let flips_handedness = inverse.determinant < 0.0;
        sound.then_some(PlacedInstance { object_from_parent, bounds, flips_handedness })
    }

    /// Box of the target placed by `m`, including the positions to which the f32 rounding `A + E` of the inverse
    /// `A = (rows, offset)` moves it: a point x moves by `M E x`, with `|E| <= 2^-24 |A|`.
    #[inline]
    fn placed_box(&self, m: &DAffine3, inverse: &InversePlacement) -> ([DVec3; 2], InstanceFootprint) {
        let InversePlacement { rows, offset, .. } = inverse;
        let lever = m.matrix3 * self.center;
        let center = lever + m.translation;
        let (x, y, z) = (m.matrix3.x_axis.abs(), m.matrix3.y_axis.abs(), m.matrix3.z_axis.abs());
        let half = x * self.half.x + y * self.half.y + z * self.half.z;
        let reach = center.abs() + half;
        let [a, b, c] = rows.map(|r| r.abs().dot(reach));
        let error = (DVec3::new(a, b, c) + offset.abs()) * MATRIX_ERROR;
        let sums = rows.map(|r| r.abs().element_sum());
        let spread = (x * sums[0] + y * sums[1] + z * sums[2]).max_element();
        let footprint = InstanceFootprint { center, half, spread, lever: lever.abs().max_element() };
        let half = half + x * error.x + y * error.y + z * error.z;
        ([center - half, center + half], footprint)
    }
}

/// The inverse of a placement, before rounding.
struct InversePlacement {
    rows: [DVec3; 3],
    offset: DVec3,
    /// Determinant of the placement.
    determinant: f64,
}

impl InversePlacement {
    #[inline]
    fn of(m: &DAffine3) -> Option<Self> {
        let DMat3 { x_axis: x, y_axis: y, z_axis: z } = m.matrix3;
        // Rows of the adjugate.
        let (r0, r1, r2) = (y.cross(z), z.cross(x), x.cross(y));
        let determinant = z.dot(r2);
        if !is_regular(&m.matrix3, determinant) {
            // Also where the test compared with NaN.
            return None;
        }
        let inverse = 1.0 / determinant;
        let rows = [r0 * inverse, r1 * inverse, r2 * inverse];
        let offset = -DVec3::from(rows.map(|r| r.dot(m.translation)));
        Some(Self { rows, offset, determinant })
    }
}

/// A quaternion of finite halves, which most are: the same result as [`ArrayView::quat`], faster. `None` for others.
#[inline]
fn usual_halves(rotations: &ArrayView<'_>, number: usize) -> Option<DQuat> {
    /// 2^112, the difference of the exponents' biases: the product is exact.
    const SCALE: f32 = f32::from_bits(0x7780_0000);
    if rotations.element() != ElementType::Quath {
        return None;
    }
    let bytes = rotations.bytes().get(number.checked_mul(8)?..)?.first_chunk::<8>()?;
    let [a, b, c, d, e, f, g, h] = *bytes;
    let halves = [[a, b], [c, d], [e, f], [g, h]].map(u16::from_ne_bytes);
    let is_finite = halves.iter().fold(true, |finite, half| finite & (half & 0x7c00 != 0x7c00));
    let wide = |half: u16| {
        let magnitude = f32::from_bits(u32::from(half & 0x7fff) << 13) * SCALE;
        f64::from(f32::from_bits(magnitude.to_bits() | u32::from(half & 0x8000) << 16))
    };
    is_finite.then(|| DQuat::from_array(halves.map(wide)))
}

/// Rotation matrix of a quaternion of any length; the identity for the zero quaternion.
#[inline]
fn rotation(q: DQuat) -> DMat3 {
    let norm = q.length_squared();
    if norm == 0.0 {
        return DMat3::IDENTITY;
    }
    let s = 2.0 / norm;
    let (xs, ys, zs) = (q.x * s, q.y * s, q.z * s);
    let (wx, wy, wz) = (q.w * xs, q.w * ys, q.w * zs);
    let (xx, xy, xz) = (q.x * xs, q.x * ys, q.x * zs);
    let (yy, yz, zz) = (q.y * ys, q.y * zs, q.z * zs);
    DMat3::from_cols(
        DVec3::new(1.0 - (yy + zz), xy + wz, xz - wy),
        DVec3::new(xy - wz, 1.0 - (xx + zz), yz + wx),
        DVec3::new(xz + wy, yz - wx, 1.0 - (xx + yy)),
    )
}
