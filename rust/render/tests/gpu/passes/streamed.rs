// SPDX-License-Identifier: Apache-2.0
//! Streaming: submissions while chunks and meshes come and go, with the queues and the demand checked each time.

use super::handmade_scene::{CHUNKS, MESHES, Random, UNITS};
use super::pass_runner::{Images, Launch, PATHS, PIXELS, SEGMENT_SIZE, SEGMENTS, Tracer};
use bytemuck::Zeroable;
use oocpt_abi as abi;
use oocpt_abi::{
    GpuChunk, GpuMesh, NO_MESH, PathSegment, PushConstants, PushFlags, SHADOW_BIT, UnitDemand, WavefrontCounters,
    sort_blocks,
};
use oocpt_shaders::passes;
use std::collections::HashMap;

/// What a run reports beside its images.
#[derive(Debug, Default)]
pub(super) struct Totals {
    pub(super) submissions: u32,
    pub(super) counters: WavefrontCounters,
    pub(super) unit_rays: Vec<u32>,
}

/// An item of a ray's list: its chunk, and its mesh unless all of the chunk is meant.
type Item = (u32, Option<u32>);

/// A deferred ray and its items.
type Deferred = (u32, Vec<Item>);

impl Tracer<'_> {
    /// The same images with at most `resident` chunks at a time and a few meshes, `rounds` rounds a submission; units
    /// come by demand and go at random.
    pub(super) fn stream(&mut self, resident: usize, rounds: u32, seed: u64) -> (Images, Totals) {
        self.clear(&["film", "unit rays"]);
        let mut random = Random(seed);
        let mut totals = Totals::default();
        self.stream_paths(PIXELS, PushFlags::AOVS, (resident, rounds), &mut random, &mut totals);
        self.stream_paths(PATHS, PushFlags::empty(), (resident, rounds), &mut random, &mut totals);
        totals.unit_rays = self.read("unit rays");
        (self.images(), totals)
    }

    fn stream_paths(
        &mut self,
        paths: u32,
        flags: PushFlags,
        (resident, rounds): (usize, u32),
        random: &mut Random,
        totals: &mut Totals,
    ) {
        self.clear(&["counters", "segments", "demand"]);
        self.round = 0;
        let mut here: Vec<u32> = Vec::new();
        let mut demand = Vec::new();
        let mut flying: Vec<Option<u32>> = vec![None; SEGMENTS as usize]; // first path of each segment
        let (mut given, mut taken) = (0, 0);
        while taken < paths {
            totals.submissions += 1;
            assert!(
                totals.submissions < 20_000,
                "the paths do not end: {:?}",
                self.read::<WavefrontCounters>("counters")
            );
            here = choose(&here, &demand, resident, random);
            self.show(&here);
            self.sort(flags, &here);
            let mut fresh = Vec::new();
            for (segment, first) in (0..).zip(&mut flying) {
                if first.is_none() && given < paths {
                    *first = Some(given);
                    fresh.push((segment, given));
                    given = paths.min(given + SEGMENT_SIZE);
                }
            }
            self.trace(&fresh, paths, flags, rounds);
            demand = self.demand(&here);
            let segments: Vec<PathSegment> = self.read("segments");
            while let Some(s) = flying.iter().position(|first| *first == Some(taken)) {
                if segments[s].alive > 0 {
                    break;
                }
                let push = self.segment_push(u32::try_from(s).expect("few"), taken, segments[s].count, flags);
                if flags.is_empty() {
                    let mut commands = self.gpu.commands("accumulate").expect("a list");
                    self.run(&mut commands, &passes::ACCUMULATE, push, Launch::Threads(SEGMENT_SIZE.min(PIXELS)));
                    commands.submit().expect("submitted");
                }
                taken += segments[s].count;
                flying[s] = None;
            }
        }
        totals.counters = self.read("counters")[0];
    }

    /// Fills the tables with these units.
    fn show(&self, here: &[u32]) {
        let chunk = |(i, chunk): (u32, &GpuChunk)| if here.contains(&i) { *chunk } else { GpuChunk::default() };
        let mesh = |(i, mesh): (u32, &GpuMesh)| if here.contains(&i) { *mesh } else { GpuMesh::zeroed() };
        self.set_chunks(&(0..).zip(&self.scene.chunks).map(chunk).collect::<Vec<_>>());
        self.set_meshes(&(CHUNKS..).zip(&self.scene.meshes).map(mesh).collect::<Vec<_>>());
    }

    fn segment_push(&self, segment: u32, first: u32, count: u32, flags: PushFlags) -> PushConstants {
        let q = PushConstants::wave(self.address("frame"), u64::from(first), count, PIXELS);
        q.with(self.round, segment * SEGMENT_SIZE).flagged(flags)
    }

    /// Sends deferred rays on, and checks where they went.
    fn sort(&mut self, flags: PushFlags, here: &[u32]) {
        let q = PushConstants::wave(self.address("frame"), 0, 0, PIXELS).with(self.round, 0).flagged(flags);
        let before = self.waiting();
        let old: WavefrontCounters = self.read("counters")[0];
        self.clear(&["counts"]);
        let mut commands = self.gpu.commands("sort").expect("a list");
        let c = &mut commands;
        self.run(c, &passes::SORT_DEFERRED_COUNT, q, Launch::Indirect(WavefrontCounters::DEFERRED_ARGS));
        self.run(
            c,
            &passes::SORT_DEFERRED_SCAN,
            q.with(q.round, abi::SCAN_BLOCKS),
            Launch::Groups(sort_blocks(CHUNKS)),
        );
        self.run(c, &passes::SORT_DEFERRED_SCAN, q.with(q.round, abi::SCAN_SUMS), Launch::Groups(1));
        self.run(c, &passes::SORT_DEFERRED_SCATTER, q, Launch::Indirect(WavefrontCounters::DEFERRED_ARGS));
        commands.submit().expect("submitted");
        let new: WavefrontCounters = self.read("counters")[0];
        let parity = (self.round & 1) as usize;
        let ready = |items: &[Item], shadow: bool| {
            let asked = if shadow { items } else { &items[..1] };
            let is_there =
                |(chunk, mesh): &&Item| here.contains(chunk) && mesh.is_none_or(|mesh| here.contains(&(CHUNKS + mesh)));
            asked.iter().find(is_there).map(|(chunk, _)| *chunk)
        };
        let (mut stay, mut go) = (Vec::new(), [Vec::new(), Vec::new()]);
        for (entry, items) in &before {
            let shadow = entry & SHADOW_BIT != 0;
            match ready(items, shadow) {
                Some(chunk) => go[usize::from(shadow)].push((chunk, entry & !SHADOW_BIT)),
                None => stay.push(*entry),
            }
        }
        let queues: [Vec<u32>; 2] = [self.read(["queue 0", "queue 1"][parity]), self.read("shadow queue")];
        let ranges = [(old.ray_count[parity], new.ray_count[parity]), (old.shadow_count, new.shadow_count)];
        for kind in 0..2 {
            let queue = &queues[kind][ranges[kind].0 as usize..ranges[kind].1 as usize];
            let chunk_of: HashMap<u32, u32> = go[kind].iter().map(|(chunk, path)| (*path, *chunk)).collect();
            let mut sent: Vec<(u32, u32)> = queue.iter().map(|path| (chunk_of[path], *path)).collect();
            assert!(sent.is_sorted_by_key(|(chunk, _)| *chunk), "rays of a chunk are side by side: {sent:?}");
            sent.sort_unstable();
            go[kind].sort_unstable();
            assert_eq!(sent, go[kind], "the rays that may go on do, once each");
        }
        let mut left: Vec<u32> = self.waiting().into_iter().map(|(entry, _)| entry).collect();
        left.sort_unstable();
        stay.sort_unstable();
        assert_eq!(left, stay, "the others wait on");
    }

    /// The deferred rays and their lists.
    fn waiting(&self) -> Vec<Deferred> {
        let counters: WavefrontCounters = self.read("counters")[0];
        let list = counters.deferred_parity as usize;
        let entries: Vec<u32> = self.read(["deferred 0", "deferred 1"][list]);
        let flags = [
            self.read::<[u32; 12]>("rays").iter().map(|ray| ray[11]).collect::<Vec<u32>>(),
            self.read::<[u32; 16]>("shadow_rays").iter().map(|ray| ray[11]).collect(),
        ];
        let pending: [Vec<abi::PendingItems>; 2] = [self.read("pending"), self.read("shadow pending")];
        let lists = |entry: &u32| {
            let (kind, path) = (usize::from(entry & SHADOW_BIT != 0), (entry & !SHADOW_BIT) as usize);
            let count = (flags[kind][path] >> 4 & 7) as usize;
            let keys = &pending[kind][path];
            assert!(count >= 1, "a ray waits for something");
            let key = |i: usize| (keys.entry[i], keys.chunk_instance[i], keys.record_entry[i], keys.mesh[i]);
            assert!((1..count).all(|i| key(i - 1) < key(i)), "in order, each once: {keys:?}");
            let mesh = |i: usize| (keys.mesh[i] != NO_MESH).then_some(keys.mesh[i]);
            let item = |i: usize| (self.scene.chunk_of[keys.chunk_instance[i] as usize], mesh(i));
            (*entry, (0..count).map(item).collect())
        };
        entries[..counters.deferred_count[list] as usize].iter().map(lists).collect()
    }

    fn trace(&mut self, fresh: &[(u32, u32)], paths: u32, flags: PushFlags, rounds: u32) {
        let mut commands = self.gpu.commands("trace").expect("a list");
        let generate = if flags.is_empty() { &passes::GENERATE_CAMERA_RAYS } else { &passes::GENERATE_AOV_RAYS };
        for (segment, first) in fresh {
            let count = SEGMENT_SIZE.min(paths - first);
            let push = self.segment_push(*segment, *first, count, flags);
            let push = push.into_slots(*segment, u64::from(*first), SEGMENTS * SEGMENT_SIZE);
            self.run(&mut commands, generate, push, Launch::Threads(count));
        }
        let q = PushConstants::wave(self.address("frame"), 0, 0, PIXELS).flagged(flags);
        for _ in 0..rounds {
            self.round(&mut commands, q.with(self.round, 0));
            self.round += 1;
        }
        self.run(&mut commands, &passes::PREPARE_DISPATCH, q.with(self.round, abi::PREPARE_DEMAND), Launch::Threads(1));
        commands.fill(&self.buffers["demand counts"], 0, 8, 0);
        self.run(&mut commands, &passes::COUNT_DEMAND, q, Launch::Indirect(WavefrontCounters::DEFERRED_ARGS));
        self.run(&mut commands, &passes::LIST_DEMAND, q, Launch::Groups(2));
        self.run(&mut commands, &passes::RETIRE_PATHS, q, Launch::Indirect(WavefrontCounters::RETIRE_ARGS));
        commands.submit().expect("submitted");
    }

    /// The demand that the device has listed, once checked; by unit, nothing where none is listed.
    fn demand(&self, here: &[u32]) -> Vec<UnitDemand> {
        let expected = expected_demand(&self.waiting(), here);
        let [_, listed]: [u32; 2] = self.read("demand counts")[0];
        let asked = expected.iter().filter(|of| (of.waiting, of.next) != (0, 0)).count();
        assert_eq!(listed as usize, asked, "every unit that is asked for is counted once");
        let mut demand = vec![UnitDemand::default(); UNITS as usize];
        let list: Vec<UnitDemand> = self.read("demand list");
        for of in list.into_iter().take(asked.min(self.demand_capacities[1] as usize)) {
            let known = expected[of.unit as usize];
            assert_eq!((of.waiting, of.next), (known.waiting, known.next), "what the rays' lists say of {}", of.unit);
            assert_eq!(of.partner == 0, known.partner == 0, "{of:?}: a partner where some ray has one");
            let seen = std::mem::replace(&mut demand[of.unit as usize], of);
            assert_eq!(seen, UnitDemand::default(), "{} is in it once", of.unit);
        }
        assert!(self.read::<u32>("demand").iter().all(|rays| *rays == 0), "nothing is left for the next step");
        demand
    }
}

