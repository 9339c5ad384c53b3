#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Farm jobs whose processes are killed at random moments, against the bits of one process.

    $OOCPT_USD_PYTHON tests/schedulers/random_kills.py --scheduler openjd --runs 20 --seed 1

Runs what the book tells users to run, through real schedulers on this machine: `openjd` (PyPI `openjd-cli`), `slurm`
(Debian's `slurm-wlm` and `munge`, whose daemons this starts and stops, as root), `ray` (PyPI `ray`). OOCPT_OPENJD names
the command, OOCPT_RAY_PYTHON the Python that has it. Each run draws moments and victims from its seed: SIGKILL or
SIGTERM to a renderer, to the program of its task, or to what started that. A scheduler without retries is started
again. Prints a line for each run; fails if a picture, its error, or the sums of its film differ in a bit, or if no run
of a scheduler had a kill.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
FARM = REPOSITORY / "plugin/schedulers"
for folder in (REPOSITORY / "tests/hydra", REPOSITORY / "tests/scenes", FARM, pathlib.Path(__file__).parent):
    sys.path.insert(0, str(folder))

import exr  # noqa: E402  of the tests through Hydra
import film_sums  # noqa: E402
from slurm import Slurm  # noqa: E402

SCENE = REPOSITORY / "tests/scenes/small/nested.usda"
CAMERA = "/World/Camera"
# A command that has not ended by then hangs.
MOST_SECONDS = 3600
MOST_STARTS = 100


class Killer(threading.Thread):
    """Sends signals to processes of a run at random moments."""

    def __init__(self, folder: pathlib.Path, seed: int, kills: int, pause: float) -> None:
        super().__init__(daemon=True)
        self.folder, self.random, self.left, self.pause = folder, random.Random(seed), kills, pause
        self.sent: list[str] = []
        self.ended = threading.Event()

    def victims(self) -> list[tuple[int, str]]:
        """The programs of tasks, renderers, and what started a program of a task."""
        found = {}
        for entry in pathlib.Path("/proc").iterdir():
            words = command_of(entry.name) if entry.name.isdecimal() else []
            if not any(word.startswith((str(self.folder), f"--folder={self.folder}")) for word in words):
                continue
            if any(word.endswith("oocpt_farm.py") for word in words):
                found[int(entry.name)] = "task"
                above = parent_of(entry.name)
                if (starter := starter_kind(command_of(above))):
                    found[int(above)] = starter
            elif any(word.endswith(("usdrecord", "oocpt")) for word in words):
                found[int(entry.name)] = "renderer"
        return sorted(found.items())

    def run(self) -> None:
        while self.left and not self.ended.wait(self.random.expovariate(1 / self.pause)):
            if not (victims := self.victims()):
                continue
            number, kind = self.random.choice(victims)
            name = self.random.choice((signal.SIGKILL, signal.SIGTERM))
            try:
                os.kill(number, name)
            except ProcessLookupError:
                continue
            self.left -= 1
            self.sent.append(f"{kind} {name.name[3:]}")


def command_of(process: str) -> list[str]:
    try:
        return pathlib.Path(f"/proc/{process}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def parent_of(process: str) -> str:
    try:
        return pathlib.Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[1]
    except OSError:
        return "0"


def starter_kind(words: list[str]) -> str:
    """What started the program of a task, if that may die as a worker does."""
    line = " ".join(words)
    return next((kind for kind in ("ray::run_part", "openjd") if kind in line), "")


def openjd(run: pathlib.Path, options: argparse.Namespace) -> int:
    parameters = {
        "Scene": SCENE, "Camera": CAMERA, "Samples": options.samples, "Blocks": options.blocks, "Width": options.width,
        "Parts": run / "parts", "Pictures": run / "pictures", "Caches": run / "caches",
    }  # fmt: skip
    line = [os.environ.get("OOCPT_OPENJD", "openjd"), "run", FARM / "render.template.yaml", "--step", "Pictures"]
    line += ["--run-dependencies", *(word for name, value in parameters.items() for word in ("-p", f"{name}={value}"))]
    return again(line, run, {})


def ray(run: pathlib.Path, options: argparse.Namespace) -> int:
    line = [os.environ.get("OOCPT_RAY_PYTHON", sys.executable), FARM / "oocpt_ray.py", "--scene", SCENE]
    line += ["--folder", run / "parts", "--frame", 1, "--samples", options.samples, "--blocks", options.blocks]
    line += ["--camera", CAMERA, "--width", options.width, "--caches", run / "caches", "--retries", 100]
    # Ray gives its workers the least priority.
    variables = {"RAY_AUTH_MODE": "disabled", "RAY_worker_niceness": "0"}
    return again([*line, "--out", run / "pictures/frame.%04d.exr"], run, variables)


def again(line: list, run: pathlib.Path, variables: dict[str, str]) -> int:
    """Starts a command until it ends well; how often it was."""
    with (run / "log").open("ab") as log:
        for starts in range(1, MOST_STARTS):
            done = subprocess.run(
                list(map(str, line)), env=os.environ | variables, cwd=run, stdin=subprocess.DEVNULL, stdout=log,
                stderr=subprocess.STDOUT, timeout=MOST_SECONDS, check=False,
            )  # fmt: skip
            if done.returncode == 0:
                return starts
    raise RuntimeError(f"{line[0]} did not end well in {MOST_STARTS} runs: {run / 'log'}")


def slurm(run: pathlib.Path, options: argparse.Namespace) -> int:
    variables = {
        "SCENE": SCENE, "CAMERA": CAMERA, "FOLDER": run / "parts", "FRAME": 1, "SAMPLES": options.samples,
        "BLOCKS": options.blocks, "WIDTH": options.width, "CACHES": run / "caches",
        "OUT": run / "pictures/frame.%04d.exr",
    }  # fmt: skip
    variables = os.environ | options.slurm.variables() | {name: str(value) for name, value in variables.items()}
    subprocess.run(["sh", FARM / "slurm_array.sh"], env=variables, cwd=run, check=True, capture_output=True)
    end = time.monotonic() + MOST_SECONDS
    while options.slurm.jobs():
        if time.monotonic() > end:
            raise RuntimeError(f"Slurm has {options.slurm.jobs()} after {MOST_SECONDS} s")
        time.sleep(0.3)
    return 1


SCHEDULERS = {"openjd": openjd, "slurm": slurm, "ray": ray}


def merged_film(run: pathlib.Path) -> pathlib.Path:
    """The film of what is there."""
    films = sorted(run.glob("parts/frame.0001/*.film"))
    merged = run / "parts/frame.0001/merged.film"
    if merged not in films:
        merged = run / "merged.film"
        subprocess.run(["oocpt", "film", "merge", *films, "--out", merged], check=True, capture_output=True)
    return merged


def results(run: pathlib.Path) -> tuple[bytes, dict, bytes]:
    """The pixels of a picture, what it says of its error, and the sums of its film."""
    path = run / "pictures/frame.0001.exr"
    return exr.read(path).tobytes(), film_sums.errors(path), film_sums.sums(merged_film(run))


def one_process(folder: pathlib.Path, options: argparse.Namespace) -> tuple[bytes, dict, bytes]:
    """What all runs have to equal."""
    program = [sys.executable, FARM / "oocpt_farm.py"]
    common = ["--folder", folder / "parts", "--frame", 1, "--samples", options.samples]
    part = ["part", *common, "--scene", SCENE, "--camera", CAMERA, "--width", options.width, "--block", 1]
    for words in (part, ["picture", *common, "--out", folder / "pictures/frame.%04d.exr"]):
        subprocess.run(list(map(str, (*program, *words))), check=True, capture_output=True)
    return results(folder)


def run_once(number: int, name: str, folder: pathlib.Path, options: argparse.Namespace) -> tuple[bool, int]:
    """A run of a scheduler; whether its results are those of one process, and how many kills it had."""
    run = folder / f"{name}.{number}"
    run.mkdir()
    killer = Killer(run, options.seed * 1000 + number, options.kills, options.pause)
    killer.start()
    begin = time.monotonic()
    try:
        starts = SCHEDULERS[name](run, options)
    finally:
        killer.ended.set()
        killer.join()
    same = [one == other for one, other in zip(results(run), options.expected, strict=True)]
    parts = zip(("picture", "error", "film"), same, strict=True)
    told = " ".join(f"{what} {'same' if is_same else 'DIFFERS'}" for what, is_same in parts)
    told += f"; {time.monotonic() - begin:.0f} s, started {starts} times"
    print(f"{name} {number}: {told}; {', '.join(killer.sent) or 'no kill'}", flush=True)
    if all(same):
        shutil.rmtree(run)
    return all(same), len(killer.sent)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scheduler", action="append", choices=SCHEDULERS, required=True)
    parser.add_argument("--runs", type=int, default=1, help="of each scheduler")
    parser.add_argument("--first", type=int, default=0, help="number of the first run")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kills", type=int, default=4, help="of a run, at most")
    parser.add_argument("--pause", type=float, default=1.5, help="seconds between kills, on average")
    parser.add_argument("--samples", type=int, default=1024)
    parser.add_argument("--blocks", type=int, default=4)
    parser.add_argument("--width", type=int, default=64)
    options = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="oocpt-kills-"))
    os.environ |= {"OOCPT_MAX_BOUNCES": "2", "OOCPT_CHECKPOINT_INTERVAL": "0"}
    options.expected = one_process(folder / "whole", options)
    failed = 0
    for name in options.scheduler:
        options.slurm = Slurm(folder / "slurm") if name == "slurm" else None
        try:
            done = [run_once(options.first + run, name, folder, options) for run in range(options.runs)]
        finally:
            if options.slurm:
                options.slurm.stop()
        killed = sum(kills for _, kills in done)
        right = sum(is_right for is_right, _ in done)
        print(f"{name}: {right} of {len(done)} runs have the bits of one process, {killed} kills", flush=True)
        failed += right < len(done) or killed == 0
    if not failed:
        shutil.rmtree(folder)
    return min(failed, 1)


if __name__ == "__main__":
    sys.exit(main())
