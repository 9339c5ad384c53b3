// SPDX-License-Identifier: Apache-2.0
//! Streaming: what a walk asks about cutouts whose tiles are absent, and was told (traversal/pending.glsl).
//! `resolve_cutouts` answers. Any thread.

use crate::pending::before;
use oocpt_gpu::HostWords;
use oocpt_shader_abi::Question;

/// Words of a question.
const QUESTION_WORDS: usize = size_of::<Question>() / 4;

/// What a walk asks with streaming, and what it was told.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Asking {
    /// The nearest cutout, in the chunk instance with the smallest key, that cannot be answered because a tile is
    /// absent, and where that chunk instance is entered.
    question: Option<(f32, Question)>,
    /// What the ray came back with.
    answer: Option<Question>,
    /// Where the current chunk instance was entered, as its parent said.
    chunk_entry: f32,
    /// Something in it waits for a tile.
    chunk_waits: bool,
}

impl Asking {
    /// Of a ray that comes with an answer or none.
    pub(crate) fn begin(&mut self, answer: Option<Question>) {
        (self.question, self.answer) = (None, answer);
    }

    /// The walk enters a chunk instance.
    pub(crate) fn enter(&mut self, entry: f32) {
        (self.chunk_entry, self.chunk_waits) = (entry, false);
    }

    /// Asks, unless something before it was asked already. Where the chunk instance was entered, the first time that
    /// something in it waits.
    pub(crate) fn ask(&mut self, q: Question) -> Option<f32> {
        let is_next = self.question.as_ref().is_none_or(|(entry, other)| {
            if q.chunk_instance == other.chunk_instance {
                before((q.t, q.id), (other.t, other.id))
            } else {
                before((self.chunk_entry, q.chunk_instance), (*entry, other.chunk_instance))
            }
        });
        if is_next {
            self.question = Some((self.chunk_entry, q));
        }
        let waited = std::mem::replace(&mut self.chunk_waits, true);
        (!waited).then_some(self.chunk_entry)
    }

    /// What the ray was told about a chunk instance.
    pub(crate) fn answer_about(&self, chunk_instance: u32) -> Option<&Question> {
        self.answer.as_ref().filter(|answer| answer.chunk_instance == chunk_instance)
    }

    /// What was asked about a chunk instance.
    pub(crate) fn question_about(&self, chunk_instance: u32) -> Option<&Question> {
        self.question.as_ref().map(|(_, question)| question).filter(|q| q.chunk_instance == chunk_instance)
    }
}

/// The question of a path.
pub(crate) fn load_question(questions: HostWords<'_>, path: u32) -> Question {
    let mut words = [0_u32; QUESTION_WORDS];
    for (i, word) in words.iter_mut().enumerate() {
        *word = questions.load(path as usize * QUESTION_WORDS + i);
    }
    bytemuck::cast(words)
}

/// Keeps the question of a path.
pub(crate) fn store_question(questions: HostWords<'_>, path: u32, question: &Question) {
    let words: [u32; QUESTION_WORDS] = bytemuck::cast(*question);
    for (i, word) in words.into_iter().enumerate() {
        questions.store(path as usize * QUESTION_WORDS + i, word);
    }
}
