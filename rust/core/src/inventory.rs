// SPDX-License-Identifier: Apache-2.0
//! Inventory of a render: the parts that its scene, camera and request need, and those that were left out.
//!
//! Plain data, serialisable; any thread. Bytes are of device memory, unless they are of host memory that the device
//! reaches (readback, upload). The renderer fills it in from the objects that it made, not from the request.

use serde::{Deserialize, Serialize};

/// Largest number of primvars that are listed by name: names come from scenes of strangers.
pub const MAX_PRIMVARS: usize = 64;
/// Longest name of a primvar that is listed, characters.
const MAX_NAME_CHARS: usize = 80;

/// The parts that a render was made of, and those that were left out.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct RenderInventory {
    /// Parts of the passes that are compiled only for scenes that need them.
    pub features: Vec<FeatureUse>,
    /// Passes of the renderer; each one that was made is one pipeline.
    pub passes: Vec<PassUse>,
    /// Buffers and tables by name.
    pub buffers: Vec<BufferUse>,
    /// Authored primvars by name, at most [`MAX_PRIMVARS`].
    pub primvars: Vec<PrimvarUse>,
    /// Further names of primvars, not listed.
    #[serde(default)]
    pub more_primvars: u64,
    /// Number of levels of instance records that the passes are compiled for.
    pub max_levels: u32,
    /// Number of entries of a ray's stack that the passes are compiled for.
    pub stack_size: u32,
    /// Paths in flight.
    pub paths: u64,
    /// Backend that traces the rays.
    #[serde(default)]
    pub traversal: TraversalUse,
}

/// The traversal backend of a render.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct TraversalUse {
    /// `compute` or `native`.
    pub backend: String,
    /// Reason for the choice, in words.
    pub why: String,
}

/// A feature of the passes.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct FeatureUse {
    /// Name in the shaders.
    pub name: String,
    /// Description in words.
    pub what: String,
    /// True if the feature is compiled in.
    pub present: bool,
    /// Compiled in although the scene does not need it, for benches and tests.
    #[serde(default)]
    pub carried: bool,
}

/// A pass.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PassUse {
    /// Name of its shader.
    pub name: String,
    /// True if there is a pipeline of it for this render.
    pub made: bool,
    /// Seconds that compiling its pipeline took when this process first needed it; 0 if it was left out.
    pub compile_secs: f64,
}

/// A buffer or table.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct BufferUse {
    /// Name in debuggers and errors.
    pub name: String,
    /// Bytes; 0 when left out.
    pub bytes: u64,
    /// Bytes saved because the scene needs less: all of them if it was left out.
    pub saved: u64,
}

/// A primvar of meshes, or with a value per instance.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct PrimvarUse {
    /// Its name without `primvars:`.
    pub name: String,
    /// Number of meshes and instancers whose values are used.
    pub made: u64,
    /// Number of meshes and instancers that have it and whose values nothing reads.
    pub left_out: u64,
    /// Bytes of the values used, as floats; a shared mesh counts once for each prim.
    pub bytes: u64,
    /// Bytes that the authored values which nothing reads would take as floats.
    pub saved: u64,
}

impl RenderInventory {
    /// Bytes of all buffers.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.buffers.iter().map(|buffer| buffer.bytes).fold(0, u64::saturating_add)
    }

    /// Bytes saved because the scene does not need them, primvars included.
    #[must_use]
    pub fn saved(&self) -> u64 {
        let buffers = self.buffers.iter().map(|buffer| buffer.saved);
        buffers.chain(self.primvars.iter().map(|primvar| primvar.saved)).fold(0, u64::saturating_add)
    }

    /// Pipelines of this render.
    #[must_use]
    pub fn pipelines(&self) -> usize {
        self.passes.iter().filter(|pass| pass.made).count()
    }

    /// Notes a buffer that is there.
    pub fn add(&mut self, name: &str, bytes: u64) {
        self.note(name, bytes, 0);
    }

    /// Notes a buffer that would have this many bytes if something needed it.
    pub fn leave_out(&mut self, name: &str, bytes: u64) {
        self.note(name, 0, bytes);
    }

    fn note(&mut self, name: &str, bytes: u64, saved: u64) {
        match self.buffers.iter_mut().find(|buffer| buffer.name == name) {
            Some(known) => {
                known.bytes = known.bytes.saturating_add(bytes);
                known.saved = known.saved.saturating_add(saved);
            }
            None => self.buffers.push(BufferUse { name: name.to_owned(), bytes, saved }),
        }
    }

    /// Sets the primvars: those with most bytes first, at most [`MAX_PRIMVARS`], names cut short.
    pub fn set_primvars(&mut self, mut primvars: Vec<PrimvarUse>) {
        let weight = |primvar: &PrimvarUse| primvar.bytes.saturating_add(primvar.saved);
        primvars.sort_by(|a, b| weight(b).cmp(&weight(a)).then_with(|| a.name.cmp(&b.name)));
        self.more_primvars = primvars.len().saturating_sub(MAX_PRIMVARS) as u64;
        primvars.truncate(MAX_PRIMVARS);
        for primvar in &mut primvars {
            primvar.name = primvar.name.chars().filter(|c| !c.is_control()).take(MAX_NAME_CHARS).collect();
        }
        self.primvars = primvars;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn present_and_omitted_bytes_are_summed_separately() {
        let mut inventory = RenderInventory::default();
        inventory.add("rays", 100);
        inventory.add("rays", 20);
        inventory.leave_out("cones", 7);
        assert_eq!((inventory.bytes(), inventory.saved()), (120, 7), "{inventory:?}");
        assert_eq!(inventory.buffers.len(), 2, "one entry for each name");
        inventory.add("all", u64::MAX);
        assert_eq!(inventory.bytes(), u64::MAX, "sums do not wrap");
    }

    #[test]
    fn scene_given_names_are_bounded_in_number_and_length() {
        let primvar =
            |k: u64| PrimvarUse { name: format!("{k}\n{}", "x".repeat(1000)), saved: k, ..PrimvarUse::default() };
        let mut inventory = RenderInventory::default();
        inventory.set_primvars((0..1000).map(primvar).collect());
        assert_eq!((inventory.primvars.len() as u64, inventory.more_primvars), (64, 936), "no more than can be read");
        let first = &inventory.primvars[0];
        assert!(first.saved == 999 && first.name.starts_with("999x") && first.name.len() == 80, "{first:?}");
    }
}
