// SPDX-License-Identifier: Apache-2.0
//! The image of shadows, and shadow catchers: what is in the way and what is not, by channel, with closed forms; the
//! same bits while streaming, and edits.

use crate::scenes::{dome, glow, mesh, prim, sphere, sun};
use crate::support::{color_request, orthographic, read, render, settings};
use glam::{DMat4, DVec3};
use oocpt_abi::PrimMask;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::Settings;
use oocpt_core::{LightDesc, MeshDesc};
use oocpt_render::{AovKind, AovRequest, RenderRequest, Session, SessionOptions};
use std::f64::consts::FRAC_PI_2;

const SIZE: [u32; 2] = [16, 8];

fn session_of(settings: Settings, streams: bool, build: impl FnOnce(&mut SceneDb)) -> Session {
    let options = SessionOptions { validation: true, force_streaming: streams, ..SessionOptions::default() };
    let session = Session::with_options(settings, options);
    session.with_scene(build);
    session
}

/// Looks down at 3.2 units of the floor along x, the origin in the middle.
fn at_the_floor(kinds: &[AovKind]) -> RenderRequest {
    let view = color_request(orthographic(DVec3::new(0.0, 5.0, 5.0), DVec3::ZERO, 1.6, SIZE));
    RenderRequest { aovs: kinds.iter().map(|&kind| AovRequest { kind, clear: [0.0; 4] }).collect(), ..view }
}

fn down() -> DMat4 {
    DMat4::from_rotation_x(-FRAC_PI_2)
}

/// A floor, and a roof one unit above its half of negative x that the camera does not see.
fn below_a_roof(db: &mut SceneDb, floor: PrimMask) {
    let board = |path: &str, y: f32, to: f32, id| {
        let corners = [[-9.0, y, 9.0], [to, y, 9.0], [to, y, -9.0], [-9.0, y, -9.0]];
        mesh(prim(path, DMat4::IDENTITY), id, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5)
    };
    db.upsert_mesh(MeshDesc { mask: floor, ..board("/floor", 0.0, 9.0, 1) });
    db.upsert_mesh(MeshDesc { mask: PrimMask::NO_CAMERA, ..board("/roof", 1.0, 0.0, 2) });
}

fn is_left(pixel: usize) -> bool {
    (pixel % SIZE[0] as usize) < SIZE[0] as usize / 2
}

#[test]
fn shadows_are_what_does_not_arrive_by_channel() {
    let view = at_the_floor(&[AovKind::Color, AovKind::Shadow]);
    let session = session_of(settings(256, 0), false, |db| {
        below_a_roof(db, PrimMask::empty());
        // Red from above, blue from the side below the roof; it arrives at half of its irradiance.
        let slanted = DMat4::from_rotation_z(-60_f64.to_radians()) * down();
        let lit = |path: &str, color, place| LightDesc {
            color,
            ..LightDesc { prim: prim(path, place), ..sun(1.0, 0.0, place) }
        };
        db.upsert_light(lit("/red", [1.0, 0.0, 0.0], down()));
        db.upsert_light(lit("/blue", [0.0, 0.0, 4.0], slanted));
    });
    render(&session, &view);
    let expected = 0.2126 / (0.2126 + 0.0722 * 2.0);
    for (pixel, shadow) in read::<[f32; 4]>(&session, &view, AovKind::Shadow).into_iter().enumerate() {
        let [r, g, b, all] = shadow;
        if is_left(pixel) {
            assert_eq!([r, g, b], [1.0, 0.0, 0.0], "pixel {pixel}: red alone is kept off, and there is no green");
            assert!((all - expected).abs() < 0.06, "pixel {pixel}: of the luminance {all}, not {expected}");
        } else {
            assert_eq!(shadow, [0.0; 4], "pixel {pixel}: all arrives");
        }
    }
}

