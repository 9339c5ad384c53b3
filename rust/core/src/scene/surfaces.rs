// SPDX-License-Identifier: Apache-2.0
//! Resolves material bindings of meshes and subsets to the tables of a snapshot, and decides what the meshes have to
//! build for their materials. A material is compiled once after an edit, and only if a mesh shows it.

use oocpt_abi::{
    MAX_PRIM_ID, MaterialFlags, MaterialInput, NAME_DISPLAY_COLOR, NAME_DISPLAY_OPACITY, NO_MATERIAL, PrimMask,
};
use std::collections::BTreeMap;
use std::sync::Arc;

use rustc_hash::{FxHashMap, FxHashSet};

use super::entries::{InstancerEntry, MeshEntry, SlotCutouts};
use super::linked_prims::LinkedPrims;
use super::mesh_lights::{MESH_LIGHT, MeshLight};
use super::report::CommitReports;
use super::snapshot::{PrimRecord, SurfaceTables};
use crate::desc::{LightDesc, MaterialDesc, MeshDesc, PrimShape};
use crate::instancing::instance_primvars::{InstancePrimvar, MemberPrimvar};
use crate::material::{
    ACROSS_NAME, CompiledMaterial, Cutout, InputValue, Material, PTEX_SET, TextureRef, built_in, compile,
};
use crate::mesh::{SlotDisplacements, WantedPrimvar};
use oocpt_materialx::program::{ProgramLookup, REGISTERS};

/// The meshes that tables are made for.
#[derive(Clone, Copy)]
pub(crate) struct ShownMeshes<'a> {
    pub(crate) meshes: &'a BTreeMap<Arc<str>, MeshEntry>,
    pub(crate) lights: &'a FxHashMap<Arc<str>, MeshLight>,
    pub(crate) paths: &'a FxHashSet<Arc<str>>,
    pub(crate) linked: &'a LinkedPrims,
}

/// A material prim.
#[derive(Debug)]
pub(crate) struct MaterialEntry {
    pub(crate) desc: MaterialDesc,
    compiled: Option<Arc<CompiledMaterial>>,
    /// Cutout of `compiled`.
    cutout: Option<Arc<Cutout>>,
}

impl MaterialEntry {
    /// A new entry, or `old` if nothing changed. Also returns if anything changed.
    pub(crate) fn update(old: Option<Self>, desc: MaterialDesc) -> (Self, bool) {
        match old {
            Some(old) if old.desc == desc => (old, false),
            _ => (Self { desc, compiled: None, cutout: None }, true),
        }
    }

    fn compiled(&mut self) -> &Arc<CompiledMaterial> {
        let Self { desc, compiled, cutout } = self;
        compiled.get_or_insert_with(|| {
            let compiled = compile(desc);
            *cutout = compiled.cutout().map(Arc::new);
            Arc::new(compiled)
        })
    }
}

/// The state that is kept from commit to commit.
#[derive(Debug)]
pub(crate) struct SurfaceStore {
    /// Numbers of primvar names; they never change. The primvars that surfaces without a material show come first.
    names: FxHashMap<Arc<str>, u32>,
    /// Materials of the last commit by path.
    materials: FxHashMap<Arc<str>, Arc<Material>>,
    /// Primvars that images are wanted of, with the numbers of their names.
    shown_primvars: Vec<(Arc<str>, u32)>,
    /// True if boxes ignore cutouts, for tests.
    pub(crate) has_whole_bounds: bool,
}

impl Default for SurfaceStore {
    fn default() -> Self {
        let names = [("displayColor", NAME_DISPLAY_COLOR), ("displayOpacity", NAME_DISPLAY_OPACITY)];
        let names = names.map(|(name, id)| (name.into(), id)).into_iter().collect();
        let (materials, shown_primvars) = (FxHashMap::default(), Vec::new());
        Self { names, materials, shown_primvars, has_whole_bounds: false }
    }
}

/// Path of a binding; `None` if it is empty.
fn bound(path: Option<&Arc<str>>) -> Option<&Arc<str>> {
    path.filter(|path| !path.is_empty())
}

