// SPDX-License-Identifier: Apache-2.0
//! Primvars with a value per instance: each instance shows its own, the mesh's and the innermost instancer's win, at
//! any nesting and any budget.

use super::*;
use oocpt_core::scene::InstancerDesc;
use oocpt_core::settings::Settings;

/// A primvar of an instancer.
fn per_instance<T: ArrayElement + std::fmt::Debug>(
    mut desc: InstancerDesc,
    name: &str,
    values: Vec<T>,
) -> InstancerDesc {
    let primvar = Primvar { interpolation: Interpolation::Instance, values: TypedArray::of(values), indices: None };
    desc.primvars.push(NamedPrimvar { name: name.into(), primvar });
    desc
}

/// `side` x `side` places that fill -1..1 with boards.
fn grid(side: u16) -> Vec<(DVec3, DQuat, DVec3)> {
    let size = 1.0 / f64::from(side);
    let at = |k: u16| f64::from(2 * k + 1) * size - 1.0;
    let all = (0..side).flat_map(|y| (0..side).map(move |x| (x, y)));
    all.map(|(x, y)| (DVec3::new(at(x), at(y), 0.0), DQuat::IDENTITY, DVec3::splat(size))).collect()
}

/// A value of its own for each number.
fn tint(number: usize) -> [f32; 3] {
    let part = |factor: usize| f32::from(u16::try_from(number * factor % 97).expect("small")) / 97.0;
    [part(13), part(29), part(61)]
}

fn tints(count: usize) -> Vec<[f32; 3]> {
    (0..count).map(tint).collect()
}

/// A board without a colour or a material, placed by `/row`.
fn bare(path: &str, instancer: &str) -> MeshDesc {
    let desc = board(path, 5, "");
    MeshDesc { prim: instanced(desc.prim.clone(), instancer), material: None, display_color: None, ..desc }
}

fn row(side: u16) -> InstancerDesc {
    instancer(prim("/row", DMat4::IDENTITY), "/row/board", &grid(side))
}

fn albedo_by_instance(session: &Session, request: &RenderRequest, expected: impl Fn(usize) -> [f32; 3]) {
    let albedo: Vec<[f32; 3]> = read(session, request, AovKind::Albedo);
    let ids: Vec<i32> = read(session, request, AovKind::InstanceId);
    for (pixel, (albedo, id)) in albedo.iter().zip(ids).enumerate() {
        let id = usize::try_from(id).expect("every pixel shows an instance");
        assert_eq!(*albedo, expected(id), "pixel {pixel}, instance {id}");
    }
}

fn leaves_out(session: &Session) -> bool {
    session.stats().features_left_out.iter().any(|name| name == "primvars with a value per instance")
}

#[test]
fn each_instance_shows_its_display_color() {
    let (session, request) = shown(
        |db| {
            db.upsert_mesh(bare("/row/board", "/row"));
            db.upsert_instancer(per_instance(row(4), "displayColor", tints(16)));
        },
        1,
    );
    albedo_by_instance(&session, &request, tint);
    assert!(!leaves_out(&session), "it is not left out");
}

#[test]
fn a_primvar_that_nothing_reads_is_left_out() {
    let (session, request) = shown(
        |db| {
            db.upsert_mesh(bare("/row/board", "/row"));
            db.upsert_instancer(per_instance(row(4), "unread", tints(16)));
        },
        1,
    );
    albedo_by_instance(&session, &request, |_| [0.18; 3]);
    assert!(leaves_out(&session), "nobody reads it");
    let (session, request) = shown(
        |db| {
            db.upsert_mesh(MeshDesc { display_color: constant([0.5_f32; 3]), ..bare("/row/board", "/row") });
            db.upsert_instancer(per_instance(row(4), "displayColor", tints(16)));
        },
        1,
    );
    albedo_by_instance(&session, &request, |_| [0.5; 3]);
    assert!(leaves_out(&session), "the mesh has its own");
}

