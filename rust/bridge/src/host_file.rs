// SPDX-License-Identifier: Apache-2.0
//! Random access to files through the host's asset resolver. A scene may name more files than a process may have open,
//! so a file is opened when it is read, and an LRU cache keeps the last [`MAX_OPEN`] of them open. Thread-safe.

use crate::ffi_images as ffi;
use cxx::UniquePtr;
use oocpt_ptex::ReadAt;
use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

/// Files that the cache keeps open.
const MAX_OPEN: usize = 32;

/// An open file; a null pointer where the host could not open it.
pub(crate) struct OpenHostFile(UniquePtr<ffi::HeldFile>);

impl OpenHostFile {
    fn get(&self) -> io::Result<&ffi::HeldFile> {
        self.0.as_ref().ok_or_else(|| io::Error::other("cannot be opened"))
    }
}

/// LRU cache of open files by resolved name; the most recently used one is last.
#[derive(Default)]
pub(crate) struct OpenFiles(Mutex<VecDeque<(Arc<str>, Arc<OpenHostFile>)>>);

impl OpenFiles {
    /// The open file of this name, which becomes the most recently used one.
    fn get(&self, name: &str) -> Option<Arc<OpenHostFile>> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let at = open.iter().position(|(other, _)| **other == *name)?;
        let entry = open.remove(at)?;
        let file = Arc::clone(&entry.1);
        open.push_back(entry);
        Some(file)
    }

    fn remove(&self, name: &str) {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|(other, _)| **other != *name);
    }

    /// Adds a file as the most recently used one and evicts the least recently used ones.
    fn insert(&self, name: &Arc<str>, file: &Arc<OpenHostFile>) {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|(other, _)| other != name);
        while open.len() >= MAX_OPEN {
            open.pop_front();
        }
        open.push_back((Arc::clone(name), Arc::clone(file)));
    }
}

/// A file of the host, which is opened again when the cache has closed it.
pub(crate) struct HostFile {
    source: Arc<UniquePtr<ffi::ImageSource>>,
    open_files: Arc<OpenFiles>,
    name: Arc<str>,
    /// In bytes, when it was first opened.
    size: u64,
}

impl fmt::Debug for HostFile {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "HostFile({})", self.name)
    }
}

impl HostFile {
    pub(crate) fn open(
        source: &Arc<UniquePtr<ffi::ImageSource>>,
        open_files: &Arc<OpenFiles>,
        name: Arc<str>,
    ) -> io::Result<Self> {
        // The file on disk may have been replaced since the cached handle was opened.
        open_files.remove(&name);
        let mut file = Self { source: Arc::clone(source), open_files: Arc::clone(open_files), name, size: 0 };
        file.size = file.handle()?.get()?.size();
        Ok(file)
    }

    /// The cached handle, or a newly opened one.
    fn handle(&self) -> io::Result<Arc<OpenHostFile>> {
        if let Some(file) = self.open_files.get(&self.name) {
            return Ok(file);
        }
        let source = self.source.as_ref().as_ref();
        let source = source.ok_or_else(|| io::Error::other("cannot be read: the host gives no files"))?;
        let file = source.open_file(&self.name).map_err(|reason| io::Error::other(reason.what().to_owned()))?;
        let file = Arc::new(OpenHostFile(file));
        self.open_files.insert(&self.name, &file);
        Ok(file)
    }
}

impl ReadAt for HostFile {
    fn size(&self) -> u64 {
        self.size
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let file = self.handle()?;
        file.get()?.read_bytes(offset, out).map_err(|reason| io::Error::other(reason.what().to_owned()))
    }
}
