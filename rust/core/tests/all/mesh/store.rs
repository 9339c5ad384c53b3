// SPDX-License-Identifier: Apache-2.0
//! Meshes that are kept in files: the same assets as in memory, found again by another database, built again where
//! files are damaged. The files are a map in memory here.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use oocpt_core::mesh::{MeshFiles, MeshSummary, PayloadError, PayloadSource, StoredEntry};
use oocpt_core::{Interpolation, MeshDesc, NamedPrimvar, PartitionOptions, SceneDb, SceneMesh, Snapshot};

use crate::scene::bindings::{bind, color};
use crate::support::{asset, committed, grid, primvar};

/// A head and payloads.
type Entry = (Vec<u8>, Vec<Vec<u8>>);

/// What was written.
#[derive(Debug, Default)]
pub(crate) struct Files {
    lasts: bool,
    is_full: bool,
    entries: Mutex<BTreeMap<u128, Entry>>,
    added: AtomicUsize,
    found: AtomicUsize,
    damages: AtomicUsize,
    is_damaged: Arc<AtomicBool>,
    /// Reads that fail before one succeeds.
    busy: Arc<AtomicUsize>,
}

#[derive(Debug)]
struct Bytes(Vec<u8>, Arc<AtomicBool>, Arc<AtomicUsize>);

impl PayloadSource for Bytes {
    fn size(&self) -> u64 {
        self.0.len() as u64
    }

    fn read(&self, parts: &mut [&mut [u8]]) -> Result<(), PayloadError> {
        if self.2.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |busy| busy.checked_sub(1)).is_ok() {
            return Err(PayloadError::Read("the disk is busy".into()));
        }
        let mut rest = &self.0[..];
        for part in parts.iter_mut() {
            let (own, after) = rest.split_at(part.len());
            part.copy_from_slice(own);
            rest = after;
        }
        assert!(rest.is_empty(), "all is read");
        if self.1.load(Ordering::Relaxed) { Err(PayloadError::Damaged) } else { Ok(()) }
    }
}

impl Files {
    /// Files that another database finds its meshes in.
    pub(crate) fn lasting() -> Self {
        Self { lasts: true, ..Self::default() }
    }

    /// How many entries were found.
    pub(crate) fn found(&self) -> usize {
        self.found.load(Ordering::Relaxed)
    }

    fn payloads(&self, bytes: &[Vec<u8>]) -> Vec<Arc<dyn PayloadSource>> {
        let payload = |b: &Vec<u8>| Bytes(b.clone(), self.is_damaged.clone(), self.busy.clone());
        bytes.iter().map(|b| Arc::new(payload(b)) as Arc<dyn PayloadSource>).collect()
    }
}

impl MeshFiles for Files {
    fn wait(&self, _pause: Duration) {}

    fn lasts(&self) -> bool {
        self.lasts
    }

    fn find(&self, key: u128) -> Option<StoredEntry> {
        let entries = self.entries.lock().expect("not poisoned");
        let (head, payloads) = entries.get(&key)?;
        self.found.fetch_add(1, Ordering::Relaxed);
        Some(StoredEntry { head: head.clone(), payloads: self.payloads(payloads) })
    }

    fn add(&self, key: Option<u128>, head: &[u8], payloads: &[Vec<&[u8]>]) -> Option<Vec<Arc<dyn PayloadSource>>> {
        if self.is_full {
            return None;
        }
        self.added.fetch_add(1, Ordering::Relaxed);
        let bytes: Vec<Vec<u8>> = payloads.iter().map(|parts| parts.concat()).collect();
        let stored = self.payloads(&bytes);
        if let Some(key) = key {
            self.entries.lock().expect("not poisoned").insert(key, (head.to_vec(), bytes));
        }
        Some(stored)
    }

    fn damaged(&self, key: Option<u128>, _error: &PayloadError) {
        self.damages.fetch_add(1, Ordering::Relaxed);
        if let Some(key) = key {
            self.entries.lock().expect("not poisoned").remove(&key);
        }
    }
}

/// Meshes with everything that an asset can have, one of them so large that it is split.
fn meshes() -> Vec<MeshDesc> {
    let mut rich = bind(grid("/rich", 12), "/m", &[("/n", &[1, 5])]);
    let count = rich.points.len();
    let ramp = |width: f32| (0..count).map(|at| [at as f32, width, 0.25]).collect::<Vec<[f32; 3]>>();
    rich.normals = Some(primvar(Interpolation::Vertex, vec![[0.0_f32, 0.0, 1.0]; count]));
    rich.display_color = Some(primvar(Interpolation::Vertex, ramp(0.5)));
    rich.display_opacity = Some(primvar(Interpolation::Constant, vec![0.5_f32]));
    let named = |name: &str, primvar| NamedPrimvar { name: name.into(), primvar };
    rich.primvars = vec![named("tint", primvar(Interpolation::Vertex, ramp(2.0)))];
    rich.left_handed = true;
    let mut broken = grid("/broken", 3);
    broken.display_color = Some(primvar(Interpolation::Vertex, vec![[1.0_f32, 2.0, 3.0]]));
    vec![rich, grid("/large", 60), broken]
}

