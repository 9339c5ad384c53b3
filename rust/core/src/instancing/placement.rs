// SPDX-License-Identifier: Apache-2.0
//! Where one instance goes: the matrix from borrowed arrays in f64, its inverse, a conservative box. Pure and without
//! allocation: this is the inner loop of scene encoding.

use std::sync::{Arc, OnceLock, Weak};

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, DVec4};

use super::array_motion::{ArrayMotion, VelocityMotion};
use super::assembly::InstanceFlags;
use super::diff::ChangedNumbers;
use super::moving::KeyPlacer;
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::desc::DroppedData;
use crate::desc::InstancerDesc;
use crate::mesh::Aabb;

/// Columns are called dependent when `det^2` is below this times the product of their squared lengths.
const SINGULAR: f64 = 1e-24;
/// Largest number of a record: its square is finite in single precision.
pub(super) const MAX_MAGNITUDE: f32 = 1e18;
/// Numbers of a record that add up to less are all well below [`MAX_MAGNITUDE`].
const USUAL_MAGNITUDE: f64 = 1e17;
/// Rounding of the f32 matrix and of its evaluation, in units of the magnitudes involved: 4 x 2^-24.
pub(crate) const MATRIX_ERROR: f64 = 4.0 / 16_777_216.0;

/// The per-instance arrays of an instancer; absent and empty arrays are `None`.
#[derive(Clone, Debug, Default)]
pub(crate) struct InstanceArrays {
    pub(crate) mask: Option<TypedArray>,
    pub(crate) translations: Option<TypedArray>,
    pub(crate) rotations: Option<TypedArray>,
    pub(crate) scales: Option<TypedArray>,
    pub(crate) transforms: Option<TypedArray>,
    /// How they move while the shutter is open.
    pub(crate) motion: Option<Arc<ArrayMotion>>,
    /// What changed against the arrays before, once it was asked for.
    pub(crate) changes: OnceLock<(Weak<Self>, Option<Arc<ChangedNumbers>>)>,
}

impl InstanceArrays {
    /// Takes the arrays of `desc`.
    pub(crate) fn of(desc: &InstancerDesc) -> Self {
        let present = |array: &Option<TypedArray>| array.clone().filter(|a| !a.is_empty());
        Self {
            mask: present(&desc.mask),
            translations: present(&desc.translations),
            rotations: present(&desc.rotations),
            scales: present(&desc.scales),
            transforms: present(&desc.transforms),
            motion: None,
            changes: OnceLock::new(),
        }
    }

    /// The instances whose elements differ, when both have the same kinds of arrays and the same mask. Kept, so that it
    /// is worked out once for all prototypes; whoever asks before it is kept works it out too, and nobody waits: a
    /// thread of the pool that helps out while it waits could come back here and wait for itself.
    pub(crate) fn changes(old: &Arc<Self>, new: &Arc<Self>) -> Option<Arc<ChangedNumbers>> {
        if new.changes.get().is_none() {
            let changes = ChangedNumbers::between(old, new).map(Arc::new);
            // Somebody else may have been faster, with the same result.
            drop(new.changes.set((Arc::downgrade(old), changes)));
        }
        let (from, changes) = new.changes.get()?;
        if std::ptr::eq(from.as_ptr(), Arc::as_ptr(old)) { changes.clone() } else { None }
    }

    pub(crate) fn all(&self) -> [&Option<TypedArray>; 5] {
        [&self.mask, &self.translations, &self.rotations, &self.scales, &self.transforms]
    }

    /// True when both hold the same data.
    pub(crate) fn same_contents(&self, other: &Self) -> bool {
        let moves_alike = match (&self.motion, &other.motion) {
            (None, None) => true,
            (Some(a), Some(b)) => a.same_contents(b),
            _ => false,
        };
        moves_alike
            && self.all().into_iter().zip(other.all()).all(|pair| match pair {
                (None, None) => true,
                (Some(a), Some(b)) => a.same_contents(b),
                _ => false,
            })
    }

