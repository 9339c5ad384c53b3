// SPDX-License-Identifier: Apache-2.0
//! Primvars with a value per instance: finds those that are read, and the value of a placement.
//!
//! Rules, those of Storm (`HdSt_CodeGen`, instance primvars): a primvar that the mesh itself has wins; else the
//! innermost instancer that has it, whatever its value. Only `instance` interpolation counts. Values stay in the
//! borrowed arrays; those of a chunk or an assembly are computed record by record when it is loaded, like the records
//! themselves. Pure; any thread.

use oocpt_abi::NO_VALUE;
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;

use super::diff::ChangedNumbers;
use super::run::{InstanceNumbers, InstanceRun};
use crate::array::{ArrayView, ElementType, TypedArray};
use crate::desc::{InstancerDesc, Interpolation, Primvar};

/// Number of values checked by one task.
const TASK: usize = 1 << 14;

/// A primvar in a table of values by record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct InstanceColumn {
    /// Number of its name; materials use the same numbers.
    pub id: u32,
    /// Number of floats of a value, 1 to 4.
    pub width: u32,
}

/// Device bytes of a record's values in these columns.
pub(crate) fn value_bytes(columns: &[InstanceColumn]) -> u64 {
    columns.iter().map(|column| 4 * u64::from(column.width)).sum()
}

/// Result of checking all values of a primvar.
#[derive(Clone, Copy, Debug)]
struct PrimvarFindings {
    /// Values that are not finite, or whose index is out of range.
    bad: u64,
    /// True if every value is at least 1.
    all_one: bool,
}

/// An instance-rate primvar of an instancer.
#[derive(Debug)]
pub(crate) struct InstancePrimvar {
    pub(crate) name: Arc<str>,
    values: TypedArray,
    indices: Option<TypedArray>,
    findings: OnceLock<PrimvarFindings>,
}

impl InstancePrimvar {
    /// The instance-rate primvars of `desc`; taken from `old` if nothing changed.
    pub(crate) fn all_of(desc: &InstancerDesc, old: &[Arc<Self>]) -> Vec<Arc<Self>> {
        let is_instance_rate =
            |primvar: &Primvar| primvar.interpolation == Interpolation::Instance && !primvar.values.is_empty();
        let all = desc.primvars.iter().filter(|named| is_instance_rate(&named.primvar));
        let new = all.map(|named| Self {
            name: named.name.clone(),
            values: named.primvar.values.clone(),
            indices: named.primvar.indices.clone().filter(|indices| !indices.is_empty()),
            findings: OnceLock::new(),
        });
        new.map(|new| old.iter().find(|old| old.is_same(&new)).cloned().unwrap_or_else(|| Arc::new(new))).collect()
    }

    fn is_same(&self, other: &Self) -> bool {
        let indices = TypedArray::same_optional(self.indices.as_ref(), other.indices.as_ref());
        indices && self.name == other.name && self.values.same_contents(&other.values)
    }

    /// Number of floats of a value; `None` for types that are not numbers.
    pub(crate) fn width(&self) -> Option<u32> {
        Some(match self.values.element() {
            ElementType::F16 | ElementType::F32 | ElementType::F64 | ElementType::I32 | ElementType::Bool => 1,
            ElementType::Vec2h | ElementType::Vec2f | ElementType::Vec2d => 2,
            ElementType::Vec3h | ElementType::Vec3f | ElementType::Vec3d => 3,
            ElementType::Vec4h | ElementType::Vec4f | ElementType::Vec4d => 4,
            _ => return None,
        })
    }

    /// Returns true if it has a value for each of `count` instances.
    pub(crate) fn is_usable(&self, count: usize) -> bool {
        let len = self.indices.as_ref().map_or(self.values.len(), TypedArray::len);
        let indexed = self.indices.as_ref().is_none_or(|indices| indices.element() == ElementType::I32);
        len >= count && indexed && self.width().is_some()
    }

    fn findings(&self) -> PrimvarFindings {
        *self.findings.get_or_init(|| {
            let values = ValueReader::of(self, 1);
            let count = self.indices.as_ref().map_or(self.values.len(), TypedArray::len);
            let width = self.width().unwrap_or(1) as usize;
            let look = |first: usize| {
                let mut found = PrimvarFindings { bad: 0, all_one: true };
                for number in first..(first + TASK).min(count) {
                    match values.at(number) {
                        Some(value) => found.all_one &= value[..width].iter().all(|v| *v >= 1.0),
                        None => found = PrimvarFindings { bad: found.bad + 1, all_one: false },
                    }
                }
                found
            };
            let both = |a: PrimvarFindings, b: PrimvarFindings| PrimvarFindings {
                bad: a.bad + b.bad,
                all_one: a.all_one && b.all_one,
            };
            let nothing = || PrimvarFindings { bad: 0, all_one: true };
            (0..count.div_ceil(TASK)).into_par_iter().map(|task| look(task * TASK)).reduce(nothing, both)
        })
    }

