// SPDX-License-Identifier: Apache-2.0
//! Names of what a sample can meet, for files that identify it by name (Cryptomatte): placements of prims, the
//! outermost instance that they are in, materials. Names are paths, which stay the same from frame to frame; a
//! placement in instancers has the index in each behind it, the outermost first: `/forest/tree/leaf[12][3]`. Pure.

use super::{InstanceTarget, SceneDb, Snapshot};
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// An instancer on the way to a prim, and the number of its placements of what comes next.
type InstancerLevel = (Arc<str>, u32);

/// The instancers on the way to an assembly or prim, from the outermost in; `None` where there are several ways, so
/// that the flat index of a placement does not say which one it is of.
type PrimWay = Option<Vec<InstancerLevel>>;

/// The names of a scene's prims and materials.
#[derive(Clone, Debug, Default)]
pub struct PrimNames {
    prims: FxHashMap<i32, (Arc<str>, PrimWay)>,
    materials: Vec<Arc<str>>,
}

impl PrimNames {
    /// The placement `instance` of the mesh with that Hydra id, `instance` the flat index, outer instancer slowest.
    #[must_use]
    pub fn object(&self, prim_id: i32, instance: u32) -> Option<String> {
        let (path, way) = self.prims.get(&prim_id)?;
        let indices = match way {
            Some(levels) => indices(levels, instance),
            None => vec![instance],
        };
        let behind: Vec<String> = indices.into_iter().map(|index| format!("[{index}]")).collect();
        Some(format!("{path}{}", behind.concat()))
    }

    /// The outermost instance that a placement is in, else the parent of its prim.
    #[must_use]
    pub fn asset(&self, prim_id: i32, instance: u32) -> Option<String> {
        let (path, way) = self.prims.get(&prim_id)?;
        let placed = way.as_ref().and_then(|levels| {
            let (instancer, _) = levels.first()?;
            Some(format!("{instancer}[{}]", indices(levels, instance).first()?))
        });
        let parent =
            || path.rsplit_once('/').map_or(&**path, |(parent, _)| if parent.is_empty() { path } else { parent });
        Some(placed.unwrap_or_else(|| parent().to_owned()))
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
    for (at, (_, count)) in levels.iter().enumerate().rev() {
        indices[at] = rest % count.max(&1);
        rest /= count.max(&1);
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
                let level = member.run.is_instanced().then(|| (Arc::clone(&member.path), member.prototype_count()));
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

impl SceneDb {
    /// The names of the prims and materials of the last commit's snapshot.
    #[must_use]
    pub fn prim_names(&self) -> PrimNames {
        let mut ways = PrimWays::of(&self.snapshot).prims;
        let prims = self.meshes.iter().filter_map(|(path, entry)| {
            let id = entry.desc.prim_id;
            let levels = ways
                .remove(&id)?
                .map(|levels| levels.into_iter().map(|(path, count)| (without_copies(&path).into(), count)).collect());
            Some((id, (without_copies(path).into(), levels)))
        });
        PrimNames { prims: prims.collect(), materials: self.snapshot.surfaces.material_paths.clone() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn level(path: &str, count: u32) -> InstancerLevel {
        (path.into(), count)
    }

    fn names(way: PrimWay) -> PrimNames {
        PrimNames { prims: [(7, ("/forest/tree/leaf".into(), way))].into_iter().collect(), materials: Vec::new() }
    }

    #[test]
    fn a_placement_has_the_index_in_each_instancer() {
        let nested = names(Some(vec![level("/forest", 50), level("/forest/tree", 8)]));
        assert_eq!(nested.object(7, 12 * 8 + 3).as_deref(), Some("/forest/tree/leaf[12][3]"));
        assert_eq!(nested.asset(7, 12 * 8 + 3).as_deref(), Some("/forest[12]"));
        assert_eq!(nested.object(8, 0), None, "nobody has this id");
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
