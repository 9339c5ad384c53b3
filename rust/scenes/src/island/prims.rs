// SPDX-License-Identifier: Apache-2.0
//! The island as prims: the one description behind the scene database and the USD file.
//!
//! Paths are those of the USD stage. `BASE` is `/World/Island`, or `/World/Copies/Island` when an instancer copies it:
//! - `BASE/Unique/NAME`: meshes that appear once (under `--flatten` with copies: prototypes of `BASE/Unique`)
//! - `BASE/Library/NAME`: meshes and clumps, the prototypes (USD: below an empty instancer, so that nothing shows them)
//! - `BASE/SPECIES`, or `BASE/SPECIES_c007` for copy 7: point instancers
//! - `/World/Ocean`, `/World/Sky`, `/World/Sun`, `/World/Camera`

use std::collections::BTreeMap;
use std::sync::Arc;

use anyhow::Result;
use glam::{DMat4, DQuat, DVec3};
use oocpt_core::array::{ElementType, TypedArray};
use oocpt_core::scene::{
    InstancedBy, InstancerDesc, InstancerPrototype, Interpolation, LightDesc, MeshDesc, PrimDesc, Primvar, SceneDb,
    Subdivision,
};
use rustc_hash::FxHashMap;

use super::plants::{Item, Place};
use super::scatter::Places;
use super::soup::Soup;
use super::{Island, Parameters, uniques, view};

/// Distance of copies, in half sides of an island.
const SPACING: f64 = 2.3;
/// Half the side of the ocean, in half sides of an island, for one copy.
const OCEAN: f64 = 60.0;

/// Everything in the scene but the camera.
#[derive(Debug)]
pub struct Prims {
    /// Unique meshes and prototypes.
    pub meshes: Vec<MeshDesc>,
    /// All point instancers.
    pub instancers: Vec<InstancerDesc>,
    /// Sky and sun.
    pub lights: Vec<LightDesc>,
    /// Quads of the unique meshes.
    pub quads: u64,
}

/// A visible prim of the default purpose.
fn prim(path: impl Into<Arc<str>>, transform: DMat4, instanced_by: Vec<InstancedBy>) -> PrimDesc {
    PrimDesc { path: path.into(), transform, instanced_by, ..PrimDesc::default() }
}

/// Where copy `c` of an island goes: an arrowhead of rows that the camera looks along, each copy turned another way.
pub(crate) fn copy_transform(c: u32, half: f64) -> DMat4 {
    let row = c.isqrt();
    let column = f64::from(c - row * row) - f64::from(row);
    let at = DVec3::new(column, 0.0, -f64::from(row)) * (SPACING * half);
    DMat4::from_rotation_translation(DQuat::from_rotation_y(1.7 * f64::from(c)), at)
}

/// Collects prims; remembers who shows what.
struct Builder<'a> {
    island: &'a Island,
    parameters: &'a Parameters,
    base: &'static str,
    prims: Prims,
    /// By the path of a prototype: who shows it.
    shown_by: FxHashMap<Arc<str>, Vec<InstancedBy>>,
}

impl Prims {
    /// Makes the island.
    pub fn new(parameters: &Parameters) -> Result<Self> {
        parameters.check()?;
        let mut island = Island::new(parameters);
        let copied = parameters.copies > 1 && !parameters.flatten;
        let mut builder = Builder {
            island: &island,
            parameters,
            base: if copied { "/World/Copies/Island" } else { "/World/Island" },
            prims: Self { meshes: Vec::new(), instancers: Vec::new(), lights: view::lights(), quads: 0 },
            shown_by: FxHashMap::default(),
        };
        builder.add_species()?;
        builder.add_unique_places()?;
        if !parameters.flatten {
            builder.add_clumps()?;
        }
        let Builder { mut prims, shown_by, base, .. } = builder;
        let land = island.land;
        let mut add = |path: Arc<str>, soup: Soup, place: DMat4| -> Result<()> {
            let instanced_by = shown_by.get(&path).cloned().unwrap_or_default();
            prims.quads += soup.quads.len() as u64;
            let id = i32::try_from(prims.meshes.len())?;
            prims.meshes.push(mesh(prim(path, place, instanced_by), id, soup)?);
            Ok(())
        };
        let is_shared = parameters.flatten && parameters.copies > 1;
        for unique in std::mem::take(&mut island.uniques) {
            let place = if is_shared { DMat4::IDENTITY } else { matrix(&unique.place) };
            add(format!("{base}/Unique/{}", unique.name).into(), unique.soup, place)?;
        }
        for shape in std::mem::take(&mut island.plants.shapes) {
            add(library(base, &shape.name), shape.soup, DMat4::IDENTITY)?;
        }
        let ocean = uniques::ocean(land.half * (OCEAN + 4.0 * f64::from(parameters.copies.isqrt())));
        add("/World/Ocean".into(), ocean, DMat4::IDENTITY)?;
        if copied {
            prims.add_copies(parameters.copies, land.half)?;
        }
        Ok(prims)
    }

