// SPDX-License-Identifier: Apache-2.0
//! What samples have for images of shadows, with the operations of `shaders/light/shadow_sums.glsl`.

use crate::scene::TraversalScene;
use crate::vector::{V3, dot3};
use oocpt_abi::{Features, NO_INDEX};
use oocpt_gpu::HostWords;

/// Luminance of linear Rec. 709.
const LUMINANCE: V3 = V3([0.2126, 0.7152, 0.0722]);

/// Where shadow rays of bounce 0 note how much of the light arrives that was asked for.
pub(super) struct ShadowSums<'v> {
    values: HostWords<'v>,
    stride: usize,
    /// The words of what arrives: three for images of shadows, one for shadow catchers.
    shadow: Option<usize>,
    catcher: Option<usize>,
}

impl<'v> ShadowSums<'v> {
    /// `None` if no image asks for them.
    pub(super) fn new(scene: &TraversalScene<'v>) -> Option<Self> {
        let frame = &scene.frame;
        let place = |first: u32, behind: usize| (first != NO_INDEX).then_some(first as usize + behind);
        scene.has(Features::SHADOW_SUMS).then(|| Self {
            values: scene.view.words(frame.light_values),
            stride: frame.light_stride as usize,
            shadow: place(frame.shadow_at, 3),
            catcher: place(frame.catcher_at, 1),
        })
    }

    /// So much of the light that the path's ray has asked for arrives.
    pub(super) fn store(&self, path: u32, arrives: V3) {
        let path = path as usize * self.stride;
        let scale = |word: usize, factor: f32| {
            self.values.store(word, (f32::from_bits(self.values.load(word)) * factor).to_bits());
        };
        if let Some(first) = self.shadow {
            arrives.0.into_iter().enumerate().for_each(|(channel, factor)| scale(path + first + channel, factor));
        }
        if let Some(word) = self.catcher {
            scale(path + word, dot3(LUMINANCE, arrives));
        }
    }
}
