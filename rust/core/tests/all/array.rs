// SPDX-License-Identifier: Apache-2.0
//! Typed views of arrays.

use std::sync::Arc;

use glam::{DMat4, DQuat, DVec3, DVec4};
use half::f16;
use oocpt_core::{ArrayError, ArraySource, ElementType, TypedArray};

#[derive(Debug)]
struct Shifted(Vec<u8>);

impl ArraySource for Shifted {
    fn bytes(&self) -> &[u8] {
        &self.0[1..]
    }
}

#[test]
fn length_must_be_whole_elements() {
    let source = Arc::new(Shifted(vec![0; 14]));
    let error = TypedArray::new(ElementType::Vec3f, source.clone()).unwrap_err();
    assert_eq!(error, ArrayError::Length { element: ElementType::Vec3f, size: 12, bytes: 13 });
    assert_eq!(TypedArray::new(ElementType::Bool, source).unwrap().len(), 13);
}

#[test]
fn unaligned_arrays_are_read() {
    let mut bytes = vec![0xff];
    bytes.extend(bytemuck::cast_slice(&[1.0_f64, 2.0, 3.0, 4.0, 5.0, 6.0]));
    let array = TypedArray::new(ElementType::Vec3d, Arc::new(Shifted(bytes))).unwrap();
    assert_eq!(array.vec3(1), Some(DVec3::new(4.0, 5.0, 6.0)));
    assert_eq!(array.vec3(2), None);
    assert_eq!(array.vec3(usize::MAX), None);
}

#[test]
fn half_float_and_double_arrays_give_the_same_numbers() {
    let h = TypedArray::of(vec![[1.5, -2.0, 0.25].map(f16::from_f32)]);
    let f = TypedArray::of(vec![[1.5_f32, -2.0, 0.25]]);
    let d = TypedArray::of(vec![[1.5_f64, -2.0, 0.25]]);
    for array in [h, f, d] {
        assert_eq!(array.vec3(0), Some(DVec3::new(1.5, -2.0, 0.25)), "{array:?}");
        assert_eq!((array.vec4(0), array.quat(0), array.scalar(0), array.index(0)), (None, None, None, None));
    }
}

#[test]
fn quaternions_store_the_imaginary_part_first() {
    let array = TypedArray::from_vec(ElementType::Quatf, vec![[1.0_f32, 2.0, 3.0, 4.0]]).unwrap();
    assert_eq!(array.quat(0), Some(DQuat::from_xyzw(1.0, 2.0, 3.0, 4.0)));
    assert_eq!(array.vec4(0), None);
    assert_eq!(TypedArray::of(vec![[1.0_f32; 4]]).vec4(0), Some(DVec4::ONE));
}

#[test]
fn gf_matrices_become_column_vector_matrices() {
    // GfMatrix4d().SetTranslate((5, 6, 7)): the translation is the last row.
    let gf = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [5.0, 6.0, 7.0, 1.0_f64]];
    let expected = DMat4::from_translation(DVec3::new(5.0, 6.0, 7.0));
    assert_eq!(TypedArray::of(vec![gf]).matrix(0), Some(expected));
}

#[test]
fn matrices_are_normalized_by_the_homogeneous_term() {
    let transform = |corner: [f64; 4]| {
        let gf = [[2.0, 0.0, 0.0, corner[0]], [0.0, 4.0, 0.0, corner[1]], [0.0, 0.0, 6.0, corner[2]]];
        TypedArray::of(vec![[gf[0], gf[1], gf[2], [5.0, 6.0, 7.0, corner[3]]]]).matrix(0).unwrap()
    };
    let moved = |corner| transform(corner).transform_point3(DVec3::ONE);
    assert_eq!(moved([0.0, 0.0, 0.0, 1.0]), DVec3::new(7.0, 10.0, 13.0), "as it is");
    // This is the result of GfMatrix4d::Transform.
    assert_eq!(moved([0.0, 0.0, 0.0, 2.0]), DVec3::new(3.5, 5.0, 6.5), "points are homogeneous");
    assert_eq!(moved([0.0, 0.0, 0.0, -2.0]), DVec3::new(-3.5, -5.0, -6.5), "and so are negative ones");
    assert_eq!(transform([0.0, 0.0, 0.0, 3.0]).row(3), DVec4::W, "affine");
    let kept = [[0.0, 0.0, 1.0, 2.0], [0.0; 4], [0.0, 0.0, 0.0, f64::INFINITY]];
    for corner in kept {
        assert_eq!(transform(corner).row(3), DVec4::from_array(corner), "what is no affine matrix stays");
    }
}

#[test]
fn integers_and_bools_are_not_mixed() {
    let ints = TypedArray::of(vec![-3_i32, 4]);
    assert_eq!((ints.index(0), ints.index(2), ints.boolean(0)), (Some(-3), None, None));
    assert_eq!((ints.scalar(0), ints.scalar(2)), (Some(-3.0), None), "whole numbers are numbers");
    let bools = TypedArray::from_bools(&[true, false]);
    assert_eq!((bools.boolean(0), bools.boolean(1), bools.boolean(2)), (Some(true), Some(false), None));
    assert_eq!(bools.index(0), None);
}

#[test]
fn identity_is_shared_by_clones_only() {
    let a = TypedArray::of(vec![1_i32, 2]);
    let b = TypedArray::of(vec![1_i32, 2]);
    assert_eq!(a.identity(), a.clone().identity());
    assert_ne!(a.identity(), b.identity());
    assert!(a.same_contents(&b));
    assert!(!a.same_contents(&TypedArray::of(vec![1_i32, 3])));
}

#[test]
fn large_arrays_are_compared_to_their_last_byte() {
    let numbers = |last: i32| (0..300_000).chain([last]).collect::<Vec<i32>>();
    let a = TypedArray::of(numbers(7));
    assert!(a.same_contents(&TypedArray::of(numbers(7))), "at another address");
    assert!(!a.same_contents(&TypedArray::of(numbers(8))), "another last element");
    let mut longer = numbers(7);
    longer.push(0);
    assert!(!a.same_contents(&TypedArray::of(longer)), "one more");
}
