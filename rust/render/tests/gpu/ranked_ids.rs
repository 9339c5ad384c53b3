// SPDX-License-Identifier: Apache-2.0
//! Images that rank what samples meet: shares by closed forms and by the colour, the same bits everywhere, and nothing
//! of them where nobody asks.

use crate::checkpoints::{Folder, by, open};
use crate::filtered_images::{SAMPLES, SIZE, asking, blurred, card_met, cards, disk, ray, session_of};
use crate::scenes::{features, glow, instanced, instancer, matrix, nested, places, prim, sphere};
use crate::support::{filtering, perspective, read, render, settings};
use glam::{DMat4, DVec3};
use oocpt_abi::sampler::{pixel_seed, sample_4d};
use oocpt_abi::{ID_RANKS, ID_SLOTS, IdSlot};
use oocpt_core::MeshDesc;
use oocpt_core::pixel_filter::PixelFilterKind;
use oocpt_core::scene::SceneDb;
use oocpt_core::settings::{Settings, TraversalKind};
use oocpt_render::{AovKind, RenderRequest, Session};
use std::collections::BTreeMap;

const IDS: [AovKind; 2] = [AovKind::CryptoObject, AovKind::CryptoMaterial];

fn slots(session: &Session, view: &RenderRequest, kind: AovKind) -> Vec<Vec<IdSlot>> {
    let all = read::<IdSlot>(session, view, kind);
    all.chunks_exact(ID_RANKS as usize).map(<[IdSlot]>::to_vec).collect()
}

fn view_of_nested(kinds: &[AovKind], size: [u32; 2]) -> RenderRequest {
    asking(perspective(DVec3::new(3.0, 4.0, 6.0), DVec3::new(0.0, 0.5, 0.0), 0.7, size), kinds, [0.0; 4])
}

#[test]
fn shares_are_those_of_the_samples_that_meet_a_prim() {
    let camera = blurred();
    let view = asking(camera.clone(), &IDS[..1], [0.0; 4]);
    let session = session_of(settings(SAMPLES, 0), false, cards);
    render(&session, &view);
    let mut wrong = 0;
    let mut mixed = 0;
    for (at, ranks) in (0..).zip(slots(&session, &view, AovKind::CryptoObject)) {
        let [x, y] = [at % SIZE[0], at / SIZE[0]];
        let mut counts = [0_u32; 2];
        for sample in 0..SAMPLES {
            let u = sample_4d(sample, 0, pixel_seed(x, y, 0));
            let p = [f64::from(x) + f64::from(u[0]), f64::from(y) + f64::from(u[1])];
            if let Some(card) = card_met(ray(&camera, p, disk([u[2], u[3]]))) {
                counts[card] += 1;
            }
        }
        let mut expected: BTreeMap<u32, u32> = BTreeMap::new();
        for (id, count) in (1..).zip(counts).filter(|(_, count)| *count > 0) {
            expected.insert(id, count);
        }
        #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "whole numbers of samples")]
        let found: BTreeMap<u32, u32> = ranks
            .iter()
            .filter(|slot| slot.id != 0)
            .map(|slot| (slot.id, (f64::from(slot.weight) * f64::from(SAMPLES)).round() as u32))
            .collect();
        assert!(ranks.windows(2).all(|pair| pair[0].weight >= pair[1].weight), "largest first: {ranks:?}");
        wrong += u32::from(found != expected);
        mixed += u32::from(expected.len() == 2);
    }
    // A sample at an edge to the last bit may be on the other side in single precision.
    assert!(wrong <= 1, "{wrong} pixels differ");
    assert!(mixed > 10, "both cards are seen in some pixels: {mixed}");
}

