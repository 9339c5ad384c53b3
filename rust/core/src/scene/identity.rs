// SPDX-License-Identifier: Apache-2.0
//! A hash of the scene that films are known by: two scenes with the same hash have the same samples.
//!
//! It covers what the host has given of all prims that are not hidden by themselves: paths, placements and motion;
//! meshes, curves, points, solids and instancers with the content of their arrays; materials with their networks;
//! lights; collections; the purposes that are shown; and the world point that is the origin of the scene's frame. Of
//! the files that materials and lights name it covers what the caller says of them, which is to be their content, and
//! not where they are. It covers more than samples depend on (primvars that nothing reads, prims hidden by another
//! one), never less. Not covered: camera, settings and version, which are compared by name.
//!
//! Plain fields go into the hash as the text of their `Debug`, so that a new field is in it without being listed here;
//! floats are written there such that no two are alike. Arrays are hashed once each, however many prims share them: by
//! content, type and length. Nothing depends on addresses, on the order of hash tables or on the history of edits,
//! except that a scene that was moved far keeps its origin.

use std::fmt::{Debug, Write as _};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use rustc_hash::FxHashMap;
use xxhash_rust::xxh3::{Xxh3, xxh3_128};

use super::lent::{instancer_arrays, mesh_arrays};
use super::{SceneDb, canonical_purpose};
use crate::array::TypedArray;
use crate::desc::{AssetRef, LightDesc, LightKind, MaterialDesc, MeshDesc, ParamValue, PrimDesc};

/// Arrays of fewer bytes are hashed each time.
const SMALL: usize = 256;
/// Tables of hashes of arrays, each with its own lock.
const SHARDS: usize = 64;

/// Says what a file contains: a text that is the same wherever the file is, and another one if its content is.
pub type AssetContent<'a> = dyn Fn(&AssetRef) -> String + Sync + 'a;

/// Address, length and type of an array.
type ArrayPlace = (usize, usize, u8);

/// Hashes of arrays, in several tables, so that threads seldom wait for each other.
#[derive(Debug)]
struct ArrayHashes([Mutex<FxHashMap<ArrayPlace, u128>>; SHARDS]);

impl ArrayHashes {
    fn of(&self, array: &TypedArray) -> u128 {
        let (address, length) = array.identity();
        let hash = || xxh3_128(array.view().bytes());
        if length < SMALL {
            return hash();
        }
        let shard = &self.0[(address >> 6) % SHARDS];
        let key = (address, length, array.element() as u8);
        let known = shard.lock().unwrap_or_else(PoisonError::into_inner).get(&key).copied();
        // Nobody waits for another thread's hash of the same array.
        known.unwrap_or_else(|| {
            let hash = hash();
            shard.lock().unwrap_or_else(PoisonError::into_inner).insert(key, hash);
            hash
        })
    }
}

/// Takes text in without keeping it.
struct HashedText<'a>(&'a mut Xxh3);

impl std::fmt::Write for HashedText<'_> {
    fn write_str(&mut self, text: &str) -> std::fmt::Result {
        self.0.update(text.as_bytes());
        Ok(())
    }
}

/// Adds the text of a value, and an end that no text has.
fn add(hasher: &mut Xxh3, value: &impl Debug) {
    // Nothing that is written here fails.
    let _written = write!(HashedText(hasher), "{value:?}");
    hasher.update(&[u8::MAX]);
}

/// The hash of a description: its text, which has types and lengths of its arrays, and their contents in order.
fn of_prim<'a>(desc: &impl Debug, arrays: impl Iterator<Item = &'a TypedArray>, hashes: &ArrayHashes) -> u128 {
    let mut hasher = Xxh3::new();
    add(&mut hasher, desc);
    for array in arrays {
        hasher.update(&[array.element() as u8]);
        hasher.update(&hashes.of(array).to_le_bytes());
    }
    hasher.digest128()
}

/// Arrays that the host gives with a solid, whose others are made.
fn solid_arrays(desc: &MeshDesc) -> impl Iterator<Item = &TypedArray> {
    let named = desc.primvars.iter().map(|named| &named.primvar);
    let given = [&desc.display_color, &desc.display_opacity].into_iter().flatten().chain(named);
    given.flat_map(|primvar| [&primvar.values].into_iter().chain(&primvar.indices)).filter(|_| desc.solid.is_some())
}

/// Puts what files contain in the place of their names.
fn with_content(asset: &mut AssetRef, content: &AssetContent<'_>) {
    let text = content(asset);
    *asset = AssetRef { authored: "".into(), resolved: text.into() };
}

/// A path without the address of a renderer: Hydra's task controller names the prim above the light at the camera by
/// it, so that every process has another one.
fn stable_path(path: &str) -> &str {
    let below = path.strip_prefix("/_UsdImaging_").and_then(|rest| rest.find('/').map(|at| &rest[at..]));
    below.unwrap_or(path)
}

fn light_with_content(light: &LightDesc, content: &AssetContent<'_>) -> LightDesc {
    let mut light = light.clone();
    light.prim.path = stable_path(&light.prim.path).into();
    let texture = match &mut light.kind {
        LightKind::Dome { texture, .. } | LightKind::Rect { texture, .. } => texture.as_mut(),
        _ => None,
    };
    let profile = light.shaping.as_mut().and_then(|shaping| shaping.ies.as_mut());
    texture.into_iter().chain(profile).for_each(|asset| with_content(asset, content));
    light
}

fn material_with_content(material: &MaterialDesc, content: &AssetContent<'_>) -> MaterialDesc {
    let mut material = material.clone();
    let params = material.nodes.iter_mut().flat_map(|node| &mut node.params);
    for param in params {
        if let ParamValue::Asset(asset) = &mut param.value {
            with_content(asset, content);
        }
    }
    material
}

impl SceneDb {
    /// The hash of the scene as it was last committed; `content` says what the files that it names contain.
    #[must_use]
    pub fn identity(&self, content: &AssetContent<'_>) -> u128 {
        let hashes = ArrayHashes(std::array::from_fn(|_| Mutex::default()));
        let shows = |prim: &PrimDesc| {
            let purpose = canonical_purpose(&prim.purpose);
            prim.visible && (self.purposes.is_empty() || self.purposes.iter().any(|shown| shown == purpose))
        };
        let meshes: Vec<u128> = self
            .meshes
            .par_iter()
            .filter(|(_, entry)| shows(&entry.desc.prim))
            .map(|(_, entry)| of_prim(&entry.desc, mesh_arrays(&entry.desc).chain(solid_arrays(&entry.desc)), &hashes))
            .collect();
        let instancers: Vec<u128> = self
            .instancers
            .par_iter()
            .map(|(_, entry)| of_prim(&entry.desc, instancer_arrays(&entry.desc), &hashes))
            .collect();
        let none = std::iter::empty;
        let materials: Vec<u128> = self
            .materials
            .par_iter()
            .map(|(_, entry)| of_prim(&material_with_content(&entry.desc, content), none(), &hashes))
            .collect();
        let lights: Vec<u128> = self
            .lights
            .par_iter()
            .map(|(_, light)| of_prim(&light_with_content(light, content), none(), &hashes))
            .collect();
        let mut hasher = Xxh3::new();
        add(&mut hasher, &(&self.purposes, self.snapshot.origin.to_array()));
        for prims in [meshes, instancers, materials, lights] {
            hasher.update(&(prims.len() as u64).to_le_bytes());
            prims.iter().for_each(|hash| hasher.update(&hash.to_le_bytes()));
        }
        hasher.digest128()
    }
}