/// Materials of a mesh by slot.
fn bindings(desc: &MeshDesc) -> impl Iterator<Item = Option<&Arc<str>>> {
    std::iter::once(bound(desc.material.as_ref())).chain(desc.subsets.iter().map(|s| bound(s.material.as_ref())))
}

/// Returns true if a mesh has an authored primvar, even an empty one.
fn has_authored(desc: &MeshDesc, name: &str) -> bool {
    desc.authored_primvar(name).is_some()
}

/// Returns true if a mesh has a primvar itself.
fn has(desc: &MeshDesc, name: &str) -> bool {
    desc.authored_primvar(name).is_some_and(|primvar| !primvar.values.is_empty())
}

/// Warning about a material that the host does not have. Hosts leave out materials all of whose surfaces are for other
/// renderers.
const MISSING_MATERIAL: &str = "does not exist, or has no surface that is read (UsdPreviewSurface or MaterialX)";

/// Warning about a hair material on a prim that is not a curve.
const NO_CURVE: &str = "its hair material is for curves: fibres go along the first texture coordinate, and are met \
                        where the normal says";

/// Returns true if one of a mesh's materials emits light.
fn is_emissive(desc: &MeshDesc, materials: &BTreeMap<Arc<str>, MaterialEntry>) -> bool {
    bindings(desc).flatten().any(|material| {
        let compiled = materials.get(material).and_then(|entry| entry.compiled.as_ref()?.material.as_ref());
        compiled.is_some_and(|material| material.flags.contains(MaterialFlags::EMISSIVE))
    })
}

/// Cutouts of the materials of a mesh, by slot.
fn cutouts(desc: &MeshDesc, materials: &BTreeMap<Arc<str>, MaterialEntry>) -> SlotCutouts {
    let cutout = |material: Option<&Arc<str>>| materials.get(material?)?.cutout.clone();
    let all: SlotCutouts = bindings(desc).map(cutout).collect();
    let is_cut = matches!(desc.shape, PrimShape::Mesh) && all.iter().any(Option::is_some);
    if is_cut { all } else { Vec::new() }
}

impl SurfaceStore {
    /// Sets the primvars that images are wanted of: prims build them, and instancers offer them. Returns if these are
    /// others than before.
    pub(crate) fn show_primvars(&mut self, names: &[Arc<str>]) -> bool {
        let same = self.shown_primvars.iter().map(|(name, _)| name).eq(names);
        if !same {
            let names = names.iter().filter(|name| built_in(name).is_none());
            self.shown_primvars = names.map(|name| (Arc::clone(name), self.id(name))).collect();
        }
        !same
    }

