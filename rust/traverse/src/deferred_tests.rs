// SPDX-License-Identifier: Apache-2.0
//! Streaming: the alpha tests that a walk defers because tiles are absent, and their answers (traversal/pending.glsl).
//! `resolve_cutouts` answers them. Any thread.

use crate::pending::{PendingItem, before};
use oocpt_abi::DeferredAlphaTest;
use oocpt_gpu::HostWords;

/// Number of words of a deferred alpha test.
const ALPHA_TEST_WORDS: usize = size_of::<DeferredAlphaTest>() / 4;

/// The deferred alpha test of a ray, and the answer that it came with.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DeferredTests {
    /// The nearest cutout, in the item with the smallest key, that cannot be tested because a tile is absent.
    deferred_test: Option<(PendingItem, DeferredAlphaTest)>,
    /// Item and answer that the ray came back with.
    answer: Option<(PendingItem, DeferredAlphaTest)>,
}

impl DeferredTests {
    /// Begins a ray with an answer, or without one.
    pub(crate) fn begin(&mut self, answer: Option<(PendingItem, DeferredAlphaTest)>) {
        (self.deferred_test, self.answer) = (None, answer);
    }

    /// Defers the alpha test of a cutout in an item, unless one before it was deferred already.
    pub(crate) fn defer(&mut self, item: PendingItem, q: DeferredAlphaTest) {
        let is_next = self.deferred_test.as_ref().is_none_or(|(asked, other)| {
            if item == *asked { before((q.t, q.id), (other.t, other.id)) } else { item.is_before(asked) }
        });
        if is_next {
            self.deferred_test = Some((item, q));
        }
    }

    /// The answer about an item.
    pub(crate) fn answer_of(&self, item: &PendingItem) -> Option<&DeferredAlphaTest> {
        self.answer.as_ref().filter(|(of, _)| of == item).map(|(_, answer)| answer)
    }

    /// The deferred alpha test of an item.
    pub(crate) fn test_of(&self, item: &PendingItem) -> Option<&DeferredAlphaTest> {
        self.deferred_test.as_ref().filter(|(of, _)| of == item).map(|(_, deferred_test)| deferred_test)
    }
}

/// Loads the deferred alpha test of a path.
pub(crate) fn load_alpha_test(alpha_tests: HostWords<'_>, path: u32) -> DeferredAlphaTest {
    let mut words = [0_u32; ALPHA_TEST_WORDS];
    for (i, word) in words.iter_mut().enumerate() {
        *word = alpha_tests.load(path as usize * ALPHA_TEST_WORDS + i);
    }
    bytemuck::cast(words)
}

/// Stores the deferred alpha test of a path.
pub(crate) fn store_alpha_test(alpha_tests: HostWords<'_>, path: u32, deferred_test: &DeferredAlphaTest) {
    let words: [u32; ALPHA_TEST_WORDS] = bytemuck::cast(*deferred_test);
    for (i, word) in words.into_iter().enumerate() {
        alpha_tests.store(path as usize * ALPHA_TEST_WORDS + i, word);
    }
}
