// SPDX-License-Identifier: Apache-2.0
//! The automaton of all expressions of a render: by Thompson's construction, then the construction of subsets, then
//! refinement of partitions (Moore 1956). Pure; its size is bounded.

use super::{CAMERA, DEFAULT_LABEL, EventKinds, EventSet, PathEvent, PathExpression, PathPattern, SHARP, bit};
use oocpt_abi::MAX_EXPRESSIONS;
use rustc_hash::FxHashMap;
use std::sync::Arc;

/// Most states of an automaton.
pub const MAX_STATES: usize = 1024;
/// Most nodes of the automaton before it is made deterministic.
const MAX_NODES: usize = 4096;
/// Most labels that the expressions of a render name.
const MAX_LABELS: usize = 64;

/// Expressions need too large an automaton.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "together the light path expressions of a picture may be {MAX_EXPRESSIONS}, name {MAX_LABELS} labels and need \
     {MAX_STATES} states"
)]
pub struct AutomatonLimit;

/// A deterministic automaton of several expressions. State 0 leads nowhere.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PathAutomaton {
    /// State of a path that has left the camera.
    pub start: u32,
    /// The next state by state, then symbol ([`PathAutomaton::symbol`]).
    pub next: Vec<u32>,
    /// By state: bit i is set if a path that ends there is one of expression i.
    pub accepts: Vec<u32>,
    /// Bit i is set if nothing is in the way of the light of expression i.
    pub unoccluded: u32,
    /// Labels by number; the first stands for all that no expression names.
    labels: Vec<Option<Arc<str>>>,
}

impl PathAutomaton {
    /// The automaton of these expressions, as small as there is one.
    ///
    /// `S` alone is every lobe that is not diffuse, as in `RenderMan` and Arnold; if `G` occurs in any of the
    /// expressions it is sharp lobes only, as in Open Shading Language and Karma.
    ///
    /// # Errors
    /// [`AutomatonLimit`].
    pub fn new(expressions: &[PathExpression]) -> Result<Self, AutomatonLimit> {
        if expressions.len() > MAX_EXPRESSIONS {
            return Err(AutomatonLimit);
        }
        let names_glossy = expressions.iter().any(|expression| expression.names_glossy);
        let mut graph = PatternGraph::default();
        for expression in expressions {
            let mut pattern = expression.pattern.clone();
            if !names_glossy {
                pattern.each_set(&mut |set| set.tests.iter_mut().for_each(|test| test.kinds = with_glossy(test.kinds)));
            }
            graph.add_expression(&pattern)?;
        }
        let labels = graph.labels()?;
        let bits = (0..).zip(expressions).map(|(at, expression)| u32::from(expression.is_unoccluded) << at);
        let unoccluded = bits.fold(0, |all, bit| all | bit);
        Ok(Self { unoccluded, ..graph.subsets(labels)?.smallest() })
    }

    /// The automaton of the first expressions of a list, and how many they are: as many as the limits allow.
    #[must_use]
    pub fn of_most(expressions: &[PathExpression]) -> (Self, usize) {
        let most = expressions.len().min(MAX_EXPRESSIONS);
        let made = (1..=most).rev().find_map(|count| Some((Self::new(&expressions[..count]).ok()?, count)));
        made.unwrap_or_else(|| {
            let next = vec![0; PathEvent::ALL.len()];
            let nothing = Self { start: 0, next, accepts: vec![0], unoccluded: 0, labels: vec![None] };
            (nothing, 0)
        })
    }

    /// The number of labels that it tells apart.
    #[must_use]
    pub fn label_count(&self) -> u32 {
        narrow(self.labels.len())
    }

    /// The number of a label; `None`: of what has none.
    #[must_use]
    pub fn label(&self, label: Option<&str>) -> u32 {
        let label = label.filter(|label| !label.is_empty()).unwrap_or(DEFAULT_LABEL);
        narrow(self.labels.iter().position(|have| have.as_deref() == Some(label)).unwrap_or(0))
    }

    /// The symbol of an event with the label of this number.
    #[must_use]
    pub fn symbol(&self, event: PathEvent, label: u32) -> u32 {
        event as u32 * self.label_count() + label
    }

    /// The state after a symbol.
    #[must_use]
    pub fn step(&self, state: u32, symbol: u32) -> u32 {
        let symbols = PathEvent::ALL.len() * self.labels.len();
        self.next.get(state as usize * symbols + symbol as usize).copied().unwrap_or(0)
    }

