// SPDX-License-Identifier: Apache-2.0
//! A commit of the scene: edits in, a snapshot and what a job needs beside it out.

use crate::device::loader::Loader;
use crate::error::panic_text;
use crate::geometry_files::{GeometryFiles, GeometrySetting};
use crate::host_memory::{self, HostMemoryTaken, HostMemoryUser};
use crate::job::MeshCounts;
use crate::job::commits::{CommittedScene, RenderAsk};
use crate::job::edits::EditQueue;
use crate::job::request::Severity;
use crate::job::shared::SharedState;
use crate::report::material_report::MaterialReport;
use crate::textures::{FileContents, HeightTextures};
use oocpt_core::inventory::PrimvarUse;
use oocpt_core::mesh::MeshFiles;
use oocpt_core::partition::PartitionOptions;
use oocpt_core::scene::{DicingCamera, LentBytes, SceneDb, Snapshot, summary};
use oocpt_core::settings::Settings;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;
use xxhash_rust::xxh3::xxh3_128;

/// How a commit ends.
#[derive(Debug)]
pub(super) enum CommitEnd {
    Done(CommittedScene),
    Failed,
    /// Later edits are committed in its place.
    GivenUp,
}

/// A session's scene, and what its commits keep.
#[derive(Debug, Default)]
pub(super) struct SessionScene {
    pub(super) db: SceneDb,
    pub(super) heights: Option<Arc<HeightTextures>>,
    geometry_files: Option<Arc<GeometryFiles>>,
    /// Of the snapshot of that version.
    primvars: (u64, Arc<[PrimvarUse]>),
    /// What its files contain.
    contents: FileContents,
    /// What `oocpt:materialReport` was written of: edits of materials, and the file.
    material_report: (u64, String),
    /// What was said last of the budget of host memory.
    host_complaint: Option<String>,
}