/// The number of a material is that of its rank, where it has the pixel alone; -1 where there is none.
#[test]
fn materials_have_the_numbers_of_their_ranks() {
    let kinds = [AovKind::Color, AovKind::CryptoMaterial, AovKind::MaterialId];
    let view = view_of_nested(&kinds, SIZE);
    let session = session_of(settings(8, 0), false, |db| {
        for (id, material) in (1..).zip([Some("/red"), None, Some("/blue"), Some("/red")]) {
            let place = DMat4::from_translation(DVec3::new(2.0 * f64::from(id) - 5.0, 0.5, 0.0));
            let ball = sphere(prim(&format!("/ball{id}"), place), id, 8, 0.6);
            db.upsert_mesh(MeshDesc { material: material.map(Into::into), ..ball });
        }
        db.upsert_material(glow("/red", [1.0, 0.0, 0.0]));
        db.upsert_material(glow("/blue", [0.0, 0.0, 1.0]));
    });
    render(&session, &view);
    let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
    let numbers = read::<i32>(&session, &view, AovKind::MaterialId);
    let mut seen: BTreeMap<i32, u32> = BTreeMap::new();
    for ((color, number), ranks) in color.iter().zip(numbers).zip(slots(&session, &view, AovKind::CryptoMaterial)) {
        // Eight samples of one ball: so is the centre.
        if color[3] == 1.0 && (ranks[0].weight == 1.0 || ranks[0].id == 0) {
            assert_eq!(Some(number), i32::try_from(ranks[0].id).ok().map(|id| id - 1), "{color:?}");
            *seen.entry(number).or_default() += 1;
        }
    }
    let none = seen.remove(&-1).unwrap_or(0);
    assert!(none > 9 && seen.len() == 2 && seen.values().all(|&pixels| pixels > 9), "{none}, {seen:?}");
}

/// What is seen covers as much as the alpha of the colour says, whatever weighs the samples.
#[test]
fn shares_add_up_to_alpha() {
    let kinds = [AovKind::Color, AovKind::CryptoObject, AovKind::CryptoMaterial];
    let view = view_of_nested(&kinds, SIZE);
    for (filter, adaptive, streams) in [
        (PixelFilterKind::Box, false, false),
        (PixelFilterKind::Mitchell, false, true),
        (PixelFilterKind::Gaussian, true, false),
    ] {
        let of = Settings {
            pixel_filter: filter,
            adaptive_sampling: adaptive,
            dome_light_camera_visible: false,
            ..settings(32, 0)
        };
        let session = session_of(of, streams, nested);
        render(&session, &view);
        let color = read::<[f32; 4]>(&session, &view, AovKind::Color);
        let objects = slots(&session, &view, AovKind::CryptoObject);
        let mut several = 0;
        for (pixel, (color, ranks)) in color.iter().zip(&objects).enumerate() {
            let sum: f32 = ranks.iter().map(|slot| slot.weight).sum();
            let full = ranks.iter().all(|slot| slot.id != 0);
            // Mitchell's filter weighs alpha with its sign.
            let is_alpha = (sum - color[3]).abs() < 1e-5 || filter == PixelFilterKind::Mitchell && color[3] != 1.0;
            assert!(full || is_alpha, "{filter:?}, pixel {pixel}: {sum} of {}", color[3]);
            several += usize::from(ranks[1].id != 0);
        }
        assert!(several > 50, "pixels with several things: {several}");
        let instances: std::collections::BTreeSet<(u32, u32)> =
            objects.iter().flatten().filter(|slot| slot.id != 0).map(|slot| (slot.id, slot.instance)).collect();
        assert!(instances.len() > 8, "placements are told apart: {instances:?}");
    }
}

/// The balls of `nested`, each a mesh with an id of its own: 100 and the flat index of the placement.
fn balls_apart(db: &mut SceneDb) {
    let [outer, inner] = places();
    for (place, id) in outer.iter().flat_map(|o| inner.iter().map(move |i| matrix(o) * matrix(i))).zip(100..) {
        db.upsert_mesh(sphere(prim(&format!("/ball{id}"), place), id, 8, 0.6));
    }
}

#[test]
fn placements_have_the_shares_of_meshes_in_their_places() {
    let view = view_of_nested(&IDS[..1], SIZE);
    let of = |build: fn(&mut SceneDb)| {
        let session = session_of(settings(64, 0), false, build);
        render(&session, &view);
        slots(&session, &view, AovKind::CryptoObject)
    };
    let (nested, apart) = (of(nested_balls), of(balls_apart));
    // A slot has the id + 1.
    let shares = |ranks: &[IdSlot], number: fn(&IdSlot) -> u32| -> BTreeMap<u32, u32> {
        ranks.iter().filter(|slot| slot.id != 0).map(|slot| (number(slot), slot.weight.to_bits())).collect()
    };
    let pairs = nested.iter().zip(&apart);
    let differs = pairs.filter(|(a, b)| shares(a, |slot| slot.instance) != shares(b, |slot| slot.id - 101)).count();
    assert!(differs <= 2, "{differs} pixels: an edge may be on the other side of a sample");
    let mixed = apart.iter().filter(|ranks| ranks[1].id != 0).count();
    assert!(mixed > 5, "pixels with several balls: {mixed}");
}

