// SPDX-License-Identifier: Apache-2.0
//! Tables of results of `MaterialX`'s own GLSL; `tests/reference/nodes.py` writes them and documents their format.

/// An input or a property of the geometry, and how many numbers of a row it has.
#[derive(Clone, Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    /// Empty for geometry.
    pub(crate) kind: String,
    pub(crate) width: usize,
    /// True if it cannot be connected.
    pub(crate) is_uniform: bool,
    /// The property of the geometry that is its default.
    pub(crate) default: Option<String>,
}

/// A row.
#[derive(Clone, Debug)]
pub(crate) struct Row {
    /// Inputs and geometry.
    pub(crate) given: Vec<f32>,
    /// The results of the node.
    pub(crate) expected: Vec<f32>,
    /// True if its inputs have their defaults.
    pub(crate) is_default: bool,
}

/// Rows of one output of one definition.
#[derive(Clone, Debug)]
pub(crate) struct Block {
    pub(crate) definition: String,
    pub(crate) category: String,
    pub(crate) output: String,
    /// Its type.
    pub(crate) kind: String,
    pub(crate) inputs: Vec<Column>,
    pub(crate) texts: Vec<(String, String)>,
    pub(crate) geometry: Vec<Column>,
    pub(crate) rows: Vec<Row>,
}

/// A table.
#[derive(Clone, Debug, Default)]
pub(crate) struct Table {
    pub(crate) blocks: Vec<Block>,
    /// Definitions without values, and why.
    pub(crate) missing: Vec<(String, String)>,
}

/// Numbers of a value of a type of `MaterialX`.
pub(crate) fn width(kind: &str) -> usize {
    match kind {
        "vector2" => 2,
        "vector3" | "color3" => 3,
        "vector4" | "color4" => 4,
        "matrix33" => 9,
        "matrix44" => 16,
        _ => 1,
    }
}

fn column(text: &str) -> Column {
    let (name, about) = text.split_once(':').expect("a type");
    let (about, default) = about.split_once('<').map_or((about, None), |(about, name)| (about, Some(name.to_owned())));
    let kind = about.trim_end_matches('!').to_owned();
    Column { name: name.to_owned(), width: width(&kind), is_uniform: about.ends_with('!'), kind, default }
}

fn geometry(text: &str) -> Column {
    let (name, width) = text.trim_start_matches('@').split_once(':').expect("a width");
    let width = width.parse().expect("a number");
    Column { name: name.to_owned(), kind: String::new(), width, is_uniform: false, default: None }
}

fn head(text: &str) -> Block {
    let parts: Vec<&str> = text.split('|').collect();
    let [node, inputs, seen] = parts[..] else { panic!("{text}: three parts") };
    let node: Vec<&str> = node.split_whitespace().collect();
    let [definition, category, output] = node[..] else { panic!("{text}: three words") };
    let (output, kind) = output.split_once(':').expect("a type");
    let (said, inputs): (Vec<&str>, Vec<&str>) = inputs.split_whitespace().partition(|text| text.contains('='));
    let pair = |text: &str| text.split_once('=').map(|(name, value)| (name.to_owned(), value.to_owned()));
    Block {
        definition: definition.to_owned(),
        category: category.to_owned(),
        output: output.to_owned(),
        kind: kind.to_owned(),
        inputs: inputs.into_iter().map(column).collect(),
        texts: said.into_iter().filter_map(pair).collect(),
        geometry: seen.split_whitespace().map(geometry).collect(),
        rows: Vec::new(),
    }
}

fn row(line: &str, block: &Block) -> Row {
    let is_default = line.starts_with('*');
    let (given, expected) = line.trim_start_matches('*').split_once(';').expect("a semicolon");
    let [given, expected] = [given, expected].map(|numbers| -> Vec<f32> {
        numbers.split(',').filter(|number| !number.is_empty()).map(|number| number.parse().expect("a number")).collect()
    });
    let columns: usize = block.inputs.iter().chain(&block.geometry).map(|column| column.width).sum();
    assert_eq!((given.len(), expected.len()), (columns, width(&block.kind)), "{}: {line}", block.definition);
    Row { given, expected, is_default }
}

/// Reads a table.
pub(crate) fn read(text: &str) -> Table {
    let mut table = Table::default();
    for line in text.lines() {
        if let Some(rest) = line.strip_prefix("= ") {
            table.blocks.push(head(rest));
        } else if let Some((name, why)) = line.strip_prefix("- ND_").and_then(|rest| rest.split_once(' ')) {
            table.missing.push((format!("ND_{name}"), why.to_owned()));
        } else if !line.starts_with('#') {
            let block = table.blocks.last_mut().expect("a head");
            let found = row(line, block);
            block.rows.push(found);
        }
    }
    table
}