fn database(files: &Arc<Files>, limit: u64) -> SceneDb {
    let mut db = SceneDb::new();
    db.set_partition(PartitionOptions { chunk_bytes: 32 << 10 });
    db.mesh_memory().set_limit(limit);
    db.set_mesh_files(Some(files.clone()));
    for path in ["/m", "/n"] {
        db.upsert_material(color(path, 0.5));
    }
    meshes().into_iter().for_each(|mesh| db.upsert_mesh(mesh));
    db
}

/// All assets in full, by key.
pub(crate) fn content(snapshot: &Snapshot) -> Vec<(u128, String)> {
    let text = |mesh: &Arc<SceneMesh>| (mesh.key, format!("{:?}", *asset(mesh)));
    let mut all: Vec<_> = snapshot.meshes.iter().map(text).collect();
    all.sort();
    all
}

/// Entries of these meshes: one for each asset, and one that sums up the clusters of the large mesh.
fn entries(snapshot: &Snapshot) -> usize {
    snapshot.meshes.len() + 1
}

/// Without files.
fn plain() -> Arc<Snapshot> {
    let snapshot = committed(&mut database(&Arc::default(), u64::MAX));
    assert!(snapshot.meshes.len() > 5, "the large mesh is split: {}", snapshot.meshes.len());
    snapshot
}

fn host_bytes(snapshot: &Snapshot) -> u64 {
    snapshot.meshes.iter().map(|mesh| mesh.host_bytes() - size_of::<SceneMesh>() as u64).sum()
}

#[test]
fn mesh_summaries_match_their_assets() {
    let snapshot = plain();
    for mesh in &snapshot.meshes {
        assert_eq!(MeshSummary::of(&asset(mesh)), ***mesh);
    }
    let rich = snapshot.meshes.iter().find(|mesh| mesh.subsets > 0).expect("the one with subsets");
    assert!(rich.normals.is_some() && rich.colors.is_some() && rich.opacities.is_some() && rich.left_handed);
    let bytes: u64 = snapshot.meshes.iter().map(|mesh| asset(mesh).host_bytes()).sum();
    assert_eq!(host_bytes(&snapshot), bytes, "all are in memory");
}

#[test]
fn meshes_beyond_the_host_budget_reload_from_files_bit_for_bit() {
    let expected = content(&plain());
    let files = Arc::new(Files::default());
    let mut db = database(&files, 0);
    let snapshot = committed(&mut db);
    assert_eq!((host_bytes(&snapshot), db.mesh_memory().held()), (0, 0), "nothing is in memory");
    assert_eq!(content(&snapshot), expected);
    assert_eq!(files.added.load(Ordering::Relaxed), snapshot.meshes.len(), "each asset once");
    snapshot.validate().expect("sound");

    let all = host_bytes(&plain());
    let files = Arc::new(Files::default());
    let mut db = database(&files, all / 2);
    let snapshot = committed(&mut db);
    let held = host_bytes(&snapshot);
    assert!(held > 0 && held <= all / 2 && db.mesh_memory().held() == held, "{held} of {all}");
    assert_eq!(content(&snapshot), expected);
    drop((snapshot, db.commit()));
    ["/rich", "/large", "/broken"].into_iter().for_each(|path| db.remove(path));
    committed(&mut db);
    assert_eq!(db.mesh_memory().held(), 0, "given back");
}

#[test]
fn without_disk_space_meshes_stay_in_memory() {
    let files = Arc::new(Files { is_full: true, ..Files::default() });
    let mut db = database(&files, 0);
    let snapshot = committed(&mut db);
    assert_eq!(content(&snapshot), content(&plain()));
    assert_eq!(db.mesh_memory().held(), host_bytes(&snapshot), "counted all the same");
}

