// SPDX-License-Identifier: Apache-2.0
//! Library files (XML) made into definitions.

use std::collections::HashMap;
use std::sync::Arc;

use roxmltree::{Document, Node, ParsingOptions};

use super::{Definition, Graph, GraphInput, GraphNode, InputDef, Source};
use crate::value::{Type, Value};

/// Most nodes of a graph.
const MAX_GRAPH_NODES: usize = 4096;
/// Most elements of a file.
const MAX_ELEMENTS: u32 = 1 << 20;
/// Definitions that inherit from one another, one after the other.
const MAX_INHERITANCE: usize = 8;

/// What was read so far.
#[derive(Default)]
pub(super) struct Parser {
    definitions: Vec<(Definition, Option<Arc<str>>)>,
    graphs: HashMap<Arc<str>, Arc<Graph>>,
    /// Graph by definition.
    implementations: HashMap<Arc<str>, Arc<str>>,
}

impl Parser {
    /// Reads a file.
    pub(super) fn file(&mut self, text: &str) -> Result<(), roxmltree::Error> {
        let options = ParsingOptions { nodes_limit: MAX_ELEMENTS, ..ParsingOptions::default() };
        let document = Document::parse_with_options(text, options)?;
        for element in document.root_element().children().filter(Node::is_element) {
            let Some(name) = element.attribute("name") else { continue };
            match element.tag_name().name() {
                "nodedef" => self.definition(name, element),
                "nodegraph" => {
                    self.graphs.insert(name.into(), Arc::new(graph(element)));
                    if let Some(definition) = element.attribute("nodedef") {
                        self.implementations.insert(definition.into(), name.into());
                    }
                }
                "implementation" => {
                    if let (Some(definition), Some(graph)) =
                        (element.attribute("nodedef"), element.attribute("nodegraph"))
                    {
                        self.implementations.insert(definition.into(), graph.into());
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn definition(&mut self, name: &str, element: Node<'_, '_>) {
        let category = element.attribute("node").unwrap_or_default();
        let mut definition = Definition {
            name: name.into(),
            category: category.into(),
            inputs: Vec::new(),
            outputs: Vec::new(),
            graph: None,
            is_default_version: element.attribute("isdefaultversion") == Some("true")
                || element.attribute("version").is_none(),
        };
        for child in element.children().filter(Node::is_element) {
            let (Some(name), Some(type_name)) = (child.attribute("name"), child.attribute("type")) else { continue };
            let ty = Type::named(type_name);
            match child.tag_name().name() {
                "input" => definition.inputs.push(InputDef {
                    name: name.into(),
                    ty,
                    value: child.attribute("value").and_then(|text| Value::parse(ty, text)),
                    geometry: child.attribute("defaultgeomprop").map(Into::into),
                }),
                "output" => definition.outputs.push((name.into(), ty, type_name.into())),
                _ => {}
            }
        }
        self.definitions.push((definition, element.attribute("inherit").map(Into::into)));
    }

    /// The definitions, with what they inherit and their graphs.
    pub(super) fn finish(self) -> Vec<Definition> {
        let Self { definitions, graphs, implementations } = self;
        let by_name: HashMap<Arc<str>, usize> =
            definitions.iter().enumerate().map(|(at, (definition, _))| (Arc::clone(&definition.name), at)).collect();
        let parent = |at: usize| definitions[at].1.as_ref().and_then(|name| by_name.get(name)).copied();
        let mut finished = Vec::with_capacity(definitions.len());
        for (at, (definition, _)) in definitions.iter().enumerate() {
            let mut whole = definition.clone();
            let ancestors = std::iter::successors(parent(at), |&at| parent(at)).take(MAX_INHERITANCE);
            for ancestor in ancestors {
                let from = &definitions[ancestor].0;
                for input in &from.inputs {
                    if whole.input(&input.name).is_none() {
                        whole.inputs.push(input.clone());
                    }
                }
                if whole.outputs.is_empty() {
                    whole.outputs.clone_from(&from.outputs);
                }
            }
            whole.graph = implementations.get(&whole.name).and_then(|name| graphs.get(name)).cloned();
            finished.push(whole);
        }
        finished
    }
}

/// A graph; connections to nodes that do not exist are left out.
fn graph(element: Node<'_, '_>) -> Graph {
    let is_node = |child: &Node<'_, '_>| {
        child.is_element() && !matches!(child.tag_name().name(), "input" | "output" | "token" | "backdrop")
    };
    let nodes: Vec<Node<'_, '_>> = element.children().filter(is_node).take(MAX_GRAPH_NODES).collect();
    let numbers: HashMap<&str, usize> =
        nodes.iter().enumerate().filter_map(|(at, node)| Some((node.attribute("name")?, at))).collect();
    let source = |child: Node<'_, '_>| {
        let ty = Type::named(child.attribute("type").unwrap_or_default());
        if let Some(name) = child.attribute("interfacename") {
            return Some(Source::Interface(name.into()));
        }
        if let Some(name) = child.attribute("nodename") {
            return Some(Source::Node(*numbers.get(name)?, child.attribute("output").unwrap_or_default().into()));
        }
        Some(Source::Value(Value::parse(ty, child.attribute("value")?)?))
    };
    let of_node = |node: &Node<'_, '_>| GraphNode {
        name: node.attribute("name").unwrap_or_default().into(),
        category: node.tag_name().name().into(),
        definition: node.attribute("nodedef").map(Into::into),
        ty: Type::named(node.attribute("type").unwrap_or_default()),
        type_name: node.attribute("type").unwrap_or_default().into(),
        inputs: node
            .children()
            .filter(|child| child.is_element() && child.tag_name().name() == "input")
            .filter_map(|child| {
                Some(GraphInput {
                    name: child.attribute("name")?.into(),
                    ty: Type::named(child.attribute("type").unwrap_or_default()),
                    source: source(child)?,
                })
            })
            .collect(),
    };
    let outputs = element.children().filter(|child| child.is_element() && child.tag_name().name() == "output");
    Graph {
        nodes: nodes.iter().map(of_node).collect(),
        outputs: outputs
            .filter_map(|child| {
                let name = child.attribute("name").unwrap_or("out");
                Some((name.into(), source(child)?))
            })
            .collect(),
    }
}