    /// Puts all prims into `db`.
    pub fn insert(&self, db: &mut SceneDb) {
        for mesh in &self.meshes {
            db.upsert_mesh(mesh.clone());
        }
        for instancer in &self.instancers {
            db.upsert_instancer(instancer.clone());
        }
        for light in &self.lights {
            db.upsert_light(light.clone());
        }
    }

    /// Bytes of the instance arrays, shared ones counted once.
    pub fn array_bytes(&self) -> u64 {
        let mut seen = rustc_hash::FxHashSet::default();
        let mut bytes = 0;
        for instancer in &self.instancers {
            let InstancerDesc { translations, rotations, scales, prototypes, .. } = instancer;
            let indices = prototypes.iter().map(|prototype| &prototype.indices);
            for array in [translations, rotations, scales].into_iter().flatten().chain(indices) {
                let (address, size) = array.identity();
                bytes += if seen.insert(address) { size as u64 } else { 0 };
            }
        }
        bytes
    }

    /// Makes the island the prototype of an instancer.
    fn add_copies(&mut self, copies: u32, half: f64) -> Result<()> {
        let by = InstancedBy { instancer: "/World/Copies".into(), prototype_root: "/World/Copies/Island".into() };
        let inside = |prim: &mut PrimDesc| {
            if prim.instanced_by.is_empty() && prim.path.starts_with("/World/Copies/Island/") {
                prim.instanced_by.push(by.clone());
            }
        };
        self.meshes.iter_mut().for_each(|mesh| inside(&mut mesh.prim));
        self.instancers.iter_mut().for_each(|instancer| inside(&mut instancer.prim));
        let transforms: Vec<DMat4> = (0..copies).map(|c| copy_transform(c, half)).collect();
        let root = InstancerPrototype { root: by.prototype_root, indices: numbers(0, 1, transforms.len())? };
        let prim = prim(by.instancer, DMat4::IDENTITY, Vec::new());
        self.instancers.push(of_matrices(prim, vec![root], &transforms)?);
        Ok(())
    }
}