#[test]
fn primvar_readers_get_the_instance_value() {
    let (session, request) = shown(
        |db| {
            db.upsert_material(reading("/m", "diffuseColor", "float3", "tint", &[]));
            db.upsert_mesh(MeshDesc { material: Some("/m".into()), ..bare("/row/board", "/row") });
            let row = per_instance(row(4), "displayColor", vec![[1.0_f32; 3]; 16]);
            db.upsert_instancer(per_instance(row, "tint", tints(16)));
        },
        1,
    );
    albedo_by_instance(&session, &request, tint);
    // Doubles, by indices.
    let (session, request) = shown(
        |db| {
            db.upsert_material(reading("/m", "diffuseColor", "float3", "tint", &[]));
            db.upsert_mesh(MeshDesc { material: Some("/m".into()), ..bare("/row/board", "/row") });
            let mut row = per_instance(row(4), "tint", (0..4).map(|k| tint(k).map(f64::from)).collect::<Vec<_>>());
            row.primvars[0].primvar.indices = Some(TypedArray::of((0..16).map(|k| k % 4).collect::<Vec<i32>>()));
            db.upsert_instancer(row);
        },
        1,
    );
    albedo_by_instance(&session, &request, |id| tint(id % 4));
}

/// The outer one of two levels: four blocks, with a value of each primvar.
fn outer() -> InstancerDesc {
    let outer = per_instance(instancer(prim("/outer", DMat4::IDENTITY), "/outer/row", &grid(2)), "tint", tints(4));
    per_instance(outer, "displayColor", (0..4).map(|k| tint(k + 50)).collect())
}

/// Two levels: four blocks of `inner` x `inner` boards. The outer instancer has all primvars, the inner one what
/// `inside` adds.
fn nested(db: &mut SceneDb, inner: u16, inside: impl Fn(InstancerDesc) -> InstancerDesc) {
    db.upsert_instancer(outer());
    let row = instanced(prim("/outer/row", DMat4::IDENTITY), "/outer");
    db.upsert_instancer(inside(instancer(row, "/outer/row/board", &grid(inner))));
    db.upsert_mesh(bare("/outer/row/board", "/outer/row"));
}

#[test]
fn the_innermost_instancer_that_has_it_wins() {
    let (session, request) = shown(|db| nested(db, 3, |row| row), 1);
    albedo_by_instance(&session, &request, |id| tint(id / 9 + 50));
    let (session, request) =
        shown(|db| nested(db, 3, |row| per_instance(row, "displayColor", (0..9).map(|k| tint(k + 7)).collect())), 1);
    albedo_by_instance(&session, &request, |id| tint(id % 9 + 7));
    let (session, request) = shown(
        |db| {
            db.upsert_material(reading("/m", "diffuseColor", "float3", "tint", &[]));
            nested(db, 3, |row| per_instance(row, "displayColor", tints(9)));
            db.upsert_mesh(MeshDesc { material: Some("/m".into()), ..bare("/outer/row/board", "/outer/row") });
        },
        1,
    );
    albedo_by_instance(&session, &request, |id| tint(id / 9));
}

/// Many boards, in chunks of 16 KiB: nine hundred are too many for one, so records of instancers around theirs are in
/// no chunk.
fn opened(build: impl Fn(&mut SceneDb)) -> (Session, RenderRequest) {
    let session = session(Settings { chunk_size_kib: 16, ..settings(1, 1) });
    session.with_scene(build);
    let request = front();
    render(&session, &request);
    assert!(session.stats().streaming.chunks > 4, "{:?}", session.stats().streaming);
    (session, request)
}

#[test]
fn placements_of_opened_assemblies_keep_their_values() {
    let (session, request) = opened(|db| nested(db, 30, |row| row));
    albedo_by_instance(&session, &request, |id| tint(id / 900 + 50));
}

/// A board behind all others, in the prototype `root` of `instancer`: it has no value of its own and no other
/// instancer, so that one's are read, and are there for all that it places.
fn behind(db: &mut SceneDb, root: &str, instancer: &str) {
    let mut desc = bare(&format!("{root}/behind"), instancer);
    desc.prim.transform = DMat4::from_translation(-DVec3::Z);
    desc.prim.instanced_by = instanced(prim(root, DMat4::IDENTITY), instancer).instanced_by;
    db.upsert_mesh(desc);
}

