// SPDX-License-Identifier: Apache-2.0
//! The same bits when the scene streams; the uploads after edits.

use super::*;

/// Boards with everything above, one of them instanced.
fn everything(db: &mut SceneDb) {
    db.upsert_material(plain("/glow", &[("emissiveColor", color([1.5, 0.5, 0.25]))]));
    db.upsert_material(reading("/tinted", "diffuseColor", "float3", "tint", &[]));
    let threshold = [("opacityThreshold", ParamValue::Float(0.5))];
    db.upsert_material(reading("/leaf", "opacity", "float", "alpha", &threshold));
    let tint: Vec<[f32; 3]> = (0..9_u8).map(|k| [0.1 * f32::from(k), 0.5, 0.9]).collect();
    let mut tinted = with(board("/tinted_board", 3, "/tinted"), "tint", Interpolation::Vertex, tint);
    tinted.subsets =
        vec![SubsetDesc { path: "/s".into(), material: Some("/glow".into()), faces: TypedArray::of(vec![2]) }];
    db.upsert_mesh(tinted);
    let alpha: Vec<f32> = (0..9_u8).map(|k| 0.125 * f32::from(k)).collect();
    let mut leaf = with(board("/trees/leaf", 4, "/leaf"), "alpha", Interpolation::Vertex, alpha);
    leaf.prim = instanced(leaf.prim, "/trees");
    db.upsert_mesh(leaf);
    let turn = DQuat::from_rotation_y(0.5);
    let places = [1.0, 2.0].map(|z| (DVec3::new(0.3 * z, 0.1, z), turn, DVec3::splat(0.5)));
    db.upsert_instancer(instancer(prim("/trees", DMat4::IDENTITY), "/trees/leaf", &places));
    db.upsert_material(textured("/picture", "diffuseColor", "rgb", &[]));
    let mut picture = with(board("/picture_board", 6, "/picture"), "st", Interpolation::Vertex, coordinates(|st| st));
    picture.prim.transform =
        DMat4::from_scale_rotation_translation(DVec3::splat(0.4), turn, DVec3::new(0.5, -0.5, 1.5));
    db.upsert_mesh(picture);
    db.upsert_light(dome([0.5, 0.6, 0.7]));
}

#[test]
fn preview_surface_materials_stream_with_the_same_bits() {
    let request = front();
    let images = [false, true].map(|force_streaming| {
        let options = SessionOptions { validation: true, force_streaming, ..SessionOptions::default() };
        let session =
            Session::with_options(crate::support::filtering(settings(8, 3)), options).with_images(Arc::new(Ramps));
        session.with_scene(everything);
        render(&session, &request);
        assert_eq!(session.stats().streaming.in_core, !force_streaming, "it streams when it is told to");
        read_all(&session, &request)
    });
    assert!(images[0] == images[1], "streaming changed a picture");
}

#[test]
fn an_edit_of_a_material_uploads_no_geometry() {
    let session = session(settings(1, 1)).with_images(Arc::new(Ramps));
    session.with_scene(everything);
    let request = front();
    render(&session, &request);
    let before = read_all(&session, &request);
    let edit = |db: &mut SceneDb| db.upsert_material(plain("/glow", &[("emissiveColor", color([0.25; 3]))]));
    session.with_scene(edit);
    render(&session, &request);
    let after = read_all(&session, &request);
    assert!(before != after, "the edit is seen");
    let other = crate::support::session(settings(1, 1)).with_images(Arc::new(Ramps));
    other.with_scene(|db| {
        everything(db);
        edit(db);
    });
    render(&other, &request);
    assert!(after == read_all(&other, &request), "as in a fresh render");
    let bytes = session.timings().uploaded_bytes;
    assert_eq!(bytes, 0, "nothing but tables is uploaded");
}