    /// The expressions that some path is one of, as bits.
    #[must_use]
    pub fn possible(&self) -> u32 {
        let mut all = 0;
        for row in self.next.chunks(PathEvent::ALL.len() * self.labels.len()) {
            for event in PathEvent::ALL.into_iter().filter(|event| event.shines()) {
                let first = event as usize * self.labels.len();
                let ends = &row[first..first + self.labels.len()];
                all |= ends.iter().map(|end| self.accepts[*end as usize]).fold(0, |all, mask| all | mask);
            }
        }
        all
    }

    /// Merges states that no path distinguishes.
    fn smallest(self) -> Self {
        let symbols = PathEvent::ALL.len() * self.labels.len();
        let mut block: Vec<u32> = numbered(self.accepts.iter());
        loop {
            let key = |state: usize| -> (u32, Vec<u32>) {
                let row = &self.next[state * symbols..][..symbols];
                (block[state], row.iter().map(|to| block[*to as usize]).collect())
            };
            let keys: Vec<_> = (0..block.len()).map(key).collect();
            let finer = numbered(keys.iter());
            let is_done = finer.iter().max() == block.iter().max();
            block = finer;
            if is_done {
                break;
            }
        }
        let count = block.iter().max().map_or(0, |last| *last as usize + 1);
        let (mut next, mut accepts) = (vec![0; count * symbols], vec![0; count]);
        for (state, of) in block.iter().enumerate() {
            let (from, to) = (state * symbols, *of as usize * symbols);
            for symbol in 0..symbols {
                next[to + symbol] = block[self.next[from + symbol] as usize];
            }
            accepts[*of as usize] = self.accepts[state];
        }
        Self { start: block[self.start as usize], next, accepts, ..self }
    }
}

/// Numbers equal keys alike, in the order in which they come first.
fn numbered<K: Eq + std::hash::Hash>(keys: impl Iterator<Item = K>) -> Vec<u32> {
    let mut known = FxHashMap::default();
    keys.map(|key| {
        let new = narrow(known.len());
        *known.entry(key).or_insert(new)
    })
    .collect()
}

