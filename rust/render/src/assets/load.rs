// SPDX-License-Identifier: Apache-2.0
//! Loads assets to the device on the loader's threads while the render thread traces: encode, write to pinned staging
//! memory, copy on the transfer queue. Encodings that were kept are only written and copied. A load belongs to an
//! [`LoadInbox`]; loads of an inbox that was dropped are skipped.

use super::copied::CopiedAssets;
use super::encode::AssetCopier;
use super::kept::EncodedAssets;
use super::level::{self, EncodedAsset, EncodedPiece, EncodedStretch, RECORD};
use super::source::AssetSource;
use crate::device::loader::Loader;
use crate::device::reading::ReadingLimit;
use crate::error::RenderError;
use crate::sync::lock;
use crossbeam_channel::{Receiver, Sender, unbounded};
use oocpt_abi::Bvh4Node;
use oocpt_core::mesh::LevelTree;
use oocpt_core::residency::AssetId;
use oocpt_gpu::{DeviceRange, Gpu, HeapRange, StagingRing};
use rustc_hash::FxHashMap;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, Weak};
use std::time::Duration;

/// Bytes that one thread copies in one piece, if they need no encoding.
const COPY_BYTES: u64 = 1 << 20;

/// An asset to load to the device.
#[derive(Debug)]
pub(crate) struct WantedAsset {
    pub(crate) asset: AssetId,
    pub(crate) source: AssetSource,
    pub(crate) target: Arc<HeapRange>,
}

/// Assets that are loaded to the device together.
#[derive(Debug)]
struct AssetLoad {
    wanted: Vec<WantedAsset>,
    /// The store of encodings, which is read and filled.
    kept: Arc<EncodedAssets>,
    reading: Arc<ReadingLimit>,
    reply: Sender<LoadResult>,
    /// Dropped when nobody waits for the result any more.
    alive: Weak<()>,
    progress: Mutex<LoadProgress>,
}

/// The progress of the parts of a load.
#[derive(Debug)]
struct LoadProgress {
    left: usize,
    /// For assemblies and chunks: the number of parts that are not encoded yet, and the encoded ones.
    levels: FxHashMap<usize, (usize, Vec<EncodedStretch>)>,
    /// The combined result of the finished parts.
    sum: Result<CopiedAssets, RenderError>,
}

/// A part of a load: several threads work on one, so that a ray waits as short as possible.
#[derive(Debug)]
enum LoadPart {
    /// All of these meshes and tiles.
    Whole(Range<usize>),
    /// Records of an assembly or a chunk.
    Records(usize, Range<usize>),
    /// Pieces of the kept encoding of an assembly or a chunk.
    Pieces(usize, Arc<EncodedAsset>, Range<usize>),
}

/// A part of a load in the queue.
#[derive(Debug)]
struct LoadJob {
    load: Arc<AssetLoad>,
    part: LoadPart,
}

/// What became of a load.
pub(crate) type LoadResult = Result<CopiedAssets, RenderError>;

/// Receives the results of one scene's loads.
#[derive(Debug)]
pub(crate) struct LoadInbox {
    reply: Sender<LoadResult>,
    results: Receiver<LoadResult>,
    wanted: Arc<()>,
    in_flight: AtomicU64,
}

impl Default for LoadInbox {
    fn default() -> Self {
        let (reply, results) = unbounded();
        Self { reply, results, wanted: Arc::new(()), in_flight: AtomicU64::new(0) }
    }
}

impl LoadInbox {
    /// A result, if one has arrived.
    pub(crate) fn try_next(&self) -> Option<LoadResult> {
        let loaded = self.results.try_recv().ok()?;
        self.in_flight.fetch_sub(1, Ordering::Relaxed);
        Some(loaded)
    }

    /// The next result; `None` after `timeout` or if nothing is under way.
    pub(crate) fn next(&self, timeout: Duration) -> Option<LoadResult> {
        if self.in_flight() == 0 {
            return None;
        }
        let loaded = self.results.recv_timeout(timeout).ok()?;
        self.in_flight.fetch_sub(1, Ordering::Relaxed);
        Some(loaded)
    }

    /// Requests a load of `wanted`; its result arrives here.
    pub(crate) fn load(
        &self,
        loader: &Loader,
        wanted: Vec<WantedAsset>,
        kept: &Arc<EncodedAssets>,
    ) -> Result<(), RenderError> {
        if wanted.is_empty() {
            return Ok(());
        }
        let (parts, progress) = parts(&wanted, kept);
        let load = Arc::new(AssetLoad {
            wanted,
            kept: Arc::clone(kept),
            reading: Arc::clone(loader.reading()),
            reply: self.reply.clone(),
            alive: Arc::downgrade(&self.wanted),
            progress: Mutex::new(progress),
        });
        for part in parts {
            let job = LoadJob { load: Arc::clone(&load), part };
            loader.run(Box::new(|gpu, ring| job.run(gpu, ring)))?;
        }
        self.in_flight.fetch_add(1, Ordering::Relaxed);
        Ok(())
    }

