// SPDX-License-Identifier: Apache-2.0
//! Files of the host that are read in parts, while textures are made of them. A scene may have more of them than a
//! process may have open: each is opened when it is read, and the ones read last stay open. Any thread, several at
//! once.

use crate::ffi_images as ffi;
use cxx::UniquePtr;
use oocpt_ptex::ReadAt;
use std::collections::VecDeque;
use std::fmt;
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

/// Files that stay open.
const MOST_OPEN: usize = 32;

/// A file that is open.
pub(crate) struct OpenHostFile(UniquePtr<ffi::HeldFile>);

impl OpenHostFile {
    fn get(&self) -> io::Result<&ffi::HeldFile> {
        self.0.as_ref().ok_or_else(|| io::Error::other("cannot be opened"))
    }
}

/// Files that were read last, by their resolved names; the last one read comes last.
#[derive(Default)]
pub(crate) struct OpenFiles(Mutex<VecDeque<(Arc<str>, Arc<OpenHostFile>)>>);

impl OpenFiles {
    fn take(&self, name: &str) -> Option<Arc<OpenHostFile>> {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let at = open.iter().position(|(other, _)| **other == *name)?;
        let entry = open.remove(at)?;
        let held = Arc::clone(&entry.1);
        open.push_back(entry);
        Some(held)
    }

    fn forget(&self, name: &str) {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|(other, _)| **other != *name);
    }

    fn keep(&self, name: &Arc<str>, held: &Arc<OpenHostFile>) {
        let mut open = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        open.retain(|(other, _)| other != name);
        while open.len() >= MOST_OPEN {
            open.pop_front();
        }
        open.push_back((Arc::clone(name), Arc::clone(held)));
    }
}

/// A file of the host.
pub(crate) struct HostFile {
    source: Arc<UniquePtr<ffi::ImageSource>>,
    files: Arc<OpenFiles>,
    name: Arc<str>,
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
        files: &Arc<OpenFiles>,
        name: Arc<str>,
    ) -> io::Result<Self> {
        // The file may have changed since it was last open.
        files.forget(&name);
        let mut file = Self { source: Arc::clone(source), files: Arc::clone(files), name, size: 0 };
        file.size = file.held()?.get()?.size();
        Ok(file)
    }

    fn held(&self) -> io::Result<Arc<OpenHostFile>> {
        if let Some(held) = self.files.take(&self.name) {
            return Ok(held);
        }
        let source = self.source.as_ref().as_ref();
        let source = source.ok_or_else(|| io::Error::other("cannot be read: the host gives no files"))?;
        let held = source.open_file(&self.name).map_err(|reason| io::Error::other(reason.what().to_owned()))?;
        let held = Arc::new(OpenHostFile(held));
        self.files.keep(&self.name, &held);
        Ok(held)
    }
}

impl ReadAt for HostFile {
    fn size(&self) -> u64 {
        self.size
    }

    fn read_at(&self, offset: u64, out: &mut [u8]) -> io::Result<()> {
        let held = self.held()?;
        held.get()?.read_bytes(offset, out).map_err(|reason| io::Error::other(reason.what().to_owned()))
    }
}
