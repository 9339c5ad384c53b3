// SPDX-License-Identifier: Apache-2.0
//! Walks a network from an input upwards and makes expressions of it, through the graphs that implement nodes.
//!
//! Limits: [`MAX_STEPS`] nodes, chains of [`MAX_DEPTH`] nodes; cycles are found. Unsupported parts are problems, and an
//! input that reads one counts as not connected.

use std::collections::HashMap;
use std::sync::Arc;

use crate::expression::{ExpressionGraph, Val};
use crate::library::{GraphNode, NodeDef, NodeGraph, NodeLibrary, PortSource};
use crate::network::Network;
use crate::program::Geometry;
use crate::slab::OpenPbrSlab;
use crate::uses::MaterialUses;
use crate::value::{FileRef, PortType, PortValue};

/// Most nodes that are visited.
const MAX_STEPS: usize = 1 << 14;
/// Most lines about unsupported parts.
const MAX_PROBLEMS: usize = 64;
/// Longest chain of nodes.
const MAX_DEPTH: usize = 128;

/// The value of an input or output.
#[derive(Clone, Debug)]
pub(crate) enum BoundValue {
    Number(Val),
    Text(Arc<str>),
    File(FileRef),
    /// The rows of a matrix.
    Matrix([[f32; 4]; 4]),
}

impl BoundValue {
    fn of(value: &PortValue) -> Self {
        match value {
            PortValue::Numbers(numbers) => Self::Number(Val::Constant(*numbers)),
            PortValue::Text(text) => Self::Text(Arc::clone(text)),
            PortValue::File(file) => Self::File(file.clone()),
            PortValue::Matrix(rows) => Self::Matrix(*rows),
        }
    }
}

/// A node: of the network (frame 0), or of a graph that implements another node.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(crate) struct NodeAddress {
    frame: usize,
    node: usize,
}

/// A graph, and the node that it implements.
struct GraphFrame {
    graph: Arc<NodeGraph>,
    owner: NodeAddress,
}

/// The state of a node's output.
#[derive(Clone, Debug)]
enum MemoizedOutput {
    /// It is being computed.
    Open,
    Known(Option<BoundValue>),
}

/// The state of a walk through one network.
pub(crate) struct NetworkWalker<'a> {
    network: &'a Network,
    library: &'a NodeLibrary,
    frames: Vec<GraphFrame>,
    frame_of: HashMap<NodeAddress, usize>,
    memo: HashMap<(NodeAddress, Arc<str>), MemoizedOutput>,
    /// Slabs of closures and surface shaders: each is computed once; `None` while it is being computed.
    pub(crate) slabs: HashMap<NodeAddress, Option<Option<OpenPbrSlab>>>,
    /// Emission of nodes: each is computed once; `None` while it is being computed.
    pub(crate) emissions: HashMap<NodeAddress, Option<Val>>,
    /// Random numbers of a hit that are used.
    pub(crate) choices: usize,
    /// True if the walk is for displacement: meshes have no place in the world yet, and no viewer.
    pub(crate) is_displacing: bool,
    steps: usize,
    depth: usize,
    pub(crate) expressions: ExpressionGraph,
    pub(crate) uses: MaterialUses,
    pub(crate) problems: Vec<String>,
}

impl<'a> NetworkWalker<'a> {
    pub(crate) fn new(network: &'a Network, library: &'a NodeLibrary) -> Self {
        Self {
            network,
            library,
            frames: Vec::new(),
            frame_of: HashMap::new(),
            memo: HashMap::new(),
            slabs: HashMap::new(),
            emissions: HashMap::new(),
            choices: 0,
            is_displacing: false,
            steps: 0,
            depth: 0,
            expressions: ExpressionGraph::default(),
            uses: MaterialUses::default(),
            problems: Vec::new(),
        }
    }

    /// Notes an unsupported part, once.
    pub(crate) fn problem(&mut self, text: String) {
        if self.problems.len() < MAX_PROBLEMS && !self.problems.contains(&text) {
            self.problems.push(text);
        }
    }

    /// Notes that a node is not supported; `role` is its purpose. Hosts give no kind for nodes that they have no
    /// definition of.
    pub(crate) fn unsupported(&mut self, at: NodeAddress, role: &str) {
        let (category, path) = (self.category(at), self.path(at));
        self.problem(if category.is_empty() {
            format!("the host has no definition of {path}")
        } else if self.definition(at).is_some_and(|definition| definition.graph.is_none()) {
            format!("{role}`{category}` ({path}) is not supported: its definition is implemented by no graph of nodes")
        } else {
            format!("{role}`{category}` ({path}) is not supported")
        });
    }