impl Builder<'_> {
    /// The instancers of the species, once or once per copy; copies share their arrays unless they are distinct.
    fn add_species(&mut self) -> Result<()> {
        let Parameters { flatten, distinct, .. } = *self.parameters;
        let copies = if flatten { self.parameters.copies } else { 1 };
        for (k, species) in self.island.plants.species.iter().enumerate() {
            let (mut places, mut prototypes) = if flatten { self.flat(k, 0)? } else { self.nested(k)? };
            for copy in 0..copies {
                if distinct && copy > 0 {
                    (places, prototypes) = self.flat(k, copy)?;
                }
                let suffix = if copies > 1 { format!("_c{copy:03}") } else { String::new() };
                let path: Arc<str> = format!("{}/{}{suffix}", self.base, species.name).into();
                let prim = prim(path, copy_transform(copy, self.island.land.half), Vec::new());
                self.add(InstancerDesc { prim, prototypes: prototypes.clone(), ..places.clone() });
            }
        }
        Ok(())
    }

    /// One instance per placement of a species.
    fn nested(&self, k: usize) -> Result<(InstancerDesc, Vec<InstancerPrototype>)> {
        let scatter = self.island.scatter(k, 0);
        let count = usize::try_from(scatter.count)?;
        let places = Places::new(count, 1, |i, put| put(scatter.place(i)));
        let variants = &scatter.species.variants;
        let prototype = |(v, item): (usize, &Item)| {
            let indices = numbers(v, variants.len(), count)?;
            Ok(InstancerPrototype { root: self.root(*item), indices })
        };
        Ok((arrays(places)?, variants.iter().enumerate().map(prototype).collect::<Result<_>>()?))
    }

    /// One instance per mesh of a species: placement i has the instances `i * each ..`.
    fn flat(&self, k: usize, island: u32) -> Result<(InstancerDesc, Vec<InstancerPrototype>)> {
        let scatter = self.island.scatter(k, island);
        let flats: Vec<_> = scatter.species.variants.iter().map(|v| self.island.plants.flat(*v)).collect();
        let (variants, each) = (flats.len(), flats.first().map_or(0, Vec::len));
        let count = usize::try_from(scatter.count)?;
        let places = Places::new(count, each, |i, put| {
            let place = scatter.place(i);
            for (_, inner) in &flats[usize::try_from(i).unwrap_or(0) % variants] {
                put(place.of(inner));
            }
        });
        let shapes = flats.iter().flatten().map(|(shape, _)| (*shape, Vec::new()));
        let mut indices: BTreeMap<usize, Vec<i32>> = shapes.collect();
        for i in 0..count {
            for (part, (shape, _)) in flats[i % variants].iter().enumerate() {
                indices.entry(*shape).or_default().push(i32::try_from(i * each + part)?);
            }
        }
        let prototype = |(shape, mut list): (usize, Vec<i32>)| {
            list.shrink_to_fit();
            let indices = TypedArray::of(list);
            InstancerPrototype { root: self.root(Item::Shape(shape)), indices }
        };
        Ok((arrays(places)?, indices.into_iter().map(prototype).collect()))
    }

    /// One instancer per clump, with its parts.
    fn add_clumps(&mut self) -> Result<()> {
        for (k, clump) in self.island.plants.clumps.iter().enumerate() {
            let places = Places::new(clump.parts.len(), 1, |i, put| {
                put(clump.parts[usize::try_from(i).unwrap_or(0)].1);
            });
            let mut items: Vec<Item> = Vec::new();
            for (item, _) in &clump.parts {
                if !items.contains(item) {
                    items.push(*item);
                }
            }
            let prototype = |item: Item| {
                let numbers = (0_i32..).zip(&clump.parts).filter(|(_, (part, _))| *part == item).map(|(i, _)| i);
                InstancerPrototype { root: self.root(item), indices: TypedArray::of(numbers.collect::<Vec<i32>>()) }
            };
            let prototypes = items.into_iter().map(prototype).collect();
            let prim = prim(self.root(Item::Clump(k)), DMat4::IDENTITY, Vec::new());
            self.add(InstancerDesc { prim, prototypes, ..arrays(places)? });
        }
        // Who shows a clump is known only now.
        for instancer in &mut self.prims.instancers {
            if let Some(by) = self.shown_by.get(&instancer.prim.path) {
                instancer.prim.instanced_by.clone_from(by);
            }
        }
        Ok(())
    }

    /// Copies of a flattened island: its unique meshes are instanced too.
    fn add_unique_places(&mut self) -> Result<()> {
        let Parameters { copies, flatten, .. } = *self.parameters;
        if !flatten || copies == 1 {
            return Ok(());
        }
        let mut transforms = Vec::new();
        let mut prototypes = Vec::new();
        for unique in &self.island.uniques {
            let first = transforms.len();
            transforms.extend((0..copies).map(|c| copy_transform(c, self.island.land.half) * matrix(&unique.place)));
            let root = format!("{}/Unique/{}", self.base, unique.name).into();
            prototypes.push(InstancerPrototype { root, indices: numbers(first, 1, transforms.len())? });
        }
        let prim = prim(format!("{}/Unique", self.base), DMat4::IDENTITY, Vec::new());
        self.add(of_matrices(prim, prototypes, &transforms)?);
        Ok(())
    }

    fn add(&mut self, instancer: InstancerDesc) {
        for prototype in &instancer.prototypes {
            let by = InstancedBy { instancer: instancer.prim.path.clone(), prototype_root: prototype.root.clone() };
            self.shown_by.entry(prototype.root.clone()).or_default().push(by);
        }
        self.prims.instancers.push(instancer);
    }

    /// The path of a prototype.
    fn root(&self, item: Item) -> Arc<str> {
        let plants = &self.island.plants;
        match item {
            Item::Shape(k) => library(self.base, &plants.shapes[k].name),
            Item::Clump(k) => library(self.base, &plants.clumps[k].name),
        }
    }
}

