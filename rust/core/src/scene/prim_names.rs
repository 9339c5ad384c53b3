// SPDX-License-Identifier: Apache-2.0
//! Names of what a sample can meet, for files that identify it by name (Cryptomatte): placements of prims, the
//! outermost instance that they are in, materials. Names are paths, which stay the same from frame to frame; a
//! placement in instancers has the index in each behind it, the outermost first: `/forest/tree/leaf[12][3]`. A primvar
//! of text may name prims and instances otherwise. Pure.

use super::{InstanceTarget, SceneDb, Snapshot};
use crate::desc::{InstancerDesc, PrimDesc};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// A primvar of text that names things.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NamingPrimvar {
    /// Texts by the path of a prim, of which the first counts, or of an instancer, by the number of an instance. An
    /// empty text is none.
    pub texts: FxHashMap<Arc<str>, Vec<Arc<str>>>,
}

/// An instancer on the way to a prim.
#[derive(Clone, Debug, PartialEq, Eq)]
struct InstancerLevel {
    /// The instancer, as hosts call it.
    path: Arc<str>,
    /// The number of its placements of what comes next.
    count: u32,
    /// Numbers of these among all of its instances, where a primvar names them.
    numbers: Option<Arc<[u32]>>,
}

/// Numbers of the instances of a prototype ([`instance_numbers`]), by instancer and root.
type NumbersOfPrototypes = FxHashMap<(Arc<str>, Arc<str>), Option<Arc<[u32]>>>;

/// The instancers on the way to an assembly or prim, from the outermost in; `None` where there are several ways, so
/// that the flat index of a placement does not say which one it is of.
type PrimWay = Option<Vec<InstancerLevel>>;

/// A prim and the way to it.
#[derive(Clone, Debug)]
struct NamedPrim {
    /// The path, as hosts call it.
    path: Arc<str>,
    way: PrimWay,
}

/// The names of a scene's prims and materials.
#[derive(Clone, Debug, Default)]
pub struct PrimNames {
    prims: FxHashMap<i32, NamedPrim>,
    materials: Vec<Arc<str>>,
}

impl PrimNames {
    /// The placement `instance` of the mesh with that Hydra id, `instance` the flat index, outer instancer slowest.
    #[must_use]
    pub fn object(&self, prim_id: i32, instance: u32) -> Option<String> {
        let NamedPrim { path, way } = self.prims.get(&prim_id)?;
        let indices = match way {
            Some(levels) => indices(levels, instance),
            None => vec![instance],
        };
        let behind: Vec<String> = indices.into_iter().map(|index| format!("[{index}]")).collect();
        Some(format!("{}{}", without_copies(path), behind.concat()))
    }

    /// The outermost instance that a placement is in, else the parent of its prim.
    #[must_use]
    pub fn asset(&self, prim_id: i32, instance: u32) -> Option<String> {
        let NamedPrim { path, way } = self.prims.get(&prim_id)?;
        let placed = way.as_ref().and_then(|levels| {
            let outermost = without_copies(&levels.first()?.path);
            Some(format!("{outermost}[{}]", indices(levels, instance).first()?))
        });
        let path = without_copies(path);
        let parent =
            || path.rsplit_once('/').map_or(&*path, |(parent, _)| if parent.is_empty() { &path } else { parent });
        Some(placed.unwrap_or_else(|| parent().to_owned()))
    }

    /// The text that a primvar has for a placement: that of the prim, else that of the innermost instance with one.
    #[must_use]
    pub fn text<'a>(&self, prim_id: i32, instance: u32, naming: &'a NamingPrimvar) -> Option<&'a str> {
        let NamedPrim { path, way } = self.prims.get(&prim_id)?;
        let of = |path: &Arc<str>, number: usize| {
            let text = naming.texts.get(path)?.get(number)?;
            (!text.is_empty()).then_some(&**text)
        };
        of(path, 0).or_else(|| {
            let levels = way.as_ref()?;
            let mut instances = levels.iter().zip(indices(levels, instance)).rev();
            instances.find_map(|(level, index)| {
                let number = *level.numbers.as_ref()?.get(index as usize)?;
                of(&level.path, number as usize)
            })
        })
    }

    /// The material of that number in the snapshot.
    #[must_use]
    pub fn material(&self, number: u32) -> Option<&str> {
        self.materials.get(number as usize).map(|path| &**path)
    }
}

