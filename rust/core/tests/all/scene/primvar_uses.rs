// SPDX-License-Identifier: Apache-2.0
//! Reports of the primvars that are used, and of those that are left out because nothing reads them.

use crate::support::{by, constant, scatter, triangle};
use oocpt_core::inventory::PrimvarUse;
use oocpt_core::scene::NamedPrimvar;
use oocpt_core::{Interpolation, MeshDesc, Primvar, SceneDb, TypedArray};

fn find<'a>(uses: &'a [PrimvarUse], name: &str) -> &'a PrimvarUse {
    uses.iter().find(|primvar| primvar.name == name).unwrap_or_else(|| panic!("{name} is not in {uses:?}"))
}

#[test]
fn unused_primvars_are_reported_with_their_bytes() {
    let instance_rate = |name: &str| NamedPrimvar {
        name: name.into(),
        primvar: Primvar {
            interpolation: Interpolation::Instance,
            values: TypedArray::of(vec![[0.5_f32; 3]; 2]),
            indices: None,
        },
    };
    let mut db = SceneDb::new();
    let st = Primvar {
        interpolation: Interpolation::FaceVarying,
        values: TypedArray::of(vec![[0.0_f32; 2]; 2]),
        indices: Some(TypedArray::of(vec![0, 1, 0])),
    };
    let named = NamedPrimvar { name: "st".into(), primvar: st };
    let mut mesh = triangle("/i/p", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(MeshDesc { primvars: vec![named], display_opacity: Some(constant(1.0_f32)), ..mesh });
    let mut row = scatter("/i", &[[0.0; 3], [5.0, 0.0, 0.0]], &[("/i/p", &[0, 1])]);
    row.primvars = vec![instance_rate("displayColor"), instance_rate("tint")];
    db.upsert_instancer(row);
    db.commit();
    let uses = db.primvar_uses();
    let color = find(&uses, "displayColor");
    assert_eq!((color.made, color.left_out, color.bytes, color.saved), (1, 0, 24, 0), "shown without a material");
    let tint = find(&uses, "tint");
    assert_eq!((tint.made, tint.left_out, tint.bytes, tint.saved), (0, 1, 0, 24), "nobody asks for it");
    let st = find(&uses, "st");
    assert_eq!((st.made, st.left_out, st.bytes, st.saved), (0, 1, 0, 24), "no material: three corners of two floats");
    let opacity = find(&uses, "displayOpacity");
    assert_eq!((opacity.made, opacity.left_out, opacity.saved), (0, 1, 4), "1 everywhere says nothing");
}

#[test]
fn primvars_that_images_show_are_kept() {
    let mut db = SceneDb::new();
    let dust = |interpolation, values| NamedPrimvar {
        name: "dust".into(),
        primvar: Primvar { interpolation, values: TypedArray::of(values), indices: None },
    };
    let vertex = dust(Interpolation::Vertex, vec![1.0_f32, 2.0, 3.0]);
    db.upsert_mesh(MeshDesc { primvars: vec![vertex], ..triangle("/board", 0.0) });
    let mut mesh = triangle("/i/p", 0.0);
    mesh.prim.instanced_by = vec![by("/i", "/i/p")];
    db.upsert_mesh(mesh);
    let mut row = scatter("/i", &[[0.0; 3], [5.0, 0.0, 0.0]], &[("/i/p", &[0, 1])]);
    row.primvars = vec![dust(Interpolation::Instance, vec![4.0, 5.0])];
    db.upsert_instancer(row);
    let plain = db.commit().snapshot;
    let made = |db: &SceneDb| db.primvar_uses().iter().map(|primvar| (primvar.made, primvar.bytes)).collect::<Vec<_>>();
    assert_eq!((made(&db), plain.surfaces.shown_primvars.len()), (vec![(0, 0)], 0), "nobody asks");
    db.show_primvars(&["dust".into(), "nothing".into()]);
    let shown = db.commit();
    assert!(shown.changed && made(&db) == [(2, 20)], "three of the mesh, two of the instances: {:?}", made(&db));
    assert_ne!(shown.snapshot.surfaces.primvar_number("dust"), shown.snapshot.surfaces.primvar_number("nothing"));
    db.show_primvars(&["dust".into(), "nothing".into()]);
    assert!(!db.commit().changed, "the same again");
    db.show_primvars(&[]);
    let again = db.commit().snapshot;
    assert_eq!((made(&db), &again.meshes.len()), (vec![(0, 0)], &plain.meshes.len()), "nobody asks any more");
}