    /// A node of the network.
    pub(crate) fn terminal(node: usize) -> NodeAddress {
        NodeAddress { frame: 0, node }
    }

    /// The node of the network's surface.
    pub(crate) fn surface(&self) -> NodeAddress {
        Self::terminal(self.network.surface)
    }

    /// The definition of a node.
    pub(crate) fn definition(&self, at: NodeAddress) -> Option<Arc<NodeDef>> {
        if at.frame == 0 {
            let node = self.network.nodes.get(at.node)?;
            return self.library.definition(&node.kind).cloned();
        }
        let node = self.frames.get(at.frame - 1)?.graph.nodes.get(at.node)?;
        self.library.matching(node).cloned()
    }

    /// The category of a node.
    pub(crate) fn category(&self, at: NodeAddress) -> Arc<str> {
        if at.frame > 0
            && let Some(node) = self.frames.get(at.frame - 1).and_then(|frame| frame.graph.nodes.get(at.node))
        {
            // The name of a definition has priority over the name of the element: `ramp_gradient` has an `ifgreater`
            // that is defined by `ND_ifgreatereq_color4I`. So does one of the namespace.
            let is_named = node.definition.is_some() || node.namespace.is_some();
            let named = if is_named { self.library.matching(node) } else { None };
            return Arc::clone(named.map_or(&node.category, |definition| &definition.category));
        }
        if let Some(definition) = self.definition(at) {
            return Arc::clone(&definition.category);
        }
        let kind = self.network.nodes.get(at.node).map_or("", |node| &*node.kind);
        kind.trim_start_matches("ND_").into()
    }

    /// Returns true if a node is one of `MaterialX` 1.38, as far as it can be recognised: by its definition, or by an
    /// input that later versions do not have.
    pub(crate) fn is_older(&self, at: NodeAddress) -> bool {
        let is_named =
            at.frame == 0 && self.network.nodes.get(at.node).is_some_and(|node| &*node.kind == "ND_normalmap");
        is_named || self.is_authored(at, "space")
    }

    /// The path of the network's node that it is, or is part of, for messages.
    pub(crate) fn path(&self, mut at: NodeAddress) -> Arc<str> {
        while at.frame > 0 {
            match self.frames.get(at.frame - 1) {
                Some(frame) => at = frame.owner,
                None => break,
            }
        }
        self.network.nodes.get(at.node).map(|node| Arc::clone(&node.path)).unwrap_or_default()
    }

    /// True if an input is authored: it has a value or a connection.
    pub(crate) fn is_authored(&self, at: NodeAddress, name: &str) -> bool {
        if at.frame == 0 {
            let Some(node) = self.network.nodes.get(at.node) else { return false };
            return node.connection(name).is_some() || node.value(name).is_some();
        }
        let Some(frame) = self.frames.get(at.frame - 1) else { return false };
        let Some(node) = frame.graph.nodes.get(at.node) else { return false };
        match node.inputs.iter().find(|input| &*input.name == name).map(|input| &input.source) {
            Some(PortSource::Interface(outer)) => self.is_authored(frame.owner, outer),
            found => found.is_some(),
        }
    }

    /// The value of an input: of its connection, else the authored one, else the default of its definition.
    pub(crate) fn input(&mut self, at: NodeAddress, name: &str) -> Option<BoundValue> {
        if let Some(authored) = self.authored(at, name) {
            return Some(authored);
        }
        let definition = self.definition(at)?;
        let input = definition.input(name)?;
        if let Some(geometry) = &input.geometry {
            return self.geometry_named(at, geometry).map(BoundValue::Number);
        }
        input.value.as_ref().map(BoundValue::of)
    }

