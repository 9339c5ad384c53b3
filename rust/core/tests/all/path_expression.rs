// SPDX-License-Identifier: Apache-2.0
//! Light path expressions against a matcher that tries every way, and texts of strangers.

use oocpt_core::path_expression::{MAX_EXPRESSIONS, MAX_STATES, PathAutomaton, PathEvent, PathExpression};
use proptest::prelude::*;
use std::collections::BTreeSet;

/// Names of the events in the order of their numbers.
const EVENTS: [&str; 9] = ["RD", "RG", "RS", "TD", "TG", "TS", "L", "B", "O"];

/// An event after the camera: its name, and the label of what it happens at.
type NamedEvent = (&'static str, &'static str);

fn automaton(texts: &[&str]) -> PathAutomaton {
    let parsed = texts.iter().map(|text| PathExpression::parse(text).expect("an expression"));
    PathAutomaton::new(&parsed.collect::<Vec<_>>()).expect("a small automaton")
}

fn mask(automaton: &PathAutomaton, path: &[NamedEvent]) -> u32 {
    let end = path.iter().fold(automaton.start, |state, (name, label)| {
        let number = EVENTS.iter().position(|have| have == name).expect("an event");
        automaton.step(state, automaton.symbol(PathEvent::ALL[number], automaton.label(Some(label))))
    });
    automaton.accepts[end as usize]
}

/// A path in words: events with spaces between, labels behind a slash.
fn path(text: &'static str) -> Vec<NamedEvent> {
    text.split_whitespace().map(|event| event.split_once('/').unwrap_or((event, ""))).collect()
}

fn matches(expression: &str, of: &'static str) -> bool {
    mask(&automaton(&[expression]), &path(of)) == 1
}

#[test]
fn expressions_mean_what_users_of_other_renderers_expect() {
    for (expression, yes, no) in [
        ("C<RD>L", "RD L", "RG L"),
        ("lpe:C<RD>L", "RD B", "RD RD L"),
        ("color lpe:C<RD>.+L", "RD TS L", "RD L"),
        ("C.*[LO]", "RD TG O", "RD"),
        ("C.*[<L.>O]", "L", "RD RD"),
        ("CD[DS]*[LO]", "RD RG TD L", "RG RD L"),
        ("C[DS]*<L.'key'>", "RD RS L/key", "RD RS L/fill"),
        ("C.*<L.[^'key''fill']>", "RD L/rim", "RD L/fill"),
        ("C.*<L.'default'>", "RD L", "RD L/key"),
        ("C.*<O.'sign'>", "RS O/sign", "RS L/sign"),
        ("C.*<[LO].'sign'>", "RS L/sign", "RS L"),
        ("C<T[SG]>.*B", "TG RD B", "TG RD L"),
        ("C<R[^D]>L", "RG L", "RD L"),
        ("C[^D]L", "TS L", "TD L"),
        ("C(D|<TS>{2})L", "TS TS L", "TS L"),
        ("CD{1,2}L", "RD TD L", "RD RD RD L"),
        ("CD{2,}L", "RD TD RD L", "RD L"),
        ("CS?L", "L", "RD L"),
        ("O|CO", "O", "RD O"),
        ("C<RD'skin'>L", "RD/skin L", "RD/cloth L"),
        ("C'skin'L", "TS/skin L", "TS L"),
        ("C<.><..><L'key'>", "RD RG L/key", "RD L/key"),
        (" C < R D > [ < L . 'key' > O ] ", "RD L/key", "RD L"),
        ("C.*O", "RG O", "RG B"),
    ] {
        assert!(matches(expression, yes), "{expression} has {yes}");
        assert!(!matches(expression, no), "{expression} has not {no}");
    }
}

#[test]
fn specular_is_glossy_too_unless_an_expression_names_glossy_lobes() {
    assert!(matches("C<RS>L", "RG L") && matches("C<RS>L", "RS L"), "as in RenderMan");
    let parts = automaton(&["C<RD>.*", "C<RG>.*", "C<RS>.*", "C<R[^S]>.*"]);
    let of = ["RD L", "RG L", "RS L"].map(|of| mask(&parts, &path(of)));
    assert_eq!(of, [0b1001, 0b1010, 0b0100], "as in Open Shading Language");
}

#[test]
fn errors_say_where_and_what() {
    for (text, at, what) in [
        ("C<RQ>L", 4, "'Q' is no event"),
        ("lpe:C<RD", 9, "'>' is missing before the end"),
        ("C<L.'key>", 5, "does not end"),
        ("", 1, "no expression"),
        ("lpe:  ", 7, "no expression"),
        ("C)L", 2, "')' closes nothing"),
        ("C(D|SL", 7, "')' is missing"),
        ("C[]L", 3, "']' is no event"),
        ("CD{3,2}L", 7, "below the first"),
        ("CD{99}L", 5, "more than 64"),
        ("C<L.'a''b'>", 8, "['a''b']"),
        ("shadows;C<RD>L", 1, "'shadows'"),
        ("unoccluded;C<RD", 16, "'>'"),
        ("*", 1, "'*' is no event"),
    ] {
        let error = PathExpression::parse(text).expect_err(text);
        assert!(error.at == at && error.what.contains(what), "{text}: {error}");
    }
    let deep = "(".repeat(1000);
    assert!(PathExpression::parse(&deep).is_err_and(|error| error.what.contains("parentheses")), "{deep}");
    assert!(PathExpression::parse(&"C".repeat(5000)).is_err(), "too long");
}