    /// Loads whose results have not been taken.
    pub(crate) fn in_flight(&self) -> u64 {
        self.in_flight.load(Ordering::Relaxed)
    }
}

/// The parts that threads may write in parallel, at least one, and the initial progress.
fn parts(wanted: &[WantedAsset], kept: &EncodedAssets) -> (Vec<LoadPart>, LoadProgress) {
    let mut parts = Vec::new();
    let mut copied = CopiedAssets::default();
    let mut levels = FxHashMap::default();
    // Encoding takes longest, so it comes first.
    for (at, WantedAsset { asset, source, .. }) in wanted.iter().enumerate() {
        match source {
            AssetSource::Tile(..) => copied.assets.push((*asset, 0)),
            AssetSource::Mesh(mesh) => copied.assets.push((*asset, mesh.stack)),
            AssetSource::Assembly(_) | AssetSource::Chunk(_) => match kept.get(&source.key()) {
                Some(encoded) => {
                    copied.assets.push((*asset, encoded.stack));
                    let sizes = encoded.pieces.iter().map(|piece| piece.bytes.len() as u64);
                    let ranges = groups(sizes);
                    parts.extend(ranges.into_iter().map(|range| LoadPart::Pieces(at, Arc::clone(&encoded), range)));
                }
                None => {
                    let before = parts.len();
                    parts.extend(level::stretches(source).map(|records| LoadPart::Records(at, records)));
                    levels.insert(at, (parts.len() - before, Vec::new()));
                }
            },
        }
    }
    let sizes = wanted.iter().map(|wanted| match wanted.source {
        AssetSource::Mesh(_) | AssetSource::Tile(..) => wanted.source.size(),
        AssetSource::Assembly(_) | AssetSource::Chunk(_) => 0,
    });
    parts.extend(groups(sizes).into_iter().map(LoadPart::Whole));
    if parts.is_empty() {
        // An empty load has a result too.
        parts.push(LoadPart::Whole(0..wanted.len()));
    }
    let left = parts.len();
    (parts, LoadProgress { left, levels, sum: Ok(copied) })
}

/// Ranges of items of these sizes, of at least [`COPY_BYTES`] each but for the last; no range is empty.
fn groups(sizes: impl Iterator<Item = u64>) -> Vec<Range<usize>> {
    let (mut groups, mut first, mut bytes, mut end) = (Vec::new(), 0, 0, 0);
    for (at, size) in sizes.enumerate() {
        bytes += size;
        end = at + 1;
        if bytes >= COPY_BYTES {
            groups.push(first..end);
            (first, bytes) = (end, 0);
        }
    }
    if bytes > 0 {
        groups.push(first..end);
    }
    groups
}

impl LoadJob {
    fn run(self, gpu: &Arc<Gpu>, ring: &StagingRing) {
        if self.load.alive.strong_count() == 0 {
            return;
        }
        let mut writer = AssetCopier::new(gpu, ring);
        let written = catch_unwind(AssertUnwindSafe(|| self.write(&mut writer)))
            .unwrap_or_else(|_| Err(RenderError::Internal("a loader thread panicked".into())));
        self.load.done(written.and_then(|CopiedAssets { assets, left_out, .. }| {
            Ok(CopiedAssets { assets, left_out, ..writer.finish()? })
        }));
    }

