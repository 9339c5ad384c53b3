// SPDX-License-Identifier: Apache-2.0
//! Evaluates if the material lets a surface exist for a ray: `is_cut_in` of traversal/opacity.glsl. Any thread.

use crate::pending::before;
use crate::presence::{AlphaTest, OpacitySource};
use crate::texture::{LookupResult, TextureLookup};
use crate::walk::{CandidateSurface, RayTraversal};
use oocpt_abi::sampler::{combine, hash, unit_float};
use oocpt_abi::{DeferredAlphaTest, RayFlags, SECOND_SURFACE};

/// Bits of `DeferredAlphaTest::flags`, as in traversal/cutout.glsl.
const CHANNEL_SHIFT: u32 = 4;
const INCLUSIVE: u32 = 64;
const PRESENT: u32 = 128;

/// Alpha test by a mask, as `is_covered` of the shaders: returns true if a ray meets the kept part of a cell with this
/// coverage, in parts of 255; `chance` is a random number in [0, 1).
fn is_covered(coverage: u8, is_chance: bool, of_aovs: bool, chance: impl FnOnce() -> f32) -> bool {
    match coverage {
        0 | 255 => coverage != 0,
        coverage if of_aovs => is_chance || coverage >= 128,
        coverage => chance() * 255.0 < f32::from(coverage),
    }
}

impl<const ANY_HIT: bool> RayTraversal<'_, '_, ANY_HIT> {
    /// The deferred alpha test that is stored with the items that the ray waits for: one about the first of its list.
    pub(crate) fn kept_alpha_test(&self) -> Option<&DeferredAlphaTest> {
        self.deferred_tests.test_of(self.pending.items().first()?)
    }

    /// The flags of a ray that waits for the pending items (`pending_flags`).
    pub(crate) fn waiting_flags(&self) -> u32 {
        let asked = self.kept_alpha_test().map_or(RayFlags::empty(), |_| RayFlags::ASKED);
        self.pending.flags() | asked.bits()
    }

    /// Returns true if the surface exists for this ray according to its material.
    #[inline(never)]
    pub(crate) fn is_cut_in(&mut self, surface: CandidateSurface, t: f32, uv: [f32; 2]) -> bool {
        let CandidateSurface { item: triangle, number, subset_and_sides } = surface;
        let records = &self.chain[..=self.level_index()];
        let above = records.iter().fold(self.chunk_instance, |id, &record| combine(id, record));
        let id = combine(above, triangle | (number & SECOND_SURFACE));
        if let Some(answer) = self.deferred_tests.answer_of(&self.item) {
            if before((t, id), (answer.t, answer.id)) {
                return false;
            }
            if t == answer.t && id == answer.id {
                return answer.flags & PRESENT != 0;
            }
        }
        let Some(AlphaTest { opacity, threshold }) = self.presence(triangle, subset_and_sides, t, uv) else {
            return true;
        };
        let is_chance = threshold <= 0.0;
        let of_aovs = self.scene.is_of_aovs();
        let chance = || unit_float(hash(combine(self.world.seed, combine(above, number))));
        let limit = match is_chance {
            false => threshold,
            true if of_aovs => 0.0,
            true => chance(),
        };
        let is_there = |opacity: f32| opacity > limit || (!is_chance && opacity == limit);
        let (lookup, scale, bias) = match opacity {
            OpacitySource::Value(value) => return is_there(value),
            OpacitySource::Covered(coverage) => return is_covered(coverage, is_chance, of_aovs, chance),
            OpacitySource::Texel { lookup, scale, bias } => (lookup, scale, bias),
        };
        match self.scene.look_up(self.world.path, &lookup) {
            LookupResult::Texel(texel) => is_there(texel * scale + bias),
            LookupResult::Fallback(value) => is_there(value),
            LookupResult::Waits { page, taps, mean } => {
                let TextureLookup { texture, st, width, channel } = lookup;
                let flags = channel << CHANNEL_SHIFT | if is_chance { 0 } else { INCLUSIVE } | taps;
                let unit = self.scene.streaming.first_tile.wrapping_add(page);
                let (chunk_instance, mean) = (self.chunk_instance, [mean; 4]);
                self.wait_for(DeferredAlphaTest {
                    t,
                    id,
                    chunk_instance,
                    flags,
                    mean,
                    texture,
                    st,
                    width,
                    scale,
                    bias,
                    limit,
                    unit,
                });
                false
            }
        }
    }

    /// Defers the alpha test, and adds the item to the list that the ray waits for.
    fn wait_for(&mut self, deferred_test: DeferredAlphaTest) {
        self.deferred_tests.defer(self.item, deferred_test);
        self.pending.remember(self.item);
    }
}