    fn authored(&mut self, at: NodeAddress, name: &str) -> Option<BoundValue> {
        let network = self.network;
        if at.frame == 0 {
            let node = network.nodes.get(at.node)?;
            if let Some((upstream, output)) = node.connection(name) {
                return self.output(NodeAddress { frame: 0, node: upstream }, output);
            }
            return node.value(name).map(BoundValue::of);
        }
        let frame = self.frames.get(at.frame - 1)?;
        let (graph, owner) = (Arc::clone(&frame.graph), frame.owner);
        let input = graph.nodes.get(at.node)?.inputs.iter().find(|input| &*input.name == name)?;
        match &input.source {
            PortSource::Value(value) => Some(BoundValue::of(value)),
            PortSource::Node(node, output) => self.output(NodeAddress { frame: at.frame, node: *node }, output),
            // The colour space nearest to the file counts.
            PortSource::Interface(outer) => match self.input(owner, outer)? {
                BoundValue::File(file) => {
                    let color_space = file.color_space.or_else(|| input.color_space.clone());
                    Some(BoundValue::File(FileRef { color_space, ..file }))
                }
                other => Some(other),
            },
        }
    }

    /// A number.
    pub(crate) fn number(&mut self, at: NodeAddress, name: &str) -> Option<Val> {
        match self.input(at, name)? {
            BoundValue::Number(val) => Some(val),
            _ => None,
        }
    }

    /// The number of an input, or `default`.
    pub(crate) fn number_or(&mut self, at: NodeAddress, name: &str, default: f32) -> Val {
        self.number(at, name).unwrap_or(Val::number(default))
    }

    /// A text.
    pub(crate) fn text(&mut self, at: NodeAddress, name: &str) -> Option<Arc<str>> {
        match self.input(at, name)? {
            BoundValue::Text(text) => Some(text),
            _ => None,
        }
    }

    /// The node that an input is connected to, through the interfaces of graphs.
    pub(crate) fn source_node(&self, at: NodeAddress, name: &str) -> Option<NodeAddress> {
        let (mut at, mut name): (NodeAddress, Arc<str>) = (at, name.into());
        for _ in 0..MAX_DEPTH {
            if at.frame == 0 {
                let (node, _) = self.network.nodes.get(at.node)?.connection(&name)?;
                return (node < self.network.nodes.len()).then_some(NodeAddress { frame: 0, node });
            }
            let frame = self.frames.get(at.frame - 1)?;
            let input = frame.graph.nodes.get(at.node)?.inputs.iter().find(|input| input.name == name)?;
            match &input.source {
                PortSource::Node(node, _) => return Some(NodeAddress { frame: at.frame, node: *node }),
                PortSource::Interface(outer) => (at, name) = (frame.owner, Arc::clone(outer)),
                PortSource::Value(_) => return None,
            }
        }
        None
    }

    /// The node of the graph that implements a node and computes this output.
    pub(crate) fn implementation(&mut self, at: NodeAddress) -> Option<NodeAddress> {
        let graph = self.definition(at)?.graph.clone()?;
        let frame = self.enter(at, &graph)?;
        match graph.outputs.first()?.1 {
            PortSource::Node(node, _) => Some(NodeAddress { frame, node }),
            _ => None,
        }
    }

    /// The frame of a graph that implements a node.
    fn enter(&mut self, at: NodeAddress, graph: &Arc<NodeGraph>) -> Option<usize> {
        if let Some(frame) = self.frame_of.get(&at) {
            return Some(*frame);
        }
        if self.frames.len() >= MAX_STEPS {
            return None;
        }
        self.frames.push(GraphFrame { graph: Arc::clone(graph), owner: at });
        self.frame_of.insert(at, self.frames.len());
        Some(self.frames.len())
    }

    /// The type of an input.
    pub(crate) fn input_type(&self, at: NodeAddress, name: &str) -> PortType {
        let found = self.definition(at).and_then(|definition| definition.input(name).map(|input| input.ty));
        let declared = || self.graph_node(at)?.inputs.iter().find(|input| &*input.name == name).map(|input| input.ty);
        found.or_else(declared).unwrap_or(PortType::Other)
    }

    /// A node of a graph that implements another one.
    fn graph_node(&self, at: NodeAddress) -> Option<&GraphNode> {
        self.frames.get(at.frame.checked_sub(1)?)?.graph.nodes.get(at.node)
    }

