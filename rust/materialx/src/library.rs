// SPDX-License-Identifier: Apache-2.0
//! Definitions of nodes, read from `MaterialX`'s data libraries (`libraries/*/*.mtlx`), and those of one's own.
//!
//! Limits: [`MAX_FILE_BYTES`] a file, [`MAX_FILES`] files, folders three deep; regular files only. What cannot be read
//! is left out, and [`NodeLibrary::problems`] says so.
//!
//! What a file of a namespace defines is called `namespace:name`, as `MaterialX` has it.

mod documents;
mod parse;

pub use documents::with_documents;

use std::collections::HashMap;
use std::fs;
use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use crate::value::{PortType, PortValue};

/// Most bytes of a library file.
pub const MAX_FILE_BYTES: u64 = 16 << 20;
/// Most files of a library.
pub const MAX_FILES: usize = 512;
/// Most files that a material names for definitions, with those that they include.
pub const MAX_INCLUDED: usize = 64;

/// Folders of data libraries, as OpenUSD takes them from the environment.
const SEARCH_PATHS: &str = "PXR_MTLX_STDLIB_SEARCH_PATHS";
/// Folders of definitions of one's own, likewise.
const OWN_PATHS: &str = "PXR_MTLX_PLUGIN_SEARCH_PATHS";

static STANDARD: OnceLock<NodeLibrary> = OnceLock::new();

/// The libraries of this process: those of the folders of `PXR_MTLX_STDLIB_SEARCH_PATHS` and
/// `PXR_MTLX_PLUGIN_SEARCH_PATHS`, read at first use. A definition of the latter stands for one of the former of its
/// name. Any thread; empty where there are no data libraries.
pub fn standard() -> &'static NodeLibrary {
    STANDARD.get_or_init(|| {
        let folders = |name: &str| -> Vec<PathBuf> {
            let paths = std::env::var_os(name).unwrap_or_default();
            std::env::split_paths(&paths).filter(|path| !path.as_os_str().is_empty()).collect()
        };
        let library = NodeLibrary::read_with(&folders(SEARCH_PATHS), &folders(OWN_PATHS));
        for problem in library.problems() {
            tracing::warn!("MaterialX library {problem}");
        }
        library
    })
}

/// An input of a definition.
#[derive(Clone, Debug, PartialEq)]
pub struct InputDef {
    /// Its name.
    pub name: Arc<str>,
    /// Its type.
    pub ty: PortType,
    /// What it is where nothing is said.
    pub value: Option<PortValue>,
    /// Or the property of the geometry that it is then (`UV0`, `Nworld`).
    pub geometry: Option<Arc<str>>,
}

/// Where an input of a node in a graph comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum PortSource {
    /// A value.
    Value(PortValue),
    /// An output of a node of the graph; the empty name is the only one.
    Node(usize, Arc<str>),
    /// An input of the node that the graph implements.
    Interface(Arc<str>),
}

/// An input of a node in a graph.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphInput {
    /// Its name.
    pub name: Arc<str>,
    /// Its type.
    pub ty: PortType,
    /// Where it comes from.
    pub source: PortSource,
    /// Colour space of a file that the node reads, if the graph says it.
    pub color_space: Option<Arc<str>>,
}

/// A node in a graph.
#[derive(Clone, Debug, PartialEq)]
pub struct GraphNode {
    /// Its name in the graph.
    pub name: Arc<str>,
    /// What kind of node.
    pub category: Arc<str>,
    /// Name of its definition, where the graph says it.
    pub definition: Option<Arc<str>>,
    /// Where definitions are looked for first.
    pub namespace: Option<Arc<str>>,
    /// Type of its output.
    pub ty: PortType,
    /// Name of that type.
    pub type_name: Arc<str>,
    /// What is said of its inputs.
    pub inputs: Vec<GraphInput>,
}

/// The implementation of a definition by other nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NodeGraph {
    /// The nodes.
    pub nodes: Vec<GraphNode>,
    /// Its outputs: name and where from.
    pub outputs: Vec<(Arc<str>, PortSource)>,
}

