// SPDX-License-Identifier: Apache-2.0
//! Scene data on the device: the list of assets (`catalog`), the sources of their bytes (`source`), loading (`load`,
//! `encode`, `level`), the resident assets (`store`), the encodings and the shapes of trees kept in host memory
//! (`kept`, `shapes`), what the device places by itself (`moved`, `placing`, `lent_arrays`), the tables that rays read
//! (`tables`), and all of it from frame to frame (`cache`).
//!
//! The way of a mesh from a snapshot to a ray: `catalog` -> `store` -> `load` -> `encode` -> `tables`; an instance
//! takes the same way through `level`.

mod cache;
mod catalog;
mod copied;
mod demand;
mod edited;
mod encode;
mod host_heap;
mod kept;
mod lent_arrays;
mod level;
mod load;
mod moved;
mod place;
mod placing;
mod shapes;
mod source;
mod store;
mod surfaces;
mod tables;
mod values;

pub(crate) use cache::{DeviceScene, SceneCache, SceneView};
pub(crate) use catalog::SceneAssets;
pub(crate) use demand::TilesOutcome;
pub(crate) use encode::AssetCopier;
pub(crate) use host_heap::{HostHeapFiller, bytes_with_gaps};
pub(crate) use level::motion_key;
pub(crate) use store::{AssetStore, MemoryWait};
#[cfg(test)]
pub(crate) use surfaces::SurfaceEntries;
pub(crate) use tables::{SceneTables, TableEntries};
