// SPDX-License-Identifier: Apache-2.0
//! An append-only file of records of built meshes.
//!
//! A record is a [`RecordHeader`], a table of its payloads, a head, and the payloads, in native byte order; the next
//! one begins at a multiple of [`ALIGN`]. The header is written last, so a process that dies leaves a record that is
//! not seen; everything else has a hash that is compared when it is read. One process appends, any number read.

use crate::sync::lock;
use bytemuck::{Pod, Zeroable};
use oocpt_core::mesh::{PayloadError, PayloadSource, StoredEntry};
use rustc_hash::FxHashMap;
use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

/// The first word of every record.
const MAGIC: u64 = u64::from_le_bytes(*b"OocPTgeo");
/// Version of the layout of records.
const VERSION: u32 = 1;
/// Alignment of records.
const ALIGN: u64 = 64;
/// Largest table and head: they are read before their hash is known.
const MAX_HEAD_BYTES: u64 = 256 << 20;
/// Largest payload that is read and written in one piece.
const ONE_PIECE: u64 = 256 << 10;

/// The header of a record.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
struct RecordHeader {
    magic: u64,
    version: u32,
    payloads: u32,
    key: [u64; 2],
    head_bytes: u64,
    /// Bytes of the record, header included.
    record_bytes: u64,
    /// Hash of table and head.
    head_hash: u64,
    /// Hash of the fields above.
    hash: u64,
}

/// The place of a payload.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
struct PayloadPlace {
    /// Bytes from the record's first byte.
    offset: u64,
    bytes: u64,
    hash: u64,
}

/// An open file with the index of its records.
#[derive(Debug)]
pub(super) struct PackFile {
    file: File,
    /// The file's path; `None` if it has no name and is removed with the process.
    path: Option<PathBuf>,
    /// The offset of the next record.
    end: AtomicU64,
    /// Offsets of the records by key.
    records: Mutex<FxHashMap<u128, u64>>,
}

impl RecordHeader {
    fn own_hash(&self) -> u64 {
        let bytes = bytemuck::bytes_of(self);
        xxh3_64(&bytes[..bytes.len() - size_of::<u64>()])
    }

    /// Reads the header at `offset` of a file of `length` bytes, if its record is complete.
    fn read(file: &File, offset: u64, length: u64) -> Option<Self> {
        let mut header = Self::zeroed();
        file.read_exact_at(bytemuck::bytes_of_mut(&mut header), offset).ok()?;
        let table = u64::from(header.payloads) * size_of::<PayloadPlace>() as u64;
        let least = (size_of::<Self>() as u64).checked_add(table)?.checked_add(header.head_bytes)?;
        let is_whole = header.magic == MAGIC
            && header.version == VERSION
            && header.hash == header.own_hash()
            && least <= header.record_bytes
            && offset.checked_add(header.record_bytes)? <= length;
        is_whole.then_some(header)
    }

    fn key(&self) -> u128 {
        u128::from(self.key[0]) | u128::from(self.key[1]) << 64
    }
}

impl PackFile {
    /// A new file, which must be empty.
    pub(super) fn new(file: File, path: Option<PathBuf>) -> Self {
        Self { file, path, end: AtomicU64::new(0), records: Mutex::default() }
    }

    /// Opens a file of another process, which may still write to it, with the records up to the first incomplete one.
    pub(super) fn open(path: PathBuf) -> io::Result<Self> {
        let file = oocpt_files::open(&path)?;
        let metadata = file.metadata()?;
        let mut records = FxHashMap::default();
        let mut at = 0;
        while let Some(header) = RecordHeader::read(&file, at, metadata.len()) {
            if header.key() != 0 {
                records.insert(header.key(), at);
            }
            at = (at + header.record_bytes).next_multiple_of(ALIGN);
        }
        Ok(Self { file, path: Some(path), end: AtomicU64::new(at), records: Mutex::new(records) })
    }

    /// Bytes of the records.
    pub(super) fn bytes(&self) -> u64 {
        self.end.load(Ordering::Relaxed)
    }

    pub(super) fn path(&self) -> Option<&PathBuf> {
        self.path.as_ref()
    }

    /// Returns true if there is a record with this key.
    pub(super) fn has(&self, key: u128) -> bool {
        lock(&self.records).contains_key(&key)
    }

    /// Forgets all records with keys, and lets others remove the file. Payloads in use stay valid.
    pub(super) fn forget(&self) {
        lock(&self.records).clear();
        oocpt_files::release(&self.file);
    }

    /// Marks the file as used now, and until it is closed.
    pub(super) fn mark(&self) {
        let is_there = oocpt_files::hold(&self.file);
        tracing::trace!(is_there, "found");
        // The times do not matter in a folder that cannot be written.
        let marked = self.file.set_modified(std::time::SystemTime::now());
        tracing::trace!(?marked, "used");
    }

    /// Finds the record of a key; an error if it differs from what was written.
    pub(super) fn find(self: &Arc<Self>, key: u128) -> Option<Result<StoredEntry, PayloadError>> {
        let at = lock(&self.records).get(&key).copied()?;
        Some(self.entry(at))
    }

