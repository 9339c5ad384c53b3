// SPDX-License-Identifier: Apache-2.0
//! The data that the database keeps per prim.

use std::sync::{Arc, OnceLock};

use super::linking::LinkClasses;
use super::mesh_outline::MeshOutline;
use super::surface_cut::{PatchCuts, SurfaceCut};
use crate::array::ArrayView;
use crate::desc::DroppedData;
use crate::desc::{InstancerDesc, MeshDesc};
use crate::instancing::array_motion::ArrayMotion;
use crate::instancing::arrays::InstanceArrays;
use crate::instancing::instance_primvars::{InstancePrimvar, MemberPrimvar};
use crate::material::Cutout;
use crate::mesh::{
    BuildDemand, DicingRate, KeptMesh, MeshPatches, MeshShape, SlotDisplacements, WantedPrimvar, is_same_mesh,
};

/// Cutouts by slot, as [`SlotDisplacements`]. Empty if nothing is cut out.
pub(crate) type SlotCutouts = Vec<Option<Arc<Cutout>>>;

/// A mesh prim.
#[derive(Debug)]
pub(crate) struct MeshEntry {
    pub(crate) desc: MeshDesc,
    /// The asset, once the prim was needed; `None` again after the arrays change.
    pub(crate) built: Option<Arc<KeptMesh>>,
    /// Rate at which its limit surface is cut.
    pub(crate) dicing: DicingRate,
    /// The cuts of its patches, where it is refined patch by patch: then `dicing` says nothing about rates.
    pub(crate) cuts: Option<Arc<PatchCuts>>,
    /// The facts about it that dicing needs, once they were asked for; `None` again after the arrays or
    /// `wanted` change.
    outline: OnceLock<MeshOutline>,
    /// Primvars that materials read.
    pub(crate) wanted: Vec<WantedPrimvar>,
    /// Displacements of its materials.
    pub(crate) displacements: SlotDisplacements,
    /// Cutouts of its materials.
    pub(crate) cutouts: SlotCutouts,
    /// Numbers of the primvars that are read here and that the mesh does not have.
    pub(crate) lacks: Vec<u32>,
    /// True if its faces are those of before, with points elsewhere.
    pub(crate) deforms: bool,
    /// The shape that it had, if that was kept.
    pub(crate) shape: Option<Arc<MeshShape>>,
}

impl MeshEntry {
    /// A new entry, or `old` with the changed parts. Also returns if anything changed.
    pub(crate) fn update(old: Option<Self>, mut desc: MeshDesc) -> (Self, bool) {
        if let Some(old) = &old {
            desc.keep_form(&old.desc);
        }
        if desc.points.is_empty() {
            desc.take_form(false);
        }
        let deformed = old.as_ref().filter(|old| is_deformed(&old.desc, &desc)).map(Self::kept_shape);
        match old {
            Some(old) if is_same_mesh(&old.desc, &desc, &old.demand()) => {
                let changed = old.desc.prim != desc.prim
                    || old.desc.prim_id != desc.prim_id
                    || !is_dressed_alike(&old.desc, &desc);
                (Self { desc, ..old }, changed)
            }
            _ => {
                let entry = Self {
                    desc,
                    built: None,
                    dicing: DicingRate::default(),
                    cuts: None,
                    outline: OnceLock::new(),
                    wanted: Vec::new(),
                    displacements: Vec::new(),
                    cutouts: Vec::new(),
                    lacks: Vec::new(),
                    deforms: deformed.is_some(),
                    shape: deformed.flatten(),
                };
                (entry, true)
            }
        }
    }
}

impl MeshEntry {
    /// Returns true if host memory did not suffice to build it.
    pub(crate) fn is_left_out(&self) -> bool {
        self.built.as_ref().is_some_and(|built| built.is_left_out)
    }

    /// The shape of its asset, or the one that it had.
    fn kept_shape(&self) -> Option<Arc<MeshShape>> {
        let built = self.built.as_ref().and_then(|built| built.refit.as_ref());
        built.map_or_else(|| self.shape.clone(), |refit| refit.shape.clone())
    }

    /// The inputs of building it.
    pub(crate) fn demand(&self) -> BuildDemand<'_> {
        let Self { wanted, dicing, displacements, .. } = self;
        BuildDemand { wanted, dicing: Some(dicing), displacements, covers: &[], heights: None }
    }

    /// The facts about it that dicing needs.
    pub(crate) fn outline(&self) -> &MeshOutline {
        self.outline.get_or_init(|| MeshOutline::new(&self.desc, self.demand()))
    }

    /// Its patches; `None` if it is always refined as a whole.
    pub(crate) fn patches(&self) -> Option<&Arc<MeshPatches>> {
        self.outline().patches(&self.desc, self.demand())
    }

    /// Sets how finely it is cut; forgets an asset that was cut otherwise.
    pub(crate) fn cut(&mut self, cut: SurfaceCut) {
        let is_same = match (&self.cuts, &cut.patches) {
            (Some(old), Some(new)) => old.is_same(new),
            (old, new) => old.is_none() && new.is_none() && self.dicing == cut.dicing,
        };
        if !is_same {
            self.built = None;
        }
        (self.dicing, self.cuts) = (cut.dicing, cut.patches);
    }

    /// Sets the cutouts of its materials; forgets an asset that was built with others.
    pub(crate) fn cut_out(&mut self, cutouts: SlotCutouts) {
        if self.cutouts != cutouts {
            self.cutouts = cutouts;
            self.built = None;
        }
    }

    /// Sets the demands of its materials; forgets an asset that was built for others. `emits`: some part of it is a
    /// light.
    pub(crate) fn ask(&mut self, wanted: Vec<WantedPrimvar>, displacements: SlotDisplacements, emits: bool) {
        let is_new_form = self.desc.take_form(emits || !displacements.is_empty());
        if is_new_form || self.wanted != wanted || self.displacements != displacements {
            self.wanted = wanted;
            self.displacements = displacements;
            self.built = None;
            self.outline = OnceLock::new();
        }
    }
}

