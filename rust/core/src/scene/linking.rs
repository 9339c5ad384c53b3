// SPDX-License-Identifier: Apache-2.0
//! Links of lights to instances: which instances of an instancer are in the same collections, and prims that are seen
//! in several sets of collections. Pure.
//!
//! A mesh below instancers is in the collections that it is in itself and in those of all instances on the way to it.
//! Instances of one prototype that are in different collections are placed apart, with a copy of the prototype's group
//! for each set ([`LinkCategories`]); the meshes in it are the same, under prim ids of their own, which are what links
//! are looked up by ([`LinkedPrims`]). Only collections that some light names count.

use oocpt_abi::MAX_PRIM_ID;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::entries::MeshEntry;
use crate::array::{ElementType, TypedArray};
use crate::desc::{InstanceLinks, InstancerDesc, LightDesc, LightKind};

/// Most prims that are seen in sets of collections other than their own.
pub(crate) const MAX_LINKED_PRIMS: usize = 1 << 20;

/// A set of collections, sorted; empty for none.
pub(crate) type LinkCategories = Arc<[Arc<str>]>;

/// The collections that lights name.
pub(crate) fn named(lights: &BTreeMap<Arc<str>, LightDesc>) -> BTreeSet<Arc<str>> {
    let own = lights.values().filter(|light| !matches!(light.kind, LightKind::Mesh { .. }));
    let links = own.flat_map(|light| [&light.light_link, &light.shadow_link]).flatten();
    links.filter(|name| !name.is_empty()).cloned().collect()
}

/// Instances that are in the same collections.
#[derive(Clone, Debug)]
pub(crate) struct LinkClass {
    pub(crate) categories: LinkCategories,
    /// Of each prototype: the places in its indices; `None`: all of them.
    chosen: Option<Vec<Arc<Vec<u32>>>>,
}

impl LinkClass {
    /// The places in the indices of a prototype that are in it: all where there is nothing inside, and `None` for no
    /// place at all.
    #[expect(clippy::option_option, reason = "none; all; some")]
    pub(crate) fn chosen(&self, prototype: usize) -> Option<Option<Arc<Vec<u32>>>> {
        match &self.chosen {
            None => Some(None),
            Some(chosen) => chosen.get(prototype).filter(|places| !places.is_empty()).cloned().map(Some),
        }
    }
}

/// What classes are made of: the links, the names, the arrays of indices.
type LinkSources = (Arc<InstanceLinks>, BTreeSet<Arc<str>>, Vec<TypedArray>);

/// The instances of an instancer by their collections, kept while nothing that decides them changes.
#[derive(Debug, Default)]
pub(crate) struct LinkClasses {
    classes: Vec<LinkClass>,
    made_of: Option<LinkSources>,
}

impl LinkClasses {
    /// At least one after [`Self::update`].
    pub(crate) fn all(&self) -> &[LinkClass] {
        &self.classes
    }

    /// Works them out, unless nothing is different.
    pub(crate) fn update(&mut self, desc: &InstancerDesc, named: &BTreeSet<Arc<str>>) {
        let arrays = || desc.prototypes.iter().map(|prototype| &prototype.indices);
        let is_known = self.made_of.as_ref().is_some_and(|(links, names, known)| {
            (Arc::ptr_eq(links, &desc.links) || *links == desc.links)
                && names == named
                && known.iter().map(TypedArray::identity).eq(arrays().map(TypedArray::identity))
        });
        if is_known {
            return;
        }
        self.classes = classes(desc, named);
        self.made_of = Some((Arc::clone(&desc.links), named.clone(), arrays().cloned().collect()));
    }
}

