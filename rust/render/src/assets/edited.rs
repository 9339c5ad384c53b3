// SPDX-License-Identifier: Apache-2.0
//! What an edit leaves as it is. After one of lights, or of placements in a few chunks of the world, lists, tables and
//! stacks are those of before but for these chunks: the edit costs a comparison of addresses, whatever the scene.
//! Everything else is listed anew, with the same result. Scenes in core only. Render thread only.

use super::cache::DeviceScene;
use super::catalog::SceneAssets;
use super::source::AssetKey;
use super::tables::{ShownTop, WRITE_TIMEOUT};
use crate::device::Device;
use crate::error::RenderError;
use crate::textures::{OpacityMasks, TextureSet};
use oocpt_core::partition::PartitionedWorld;
use oocpt_core::residency::AssetId;
use oocpt_core::scene::Snapshot;
use std::sync::Arc;

/// One chunk in so many may change, or one; of more, all are listed anew.
const SPARSE: usize = 8;

fn are_same<T>(old: &[Arc<T>], new: &[Arc<T>]) -> bool {
    old.len() == new.len() && old.iter().zip(new).all(|(old, new)| Arc::ptr_eq(old, new))
}

/// The chunks that differ between a scene and a later one which is otherwise the same but for lights.
#[derive(Debug)]
struct SceneEdit {
    chunks: Vec<usize>,
}

impl SceneEdit {
    /// `None` if more differs.
    fn between(assets: &SceneAssets, snapshot: &Snapshot, textures: &Arc<TextureSet>) -> Option<Self> {
        let old = &*assets.snapshot;
        let (world, new) = (&old.world, &snapshot.world);
        let is_same = are_same(&old.meshes, &snapshot.meshes) && assets.has_surfaces_of(snapshot, textures);
        if !is_same {
            return None;
        }
        if Arc::ptr_eq(world, new) && are_same(&old.assemblies, &snapshot.assemblies) {
            return Some(Self { chunks: Vec::new() });
        }
        // The root is no asset that anything needs, and the last one.
        let below = |snapshot: &Snapshot| snapshot.assemblies.len().saturating_sub(1);
        let has_same_below = below(old) == below(snapshot)
            && are_same(old.assemblies.get(..below(old))?, snapshot.assemblies.get(..below(snapshot))?);
        let has_same_places = world.chunks.len() == new.chunks.len()
            && world.instances.len() == new.instances.len()
            && (world.levels, &world.opened, &world.placed) == (new.levels, &new.opened, &new.placed);
        if assets.has_held || !has_same_below || !has_same_places {
            return None;
        }
        let pairs = || world.chunks.iter().zip(&new.chunks);
        let chunks: Vec<usize> =
            pairs().enumerate().filter(|(_, (old, new))| !Arc::ptr_eq(old, new)).map(|(at, _)| at).collect();
        let is_alike = |at: &usize| {
            let pair = world.chunks.get(*at).zip(new.chunks.get(*at));
            pair.is_some_and(|(old, new)| old.targets() == new.targets() && !new.is_held())
        };
        let are_few = chunks.len() <= (world.chunks.len() / SPARSE).max(1);
        (are_few && chunks.iter().all(is_alike)).then_some(Self { chunks })
    }
}

impl DeviceScene {
    /// Makes it the scene of a later snapshot, whose textures and masks are given, where little differs. Returns false,
    /// and nothing has changed, where it is to be made anew.
    pub(super) fn edit(
        &mut self,
        snapshot: &Arc<Snapshot>,
        textures: &Arc<TextureSet>,
        masks: &Arc<OpacityMasks>,
    ) -> bool {
        // Tables of an edit before that were not written are not known.
        if !self.is_in_core || self.shown_top.is_some() {
            return false;
        }
        let Some(edit) = SceneEdit::between(&self.assets, snapshot, textures) else { return false };
        let Some(assets) = Arc::get_mut(&mut self.assets) else { return false };
        let old = Arc::clone(&assets.snapshot);
        let key = |world: &PartitionedWorld, at: &usize| Some(AssetKey::Chunk(world.chunks.get(*at)?.key()));
        let new: Vec<AssetKey> = edit.chunks.iter().filter_map(|at| key(&snapshot.world, at)).collect();
        let gone = edit.chunks.iter().filter_map(|at| key(&old.world, at)).filter(|key| !new.contains(key));
        self.store.forget(gone);
        let nodes = assets.replace_chunks(snapshot, masks, &edit.chunks);
        self.listed += edit.chunks.len() as u64;
        let changed: Vec<AssetId> = edit.chunks.iter().map(|at| assets.chunk_asset(*at)).collect();
        if let Some(lacking) = &mut self.lacking {
            lacking.extend(&changed);
        }
        if let Some(nodes) = nodes {
            self.shown_top = Some(ShownTop { world: Arc::clone(&old.world), nodes });
            self.unshown = changed;
        }
        true
    }

    /// Writes what an edit has changed in the tables.
    pub(super) fn show_edit(&mut self, device: &Device) -> Result<(), RenderError> {
        let Some(before) = self.shown_top.take() else { return Ok(()) };
        let changed = std::mem::take(&mut self.unshown);
        changed.iter().for_each(|asset| self.show(*asset));
        self.renew_stacks(&changed);
        let Some(tables) = &mut self.tables else {
            return Err(RenderError::Internal("the scene's tables were not made".into()));
        };
        let mut commands = device.gpu.commands("tables of an edit")?;
        tables.make_room(device, &self.assets)?;
        let mut written = 0;
        commands.concurrent(|c| {
            written = tables.update(c, &self.assets, &self.entries, &changed);
            written += tables.update_top(c, &self.assets, &before);
        });
        self.table_bytes += written;
        if !commands.submit()?.wait(WRITE_TIMEOUT)? {
            return Err(RenderError::Internal("writing the scene's tables did not finish".into()));
        }
        Ok(())
    }
}
