// SPDX-License-Identifier: Apache-2.0
//! What prims do without: each kind of ray in a scene where it alone matters, lights that rays see in different ways,
//! mattes that add up; the same bits everywhere.

use crate::last_bounce::{floor, surface};
use crate::native_traversal::same_bits;
use crate::scenes::{dome, glow, instanced, instancer, mesh, prim, sphere, square, sun};
use crate::support::{color_request, orthographic, perspective, read, read_all, render, request, settings};
use glam::{DMat4, DQuat, DVec3};
use oocpt_abi::{ID_RANKS, IdSlot, PrimMask};
use oocpt_core::scene::{ParamValue, SceneDb};
use oocpt_core::settings::Settings;
use oocpt_core::{LightDesc, LightKind, MeshDesc};
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};
use std::f64::consts::{FRAC_PI_2, PI};

fn session_of(settings: Settings, streams: bool, build: impl FnOnce(&mut SceneDb)) -> Session {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    session
}

fn picture(settings: Settings, view: &RenderRequest, build: impl FnOnce(&mut SceneDb)) -> Vec<[f32; 4]> {
    let session = session_of(settings, false, build);
    render(&session, view);
    read(&session, view, AovKind::Color)
}

fn mean(picture: &[[f32; 4]]) -> f64 {
    picture.iter().map(|pixel| f64::from(pixel[0])).sum::<f64>() / f64::from(u32::try_from(picture.len()).expect("few"))
}

/// A board of two units in the plane z = 0.
fn board(path: &str, place: DMat4, id: i32, size: f32, albedo: f32) -> MeshDesc {
    let corners = [[-size, -size, 0.0], [size, -size, 0.0], [size, size, 0.0], [-size, size, 0.0]];
    mesh(prim(path, place), id, corners.to_vec(), &[vec![0, 1, 2, 3]], albedo)
}

fn downwards() -> DMat4 {
    DMat4::from_rotation_x(-FRAC_PI_2)
}

/// A light with a name.
type LightKindScene<'a> = (&'a str, &'a dyn Fn(&mut SceneDb));

/// A scene in which the prim that is given matters to one kind of ray alone, with its bit.
struct Case {
    what: &'static str,
    bit: PrimMask,
    bounces: u32,
    view: fn() -> RenderRequest,
    thing: fn() -> MeshDesc,
    others: fn(&mut SceneDb),
}

fn at_the_floor() -> RenderRequest {
    color_request(orthographic(DVec3::new(0.0, 5.0, 5.0), DVec3::ZERO, 0.01, [8, 8]))
}

fn cases() -> [Case; 5] {
    let straight = || color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 0.01, [8, 8]));
    [
        Case {
            what: "seen by the camera",
            bit: PrimMask::NO_CAMERA,
            bounces: 0,
            view: straight,
            thing: || board("/thing", DMat4::IDENTITY, 1, 1.0, 0.5),
            others: |db| db.upsert_light(sun(1.0, 0.0, DMat4::IDENTITY)),
        },
        Case {
            what: "a roof",
            bit: PrimMask::NO_SHADOW,
            bounces: 0,
            view: at_the_floor,
            thing: || square(prim("/thing", DMat4::from_translation(DVec3::Y * 3.0)), 2, 0.5),
            others: |db| {
                db.upsert_mesh(board("/floor", downwards(), 1, 9.0, 0.5));
                db.upsert_light(sun(1.0, 0.0, downwards()));
            },
        },
        Case {
            what: "a wall that lights the floor",
            bit: PrimMask::NO_DIFFUSE,
            bounces: 1,
            view: at_the_floor,
            thing: || board("/thing", DMat4::from_translation(DVec3::Z * -1.0), 2, 3.0, 0.8),
            others: |db| {
                db.upsert_mesh(board("/floor", downwards(), 1, 0.1, 0.5));
                // Along the floor, so that it is not lit.
                db.upsert_light(sun(2.0, 0.0, DMat4::IDENTITY));
            },
        },
        Case {
            what: "in a mirror",
            bit: PrimMask::NO_REFLECTION,
            bounces: 1,
            view: at_the_floor,
            thing: || {
                let facing = DMat4::from_translation(DVec3::new(0.0, 5.0, -5.0)) * DMat4::from_rotation_x(PI / 4.0);
                board("/thing", facing, 2, 9.0, 0.5)
            },
            others: |db| {
                floor(db, 0.0);
                db.upsert_light(sun(3.0, 1.0, DMat4::from_rotation_x(PI / 8.0)));
            },
        },
        behind_glass(straight),
    ]
}