    /// Compiles the materials of the meshes `shown`, and sets on every mesh the primvars that it has to build and its
    /// displacement; a mesh that was built with others forgets its asset. Solids that emit become polygons.
    pub(crate) fn prepare(
        &mut self,
        materials: &mut BTreeMap<Arc<str>, MaterialEntry>,
        meshes: &mut BTreeMap<Arc<str>, MeshEntry>,
        lights: &BTreeMap<Arc<str>, LightDesc>,
        shown: &FxHashSet<Arc<str>>,
        reports: &mut CommitReports,
    ) {
        let shown_primvars = self.shown_primvars.clone();
        for (path, entry) in meshes.iter_mut().filter(|(path, _)| shown.contains(*path)) {
            let (seen, unseen) = shown_primvars.iter().partition::<Vec<_>, _>(|(name, _)| has(&entry.desc, name));
            let mut names: Vec<&Arc<str>> = seen.into_iter().map(|(name, _)| name).collect();
            for material in bindings(&entry.desc).flatten() {
                match materials.get_mut(material) {
                    Some(found) => {
                        found.compiled();
                    }
                    None => reports.note(path, format!("its material {material} {MISSING_MATERIAL}")),
                }
            }
            let is_instanced = !entry.desc.prim.instanced_by.is_empty();
            let mut lacks: Vec<u32> = unseen.into_iter().map(|(_, number)| *number).collect();
            for material in bindings(&entry.desc) {
                let compiled = material.and_then(|material| materials.get(material)).and_then(|m| m.compiled.as_ref());
                let Some(material) = compiled.and_then(|c| c.material.as_ref()) else {
                    let shown = [("displayColor", NAME_DISPLAY_COLOR), ("displayOpacity", NAME_DISPLAY_OPACITY)];
                    lacks.extend(shown.iter().filter(|(name, _)| !has(&entry.desc, name)).map(|(_, id)| *id));
                    continue;
                };
                let is_curve = matches!(entry.desc.shape, PrimShape::Curves(_));
                if material.flags.contains(MaterialFlags::HAIR) && !is_curve {
                    reports.note(path, NO_CURVE.to_owned());
                }
                for name in material.primvar_names() {
                    // Only ribbons have this primvar, and they make it.
                    if &**name == ACROSS_NAME {
                        names.extend(Some(name).filter(|_| is_curve && entry.desc.normals.is_some()));
                        continue;
                    }
                    if is_instanced && built_in(name).is_none() && !has(&entry.desc, name) {
                        lacks.push(self.id(name));
                    }
                    names.extend(Some(name).filter(|name| &***name == PTEX_SET || has_authored(&entry.desc, name)));
                }
            }
            lacks.sort_unstable();
            lacks.dedup();
            entry.lacks = if is_instanced { lacks } else { Vec::new() };
            let mut wanted: Vec<WantedPrimvar> =
                names.into_iter().map(|name| WantedPrimvar { name: name.clone(), id: self.id(name) }).collect();
            wanted.sort_by_key(|primvar| primvar.id);
            wanted.dedup();
            let displacement =
                |material: Option<&Arc<str>>| materials.get(material?)?.compiled.as_ref()?.displacement.clone();
            let mut displacements: SlotDisplacements = bindings(&entry.desc).map(displacement).collect();
            if displacements.iter().all(Option::is_none) {
                displacements.clear();
            }
            let emits = lights.contains_key(&*format!("{path}{MESH_LIGHT}")) || is_emissive(&entry.desc, materials);
            entry.ask(wanted, displacements, emits && entry.desc.solid.is_some());
            // All faces of a light count.
            let is_whole = emits || self.has_whole_bounds;
            entry.cut_out(if is_whole { Vec::new() } else { cutouts(&entry.desc, materials) });
        }
        for (path, entry) in materials.iter() {
            if let Some(problem) = entry.compiled.as_ref().and_then(|compiled| compiled.problem()) {
                reports.note(path, problem);
            }
        }
    }

    /// Sets on every instancer `shown` the primvars that some mesh lacks. A `displayOpacity` that is 1 everywhere is
    /// left out.
    pub(crate) fn offer(
        &self,
        meshes: &BTreeMap<Arc<str>, MeshEntry>,
        instancers: &mut BTreeMap<Arc<str>, InstancerEntry>,
        shown: &FxHashSet<Arc<str>>,
        reports: &mut CommitReports,
    ) {
        let lacking: FxHashSet<u32> = meshes
            .iter()
            .filter(|(path, _)| shown.contains(*path))
            .flat_map(|(_, entry)| entry.lacks.iter().copied())
            .collect();
        let mut hides = false;
        for (path, entry) in instancers.iter_mut().filter(|(path, _)| shown.contains(*path)) {
            entry.offers.clear();
            let known = |primvar: &Arc<InstancePrimvar>| {
                let id = self.names.get(&primvar.name).copied().filter(|id| lacking.contains(id))?;
                Some(MemberPrimvar { id, primvar: primvar.clone() })
            };
            let offers: Vec<MemberPrimvar> = entry.primvars.iter().filter_map(known).collect();
            for offer in offers {
                if !offer.primvar.is_usable(entry.instance_count()) {
                    reports.of(path).primvars += 1;
                    continue;
                }
                reports.of(path).primvar_values += offer.primvar.bad_values();
                hides |= offer.id == NAME_DISPLAY_OPACITY && !offer.primvar.is_all_one();
                entry.offers.push(offer);
            }
        }
        if !hides {
            instancers.values_mut().for_each(|entry| entry.offers.retain(|offer| offer.id != NAME_DISPLAY_OPACITY));
        }
    }