/// A definition of a node (`nodedef`).
#[derive(Clone, Debug, PartialEq)]
pub struct NodeDef {
    /// Its name, `ND_add_float` for instance.
    pub name: Arc<str>,
    /// What kind of node, `add` for instance.
    pub category: Arc<str>,
    /// Inputs.
    pub inputs: Vec<InputDef>,
    /// Outputs: name, type, name of the type.
    pub outputs: Vec<(Arc<str>, PortType, Arc<str>)>,
    /// Its implementation, if it is a graph.
    pub graph: Option<Arc<NodeGraph>>,
    /// The one that is meant where the version is not said.
    pub is_default_version: bool,
}

impl NodeDef {
    /// An input.
    #[must_use]
    pub fn input(&self, name: &str) -> Option<&InputDef> {
        self.inputs.iter().find(|input| &*input.name == name)
    }

    /// Type of an output; the first one for an empty name.
    #[must_use]
    pub fn output(&self, name: &str) -> Option<PortType> {
        let found = self.outputs.iter().find(|(output, ..)| name.is_empty() || &**output == name);
        found.or(self.outputs.first()).map(|(_, ty, _)| *ty)
    }
}

/// All definitions.
#[derive(Clone, Debug, Default)]
pub struct NodeLibrary {
    definitions: HashMap<Arc<str>, Arc<NodeDef>>,
    by_category: HashMap<Arc<str>, Vec<Arc<NodeDef>>>,
    problems: Vec<String>,
}

impl NodeLibrary {
    /// Reads all `.mtlx` files below the folders. Folders of generators (`gen*`) hold no definitions that count here.
    #[must_use]
    pub fn read(folders: &[PathBuf]) -> Self {
        Self::read_with(folders, &[])
    }

    /// The same, and what lies below the folders `own`, which stands for what is of the same name.
    #[must_use]
    pub fn read_with(folders: &[PathBuf], own: &[PathBuf]) -> Self {
        let mut texts = Vec::new();
        let mut problems = Vec::new();
        for folders in [folders, own] {
            let mut files = Vec::new();
            for folder in folders {
                collect(folder, 0, &mut files);
            }
            files.sort();
            files.dedup();
            if files.len() > MAX_FILES {
                problems.push(format!("has more than {MAX_FILES} files: the rest is left out"));
            }
            for file in files.iter().take(MAX_FILES) {
                match text_of(file) {
                    Ok(text) => texts.push((file.display().to_string(), text)),
                    Err(error) => problems.push(format!("{}: {error}", file.display())),
                }
            }
        }
        let mut library = Self::parse(&texts);
        library.problems.extend(problems);
        library
    }

    /// This library and what these files define, and those that they include: relative to the file that does, at most
    /// [`MAX_INCLUDED`]. What is of the same name stands for what was there.
    #[must_use]
    pub fn with_files(&self, files: &[PathBuf]) -> Self {
        let mut problems = Vec::new();
        let mut texts = Vec::new();
        let mut rest: Vec<PathBuf> = files.iter().rev().cloned().collect();
        let mut known: Vec<PathBuf> = Vec::new();
        while let Some(file) = rest.pop() {
            if known.contains(&file) {
                continue;
            }
            if known.len() >= MAX_INCLUDED {
                problems.push(format!("{} is one of more than {MAX_INCLUDED} files: it is left out", file.display()));
                break;
            }
            match text_of(&file) {
                Ok(text) => {
                    let folder = file.parent().unwrap_or(Path::new(""));
                    rest.extend(parse::included(&text).iter().map(|name| folder.join(name)));
                    texts.push((file.display().to_string(), text));
                }
                Err(error) => problems.push(format!("{}: {error}", file.display())),
            }
            known.push(file);
        }
        // What includes others comes after them.
        texts.reverse();
        let added = Self::parse(&texts);
        problems.extend(added.problems);
        let mut library = Self { problems, ..self.clone() };
        for definition in added.definitions.into_values() {
            library.insert(definition);
        }
        library
    }

    fn insert(&mut self, definition: Arc<NodeDef>) {
        let of_category = self.by_category.entry(Arc::clone(&definition.category)).or_default();
        of_category.retain(|known| known.name != definition.name);
        of_category.push(Arc::clone(&definition));
        self.definitions.insert(Arc::clone(&definition.name), definition);
    }

    /// Reads library files given as name and text. Files that their definitions name are relative to them.
    #[must_use]
    pub fn parse(texts: &[(String, String)]) -> Self {
        let mut library = Self::default();
        let mut parser = parse::LibraryParser::default();
        for (name, text) in texts {
            if let Err(error) = parser.file(Path::new(name), text) {
                library.problems.push(format!("{name}: {error}"));
            }
        }
        for definition in parser.finish() {
            library.insert(Arc::new(definition));
        }
        library
    }