    /// An output of a node.
    pub(crate) fn output(&mut self, at: NodeAddress, output: &Arc<str>) -> Option<BoundValue> {
        let key = (at, Arc::clone(output));
        match self.memo.get(&key) {
            Some(MemoizedOutput::Known(known)) => return known.clone(),
            Some(MemoizedOutput::Open) => {
                let path = self.path(at);
                self.problem(format!("{path} is connected in a circle"));
                return None;
            }
            None => {}
        }
        self.steps += 1;
        if self.depth >= MAX_DEPTH || self.steps > MAX_STEPS || self.expressions.is_full {
            self.problem("the network is too large".to_owned());
            return None;
        }
        self.memo.insert(key.clone(), MemoizedOutput::Open);
        self.depth += 1;
        let found = self.work_out(at, output);
        self.depth -= 1;
        self.memo.insert(key, MemoizedOutput::Known(found.clone()));
        found
    }

    fn work_out(&mut self, at: NodeAddress, output: &Arc<str>) -> Option<BoundValue> {
        let category = self.category(at);
        let definition = self.definition(at);
        let ty = definition.as_ref().and_then(|definition| definition.output(output));
        let ty = ty.or_else(|| self.graph_node(at).map(|node| node.ty)).unwrap_or(PortType::Other);
        if let Some(found) = self.node(at, &category, ty, output) {
            return Some(found);
        }
        let Some(graph) = definition.as_ref().and_then(|definition| definition.graph.as_ref()) else {
            self.unsupported(at, "");
            return None;
        };
        let graph = Arc::clone(graph);
        let frame = self.enter(at, &graph)?;
        let found = graph.outputs.iter().find(|(name, _)| output.is_empty() || name == output);
        match &found.or(graph.outputs.first())?.1 {
            PortSource::Value(value) => Some(BoundValue::of(value)),
            PortSource::Node(node, output) => self.output(NodeAddress { frame, node: *node }, output),
            PortSource::Interface(name) => self.input(at, name),
        }
    }

    /// The property of the geometry of that name.
    fn geometry_named(&mut self, at: NodeAddress, name: &str) -> Option<Val> {
        if name == "UV0" {
            return Some(self.texcoord("st"));
        }
        let (what, is_world) = match name {
            "Pobject" => (Geometry::Position, false),
            "Nobject" => (Geometry::Normal, false),
            "Pworld" => (Geometry::Position, true),
            "Nworld" => (Geometry::Normal, true),
            "Tobject" => (Geometry::Tangent, false),
            "Bobject" => (Geometry::Bitangent, false),
            "Tworld" => (Geometry::Tangent, true),
            "Bworld" => (Geometry::Bitangent, true),
            _ => return None,
        };
        Some(self.geometry(at, what, is_world))
    }

    /// A property of the surface that a node reads: in the frame of the mesh or of the world. Tangents are always those
    /// of the world. For a displaced mesh, its own frame is the only one; reading the world's is reported.
    pub(crate) fn geometry(&mut self, at: NodeAddress, what: Geometry, is_world: bool) -> Val {
        if self.is_displacing {
            if is_world {
                let (category, path) = (self.category(at), self.path(at));
                self.problem(format!(
                    "`{category}` ({path}) reads the world, which displaced meshes do not know: it is the object's \
                     space"
                ));
            }
            return self.expressions.geometry(what);
        }
        match what {
            Geometry::Position if !is_world => self.primvar(MaterialUses::POSITION, [0.0; 4]),
            Geometry::Normal if !is_world => self.primvar(MaterialUses::NORMAL, [0.0, 1.0, 0.0, 0.0]),
            _ => self.expressions.geometry(what),
        }
    }

    /// A set of texture coordinates.
    pub(crate) fn texcoord(&mut self, name: &str) -> Val {
        match self.uses.uv_set(name) {
            Some(set) => self.expressions.geometry(if set == 0 { Geometry::Uv0 } else { Geometry::Uv1 }),
            None => {
                self.problem(format!(
                    "more than {} sets of texture coordinates: {name} is left out",
                    MaterialUses::MAX_SETS
                ));
                Val::ZERO
            }
        }
    }

    /// A primvar, or `fallback` if the mesh does not have it.
    pub(crate) fn primvar(&mut self, name: &str, fallback: [f32; 4]) -> Val {
        match self.uses.primvar(name, fallback) {
            Some(slot) => self.expressions.geometry(if slot == 0 { Geometry::Primvar0 } else { Geometry::Primvar1 }),
            None => {
                self.problem(format!("more than {} primvars: {name} is left out", MaterialUses::MAX_SETS));
                Val::Constant(fallback)
            }
        }
    }
}
