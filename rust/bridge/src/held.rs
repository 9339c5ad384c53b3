// SPDX-License-Identifier: Apache-2.0
//! The objects of C++ that Rust uses: arrays, read in place, and images.
//!
//! [`HeldSource`] owns the C++ object and so keeps the USD array alive; it may be read and dropped on any thread.

use crate::{ffi, ffi_images};
use cxx::UniquePtr;
use oocpt_core::array::{ArraySource, ElementType, TypedArray};
use std::fmt;
use std::sync::Arc;

// SAFETY: a HeldArray is immutable from construction on. It owns a VtValue that holds a VtArray; copying and destroying
// one only touches an atomic reference count and calls no Python, so the destructor may run on any thread.
unsafe impl Send for ffi::HeldArray {}

// SAFETY: the only methods, bytes() and element(), are const and read members that are never written after
// construction.
unsafe impl Sync for ffi::HeldArray {}

// SAFETY: the contract of heldImage.h: every function and the destructor may run on any thread.
unsafe impl Send for ffi_images::HeldImage {}

// SAFETY: the same contract: several threads may be inside at once.
unsafe impl Sync for ffi_images::HeldImage {}

// SAFETY: the same contract.
unsafe impl Send for ffi_images::HeldFile {}

// SAFETY: the same contract.
unsafe impl Sync for ffi_images::HeldFile {}

// SAFETY: the same contract.
unsafe impl Send for ffi_images::HeldTransform {}

// SAFETY: the same contract.
unsafe impl Sync for ffi_images::HeldTransform {}

// SAFETY: the same contract.
unsafe impl Send for ffi_images::ImageSource {}

// SAFETY: the same contract.
unsafe impl Sync for ffi_images::ImageSource {}

/// A non-null held array.
struct HeldSource(UniquePtr<ffi::HeldArray>);

impl ArraySource for HeldSource {
    fn bytes(&self) -> &[u8] {
        self.0.as_ref().map_or(&[], |held| held.bytes())
    }
}

impl fmt::Debug for HeldSource {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "HeldSource({} bytes)", self.bytes().len())
    }
}

/// A typed view of a held array; `None` if the pointer is null.
///
/// `Some(Err)` carries the reason if the bytes do not divide into elements or the element type is unknown.
pub(crate) fn typed_array(held: UniquePtr<ffi::HeldArray>) -> Option<Result<TypedArray, String>> {
    let element = held.as_ref()?.element();
    Some(match element_type(element) {
        Some(element) => TypedArray::new(element, Arc::new(HeldSource(held))).map_err(|error| error.to_string()),
        None => Err(format!("element type {} is unknown", element.repr)),
    })
}

fn element_type(tag: ffi::ElementTag) -> Option<ElementType> {
    Some(match tag {
        ffi::ElementTag::Bool => ElementType::Bool,
        ffi::ElementTag::I32 => ElementType::I32,
        ffi::ElementTag::F16 => ElementType::F16,
        ffi::ElementTag::F32 => ElementType::F32,
        ffi::ElementTag::F64 => ElementType::F64,
        ffi::ElementTag::Vec2h => ElementType::Vec2h,
        ffi::ElementTag::Vec2f => ElementType::Vec2f,
        ffi::ElementTag::Vec2d => ElementType::Vec2d,
        ffi::ElementTag::Vec3h => ElementType::Vec3h,
        ffi::ElementTag::Vec3f => ElementType::Vec3f,
        ffi::ElementTag::Vec3d => ElementType::Vec3d,
        ffi::ElementTag::Vec4h => ElementType::Vec4h,
        ffi::ElementTag::Vec4f => ElementType::Vec4f,
        ffi::ElementTag::Vec4d => ElementType::Vec4d,
        ffi::ElementTag::Quath => ElementType::Quath,
        ffi::ElementTag::Quatf => ElementType::Quatf,
        ffi::ElementTag::Quatd => ElementType::Quatd,
        ffi::ElementTag::Matrix4f => ElementType::Matrix4f,
        ffi::ElementTag::Matrix4d => ElementType::Matrix4d,
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_tag_has_its_element_type_with_the_right_size() {
        let sizes = [1, 4, 2, 4, 8, 4, 8, 16, 6, 12, 24, 8, 16, 32, 8, 16, 32, 64, 128];
        for (repr, size) in sizes.into_iter().enumerate() {
            let tag = ffi::ElementTag { repr: u8::try_from(repr).expect("few tags") };
            let bytes = vec![0_u8; 3 * size];
            let array = typed_array(ffi::copy_array(tag, &bytes)).expect("not null").expect("a known tag");
            assert_eq!(array.len(), 3, "tag {repr} must have elements of {size} bytes");
        }
    }

    #[test]
    fn null_is_absent_and_an_unknown_tag_is_an_error() {
        assert!(typed_array(UniquePtr::null()).is_none(), "null");
        let unknown = typed_array(ffi::copy_array(ffi::ElementTag { repr: 250 }, &[0; 4])).expect("not null");
        assert!(unknown.expect_err("no such type").contains("250"), "the tag must be named");
    }

    #[test]
    fn an_array_may_be_read_and_dropped_on_another_thread() {
        let array = typed_array(ffi::copy_array(ffi::ElementTag::I32, &7_i32.to_ne_bytes()));
        let array = array.expect("not null").expect("one integer");
        let read = std::thread::spawn(move || array.index(0)).join().expect("the thread must end well");
        assert_eq!(read, Some(7), "the value");
    }
}
