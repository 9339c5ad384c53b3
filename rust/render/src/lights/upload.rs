// SPDX-License-Identifier: Apache-2.0
//! The light table on the device: always resident, in the scene's heap, so that it counts in the budget. Render thread
//! only.
//!
//! Pictures and meshes that emit light stay from frame to frame as long as they are used; the rest is small and is
//! written anew.

use super::MeshLights;
use super::picture::EncodedPicture;
use super::table::{LightTable, PlacedPicture};
use crate::assets::AssetCopier;
use crate::device::Device;
use crate::error::RenderError;
use oocpt_abi::{GpuLightMap, LightTablePointers};
use oocpt_core::inventory::RenderInventory;
use oocpt_gpu::HeapRange;
use std::sync::Arc;
use std::time::Duration;

/// The longest time that writing may take before the device counts as lost.
const WRITE_TIMEOUT: Duration = Duration::from_secs(120);

/// A picture on the device.
#[derive(Debug)]
struct ResidentPicture {
    picture: Arc<EncodedPicture>,
    texels: HeapRange,
    cells: Option<HeapRange>,
}

/// Meshes that emit light, on the device.
#[derive(Debug)]
struct ResidentMeshes {
    lights: Arc<MeshLights>,
    /// Tables in the order of the addresses in [`LightTablePointers`]; `None` for those that are not needed.
    tables: Vec<Option<HeapRange>>,
}

/// Addresses of the tables of meshes, as [`ResidentMeshes`] has them; 0 for those that are not needed.
#[derive(Clone, Copy, Debug)]
struct MeshTables([u64; 12]);

impl MeshTables {
    /// The block with these addresses.
    fn with(self, block: LightTablePointers) -> LightTablePointers {
        let [
            mesh_lights,
            light_meshes,
            mesh_nodes,
            light_leaves,
            light_triangles,
            light_faces,
            values,
            weights,
            placed,
            corners,
            mesh_motion,
            mesh_keys,
        ] = self.0;
        LightTablePointers {
            mesh_lights,
            light_meshes,
            mesh_nodes,
            light_leaves,
            light_triangles,
            light_faces,
            light_values: values,
            light_face_weights: weights,
            light_placed_values: placed,
            light_corners: corners,
            mesh_motion,
            mesh_keys,
            ..block
        }
    }
}

/// The tables of lights, pictures and mesh lights on the device.
#[derive(Debug, Default)]
pub(crate) struct LightTables {
    pictures: Vec<ResidentPicture>,
    meshes: Option<ResidentMeshes>,
    tables: Vec<HeapRange>,
    /// Address of the [`LightTablePointers`]; 0 before the first [`Self::sync`].
    pub(crate) lighting: u64,
    /// Address of the masks of prims; 0 without any.
    pub(crate) prim_masks: u64,
}

impl LightTables {
    /// Makes the device hold what `lights` need, and nothing else.
    pub(crate) fn sync(&mut self, device: &Device, lights: &LightTable) -> Result<(), RenderError> {
        self.tables.clear();
        (self.lighting, self.prim_masks) = (0, 0);
        self.pictures.retain(|have| lights.maps.iter().any(|map| Arc::ptr_eq(&map.picture, &have.picture)));
        let ring = device.loader()?.ring();
        let mut writer = AssetCopier::new(&device.gpu, ring);
        for map in &lights.maps {
            if !self.pictures.iter().any(|have| Arc::ptr_eq(&map.picture, &have.picture)) {
                self.pictures.push(ResidentPicture::new(device, &mut writer, &map.picture)?);
            }
        }
        let meshes = self.sync_meshes(device, &mut writer, lights.meshes.as_ref())?;
        let maps: Vec<GpuLightMap> = lights.maps.iter().map(|map| self.entry(map)).collect();
        let mut put = |name: &str, bytes: &[u8]| -> Result<u64, RenderError> {
            if bytes.is_empty() {
                return Ok(0);
            }
            let range = device.heap.alloc(name, bytes.len() as u64, 16)?;
            writer.bytes(&range, 0, bytes)?;
            let address = range.address();
            self.tables.push(range);
            Ok(address)
        };
        let block = LightTablePointers {
            local_lights: put("local lights", bytemuck::cast_slice(&lights.locals))?,
            nodes: put("light tree", bytemuck::cast_slice(&lights.nodes))?,
            infinite_lights: put("lights at infinity", bytemuck::cast_slice(&lights.infinite))?,
            shapings: put("light shapings", bytemuck::cast_slice(&lights.shapings))?,
            ies: put("IES profiles", bytemuck::cast_slice(&lights.profiles))?,
            maps: put("light maps", bytemuck::cast_slice(&maps))?,
            link_bits: put("light links", bytemuck::cast_slice(&lights.link_bits))?,
            prim_sets: put("light links of prims", bytemuck::cast_slice(&lights.prim_sets))?,
            light_keys: put("light keys", bytemuck::cast_slice(&lights.keys))?,
            local_motion: put("motion of local lights", bytemuck::cast_slice(&lights.local_motion))?,
            infinite_motion: put("motion of lights at infinity", bytemuck::cast_slice(&lights.infinite_motion))?,
            local_reaches: put("reach of shadows", bytemuck::cast_slice(&lights.local_reaches))?,
            infinite_reaches: put("reach of shadows at infinity", bytemuck::cast_slice(&lights.infinite_reaches))?,
            ..meshes.with(lights.block())
        };
        let prim_masks = put("masks of prims", bytemuck::cast_slice(&lights.prim_masks))?;
        let lighting = put("lighting", bytemuck::bytes_of(&block))?;
        let copies = writer.finish()?.submissions;
        for copy in &copies {
            if !copy.wait(WRITE_TIMEOUT)? {
                return Err(RenderError::Internal("writing the lights did not finish".into()));
            }
        }
        (self.lighting, self.prim_masks) = (lighting, prim_masks);
        Ok(())
    }