    fn id(&mut self, name: &Arc<str>) -> u32 {
        if let Some(id) = built_in(name) {
            return id;
        }
        let next = u32::try_from(self.names.len()).unwrap_or(u32::MAX);
        *self.names.entry(name.clone()).or_insert(next)
    }

    /// The tables for the meshes `shown`, all prepared.
    pub(crate) fn tables(
        &mut self,
        materials: &BTreeMap<Arc<str>, MaterialEntry>,
        shown: ShownMeshes<'_>,
        reports: &mut CommitReports,
    ) -> SurfaceTables {
        let ShownMeshes { meshes, lights, paths: shown, linked } = shown;
        let is_linked: FxHashSet<&Arc<str>> = linked.list().iter().map(|prim| &prim.path).collect();
        let mut linked_slots: FxHashMap<&Arc<str>, Vec<u32>> = FxHashMap::default();
        let mut tables = SurfaceTables { shown_primvars: self.shown_primvars.clone(), ..SurfaceTables::default() };
        let mut indices: FxHashMap<Arc<str>, u32> = FxHashMap::default();
        let used: FxHashSet<&Arc<str>> = meshes
            .iter()
            .filter(|(path, entry)| shown.contains(*path) && entry.built.is_some())
            .flat_map(|(_, entry)| bindings(&entry.desc).flatten())
            .collect();
        let known = std::mem::take(&mut self.materials);
        for (path, entry) in materials.iter().filter(|(path, _)| used.contains(path)) {
            let Some(compiled) = &entry.compiled else { continue };
            let Some(material) = &compiled.material else { continue };
            let material = self.linked(material, &compiled.textures, &mut tables.textures);
            let same = known.get(path).filter(|known| ***known == material).cloned();
            let material = same.unwrap_or_else(|| Arc::new(material));
            indices.insert(path.clone(), u32::try_from(tables.materials.len()).unwrap_or(NO_MATERIAL));
            self.materials.insert(path.clone(), material.clone());
            tables.materials.push(material);
            tables.material_paths.push(path.clone());
        }
        for (path, entry) in meshes.iter().filter(|(path, e)| shown.contains(*path) && e.built.is_some()) {
            let of =
                |material: Option<&Arc<str>>| material.and_then(|m| indices.get(m)).copied().unwrap_or(NO_MATERIAL);
            let mut slots: Vec<u32> = bindings(&entry.desc).map(of).collect();
            if let Some(light) = lights.get(path) {
                for (number, slot) in slots.iter_mut().enumerate() {
                    let own = tables.materials.get(*slot as usize).map(|material| &**material);
                    let dressed = light.dress(path, own, reports);
                    let name: Arc<str> = format!("{path}{MESH_LIGHT}/{number}").into();
                    let same = known.get(&name).filter(|known| ***known == dressed).cloned();
                    let dressed = same.unwrap_or_else(|| Arc::new(dressed));
                    *slot = u32::try_from(tables.materials.len()).unwrap_or(NO_MATERIAL);
                    self.materials.insert(Arc::clone(&name), dressed.clone());
                    tables.materials.push(dressed);
                    tables.material_paths.push(name);
                }
            }
            if is_linked.contains(path) {
                linked_slots.insert(path, slots.clone());
            }
            let record = PrimRecord::default();
            tables.add(path, entry.desc.prim_id, (record, entry.desc.categories.clone(), slots), reports);
            let of_light = lights.get(path).and_then(|light| light.label.clone());
            tables.set_label(entry.desc.prim_id, of_light.or_else(|| entry.desc.label.clone()));
            if !tables.set_mask(entry.desc.prim_id, entry.desc.mask) {
                reports.note(path, "its prim id is out of range: all rays see it, and it is no matte".to_owned());
            }
        }
        for prim in linked.list() {
            let (Some(slots), Some(entry)) = (linked_slots.get(&prim.path), meshes.get(&prim.path)) else { continue };
            let record = PrimRecord { shown_as: Some(entry.desc.prim_id), ..PrimRecord::default() };
            let categories = entry.desc.categories.iter().chain(prim.categories.iter()).cloned().collect();
            tables.add(&prim.path, prim.prim_id, (record, categories, slots.clone()), reports);
            let of_light = lights.get(&prim.path).and_then(|light| light.label.clone());
            tables.set_label(prim.prim_id, of_light.or_else(|| entry.desc.label.clone()));
            // Its prim id is one of those that this crate gives, in range.
            let _is_set = tables.set_mask(prim.prim_id, entry.desc.mask);
        }
        tables
    }

