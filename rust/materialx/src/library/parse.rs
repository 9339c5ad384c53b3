// SPDX-License-Identifier: Apache-2.0
//! Library files (XML) made into definitions.

use std::borrow::Cow;
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use roxmltree::{Document, Node, ParsingOptions};

use super::{GraphInput, GraphNode, InputDef, NodeDef, NodeGraph, PortSource};
use crate::value::{FileRef, PortType, PortValue};

/// Most nodes of a graph.
const MAX_GRAPH_NODES: usize = 4096;
/// Most elements of a file.
const MAX_ELEMENTS: u32 = 1 << 20;
/// Definitions that inherit from one another, one after the other.
const MAX_INHERITANCE: usize = 8;

/// What was read so far.
#[derive(Default)]
pub(super) struct LibraryParser {
    definitions: Vec<(NodeDef, Option<Arc<str>>)>,
    graphs: HashMap<Arc<str>, Arc<NodeGraph>>,
    /// Graph by definition.
    implementations: HashMap<Arc<str>, Arc<str>>,
}

impl LibraryParser {
    /// Reads a file; what it names lies beside it.
    pub(super) fn file(&mut self, path: &Path, text: &str) -> Result<(), roxmltree::Error> {
        let text = &declared(text);
        let document = Document::parse_with_options(text, options())?;
        let root = document.root_element();
        let folder = path.parent().unwrap_or(Path::new(""));
        for element in root.children().filter(Node::is_element) {
            let Some(name) = element.attribute("name") else { continue };
            let file =
                ElementOrigin { folder, namespace: element.attribute("namespace").or(root.attribute("namespace")) };
            let name = file.qualified(name);
            let attribute = |key: &str| element.attribute(key).map(|text| file.qualified(text));
            match element.tag_name().name() {
                "nodedef" => self.definition(&name, element, &file),
                "nodegraph" => {
                    self.graphs.insert(Arc::clone(&name), Arc::new(graph(element, &file)));
                    if let Some(definition) = attribute("nodedef") {
                        self.implementations.insert(definition, name);
                    }
                }
                "implementation" => {
                    if let (Some(definition), Some(graph)) = (attribute("nodedef"), attribute("nodegraph")) {
                        self.implementations.insert(definition, graph);
                    }
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn definition(&mut self, name: &str, element: Node<'_, '_>, file: &ElementOrigin<'_>) {
        let category = element.attribute("node").unwrap_or_default();
        let mut definition = NodeDef {
            name: name.into(),
            category: file.qualified(category),
            inputs: Vec::new(),
            outputs: Vec::new(),
            graph: None,
            is_default_version: element.attribute("isdefaultversion") == Some("true")
                || element.attribute("version").is_none(),
        };
        for child in element.children().filter(Node::is_element) {
            let (Some(name), Some(type_name)) = (child.attribute("name"), child.attribute("type")) else { continue };
            let ty = PortType::named(type_name);
            match child.tag_name().name() {
                "input" => definition.inputs.push(InputDef {
                    name: name.into(),
                    ty,
                    value: child.attribute("value").and_then(|text| file.value(ty, text, child)),
                    geometry: child.attribute("defaultgeomprop").map(Into::into),
                }),
                "output" => definition.outputs.push((name.into(), ty, type_name.into())),
                _ => {}
            }
        }
        self.definitions.push((definition, element.attribute("inherit").map(|name| file.qualified(name))));
    }

    /// The definitions, with what they inherit and their graphs.
    pub(super) fn finish(self) -> Vec<NodeDef> {
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

fn options<'a>() -> ParsingOptions<'a> {
    ParsingOptions { nodes_limit: MAX_ELEMENTS, ..ParsingOptions::default() }
}

/// The text of a file, with the prefix of includes, which nobody declares.
fn declared(text: &str) -> Cow<'_, str> {
    match text.contains("<xi:include") && !text.contains("xmlns:xi") {
        true => text.replacen("<materialx", "<materialx xmlns:xi=\"http://www.w3.org/2001/XInclude\"", 1).into(),
        false => text.into(),
    }
}

/// Files that a file includes, as it names them; none where it cannot be read.
pub(super) fn included(text: &str) -> Vec<String> {
    let text = declared(text);
    let Ok(document) = Document::parse_with_options(&text, options()) else { return Vec::new() };
    let elements = document.root_element().children().filter(|child| child.tag_name().name() == "include");
    elements.filter_map(|element| element.attribute("href")).map(str::to_owned).collect()
}

/// Where elements come from.
struct ElementOrigin<'a> {
    folder: &'a Path,
    namespace: Option<&'a str>,
}

impl ElementOrigin<'_> {
    /// A name in the namespace. One that says its own keeps it.
    fn qualified(&self, name: &str) -> Arc<str> {
        match self.namespace {
            Some(space) if !space.is_empty() && !name.is_empty() && !name.contains(':') => {
                format!("{space}:{name}").into()
            }
            _ => name.into(),
        }
    }

    /// The value of an input.
    fn value(&self, ty: PortType, text: &str, input: Node<'_, '_>) -> Option<PortValue> {
        if ty != PortType::File || text.is_empty() {
            return PortValue::parse(ty, text);
        }
        Some(PortValue::File(FileRef {
            authored: text.into(),
            resolved: self.folder.join(text).to_string_lossy().into(),
            color_space: color_space(input),
            node: "".into(),
        }))
    }
}

/// The colour space that an element of a graph or definition says, or one around it; that of a document says what is
/// meant where nothing else is said, and is left out.
fn color_space(element: Node<'_, '_>) -> Option<Arc<str>> {
    let inner = element.ancestors().take_while(|element| element.tag_name().name() != "materialx");
    inner.filter_map(|element| element.attribute("colorspace")).next().map(Into::into)
}

/// A graph; connections to nodes that do not exist are left out.
fn graph(element: Node<'_, '_>, file: &ElementOrigin<'_>) -> NodeGraph {
    let is_node = |child: &Node<'_, '_>| {
        child.is_element() && !matches!(child.tag_name().name(), "input" | "output" | "token" | "backdrop")
    };
    let nodes: Vec<Node<'_, '_>> = element.children().filter(is_node).take(MAX_GRAPH_NODES).collect();
    let numbers: HashMap<&str, usize> =
        nodes.iter().enumerate().filter_map(|(at, node)| Some((node.attribute("name")?, at))).collect();
    let source = |child: Node<'_, '_>| {
        let ty = PortType::named(child.attribute("type").unwrap_or_default());
        if let Some(name) = child.attribute("interfacename") {
            return Some(PortSource::Interface(name.into()));
        }
        if let Some(name) = child.attribute("nodename") {
            return Some(PortSource::Node(*numbers.get(name)?, child.attribute("output").unwrap_or_default().into()));
        }
        Some(PortSource::Value(file.value(ty, child.attribute("value")?, child)?))
    };
    let of_node = |node: &Node<'_, '_>| GraphNode {
        name: node.attribute("name").unwrap_or_default().into(),
        category: node.tag_name().name().into(),
        definition: node.attribute("nodedef").map(Into::into),
        namespace: node.attribute("namespace").or(file.namespace).map(Into::into),
        ty: PortType::named(node.attribute("type").unwrap_or_default()),
        type_name: node.attribute("type").unwrap_or_default().into(),
        inputs: node
            .children()
            .filter(|child| child.is_element() && child.tag_name().name() == "input")
            .filter_map(|child| {
                Some(GraphInput {
                    name: child.attribute("name")?.into(),
                    ty: PortType::named(child.attribute("type").unwrap_or_default()),
                    source: source(child)?,
                    color_space: if child.attribute("type") == Some("filename") { color_space(child) } else { None },
                })
            })
            .collect(),
    };
    let outputs = element.children().filter(|child| child.is_element() && child.tag_name().name() == "output");
    NodeGraph {
        nodes: nodes.iter().map(of_node).collect(),
        outputs: outputs
            .filter_map(|child| {
                let name = child.attribute("name").unwrap_or("out");
                Some((name.into(), source(child)?))
            })
            .collect(),
    }
}