#[test]
fn stored_meshes_are_found_by_another_database() {
    let files = Arc::new(Files::lasting());
    let first = database(&files, u64::MAX).commit();
    let all = entries(&first.snapshot);
    assert_eq!((files.added.load(Ordering::Relaxed), files.found.load(Ordering::Relaxed)), (all, 0));
    let again = database(&files, u64::MAX).commit();
    assert_eq!((files.added.load(Ordering::Relaxed), files.found.load(Ordering::Relaxed)), (all, all));
    assert_eq!(host_bytes(&again.snapshot), 0, "read as it is needed");
    assert_eq!(content(&again.snapshot), content(&first.snapshot));
    assert_eq!((again.warnings, again.snapshot.dropped), (first.warnings, first.snapshot.dropped), "the same is said");
    assert!(first.snapshot.dropped.primvars > 0, "something is");

    // Another chunk size splits otherwise.
    let mut other = database(&files, u64::MAX);
    other.set_partition(PartitionOptions { chunk_bytes: 64 << 10 });
    other.commit();
    assert_eq!(files.found.load(Ordering::Relaxed), all, "nothing of that is found");
}

#[test]
fn a_mesh_of_which_a_cluster_is_missing_is_built_again() {
    let files = Arc::new(Files::lasting());
    let expected = content(&committed(&mut database(&files, u64::MAX)));
    let gone = {
        let mut entries = files.entries.lock().expect("not poisoned");
        // Clusters have no head.
        let cluster = entries.iter().find(|(_, (head, _))| head.is_empty()).map(|(key, _)| *key);
        entries.remove(&cluster.expect("one of a cluster"))
    };
    assert!(gone.is_some());
    assert_eq!(content(&committed(&mut database(&files, u64::MAX))), expected);
    assert_eq!(files.damages.load(Ordering::Relaxed), 0, "that is no damage");
    assert_eq!(files.entries.lock().expect("not poisoned").len(), expected.len() + 1, "written again");
}

#[test]
fn damaged_files_are_built_again() {
    let files = Arc::new(Files::default());
    let snapshot = committed(&mut database(&files, 0));
    files.is_damaged.store(true, Ordering::Relaxed);
    assert_eq!(content(&snapshot), content(&plain()));
    assert_eq!(files.damages.load(Ordering::Relaxed), snapshot.meshes.len(), "each was told of");
    assert_eq!(content(&snapshot), content(&plain()));
    assert_eq!(files.damages.load(Ordering::Relaxed), snapshot.meshes.len(), "and is in memory now");
}

#[test]
fn transient_read_failures_are_retried() {
    let files = Arc::new(Files::default());
    let snapshot = committed(&mut database(&files, 0));
    files.busy.store(2, Ordering::Relaxed);
    assert_eq!(content(&snapshot), content(&plain()));
    assert_eq!(files.damages.load(Ordering::Relaxed), 0, "nothing was given up");
    files.busy.store(5, Ordering::Relaxed);
    assert_eq!(content(&snapshot), content(&plain()), "built again");
    assert_eq!(files.damages.load(Ordering::Relaxed), 2, "four tries of the first mesh, one of the next");
}

#[test]
fn corrupt_stored_entries_are_rejected() {
    let files = Arc::new(Files::lasting());
    let expected = content(&committed(&mut database(&files, u64::MAX)));
    let entries = files.entries.lock().expect("not poisoned").clone();
    let mut random = 1_u64;
    for round in 0..400 {
        let mut spoilt = entries.clone();
        for (head, payloads) in spoilt.values_mut() {
            random = random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let at = usize::try_from(random >> 33).expect("small");
            match round % 4 {
                0 => head.truncate(at % (head.len() + 1)),
                1 => payloads.truncate(at % (payloads.len() + 1)),
                2 => payloads.iter_mut().take(1).for_each(|payload| payload.truncate(at % payload.len())),
                // Any byte: sizes that do not fit the payloads are refused. What still fits, a hash tells (of files).
                _ => {
                    let length = head.len().max(1);
                    head.iter_mut().skip(at % length).take(1).for_each(|byte| *byte = 0xFF);
                }
            }
        }
        *files.entries.lock().expect("not poisoned") = spoilt;
        let snapshot = database(&files, u64::MAX).commit().snapshot;
        for mesh in &snapshot.meshes {
            assert_eq!(asset(mesh).triangles.len() as u64, mesh.triangles, "round {round}");
        }
        if round % 4 != 3 {
            assert_eq!(content(&snapshot), expected, "round {round}");
        }
    }
}

#[test]
fn changed_build_bits_require_a_new_format_version() {
    // When this fails, meshes are built to other bits: raise `kept_mesh::VERSION`, then put the new number here.
    let text: String = content(&plain()).into_iter().map(|(key, text)| format!("{key} {text}")).collect();
    assert_eq!(xxhash_rust::xxh3::xxh3_64(text.as_bytes()), 15_193_013_840_246_037_363, "of version 6");
}
