// SPDX-License-Identifier: Apache-2.0
//! Light path expressions: which of the light that reaches the camera an image shows.
//!
//! A path is a word of events: the camera, each surface that scatters, and what shines. An expression is a regular
//! expression over such words in the syntax of Open Shading Language ("Light path expressions" in its manual), with
//! the spellings of `RenderMan`, Karma and Arnold. Follow an expression: [`PathExpression::parse`] (`parse`), then
//! [`PathAutomaton::new`] (`automaton`), one deterministic automaton of all expressions of a render, which paths carry
//! along.
//!
//! Texts come from strangers: length, depth and the size of automata are bounded. Pure; any thread.

mod automaton;
mod parse;

use std::sync::Arc;

pub use automaton::{AutomatonLimit, MAX_STATES, PathAutomaton};
pub use oocpt_abi::{MAX_EXPRESSIONS, PathEvent};
pub use parse::ExpressionError;

/// The label of lights and surfaces that have none of their own, as Arnold's light groups call it.
pub const DEFAULT_LABEL: &str = "default";

/// Events by kind: bits of [`PathEvent`], and one of the camera.
type EventKinds = u16;
/// The camera, with which every path begins.
const CAMERA: EventKinds = 1 << PathEvent::ALL.len();
/// The bit of an event.
const fn bit(event: PathEvent) -> EventKinds {
    1 << event as u32
}

/// Every event.
const ANY_EVENT: EventKinds = (CAMERA << 1) - 1;
/// The sharp lobes; the bits of the glossy ones are one lower.
const SHARP: EventKinds = bit(PathEvent::SharpReflection) | bit(PathEvent::SharpTransmission);

/// Labels that an event may have.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum LabelTest {
    Any,
    OneOf(Vec<Arc<str>>),
    NoneOf(Vec<Arc<str>>),
}

/// A kind of events with certain labels.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct EventTest {
    kinds: EventKinds,
    labels: LabelTest,
}

/// A set of events: one that passes any of these tests; negated, one that passes none.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct EventSet {
    tests: Vec<EventTest>,
    is_negated: bool,
}

impl EventSet {
    /// Whether the event of this kind (one bit) and label is in the set; `None`: a label that no expression names.
    fn has(&self, kind: EventKinds, label: Option<&str>) -> bool {
        let passes = self.tests.iter().any(|test| {
            let is_listed = |list: &[Arc<str>]| list.iter().any(|have| Some(&**have) == label);
            test.kinds & kind != 0
                && match &test.labels {
                    LabelTest::Any => true,
                    LabelTest::OneOf(list) => is_listed(list),
                    LabelTest::NoneOf(list) => !is_listed(list),
                }
        });
        passes != self.is_negated
    }

    /// The labels that it names.
    fn labels(&self) -> impl Iterator<Item = &Arc<str>> {
        self.tests.iter().flat_map(|test| match &test.labels {
            LabelTest::Any => &[][..],
            LabelTest::OneOf(list) | LabelTest::NoneOf(list) => list,
        })
    }
}

/// A regular expression over events.
#[derive(Clone, Debug, PartialEq, Eq)]
enum PathPattern {
    Event(EventSet),
    Sequence(Vec<Self>),
    Either(Vec<Self>),
    /// So many times at least and at most; `None`: without end.
    Repeat(Box<Self>, u32, Option<u32>),
}

impl PathPattern {
    /// Calls `visit` with every set of events.
    fn each_set(&mut self, visit: &mut impl FnMut(&mut EventSet)) {
        match self {
            Self::Event(set) => visit(set),
            Self::Sequence(parts) | Self::Either(parts) => parts.iter_mut().for_each(|part| part.each_set(visit)),
            Self::Repeat(part, ..) => part.each_set(visit),
        }
    }
}

/// A light path expression.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PathExpression {
    pattern: PathPattern,
    /// It distinguishes glossy lobes from sharp ones: `G` occurs.
    names_glossy: bool,
    /// Nothing is in the way of its light (`unoccluded;`).
    is_unoccluded: bool,
}

impl PathExpression {
    /// Reads an expression, with or without `color ` and `lpe:` before it.
    ///
    /// # Errors
    /// [`ExpressionError`] says what is wrong, and at which character.
    pub fn parse(text: &str) -> Result<Self, ExpressionError> {
        parse::expression(text)
    }

    /// The expression without `color ` and `lpe:` and without spaces outside of labels: equal ones are the same image.
    #[must_use]
    pub fn plain_text(text: &str) -> String {
        let mut quote = None;
        let is_kept = |c: &char| {
            match quote {
                None if matches!(c, '\'' | '"') => quote = Some(*c),
                Some(open) if open == *c => quote = None,
                _ => {}
            }
            quote.is_some() || !c.is_whitespace()
        };
        parse::without_prefix(text).1.chars().filter(is_kept).collect()
    }
}