fn library(base: &str, name: &str) -> Arc<str> {
    format!("{base}/Library/{name}").into()
}

fn matrix(place: &Place) -> DMat4 {
    DMat4::from_scale_rotation_translation(DVec3::splat(place.scale), place.turn, place.at)
}

/// Every `step`-th number from `first` to below `end`.
fn numbers(first: usize, step: usize, end: usize) -> Result<TypedArray> {
    let list = (first..end).step_by(step).map(i32::try_from);
    Ok(TypedArray::of(list.collect::<Result<Vec<i32>, _>>()?))
}

/// An instancer with these arrays and nothing else.
fn arrays(places: Places) -> Result<InstancerDesc> {
    Ok(InstancerDesc {
        prim: prim("", DMat4::IDENTITY, Vec::new()),
        prototypes: Vec::new(),
        mask: None,
        translations: Some(TypedArray::of(places.translations)),
        rotations: Some(TypedArray::from_vec(ElementType::Quath, places.rotations)?),
        scales: Some(TypedArray::of(places.scales)),
        transforms: None,
        ..InstancerDesc::default()
    })
}

/// An instancer of rigid or uniformly scaled placements in full precision.
fn of_matrices(prim: PrimDesc, prototypes: Vec<InstancerPrototype>, transforms: &[DMat4]) -> Result<InstancerDesc> {
    let parts: Vec<_> = transforms.iter().map(DMat4::to_scale_rotation_translation).collect();
    let vectors = |part: fn(&(DVec3, DQuat, DVec3)) -> DVec3| {
        TypedArray::of(parts.iter().map(|p| part(p).as_vec3().to_array()).collect::<Vec<_>>())
    };
    let rotations: Vec<[f32; 4]> = parts.iter().map(|p| p.1.as_quat().to_array()).collect();
    Ok(InstancerDesc {
        prim,
        prototypes,
        mask: None,
        translations: Some(vectors(|p| p.2)),
        rotations: Some(TypedArray::from_vec(ElementType::Quatf, rotations)?),
        scales: Some(vectors(|p| p.0)),
        transforms: None,
        ..InstancerDesc::default()
    })
}

/// A mesh prim of a soup.
fn mesh(prim: PrimDesc, prim_id: i32, soup: Soup) -> Result<MeshDesc> {
    let interpolation = match soup.colors.len() {
        1 => Interpolation::Constant,
        n if n == soup.quads.len() => Interpolation::Uniform,
        _ => Interpolation::Vertex,
    };
    let vectors = |interpolation, values| Primvar { interpolation, values: TypedArray::of(values), indices: None };
    let normals = (!soup.normals.is_empty()).then(|| vectors(Interpolation::Vertex, soup.normals));
    Ok(MeshDesc {
        prim,
        prim_id,
        double_sided: true,
        left_handed: false,
        subdivision: Subdivision::None,
        face_vertex_counts: TypedArray::of(vec![4_i32; soup.quads.len()]),
        face_vertex_indices: TypedArray::from_vec(ElementType::I32, soup.quads)?,
        hole_indices: None,
        points: TypedArray::of(soup.points),
        normals,
        display_color: Some(vectors(interpolation, soup.colors)),
        display_opacity: None,
        ..MeshDesc::default()
    })
}
