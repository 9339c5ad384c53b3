// SPDX-License-Identifier: Apache-2.0
//! Streaming: what a walk asks about cutouts whose tiles are absent, and was told (traversal/pending.glsl).
//! `resolve_cutouts` answers. Any thread.

use crate::pending::{PendingItem, before};
use oocpt_abi::DeferredAlphaTest;
use oocpt_gpu::HostWords;

/// Words of a question.
const QUESTION_WORDS: usize = size_of::<DeferredAlphaTest>() / 4;

/// What a walk asks with streaming, and what it was told.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct CutoutQuestions {
    /// The nearest cutout, in the item with the smallest key, that cannot be answered because a tile is absent.
    question: Option<(PendingItem, DeferredAlphaTest)>,
    /// What the ray came back with.
    answer: Option<(PendingItem, DeferredAlphaTest)>,
}

impl CutoutQuestions {
    /// Of a ray that comes with an answer or none.
    pub(crate) fn begin(&mut self, answer: Option<(PendingItem, DeferredAlphaTest)>) {
        (self.question, self.answer) = (None, answer);
    }

    /// Asks about something in an item, unless something before it was asked already.
    pub(crate) fn ask(&mut self, item: PendingItem, q: DeferredAlphaTest) {
        let is_next = self.question.as_ref().is_none_or(|(asked, other)| {
            if item == *asked { before((q.t, q.id), (other.t, other.id)) } else { item.is_before(asked) }
        });
        if is_next {
            self.question = Some((item, q));
        }
    }

    /// What the ray was told about an item.
    pub(crate) fn answer_about(&self, item: &PendingItem) -> Option<&DeferredAlphaTest> {
        self.answer.as_ref().filter(|(of, _)| of == item).map(|(_, answer)| answer)
    }

    /// What was asked about an item.
    pub(crate) fn question_about(&self, item: &PendingItem) -> Option<&DeferredAlphaTest> {
        self.question.as_ref().filter(|(of, _)| of == item).map(|(_, question)| question)
    }
}

/// The question of a path.
pub(crate) fn load_question(questions: HostWords<'_>, path: u32) -> DeferredAlphaTest {
    let mut words = [0_u32; QUESTION_WORDS];
    for (i, word) in words.iter_mut().enumerate() {
        *word = questions.load(path as usize * QUESTION_WORDS + i);
    }
    bytemuck::cast(words)
}

/// Keeps the question of a path.
pub(crate) fn store_question(questions: HostWords<'_>, path: u32, question: &DeferredAlphaTest) {
    let words: [u32; QUESTION_WORDS] = bytemuck::cast(*question);
    for (i, word) in words.into_iter().enumerate() {
        questions.store(path as usize * QUESTION_WORDS + i, word);
    }
}