    fn entry(self: &Arc<Self>, at: u64) -> Result<StoredEntry, PayloadError> {
        let length = self.file.metadata().map_err(read_error)?.len();
        let header = RecordHeader::read(&self.file, at, length).ok_or(PayloadError::Damaged)?;
        let table = u64::from(header.payloads) * size_of::<PayloadPlace>() as u64;
        if table.saturating_add(header.head_bytes) > MAX_HEAD_BYTES {
            return Err(PayloadError::Damaged);
        }
        let bytes = |count: u64| usize::try_from(count).ok().ok_or(PayloadError::Damaged);
        let mut places = vec![PayloadPlace::zeroed(); bytes(u64::from(header.payloads))?];
        let mut head = vec![0; bytes(header.head_bytes)?];
        let after = at + size_of::<RecordHeader>() as u64;
        self.file.read_exact_at(bytemuck::cast_slice_mut(&mut places), after).map_err(read_error)?;
        self.file.read_exact_at(&mut head, after + table).map_err(read_error)?;
        if hash_of([bytemuck::cast_slice(&places), &head[..]]) != header.head_hash {
            return Err(PayloadError::Damaged);
        }
        let mut payloads: Vec<Arc<dyn PayloadSource>> = Vec::with_capacity(places.len());
        for PayloadPlace { offset, bytes, hash } in places {
            let end = offset.checked_add(bytes).filter(|end| *end <= header.record_bytes);
            end.ok_or(PayloadError::Damaged)?;
            payloads.push(Arc::new(PackPayload { pack: self.clone(), offset: at + offset, bytes, hash }));
        }
        Ok(StoredEntry { head, payloads })
    }

    /// Appends a record; the key 0 means none. Threads may append in parallel.
    pub(super) fn append(
        self: &Arc<Self>,
        key: u128,
        head: &[u8],
        payloads: &[Vec<&[u8]>],
    ) -> io::Result<Vec<Arc<dyn PayloadSource>>> {
        let size = |payload: &Vec<&[u8]>| payload.iter().map(|part| part.len() as u64).sum::<u64>();
        let too_large = || io::Error::from(io::ErrorKind::FileTooLarge);
        let table = (payloads.len() * size_of::<PayloadPlace>()) as u64;
        let first = size_of::<RecordHeader>() as u64 + table + head.len() as u64;
        if first > MAX_HEAD_BYTES {
            return Err(too_large());
        }
        let record_bytes = first + payloads.iter().map(size).sum::<u64>();
        let at = self.end.fetch_add(record_bytes.next_multiple_of(ALIGN), Ordering::Relaxed);
        let mut places = Vec::with_capacity(payloads.len());
        let mut offset = first;
        for payload in payloads {
            let bytes = size(payload);
            self.write(payload, at + offset, bytes)?;
            places.push(PayloadPlace { offset, bytes, hash: hash_of(payload.iter().copied()) });
            offset += bytes;
        }
        let tables: [&[u8]; 2] = [bytemuck::cast_slice(&places), head];
        let mut header = RecordHeader {
            magic: MAGIC,
            version: VERSION,
            payloads: u32::try_from(payloads.len()).ok().ok_or_else(too_large)?,
            key: bytemuck::cast(key.to_le_bytes()),
            head_bytes: head.len() as u64,
            record_bytes,
            head_hash: hash_of(tables),
            hash: 0,
        };
        header.hash = header.own_hash();
        self.write(&tables, at + size_of::<RecordHeader>() as u64, table + head.len() as u64)?;
        self.file.write_all_at(bytemuck::bytes_of(&header), at)?;
        if key != 0 {
            lock(&self.records).insert(key, at);
        }
        let payload = |place: &PayloadPlace| {
            let PayloadPlace { offset, bytes, hash } = *place;
            Arc::new(PackPayload { pack: self.clone(), offset: at + offset, bytes, hash }) as Arc<dyn PayloadSource>
        };
        Ok(places.iter().map(payload).collect())
    }

    fn write(&self, parts: &[&[u8]], at: u64, bytes: u64) -> io::Result<()> {
        if bytes <= ONE_PIECE {
            return self.file.write_all_at(&parts.concat(), at);
        }
        let mut at = at;
        for part in parts {
            self.file.write_all_at(part, at)?;
            at += part.len() as u64;
        }
        Ok(())
    }
}

/// A payload of a record.
#[derive(Debug)]
struct PackPayload {
    pack: Arc<PackFile>,
    /// Bytes from the file's first byte.
    offset: u64,
    bytes: u64,
    hash: u64,
}

impl PayloadSource for PackPayload {
    fn size(&self) -> u64 {
        self.bytes
    }

    fn read(&self, parts: &mut [&mut [u8]]) -> Result<(), PayloadError> {
        if parts.iter().map(|part| part.len() as u64).sum::<u64>() != self.bytes {
            return Err(PayloadError::Damaged);
        }
        let file = &self.pack.file;
        if self.bytes <= ONE_PIECE {
            let mut all = vec![0; parts.iter().map(|part| part.len()).sum()];
            file.read_exact_at(&mut all, self.offset).map_err(read_error)?;
            let mut rest = &all[..];
            for part in parts.iter_mut() {
                let (own, after) = rest.split_at(part.len());
                part.copy_from_slice(own);
                rest = after;
            }
        } else {
            let mut at = self.offset;
            for part in parts.iter_mut() {
                file.read_exact_at(part, at).map_err(read_error)?;
                at += part.len() as u64;
            }
        }
        if hash_of(parts.iter().map(|part| &**part)) == self.hash { Ok(()) } else { Err(PayloadError::Damaged) }
    }
}

fn hash_of<'a>(parts: impl IntoIterator<Item = &'a [u8]>) -> u64 {
    let mut hasher = Xxh3::new();
    parts.into_iter().for_each(|part| hasher.update(part));
    hasher.digest()
}

#[expect(clippy::needless_pass_by_value, reason = "for map_err")]
fn read_error(error: io::Error) -> PayloadError {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => PayloadError::Damaged,
        _ => PayloadError::Read(error.to_string()),
    }
}
