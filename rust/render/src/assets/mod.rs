// SPDX-License-Identifier: Apache-2.0
//! Scene data on the device: what there is (`catalog`), where its bytes come from (`source`), how they get there
//! (`load`, `encode`, `level`), what is there now (`store`) and kept in host memory (`kept`), the tables that rays go
//! through (`tables`), and all of it from frame to frame (`cache`).
//!
//! The straight line of a mesh from a snapshot to a ray: `catalog` -> `store` -> `load` -> `encode` -> `tables`; of an
//! instance the same by `level`.

mod cache;
mod catalog;
mod demand;
mod encode;
mod host_heap;
mod kept;
mod level;
mod load;
mod place;
mod source;
mod store;
mod surfaces;
mod tables;
mod values;

pub(crate) use cache::{DeviceScene, SceneCache, SceneView};
pub(crate) use catalog::SceneAssets;
pub(crate) use demand::TilesOutcome;
pub(crate) use encode::AssetCopier;
pub(crate) use host_heap::{HostHeapFiller, bytes_with_holes};
pub(crate) use level::motion_key;
pub(crate) use store::{AssetStore, MemoryWait};
#[cfg(test)]
pub(crate) use surfaces::SurfaceEntries;
pub(crate) use tables::{SceneTables, TableEntries};