/// The path without what hosts put into those of prototypes: names that tell nothing, and numbers that are others in
/// each process. `ForInstancer` and a number (`UsdImagingPiPrototypePropagatingSceneIndex`); `UsdNiInstancer`,
/// `UsdNiPrototype`, `UsdNiPropagatedPrototypes` with a name behind it (`UsdImagingNiPrototypePropagatingSceneIndex`).
fn without_copies(path: &str) -> String {
    let is_copy = |name: &str| {
        let number = name.strip_prefix("ForInstancer");
        number.is_some_and(|number| !number.is_empty() && number.bytes().all(|byte| byte.is_ascii_hexdigit()))
    };
    let mut names = path.split('/');
    let mut kept: Vec<&str> = Vec::new();
    while let Some(name) = names.next() {
        match name {
            "UsdNiPropagatedPrototypes" => drop(names.next()),
            "UsdNiInstancer" | "UsdNiPrototype" => {}
            name if is_copy(name) => {}
            name => kept.push(name),
        }
    }
    kept.join("/")
}

/// The index in each instancer of a flat index.
fn indices(levels: &[InstancerLevel], instance: u32) -> Vec<u32> {
    let mut rest = instance;
    let mut indices = vec![0; levels.len()];
    for (at, level) in levels.iter().enumerate().rev() {
        let count = level.count.max(1);
        indices[at] = rest % count;
        rest /= count;
    }
    indices
}

/// The ways to the assemblies and meshes of a snapshot.
struct PrimWays {
    assemblies: Vec<Option<PrimWay>>,
    prims: FxHashMap<i32, PrimWay>,
}

impl PrimWays {
    fn of(snapshot: &Snapshot) -> Self {
        let count = snapshot.assemblies.len();
        let mut ways = Self { assemblies: vec![None; count], prims: FxHashMap::default() };
        if let Some(root) = ways.assemblies.last_mut() {
            *root = Some(Some(Vec::new()));
        }
        let shown = |id: i32| {
            let at = usize::try_from(i64::from(id) + 1).ok();
            at.and_then(|at| snapshot.surfaces.prims.get(at)).and_then(|prim| prim.shown_as).unwrap_or(id)
        };
        // Children come before parents.
        for at in (0..count).rev() {
            let Some(way) = ways.assemblies[at].clone() else { continue };
            for member in snapshot.assemblies[at].members() {
                let level = member.run.is_instanced().then(|| InstancerLevel {
                    path: Arc::clone(&member.path),
                    count: member.prototype_count(),
                    numbers: None,
                });
                let next = way.as_ref().map(|levels| levels.iter().cloned().chain(level).collect::<Vec<_>>());
                match member.target {
                    InstanceTarget::Mesh(_) => {
                        let entry = ways.prims.entry(shown(member.prim_id)).or_insert_with(|| next.clone());
                        merge(entry, &next);
                    }
                    InstanceTarget::Assembly(index) => {
                        let Some(entry) = ways.assemblies.get_mut(index as usize) else { continue };
                        merge(entry.get_or_insert_with(|| next.clone()), &next);
                    }
                }
            }
        }
        ways
    }
}

/// Another way leads to the same place.
fn merge(have: &mut PrimWay, other: &PrimWay) {
    if have != other {
        *have = None;
    }
}

/// The numbers of the instances of a prototype, by their index in it.
fn instance_numbers(instancer: &InstancerDesc, root: &str) -> Option<Arc<[u32]>> {
    let indices = &instancer.prototypes.iter().find(|prototype| *prototype.root == *root)?.indices;
    let is_shown = |number: i32| match &instancer.mask {
        Some(mask) => usize::try_from(number).ok().and_then(|at| mask.boolean(at)).unwrap_or(true),
        None => true,
    };
    let shown = (0..indices.len()).filter_map(|at| indices.index(at)).filter(|number| is_shown(*number));
    // What is no number of an instance shows nothing.
    Some(shown.map(|number| u32::try_from(number).unwrap_or(u32::MAX)).collect())
}

impl SceneDb {
    /// The names of the prims and materials of the last commit's snapshot, for these primvars to name them.
    #[must_use]
    pub fn prim_names(&self, naming: &[Arc<NamingPrimvar>]) -> PrimNames {
        let mut ways = PrimWays::of(&self.snapshot).prims;
        let mut known = FxHashMap::default();
        let prims = self.meshes.iter().filter_map(|(path, entry)| {
            let id = entry.desc.prim_id;
            let mut way = ways.remove(&id)?;
            way.iter_mut().for_each(|levels| self.number(levels, &entry.desc.prim, naming, &mut known));
            Some((id, NamedPrim { path: Arc::clone(path), way }))
        });
        PrimNames { prims: prims.collect(), materials: self.snapshot.surfaces.material_paths.clone() }
    }