impl SessionScene {
    /// Edits the scene. An edit that fails is lost, and told.
    pub(super) fn edit(&mut self, edits: EditQueue, shared: &SharedState) {
        for edit in edits {
            let path = edit.path().to_owned();
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| edit.apply(&mut self.db))) {
                let text = format!("{path}: an edit is lost: internal error: {}", panic_text(panic.as_ref()));
                tracing::error!(text, "caught a panic of an edit");
                shared.report(Severity::Error, text);
            }
        }
    }

    /// Commits the scene for `ask`; a failure is told. Unless it is done, the next commit begins where this one began.
    pub(super) fn commit(&mut self, ask: &RenderAsk, shared: &Arc<SharedState>) -> CommitEnd {
        catch_unwind(AssertUnwindSafe(|| self.committed(ask, shared)))
            .inspect_err(|panic| {
                let text = panic_text(panic.as_ref());
                tracing::error!(text, "caught a panic of a commit");
                let told = "the scene could not be committed, and is tried again with the next change";
                let told = format!("{told}: internal error: {text}; the picture is of the scene before");
                shared.report(Severity::Error, told);
            })
            .map_or(CommitEnd::Failed, |scene| scene.map_or(CommitEnd::GivenUp, CommitEnd::Done))
    }

    /// The scene for `ask`; `None` if edits that have come meanwhile make it moot.
    fn committed(&mut self, ask: &RenderAsk, shared: &Arc<SharedState>) -> Option<CommittedScene> {
        let settings = &ask.settings;
        self.heights.iter().for_each(|heights| heights.keep_in(settings));
        self.db.set_partition(PartitionOptions { chunk_bytes: u64::from(settings.chunk_size_kib) << 10 });
        let dicing = DicingCamera::new(&ask.request.camera, settings.dicing_rate).live(settings.interactive);
        self.db.set_dicing(dicing);
        self.db.set_live(settings.interactive);
        self.db.show_primvars(&ask.shown_primvars());
        // Measured by the device, where it places what moves.
        self.db.set_late(shared.places_moved.load(Ordering::Relaxed));
        let lent = self.keep_meshes(settings, shared);
        #[cfg(feature = "faults")]
        shared.commit_gate.pass();
        let commit = self.db.commit_unless(&|building| shared.control().commits.makes_moot(building))?;
        let fixed_host_bytes = self.watch_host_memory(settings, &lent, &commit.snapshot, shared)
            + host_memory::film_files(settings, ask.request.pixels());
        self.report_materials(&settings.material_report, shared);
        for line in summary(&commit.warnings) {
            shared.report(Severity::Warning, line);
        }
        let primvars = self.primvars_of(commit.snapshot.version);
        let meshes = MeshCounts { made: self.db.meshes_made(), refitted: self.db.meshes_refitted() };
        let has_file = [&settings.checkpoint, &settings.film_part].iter().any(|file| !file.is_empty());
        let identity = (has_file && !settings.interactive).then(|| self.identity(ask));
        let names = ask.names_things().then(|| Arc::new(self.db.prim_names(&ask.naming())));
        Some(CommittedScene { snapshot: commit.snapshot, primvars, identity, names, meshes, fixed_host_bytes })
    }

    /// Has meshes built and kept as the settings say. With a budget of host memory gives what the scene's arrays take.
    fn keep_meshes(&mut self, settings: &Settings, shared: &Arc<SharedState>) -> LentBytes {
        let budget = host_memory::budget(settings);
        let lent = budget.map(|_| self.db.lent()).unwrap_or_default();
        let tables = self.db.snapshot().world.host_bytes();
        let fixed = lent.bytes + tables + Loader::staging_bytes();
        let has_rendered = shared.control().job.is_some();
        let commit = host_memory::of_commit(settings, fixed, has_rendered);
        self.db.set_host_budget(budget.unwrap_or(u64::MAX));
        self.db.set_partition_memory(commit.sorting);
        let memory = self.db.mesh_memory();
        memory.set_room(commit.building);
        memory.set_limit(host_memory::limit_of(HostMemoryUser::Meshes, settings, memory.held(), fixed));
        let setting = GeometrySetting::of(settings);
        if self.geometry_files.as_ref().map(|files| files.setting()) != setting.as_ref() {
            self.geometry_files = setting.map(|setting| Arc::new(GeometryFiles::new(setting, shared)));
            self.db.set_mesh_files(self.geometry_files.clone().map(|files| files as Arc<dyn MeshFiles>));
        }
        lent
    }

    /// With a budget of host memory: the bytes that can be put nowhere else; tells where they are more than there is,
    /// or where meshes have no other place.
    fn watch_host_memory(
        &mut self,
        settings: &Settings,
        lent: &LentBytes,
        snapshot: &Snapshot,
        shared: &SharedState,
    ) -> u64 {
        let Some(budget) = host_memory::budget(settings) else { return 0 };
        let tables = snapshot.world.host_bytes();
        let memory = self.db.mesh_memory();
        let taken = HostMemoryTaken {
            lent,
            tables,
            staging: Loader::staging_bytes(),
            held: memory.held(),
            building: memory.overrun(),
            has_files: self.geometry_files.is_some(),
        };
        let complaint = host_memory::complaint(budget, &taken);
        // Once, however often the scene is rendered.
        if let Some(text) = complaint.as_ref().filter(|_| self.host_complaint != complaint) {
            shared.report(Severity::Warning, text.clone());
        }
        self.host_complaint = complaint;
        lent.bytes + tables + Loader::staging_bytes()
    }

    /// The hash that films of the scene are known by.
    fn identity(&mut self, ask: &RenderAsk) -> u128 {
        let started = Instant::now();
        let contents = &self.contents;
        contents.begin();
        let images = ask.images.as_deref();
        let scene = self.db.identity(&|asset| contents.of(asset, images));
        let identity = xxh3_128(format!("{scene:032x} {}", contents.of_colors(images)).as_bytes());
        tracing::debug!(seconds = started.elapsed().as_secs_f64(), "the scene's hash");
        identity
    }

    fn primvars_of(&mut self, version: u64) -> Arc<[PrimvarUse]> {
        if self.primvars.0 != version {
            self.primvars = (version, self.db.primvar_uses().into());
        }
        Arc::clone(&self.primvars.1)
    }

    /// Writes the report that `oocpt:materialReport` names, once for each state of the materials.
    fn report_materials(&mut self, file: &str, shared: &SharedState) {
        let wanted = (self.db.material_edits(), file.to_owned());
        if file.is_empty() || self.material_report == wanted {
            return;
        }
        self.material_report = wanted;
        if let Err(error) = MaterialReport::of(&self.db).write(Path::new(file)) {
            shared.report(Severity::Warning, format!("oocpt:materialReport: {error}"));
        }
    }
}
