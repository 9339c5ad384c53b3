// SPDX-License-Identifier: Apache-2.0
//! Edits of the scene as the commit thread takes them: it converts what the host has given, prim by prim.

use crate::convert::{self, ConversionWarnings};
use crate::ffi;
use crate::{light, material};
use oocpt_core::scene::summary;
use oocpt_render::SceneEdit;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Complaints of edits that were converted and whose batch is not at its end.
type BatchComplaints = Arc<Mutex<ConversionWarnings>>;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A batch of edits. What cannot be converted is added to `warnings`, summed up over the batch.
pub(crate) fn of(batch: ffi::SceneEdits, warnings: &Arc<Mutex<Vec<String>>>) -> Vec<SceneEdit> {
    let complaints = BatchComplaints::default();
    let removed = batch.removed.into_iter().inspect(|path| tracing::debug!(path, "remove")).map(SceneEdit::Remove);
    let materials = batch.materials.into_iter().map(|desc| edit_material(desc, &complaints));
    let meshes = batch.meshes.into_iter().map(|desc| edit_mesh(desc, &complaints));
    let instancers = batch.instancers.into_iter().map(|desc| edit_instancer(desc, &complaints));
    let lights = batch.lights.into_iter().map(edit_light);
    let mut edits: Vec<SceneEdit> = removed.chain(materials).chain(meshes).chain(instancers).chain(lights).collect();
    if !edits.is_empty() {
        let warnings = Arc::clone(warnings);
        edits.push(SceneEdit::other(move |_| lock(&warnings).append(&mut summary(&lock(&complaints).0))));
    }
    edits
}

/// Shows meshes of these purposes only.
pub(crate) fn purposes(purposes: Vec<String>) -> SceneEdit {
    SceneEdit::other(move |scene| scene.set_purposes(&purposes.iter().map(String::as_str).collect::<Vec<_>>()))
}

fn edit_material(desc: ffi::MaterialDesc, complaints: &BatchComplaints) -> SceneEdit {
    let complaints = Arc::clone(complaints);
    SceneEdit::upsert(desc.path.clone(), move |scene| {
        let material = material::material(desc, &mut lock(&complaints));
        tracing::debug!(?material, "upsert");
        scene.upsert_material(material);
    })
}

fn edit_mesh(desc: ffi::MeshDesc, complaints: &BatchComplaints) -> SceneEdit {
    let complaints = Arc::clone(complaints);
    SceneEdit::upsert(desc.prim.path.clone(), move |scene| {
        let mesh = convert::mesh(desc, &mut lock(&complaints));
        tracing::debug!(?mesh, "upsert");
        scene.upsert_mesh(mesh);
    })
}

fn edit_instancer(desc: ffi::InstancerDesc, complaints: &BatchComplaints) -> SceneEdit {
    let complaints = Arc::clone(complaints);
    SceneEdit::upsert(desc.prim.path.clone(), move |scene| {
        let instancer = convert::instancer(desc, &mut lock(&complaints));
        tracing::debug!(?instancer, "upsert");
        scene.upsert_instancer(instancer);
    })
}

fn edit_light(desc: ffi::LightDesc) -> SceneEdit {
    SceneEdit::upsert(desc.prim.path.clone(), move |scene| {
        let light = light::light(desc);
        tracing::debug!(?light, "upsert");
        scene.upsert_light(light);
    })
}