    /// Writes the part; returns the assets that it completes, with their stack entries, and those that cannot be read.
    fn write(&self, writer: &mut AssetCopier<'_>) -> Result<CopiedAssets, RenderError> {
        let mut copied = CopiedAssets::default();
        let of = |at: usize| {
            let wanted = self.load.wanted.get(at);
            wanted.ok_or_else(|| RenderError::Internal("a part of an asset that is not wanted".into()))
        };
        match &self.part {
            LoadPart::Records(at, range) => {
                let WantedAsset { asset, source, target } = of(*at)?;
                let kept = &self.load.kept;
                let stretch = if kept.keeps() {
                    let stretch = level::encode(source, range.clone());
                    writer.pieces(&stretch.pieces, &**target)?;
                    stretch
                } else {
                    send(source, range.clone(), writer, &**target)?
                };
                let Some(mut stretches) = self.load.encoded(*at, stretch) else { return Ok(copied) };
                let LevelTree { nodes, stack } = level::tree(source, &mut stretches, &kept.shapes);
                let nodes: &[u8] = bytemuck::cast_slice(&nodes);
                writer.bytes(&**target, source.nodes_at(), nodes)?;
                // Without the records of a stretch nothing can be kept.
                if stretches.iter().all(|stretch| !stretch.pieces.is_empty()) {
                    kept.offer(source.key(), encoded(source, stretches, (nodes, stack)));
                }
                copied.assets.push((*asset, stack));
            }
            LoadPart::Pieces(at, encoded, range) => {
                writer.pieces(encoded.pieces.get(range.clone()).unwrap_or_default(), &*of(*at)?.target)?;
            }
            LoadPart::Whole(range) => {
                for WantedAsset { source, target, .. } in self.load.wanted.get(range.clone()).unwrap_or_default() {
                    match source {
                        AssetSource::Mesh(mesh) => {
                            // Copies in hand hold staging memory that others may wait for.
                            let read = mesh.bytes_to_read();
                            let _read =
                                (read > 0).then(|| self.load.reading.begin(read, || writer.submit())).transpose()?;
                            match mesh.asset() {
                                Ok(asset) => writer.mesh((mesh, &asset), &**target)?,
                                Err(error) => {
                                    writer.bytes(&**target, 0, bytemuck::bytes_of(&NO_MESH))?;
                                    copied.left_out.push((source.key(), format!("{error}; it is left out")));
                                }
                            }
                        }
                        AssetSource::Tile(image, tile) => writer.bytes(&**target, 0, &image.tile(*tile))?,
                        AssetSource::Assembly(_) | AssetSource::Chunk(_) => {}
                    }
                }
            }
        }
        Ok(copied)
    }
}

/// The root of an absent mesh: no ray meets the boxes of its children, whose planes are in the wrong order.
const NO_MESH: Bvh4Node = Bvh4Node {
    origin: [0; 3],
    cell_and_counts: 0x007f_7f7f,
    lower: [u32::MAX; 3],
    upper: [0; 3],
    first_child: 0,
    first_triangle: 0,
};

/// Encodes records `range` of `source` where they are staged; nothing of them is kept but their boxes.
fn send(
    source: &AssetSource,
    range: Range<usize>,
    writer: &mut AssetCopier<'_>,
    target: &dyn DeviceRange,
) -> Result<EncodedStretch, RenderError> {
    let mut boxes = Vec::with_capacity(range.len());
    let offset = (range.start * RECORD) as u64;
    writer.section(target, offset, (range.len(), RECORD), |first, out| {
        let first = range.start + first;
        level::records(source, first..first + out.len() / RECORD, out, &mut boxes);
    })?;
    writer.pieces(&level::beside(source, range.clone()), target)?;
    Ok(EncodedStretch { first: range.start, pieces: Vec::new(), boxes })
}

/// The encoding of an assembly or chunk with its tree, and the stack entries that a walk of it needs.
fn encoded(source: &AssetSource, stretches: Vec<EncodedStretch>, (nodes, stack): (&[u8], u32)) -> EncodedAsset {
    let mut pieces: Vec<EncodedPiece> = stretches.into_iter().flat_map(|stretch| stretch.pieces).collect();
    pieces.push(EncodedPiece { offset: source.nodes_at(), bytes: nodes.to_vec() });
    EncodedAsset { pieces, stack }
}

impl AssetLoad {
    /// Adds an encoded stretch of an assembly or chunk; the call for the last one returns all of them.
    fn encoded(&self, at: usize, stretch: EncodedStretch) -> Option<Vec<EncodedStretch>> {
        let mut progress = lock(&self.progress);
        let (left, stretches) = progress.levels.get_mut(&at)?;
        *left = left.saturating_sub(1);
        stretches.push(stretch);
        (*left == 0).then(|| std::mem::take(stretches))
    }

    /// Adds the result of one part; the last one sends the result of the load.
    fn done(&self, result: Result<CopiedAssets, RenderError>) {
        let mut progress = lock(&self.progress);
        progress.left = progress.left.saturating_sub(1);
        match (&mut progress.sum, result) {
            (Ok(sum), Ok(copied)) => {
                sum.submissions.extend(copied.submissions);
                sum.bytes += copied.bytes;
                sum.assets.extend(copied.assets);
                sum.left_out.extend(copied.left_out);
            }
            (sum @ Ok(_), Err(error)) => *sum = Err(error),
            (Err(_), _) => {}
        }
        if progress.left > 0 {
            return;
        }
        let result = std::mem::replace(&mut progress.sum, Ok(CopiedAssets::default()));
        drop(progress);
        if self.reply.send(result).is_err() {
            tracing::debug!("nobody waits for a load any more");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_groups_cover_all_assets_and_reach_the_minimum_size() {
        let of = |sizes: &[u64]| groups(sizes.iter().copied());
        assert_eq!(of(&[]), []);
        assert_eq!(of(&[0, 0]), [], "no part for nothing");
        assert_eq!(of(&[COPY_BYTES, 1, COPY_BYTES, 5, 0, 7]), [0..1, 1..3, 3..6], "what is left over is one too");
    }
}
