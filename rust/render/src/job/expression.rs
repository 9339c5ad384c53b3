// SPDX-License-Identifier: Apache-2.0
//! Light path expressions as images know them: by a number, so that requests and images compare as cheaply as those of
//! other kinds. Numbers are of the process and never used again; texts are bounded in length and number. Any thread.

use crate::sync::lock;
use oocpt_core::path_expression::{PathAutomaton, PathExpression};
use std::sync::{Arc, Mutex};

/// Most different expressions of a process.
const MAX_KNOWN: usize = 1 << 14;

/// A light path expression that has been read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ExpressionId(u16);

#[derive(Debug)]
struct KnownExpression {
    text: Arc<str>,
    parsed: PathExpression,
}

static KNOWN: Mutex<Vec<KnownExpression>> = Mutex::new(Vec::new());

impl ExpressionId {
    /// The number of an expression; the error is for users, and says what is wrong with the text.
    ///
    /// # Errors
    /// The text is no expression, or there are too many.
    pub fn of(text: &str) -> Result<Self, String> {
        let parsed = PathExpression::parse(text)
            .map_err(|error| format!("the light path expression {}: {error}", text.trim()))?;
        let text = PathExpression::plain_text(text);
        let mut known = lock(&KNOWN);
        let at = known.iter().position(|have| *have.text == *text).unwrap_or(known.len());
        if at == known.len() {
            if at >= MAX_KNOWN {
                return Err(format!("the light path expression {text}: there were {MAX_KNOWN} others"));
            }
            known.push(KnownExpression { text: text.into(), parsed });
        }
        u16::try_from(at).map(Self).map_err(|error| error.to_string())
    }

    /// Its text, without spaces and prefix.
    pub fn text(self) -> Arc<str> {
        lock(&KNOWN).get(usize::from(self.0)).map_or_else(|| Arc::from(""), |known| Arc::clone(&known.text))
    }
}

fn parsed(expressions: &[ExpressionId]) -> Vec<PathExpression> {
    let known = lock(&KNOWN);
    expressions.iter().filter_map(|id| known.get(usize::from(id.0))).map(|known| known.parsed.clone()).collect()
}

/// The automaton of these expressions, in their order; of the first ones alone if they are too many for one.
pub(crate) fn automaton(expressions: &[ExpressionId]) -> PathAutomaton {
    PathAutomaton::of_most(&parsed(expressions)).0
}

/// Whether one automaton can have all of these; the error is for users.
pub(crate) fn fit_together(expressions: &[ExpressionId]) -> Result<(), String> {
    PathAutomaton::new(&parsed(expressions)).map(|_| ()).map_err(|limit| limit.to_string())
}

/// Whether there is any light path of the expression.
pub(crate) fn has_paths(expression: ExpressionId) -> bool {
    automaton(&[expression]).possible() != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expression_has_one_number_however_it_is_written() {
        let [a, b, c] = ["lpe:C<RD>L", " C < R D > L ", "C<RG>L"].map(|text| ExpressionId::of(text).expect(text));
        assert!(a == b && a != c, "spaces and prefix are not of it");
        assert_eq!(&*a.text(), "C<RD>L");
        assert!(ExpressionId::of("C<RD").is_err_and(|text| text.contains("C<RD: character 5")), "what and where");
    }

    #[test]
    fn what_no_path_is_of_is_known() {
        let has = |text: &str| has_paths(ExpressionId::of(text).expect(text));
        assert!(has("C.*") && !has("C<RD>") && !has("CV+L"), "light at the end, and no volumes");
    }
}
