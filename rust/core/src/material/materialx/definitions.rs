// SPDX-License-Identifier: Apache-2.0
//! Reads files that nodes name for their own definitions (`info:mtlx:sourceAsset`): OpenUSD names them if a document
//! that a scene references defines nodes. `oocpt_materialx` parses them. Any thread; reading waits for the disk.

use std::path::PathBuf;
use std::sync::Arc;

use oocpt_materialx::library::{NodeLibrary, with_documents};

use crate::desc::{AssetRef, MaterialDesc, NodeDesc, ParamValue};

/// Parameter of a node that names the file; no input of a node has such a name.
const FILE: &str = "info:mtlx:sourceAsset";
/// Largest number of files of a material; further ones are not read.
const MAX_FILES: usize = 16;

/// The file that defines a node, if it names one.
pub(super) fn of_node(node: &NodeDesc) -> Option<&AssetRef> {
    node.params.iter().find_map(|param| match &param.value {
        ParamValue::Asset(asset) if *param.name == *FILE => Some(asset),
        _ => None,
    })
}

/// The library with the custom definitions that nodes of a material name; `None` if they name none.
pub(super) fn own(desc: &MaterialDesc, library: &NodeLibrary) -> Option<Arc<NodeLibrary>> {
    let mut files: Vec<PathBuf> = Vec::new();
    for asset in desc.nodes.iter().filter_map(of_node) {
        let name = if asset.resolved.is_empty() { &asset.authored } else { &asset.resolved };
        let path = PathBuf::from(&**name);
        if files.len() < MAX_FILES && !files.contains(&path) {
            files.push(path);
        }
    }
    if files.is_empty() { None } else { Some(with_documents(library, &files)) }
}
