// SPDX-License-Identifier: Apache-2.0
//! Bad instances, instancers and lights: the smallest bad part goes, one warning per prim.

use glam::{DMat4, DVec3, DVec4};
use oocpt_core::{DroppedData, ElementType, LightDesc, LightKind, SceneDb, TypedArray};

use crate::support::{NONE, by, flatten, outcome, prim, records, scatter, triangle, with_instancer};

#[test]
fn a_bad_matrix_drops_its_instance_and_keeps_instance_ids() {
    let mut points = vec![[0.0_f32; 3]; 6];
    points[1] = [f32::NAN, 0.0, 0.0];
    points[2] = [f32::INFINITY, 0.0, 0.0];
    let mut desc = scatter("/i", &points, &[("/i/p", &[0, 1, 2, 3, 4, 5])]);
    let mut scales = vec![[1.0_f32; 3]; 6];
    scales[3] = [1.0, 0.0, 1.0];
    scales[4] = [1e-15; 3];
    desc.scales = Some(TypedArray::of(scales));
    let mut db = with_instancer(desc);
    let (left, dropped, warned) = outcome(&mut db);
    // A scale of 1e-15 is small but sound.
    assert_eq!(left, 3);
    assert_eq!(dropped, DroppedData { instance_transforms: 3, ..NONE });
    assert_eq!(warned, ["/i"]);
    let numbers: Vec<_> = records(db.snapshot(), 0).iter().map(|r| (r.index_in_prototype, r.prototype_count)).collect();
    assert_eq!(numbers, [(0, 6), (4, 6), (5, 6)]);
    assert!(db.commit().warnings.is_empty(), "warned once");
}

#[test]
fn matrices_too_extreme_for_single_precision_are_dropped() {
    // The squares of a direction in object space would overflow.
    for scale in [1e-60, 1e-20, 1e20, 1e60] {
        let mut desc = scatter("/i", &[[0.0; 3]], &[("/i/p", &[0])]);
        let matrix = DMat4::from_scale(DVec3::splat(scale)).to_cols_array_2d();
        desc.transforms = Some(TypedArray::of(vec![matrix]));
        let expected = DroppedData { instance_transforms: 1, ..NONE };
        assert_eq!(outcome(&mut with_instancer(desc)).1, expected, "{scale}");
    }
}

#[test]
fn projective_and_sheared_flat_matrices_are_dropped() {
    let mut projective = DMat4::IDENTITY;
    projective.x_axis.w = 0.5;
    let flat = DMat4::from_cols(DVec4::X, DVec4::X, DVec4::Z, DVec4::W);
    let mut desc = scatter("/i", &[[0.0; 3]; 3], &[("/i/p", &[0, 1, 2])]);
    let matrices = [projective, flat, DMat4::IDENTITY].map(|m| m.to_cols_array_2d());
    desc.transforms = Some(TypedArray::of(matrices.to_vec()));
    let (left, dropped, _) = outcome(&mut with_instancer(desc));
    assert_eq!((left, dropped), (1, DroppedData { instance_transforms: 2, ..NONE }));
}

#[test]
fn indices_without_an_instance_are_dropped() {
    let mut desc = scatter("/i", &[[0.0; 3]; 5], &[("/i/p", &[0, -1, 4, 5, i32::MAX, i32::MIN, 3])]);
    // The shortest array counts: number 4 has no rotation.
    desc.rotations = Some(TypedArray::from_vec(ElementType::Quatf, vec![[0.0_f32, 0.0, 0.0, 1.0]; 4]).unwrap());
    let (left, dropped, _) = outcome(&mut with_instancer(desc));
    assert_eq!((left, dropped), (2, DroppedData { instance_indices: 5, ..NONE }));
}

#[test]
fn a_short_instance_mask_shows_the_remaining_instances() {
    let mut desc = scatter("/i", &[[0.0; 3]; 4], &[("/i/p", &[0, 1, 2, 3, -1])]);
    desc.mask = Some(TypedArray::from_bools(&[false, true]));
    let mut db = with_instancer(desc);
    let (left, dropped, _) = outcome(&mut db);
    assert_eq!((left, dropped), (3, DroppedData { instance_indices: 1, short_masks: 1, ..NONE }));
    let ids: Vec<i64> = flatten(db.snapshot()).iter().map(|l| l.instance_id).collect();
    assert_eq!(ids, [0, 1, 2], "ranks among the shown");
}

