// SPDX-License-Identifier: Apache-2.0
//! The parts of OocPT that need no Vulkan, clock, thread of their own or file: the scene database (edits in, immutable
//! snapshots out), mesh preparation (checking, triangulation, hierarchies), materials, camera rays, lights, settings.
//!
//! Guarantees: nothing here panics on any input; everything is a pure function of its arguments; work is spread over
//! the caller's rayon pool and the result does not depend on the number of its threads.

#![forbid(unsafe_code)]

pub mod adaptive;
pub mod again;
pub mod array;
pub mod camera;
mod camera_motion;
mod clipping;
pub mod convergence;
pub mod desc;
pub mod file_space;
mod instancing;
pub mod inventory;
pub mod material;
pub mod mesh;
pub mod partition;
pub mod path_expression;
pub mod pixel_filter;
pub mod residency;
pub mod scene;
pub mod settings;
pub mod stats;
pub mod texture;

pub use array::{ArrayElement, ArrayError, ArraySource, ArrayView, ElementType, TypedArray};
pub use camera::{Camera, CameraError, CameraRays};
pub use camera_motion::{CameraMotion, CameraMotionError};
pub use clipping::MAX_CLIP_PLANES;
pub use material::{ColorSpace, InputValue, Material, TextureRef, Wrap};
pub use mesh::{Aabb, AnyAttribute, Attribute, Bvh2, Bvh4, BvhError, BvhNode, MeshAsset, MeshPrimvar, Triangle};
/// Programs of `MaterialX` patterns.
pub use oocpt_materialx as materialx;
pub use partition::{
    Chunk, ChunkInstance, OpenedAssembly, PartitionOptions, PartitionedWorld, RECORD_BYTES, WorldError,
};
pub use scene::{
    Assembly, AssetRef, ConnectionDesc, DomeFormat, DroppedData, InstanceRecord, InstanceTarget, InstancedBy,
    InstancerDesc, InstancerPrototype, Interpolation, Light, LightDesc, LightKind, MaterialDesc, MeshDesc, MotionKey,
    NamedPrimvar, NodeDesc, ParamDesc, ParamValue, PrimDesc, PrimRecord, Primvar, SceneCommit, SceneCounts, SceneDb,
    SceneMesh, SceneWarning, ShapingCone, Snapshot, SnapshotError, Subdivision, SubsetDesc, SurfaceTables,
    TransformSample,
};
pub use settings::{SettingAudience, SettingError, SettingInfo, SettingValue, Settings};
pub use stats::{ErrorRow, RenderStats, StreamingStats, TrueError, WorstPixel};
