// SPDX-License-Identifier: Apache-2.0
//! Light linking of instances: groups the instances of an instancer by the collections that they are in. Pure.
//!
//! A mesh below instancers is in the collections that it is in itself and in those of all instances that contain it.
//! Instances of one prototype that are in different collections are placed apart, with a copy of the prototype's group
//! for each set ([`LinkCategories`]); the meshes in it are the same, under prim ids of their own, by which links are
//! looked up (`linked_prims`). Only collections that some light names count.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use crate::array::{ElementType, TypedArray};
use crate::desc::{InstanceLinks, InstancerDesc, LightDesc, LightKind};

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
    /// By prototype: positions in its indices; `None`: all of them.
    chosen: Option<Vec<Arc<Vec<u32>>>>,
}

impl LinkClass {
    /// The positions in the indices of a prototype that are in the class: all if there is nothing inside, and `None` if
    /// there is none.
    #[expect(clippy::option_option, reason = "none; all; some")]
    pub(crate) fn chosen(&self, prototype: usize) -> Option<Option<Arc<Vec<u32>>>> {
        match &self.chosen {
            None => Some(None),
            Some(chosen) => chosen.get(prototype).filter(|places| !places.is_empty()).cloned().map(Some),
        }
    }
}

/// The inputs of the classes: the links, the names, the arrays of indices.
type LinkSources = (Arc<InstanceLinks>, BTreeSet<Arc<str>>, Vec<TypedArray>);

/// The instances of an instancer by their collections, kept while nothing that decides them changes.
#[derive(Debug, Default)]
pub(crate) struct LinkClasses {
    classes: Vec<LinkClass>,
    made_of: Option<LinkSources>,
}

impl LinkClasses {
    /// The classes; at least one after [`Self::update`].
    pub(crate) fn all(&self) -> &[LinkClass] {
        &self.classes
    }

    /// Computes the classes, unless the inputs are the same as before.
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
    // Sets that are equal in the collections that lights name are one class; an instance without a set is in the class
    // of none.
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

/// The union of both sets.
pub(crate) fn union(a: &LinkCategories, b: &LinkCategories) -> LinkCategories {
    if b.iter().all(|name| a.binary_search(name).is_ok()) {
        return Arc::clone(a);
    }
    let all: BTreeSet<&Arc<str>> = a.iter().chain(b.iter()).collect();
    all.into_iter().cloned().collect()
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