/// At the foot of an endless wall half of what a floor gets of the sky is missing, whatever the samples are.
#[test]
fn a_wall_keeps_half_of_the_sky_off() {
    let view = at_the_floor(&[AovKind::Shadow]);
    let view = RenderRequest { width: 2, height: 2, ..view };
    let view = RenderRequest { camera: orthographic(DVec3::new(0.0, 5.0, 5.0), DVec3::ZERO, 0.01, [2, 2]), ..view };
    for of in [
        settings(1024, 2),
        Settings { adaptive_sampling: true, pixel_filter: PixelFilterKind::Mitchell, ..settings(1024, 0) },
    ] {
        let session = session_of(of, false, |db| {
            let floor = [[-9.0, 0.0, 9.0], [9.0, 0.0, 9.0], [9.0, 0.0, -9.0], [-9.0, 0.0, -9.0]];
            let wall = [[-900.0, -1.0, -0.1], [900.0, -1.0, -0.1], [900.0, 900.0, -0.1], [-900.0, 900.0, -0.1]];
            for (path, corners, id) in [("/floor", floor, 1), ("/wall", wall, 2)] {
                db.upsert_mesh(mesh(prim(path, DMat4::IDENTITY), id, corners.to_vec(), &[vec![0, 1, 2, 3]], 0.5));
            }
            db.upsert_light(dome([0.5; 3]));
        });
        render(&session, &view);
        for shadow in read::<[f32; 4]>(&session, &view, AovKind::Shadow) {
            assert!(shadow.iter().all(|share| (share - 0.5).abs() < 0.03), "{shadow:?}");
            assert!(shadow.iter().all(|share| (share - shadow[0]).abs() < 1e-5), "a grey sky: {shadow:?}");
        }
    }
}

/// A ball over the floor on its lit side, and a sun.
fn ball_over(db: &mut SceneDb, floor: PrimMask) {
    below_a_roof(db, floor);
    db.upsert_mesh(sphere(
        prim("/ball", DMat4::from_translation(DVec3::new(1.0, 0.4, 0.0)) * DMat4::from_scale(DVec3::splat(0.25))),
        5,
        8,
        0.4,
    ));
    db.upsert_light(sun(1.0, 0.0, down()));
}

#[test]
fn a_catcher_has_the_alpha_of_its_shadow_and_no_colour() {
    let view = at_the_floor(&[AovKind::Color, AovKind::Shadow, AovKind::CryptoObject]);
    let shown = |mask, streams| {
        let session = session_of(settings(16, 2), streams, |db| ball_over(db, mask));
        render(&session, &view);
        let kinds = [AovKind::Color, AovKind::Shadow];
        (
            kinds.map(|kind| read::<[f32; 4]>(&session, &view, kind)),
            read::<[f32; 3]>(&session, &view, AovKind::CryptoObject),
        )
    };
    let ([caught, shadow], ids) = shown(PrimMask::SHADOW_CATCHER, false);
    let ([matte, _], matte_ids) = shown(PrimMask::MATTE | PrimMask::SHADOW_CATCHER, false);
    let mut seen = [0; 3];
    for (pixel, (color, matte)) in caught.iter().zip(&matte).enumerate() {
        assert_eq!(color[..3], matte[..3], "pixel {pixel}: the ball's colour, with the light of the floor");
        if is_left(pixel) {
            seen[0] += 1;
            assert_eq!((color[3], shadow[pixel][3]), (1.0, 1.0), "pixel {pixel}: all is kept off");
        } else if matte[3] == 0.0 && color[3] == 0.0 {
            seen[1] += 1;
        } else {
            seen[2] += 1;
            assert!(color[3] >= matte[3] && color[3] <= 1.0 + 1e-6, "pixel {pixel}: {color:?} over {matte:?}");
        }
    }
    assert!(seen.iter().all(|count| *count > 10), "in shadow, lit, at the ball: {seen:?}");
    assert!(ids == matte_ids, "the catcher is nothing to coverage, as a matte");
    assert!(shown(PrimMask::SHADOW_CATCHER, true) == ([caught, shadow], ids), "the same bits while streaming");
}

