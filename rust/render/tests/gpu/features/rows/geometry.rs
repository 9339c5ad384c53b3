// SPDX-License-Identifier: Apache-2.0
//! Rows of the view and of geometry.

use super::super::scenes::{bare, nested, placed, turning};
use super::{Also, BARE, OF_PARTS, Row};
use crate::materials::{coordinates, with};
use crate::scenes::{constant, deforming};
use oocpt_abi::PrimMask;
use oocpt_core::TypedArray;
use oocpt_core::scene::{Interpolation, MeshDesc, NamedPrimvar, PrimShape, SceneDb, Subdivision};

/// A board with a primvar that no material reads.
pub(super) fn dusty(db: &mut SceneDb) {
    let dust = constant(0.5_f32).map(|primvar| NamedPrimvar { name: "dust".into(), primvar });
    db.upsert_mesh(MeshDesc { primvars: dust.into_iter().collect(), ..bare("/board") });
}

pub(crate) const ROWS: &[Row] = &[
    Row {
        what: "points",
        build: |db| db.upsert_mesh(MeshDesc { shape: PrimShape::Points, ..bare("/board") }),
        features: &["POINTS"],
        ..BARE
    },
    Row {
        what: "toy boxes",
        build: |db| {
            let corners = TypedArray::of(vec![[-1.0_f32; 3], [1.0; 3]]);
            db.upsert_mesh(MeshDesc { shape: PrimShape::ToyBoxes, points: corners, ..bare("/board") });
        },
        features: &["TOY_BOX"],
        ..BARE
    },
    Row {
        what: "normals",
        build: |db| db.upsert_mesh(MeshDesc { subdivision: Subdivision::CatmullClark, ..bare("/board") }),
        features: &["NORMALS"],
        buffers: &[&["mesh normals", "mesh corners"]],
        ..BARE
    },
    Row {
        what: "a colour",
        build: |db| db.upsert_mesh(MeshDesc { display_color: constant([0.5_f32; 3]), ..bare("/board") }),
        features: &["COLORS"],
        buffers: &[&["mesh displayColor"]],
        primvars: &["displayColor"],
        ..BARE
    },
    Row {
        what: "an opacity",
        build: |db| db.upsert_mesh(MeshDesc { display_opacity: constant(0.5_f32), ..bare("/board") }),
        features: &["OPACITY"],
        buffers: &[&["mesh displayOpacity"]],
        primvars: &["displayOpacity"],
        ..BARE
    },
    Row {
        what: "something that moves",
        build: turning,
        features: &["MOTION"],
        buffers: &[&["instance motion"]],
        ..BARE
    },
    Row {
        what: "points that move",
        build: |db| {
            db.upsert_mesh(deforming(bare("/board"), &[0.0, 1.0], &|p, time| (p.as_dvec3() * (1.0 + time)).as_vec3()))
        },
        features: &["DEFORMATION"],
        ..BARE
    },
    Row {
        what: "a camera that moves",
        features: &["CAMERA_MOTION"],
        buffers: &[&["camera motion"]],
        also: Also::Moves,
        ..BARE
    },
    Row {
        what: "motion over the image",
        features: &["CAMERA_MOTION", "MOTION_VECTORS"],
        passes: &[&["generate_aov_rays", "shade_aovs"]],
        buffers: &[&["camera motion", "image motion"]],
        also: Also::Motion,
        ..BARE
    },
    Row {
        what: "clipping planes",
        features: &["CLIPPING"],
        buffers: &[&["clipping planes"]],
        also: Also::Clips,
        ..BARE
    },
    Row { what: "a lens", features: &["LENS"], also: Also::Lens, ..BARE },
    Row {
        what: "depth",
        passes: &[&["generate_aov_rays", "shade_aovs"]],
        buffers: &[&["image depth"]],
        also: Also::Depth,
        ..BARE
    },
    Row {
        what: "albedo",
        features: &["SHADED_AOVS"],
        passes: &[&["generate_aov_rays", "shade_aovs"]],
        buffers: &[&["image albedo"]],
        also: Also::Albedo,
        ..BARE
    },
    Row {
        what: "a primvar",
        build: dusty,
        features: &["SHADED_AOVS"],
        passes: &[&["generate_aov_rays", "shade_aovs"]],
        buffers: &[&["mesh primvars", "image primvars:dust"]],
        primvars: &["dust"],
        also: Also::Primvar,
    },
    Row { what: "a primvar that no image shows", build: dusty, ..BARE },
    Row {
        what: "filtered albedo",
        features: &["SHADED_AOVS"],
        passes: &[&["shade_aovs", "sum_planes", "resolve_planes"]],
        buffers: &[&["image albedo", "plane_values", "plane_sums"]],
        also: Also::Filtered,
        ..BARE
    },
    Row {
        what: "objects by coverage",
        features: &["ID_RANKS"],
        passes: &[&["shade_aovs", "rank_ids", "resolve_ids"]],
        buffers: &[&["image cryptoObject", "plane_values", "plane_sums"]],
        also: Also::Ids,
        ..BARE
    },
    Row {
        what: "deep samples",
        features: &["DEEP"],
        passes: &[&["shade_aovs", "merge_deep", "resolve_deep"]],
        buffers: &[&["image deep:16:0.001:0", "plane_values", "plane_sums"]],
        also: Also::Deep,
        ..BARE
    },
    Row {
        what: "a light path expression",
        features: &["PATH_EXPRESSIONS"],
        passes: &[&["sum_planes", "resolve_planes"]],
        buffers: &[&["image lpe:C<RD>L", "plane_values", "plane_sums"], OF_PARTS],
        also: Also::Parts,
        ..BARE
    },
    Row {
        what: "shadows",
        features: &["SHADOW_SUMS"],
        passes: &[&["sum_planes", "resolve_planes"]],
        buffers: &[&["image shadow", "plane_values", "plane_sums"]],
        also: Also::Shadows,
        ..BARE
    },
    Row {
        what: "waits for loads",
        features: &["LOAD_WAITS"],
        passes: &[&["sum_planes", "resolve_planes"]],
        buffers: &[&["image loadWaits", "plane_values", "plane_sums"]],
        also: Also::Waits,
        ..BARE
    },
    Row {
        what: "a shadow catcher",
        build: |db| db.upsert_mesh(MeshDesc { mask: PrimMask::SHADOW_CATCHER, ..bare("/board") }),
        features: &["PRIM_MASKS", "SHADOW_SUMS"],
        passes: &[&["sum_planes", "resolve_planes"]],
        buffers: &[&["masks of prims", "light_paths", "image shadowCatcher", "plane_values", "plane_sums"]],
        ..BARE
    },
    Row {
        what: "errors of pixels",
        passes: &[&["tell_spread"]],
        buffers: &[&["image error"]],
        also: Also::Errors,
        ..BARE
    },
    Row {
        what: "sample counts",
        passes: &[&["count_samples"]],
        buffers: &[&["image sampleCount"]],
        also: Also::Counts,
        ..BARE
    },
    Row { what: "a part of a film", passes: &[&["sum_exact"]], also: Also::FilmPart, ..BARE },
    Row {
        what: "adaptive sampling",
        features: &["ADAPTIVE"],
        buffers: &[&["adaptive", "entries", "estimates"]],
        also: Also::Adaptive,
        ..BARE
    },
    Row {
        what: "a limit of diffuse bounces",
        features: &["BOUNCE_KINDS"],
        buffers: &[&["bounce_kinds"]],
        also: Also::Kinds,
        ..BARE
    },
    Row {
        what: "a filter of pixels",
        features: &["PIXEL_FILTER"],
        buffers: &[&["pixel filter"]],
        also: Also::Filter,
        ..BARE
    },
    Row {
        what: "a prim that the camera does not see",
        build: |db| db.upsert_mesh(MeshDesc { mask: PrimMask::NO_CAMERA, ..bare("/board") }),
        features: &["PRIM_MASKS"],
        buffers: &[&["masks of prims", "light_paths"]],
        ..BARE
    },
    Row { what: "nesting", build: nested, features: &["INSTANCING"], ..BARE },
    Row {
        what: "a primvar by instance",
        build: |db| placed(db, "displayColor", vec![[0.5_f32; 3]; 2]),
        features: &["INSTANCE_PRIMVARS"],
        buffers: &[&["instance primvars"]],
        primvars: &["displayColor"],
        ..BARE
    },
    Row {
        what: "opacity by instance",
        build: |db| placed(db, "displayOpacity", vec![0.5_f32; 2]),
        features: &["OPACITY", "INSTANCE_PRIMVARS", "INSTANCE_OPACITY"],
        buffers: &[&["instance primvars"]],
        primvars: &["displayOpacity"],
        ..BARE
    },
    Row {
        what: "a primvar by instance that nothing reads",
        build: |db| placed(db, "unread", vec![0.5_f32; 2]),
        ..BARE
    },
    Row {
        what: "a primvar that nothing reads",
        build: |db| db.upsert_mesh(with(bare("/board"), "st", Interpolation::Vertex, coordinates(|st| st))),
        ..BARE
    },
];