#[test]
fn arrays_of_the_wrong_type_drop_the_instancer() {
    let mut desc = scatter("/i", &[[0.0; 3]; 2], &[("/i/p", &[0, 1])]);
    desc.translations = Some(TypedArray::of(vec![1.0_f32, 2.0]));
    desc.scales = Some(TypedArray::of(vec![[1.0_f32; 4]; 2]));
    let (left, dropped, _) = outcome(&mut with_instancer(desc));
    assert_eq!((left, dropped), (0, DroppedData { wrong_array_types: 2, ..NONE }));
    let mut desc = scatter("/i", &[[0.0; 3]; 2], &[("/i/p", &[])]);
    desc.prototypes[0].indices = TypedArray::of(vec![0.0_f32]);
    assert_eq!(outcome(&mut with_instancer(desc)).1, DroppedData { wrong_array_types: 1, ..NONE });
    let mut desc = scatter("/i", &[[0.0; 3]; 2], &[("/i/p", &[0, 1])]);
    desc.mask = Some(TypedArray::of(vec![0_i32, 0]));
    assert_eq!(outcome(&mut with_instancer(desc)).0, 2, "a mask of the wrong type is ignored");
}

#[test]
fn zero_quaternions_are_the_identity() {
    let mut desc = scatter("/i", &[[3.0, 0.0, 0.0]], &[("/i/p", &[0])]);
    desc.rotations = Some(TypedArray::from_vec(ElementType::Quatf, vec![[0.0_f32; 4]]).unwrap());
    let mut db = with_instancer(desc);
    assert_eq!(outcome(&mut db).1, NONE);
    assert_eq!(flatten(db.snapshot())[0].world, DMat4::from_translation(DVec3::new(3.0, 0.0, 0.0)));
}

#[test]
fn bad_prim_transforms_drop_the_prim() {
    let bad = [
        DMat4::ZERO,
        DMat4::from_scale(DVec3::new(1.0, f64::NAN, 1.0)),
        DMat4::from_translation(DVec3::INFINITY),
        DMat4::from_scale(DVec3::new(1.0, 0.0, 1.0)),
        // Finite and regular, but not in single precision.
        DMat4::from_scale(DVec3::splat(1e300)),
    ];
    for transform in bad {
        let mut db = with_instancer(scatter("/i", &[[0.0; 3]], &[("/i/p", &[0])]));
        let mut mesh = triangle("/bad", 0.0);
        mesh.prim.transform = transform;
        db.upsert_mesh(mesh);
        let (left, dropped, warned) = outcome(&mut db);
        assert_eq!((left, dropped), (1, DroppedData { prim_transforms: 1, ..NONE }), "{transform}");
        assert_eq!(warned, ["/bad"]);
    }
}

#[test]
fn a_changed_warning_is_reported_again() {
    let mut db = SceneDb::new();
    let flat = |path: &str, n: usize| {
        crate::support::polygons(path, &vec![3; n], &[0, 1, 2].repeat(n), &[[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    };
    db.upsert_mesh(flat("/flat", 1));
    let first = db.commit().warnings;
    assert_eq!(first.len(), 1);
    assert_eq!(first[0].message, "bad data: 1 meshes without a usable face, 1 zero-area triangles");
    db.upsert_mesh(triangle("/other", 0.0));
    assert!(db.commit().warnings.is_empty());
    db.upsert_mesh(flat("/flat", 2));
    assert_eq!(db.commit().warnings.len(), 1);
}

#[test]
fn bad_lights_are_dropped_alone() {
    let light = |path: &str| LightDesc {
        prim: prim(path),
        kind: LightKind::Distant { angle_degrees: 1.0 },
        color: [1.0; 3],
        intensity: 1.0,
        exposure: 0.0,
        color_temperature: None,
        normalize: true,
        camera_visible: true,
        ..LightDesc::default()
    };
    let mut db = SceneDb::new();
    db.upsert_light(light("/good"));
    let mut bad: Vec<LightDesc> = (0..6).map(|k| light(&format!("/bad{k}"))).collect();
    bad[0].intensity = f32::NAN;
    bad[1].exposure = 1e9;
    bad[2].color[1] = f32::INFINITY;
    bad[3].color_temperature = Some(f32::NAN);
    bad[4].prim.transform = DMat4::ZERO;
    bad[5].kind = LightKind::Distant { angle_degrees: f32::NAN };
    bad.into_iter().for_each(|l| db.upsert_light(l));
    let mut hidden = light("/hidden");
    hidden.prim.visible = false;
    db.upsert_light(hidden);
    let mut inside = light("/inside");
    inside.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_light(inside);
    let mut black = light("/black");
    black.intensity = 0.0;
    db.upsert_light(black);
    let (_, dropped, warned) = outcome(&mut db);
    assert_eq!(dropped, DroppedData { lights: 6, missing_instancers: 1, ..NONE });
    assert_eq!((warned.len(), db.snapshot().lights.len()), (7, 1));
}
