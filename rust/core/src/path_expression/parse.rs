// SPDX-License-Identifier: Apache-2.0
//! The parser of light path expressions: recursive descent, one function a level of the grammar. Pure.
//!
//! ```text
//! whole    = (option ';')* either                     option = 'unoccluded'
//! either   = sequence ('|' sequence)*
//! sequence = (unit times*)*
//! times    = '*' | '+' | '?' | '{' n '}' | '{' n ',' [m] '}'
//! unit     = letter | '.' | label | '(' either ')' | set | event
//! set      = '[' ['^'] (letter | '.' | label | event)+ ']'
//! event    = '<' part [part] [labels] '>'     part = letter | '.' | '[' ['^'] letter+ ']'
//! labels   = '.' | label | '[' ['^'] label+ ']'       label = "'" characters "'"
//! ```

use super::{
    ANY_EVENT, CAMERA, EventKinds, EventSet, EventTest, LabelTest, PathEvent, PathExpression, PathPattern, bit,
};
use std::sync::Arc;

/// Longest expression, bytes.
const MAX_BYTES: usize = 4096;
/// Deepest nesting of parentheses.
const MAX_DEPTH: usize = 32;
/// Largest number of repetitions in braces.
const MAX_TIMES: u32 = 64;

/// The reason why a text is no light path expression.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("character {at}: {what}")]
pub struct ExpressionError {
    /// The number of the character, from 1.
    pub at: usize,
    /// What is wrong there.
    pub what: String,
}

/// The characters before an expression, and the expression: `color ` and `lpe:` are not of it.
pub(super) fn without_prefix(text: &str) -> (usize, &str) {
    let rest = text.trim_start();
    let rest = rest.strip_prefix("color ").unwrap_or(rest).trim_start();
    let rest = rest.strip_prefix("lpe:").unwrap_or(rest);
    (text.chars().count() - rest.chars().count(), rest)
}

/// Reads an expression.
pub(super) fn expression(text: &str) -> Result<PathExpression, ExpressionError> {
    let (before, rest) = without_prefix(text);
    let mut reader = TextReader { text: &[], at: 0, before, names_glossy: false };
    if text.len() > MAX_BYTES {
        return Err(reader.error(format!("an expression has at most {MAX_BYTES} bytes")));
    }
    let mut is_unoccluded = false;
    let (options, rest) = rest.rsplit_once(';').map_or((None, rest), |(options, rest)| (Some(options), rest));
    for option in options.into_iter().flat_map(|options| options.split(';')) {
        if option.trim() != "unoccluded" {
            return Err(reader.error(format!("the option '{}' of an expression is not supported", option.trim())));
        }
        (is_unoccluded, reader.before) = (true, reader.before + option.chars().count() + 1);
    }
    let characters: Vec<char> = rest.chars().collect();
    reader.text = &characters;
    let pattern = reader.either(0)?;
    match reader.peek() {
        None if characters.iter().all(|c| c.is_whitespace()) => Err(reader.error("there is no expression".to_owned())),
        None => Ok(PathExpression { pattern, names_glossy: reader.names_glossy, is_unoccluded }),
        Some(c) => Err(reader.error(format!("'{c}' closes nothing"))),
    }
}

/// The events of a letter.
fn letter(c: char) -> Option<EventKinds> {
    use PathEvent as E;
    let of = |events: &[E]| events.iter().map(|event| bit(*event)).fold(0, |all, one| all | one);
    let reflection = of(&[E::DiffuseReflection, E::GlossyReflection, E::SharpReflection]);
    let transmission = of(&[E::DiffuseTransmission, E::GlossyTransmission, E::SharpTransmission]);
    Some(match c {
        '.' => ANY_EVENT,
        'C' => CAMERA,
        'R' => reflection,
        'T' => transmission,
        'D' => of(&[E::DiffuseReflection, E::DiffuseTransmission]),
        'G' => of(&[E::GlossyReflection, E::GlossyTransmission]),
        'S' => of(&[E::SharpReflection, E::SharpTransmission]),
        'L' => of(&[E::Light, E::Dome]),
        'B' => of(&[E::Dome]),
        'O' => of(&[E::Surface]),
        // Volumes, and light that goes straight through: there are no such events.
        'V' | 's' => 0,
        _ => return None,
    })
}

struct TextReader<'a> {
    text: &'a [char],
    /// The next character.
    at: usize,
    /// Characters before `text`.
    before: usize,
    names_glossy: bool,
}

