// SPDX-License-Identifier: Apache-2.0
//! Files that nodes name for their own definitions (`info:mtlx:sourceAsset`): OpenUSD names them where a document that
//! a scene references defines nodes. Read again when they change. Any thread; reading waits for the disk.

use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::SystemTime;

use oocpt_materialx::library::Library;

use crate::desc::{AssetRef, MaterialDesc, NodeDesc, ParamValue};

/// The parameter of a node that names the file; no input of a node has such a name.
const FILE: &str = "info:mtlx:sourceAsset";
/// Most files of a material; what is beyond is not asked.
const MOST_FILES: usize = 16;
/// Most libraries that are kept.
const MOST_KEPT: usize = 32;

/// A file, and what tells that it is another one.
type Stamp = (PathBuf, Option<SystemTime>, u64);
type Kept = Vec<(Vec<Stamp>, Arc<Library>)>;

static KEPT: Mutex<Kept> = Mutex::new(Vec::new());

/// The file that defines a node, if it names one.
pub(super) fn of_node(node: &NodeDesc) -> Option<&AssetRef> {
    node.params.iter().find_map(|param| match &param.value {
        ParamValue::Asset(asset) if *param.name == *FILE => Some(asset),
        _ => None,
    })
}

/// The library with the definitions of one's own that nodes of a material name; `None` where they name none.
pub(super) fn own(desc: &MaterialDesc, library: &Library) -> Option<Arc<Library>> {
    let mut files: Vec<Stamp> = Vec::new();
    for asset in desc.nodes.iter().filter_map(of_node) {
        let name = if asset.resolved.is_empty() { &asset.authored } else { &asset.resolved };
        let path = PathBuf::from(&**name);
        if files.len() < MOST_FILES && !files.iter().any(|(known, ..)| *known == path) {
            let data = fs::metadata(&path).ok();
            let changed = data.as_ref().and_then(|data| data.modified().ok());
            files.push((path, changed, data.map_or(0, |data| data.len())));
        }
    }
    if files.is_empty() {
        return None;
    }
    let lock = || KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((_, known)) = lock().iter().find(|(of, _)| *of == files) {
        return Some(Arc::clone(known));
    }
    let paths: Vec<PathBuf> = files.iter().map(|(path, ..)| path.clone()).collect();
    let made = Arc::new(library.with_files(&paths));
    let mut kept = lock();
    if kept.len() >= MOST_KEPT {
        kept.remove(0);
    }
    kept.push((files, Arc::clone(&made)));
    Some(made)
}