fn classes(desc: &InstancerDesc, named: &BTreeSet<Arc<str>>) -> Vec<LinkClass> {
    let links = &desc.links;
    let kept = |set: &Vec<Arc<str>>| -> Vec<Arc<str>> {
        let kept: BTreeSet<&Arc<str>> = set.iter().filter(|name| named.contains(*name)).collect();
        kept.into_iter().cloned().collect()
    };
    let sets: Vec<Vec<Arc<str>>> = links.sets.iter().map(kept).collect();
    let whole = |set: Vec<Arc<str>>| vec![LinkClass { categories: set.into(), chosen: None }];
    let Some(of) = &links.of else { return whole(sets.into_iter().next().unwrap_or_default()) };
    // Sets that are equal by what lights name are one class; an instance without a set is in the class of none.
    let mut numbers: BTreeMap<Vec<Arc<str>>, usize> = sets.iter().map(|set| (set.clone(), 0)).collect();
    numbers.insert(Vec::new(), 0);
    numbers.values_mut().enumerate().for_each(|(number, slot)| *slot = number);
    let class_of_set: Vec<usize> = sets.iter().map(|set| numbers.get(set).copied().unwrap_or(0)).collect();
    let class_of = |number: Option<i32>| {
        let set = usize::try_from(number?).ok().and_then(|number| of.get(number))?;
        class_of_set.get(*set as usize).copied()
    };
    let mut places = vec![vec![Vec::new(); desc.prototypes.len()]; numbers.len()];
    for (prototype, described) in desc.prototypes.iter().enumerate() {
        let indices = described.indices.view();
        let count = if indices.element() == ElementType::I32 { indices.len() } else { 0 };
        for (place, at) in (0..count).zip(0_u32..) {
            // The class of none comes first.
            if let Some(of_prototype) = places.get_mut(class_of(indices.index(place)).unwrap_or(0)) {
                of_prototype[prototype].push(at);
            }
        }
    }
    let is_used = |places: &Vec<Vec<u32>>| places.iter().any(|places| !places.is_empty());
    let used: Vec<_> = numbers.into_keys().zip(places).filter(|(_, places)| is_used(places)).collect();
    match used.len() {
        0 => whole(Vec::new()),
        1 => whole(used.into_iter().next().map(|(set, _)| set).unwrap_or_default()),
        _ => {
            let class = |(set, places): (Vec<Arc<str>>, Vec<Vec<u32>>)| LinkClass {
                categories: set.into(),
                chosen: Some(places.into_iter().map(Arc::new).collect()),
            };
            used.into_iter().map(class).collect()
        }
    }
}

/// Both sets.
pub(crate) fn union(a: &LinkCategories, b: &LinkCategories) -> LinkCategories {
    if b.iter().all(|name| a.binary_search(name).is_ok()) {
        return Arc::clone(a);
    }
    let all: BTreeSet<&Arc<str>> = a.iter().chain(b.iter()).collect();
    all.into_iter().cloned().collect()
}

/// A mesh that is seen in collections beside its own, under a prim id that no prim has.
#[derive(Clone, Debug)]
pub(crate) struct LinkedPrim {
    pub(crate) path: Arc<str>,
    pub(crate) prim_id: i32,
    pub(crate) categories: LinkCategories,
}

/// The prims of a plan that are seen in collections beside their own. Numbers go by the order of the plan.
#[derive(Debug, Default)]
pub(crate) struct LinkedPrims {
    known: FxHashMap<(Arc<str>, LinkCategories), i32>,
    list: Vec<LinkedPrim>,
    /// First of their prim ids, once one is needed.
    first: Option<usize>,
}

impl LinkedPrims {
    /// The prim id of a mesh below instances that are in `categories`; `None`: there are too many such.
    pub(crate) fn prim_id(
        &mut self,
        meshes: &BTreeMap<Arc<str>, MeshEntry>,
        entry: &MeshEntry,
        categories: &LinkCategories,
    ) -> Option<i32> {
        if categories.iter().all(|name| entry.desc.categories.contains(name)) {
            return Some(entry.desc.prim_id);
        }
        let key = (Arc::clone(&entry.desc.prim.path), Arc::clone(categories));
        if let Some(known) = self.known.get(&key) {
            return Some(*known);
        }
        let first = *self.first.get_or_insert_with(|| {
            let ids = meshes.values().filter_map(|mesh| usize::try_from(mesh.desc.prim_id).ok());
            // A few more prims leave the numbers as they are.
            ids.filter(|&id| id < MAX_PRIM_ID as usize).max().map_or(1, |last| (last + 1).next_power_of_two())
        });
        let number =
            Some(first + self.list.len()).filter(|&id| id < MAX_PRIM_ID as usize && self.list.len() < MAX_LINKED_PRIMS);
        let prim_id = i32::try_from(number?).ok()?;
        self.list.push(LinkedPrim { path: Arc::clone(&key.0), prim_id, categories: Arc::clone(categories) });
        self.known.insert(key, prim_id);
        Some(prim_id)
    }