    /// Number of values that are replaced by 0: not finite, or with an index out of range.
    pub(crate) fn bad_values(&self) -> u64 {
        self.findings().bad
    }

    /// Returns true if every value is at least 1.
    pub(crate) fn is_all_one(&self) -> bool {
        self.findings().all_one
    }
}

/// A primvar that some target below a member reads.
#[derive(Clone, Debug)]
pub(crate) struct MemberPrimvar {
    /// Number of its name.
    pub(crate) id: u32,
    pub(crate) primvar: Arc<InstancePrimvar>,
}

impl MemberPrimvar {
    pub(crate) fn column(&self) -> InstanceColumn {
        InstanceColumn { id: self.id, width: self.primvar.width().unwrap_or(1) }
    }

    /// Returns true if both lists give the same values.
    pub(crate) fn are_same(a: &[Self], b: &[Self]) -> bool {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.id == b.id && Arc::ptr_eq(&a.primvar, &b.primvar))
    }

    /// The instances that have another value in one of these lists; `None` unless both have the same primvars, of the
    /// same types.
    pub(crate) fn changes(old: &[Self], new: &[Self]) -> Option<ChangedNumbers> {
        let mut numbers = ChangedNumbers::of_lengths(0, 0);
        let mut add = |a: &TypedArray, b: &TypedArray| a.len() == b.len() && numbers.add(a, b);
        for (old, new) in old.iter().zip(new) {
            let (a, b) = (&old.primvar, &new.primvar);
            let is_comparable = match (&a.indices, &b.indices) {
                (None, None) => add(&a.values, &b.values),
                (Some(i), Some(j)) => a.values.same_contents(&b.values) && add(i, j),
                _ => false,
            };
            if old.id != new.id || !is_comparable {
                return None;
            }
        }
        (old.len() == new.len()).then_some(numbers)
    }

    /// The columns of several lists, each once, in order.
    pub(crate) fn columns<'a>(lists: impl Iterator<Item = &'a [Self]>) -> Vec<InstanceColumn> {
        let mut columns: Vec<InstanceColumn> = Vec::new();
        for primvar in lists.flatten() {
            let column = primvar.column();
            if !columns.contains(&column) {
                columns.push(column);
            }
        }
        columns.sort_unstable();
        columns
    }
}

/// Values of a primvar by number of the instance.
#[derive(Clone, Copy)]
struct ValueReader<'a> {
    values: ArrayView<'a>,
    indices: Option<ArrayView<'a>>,
    width: u32,
}

impl<'a> ValueReader<'a> {
    fn of(primvar: &'a InstancePrimvar, otherwise: u32) -> Self {
        let indices = primvar.indices.as_ref().map(TypedArray::view);
        Self { values: primvar.values.view(), indices, width: primvar.width().unwrap_or(otherwise) }
    }

    /// The value of an instance; `None` if it is missing or not finite in single precision.
    #[expect(clippy::cast_possible_truncation, reason = "rounding to single precision is what is wanted")]
    fn at(&self, number: usize) -> Option<[f32; 4]> {
        let at = match &self.indices {
            Some(indices) => usize::try_from(indices.index(number)?).ok()?,
            None => number,
        };
        let value = match self.width {
            1 => [self.values.scalar(at)?, 0.0, 0.0, 0.0],
            2 => self.values.vec2(at)?.extend(0.0).extend(0.0).to_array(),
            3 => self.values.vec3(at)?.extend(0.0).to_array(),
            _ => self.values.vec4(at)?.to_array(),
        };
        let value = value.map(|v| v as f32);
        value.iter().all(|v| v.is_finite()).then_some(value)
    }
}

/// Values of one column by rank of a run.
pub(crate) struct ColumnReader<'a> {
    numbers: InstanceNumbers<'a>,
    values: ValueReader<'a>,
}

impl<'a> ColumnReader<'a> {
    /// `None` if there is no such column.
    pub(crate) fn new(run: &'a InstanceRun, primvars: &'a [MemberPrimvar], column: InstanceColumn) -> Option<Self> {
        let found = primvars.iter().find(|primvar| primvar.column() == column)?;
        Some(Self { numbers: run.numbers(), values: ValueReader::of(&found.primvar, column.width) })
    }

    /// The value of a usable rank; 0 where it is unusable.
    pub(crate) fn at(&self, rank: u32) -> [f32; 4] {
        let number = self.numbers.of(rank).flatten();
        number.and_then(|number| self.values.at(number)).unwrap_or_default()
    }
}

/// Writes a value of `out`'s length, or that there is none.
pub(crate) fn write_value(out: &mut [f32], value: Option<[f32; 4]>) {
    let value = value.unwrap_or([f32::from_bits(NO_VALUE); 4]);
    for (slot, v) in out.iter_mut().zip(value) {
        *slot = v;
    }
}
