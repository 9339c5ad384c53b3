// SPDX-License-Identifier: Apache-2.0
//! What a material asks about whether its surfaces are there: traversal/presence.glsl, without programs and Ptex. Any
//! thread.

use crate::leaf;
use crate::opacity_mask::{MaskCandidate, coverage_at};
use crate::scene::TraversalScene;
use crate::texture::TextureLookup;
use crate::vector::V3;
use crate::walk::RayTraversal;
use oocpt_abi::{
    Features, GpuCutout, GpuInput, GpuMaterial, GpuPrim, INPUT_CHANNEL_SHIFT, INPUT_NO_SET, INPUT_PRIMVAR,
    INPUT_SET_SHIFT, INPUT_TEXTURE, MAX_PRIM_ID, MESH_LEAF_MASK, MaterialInput, NO_MATERIAL, SLOT_PRESENCE,
    SUBSET_MASK,
};
use std::mem::offset_of;

/// Where the opacity comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum OpacitySource {
    Value(f32),
    Texel {
        lookup: TextureLookup,
        scale: f32,
        bias: f32,
    },
    /// So many parts of 255 are there.
    Covered(u8),
}

/// What to ask.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AlphaTest {
    pub(crate) opacity: OpacitySource,
    /// 0: the opacity is a probability.
    pub(crate) threshold: f32,
}

/// A member of a material in the table of them.
macro_rules! member {
    ($scene:expr, $material:expr, $($member:ident).+) => {
        $scene.of_material($material, offset_of!(GpuMaterial, $($member).+))
    };
}

impl TraversalScene<'_> {
    /// The word of a surface's slot (`material_slot`).
    pub(crate) fn material_slot(&self, prim_id: i32, subset: u32) -> u32 {
        let index = prim_id.wrapping_add(1).cast_unsigned();
        if index > MAX_PRIM_ID {
            return NO_MATERIAL;
        }
        match self.prims.get::<GpuPrim>(index as usize) {
            Some(prim) if subset < prim.slot_count => {
                self.material_slots.get(prim.first_slot.wrapping_add(subset) as usize).unwrap_or(NO_MATERIAL)
            }
            _ => NO_MATERIAL,
        }
    }

    fn of_material<T: bytemuck::AnyBitPattern>(&self, material: u32, offset: usize) -> Option<T> {
        self.materials.at_byte((material as usize).checked_mul(size_of::<GpuMaterial>())?.checked_add(offset)?)
    }

    /// `cone_width`.
    fn cone_width(&self, path: u32, t: f32) -> f32 {
        let [width, spread] = self.cones.get::<[f32; 2]>(path as usize).unwrap_or_default();
        spread * t + width
    }
}

impl<const ANY_HIT: bool> RayTraversal<'_, '_, ANY_HIT> {
    /// What the material of a candidate asks; none where it does not.
    pub(crate) fn presence(&self, triangle: u32, subset_and_sides: u32, t: f32, uv: [f32; 2]) -> Option<AlphaTest> {
        let scene = self.scene;
        let slot = scene.material_slot(self.instance.prim_id, subset_and_sides & SUBSET_MASK);
        if slot == NO_MATERIAL || slot & SLOT_PRESENCE == 0 {
            return None;
        }
        let material = slot & !SLOT_PRESENCE;
        let threshold = member!(scene, material, opacity_threshold)?;
        let offset = offset_of!(GpuMaterial, inputs) + MaterialInput::Opacity as usize * size_of::<GpuInput>();
        let input: GpuInput = scene.of_material(material, offset)?;
        let set = (input.kind >> INPUT_SET_SHIFT) & 3;
        let value = input.value[0];
        let opacity = match input.kind & 3 {
            INPUT_PRIMVAR => {
                let names: [u32; 4] = member!(scene, material, names)?;
                let name = names[2 + (set as usize & 1)];
                let own = self.mesh_primvar(name, triangle).map(|corners| corners.at(uv));
                OpacitySource::Value(own.or_else(|| self.instance_primvar(name)).map_or(value, |found| found[0]))
            }
            // Without images there is nothing to read: opaque.
            INPUT_TEXTURE if !scene.has(Features::TEXTURES) => OpacitySource::Value(1.0),
            INPUT_TEXTURE => self.texel(material, &input, triangle, t, uv)?,
            _ => OpacitySource::Value(value),
        };
        Some(AlphaTest { opacity, threshold })
    }

    /// Which texel is the opacity of a candidate, or what the mask says: of the finest level, however wide the ray is.
    fn texel(&self, material: u32, input: &GpuInput, triangle: u32, t: f32, uv: [f32; 2]) -> Option<OpacitySource> {
        let scene = self.scene;
        let set = (input.kind >> INPUT_SET_SHIFT) & 3;
        // A shadow ray starts as wide as its surface was seen and stays so.
        let (cone, d) = (scene.cone_width(self.world.path, if ANY_HIT { 0.0 } else { t }), self.direction());
        let mut st = [0.0; 2];
        if set != INPUT_NO_SET {
            let set = set as usize & 1;
            let names: [u32; 4] = member!(scene, material, names)?;
            let cutout: Option<GpuCutout> =
                if scene.has(Features::OPACITY_MASKS) { Some(member!(scene, material, cutout)?) } else { None };
            let cutout = cutout.filter(|cutout| cutout.mask != 0);
            if let Some(corners) = self.mesh_primvar(names[set], triangle) {
                let [x, y, ..] = corners.at(uv);
                st = [x, y];
                let edges = self.edges(triangle)?;
                let place = MaskCandidate { corners: &corners, uv, edges, direction: d, cone };
                if let Some(coverage) = cutout.and_then(|cutout| coverage_at(scene.view, &cutout, &place)) {
                    return Some(OpacitySource::Covered(coverage));
                }
            } else if let Some([x, y, ..]) = self.instance_primvar(names[set]) {
                st = [x, y];
            } else {
                let fallback: [[f32; 2]; 2] = member!(scene, material, set_fallback)?;
                st = fallback[set];
            }
        }
        let channel = ((input.kind >> INPUT_CHANNEL_SHIFT) & 7).saturating_sub(1);
        let map = [input.row_s, input.row_t];
        let st = map.map(|row| row[0] * st[0] + row[1] * st[1] + row[2]);
        let lookup = TextureLookup { texture: input.texture, st, width: 0.0, channel };
        let at = channel as usize & 3;
        Some(OpacitySource::Texel { lookup, scale: input.value[at], bias: input.bias[at] })
    }

    /// `item_edges`.
    fn edges(&self, triangle: u32) -> Option<[V3; 2]> {
        let (corners, _) = self.pose.item(triangle)?;
        let features = self.scene.special.features;
        if self.mesh.flags & MESH_LEAF_MASK != 0
            && let Some(kind) = leaf::kind_of(self.mesh.flags, features)
        {
            return Some(leaf::edges(kind, corners));
        }
        let [a, b, c] = corners;
        Some([b - a, c - a])
    }
}
