// SPDX-License-Identifier: Apache-2.0
//! The arrays of an instancer. Borrowed from the host application; any thread.

use std::sync::{Arc, OnceLock, Weak};

use super::array_motion::ArrayMotion;
use super::diff::ChangedNumbers;
use crate::array::{ElementType, TypedArray};
use crate::desc::{DroppedData, InstancerDesc};

/// The per-instance arrays of an instancer; absent and empty arrays are `None`.
#[derive(Clone, Debug, Default)]
pub(crate) struct InstanceArrays {
    pub(crate) mask: Option<TypedArray>,
    pub(crate) translations: Option<TypedArray>,
    pub(crate) rotations: Option<TypedArray>,
    pub(crate) scales: Option<TypedArray>,
    pub(crate) transforms: Option<TypedArray>,
    /// Motion of the instances while the shutter is open.
    pub(crate) motion: Option<Arc<ArrayMotion>>,
    /// Instances that differ from the previous arrays, once they were asked for.
    pub(crate) changes: OnceLock<(Weak<Self>, Option<Arc<ChangedNumbers>>)>,
    /// The arrays that these were compared with, by [`TypedArray::identity`], and what differs from them.
    compared: OnceLock<ArrayChanges>,
}

/// What differs between the arrays of an instancer and earlier ones, as a commit found it.
#[derive(Clone, Debug)]
pub struct ArrayChanges {
    before: [Option<(usize, usize)>; 4],
    numbers: Arc<ChangedNumbers>,
}

impl ArrayChanges {
    /// Whether they are those of array `at` (0 translations, 1 rotations, 2 scales, 3 transforms) from `old`, which
    /// must have been alive since before these arrays were committed.
    #[must_use]
    pub fn are_since(&self, at: usize, old: &TypedArray) -> bool {
        self.before.get(at).is_some_and(|before| *before == Some(old.identity()))
    }

    /// The elements that may differ, in order; `None` if they are more than `most`.
    #[must_use]
    pub fn listed(&self, most: usize) -> Option<Vec<usize>> {
        self.numbers.listed(most)
    }
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
            compared: OnceLock::new(),
        }
    }

    /// The instances whose elements differ, if both have the same kinds of arrays and the same mask. The result is
    /// stored, so that it is computed once for all prototypes. Callers that arrive before it is stored compute it too,
    /// and none waits: a thread of the pool that works on other tasks while it waits could come back here and wait for
    /// itself.
    pub(crate) fn changes(old: &Arc<Self>, new: &Arc<Self>) -> Option<Arc<ChangedNumbers>> {
        if new.changes.get().is_none() {
            let changes = Self::compared(old, new).map(Arc::new);
            // Another thread may have been faster, with the same result.
            if let Some(numbers) = &changes {
                let before = old.transforming().map(|array| array.map(TypedArray::identity));
                drop(new.compared.set(ArrayChanges { before, numbers: Arc::clone(numbers) }));
            }
            drop(new.changes.set((Arc::downgrade(old), changes)));
        }
        let (from, changes) = new.changes.get()?;
        if std::ptr::eq(from.as_ptr(), Arc::as_ptr(old)) { changes.clone() } else { None }
    }

    /// The instances whose elements differ bit for bit, or that only one side has; `None` unless both have the same
    /// arrays, of the same types, and equal masks.
    fn compared(old: &Self, new: &Self) -> Option<ChangedNumbers> {
        if !TypedArray::same_optional(old.mask.as_ref(), new.mask.as_ref()) {
            return None;
        }
        let mut numbers = ChangedNumbers::of_lengths(old.len(), new.len());
        for pair in old.transforming().into_iter().zip(new.transforming()) {
            match pair {
                (None, None) => {}
                (Some(a), Some(b)) if numbers.add(a, b) => {}
                _ => return None,
            }
        }
        Some(numbers.counted())
    }

    /// Returns true if both have the same kinds of arrays, of the same types, for as many instances, and equal masks.
    pub(crate) fn is_shaped_as(&self, other: &Self) -> bool {
        let types = |arrays: &Self| arrays.transforming().map(|array| array.map(TypedArray::element));
        let is_alike = types(self) == types(other) && self.len() == other.len();
        is_alike && TypedArray::same_optional(self.mask.as_ref(), other.mask.as_ref())
    }

    /// What differs from the arrays before, if that was asked for and could be told.
    pub(crate) fn known_changes(&self) -> Option<&ArrayChanges> {
        self.compared.get()
    }

    /// The arrays that place instances: translations, rotations, scales, transforms.
    pub(crate) fn transforming(&self) -> [Option<&TypedArray>; 4] {
        [&self.translations, &self.rotations, &self.scales, &self.transforms].map(Option::as_ref)
    }

    fn all(&self) -> [Option<&TypedArray>; 5] {
        let [translations, rotations, scales, transforms] = self.transforming();
        [self.mask.as_ref(), translations, rotations, scales, transforms]
    }

    /// Returns true if both hold the same data.
    pub(crate) fn same_contents(&self, other: &Self) -> bool {
        let moves_alike = match (&self.motion, &other.motion) {
            (None, None) => true,
            (Some(a), Some(b)) => a.same_contents(b),
            _ => false,
        };
        let mut pairs = self.all().into_iter().zip(other.all());
        moves_alike && pairs.all(|(a, b)| TypedArray::same_optional(a, b))
    }

    /// Checks the element types. A mask of the wrong type is ignored; any other wrong array makes all instances
    /// unusable, and the result false.
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

    /// Number of instances described: the length of the shortest array, or no limit without arrays.
    pub(crate) fn len(&self) -> usize {
        self.transforming().into_iter().flatten().map(TypedArray::len).min().unwrap_or(usize::MAX)
    }
}
