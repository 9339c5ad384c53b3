#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures what a frame costs a farm, and the frame itself on few workers, beside what `oocpt_scaling.py` says of it.

    tests/schedulers/measure_scaling.py --scene scene.usda --camera /World/Camera --samples 256 --blocks 8
        --workers 1,2,4

Workers are processes of this machine that take blocks as they get free. With `--clock cpu` times are processor seconds
of a task and all that it started, which other programs do not lengthen: a worker then stands for one core, and more
workers than cores share them. With `--clock wall` they are seconds of an idle machine. Each cost is the least of
`--runs` runs. Needs `oocpt` and `usdrecord` in the path, and nothing but Python.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import pathlib
import queue
import subprocess
import sys
import tempfile
import threading
import time

FARM = pathlib.Path(__file__).resolve().parents[2] / "plugin/schedulers"
sys.path.insert(0, str(FARM))
import oocpt_scaling  # noqa: E402


class Frame:
    """Tasks of a frame."""

    def __init__(self, options: argparse.Namespace, folder: pathlib.Path) -> None:
        self.options, self.folder, self.caches = options, folder, folder / "caches"

    def seconds(self, words: list) -> float:
        """What a command takes on the clock."""
        begin = time.monotonic()
        child = subprocess.Popen(list(map(str, words)), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                 stderr=subprocess.DEVNULL, env=os.environ | {"LP_NUM_THREADS": "0"})  # fmt: skip
        _, status, usage = os.wait4(child.pid, 0)
        child.returncode = os.waitstatus_to_exitcode(status)
        if child.returncode:
            raise RuntimeError(f"exit status {child.returncode}: {words}")
        return usage.ru_utime + usage.ru_stime if self.options.clock == "cpu" else time.monotonic() - begin

    def common(self, name: str, samples: int, blocks: int) -> list:
        return ["--folder", self.folder / name, "--frame", 1, "--samples", samples, "--blocks", blocks]

    def part(self, name: str, samples: int, blocks: int, block: int) -> float:
        options = self.options
        view = ["--scene", options.scene, "--camera", options.camera, "--width", options.width, "--caches", self.caches]
        program = [sys.executable, FARM / "oocpt_farm.py", "part", *self.common(name, samples, blocks)]
        return self.seconds([*program, *view, "--block", block, "--", "--disableCameraLight"])

    def picture(self, name: str, samples: int, blocks: int) -> float:
        program = [sys.executable, FARM / "oocpt_farm.py", "picture"]
        out = ["--out", self.folder / f"{name}.exr"]
        return self.seconds([*program, *self.common(name, samples, blocks), *out])

    def costs(self) -> oocpt_scaling.FarmCosts:
        """Start and sample from tasks of few and many samples, the picture from few and many parts."""
        few, many, runs = self.options.samples // 16, self.options.samples, range(self.options.runs)
        cold = self.part("cold", few, 1, 1)
        short = min(self.part(f"few{run}", few, 1, 1) for run in runs)
        long = min(self.part(f"many{run}", many, 1, 1) for run in runs)
        sample = max((long - short) / (many - few), 1e-9)
        for block in range(1, 9):
            self.part("parts", 16, 8, block)
        one = min(self.picture("few0", few, 1) for _ in runs)
        eight = min(self.picture("parts", 16, 8) for _ in runs)
        merge = max((eight - one) / 7, 0.0)
        start = short - few * sample
        return oocpt_scaling.FarmCosts(
            start=start, sample=sample, picture=one - merge, merge=merge, cold=max(cold - short, 0.0)
        )

    def measured(self, workers: int) -> float:
        """The frame on so many workers: until the last of them is done, and the picture."""
        name, blocks, options = f"on{workers}", queue.SimpleQueue(), self.options
        for block in range(1, options.blocks + 1):
            blocks.put(block)
        taken, begin = [0.0] * workers, time.monotonic()

        def work(worker: int) -> None:
            try:
                while True:
                    taken[worker] += self.part(name, options.samples, options.blocks, blocks.get_nowait())
            except queue.Empty:
                pass

        threads = [threading.Thread(target=work, args=(worker,)) for worker in range(workers)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        rendered = max(taken) * self.shared(workers) if options.clock == "cpu" else time.monotonic() - begin
        return rendered + self.picture(name, options.samples, options.blocks)

    def shared(self, workers: int) -> float:
        """How many times as long a worker takes that shares its core."""
        return max(1.0, workers / self.options.cores)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scene", required=True, type=lambda text: pathlib.Path(text).absolute())
    parser.add_argument("--camera", default="")
    parser.add_argument("--width", type=int, default=160)
    parser.add_argument("--samples", type=int, default=256)
    parser.add_argument("--blocks", type=int, default=8)
    parser.add_argument("--workers", default="1,2,4")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--clock", choices=("cpu", "wall"), default="cpu")
    parser.add_argument("--cores", type=int, default=os.cpu_count(), help="or devices, that workers share")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="oocpt-scaling-") as folder:
        frame = Frame(options, pathlib.Path(folder))
        costs = frame.costs()
        print(json.dumps({name: round(value, 6) for name, value in dataclasses.asdict(costs).items()}), flush=True)
        warm = dataclasses.replace(costs, cold=0.0)
        for workers in map(int, options.workers.split(",")):
            shared = frame.shared(workers)
            slower = dataclasses.replace(warm, start=warm.start * shared, sample=warm.sample * shared)
            told = oocpt_scaling.simulate(slower, options.samples, options.blocks, workers).seconds
            print(f"{workers} workers: {frame.measured(workers):.2f} s, predicted {told:.2f} s", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