fn behind_glass(view: fn() -> RenderRequest) -> Case {
    Case {
        what: "behind glass",
        bit: PrimMask::NO_TRANSMISSION,
        bounces: 3,
        view,
        thing: || board("/thing", DMat4::IDENTITY, 3, 50.0, 0.5),
        others: |db| {
            for (number, (path, z, turned)) in (1..).zip([("/front", 2.0, 0.0), ("/back", 1.0, PI)]) {
                let place = DMat4::from_translation(DVec3::Z * z) * DMat4::from_rotation_x(turned);
                let pane = board(path, place, number, 1.0, 0.5);
                db.upsert_mesh(MeshDesc { material: Some("/glass".into()), ..pane });
            }
            let clear = [("opacity", 0.0), ("ior", 1.5), ("roughness", 0.0)];
            db.upsert_material(surface("/glass", &clear.map(|(name, value)| (name, ParamValue::Float(value)))));
            db.upsert_light(sun(3.0, 1.0, DMat4::from_rotation_x(-1.2)));
        },
    }
}

/// A bit counts where its kind of ray matters, as if the prim were not there, and nowhere else.
#[test]
fn each_kind_of_ray_passes_by_its_own_bit() {
    let bits = [
        PrimMask::NO_CAMERA,
        PrimMask::NO_SHADOW,
        PrimMask::NO_DIFFUSE,
        PrimMask::NO_REFLECTION,
        PrimMask::NO_TRANSMISSION,
    ];
    for Case { what, bit, bounces, view, thing, others } in cases() {
        let view = view();
        let shown = |mask: Option<PrimMask>| {
            mean(&picture(settings(64, bounces), &view, |db| {
                others(db);
                mask.into_iter().for_each(|mask| db.upsert_mesh(MeshDesc { mask, ..thing() }));
            }))
        };
        let (with, without) = (shown(Some(PrimMask::empty())), shown(None));
        assert!((with - without).abs() > 0.01, "{what}: it matters, {with} and {without}");
        for other in bits {
            let expected = if other == bit { without } else { with };
            let given = shown(Some(other));
            assert!((given - expected).abs() < 1e-6 + 0.02 * expected, "{what}, {other:?}: {given}, not {expected}");
        }
        let all = shown(Some(PrimMask::all() - PrimMask::MATTE - PrimMask::SHADOW_CATCHER));
        assert!((all - without).abs() < 1e-6 + 0.02 * without, "{what}: hidden from all rays, {all}, not {without}");
    }
}