/// The demand of these rays, with one of several partners.
fn expected_demand(waiting: &[Deferred], here: &[u32]) -> Vec<UnitDemand> {
    let mut expected: Vec<_> = (0..UNITS).map(|unit| UnitDemand { unit, ..UnitDemand::default() }).collect();
    for (_, items) in waiting {
        for (i, &(chunk, mesh)) in items.iter().enumerate() {
            let mesh = mesh.map(|mesh| CHUNKS + mesh);
            let unit = mesh.filter(|_| here.contains(&chunk)).unwrap_or(chunk);
            if i > 0 {
                expected[unit as usize].next += 1;
                continue;
            }
            expected[chunk as usize].waiting += 1;
            if let Some(mesh) = mesh {
                expected[mesh as usize].waiting += 1;
                expected[chunk as usize].partner = mesh + 1;
                expected[mesh as usize].partner = chunk + 1;
            }
        }
    }
    expected
}

/// The next units: the one most waited for with its partner, some of those before, and some at random.
fn choose(here: &[u32], demand: &[UnitDemand], resident: usize, random: &mut Random) -> Vec<u32> {
    let mut next: Vec<u32> = Vec::new();
    if let Some(most) = demand.iter().max_by_key(|of| of.waiting).filter(|of| of.waiting > 0) {
        next.extend([Some(most.unit), most.partner.checked_sub(1)].into_iter().flatten());
    }
    next.extend(here.iter().filter(|_| random.word().is_multiple_of(3)));
    next.extend((0..8 * UNITS).map(|_| random.word() % UNITS));
    let (mut chunks, mut meshes) = (resident, (1 + resident / 4).min(MESHES as usize));
    let mut seen = Vec::new();
    next.retain(|unit| {
        let left = if *unit < CHUNKS { &mut chunks } else { &mut meshes };
        let fits = *left > 0 && !seen.contains(unit);
        *left -= usize::from(fits);
        seen.push(*unit);
        fits
    });
    next
}