    /// Checks the element types. A mask of the wrong type is ignored; any other wrong array leaves no instance whose
    /// place is known, and gives false.
    pub(crate) fn check_types(&mut self, dropped: &mut DroppedData) -> bool {
        if self.mask.as_ref().is_some_and(|a| a.element() != ElementType::Bool) {
            self.mask = None;
            dropped.wrong_array_types += 1;
        }
        let reads = |array: &Option<TypedArray>, works: fn(&TypedArray) -> bool| array.as_ref().is_none_or(works);
        let usable = [
            reads(&self.translations, |a| a.vec3(0).is_some()),
            reads(&self.rotations, |a| a.quat(0).is_some() || a.vec4(0).is_some()),
            reads(&self.scales, |a| a.vec3(0).is_some()),
            reads(&self.transforms, |a| a.matrix(0).is_some()),
        ];
        dropped.wrong_array_types += usable.iter().filter(|&&u| !u).count() as u64;
        !usable.contains(&false)
    }

    /// Instances described: the shortest array, or no limit without arrays.
    pub(crate) fn len(&self) -> usize {
        let [_, rest @ ..] = self.all();
        rest.into_iter().flatten().map(TypedArray::len).min().unwrap_or(usize::MAX)
    }
}

/// An affine matrix with finite entries and independent columns, or `None`.
pub(crate) fn usable_affine(m: &DMat4) -> Option<DAffine3> {
    let affine = affine_of(m)?;
    (affine.is_finite() && is_regular(&affine.matrix3, affine.matrix3.determinant())).then_some(affine)
}

fn affine_of(m: &DMat4) -> Option<DAffine3> {
    ((m.row(3) - DVec4::W).abs().max_element() <= 1e-9).then(|| DAffine3::from_mat4(*m))
}

pub(crate) fn is_regular(m: &DMat3, determinant: f64) -> bool {
    let volume = m.x_axis.length_squared() * m.y_axis.length_squared() * m.z_axis.length_squared();
    determinant * determinant > SINGULAR * volume
}

/// A placed instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedInstance {
    /// Rows of the inverse matrix.
    pub(crate) object_from_parent: [[f32; 4]; 3],
    /// Box in the parent's frame, rounded outward.
    pub(crate) bounds: Aabb,
    /// Handedness.
    pub(crate) flags: InstanceFlags,
}

/// What the partition needs to know of a placed instance: where it is and how large, in the parent's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct InstanceFootprint {
    /// Centre of the target's box, placed.
    pub(crate) center: DVec3,
    /// Half sides of the placed box, without rounding errors.
    pub(crate) half: DVec3,
    /// Maximum norm of `|M| |M^-1|`: how much the rounding of the f32 map is magnified, per unit of distance.
    pub(crate) spread: f64,
    /// Distance (maximum norm) of the placed box's centre from the placed origin of the target.
    pub(crate) lever: f64,
}

/// Everything needed to place the instances of one run: `before * T * R * S * M * after`.
#[derive(Clone, Debug)]
pub(crate) struct InstancePlacer<'a> {
    pub(super) before: DAffine3,
    pub(super) after: DAffine3,
    pub(super) after_is_identity: bool,
    pub(super) center: DVec3,
    pub(super) half: DVec3,
    /// Largest number of a record.
    pub(super) limit: f32,
    /// Where the parent's frame is seen from.
    pub(super) origin: DVec3,
    pub(super) translations: Option<ArrayView<'a>>,
    pub(super) rotations: Option<ArrayView<'a>>,
    pub(super) scales: Option<ArrayView<'a>>,
    pub(super) transforms: Option<ArrayView<'a>>,
    pub(super) drift: Option<VelocityMotion<'a>>,
    /// Of what moves: the same at two or more times.
    pub(super) keys: Option<Arc<[KeyPlacer<'a>]>>,
}

impl<'a> InstancePlacer<'a> {
    /// A placer of something with the box `bounds` (not empty).
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

    /// The same placements as seen from `origin`. What is usable is decided in the parent's frame: no limit here.
    pub(crate) fn seen_from(mut self, origin: DVec3) -> Self {
        self.before = DAffine3::from_translation(-origin) * self.before;
        self.limit = f32::MAX;
        self.origin += origin;
        let seen = |key: &KeyPlacer<'a>| KeyPlacer { time: key.time, placer: key.placer.clone().seen_from(origin) };
        self.keys = self.keys.map(|keys| keys.iter().map(seen).collect());
        self
    }

    /// Local matrix of instance `number`; `None` when an array is too short.
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

    /// Reads a byte of everything that [`InstancePlacer::matrix`] will need: for loops that go through memory without
    /// order.
    #[inline]
    pub(crate) fn touch(&self, number: usize) -> u8 {
        let views = [&self.translations, &self.rotations, &self.scales, &self.transforms];
        views.into_iter().flatten().fold(0, |sum, view| sum ^ view.touch(number))
    }

