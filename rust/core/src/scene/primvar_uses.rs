// SPDX-License-Identifier: Apache-2.0
//! Which of the authored primvars were built, and which were left out because nothing reads them.

use super::SceneDb;
use super::entries::{InstancerEntry, MeshEntry};
use crate::desc::Primvar;
use crate::inventory::PrimvarUse;
use crate::mesh::AttributeSummary;
use rustc_hash::FxHashMap;

/// Sums by name.
#[derive(Default)]
struct PrimvarUses<'a> {
    by_name: FxHashMap<&'a str, PrimvarUse>,
}

impl<'a> PrimvarUses<'a> {
    /// Notes one prim's primvar, of so many bytes when it was built.
    fn note(&mut self, name: &'a str, built: Option<u64>, authored: impl FnOnce() -> u64) {
        let entry = self.by_name.entry(name).or_default();
        match built {
            Some(bytes) => {
                entry.made += 1;
                entry.bytes = entry.bytes.saturating_add(bytes);
            }
            None => {
                entry.left_out += 1;
                entry.saved = entry.saved.saturating_add(authored());
            }
        }
    }

    fn mesh(&mut self, entry: &'a MeshEntry) {
        let Some(built) = &entry.built else { return };
        let desc = &entry.desc;
        let assets = || built.asset.iter().chain(&built.clusters);
        let one = |attribute: Option<u64>| attribute.filter(|bytes| *bytes > 0);
        let special = [
            ("normals", &desc.normals, assets().map(|mesh| bytes_of(mesh.normals)).sum()),
            ("displayColor", &desc.display_color, assets().map(|mesh| bytes_of(mesh.colors)).sum()),
            ("displayOpacity", &desc.display_opacity, assets().map(|mesh| bytes_of(mesh.opacities)).sum()),
        ];
        for (name, primvar, bytes) in special {
            if let Some(primvar) = primvar.as_ref().filter(|primvar| !primvar.values.is_empty()) {
                self.note(name, one(Some(bytes)), || authored_bytes(primvar));
            }
        }
        for named in &desc.primvars {
            let wanted = entry.wanted.iter().find(|wanted| wanted.name == named.name);
            let bytes = wanted.map(|wanted| {
                let values = assets().flat_map(|mesh| &mesh.primvars).filter(|primvar| primvar.id == wanted.id);
                values.map(|primvar| primvar.values.bytes()).sum()
            });
            self.note(&named.name, one(bytes), || authored_bytes(&named.primvar));
        }
    }

    fn instancer(&mut self, entry: &'a InstancerEntry) {
        for primvar in &entry.primvars {
            let count = entry.instance_count() as u64;
            let bytes = || 4 * count * u64::from(primvar.width().unwrap_or(0));
            let offered = entry.offers.iter().any(|offer| std::sync::Arc::ptr_eq(&offer.primvar, primvar));
            self.note(&primvar.name, offered.then(bytes), bytes);
        }
    }
}

impl SceneDb {
    /// The authored primvars of meshes that are shown and of instancers, by name: what of them the last commit built,
    /// and what it left out.
    #[must_use]
    pub fn primvar_uses(&self) -> Vec<PrimvarUse> {
        let mut uses = PrimvarUses::default();
        self.meshes.values().for_each(|entry| uses.mesh(entry));
        self.instancers.values().for_each(|entry| uses.instancer(entry));
        let named = |(name, entry): (&str, PrimvarUse)| PrimvarUse { name: name.to_owned(), ..entry };
        let mut all: Vec<PrimvarUse> = uses.by_name.into_iter().map(named).collect();
        all.sort_by(|a, b| a.name.cmp(&b.name));
        all
    }
}

fn bytes_of(attribute: Option<AttributeSummary>) -> u64 {
    attribute.map_or(0, |attribute| attribute.bytes())
}

/// What the values would take as floats, one for each index where there are indices.
fn authored_bytes(primvar: &Primvar) -> u64 {
    let count =
        primvar.indices.as_ref().filter(|indices| !indices.is_empty()).map_or(primvar.values.len(), |i| i.len());
    4 * count as u64 * primvar.values.element().components() as u64
}