    /// Whether it has no definition at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.definitions.is_empty()
    }

    /// All definitions, in no order.
    pub fn definitions(&self) -> impl Iterator<Item = &Arc<NodeDef>> {
        self.definitions.values()
    }

    /// Names of all definitions, sorted.
    #[must_use]
    pub fn names(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.definitions.keys().map(|name| &**name).collect();
        names.sort_unstable();
        names
    }

    /// What could not be read.
    #[must_use]
    pub fn problems(&self) -> &[String] {
        &self.problems
    }

    /// A definition by its name; by its new one where only that is known.
    #[must_use]
    pub fn definition(&self, name: &str) -> Option<&Arc<NodeDef>> {
        self.definitions.get(name).or_else(|| self.definitions.get(renamed(name)?))
    }

    /// The definition that a node in a graph means: of its category and type, with all of the inputs that are said,
    /// of their types. Else with most of them: graphs of `MaterialX` 1.38 have inputs that later versions do not.
    #[must_use]
    pub fn matching(&self, node: &GraphNode) -> Option<&Arc<NodeDef>> {
        if let Some(name) = &node.definition {
            let own = node.namespace.as_ref().and_then(|space| self.definition(&format!("{space}:{name}")));
            return own.or_else(|| self.definition(name));
        }
        let own = node.namespace.as_ref().map(|space| format!("{space}:{}", node.category));
        let own = own.and_then(|name| self.by_category.get(&*name));
        own.and_then(|candidates| Self::fitting(candidates, node))
            .or_else(|| Self::fitting(self.by_category.get(&node.category)?, node))
    }

    /// Of definitions of one category the one that a node means.
    fn fitting<'a>(candidates: &'a [Arc<NodeDef>], node: &GraphNode) -> Option<&'a Arc<NodeDef>> {
        let fits = |definition: &&Arc<NodeDef>, exactly: bool| {
            let is_multi = &*node.type_name == "multioutput" && definition.outputs.len() > 1;
            let has_type = definition.outputs.first().is_some_and(|(.., name)| *name == node.type_name);
            (is_multi || has_type)
                && node
                    .inputs
                    .iter()
                    .all(|input| definition.input(&input.name).is_some_and(|found| !exactly || found.ty == input.ty))
        };
        let find = |exactly: bool, default: bool| {
            candidates.iter().find(|found| fits(found, exactly) && (!default || found.is_default_version))
        };
        let most = || {
            let known = |found: &&Arc<NodeDef>| {
                node.inputs.iter().filter(|input| found.input(&input.name).is_some_and(|of| of.ty == input.ty)).count()
            };
            let of_type =
                |found: &&Arc<NodeDef>| found.outputs.first().is_some_and(|(.., name)| *name == node.type_name);
            // The first of those that know as many.
            candidates.iter().filter(of_type).rev().max_by_key(known)
        };
        find(true, true)
            .or_else(|| find(true, false))
            .or_else(|| find(false, true))
            .or_else(|| find(false, false))
            .or_else(most)
    }
}

/// What a definition of `MaterialX` 1.38 is called in 1.39. Those that are neither here nor in the module `older` of
/// the nodes are not understood any more (`curveadjust`, `arrayappend`, `ambientocclusion`), and who asks is told.
fn renamed(name: &str) -> Option<&'static str> {
    match name {
        "ND_normalmap" => Some("ND_normalmap_float"),
        "ND_disney_brdf_2012_surface" | "ND_disney_bsdf_2015_surface" => Some("ND_disney_principled"),
        _ => None,
    }
}

/// What is in a file. A pipe or a device, which could be waited for without an end, is not opened.
fn text_of(file: &Path) -> std::io::Result<String> {
    let bytes = oocpt_files::read(file, MAX_FILE_BYTES)?;
    String::from_utf8(bytes).map_err(|error| Error::new(ErrorKind::InvalidData, error))
}

fn collect(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        let name = entry.file_name();
        if path.is_dir() {
            if depth < 3 && !name.to_string_lossy().starts_with("gen") && files.len() <= MAX_FILES {
                collect(&path, depth + 1, files);
            }
        } else if path.extension().is_some_and(|extension| extension == "mtlx") && files.len() <= MAX_FILES {
            files.push(path);
        }
    }
}