/// Lights that a floor sees past a roof which is in the way of some rays alone: what shadow rays see counts.
#[test]
fn shadow_rays_decide_where_a_prim_is_in_the_way_of_some_rays_alone() {
    let lamp = |db: &mut SceneDb| {
        let kind = LightKind::Sphere { radius: 0.5, treat_as_point: false };
        let place = DMat4::from_translation(DVec3::Y * 2.0);
        db.upsert_light(LightDesc { prim: prim("/lamp", place), kind, color: [2.0; 3], ..LightDesc::default() });
    };
    let glowing = |db: &mut SceneDb| {
        let ball = sphere(prim("/ball", DMat4::from_translation(DVec3::Y * 2.0)), 3, 6, 0.0);
        db.upsert_mesh(MeshDesc { material: Some("/glow".into()), ..ball });
        db.upsert_material(glow("/glow", [2.0; 3]));
    };
    let kinds: [LightKindScene<'_>; 4] = [
        ("a lamp", &lamp),
        ("a wide sun", &|db| db.upsert_light(sun(1.0, 40.0, downwards()))),
        ("the sky", &|db| db.upsert_light(LightDesc { camera_visible: false, ..dome([0.5; 3]) })),
        ("a glowing ball", &glowing),
    ];
    for (what, light) in kinds {
        let shown = |mask: Option<PrimMask>| {
            mean(&picture(settings(256, 1), &at_the_floor(), |db| {
                db.upsert_mesh(board("/floor", downwards(), 1, 0.1, 0.5));
                light(db);
                let place = DMat4::from_translation(DVec3::Y * 0.3) * DMat4::from_scale(DVec3::splat(50.0));
                // Black: nothing but the light itself reaches the floor.
                mask.into_iter().for_each(|mask| {
                    db.upsert_mesh(MeshDesc {
                        mask: mask | PrimMask::NO_CAMERA,
                        ..square(prim("/roof", place), 2, 0.0)
                    });
                });
            }))
        };
        let open = shown(None);
        assert!(open > 0.05, "{what} shines: {open}");
        let shadowless = shown(Some(PrimMask::NO_SHADOW));
        assert!((shadowless / open - 1.0).abs() < 0.03, "{what}, no shadow: {shadowless} of {open}");
        let shadow_only = shown(Some(PrimMask::INDIRECT));
        assert!(shadow_only.abs() < 1e-6, "{what}, a shadow alone: {shadow_only} of {open}");
    }
}