    /// The material with the numbers of names and textures in the snapshot.
    fn linked(&mut self, material: &Material, local: &[TextureRef], textures: &mut Vec<TextureRef>) -> Material {
        let mut linked = material.clone();
        for set in &mut linked.uv_sets {
            set.id = self.id(&set.name);
        }
        for slot in &mut linked.primvars {
            slot.id = self.id(&slot.name);
        }
        let mut index_of = |reference: &TextureRef| {
            let at = textures.iter().position(|texture| texture == reference).unwrap_or_else(|| {
                textures.push(reference.clone());
                textures.len() - 1
            });
            u32::try_from(at).unwrap_or_default()
        };
        for input in &mut linked.inputs {
            if let InputValue::Texture { texture, .. } = input
                && let Some(reference) = local.get(*texture as usize)
            {
                *texture = index_of(reference);
            }
        }
        let emission = linked.emission.iter_mut().flat_map(|emission| &mut emission.program.lookups);
        for lookup in linked.program.lookups.iter_mut().chain(&mut linked.opacity_program.lookups).chain(emission) {
            if let Some(reference) = local.get(lookup.texture as usize) {
                lookup.texture = index_of(reference);
            }
        }
        linked
    }
}

impl SurfaceTables {
    /// Notes the label of a prim; ids out of range have none.
    fn set_label(&mut self, prim_id: i32, label: Option<Arc<str>>) {
        let Some(label) = label.filter(|label| !label.is_empty()) else { return };
        let index = usize::try_from(i64::from(prim_id) + 1).ok().filter(|&index| index <= MAX_PRIM_ID as usize);
        let Some(index) = index else { return };
        if self.labels.len() <= index {
            self.labels.resize(index + 1, None);
        }
        self.labels[index] = Some(label);
    }

    /// Notes what a prim does without; returns false if its id is out of range.
    fn set_mask(&mut self, prim_id: i32, mask: PrimMask) -> bool {
        if mask.is_empty() {
            return true;
        }
        let index = usize::try_from(i64::from(prim_id) + 1).ok().filter(|&index| index <= MAX_PRIM_ID as usize);
        let Some(index) = index else { return false };
        if self.masks.len() <= index {
            self.masks.resize(index + 1, PrimMask::empty());
        }
        self.masks[index] = mask;
        true
    }

    /// Adds the bindings of one mesh: its record as far as it is known, its collections, its slots.
    fn add(
        &mut self,
        path: &Arc<str>,
        prim_id: i32,
        (record, mut categories, slots): (PrimRecord, Vec<Arc<str>>, Vec<u32>),
        reports: &mut CommitReports,
    ) {
        let has_material = slots.iter().any(|&slot| slot != NO_MATERIAL);
        categories.sort_unstable();
        categories.dedup();
        let Some(index) = usize::try_from(i64::from(prim_id) + 1).ok().filter(|&index| index <= MAX_PRIM_ID as usize)
        else {
            if has_material || !categories.is_empty() {
                reports.note(path, format!("its prim id {prim_id} is out of range: no material"));
            }
            return;
        };
        let known = self.prims.get(index).copied().unwrap_or_default();
        if known.slot_count > 0 {
            let (first, end) = (known.first_slot as usize, (known.first_slot + known.slot_count) as usize);
            let same = self.material_slots.get(first..end) == Some(&slots[..])
                && self.category_sets.get(known.category_set as usize).is_some_and(|set| *set == categories);
            if !same {
                reports.note(path, "another mesh with the same prim id has other materials or collections".to_owned());
            }
            return;
        }
        if self.category_sets.is_empty() {
            self.category_sets.push(Vec::new());
        }
        let set = self.category_sets.iter().position(|set| *set == categories).unwrap_or_else(|| {
            self.category_sets.push(categories);
            self.category_sets.len() - 1
        });
        if self.prims.len() <= index {
            self.prims.resize(index + 1, PrimRecord::default());
        }
        let number = |n: usize| u32::try_from(n).unwrap_or(u32::MAX);
        self.prims[index] = PrimRecord {
            first_slot: number(self.material_slots.len()),
            slot_count: number(slots.len()),
            category_set: number(set),
            ..record
        };
        self.material_slots.extend(slots);
    }