    pub(crate) fn list(&self) -> &[LinkedPrim] {
        &self.list
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::desc::InstancerPrototype;

    fn names(names: &[&str]) -> Vec<Arc<str>> {
        names.iter().map(|name| Arc::from(*name)).collect()
    }

    fn instancer(sets: &[&[&str]], of: Option<Vec<u32>>, indices: &[Vec<i32>]) -> InstancerDesc {
        let prototype =
            |indices: &Vec<i32>| InstancerPrototype { root: "/p".into(), indices: TypedArray::of(indices.clone()) };
        InstancerDesc {
            prototypes: indices.iter().map(prototype).collect(),
            links: Arc::new(InstanceLinks { sets: sets.iter().map(|set| names(set)).collect(), of }),
            ..InstancerDesc::default()
        }
    }

    /// Categories, and the places of each prototype (`None`: all).
    type Found = (Vec<String>, Vec<Option<Vec<u32>>>);

    fn found(desc: &InstancerDesc, named: &[&str]) -> Vec<Found> {
        let mut classes = LinkClasses::default();
        classes.update(desc, &named.iter().map(|name| Arc::from(*name)).collect());
        let of = |class: &LinkClass| {
            let places = |prototype| match class.chosen(prototype) {
                None => Some(Vec::new()),
                Some(chosen) => chosen.map(|places| places.to_vec()),
            };
            let categories = class.categories.iter().map(ToString::to_string).collect();
            (categories, (0..desc.prototypes.len()).map(places).collect())
        };
        classes.all().iter().map(of).collect()
    }

    #[test]
    fn instances_split_by_the_collections_that_lights_name() {
        let desc = instancer(&[&["a", "x"], &["b"], &["x"]], Some(vec![0, 1, 2, 0]), &[vec![0, 1, 2], vec![3, 2]]);
        let all = |set: &[&str]| set.iter().map(ToString::to_string).collect::<Vec<_>>();
        let expected = vec![
            (all(&[]), vec![Some(vec![2]), Some(vec![1])]),
            (all(&["a"]), vec![Some(vec![0]), Some(vec![0])]),
            (all(&["b"]), vec![Some(vec![1]), Some(vec![])]),
        ];
        assert_eq!(found(&desc, &["a", "b"]), expected, "x is no light's");
        assert_eq!(found(&desc, &["c"]), [(all(&[]), vec![None, None])], "all alike");
    }

    #[test]
    fn one_category_set_for_all_instances_keeps_the_arrays() {
        let all = |set: &[&str]| set.iter().map(ToString::to_string).collect::<Vec<_>>();
        let desc = instancer(&[&["b", "a"]], None, &[vec![0, 1]]);
        assert_eq!(found(&desc, &["a", "b"]), [(all(&["a", "b"]), vec![None])], "no instance is named");
        let desc = instancer(&[&["a"]], Some(vec![0, 0]), &[vec![0, 1]]);
        assert_eq!(found(&desc, &["a"]), [(all(&["a"]), vec![None])], "all instances are named");
        assert_eq!(found(&instancer(&[], None, &[vec![0]]), &["a"]), [(all(&[]), vec![None])], "no links");
    }

    #[test]
    fn instances_without_categories_are_in_no_set() {
        let all = |set: &[&str]| set.iter().map(ToString::to_string).collect::<Vec<_>>();
        let desc = instancer(&[&["a"]], Some(vec![0, 7]), &[vec![-1, 0, 1, 2, 9]]);
        let expected = vec![(all(&[]), vec![Some(vec![0, 2, 3, 4])]), (all(&["a"]), vec![Some(vec![1])])];
        assert_eq!(found(&desc, &["a"]), expected, "negative, no such set, beyond the end");
    }

    #[test]
    fn the_union_of_category_sets_keeps_both() {
        let [a, ab, b]: [LinkCategories; 3] = [&["a"][..], &["a", "b"], &["b"]].map(|set| names(set).into());
        assert!(Arc::ptr_eq(&union(&ab, &b), &ab), "nothing new");
        assert_eq!(union(&b, &a), ab, "sorted");
    }
}