#[test]
fn equal_expressions_have_one_text() {
    assert_eq!(PathExpression::plain_text("color lpe: C <RD> <L . 'a b'>"), "C<RD><L.'a b'>");
}

#[test]
fn automata_are_small_or_refused() {
    let parse = |text: &str| PathExpression::parse(text).expect("an expression");
    let groups: Vec<String> = (0..20).map(|at| format!("C.*<[LO].'group {at}'>")).collect();
    let groups: Vec<&str> = groups.iter().map(String::as_str).collect();
    let small = automaton(&groups);
    assert_eq!(small.accepts.len(), 22, "the start, an end for each group, and nothing");
    assert_eq!(small.possible(), (1 << 20) - 1, "each has a path");
    assert_eq!(automaton(&["C.*", "C<RD>", "CVL"]).possible(), 1, "the others end without light, or in a volume");
    assert_eq!(automaton(&["C(D|DD*)L", "CDD*L"]).accepts, automaton(&["CD+L", "CD{1}D*L"]).accepts, "the least");

    let many = vec![parse("C.*"); MAX_EXPRESSIONS + 1];
    assert!(PathAutomaton::new(&many).is_err(), "a mask has 32 bits");
    assert_eq!(PathAutomaton::of_most(&many).1, MAX_EXPRESSIONS, "as many as there may be");
    // The classic: which of the last 20 was diffuse takes 2^20 states.
    let large = parse("C.*D.{19}L");
    assert!(PathAutomaton::new(std::slice::from_ref(&large)).is_err(), "more than {MAX_STATES} states");
    let (most, count) = PathAutomaton::of_most(&[parse("C<RD>L"), large.clone()]);
    assert_eq!((count, most.accepts.len() <= MAX_STATES), (1, true), "the first is kept");
    assert_eq!(PathAutomaton::of_most(&[large]), (PathAutomaton::of_most(&[]).0, 0), "none is left");
    assert!(PathAutomaton::new(&[parse("C(((.{64}){64}){64}){64}L")]).is_err(), "so many nodes");
    let labels: String = (0..70).map(|at| format!("'{at}'")).collect();
    assert!(PathAutomaton::new(&[parse(&format!("C.*<L.[{labels}]>"))]).is_err(), "so many labels");
}

/// A pattern, and how the test itself reads it.
#[derive(Clone, Debug)]
enum Reference {
    Event(String, BTreeSet<(&'static str, &'static str)>),
    Sequence(Vec<Self>),
    Either(Vec<Self>),
    Repeat(Box<Self>, usize, Option<usize>),
}

const LABELS: [&str; 4] = ["", "key", "fill", "rim"];

/// Events that a test of names and labels passes. `S` never comes without `G` in these tests.
fn events(passes: impl Fn(&'static str, &'static str) -> bool) -> BTreeSet<(&'static str, &'static str)> {
    EVENTS.iter().flat_map(|name| LABELS.map(|label| (*name, label))).filter(|(n, l)| passes(n, l)).collect()
}

fn is_letter(letter: char, name: &str) -> bool {
    match letter {
        '.' => true,
        'L' => name == "L" || name == "B",
        'B' | 'O' => name.starts_with(letter),
        'R' | 'T' => name.starts_with(letter),
        'D' | 'G' | 'S' => name.len() == 2 && name.ends_with(letter),
        _ => false,
    }
}

fn event() -> impl Strategy<Value = Reference> {
    let letter = || prop::sample::select(vec!['.', 'R', 'T', 'D', 'G', 'S', 'L', 'B', 'O', 'V']);
    let label = || prop::sample::select(vec!["", "key", "fill"]);
    prop_oneof![
        letter().prop_map(|c| Reference::Event(c.to_string(), events(|name, _| is_letter(c, name)))),
        (letter(), letter(), label(), any::<bool>()).prop_map(|(a, b, label, negated)| {
            let written = match (label, negated) {
                ("", _) => String::new(),
                (label, true) => format!("[^'{label}']"),
                (label, false) => format!("'{label}'"),
            };
            let passes = |of: &str| label.is_empty() || (of == label) != negated;
            let both = events(|name, of| is_letter(a, name) && is_letter(b, name) && passes(of));
            Reference::Event(format!("<{a}{b}{written}>"), both)
        }),
        (prop::collection::vec(letter(), 1..4), any::<bool>()).prop_map(|(letters, negated)| {
            let text: String = letters.iter().collect();
            let set = events(|name, _| letters.iter().any(|c| is_letter(*c, name)) != negated);
            Reference::Event(format!("[{}{text}]", if negated { "^" } else { "" }), set)
        }),
    ]
}