fn nested_balls(db: &mut SceneDb) {
    let [outer, inner] = places();
    db.upsert_instancer(instancer(prim("/outer", DMat4::IDENTITY), "/outer/clump", &outer));
    let clump = instanced(prim("/outer/clump", DMat4::IDENTITY), "/outer");
    db.upsert_instancer(instancer(clump, "/outer/clump/ball", &inner));
    db.upsert_mesh(sphere(instanced(prim("/outer/clump/ball", DMat4::IDENTITY), "/outer/clump"), 2, 8, 0.6));
}

#[test]
fn ranked_ids_have_the_same_bits_everywhere() {
    let ways = [
        ("shaders", by(TraversalKind::Compute), false),
        ("host", by(TraversalKind::Auto), false),
        ("streaming", by(TraversalKind::Compute), true),
        ("at a small budget", Settings { geometry_budget_kib: 64, ..by(TraversalKind::Compute) }, true),
    ];
    let view = view_of_nested(&[AovKind::Color, AovKind::Normal, IDS[0], IDS[1]], [45, 31]);
    for (name, build, samples) in [("nested", nested as fn(&mut SceneDb), 64), ("features", features, 9)] {
        let images = ways.clone().map(|(_, way, streams)| {
            let session = open(build, filtering(Settings { samples_per_pixel: samples, ..way }), streams);
            render(&session, &view);
            IDS.map(|kind| read::<u8>(&session, &view, kind))
        });
        for ((way, ..), others) in ways.iter().zip(&images) {
            assert!(images[0] == *others, "{name}, {way}");
        }
    }
}

#[test]
fn a_checkpoint_holds_them() {
    assert_kept_by_a_checkpoint("ranked-ids", IDS[0]);
}

/// A render of an image that goes on from a checkpoint has the bits of one that does not; files have this name.
pub(crate) fn assert_kept_by_a_checkpoint(name: &str, kind: AovKind) {
    let folder = Folder::new(name);
    let checkpoint = folder.file("samples").display().to_string();
    let view = view_of_nested(&[AovKind::Color, kind], SIZE);
    let of = |samples: u32, checkpoint: &str| {
        let way = by(TraversalKind::Compute);
        let session =
            open(nested, Settings { samples_per_pixel: samples, checkpoint: checkpoint.to_owned(), ..way }, false);
        render(&session, &view);
        (read::<u8>(&session, &view, kind), session.stats().samples_kept)
    };
    let (whole, _) = of(16, "");
    of(8, &checkpoint);
    let (resumed, kept) = of(16, &checkpoint);
    assert_eq!(kept, 8, "samples of the checkpoint");
    assert!(resumed == whole, "the same bits");
}

/// Which passes of these names a render of images of the nested scene has, and the bytes of its sums.
pub(crate) fn passes_and_sums(kinds: &[AovKind], names: [&str; 3]) -> ([bool; 3], u64) {
    let session = session_of(settings(2, 1), false, nested);
    render(&session, &view_of_nested(kinds, SIZE));
    let inventory = session.stats().inventory;
    let passes = names.map(|name| inventory.passes.iter().any(|pass| pass.name == name && pass.made));
    let sums = inventory.buffers.iter().filter(|buffer| buffer.name == "plane_sums");
    (passes, sums.map(|buffer| buffer.bytes).sum::<u64>())
}

#[test]
fn ranked_ids_exist_only_on_request() {
    let made = |kinds: &[AovKind]| passes_and_sums(kinds, ["rank_ids", "resolve_ids", "sum_planes"]);
    assert_eq!(made(&[AovKind::Color, AovKind::Depth]), ([false; 3], 0));
    let bytes = u64::from(SIZE[0] * SIZE[1] * ID_SLOTS) * size_of::<IdSlot>() as u64;
    assert_eq!(made(&[AovKind::Color, IDS[1]]), ([true, true, false], bytes));
}