/// In a glossy floor things are there or not as reflected rays say, before the sky and before a lamp.
#[test]
fn gloss_shows_what_reflected_rays_see() {
    let ahead = DMat4::from_translation(DVec3::new(0.0, 5.0, -5.0)) * DMat4::from_rotation_x(PI / 4.0);
    let lamp = |db: &mut SceneDb| {
        let kind = LightKind::Sphere { radius: 4.0, treat_as_point: false };
        let place = prim("/lamp", DMat4::from_translation(DVec3::new(0.0, 12.0, -12.0)));
        db.upsert_light(LightDesc {
            prim: place,
            kind,
            color: [1.0; 3],
            camera_visible: false,
            ..LightDesc::default()
        });
    };
    let sky = |db: &mut SceneDb| db.upsert_light(LightDesc { camera_visible: false, ..dome([1.0; 3]) });
    let kinds: [LightKindScene<'_>; 2] = [("the sky", &sky), ("a lamp", &lamp)];
    for (what, light) in kinds {
        let shown = |mask: Option<PrimMask>| {
            mean(&picture(settings(64, 1), &at_the_floor(), |db| {
                floor(db, 0.03);
                light(db);
                let black = || board("/board", ahead, 2, 4.0, 0.0);
                mask.into_iter().for_each(|mask| db.upsert_mesh(MeshDesc { mask, ..black() }));
            }))
        };
        let (open, covered) = (shown(None), shown(Some(PrimMask::empty())));
        assert!(open > 0.5 && covered < 0.1 * open, "{what}: {open}, {covered}");
        let passed = shown(Some(PrimMask::NO_REFLECTION));
        assert!((passed / open - 1.0).abs() < 0.05, "{what}, no reflection: {passed} of {open}");
        let shadowless = shown(Some(PrimMask::NO_SHADOW));
        assert!(shadowless < covered + 0.05 * open, "{what}, no shadow: {shadowless} of {open}");
    }
}

/// The light of a mesh is part of what its prim is: who does not see it is not lit.
#[test]
fn a_mesh_that_is_hidden_from_diffuse_rays_lights_mirrors_alone() {
    let shown = |mask: PrimMask, roughness: Option<f32>| {
        mean(&picture(settings(64, 1), &at_the_floor(), |db| {
            match roughness {
                Some(roughness) => floor(db, roughness),
                None => db.upsert_mesh(board("/floor", downwards(), 1, 1.0, 0.5)),
            }
            let facing = DMat4::from_translation(DVec3::new(0.0, 5.0, -5.0)) * DMat4::from_rotation_x(PI / 4.0);
            let lit = board("/board", facing, 2, 2.0, 0.0);
            db.upsert_mesh(MeshDesc { material: Some("/glow".into()), mask, ..lit });
            db.upsert_material(glow("/glow", [2.0; 3]));
        }))
    };
    let (mirror, lambert) = (shown(PrimMask::empty(), Some(0.0)), shown(PrimMask::empty(), None));
    assert!(mirror > 1.0 && lambert > 0.01, "it shines: {mirror}, {lambert}");
    assert!(shown(PrimMask::NO_DIFFUSE, None).abs() < 1e-9, "not on a floor that does not see it");
    assert!((shown(PrimMask::NO_DIFFUSE, Some(0.0)) - mirror).abs() < 0.02, "a mirror shows it");
    assert!(shown(PrimMask::NO_REFLECTION, Some(0.0)).abs() < 1e-9, "a mirror that does not see it");
    for mask in [PrimMask::NO_CAMERA, PrimMask::NO_TRANSMISSION] {
        let given = shown(mask, None);
        assert!((given / lambert - 1.0).abs() < 0.05, "{mask:?}: {given} of {lambert}");
    }
}

/// Two balls before and behind each other over a floor, glass and metal among them, with these masks.
fn balls(db: &mut SceneDb, [front, back, ground]: [PrimMask; 3]) {
    let steel = [("metallic", 1.0), ("roughness", 0.3)].map(|(name, value)| (name, ParamValue::Float(value)));
    db.upsert_material(surface("/steel", &steel));
    let ball = |path, at, id| sphere(prim(path, DMat4::from_translation(at)), id, 8, 0.6);
    let first = ball("/front", DVec3::new(-0.4, 1.0, 0.8), 4);
    db.upsert_mesh(MeshDesc { mask: front, material: Some("/steel".into()), ..first });
    db.upsert_mesh(MeshDesc { mask: back, ..ball("/back", DVec3::new(0.5, 1.0, -0.8), 9) });
    db.upsert_mesh(MeshDesc { mask: ground, ..board("/floor", downwards(), 1, 4.0, 0.5) });
    db.upsert_light(LightDesc { camera_visible: false, ..dome([0.4, 0.5, 0.7]) });
    db.upsert_light(sun(2.0, 3.0, DMat4::from_rotation_y(0.6) * DMat4::from_rotation_x(-0.9)));
}

fn on_balls() -> RenderRequest {
    color_request(perspective(DVec3::new(2.0, 3.0, 5.0), DVec3::Y * 0.8, 0.9, [40, 32]))
}

/// Each thing alone, with all others as mattes: the pictures add up to the whole, colour and alpha.
#[test]
fn pictures_with_each_others_mattes_add_up() {
    let matte = PrimMask::MATTE;
    let with = |masks| picture(settings(16, 3), &on_balls(), |db| balls(db, masks));
    let whole = with([PrimMask::empty(); 3]);
    let parts = [0, 1, 2].map(|kept| with([0, 1, 2].map(|at| if at == kept { PrimMask::empty() } else { matte })));
    for (pixel, color) in whole.iter().enumerate() {
        for (channel, value) in color.iter().enumerate() {
            let sum: f32 = parts.iter().map(|part| part[pixel][channel]).sum();
            assert!((sum - value).abs() <= 4e-6 * value.max(1.0), "pixel {pixel}, {channel}: {sum}, not {value}");
        }
    }
    let covered = parts.iter().map(|part| part.iter().filter(|color| color[3] > 0.0).count());
    assert!(covered.clone().all(|count| count > 50), "each is seen: {:?}", covered.collect::<Vec<_>>());
    assert!(parts[1].iter().zip(&whole).any(|(part, whole)| part[3] < 0.01 && whole[3] > 0.99), "held out");
    let all = with([matte; 3]);
    assert!(all.iter().all(|color| *color == [0.0; 4]), "nothing is seen of mattes alone");
}

/// A matte is nothing in shares and in filtered images, and light is kept apart without it.
#[test]
fn other_images_have_nothing_of_mattes() {
    let part = AovKind::from_token("lpe:C.*O").expect("an expression");
    let rest = AovKind::from_token("lpe:C.*[^O]").expect("an expression");
    let kinds = [AovKind::Color, AovKind::CryptoObject, AovKind::GeometricNormal, AovKind::PrimId, part, rest];
    let aovs = kinds.map(|kind| AovRequest { kind, clear: [0.0; 4] }).to_vec();
    let view = RenderRequest { aovs, ..on_balls() };
    let of = Settings { filter_aovs: true, ..settings(16, 2) };
    let session = session_of(of, false, |db| balls(db, [PrimMask::MATTE, PrimMask::empty(), PrimMask::empty()]));
    render(&session, &view);
    let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
    let normals = read::<[f32; 3]>(&session, &view, AovKind::GeometricNormal);
    let ids = read::<i32>(&session, &view, AovKind::PrimId);
    let slots = read::<IdSlot>(&session, &view, AovKind::CryptoObject);
    let [glowing, others] = [part, rest].map(|kind| read::<[f32; 3]>(&session, &view, kind));
    let mut held_out = 0;
    for (pixel, ranks) in slots.chunks_exact(ID_RANKS as usize).enumerate() {
        let share: f32 = ranks.iter().map(|slot| slot.weight).sum();
        assert!((share - color[pixel][3]).abs() < 1e-5, "shares are alpha: {share}, {}", color[pixel][3]);
        assert!(ranks.iter().all(|slot| slot.id != 5), "the matte has no share");
        for channel in 0..3 {
            let sum = glowing[pixel][channel] + others[pixel][channel];
            assert!((sum - color[pixel][channel]).abs() < 1e-5, "parts add up");
        }
        if color[pixel][3] == 0.0 && ids[pixel] == 4 {
            held_out += 1;
            assert_eq!(normals[pixel], [0.0; 3], "no normal, though its id is that of the pixel's centre");
        }
    }
    assert!(held_out > 50, "pixels of the matte: {held_out}");
}

/// A lamp before a matte is seen, with what is behind it.
#[test]
fn a_lamp_before_a_matte_covers() {
    let view = color_request(orthographic(DVec3::Z * 5.0, DVec3::ZERO, 0.01, [4, 4]));
    let colors = picture(settings(4, 0), &view, |db| {
        db.upsert_mesh(MeshDesc { mask: PrimMask::MATTE, ..board("/board", DMat4::IDENTITY, 1, 1.0, 0.5) });
        let kind = LightKind::Sphere { radius: 0.5, treat_as_point: false };
        let place = prim("/lamp", DMat4::from_translation(DVec3::Z * 2.0));
        db.upsert_light(LightDesc { prim: place, kind, color: [2.0; 3], camera_visible: true, ..LightDesc::default() });
    });
    assert!(colors.iter().all(|color| color[3] == 1.0 && color[0] > 1.9), "{colors:?}");
}

/// Placements by two levels of instances of meshes with different masks, mattes and glowing ones among them.
fn masked(db: &mut SceneDb) {
    let mirror = [("metallic", 1.0), ("roughness", 0.1)].map(|(name, value)| (name, ParamValue::Float(value)));
    db.upsert_material(surface("/mirror", &mirror));
    db.upsert_material(glow("/glow", [3.0, 2.0, 1.0]));
    let clear = [("opacity", 0.2), ("roughness", 0.0)].map(|(name, value)| (name, ParamValue::Float(value)));
    db.upsert_material(surface("/glass", &clear));
    let places: Vec<_> = (0..6)
        .map(|at| {
            (DVec3::new(f64::from(at % 3) * 2.2 - 2.2, 0.0, f64::from(at / 3) * 2.2), DQuat::IDENTITY, DVec3::ONE)
        })
        .collect();
    db.upsert_instancer(instancer(prim("/all", DMat4::IDENTITY), "/all/group", &places));
    let pair =
        [(DVec3::Y * 0.6, DQuat::IDENTITY, DVec3::splat(0.5)), (DVec3::Y * 1.6, DQuat::IDENTITY, DVec3::splat(0.4))];
    let group = instanced(prim("/all/group", DMat4::IDENTITY), "/all");
    db.upsert_instancer(instancer(group, "/all/group/ball", &pair));
    let ball = sphere(instanced(prim("/all/group/ball", DMat4::IDENTITY), "/all/group"), 2, 6, 0.6);
    db.upsert_mesh(MeshDesc { material: Some("/mirror".into()), mask: PrimMask::NO_SHADOW, ..ball });
    let things = [
        ("/matte", "/mirror", PrimMask::MATTE, DVec3::new(-1.2, 0.8, 3.0)),
        ("/unseen", "/glass", PrimMask::NO_CAMERA | PrimMask::NO_DIFFUSE, DVec3::new(0.4, 0.9, 3.4)),
        ("/lantern", "/glow", PrimMask::NO_REFLECTION, DVec3::new(1.8, 1.6, 2.6)),
        ("/flat", "/glass", PrimMask::NO_TRANSMISSION, DVec3::new(2.4, 0.7, 4.0)),
        ("/caught", "/mirror", PrimMask::SHADOW_CATCHER, DVec3::new(-2.4, 0.7, 4.2)),
    ];
    for (id, (path, material, mask, at)) in (5..).zip(things) {
        let place = DMat4::from_translation(at) * DMat4::from_scale(DVec3::splat(0.5));
        db.upsert_mesh(MeshDesc { material: Some(material.into()), mask, ..sphere(prim(path, place), id, 6, 0.7) });
    }
    db.upsert_mesh(board("/floor", downwards(), 1, 9.0, 0.5));
    db.upsert_light(dome([0.4, 0.5, 0.7]));
    db.upsert_light(sun(2.0, 3.0, DMat4::from_rotation_y(0.6) * DMat4::from_rotation_x(-0.9)));
}

fn on_masked() -> RenderRequest {
    request(perspective(DVec3::new(1.0, 3.5, 8.0), DVec3::new(0.0, 0.8, 1.5), 0.8, [32, 24]))
}

#[test]
fn both_backends_let_the_same_rays_pass() {
    same_bits("masks", masked, &settings(8, 3), false, &on_masked());
    same_bits("masks, streaming", masked, &settings(4, 2), true, &on_masked());
}

#[test]
fn masks_have_the_same_bits_while_streaming() {
    let by = |streams: bool| {
        let session = session_of(settings(8, 3), streams, masked);
        render(&session, &on_masked());
        assert_eq!(session.stats().streaming.in_core, !streams, "as asked for");
        read_all(&session, &on_masked())
    };
    assert!(by(false) == by(true), "the images differ");
}

/// An edit of a mask shows, and what was there before comes back with its bits.
#[test]
fn a_mask_can_be_edited() {
    let view = on_balls();
    let session = session_of(settings(4, 2), false, |db| balls(db, [PrimMask::empty(); 3]));
    let shown = || {
        render(&session, &view);
        read::<[f32; 4]>(&session, &view, AovKind::Color)
    };
    let before = shown();
    let edit = |mask| {
        session.with_scene(|db| {
            db.upsert_mesh(MeshDesc {
                mask,
                ..sphere(prim("/back", DMat4::from_translation(DVec3::new(0.5, 1.0, -0.8))), 9, 8, 0.6)
            });
        });
    };
    edit(PrimMask::NO_CAMERA);
    let hidden = shown();
    assert!(hidden != before, "a mask that is set shows");
    edit(PrimMask::empty());
    assert!(shown() == before, "and goes away");
}