    /// Adds the numbers of the instances on the way to `prim` that a primvar names.
    fn number(
        &self,
        levels: &mut [InstancerLevel],
        prim: &PrimDesc,
        naming: &[Arc<NamingPrimvar>],
        known: &mut NumbersOfPrototypes,
    ) {
        let mut inner = Some(prim);
        for level in levels.iter_mut().rev() {
            let instancer = self.instancers.get(&level.path).map(|entry| &entry.desc);
            let by = inner.and_then(|inner| inner.instanced_by.iter().find(|by| by.instancer == level.path));
            inner = instancer.map(|instancer| &instancer.prim);
            let (Some(instancer), Some(by)) = (instancer, by) else { continue };
            if naming.iter().any(|primvar| primvar.texts.contains_key(&level.path)) {
                let key = (Arc::clone(&level.path), Arc::clone(&by.prototype_root));
                let numbers = known.entry(key).or_insert_with(|| instance_numbers(instancer, &by.prototype_root));
                level.numbers.clone_from(numbers);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(path: &str, count: u32) -> InstancerLevel {
        InstancerLevel { path: path.into(), count, numbers: None }
    }

    fn names(way: PrimWay) -> PrimNames {
        let prim = NamedPrim { path: "/forest/tree/leaf".into(), way };
        PrimNames { prims: [(7, prim)].into_iter().collect(), materials: Vec::new() }
    }

    #[test]
    fn a_placement_has_the_index_in_each_instancer() {
        let nested = names(Some(vec![level("/forest", 50), level("/forest/tree", 8)]));
        assert_eq!(nested.object(7, 12 * 8 + 3).as_deref(), Some("/forest/tree/leaf[12][3]"));
        assert_eq!(nested.asset(7, 12 * 8 + 3).as_deref(), Some("/forest[12]"));
        assert_eq!(nested.object(8, 0), None, "nobody has this id");
    }

    #[test]
    fn a_primvar_names_prims_and_the_innermost_instance_with_a_text() {
        let numbers = |numbers: &[u32]| Some(numbers.into());
        let outer = InstancerLevel { numbers: numbers(&[1, 0]), ..level("/forest", 2) };
        let inner = InstancerLevel { numbers: numbers(&[2, 9]), ..level("/forest/tree", 2) };
        let nested = names(Some(vec![outer, inner]));
        let mut naming = NamingPrimvar::default();
        let mut set = |path: &str, texts: &[&str]| {
            naming.texts.insert(path.into(), texts.iter().map(|text| Arc::from(*text)).collect());
            (0..4).map(|instance| nested.text(7, instance, &naming).map(str::to_owned)).collect::<Vec<_>>()
        };
        let texts = |texts: [&str; 4]| texts.map(|text| (!text.is_empty()).then(|| text.to_owned())).to_vec();
        assert_eq!(set("/elsewhere", &["x"]), texts(["", "", "", ""]));
        assert_eq!(set("/forest", &["oak", "fir"]), texts(["fir", "fir", "oak", "oak"]));
        assert_eq!(set("/forest/tree", &["", "", "low"]), texts(["low", "fir", "low", "oak"]), "there is no tenth");
        assert_eq!(set("/forest/tree/leaf", &[""]), texts(["low", "fir", "low", "oak"]), "an empty text is none");
        assert_eq!(set("/forest/tree/leaf", &["leaf", "x"]), texts(["leaf"; 4]));
    }

    #[test]
    fn numbers_that_change_from_process_to_process_are_no_part_of_a_name() {
        assert_eq!(without_copies("/a/Leaf/ForInstancer72ffcd9/ForInstancer01"), "/a/Leaf");
        let native = "/UsdNiPropagatedPrototypes/NoPrimvars_purpose98/__Prototype_1/UsdNiInstancer/UsdNiPrototype/Beam";
        assert_eq!(without_copies(native), "/__Prototype_1/Beam");
        assert_eq!(without_copies("/a/ForInstancerless/ForInstancer/b"), "/a/ForInstancerless/ForInstancer/b");
    }

    #[test]
    fn where_ways_differ_the_flat_index_stays() {
        let several = names(None);
        assert_eq!(several.object(7, 99).as_deref(), Some("/forest/tree/leaf[99]"));
        assert_eq!(several.asset(7, 99).as_deref(), Some("/forest/tree"));
        let mut way = Some(vec![level("/a", 2)]);
        merge(&mut way, &Some(vec![level("/a", 2)]));
        assert!(way.is_some(), "the same way twice");
        merge(&mut way, &Some(vec![level("/b", 2)]));
        assert_eq!(way, None);
    }

    #[test]
    fn what_no_instancer_places_is_its_path_and_its_parent() {
        let plain = names(Some(Vec::new()));
        assert_eq!(plain.object(7, 0).as_deref(), Some("/forest/tree/leaf"));
        assert_eq!(plain.asset(7, 0).as_deref(), Some("/forest/tree"));
    }
}
