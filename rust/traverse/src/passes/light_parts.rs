// SPDX-License-Identifier: Apache-2.0
//! Light that is kept apart by light path expressions, with the operations of `shaders/light/parts.glsl`.

use crate::scene::TraversalScene;
use crate::vector::V3;
use oocpt_abi::{Features, GpuPathAutomaton, GpuPathStates, STATES_OF_ALL};
use oocpt_gpu::{HostBytes, HostWords};

/// Where shadow rays add what they bring to the parts of light.
pub(super) struct LightParts<'v> {
    accepts: HostBytes<'v>,
    states: HostBytes<'v>,
    values: HostWords<'v>,
    stride: usize,
    /// The expressions that count what is in the way.
    occluded: u32,
}

impl<'v> LightParts<'v> {
    /// `None` if the frame keeps no light apart.
    pub(super) fn new(scene: &TraversalScene<'v>) -> Option<Self> {
        let (view, frame) = (scene.view, &scene.frame);
        let automaton = view.bytes(frame.automaton).item::<GpuPathAutomaton>(0)?;
        scene.has(Features::PATH_EXPRESSIONS).then(|| Self {
            accepts: view.bytes(automaton.accepts),
            states: view.bytes(frame.shadow_states),
            values: view.words(frame.light_values),
            stride: frame.light_stride as usize,
            occluded: !automaton.unoccluded,
        })
    }

    /// Adds what the shadow ray of a path brings.
    pub(super) fn add(&self, path: u32, light: V3) {
        let Some(mut states) = self.states.item::<GpuPathStates>(path) else { return };
        let counted = if states.states[0] & STATES_OF_ALL == 0 { self.occluded } else { u32::MAX };
        states.states[0] &= !STATES_OF_ALL;
        let first = path as usize * self.stride;
        for (channel, light) in light.0.into_iter().enumerate() {
            let state = states.states[channel];
            let [diffuse, other] =
                [state & 0xffff, state >> 16].map(|state| self.accepts.item::<u32>(state).unwrap_or(0) & counted);
            let part = light * states.share[channel];
            let rest = light - part;
            let mut left = diffuse | other;
            while left != 0 {
                let expression = left.trailing_zeros();
                let value = match (diffuse >> expression & 1, other >> expression & 1) {
                    (1, 1) => light,
                    (1, _) => part,
                    _ => rest,
                };
                let word = first + 3 * expression as usize + channel;
                self.values.store(word, (f32::from_bits(self.values.load(word)) + value).to_bits());
                left &= left - 1;
            }
        }
    }
}
