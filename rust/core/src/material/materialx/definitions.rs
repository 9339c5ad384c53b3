// SPDX-License-Identifier: Apache-2.0
//! Files that nodes name for their own definitions (`info:mtlx:sourceAsset`): OpenUSD names them where a document that
//! a scene references defines nodes. `oocpt_materialx` reads them. Any thread; reading waits for the disk.

use std::path::PathBuf;
use std::sync::Arc;

use oocpt_materialx::library::{NodeLibrary, with_documents};

use crate::desc::{AssetRef, MaterialDesc, NodeDesc, ParamValue};

/// The parameter of a node that names the file; no input of a node has such a name.
const FILE: &str = "info:mtlx:sourceAsset";
/// Most files of a material; what is beyond is not asked.
const MOST_FILES: usize = 16;

/// The file that defines a node, if it names one.
pub(super) fn of_node(node: &NodeDesc) -> Option<&AssetRef> {
    node.params.iter().find_map(|param| match &param.value {
        ParamValue::Asset(asset) if *param.name == *FILE => Some(asset),
        _ => None,
    })
}

/// The library with the definitions of one's own that nodes of a material name; `None` where they name none.
pub(super) fn own(desc: &MaterialDesc, library: &NodeLibrary) -> Option<Arc<NodeLibrary>> {
    let mut files: Vec<PathBuf> = Vec::new();
    for asset in desc.nodes.iter().filter_map(of_node) {
        let name = if asset.resolved.is_empty() { &asset.authored } else { &asset.resolved };
        let path = PathBuf::from(&**name);
        if files.len() < MOST_FILES && !files.contains(&path) {
            files.push(path);
        }
    }
    if files.is_empty() { None } else { Some(with_documents(library, &files)) }
}