    /// Matrix of instance `number` in f64, or of the one thing of a run without instances.
    #[inline]
    pub(crate) fn matrix(&self, number: Option<usize>) -> Option<DAffine3> {
        let Some(number) = number else {
            return Some(self.before * self.after);
        };
        let m = self.before * self.local(number)?;
        Some(if self.after_is_identity { m } else { m * self.after })
    }

    /// Places instance `number` (see [`InstancePlacer::matrix`]); `None` when its matrix is singular, not finite, or
    /// too extreme for single precision.
    #[inline]
    pub(crate) fn place(&self, number: Option<usize>) -> Option<PlacedInstance> {
        let m = self.matrix(number)?;
        let inverse = InversePlacement::of(&m)?;
        let placed = self.rounded(&inverse, &self.placed_box(&m, &inverse).0)?;
        if self.keys.is_none() {
            return Some(placed);
        }
        let ([min, max], _, flips) = self.swept(number)?;
        let bounds = Aabb { min: min.to_array().map(round_down), max: max.to_array().map(round_up) };
        let flags = if flips { InstanceFlags::FLIPS_HANDEDNESS } else { InstanceFlags::empty() };
        Some(PlacedInstance { bounds, flags, ..placed })
    }

    /// As [`InstancePlacer::place`], for partitioning: lower and upper corner of the box before it is rounded outward,
    /// and what chunks need to know.
    #[inline]
    pub(crate) fn measure(&self, number: Option<usize>) -> Option<([DVec3; 2], InstanceFootprint)> {
        let m = self.matrix(number)?;
        let inverse = InversePlacement::of(&m)?;
        let (corners, footprint) = self.placed_box(&m, &inverse);
        // NaN fails the comparison. What is not clearly far below the limit is looked at closely.
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

    /// What [`InstancePlacer::measure`] gives of a usable instance, without its box.
    #[inline]
    pub(crate) fn footprint(&self, number: Option<usize>) -> Option<InstanceFootprint> {
        if self.keys.is_some() {
            return self.measure(number).map(|(_, footprint)| footprint);
        }
        let m = self.matrix(number)?;
        Some(self.placed_box(&m, &InversePlacement::of(&m)?).1)
    }

    /// In single precision; `None` when that is too extreme.
    #[inline]
    fn rounded(&self, inverse: &InversePlacement, [min, max]: &[DVec3; 2]) -> Option<PlacedInstance> {
        let row = |k: usize| inverse.rows[k].extend(inverse.offset[k]).to_array().map(nearest);
        let object_from_parent = [row(0), row(1), row(2)];
        let bounds = Aabb { min: min.to_array().map(round_down), max: max.to_array().map(round_up) };
        // NaN fails the comparison too.
        let below = |numbers: &[f32]| numbers.iter().fold(true, |sound, v| sound & (v.abs() <= self.limit));
        let sound = below(object_from_parent.as_flattened()) & below(&bounds.min) & below(&bounds.max);
        let flips = inverse.determinant < 0.0;
        let flags = if flips { InstanceFlags::FLIPS_HANDEDNESS } else { InstanceFlags::empty() };
        sound.then_some(PlacedInstance { object_from_parent, bounds, flags })
    }

    /// Box of the target placed by `m`, and also where the f32 rounding `A + E` of the inverse `A = (rows, offset)`
    /// puts it: a point x moves by `M E x`, with `|E| <= 2^-24 |A|`.
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

/// The inverse of a placement.
struct InversePlacement {
    rows: [DVec3; 3],
    offset: DVec3,
    /// Of the placement.
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

/// A quaternion of finite halves, which most are: exactly what [`ArrayView::quat`] gives, sooner. `None` for others.
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

/// The nearest f32.
#[inline]
#[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
pub(crate) fn nearest(v: f64) -> f32 {
    v as f32
}

/// The largest f32 that is not above `v`.
#[inline]
pub(crate) fn round_down(v: f64) -> f32 {
    let f = nearest(v);
    if f64::from(f) > v { f.next_down() } else { f }
}

/// The smallest f32 that is not below `v`.
#[inline]
pub(crate) fn round_up(v: f64) -> f32 {
    let f = nearest(v);
    if f64::from(f) < v { f.next_up() } else { f }
}