/// Where nobody reads an outer value it is left out, and cannot win by mistake: here somebody does.
#[test]
fn the_innermost_instancer_wins_over_values_that_others_read() {
    let own = |count: usize| move |row| per_instance(row, "displayColor", (0..count).map(|k| tint(k + 7)).collect());
    let scene = |db: &mut SceneDb, inner: u16| {
        nested(db, inner, own(usize::from(inner * inner)));
        behind(db, "/outer/row", "/outer");
    };
    // In one chunk; then with the outer values in the table of placements, and the inner ones in chunks.
    let (session, request) = shown(|db| scene(db, 3), 1);
    albedo_by_instance(&session, &request, |id| tint(id % 9 + 7));
    let (session, request) = opened(|db| scene(db, 30));
    albedo_by_instance(&session, &request, |id| tint(id % 900 + 7));
    // Three levels, the outer two of them in that table.
    let (session, request) = opened(|db| {
        nested(db, 30, |row| row);
        let all = instancer(prim("/all", DMat4::IDENTITY), "/outer", &grid(2));
        db.upsert_instancer(per_instance(all, "displayColor", (0..4).map(|k| tint(k + 20)).collect()));
        let outer = outer();
        db.upsert_instancer(InstancerDesc { prim: instanced(outer.prim.clone(), "/all"), ..outer });
        behind(db, "/outer", "/all");
    });
    albedo_by_instance(&session, &request, |id| tint(id / 900 % 4 + 50));
}

#[test]
fn display_opacity_is_presence() {
    let (session, request) = shown(
        |db| {
            db.upsert_mesh(bare("/row/board", "/row"));
            db.upsert_instancer(per_instance(row(2), "displayOpacity", vec![0.0_f32, 1.0, 0.25, 1.0]));
        },
        256,
    );
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    let colors: Vec<[f32; 4]> = read(&session, &request, AovKind::Color);
    let mut quarter = 0.0;
    for (pixel, (id, color)) in ids.iter().zip(&colors).enumerate() {
        let [x, y] = place(pixel);
        let number = usize::from(x > 0.0) + 2 * usize::from(y > 0.0);
        assert_eq!(*id, if number == 0 { -1 } else { 5 }, "pixel {pixel}");
        match number {
            0 => assert_eq!(color[3], 0.0, "pixel {pixel}"),
            2 => quarter += color[3] / 256.0,
            _ => assert_eq!(color[3], 1.0, "pixel {pixel}"),
        }
    }
    // 65536 trials: the standard deviation is 0.0017.
    assert!((quarter - 0.25).abs() < 0.008, "{quarter} of the rays met it, not a quarter");
}

#[test]
fn instance_opacity_may_cut_out_whole_instances() {
    let (session, request) = shown(
        |db| {
            let threshold = [("opacityThreshold", ParamValue::Float(0.5))];
            db.upsert_material(reading("/leaf", "opacity", "float", "alpha", &threshold));
            db.upsert_mesh(MeshDesc { material: Some("/leaf".into()), ..bare("/row/board", "/row") });
            db.upsert_instancer(per_instance(row(2), "alpha", vec![0.25_f32, 0.75, 1.0, 0.0]));
        },
        1,
    );
    let ids: Vec<i32> = read(&session, &request, AovKind::PrimId);
    for (pixel, id) in ids.iter().enumerate() {
        let [x, y] = place(pixel);
        assert_eq!(*id, if (x > 0.0) == (y > 0.0) { -1 } else { 5 }, "pixel {pixel}");
    }
}

#[test]
fn an_edit_of_colors_brings_the_chunks_that_have_them_and_no_mesh() {
    let session = session(Settings { chunk_size_kib: 16, ..settings(1, 1) });
    let build = |values: Vec<[f32; 3]>| per_instance(row(32), "displayColor", values);
    session.with_scene(|db| {
        db.upsert_mesh(bare("/row/board", "/row"));
        db.upsert_instancer(build(tints(1024)));
    });
    let request = front();
    render(&session, &request);
    albedo_by_instance(&session, &request, tint);
    let mut values = tints(1024);
    values[1023] = [0.25, 0.5, 0.75];
    session.with_scene(|db| db.upsert_instancer(build(values)));
    render(&session, &request);
    albedo_by_instance(&session, &request, |id| if id == 1023 { [0.25, 0.5, 0.75] } else { tint(id) });
    let bytes = session.timings().uploaded_bytes;
    // One of sixteen chunks: 1024 records of 64 bytes, a box of 24 bytes and three floats for each.
    assert!((1..(64 + 24 + 12) * 160).contains(&bytes), "{bytes} bytes for one colour");
}