/// Returns true if the faces are equal and as many points are elsewhere.
fn is_deformed(old: &MeshDesc, new: &MeshDesc) -> bool {
    old.points.len() == new.points.len()
        && old.points.identity() != new.points.identity()
        && old.face_vertex_counts.same_contents(&new.face_vertex_counts)
        && old.face_vertex_indices.same_contents(&new.face_vertex_indices)
}

/// Returns true if bindings and collections are equal, and there are primvars of the same names.
fn is_dressed_alike(a: &MeshDesc, b: &MeshDesc) -> bool {
    a.material == b.material
        && a.categories == b.categories
        && a.label == b.label
        && a.mask == b.mask
        && a.subsets.iter().map(|s| &s.material).eq(b.subsets.iter().map(|s| &s.material))
        && a.primvars.iter().map(|p| &p.name).eq(b.primvars.iter().map(|p| &p.name))
}

/// An instancer prim.
#[derive(Debug)]
pub(crate) struct InstancerEntry {
    /// Its arrays are the ones of `arrays` (kept while their contents are the same).
    pub(crate) desc: InstancerDesc,
    pub(crate) arrays: Arc<InstanceArrays>,
    /// False when an array has the wrong type.
    pub(crate) is_usable: bool,
    pub(crate) dropped: DroppedData,
    /// Further notes for the user.
    pub(crate) notes: Vec<String>,
    /// Its instance-rate primvars.
    pub(crate) primvars: Vec<Arc<InstancePrimvar>>,
    /// Of these, the usable ones that some mesh does not have itself.
    pub(crate) offers: Vec<MemberPrimvar>,
    /// Its instances, sorted by the collections that they are in.
    pub(crate) classes: LinkClasses,
}

impl InstancerEntry {
    /// A new entry; arrays whose contents did not change are taken from `old`, so that runs made from them stay valid.
    /// Also returns if anything changed.
    pub(crate) fn update(old: Option<Self>, mut desc: InstancerDesc) -> (Self, bool) {
        let mut dropped = DroppedData::default();
        let mut arrays = InstanceArrays::of(&desc);
        let is_usable = arrays.check_types(&mut dropped);
        let mut notes = Vec::new();
        match ArrayMotion::of(&desc.motion, arrays.transforming(), arrays.len()) {
            Ok(motion) => arrays.motion = motion.filter(|_| is_usable).map(Arc::new),
            Err(why) => notes.push(format!("its instances do not move: {why}")),
        }
        let mut arrays = Arc::new(arrays);
        let known = old.as_ref().map_or(&[][..], |old| &old.primvars);
        let primvars = InstancePrimvar::all_of(&desc, known);
        let Some(old) = old else {
            let classes = LinkClasses::default();
            return (Self { desc, arrays, is_usable, dropped, notes, primvars, offers: Vec::new(), classes }, true);
        };
        let mut changed = desc.prim != old.desc.prim || desc.prototypes.len() != old.desc.prototypes.len();
        if old.arrays.same_contents(&arrays) {
            arrays = old.arrays;
        } else {
            changed = true;
        }
        for (new, old) in desc.prototypes.iter_mut().zip(&old.desc.prototypes) {
            changed |= new.root != old.root;
            if new.indices.same_contents(&old.indices) {
                new.indices = old.indices.clone();
            } else {
                changed = true;
            }
        }
        if desc.links == old.desc.links {
            desc.links = old.desc.links;
        } else {
            changed = true;
        }
        changed |= dropped != old.dropped || notes != old.notes;
        changed |= primvars.len() != old.primvars.len()
            || primvars.iter().zip(&old.primvars).any(|(new, old)| !Arc::ptr_eq(new, old));
        let (offers, classes) = (old.offers, old.classes);
        (Self { desc, arrays, is_usable, dropped, notes, primvars, offers, classes }, changed)
    }
}

impl InstancerEntry {
    /// Instances that a primvar must have values for.
    pub(crate) fn instance_count(&self) -> usize {
        match self.arrays.len() {
            usize::MAX => {
                let indices = self.desc.prototypes.iter().map(|prototype| prototype.indices.view());
                let last = |view: ArrayView<'_>| (0..view.len()).filter_map(|at| view.index(at)).max();
                let last = indices.filter_map(last).max().unwrap_or(-1);
                usize::try_from(i64::from(last) + 1).unwrap_or(0)
            }
            count => count,
        }
    }
}