    /// Slots of a prim id; empty if it has none.
    #[must_use]
    pub fn slots(&self, prim_id: i32) -> &[u32] {
        let index = usize::try_from(i64::from(prim_id) + 1).unwrap_or(usize::MAX);
        let record = self.prims.get(index).copied().unwrap_or_default();
        let first = record.first_slot as usize;
        self.material_slots.get(first..first + record.slot_count as usize).unwrap_or_default()
    }

    /// Largest number of texture lookups of a material where it is shaded.
    #[must_use]
    pub fn most_lookups(&self) -> usize {
        self.materials.iter().map(|material| material.lookups()).max().unwrap_or(0)
    }

    /// Clears tables without content: without a material there are no prims, unless some is in a collection. Labels
    /// and masks stay.
    pub(crate) fn trim(&mut self) {
        if self.materials.is_empty() && self.category_sets.len() <= 1 {
            let (labels, masks) = (std::mem::take(&mut self.labels), std::mem::take(&mut self.masks));
            let shown_primvars = std::mem::take(&mut self.shown_primvars);
            *self = Self { labels, masks, shown_primvars, ..Self::default() };
        }
    }

    /// Returns true if both are equal; materials are compared by address.
    #[must_use]
    pub fn is_same(&self, other: &Self) -> bool {
        self.materials.len() == other.materials.len()
            && self.materials.iter().zip(&other.materials).all(|(a, b)| Arc::ptr_eq(a, b))
            && self.textures == other.textures
            && self.prims == other.prims
            && self.material_slots == other.material_slots
            && self.category_sets == other.category_sets
            && self.labels == other.labels
            && self.masks == other.masks
            && self.shown_primvars == other.shown_primvars
    }

    /// Checks every invariant of the tables.
    pub(crate) fn check(&self) -> Result<(), &'static str> {
        let slots = self.material_slots.len() as u64;
        let in_range = |p: &PrimRecord| {
            u64::from(p.first_slot) + u64::from(p.slot_count) <= slots
                && (p.slot_count == 0 || (p.category_set as usize) < self.category_sets.len())
        };
        if !self.prims.iter().all(in_range) {
            return Err("prims");
        }
        if self.material_slots.iter().any(|&slot| slot != NO_MATERIAL && slot as usize >= self.materials.len()) {
            return Err("material slots");
        }
        let sound = |at: usize, input: &InputValue, material: &Material| match *input {
            InputValue::Constant(value) => value.iter().all(|v| v.is_finite()),
            InputValue::Texture { texture, uv, .. } => {
                (texture as usize) < self.textures.len() && uv.is_none_or(|uv| usize::from(uv) < material.uv_sets.len())
            }
            InputValue::Primvar { slot, .. } => usize::from(slot) < material.primvars.len(),
            InputValue::Register(register) => {
                let is_opacity = at == MaterialInput::Opacity as usize;
                let program = if is_opacity { &material.opacity_program } else { &material.program };
                usize::from(register) < REGISTERS && !program.instructions.is_empty()
            }
        };
        let known = |lookup: &ProgramLookup| (lookup.texture as usize) < self.textures.len();
        let all_sound = |material: &Arc<Material>| {
            material.inputs.iter().enumerate().all(|(at, input)| sound(at, input, material))
                && material.program_lookups().all(known)
        };
        if self.materials.iter().all(all_sound) { Ok(()) } else { Err("materials") }
    }
}