/// Two suns of which one is kept off: half of the light, though each sample asks for one of them.
#[test]
fn a_catcher_in_half_of_the_light_is_half_opaque() {
    let view = at_the_floor(&[AovKind::Color]);
    for filter in [PixelFilterKind::Box, PixelFilterKind::Mitchell] {
        let of = Settings { pixel_filter: filter, ..settings(256, 1) };
        let session = session_of(of, false, |db| {
            below_a_roof(db, PrimMask::SHADOW_CATCHER);
            let slanted = DMat4::from_rotation_z(-60_f64.to_radians()) * down();
            db.upsert_light(sun(1.0, 0.0, down()));
            db.upsert_light(LightDesc { prim: prim("/side", slanted), ..sun(2.0, 0.0, slanted) });
        });
        render(&session, &view);
        for (pixel, color) in read::<[f32; 4]>(&session, &view, AovKind::Color).into_iter().enumerate() {
            assert_eq!(color[..3], [0.0; 3], "pixel {pixel}");
            // The column beside the edge has filters that reach over it.
            let column = pixel % SIZE[0] as usize;
            if is_left(pixel) && column < 6 {
                assert!((color[3] - 0.5).abs() < 0.06, "pixel {pixel}: {}", color[3]);
            } else if column > 9 {
                assert_eq!(color[3], 0.0, "pixel {pixel}: no shadow");
            }
        }
    }
}

/// The light of meshes is none of what shadows are told of: a mesh may be in its own way.
#[test]
fn meshes_that_emit_make_no_shadows() {
    let view = at_the_floor(&[AovKind::Color, AovKind::Shadow]);
    let shown = |floor| {
        let session = session_of(settings(16, 0), false, |db| glowing_over(db, floor));
        render(&session, &view);
        [AovKind::Color, AovKind::Shadow].map(|kind| read::<[f32; 4]>(&session, &view, kind))
    };
    let [caught, plain] = [PrimMask::SHADOW_CATCHER, PrimMask::empty()].map(shown);
    assert!(caught.iter().flatten().all(|pixel| *pixel == [0.0; 4]), "nothing is kept off a catcher");
    assert!(plain[1].iter().all(|pixel| *pixel == [0.0; 4]), "nor off a floor");
    assert!(plain[0].iter().any(|pixel| pixel[0] > 0.01), "which is lit");
}

/// A floor below a roof, and a ball above both that glows.
fn glowing_over(db: &mut SceneDb, floor: PrimMask) {
    below_a_roof(db, floor);
    db.upsert_material(glow("/glow", [5.0; 3]));
    let ball = sphere(prim("/bulb", DMat4::from_translation(DVec3::Y * 4.0)), 3, 6, 0.0);
    db.upsert_mesh(MeshDesc { material: Some("/glow".into()), mask: PrimMask::NO_CAMERA, ..ball });
}

/// A live session: a floor becomes a catcher, and a floor again.
#[test]
fn a_catcher_can_be_edited() {
    let view = at_the_floor(&[AovKind::Color]);
    let session = session_of(settings(4, 1), false, |db| ball_over(db, PrimMask::empty()));
    let shown = |mask| {
        session.with_scene(|db| below_a_roof(db, mask));
        render(&session, &view);
        read::<[f32; 4]>(&session, &view, AovKind::Color)
    };
    let (before, caught) = (shown(PrimMask::empty()), shown(PrimMask::SHADOW_CATCHER));
    assert!(before.iter().all(|color| color[3] == 1.0), "a floor");
    let lit = |pixel: &usize| !is_left(*pixel) && caught[*pixel] == [0.0; 4];
    assert!((0..caught.len()).filter(lit).count() > 10, "a catcher, where it is lit");
    let in_shadow = |pixel: &usize| is_left(*pixel) && caught[*pixel] == [0.0, 0.0, 0.0, 1.0];
    assert!((0..caught.len()).filter(in_shadow).count() > 10, "and in shadow");
    assert!(shown(PrimMask::empty()) == before, "and its bits come back");
}