    /// Lists the tables on the device.
    pub(crate) fn list(&self, inventory: &mut RenderInventory) {
        let pictures = self.pictures.iter().flat_map(|have| std::iter::once(&have.texels).chain(&have.cells));
        let meshes = self.meshes.iter().flat_map(|meshes| meshes.tables.iter().flatten());
        for range in pictures.chain(meshes).chain(&self.tables) {
            inventory.add(range.name(), range.size());
        }
    }

    /// Addresses of the tables of the meshes that emit light, in the order of [`LightTablePointers`]; 0 without any.
    fn sync_meshes(
        &mut self,
        device: &Device,
        writer: &mut AssetCopier<'_>,
        wanted: Option<&Arc<MeshLights>>,
    ) -> Result<MeshTables, RenderError> {
        self.meshes = self.meshes.take().filter(|have| wanted.is_some_and(|wanted| Arc::ptr_eq(wanted, &have.lights)));
        if let (None, Some(wanted)) = (&self.meshes, wanted) {
            self.meshes = Some(ResidentMeshes::new(device, writer, wanted)?);
        }
        let table = |at: usize| self.meshes.as_ref().and_then(|meshes| meshes.tables.get(at)?.as_ref());
        Ok(MeshTables(std::array::from_fn(|at| table(at).map_or(0, HeapRange::address))))
    }

    fn entry(&self, map: &PlacedPicture) -> GpuLightMap {
        let have = self.pictures.iter().find(|have| Arc::ptr_eq(&map.picture, &have.picture));
        let EncodedPicture { width, height, format, columns, rows, .. } = *map.picture;
        let [x, y, z] = map.rows;
        let texels = have.map_or(0, |have| have.texels.address());
        let cells = have.and_then(|have| have.cells.as_ref()).map_or(0, HeapRange::address);
        GpuLightMap { texels, cells, width, height, columns, rows, x, format, y, pad0: 0, z, pad1: 0 }
    }
}

impl ResidentMeshes {
    fn new(device: &Device, writer: &mut AssetCopier<'_>, lights: &Arc<MeshLights>) -> Result<Self, RenderError> {
        let mut put = |name: &str, bytes: &[u8]| -> Result<Option<HeapRange>, RenderError> {
            if bytes.is_empty() {
                return Ok(None);
            }
            let range = device.heap.alloc(name, bytes.len() as u64, 16)?;
            writer.bytes(&range, 0, bytes)?;
            Ok(Some(range))
        };
        let tables = vec![
            put("mesh lights", bytemuck::cast_slice(&lights.placements))?,
            put("meshes of mesh lights", bytemuck::cast_slice(&lights.meshes))?,
            put("trees of mesh lights", bytemuck::cast_slice(&lights.nodes))?,
            put("leaves of mesh lights", bytemuck::cast_slice(&lights.leaves))?,
            put("triangles of mesh lights", bytemuck::cast_slice(&lights.triangles))?,
            put("faces of mesh lights", bytemuck::cast_slice(&lights.faces))?,
            put("emission of mesh lights", bytemuck::cast_slice(&lights.values))?,
            put("weights of mesh lights", bytemuck::cast_slice(&lights.face_weights))?,
            put("instances' emission of mesh lights", bytemuck::cast_slice(&lights.placed_values))?,
            put("corners of mesh lights", bytemuck::cast_slice(&lights.corners))?,
            put("motion of mesh lights", bytemuck::cast_slice(&lights.motion))?,
            put("keys of mesh lights", bytemuck::cast_slice(&lights.keys))?,
        ];
        Ok(Self { lights: Arc::clone(lights), tables })
    }
}

impl ResidentPicture {
    fn new(device: &Device, writer: &mut AssetCopier<'_>, picture: &Arc<EncodedPicture>) -> Result<Self, RenderError> {
        let texels = device.heap.alloc("light picture", picture.bytes.len() as u64, 16)?;
        writer.bytes(&texels, 0, &picture.bytes)?;
        let mut cells = None;
        if !picture.cells.is_empty() {
            let bytes: &[u8] = bytemuck::cast_slice(&picture.cells);
            let range = device.heap.alloc("dome distribution", bytes.len() as u64, 16)?;
            writer.bytes(&range, 0, bytes)?;
            cells = Some(range);
        }
        Ok(Self { picture: Arc::clone(picture), texels, cells })
    }
}