/// Counts here are bounded by far below 2^32.
fn narrow(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

/// The kinds with glossy lobes wherever sharp ones are.
fn with_glossy(kinds: EventKinds) -> EventKinds {
    kinds | (kinds & SHARP) >> 1
}

/// A node of the automaton that is not deterministic.
#[derive(Debug, Default)]
struct GraphNode {
    /// Nodes that it is as good as.
    same: Vec<u32>,
    /// The node after an event of this set.
    step: Option<(u32, u32)>,
    /// Expressions that end here.
    ends: u32,
}

#[derive(Debug, Default)]
struct PatternGraph {
    nodes: Vec<GraphNode>,
    sets: Vec<EventSet>,
    by_set: FxHashMap<EventSet, u32>,
    starts: Vec<u32>,
}

impl PatternGraph {
    fn node(&mut self) -> Result<u32, AutomatonLimit> {
        if self.nodes.len() >= MAX_NODES {
            return Err(AutomatonLimit);
        }
        self.nodes.push(GraphNode::default());
        Ok(narrow(self.nodes.len() - 1))
    }

    fn add_expression(&mut self, pattern: &PathPattern) -> Result<(), AutomatonLimit> {
        let start = self.node()?;
        let end = self.add(pattern, start)?;
        self.nodes[end as usize].ends = 1 << self.starts.len();
        self.starts.push(start);
        Ok(())
    }

    /// Adds a pattern that begins at a node; returns the node at which it ends, which nothing leaves.
    fn add(&mut self, pattern: &PathPattern, from: u32) -> Result<u32, AutomatonLimit> {
        match pattern {
            PathPattern::Event(set) => {
                let to = self.node()?;
                let known = narrow(self.sets.len());
                let number = *self.by_set.entry(set.clone()).or_insert(known);
                if number == known {
                    self.sets.push(set.clone());
                }
                let before = self.node()?;
                self.nodes[from as usize].same.push(before);
                self.nodes[before as usize].step = Some((number, to));
                Ok(to)
            }
            PathPattern::Sequence(parts) => parts.iter().try_fold(from, |at, part| self.add(part, at)),
            PathPattern::Either(parts) => {
                let to = self.node()?;
                for part in parts {
                    let begin = self.node()?;
                    self.nodes[from as usize].same.push(begin);
                    let end = self.add(part, begin)?;
                    self.nodes[end as usize].same.push(to);
                }
                Ok(to)
            }
            PathPattern::Repeat(part, least, most) => self.add_repeated(part, (*least, *most), from),
        }
    }

    fn add_repeated(
        &mut self,
        part: &PathPattern,
        (least, most): (u32, Option<u32>),
        from: u32,
    ) -> Result<u32, AutomatonLimit> {
        let mut at = from;
        for _ in 0..least {
            at = self.add(part, at)?;
        }
        let to = self.node()?;
        let Some(most) = most else {
            let again = self.node()?;
            self.nodes[at as usize].same.push(again);
            let end = self.add(part, again)?;
            self.nodes[end as usize].same.push(again);
            self.nodes[again as usize].same.push(to);
            return Ok(to);
        };
        for _ in least..most {
            self.nodes[at as usize].same.push(to);
            let begin = self.node()?;
            self.nodes[at as usize].same.push(begin);
            at = self.add(part, begin)?;
        }
        self.nodes[at as usize].same.push(to);
        Ok(to)
    }

    /// The labels that are told apart.
    fn labels(&self) -> Result<Vec<Option<Arc<str>>>, AutomatonLimit> {
        let mut named: Vec<&Arc<str>> = self.sets.iter().flat_map(EventSet::labels).collect();
        named.sort_unstable();
        named.dedup();
        if named.len() > MAX_LABELS {
            return Err(AutomatonLimit);
        }
        Ok([None].into_iter().chain(named.into_iter().map(|label| Some(Arc::clone(label)))).collect())
    }

    /// All nodes that are as good as these, sorted; without those that lead nowhere themselves.
    fn closure(&self, from: impl IntoIterator<Item = u32>) -> Vec<u32> {
        let mut seen = vec![false; self.nodes.len()];
        let mut todo: Vec<u32> = from.into_iter().collect();
        while let Some(node) = todo.pop() {
            if !std::mem::replace(&mut seen[node as usize], true) {
                todo.extend(&self.nodes[node as usize].same);
            }
        }
        let matters = |node: &GraphNode| node.step.is_some() || node.ends != 0;
        let all = seen.iter().zip(&self.nodes).zip(0..);
        all.filter(|((seen, node), _)| **seen && matters(node)).map(|(_, number)| number).collect()
    }

    /// The nodes after an event, of which it is known in which sets it is.
    fn after(&self, nodes: &[u32], is_in: &[bool]) -> Vec<u32> {
        let steps = nodes.iter().filter_map(|node| self.nodes[*node as usize].step);
        self.closure(steps.filter(|(set, _)| is_in[*set as usize]).map(|(_, to)| to))
    }

    /// Which sets an event is in.
    fn sets_with(&self, kind: EventKinds, label: Option<&Arc<str>>) -> Vec<bool> {
        self.sets.iter().map(|set| set.has(kind, label.map(|label| &**label))).collect()
    }

    fn subsets(&self, labels: Vec<Option<Arc<str>>>) -> Result<PathAutomaton, AutomatonLimit> {
        // Symbols that are in the same sets are one class.
        let symbols = PathEvent::ALL.into_iter().flat_map(|event| labels.iter().map(move |label| (event, label)));
        let sets: Vec<Vec<bool>> = symbols.map(|(event, label)| self.sets_with(bit(event), label.as_ref())).collect();
        let class = numbered(sets.iter());
        let mut classes: Vec<&Vec<bool>> = Vec::new();
        for (is_in, class) in sets.iter().zip(&class) {
            if *class as usize == classes.len() {
                classes.push(is_in);
            }
        }
        let first = self.closure(self.starts.iter().copied());
        let start = self.after(&first, &self.sets_with(CAMERA, None));
        // Nothing leads anywhere from the empty set, which is the first.
        let mut states = vec![Vec::new()];
        let mut known = FxHashMap::from_iter([(Vec::new(), 0_u32)]);
        let mut number = |set: Vec<u32>, states: &mut Vec<Vec<u32>>| {
            let new = narrow(states.len());
            *known.entry(set).or_insert_with_key(|set| {
                states.push(set.clone());
                new
            })
        };
        let start = number(start, &mut states);
        let (mut next, mut accepts) = (Vec::new(), Vec::new());
        while accepts.len() < states.len() {
            if states.len() > MAX_STATES {
                return Err(AutomatonLimit);
            }
            let state = states[accepts.len()].clone();
            accepts.push(state.iter().map(|node| self.nodes[*node as usize].ends).fold(0, |all, end| all | end));
            let row: Vec<u32> = classes.iter().map(|is_in| number(self.after(&state, is_in), &mut states)).collect();
            next.extend(class.iter().map(|class| row[*class as usize]));
        }
        Ok(PathAutomaton { start, next, accepts, unoccluded: 0, labels })
    }
}
