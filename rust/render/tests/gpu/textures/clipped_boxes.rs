// SPDX-License-Identifier: Apache-2.0
//! Boxes around what cutouts leave of triangles change no picture: in core, streaming, natively, by textures, by sets
//! of files, by primvars, and where points move.

#![expect(clippy::cast_possible_truncation, clippy::cast_precision_loss, reason = "times and counts of pixels")]

use super::opacity_masks::{Masks, cards, cut_in_many_ways, cut_with_bad_coordinates, masked, material_of};
use super::*;
use crate::scenes::deforming;
use glam::Vec3;
use oocpt_core::settings::TraversalKind;

const TOGETHER: Masks = (true, false);

/// One chunk: how a scene is cut goes by boxes, and chance by chunks.
fn one_chunk() -> Settings {
    settings(4, 3)
}

/// The picture of a scene with boxes of whole triangles.
fn whole(build: fn(&mut SceneDb), masks: Masks) -> Vec<Vec<u8>> {
    let faults =
        PlantedFaults { no_opacity_masks: !masks.0, no_deferred_cutouts: !masks.1, ..PlantedFaults::default() };
    let session = Session::with_options(one_chunk(), SessionOptions { faults, ..options() });
    let session = session.with_images(Arc::new(Library));
    session.with_scene(|db| {
        db.set_whole_bounds(true);
        build(db);
    });
    render_with_messages(&session, &close());
    read_all(&session, &close())
}

/// Sets of files, primvars of all rates, and cards that bend while the shutter is open.
fn cut_otherwise(db: &mut SceneDb) {
    db.upsert_light(dome([1.0; 3]));
    db.upsert_light(sun(2.0, 1.0, DMat4::from_rotation_x(-0.8)));
    db.upsert_mesh(square(prim("/ground", DMat4::from_scale(DVec3::splat(20.0))), 1, 0.5));
    let at = |x: f64, z: f64| DMat4::from_translation(DVec3::new(x, 0.8, z)) * DMat4::from_scale(DVec3::splat(0.6));
    let mut set = cards("/set", 2, 6, |x, y| [f32::from((x + y) & 1); 2]);
    set.prim.transform = at(-1.0, 0.3);
    set.material = Some("/set_material".into());
    db.upsert_mesh(set);
    db.upsert_material(material_of("/set_material", ("leaves <UDIM>", ["clamp", "clamp"], 1.0, 0.0, 0.5)));
    let corners = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let bends = |p: Vec3, time: f64| {
        let by = time as f32;
        p + Vec3::new(0.3 * by * p.y, 0.0, 0.4 * by * p.x * p.y)
    };
    for (i, threshold) in (0_u8..).zip([0.5, 0.2]) {
        let moved = DMat4::from_translation(DVec3::new(0.0, -1.1 * f64::from(i), -0.4)) * at(0.9, 0.0);
        let desc = mesh(prim(&format!("/moving_{i}"), moved), 3, corners.clone(), &[vec![0, 1, 2, 3]], 0.5);
        let material = format!("/moving_material_{i}");
        db.upsert_mesh(deforming(with_st(desc, 1.0, &material), &[0.0, 0.5, 1.0], &bends));
        db.upsert_material(material_of(&material, ("leaf 75x40", ["black", "black"], 1.0, 0.0, threshold)));
    }
    let rates = [(Interpolation::Uniform, 16), (Interpolation::Vertex, 25), (Interpolation::FaceVarying, 64)];
    for (i, (interpolation, count)) in (0_u8..).zip(rates) {
        let moved = DMat4::from_translation(DVec3::new(0.7 * f64::from(i), 0.7, -0.8)) * at(-0.9, 0.0);
        let mut desc = cards(&format!("/primvar_{i}"), 5 + i32::from(i), 4, |_, _| [0.0; 2]);
        desc.prim.transform = moved;
        let values =
            (0..count).map(|k| f32::from(u8::try_from(hash(k + 99 * u32::from(i)) & 255).unwrap_or(0)) / 255.0);
        let primvar = Primvar { interpolation, values: TypedArray::of(values.collect::<Vec<f32>>()), indices: None };
        desc.primvars.push(NamedPrimvar { name: "cut".into(), primvar });
        let path = format!("/primvar_material_{i}");
        desc.material = Some(path.as_str().into());
        db.upsert_mesh(desc);
        let own = vec![("opacityThreshold", ParamValue::Float(0.6))];
        let nodes = vec![
            node("/surface", "UsdPreviewSurface", own, &[("opacity", 1, "result")]),
            node("/reader", "UsdPrimvarReader_float", vec![("varname", text("cut"))], &[]),
        ];
        db.upsert_material(MaterialDesc { path: path.into(), nodes, surface: Some(0), ..MaterialDesc::default() });
    }
}

/// What is there is compared, and not a number of chance, which goes by the place of a triangle in its tree: the same
/// rays meet the same surfaces.
#[test]
fn clipped_boxes_change_no_bit_of_cutouts_by_thresholds() {
    let without = (false, false);
    let expected = whole(cut_otherwise, without);
    let (clipped, session) = masked(cut_otherwise, without, None, one_chunk());
    let snapshot = session.with_scene(|db| db.commit().snapshot);
    let count = snapshot.meshes.iter().filter(|mesh| mesh.is_clipped).count();
    assert_eq!(count, 6, "meshes whose boxes are clipped");
    assert!(clipped.images[0] == expected[0], "the picture differs");
    // Depths may differ by how they round: what is smaller has another origin.
    assert!(clipped.images[3..=8] == expected[3..=8], "ids and normals differ");
    let apart = masked(cut_otherwise, without, Some(600), one_chunk()).0;
    assert!(apart.images == clipped.images, "streaming");
    if session.device_report().expect("a device").host_memory {
        let native = Settings { traversal: TraversalKind::Native, ..one_chunk() };
        assert!(masked(cut_otherwise, without, None, native).0.images == clipped.images, "natively");
    }
}

/// By chance rays meet other leaves, as many.
#[test]
fn clipped_boxes_cover_as_much() {
    let mean = |images: &[Vec<u8>]| {
        let floats = images[0].as_chunks::<4>().0.iter().map(|bytes| f64::from(f32::from_le_bytes(*bytes)));
        floats.sum::<f64>() / (images[0].len() / 4) as f64
    };
    for build in [cut_in_many_ways, cut_with_bad_coordinates, cut_otherwise] {
        let [expected, found] =
            [mean(&whole(build, TOGETHER)), mean(&masked(build, TOGETHER, None, one_chunk()).0.images)];
        assert!((found / expected - 1.0).abs() < 0.01, "{found}, not {expected}");
    }
}
