// SPDX-License-Identifier: Apache-2.0
//! Definitions of nodes, read from `MaterialX`'s data libraries (`libraries/*/*.mtlx`).
//!
//! Limits: [`MAX_FILE_BYTES`] a file, [`MAX_FILES`] files, folders three deep. What cannot be read is left out, and
//! [`Library::problems`] says so.

mod parse;

use std::collections::HashMap;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use crate::value::{Type, Value};

/// Most bytes of a library file.
pub const MAX_FILE_BYTES: u64 = 16 << 20;
/// Most files of a library.
pub const MAX_FILES: usize = 512;

/// Folders of data libraries, as OpenUSD takes them from the environment.
const SEARCH_PATHS: &str = "PXR_MTLX_STDLIB_SEARCH_PATHS";

static STANDARD: OnceLock<Library> = OnceLock::new();

/// The data libraries of this process: those of the folders of `PXR_MTLX_STDLIB_SEARCH_PATHS`, read at first use. Any
/// thread; empty where there are none.
pub fn standard() -> &'static Library {
    STANDARD.get_or_init(|| {
        let paths = std::env::var_os(SEARCH_PATHS).unwrap_or_default();
        let library = Library::read(&std::env::split_paths(&paths).collect::<Vec<_>>());
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
    pub ty: Type,
    /// What it is where nothing is said.
    pub value: Option<Value>,
    /// Or the property of the geometry that it is then (`UV0`, `Nworld`).
    pub geometry: Option<Arc<str>>,
}

/// Where an input of a node in a graph comes from.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// A value.
    Value(Value),
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
    pub ty: Type,
    /// Where it comes from.
    pub source: Source,
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
    /// Type of its output.
    pub ty: Type,
    /// Name of that type.
    pub type_name: Arc<str>,
    /// What is said of its inputs.
    pub inputs: Vec<GraphInput>,
}

/// The implementation of a definition by other nodes.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Graph {
    /// The nodes.
    pub nodes: Vec<GraphNode>,
    /// Its outputs: name and where from.
    pub outputs: Vec<(Arc<str>, Source)>,
}

/// A definition of a node (`nodedef`).
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    /// Its name, `ND_add_float` for instance.
    pub name: Arc<str>,
    /// What kind of node, `add` for instance.
    pub category: Arc<str>,
    /// Inputs.
    pub inputs: Vec<InputDef>,
    /// Outputs: name, type, name of the type.
    pub outputs: Vec<(Arc<str>, Type, Arc<str>)>,
    /// Its implementation, if it is a graph.
    pub graph: Option<Arc<Graph>>,
    /// The one that is meant where the version is not said.
    pub is_default_version: bool,
}

impl Definition {
    /// An input.
    #[must_use]
    pub fn input(&self, name: &str) -> Option<&InputDef> {
        self.inputs.iter().find(|input| &*input.name == name)
    }

    /// Type of an output; the first one for an empty name.
    #[must_use]
    pub fn output(&self, name: &str) -> Option<Type> {
        let found = self.outputs.iter().find(|(output, ..)| name.is_empty() || &**output == name);
        found.or(self.outputs.first()).map(|(_, ty, _)| *ty)
    }
}

/// All definitions.
#[derive(Debug, Default)]
pub struct Library {
    definitions: HashMap<Arc<str>, Arc<Definition>>,
    by_category: HashMap<Arc<str>, Vec<Arc<Definition>>>,
    problems: Vec<String>,
}

impl Library {
    /// Reads all `.mtlx` files below the folders. Folders of generators (`gen*`) hold no definitions that count here.
    #[must_use]
    pub fn read(folders: &[PathBuf]) -> Self {
        let mut files = Vec::new();
        for folder in folders {
            collect(folder, 0, &mut files);
        }
        files.sort();
        files.dedup();
        let mut texts = Vec::new();
        let mut problems = Vec::new();
        for file in files.iter().take(MAX_FILES) {
            let text = oocpt_files::read(file, MAX_FILE_BYTES).and_then(|bytes| {
                String::from_utf8(bytes).map_err(|error| io::Error::new(ErrorKind::InvalidData, error))
            });
            match text {
                Ok(text) => texts.push((file.display().to_string(), text)),
                Err(error) => problems.push(format!("{}: {error}", file.display())),
            }
        }
        let mut library = Self::parse(&texts);
        library.problems.extend(problems);
        library
    }

    /// Reads library files given as name and text.
    #[must_use]
    pub fn parse(texts: &[(String, String)]) -> Self {
        let mut library = Self::default();
        let mut parser = parse::Parser::default();
        for (name, text) in texts {
            if let Err(error) = parser.file(text) {
                library.problems.push(format!("{name}: {error}"));
            }
        }
        for definition in parser.finish() {
            let definition = Arc::new(definition);
            library.by_category.entry(Arc::clone(&definition.category)).or_default().push(Arc::clone(&definition));
            library.definitions.insert(Arc::clone(&definition.name), definition);
        }
        library
    }

    /// Whether it has no definition at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.definitions.is_empty()
    }

    /// All definitions, in no order.
    pub fn definitions(&self) -> impl Iterator<Item = &Arc<Definition>> {
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

    /// A definition by its name.
    #[must_use]
    pub fn definition(&self, name: &str) -> Option<&Arc<Definition>> {
        self.definitions.get(name)
    }

    /// The definition that a node in a graph means: of its category and type, with all of the inputs that are said,
    /// of their types.
    #[must_use]
    pub fn matching(&self, node: &GraphNode) -> Option<&Arc<Definition>> {
        if let Some(name) = &node.definition {
            return self.definition(name);
        }
        let fits = |definition: &&Arc<Definition>, exactly: bool| {
            let is_multi = &*node.type_name == "multioutput" && definition.outputs.len() > 1;
            let has_type = definition.outputs.first().is_some_and(|(.., name)| *name == node.type_name);
            (is_multi || has_type)
                && node
                    .inputs
                    .iter()
                    .all(|input| definition.input(&input.name).is_some_and(|found| !exactly || found.ty == input.ty))
        };
        let candidates = self.by_category.get(&node.category)?;
        let find = |exactly: bool, default: bool| {
            candidates.iter().find(|found| fits(found, exactly) && (!default || found.is_default_version))
        };
        find(true, true).or_else(|| find(true, false)).or_else(|| find(false, true)).or_else(|| find(false, false))
    }
}

fn collect(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else { return };
    for entry in entries.flatten() {
        let path = entry.path();
        let name = entry.file_name();
        if path.is_dir() {
            if depth < 3 && !name.to_string_lossy().starts_with("gen") && files.len() < MAX_FILES {
                collect(&path, depth + 1, files);
            }
        } else if path.extension().is_some_and(|extension| extension == "mtlx") && files.len() < MAX_FILES {
            files.push(path);
        }
    }
}
