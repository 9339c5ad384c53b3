// SPDX-License-Identifier: Apache-2.0
//! Tables of cutouts that nobody has made: random words, whose numbers and addresses now and then name something.

use super::{Random, World, put};
use bytemuck::Zeroable;
use oocpt_abi::{FrameConstants, GpuAttribute, GpuMaterial, GpuMesh, GpuPrim, GpuTexture, SLOT_PRESENCE};

/// Words of each of the ten tables, which lie one behind the other.
const WORDS: usize = 2048;
const TABLES: usize = 10;

/// A word as it comes, a small number, a float that is one or none, or all bits.
fn word(random: &mut Random) -> u32 {
    match random.below(6) {
        0 => random.word(),
        1 => random.signed().to_bits(),
        2 => [f32::NAN, f32::INFINITY, -3e38, 1e-40, 1.0, 4e9][random.below(6)].to_bits(),
        3 => u32::MAX,
        _ => small(random, 9),
    }
}

fn small(random: &mut Random, end: usize) -> u32 {
    u32::try_from(random.below(end)).expect("small")
}

impl World {
    /// Gives the mesh and the scene such tables.
    pub(crate) fn set_broken_cutouts(&mut self, random: &mut Random) {
        let words: Vec<u32> = (0..WORDS * TABLES).map(|_| word(random)).collect();
        let buffer = put(&self.gpu, "cutouts", &words);
        let begin = |table: usize| (4 * WORDS * table) as u64;
        let at = |table: usize| buffer.address() + begin(table);
        let somewhere = |random: &mut Random| match random.below(8) {
            0 => u64::from(random.word()) << random.below(32),
            1 => 0,
            _ => buffer.address() + random.below(4 * WORDS * TABLES) as u64,
        };
        let write = |table: usize, bytes: &[u8]| buffer.write(begin(table), bytes).expect("there is room");
        write(0, bytemuck::cast_slice(&[0; 8].map(|_| small(random, 4) | SLOT_PRESENCE)));
        let prims = [0; 2].map(|_| GpuPrim { first_slot: small(random, 6), slot_count: 4, ..GpuPrim::zeroed() });
        write(1, bytemuck::cast_slice(&prims));
        let opacity = oocpt_abi::MaterialInput::Opacity as usize;
        let mut materials: Vec<GpuMaterial> = bytemuck::cast_slice(&words[..4 * size_of::<GpuMaterial>() / 4]).to_vec();
        for material in &mut materials {
            material.names = material.names.map(|name| if name > 8 { name } else { name & 3 });
            material.cutout.mask = if random.below(2) == 0 { somewhere(random) } else { 0 };
            let input = &mut material.inputs[opacity];
            (input.kind, input.texture) = (random.word(), small(random, 40));
        }
        write(2, bytemuck::cast_slice(&materials));
        let mut textures = [GpuTexture::zeroed(); 32];
        for texture in &mut textures {
            *texture = GpuTexture {
                decode: somewhere(random),
                directory: 0,
                first_page: word(random),
                flags: random.word(),
                width: 1 << random.below(32),
                height: word(random),
                levels: word(random),
                ..GpuTexture::zeroed()
            };
        }
        write(3, bytemuck::cast_slice(&textures));
        let pages: Vec<u64> = (0..256).map(|_| somewhere(random)).collect();
        write(4, bytemuck::cast_slice(&pages));
        let primvars = [0; 4].map(|_| GpuAttribute {
            values: u64::from(word(random)),
            name: small(random, 4),
            rate_and_width: small(random, 4) | small(random, 6) << 8,
        });
        write(5, bytemuck::cast_slice(&primvars));
        let mut mesh = GpuMesh::zeroed();
        self.mesh.read(0, bytemuck::bytes_of_mut(&mut mesh)).expect("mapped");
        (mesh.primvars, mesh.primvar_count, mesh.corner_indices) = (at(5), word(random), at(6));
        self.mesh.write(0, bytemuck::bytes_of(&mesh)).expect("mapped");
        let frame = FrameConstants {
            material_slots: at(0),
            prims: at(1),
            materials: at(2),
            textures: at(3),
            texture_pages: at(4),
            cones: at(7),
            ..self.frame_block()
        };
        self.frame.write(0, bytemuck::bytes_of(&frame)).expect("mapped");
        self.cutouts = Some(buffer);
    }
}
