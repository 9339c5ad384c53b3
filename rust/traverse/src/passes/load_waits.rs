// SPDX-License-Identifier: Apache-2.0
//! How often a path waits for loads, with the operations of `shaders/wavefront/load_waits.glsl`.

use crate::scene::TraversalScene;
use oocpt_abi::{Features, SHADOW_BIT, WAIT_WORDS};
use oocpt_gpu::HostWords;

/// Where waits are counted.
pub(super) struct LoadWaits<'v> {
    values: HostWords<'v>,
    stride: usize,
    /// The first word of a path's.
    first: usize,
}

impl<'v> LoadWaits<'v> {
    /// `None` if no image asks for them.
    pub(super) fn new(scene: &TraversalScene<'v>) -> Option<Self> {
        let frame = &scene.frame;
        scene.has(Features::LOAD_WAITS).then(|| Self {
            values: scene.view.words(frame.light_values),
            stride: frame.light_stride as usize,
            first: frame.light_words.saturating_sub(WAIT_WORDS) as usize,
        })
    }

    /// Counts the wait of a ray, by its entry on the list of deferred rays.
    pub(super) fn count(&self, entry: u32) {
        let path = (entry & !SHADOW_BIT) as usize;
        let word = path * self.stride + self.first + usize::from(entry & SHADOW_BIT != 0);
        self.values.store(word, (f32::from_bits(self.values.load(word)) + 1.0).to_bits());
    }
}