impl TextReader<'_> {
    fn error(&self, what: String) -> ExpressionError {
        ExpressionError { at: self.before + self.at + 1, what }
    }

    fn peek(&mut self) -> Option<char> {
        while self.text.get(self.at).is_some_and(|c| c.is_whitespace()) {
            self.at += 1;
        }
        self.text.get(self.at).copied()
    }

    fn take(&mut self, wanted: char) -> bool {
        let is_there = self.peek() == Some(wanted);
        self.at += usize::from(is_there);
        is_there
    }

    fn expect(&mut self, wanted: char) -> Result<(), ExpressionError> {
        if self.take(wanted) {
            return Ok(());
        }
        let found = self.peek().map_or_else(|| "the end".to_owned(), |c| format!("'{c}'"));
        Err(self.error(format!("'{wanted}' is missing before {found}")))
    }

    fn either(&mut self, depth: usize) -> Result<PathPattern, ExpressionError> {
        if depth > MAX_DEPTH {
            return Err(self.error(format!("more than {MAX_DEPTH} parentheses inside each other")));
        }
        let mut parts = vec![self.sequence(depth)?];
        while self.take('|') {
            parts.push(self.sequence(depth)?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { PathPattern::Either(parts) })
    }

    fn sequence(&mut self, depth: usize) -> Result<PathPattern, ExpressionError> {
        let mut parts = Vec::new();
        while !matches!(self.peek(), None | Some('|' | ')')) {
            let mut unit = self.unit(depth)?;
            while let Some((least, most)) = self.times()? {
                unit = PathPattern::Repeat(Box::new(unit), least, most);
            }
            parts.push(unit);
        }
        Ok(PathPattern::Sequence(parts))
    }

    /// How often the unit before is there, if that is said.
    fn times(&mut self) -> Result<Option<(u32, Option<u32>)>, ExpressionError> {
        Ok(Some(match self.peek() {
            Some('*') => (0, None),
            Some('+') => (1, None),
            Some('?') => (0, Some(1)),
            Some('{') => {
                self.at += 1;
                let least = self.number()?;
                let most = match self.take(',') {
                    true if self.peek() == Some('}') => None,
                    true => Some(self.number()?),
                    false => Some(least),
                };
                if most.is_some_and(|most| most < least) {
                    return Err(self.error("the second number is below the first".to_owned()));
                }
                self.expect('}')?;
                return Ok(Some((least, most)));
            }
            _ => return Ok(None),
        })
        .inspect(|_| self.at += 1))
    }

    fn number(&mut self) -> Result<u32, ExpressionError> {
        let mut number = None;
        while let Some(digit) = self.peek().and_then(|c| c.to_digit(10)) {
            let value = number.unwrap_or(0) * 10 + digit;
            if value > MAX_TIMES {
                return Err(self.error(format!("more than {MAX_TIMES} times")));
            }
            number = Some(value);
            self.at += 1;
        }
        number.ok_or_else(|| self.error("a number is missing".to_owned()))
    }

    fn unit(&mut self, depth: usize) -> Result<PathPattern, ExpressionError> {
        if self.take('(') {
            let inside = self.either(depth + 1)?;
            self.expect(')')?;
            return Ok(inside);
        }
        if self.peek() == Some('[') {
            return Ok(PathPattern::Event(self.set()?));
        }
        Ok(PathPattern::Event(EventSet { tests: vec![self.test()?], is_negated: false }))
    }

    fn set(&mut self) -> Result<EventSet, ExpressionError> {
        self.expect('[')?;
        let is_negated = self.take('^');
        let mut tests = vec![self.test()?];
        while self.peek().is_some_and(|c| c != ']') {
            tests.push(self.test()?);
        }
        self.expect(']')?;
        Ok(EventSet { tests, is_negated })
    }

    /// A letter, a label or an event in angle brackets.
    fn test(&mut self) -> Result<EventTest, ExpressionError> {
        if self.is_at_label() {
            return Ok(EventTest { kinds: ANY_EVENT, labels: LabelTest::OneOf(vec![self.label()?]) });
        }
        if !self.take('<') {
            return Ok(EventTest { kinds: self.letter()?, labels: LabelTest::Any });
        }
        let mut kinds = self.part()?;
        if !self.is_at_labels() && self.peek() != Some('>') {
            kinds &= self.part()?;
        }
        let has_labels = self.is_at_labels() || self.peek() == Some('.');
        let labels = if has_labels { self.labels()? } else { LabelTest::Any };
        if self.is_at_label() {
            return Err(self.error("several labels are written ['a''b']".to_owned()));
        }
        self.expect('>')?;
        Ok(EventTest { kinds, labels })
    }

    fn letter(&mut self) -> Result<EventKinds, ExpressionError> {
        let Some(c) = self.peek() else { return Err(self.error("an event is missing at the end".to_owned())) };
        let Some(kinds) = letter(c) else {
            return Err(self.error(format!("'{c}' is no event; there are C, R, T, V, D, G, S, s, L, B, O and .")));
        };
        self.at += 1;
        self.names_glossy |= c == 'G';
        Ok(kinds)
    }

    /// A letter, or a set of letters.
    fn part(&mut self) -> Result<EventKinds, ExpressionError> {
        if !self.take('[') {
            return self.letter();
        }
        let is_negated = self.take('^');
        let mut kinds = self.letter()?;
        while self.peek().is_some_and(|c| c != ']') {
            kinds |= self.letter()?;
        }
        self.expect(']')?;
        Ok(if is_negated { ANY_EVENT & !kinds } else { kinds })
    }

    fn is_at_label(&mut self) -> bool {
        matches!(self.peek(), Some('\'' | '"'))
    }

    /// Whether labels, or a set of them, come next.
    fn is_at_labels(&mut self) -> bool {
        if self.peek() != Some('[') {
            return self.is_at_label();
        }
        let inside = self.text[self.at + 1..].iter().find(|c| !c.is_whitespace() && **c != '^');
        matches!(inside, Some('\'' | '"'))
    }

    fn labels(&mut self) -> Result<LabelTest, ExpressionError> {
        if self.take('.') {
            return Ok(LabelTest::Any);
        }
        if !self.take('[') {
            return Ok(LabelTest::OneOf(vec![self.label()?]));
        }
        let is_negated = self.take('^');
        let mut list = vec![self.label()?];
        while self.is_at_label() {
            list.push(self.label()?);
        }
        self.expect(']')?;
        Ok(if is_negated { LabelTest::NoneOf(list) } else { LabelTest::OneOf(list) })
    }

    fn label(&mut self) -> Result<Arc<str>, ExpressionError> {
        let Some(quote @ ('\'' | '"')) = self.peek() else {
            return Err(self.error("a label in quotes is missing".to_owned()));
        };
        let begin = self.at + 1;
        let Some(length) = self.text[begin..].iter().position(|c| *c == quote) else {
            return Err(self.error("the label does not end".to_owned()));
        };
        self.at = begin + length + 1;
        Ok(self.text[begin..begin + length].iter().collect::<String>().into())
    }
}