fn pattern() -> impl Strategy<Value = Reference> {
    event().prop_recursive(3, 12, 4, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..4).prop_map(Reference::Sequence),
            prop::collection::vec(inner.clone(), 1..3).prop_map(Reference::Either),
            (inner, 0_usize..3, prop::option::of(0_usize..3)).prop_map(|(part, least, more)| {
                Reference::Repeat(Box::new(part), least, more.map(|more| least + more))
            }),
        ]
    })
}

impl Reference {
    fn text(&self) -> String {
        match self {
            Self::Event(text, _) => text.clone(),
            Self::Sequence(parts) => parts.iter().map(|part| format!("({})", part.text())).collect(),
            Self::Either(parts) => {
                let parts: Vec<String> = parts.iter().map(Self::text).collect();
                format!("({})", parts.join("|"))
            }
            Self::Repeat(part, 0, None) => format!("({})*", part.text()),
            Self::Repeat(part, 1, None) => format!("({})+", part.text()),
            Self::Repeat(part, 0, Some(1)) => format!("({})?", part.text()),
            Self::Repeat(part, least, None) => format!("({}){{{least},}}", part.text()),
            Self::Repeat(part, least, Some(most)) => format!("({}){{{least},{most}}}", part.text()),
        }
    }

    /// Places of the path at which the pattern may end if it begins at `from`.
    fn ends(&self, path: &[NamedEvent], from: usize) -> BTreeSet<usize> {
        let after = |part: &Self, at: BTreeSet<usize>| -> BTreeSet<usize> {
            at.into_iter().flat_map(|at| part.ends(path, at)).collect()
        };
        match self {
            Self::Event(_, set) => {
                path.get(from).filter(|event| set.contains(event)).map(|_| from + 1).into_iter().collect()
            }
            Self::Sequence(parts) => parts.iter().fold(BTreeSet::from([from]), |at, part| after(part, at)),
            Self::Either(parts) => parts.iter().flat_map(|part| part.ends(path, from)).collect(),
            Self::Repeat(part, least, most) => {
                let mut at = (0..*least).fold(BTreeSet::from([from]), |at, _| after(part, at));
                let mut all = at.clone();
                for _ in *least..most.unwrap_or(least + path.len() + 1) {
                    at = after(part, at);
                    all.extend(&at);
                }
                all
            }
        }
    }
}

fn paths() -> impl Strategy<Value = Vec<NamedEvent>> {
    let scatter = (prop::sample::select(EVENTS[..6].to_vec()), prop::sample::select(LABELS.to_vec()));
    let light = (prop::sample::select(EVENTS[6..].to_vec()), prop::sample::select(LABELS.to_vec()));
    (prop::collection::vec(scatter, 0..5), light).prop_map(|(mut path, light)| {
        path.push(light);
        path
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, ..ProptestConfig::default() })]

    #[test]
    fn the_automaton_agrees_with_a_matcher_that_tries_every_way(
        patterns in prop::collection::vec(pattern(), 1..5),
        paths in prop::collection::vec(paths(), 20),
    ) {
        // The last one makes S sharp in all of them.
        let texts: Vec<String> = patterns.iter().map(|of| format!("C{}", of.text())).chain(["CG".to_owned()]).collect();
        let parsed: Vec<PathExpression> =
            texts.iter().map(|text| PathExpression::parse(text).expect("an expression")).collect();
        if let Ok(made) = PathAutomaton::new(&parsed) {
            for path in &paths {
                let expected = patterns.iter().enumerate()
                    .filter(|(_, of)| of.ends(path, 0).contains(&path.len()))
                    .fold(0, |all, (at, _)| all | 1 << at);
                prop_assert_eq!(mask(&made, path), expected, "{:?} on {:?}", &texts, path);
            }
        }
    }

    #[test]
    fn texts_of_strangers_are_expressions_or_errors(
        texts in prop::collection::vec("[CRTVDGSsLBO.\\[\\]<>^'*+?{},|()0-9; é]{0,40}", 1..40),
    ) {
        let parsed: Vec<PathExpression> = texts.iter().filter_map(|text| PathExpression::parse(text).ok()).collect();
        let (made, count) = PathAutomaton::of_most(&parsed);
        prop_assert!(made.accepts.len() <= MAX_STATES && count <= MAX_EXPRESSIONS);
        prop_assert!(made.next.iter().all(|to| (*to as usize) < made.accepts.len()), "states that are there");
        prop_assert!(made.accepts.iter().all(|mask| u64::from(*mask) < 1_u64 << count), "expressions that are there");
        for text in &texts {
            let error = PathExpression::parse(text).err();
            prop_assert!(error.is_none_or(|error| error.at <= text.chars().count() + 1), "inside of {}", text);
        }
    }
}
