// SPDX-License-Identifier: Apache-2.0
//! Streaming: submissions while chunks come and go, with the queues and the demand checked each time.

use super::handmade_scene::{CHUNKS, Random};
use super::pass_runner::{Images, Launch, PATHS, PIXELS, SEGMENT_SIZE, SEGMENTS, Tracer};
use oocpt_shader_abi as abi;
use oocpt_shader_abi::{Counters, GpuChunk, Push, PushFlags, SHADOW_BIT, Segment, UnitDemand, passes, sort_blocks};
use std::collections::HashMap;

/// What a run reports beside its images.
#[derive(Debug, Default)]
pub(super) struct Totals {
    pub(super) submissions: u32,
    pub(super) counters: Counters,
    pub(super) chunk_rays: Vec<u32>,
}

impl Tracer<'_> {
    /// The same images with at most `resident` chunks at a time, `rounds` rounds a submission; chunks come by demand
    /// and go at random.
    pub(super) fn stream(&mut self, resident: usize, rounds: u32, seed: u64) -> (Images, Totals) {
        self.clear(&["film", "chunk rays"]);
        let mut random = Random(seed);
        let mut totals = Totals::default();
        self.stream_paths(PIXELS, PushFlags::AOVS, (resident, rounds), &mut random, &mut totals);
        self.stream_paths(PATHS, PushFlags::empty(), (resident, rounds), &mut random, &mut totals);
        totals.chunk_rays = self.read("chunk rays");
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
        let mut demand = vec![0_u32; 2 * CHUNKS as usize];
        let mut flying: Vec<Option<u32>> = vec![None; SEGMENTS as usize]; // first path of each segment
        let (mut given, mut taken) = (0, 0);
        while taken < paths {
            totals.submissions += 1;
            assert!(totals.submissions < 5000, "the paths do not end: {:?}", self.read::<Counters>("counters"));
            here = choose(&here, &demand, resident, random);
            let present = |(i, chunk): (u32, &GpuChunk)| if here.contains(&i) { *chunk } else { GpuChunk::default() };
            let table: Vec<GpuChunk> = (0..).zip(&self.scene.chunks).map(present).collect();
            self.set_chunks(&table);
            self.sort(flags, &table);
            let mut fresh = Vec::new();
            for (segment, first) in (0..).zip(&mut flying) {
                if first.is_none() && given < paths {
                    *first = Some(given);
                    fresh.push((segment, given));
                    given = paths.min(given + SEGMENT_SIZE);
                }
            }
            self.trace(&fresh, paths, flags, rounds);
            demand = self.demand();
            let segments: Vec<Segment> = self.read("segments");
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

    fn segment_push(&self, segment: u32, first: u32, count: u32, flags: PushFlags) -> Push {
        let q = Push::wave(self.address("frame"), u64::from(first), count, PIXELS);
        q.with(self.round, segment * SEGMENT_SIZE).flagged(flags)
    }

    /// Sends deferred rays on, and checks where they went.
    fn sort(&mut self, flags: PushFlags, table: &[GpuChunk]) {
        let q = Push::wave(self.address("frame"), 0, 0, PIXELS).with(self.round, 0).flagged(flags);
        let before = self.waiting();
        let old: Counters = self.read("counters")[0];
        self.clear(&["counts"]);
        let mut commands = self.gpu.commands("sort").expect("a list");
        let c = &mut commands;
        self.run(c, &passes::SORT_DEFERRED_COUNT, q, Launch::Indirect(Counters::DEFERRED_ARGS));
        self.run(
            c,
            &passes::SORT_DEFERRED_SCAN,
            q.with(q.round, abi::SCAN_BLOCKS),
            Launch::Groups(sort_blocks(CHUNKS)),
        );
        self.run(c, &passes::SORT_DEFERRED_SCAN, q.with(q.round, abi::SCAN_SUMS), Launch::Groups(1));
        self.run(c, &passes::SORT_DEFERRED_SCATTER, q, Launch::Indirect(Counters::DEFERRED_ARGS));
        commands.submit().expect("submitted");
        let new: Counters = self.read("counters")[0];
        let parity = (self.round & 1) as usize;
        let ready = |chunks: &[u32], shadow: bool| {
            let asked = if shadow { chunks } else { &chunks[..1] };
            asked.iter().copied().find(|chunk| table[*chunk as usize].nodes != 0)
        };
        let (mut stay, mut go) = (Vec::new(), [Vec::new(), Vec::new()]);
        for (entry, chunks) in &before {
            let shadow = entry & SHADOW_BIT != 0;
            match ready(chunks, shadow) {
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

    /// The deferred rays and the chunks on their lists.
    fn waiting(&self) -> Vec<(u32, Vec<u32>)> {
        let counters: Counters = self.read("counters")[0];
        let list = counters.deferred_parity as usize;
        let entries: Vec<u32> = self.read(["deferred 0", "deferred 1"][list]);
        let flags = [
            self.read::<[u32; 12]>("rays").iter().map(|ray| ray[11]).collect::<Vec<u32>>(),
            self.read::<[u32; 16]>("shadow_rays").iter().map(|ray| ray[11]).collect(),
        ];
        let pending: [Vec<abi::Pending>; 2] = [self.read("pending"), self.read("shadow pending")];
        let lists = |entry: &u32| {
            let (kind, path) = (usize::from(entry & SHADOW_BIT != 0), (entry & !SHADOW_BIT) as usize);
            let count = (flags[kind][path] >> 4 & 7) as usize;
            let keys = &pending[kind][path];
            assert!(count >= 1, "a ray waits for something");
            assert!(keys.entry[..count].is_sorted(), "nearest first: {keys:?}");
            let instances = &keys.chunk_instance[..count];
            (*entry, instances.iter().map(|i| self.scene.chunk_of[*i as usize]).collect())
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
        let q = Push::wave(self.address("frame"), 0, 0, PIXELS).flagged(flags);
        for _ in 0..rounds {
            self.round(&mut commands, q.with(self.round, 0));
            self.round += 1;
        }
        self.run(&mut commands, &passes::PREPARE_DISPATCH, q.with(self.round, abi::PREPARE_DEMAND), Launch::Threads(1));
        commands.fill(&self.buffers["demand counts"], 0, 8, 0);
        self.run(&mut commands, &passes::COUNT_DEMAND, q, Launch::Indirect(Counters::DEFERRED_ARGS));
        self.run(&mut commands, &passes::LIST_DEMAND, q, Launch::Groups(2));
        self.run(&mut commands, &passes::RETIRE_PATHS, q, Launch::Indirect(Counters::RETIRE_ARGS));
        commands.submit().expect("submitted");
    }

    /// The demand that the device has listed, once checked: `waiting`, then `next` of each chunk.
    fn demand(&self) -> Vec<u32> {
        let mut expected = vec![0; 2 * CHUNKS as usize];
        for (_, chunks) in self.waiting() {
            for (i, chunk) in chunks.iter().enumerate() {
                expected[*chunk as usize + if i == 0 { 0 } else { CHUNKS as usize }] += 1;
            }
        }
        let [_, listed]: [u32; 2] = self.read("demand counts")[0];
        let of = |unit: u32| [expected[unit as usize], expected[(unit + CHUNKS) as usize]];
        let asked = (0..CHUNKS).filter(|unit| of(*unit) != [0, 0]).count();
        assert_eq!(listed as usize, asked, "every unit that is asked for is counted once");
        let mut demand = vec![0; 2 * CHUNKS as usize];
        let list: Vec<UnitDemand> = self.read("demand list");
        for UnitDemand { unit, waiting, next } in list.into_iter().take(asked.min(self.demand_capacities[1] as usize)) {
            assert_eq!([waiting, next], of(unit), "the list has what the rays' lists say of {unit}");
            let [first, later] = [unit, unit + CHUNKS].map(|at| at as usize);
            assert_eq!([demand[first], demand[later]], [0, 0], "{unit} is in it once");
            (demand[first], demand[later]) = (waiting, next);
        }
        assert!(self.read::<u32>("demand").iter().all(|rays| *rays == 0), "nothing is left for the next step");
        demand
    }
}

/// The next chunks: the one most waited for, some of those before, and some at random.
fn choose(here: &[u32], demand: &[u32], resident: usize, random: &mut Random) -> Vec<u32> {
    let most = (0..CHUNKS).max_by_key(|chunk| demand[*chunk as usize]);
    let mut next: Vec<u32> = most.into_iter().collect();
    for chunk in here {
        if random.word().is_multiple_of(3) && !next.contains(chunk) {
            next.push(*chunk);
        }
    }
    while next.len() < resident {
        let chunk = random.word() % CHUNKS;
        if !next.contains(&chunk) {
            next.push(chunk);
        }
    }
    next.truncate(resident);
    next
}
