#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How long a frame takes on many workers: a discrete simulation of its blocks, with deaths and stragglers.

    oocpt_scaling.py --start 6 --sample 0.5 --samples 4096 --part 2 --merge 0.2 --workers 1,16,256,4096

Times are in seconds: of a task's start (process, scene, commit with a warm cache), of a sample of all pixels, of
writing a part, of the picture of no part and for each more. Tells for each number of workers the best number of blocks,
the seconds, and the efficiency, which is the time that samples alone take over the time that all workers take.

- A worker takes the next block when it is free. The time of a block is `(start + samples * sample + part) * slowness`.
- Workers have a slowness that is drawn once: `exp(spread * n)`, n normal, and of `slow` of them `slowest` times that.
- A worker dies at random, `deaths` times an hour of its running; its block begins anew, first of those that wait, and
  it is back after `back` seconds, with a cold cache: `cold` seconds more for its first task.
- Parts are merged one after the other: at the end, for the picture, or with `--as-they-come` meanwhile, as Ray's driver
  does.
- What is shared (folder, licence server, network) is as fast for 10 000 workers as for one.
"""

from __future__ import annotations

import argparse
import heapq
import math
import random
import sys
from dataclasses import dataclass


@dataclass(frozen=True)
class FarmCosts:
    """What a frame and its workers cost, in seconds but for `deaths` (an hour of a worker) and shares of workers."""

    start: float
    sample: float
    part: float = 0.0
    picture: float = 0.0
    merge: float = 0.0
    cold: float = 0.0
    deaths: float = 0.0
    back: float = 60.0
    spread: float = 0.0
    slow: float = 0.0
    slowest: float = 4.0
    as_they_come: bool = False


@dataclass(frozen=True)
class FarmRun:
    """What came of a frame: its seconds with the picture, how many deaths it had, and the seconds of all workers."""

    seconds: float
    deaths: int
    work: float


def slowness(costs: FarmCosts, chance: random.Random) -> float:
    """How many times as long a worker takes."""
    factor = math.exp(costs.spread * chance.gauss(0.0, 1.0)) if costs.spread else 1.0
    return factor * costs.slowest if costs.slow and chance.random() < costs.slow else factor


def simulate(costs: FarmCosts, samples: int, blocks: int, workers: int, seed: int = 1) -> FarmRun:
    """A frame from the moment that all workers are free."""
    chance = random.Random(seed)
    waiting = [samples * (block + 1) // blocks - samples * block // blocks for block in range(blocks)][::-1]
    speeds = [slowness(costs, chance) for _ in range(min(workers, blocks))]
    # Of each worker: when it is free, its number, and whether its caches are warm.
    free = [(0.0, worker, costs.cold == 0.0) for worker in range(len(speeds))]
    running: list[tuple[float, int, int, bool]] = []
    last, merged, deaths, work = 0.0, 0.0, 0, 0.0
    while waiting or running:
        if waiting and free and (not running or free[0][0] <= running[0][0]):
            now, worker, is_warm = heapq.heappop(free)
            block = waiting.pop()
            cold = 0.0 if is_warm else costs.cold
            time = (costs.start + cold + block * costs.sample + costs.part) * speeds[worker]
            dies = chance.expovariate(costs.deaths / 3600.0) if costs.deaths else math.inf
            work += min(time, dies)
            heapq.heappush(running, (now + min(time, dies), worker, block if dies < time else -1, is_warm))
            continue
        now, worker, lost, _ = heapq.heappop(running)
        if lost < 0:
            last, merged = max(last, now), max(merged, now) + costs.merge
            heapq.heappush(free, (now, worker, True))
        else:
            deaths += 1
            waiting.append(lost)
            heapq.heappush(free, (now + costs.back, worker, costs.cold == 0.0))
    end = merged if costs.as_they_come else last + costs.merge * blocks
    return FarmRun(end + costs.picture, deaths, work)


def mean(costs: FarmCosts, samples: int, blocks: int, workers: int, seeds: int) -> tuple[float, float]:
    """Seconds and deaths of a frame, means over seeds."""
    runs = [simulate(costs, samples, blocks, workers, seed) for seed in range(seeds)]
    return sum(run.seconds for run in runs) / seeds, sum(run.deaths for run in runs) / seeds


def best(costs: FarmCosts, samples: int, workers: int, seeds: int) -> tuple[int, float, float]:
    """The number of blocks that takes the shortest time, with its seconds and deaths: a power of two, since parts that
    begin and end at powers of two are smallest, or one block for each worker."""
    counts = sorted({min(workers, samples)} | {1 << power for power in range(18) if 1 << power <= samples})
    counts = [blocks for blocks in counts if blocks <= 4 * workers]
    tried = ((*mean(costs, samples, blocks, workers, seeds), blocks) for blocks in counts)
    seconds, deaths, blocks = min(tried, key=lambda one: (one[0], one[2]))
    return blocks, seconds, deaths


def efficiency(costs: FarmCosts, samples: int, workers: int, seconds: float) -> float:
    return samples * costs.sample / (workers * seconds)


def parser() -> argparse.ArgumentParser:
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    for name, value in FarmCosts.__dataclass_fields__.items():
        if name == "as_they_come":
            options.add_argument("--as-they-come", action="store_true")
            continue
        required = name in ("start", "sample")
        options.add_argument(f"--{name}", type=float, required=required, default=None if required else value.default)
    options.add_argument("--samples", type=int, default=1024)
    options.add_argument("--blocks", type=int, default=0, help="0 looks for the best number")
    options.add_argument("--workers", default="1,2,4,16,64,256,1024,4096,10000")
    options.add_argument("--seeds", type=int, default=5)
    return options


def main() -> int:
    given = vars(parser().parse_args())
    samples, blocks, seeds = (given.pop(name) for name in ("samples", "blocks", "seeds"))
    counts = [int(word) for word in given.pop("workers").split(",")]
    costs = FarmCosts(**given)
    print(f"{'workers':>8} {'blocks':>8} {'seconds':>10} {'efficiency':>10} {'deaths':>8}")
    for workers in counts:
        if blocks:
            chosen, (seconds, deaths) = blocks, mean(costs, samples, blocks, workers, seeds)
        else:
            chosen, seconds, deaths = best(costs, samples, workers, seeds)
        share = efficiency(costs, samples, workers, seconds)
        print(f"{workers:8} {chosen:8} {seconds:10.1f} {share:10.2f} {deaths:8.1f}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
