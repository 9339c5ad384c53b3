#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whole sets through a real usdrecord with ever less device memory in all: what `cargo xtask bench sets` runs.

    measure_sets.py [--sets reef,city,interior,grove] [--scene FILE[,camera=PATH][,frame=TIME]] [--seed 1] [--size 0.05]
        [--percents 100,75,50,27,14] [--samples 16] [--width 320] [--limit 600] [--json FILE] [--usdrecord CMD]

Each scene is rendered without a budget first; what that took of device memory in all, by the renderer's own count, is
100 %. Each budget is rendered with empty caches of geometry and textures, then with those filled. A render of one
sample comes before each budget, so that drivers that keep compiled passes have them (Mesa's software driver translates
them in every process). Every render is a process of its own; one that gives no picture in `--limit` seconds is ended,
and its row says so. The picture of each row is compared with that without a budget, bit for bit. The table has the
worst row first, by seconds, or with `--by cpu` by processor seconds: the ones to read where cores are shared and the
device is a software one.

Needs Python alone; `--python` names one with pxr and numpy that makes the sets. Odd seeds are held out: see
tests/scenes/sets. Exits with 1 if a row has no picture, another picture, or more memory than its budget.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import pathlib
import platform
import shlex
import subprocess
import sys
from dataclasses import asdict, dataclass, field

HERE = pathlib.Path(__file__).resolve().parent
SCENES = HERE.parent / "scenes"
sys.path.insert(0, str(HERE))

from usdrecord_runs import MIB, Host, Run, Scene, record, scene_of  # noqa: E402

SETS = ("reef", "city", "interior", "grove")
FRAMES = {"grove": "12"}
CACHES = ("cold", "warm")


@dataclass
class Row:
    """One render: `percent` is None without a budget. Ratios are to the render without a budget and the same caches."""

    scene: str
    percent: float | None
    budget_mib: int
    cache: str
    status: str
    same: bool | None
    secs: float
    ratio: float | None
    cpu_secs: float
    cpu_ratio: float | None
    tracing_secs: float | None
    tracing_ratio: float | None
    rays: int | None
    rays_per_sec: float | None
    loads: int | None
    reloads: int | None
    paged_bytes: int | None
    device_peak: int | None
    driver_peak: int | None
    host_peak: int
    in_core: bool | None
    messages: list[str] = field(default_factory=list)

    @property
    def is_over(self) -> bool:
        """More device memory than the budget."""
        return bool(self.budget_mib and self.device_peak and self.device_peak > self.budget_mib * MIB)

    @property
    def is_bad(self) -> bool:
        return self.status != "ok" or self.same is False or self.is_over


def row_of(scene: Scene, percent: float | None, budget_mib: int, cache: str, run: Run, first: Row | None, pixels: str):
    """What a run says, beside the run without a budget; what it does not say is None."""
    last, usage = run.report.get("row", {}), run.report.get("usage", {})
    tracing, rays = last.get("secondsTracing"), usage.get("raysTraced", last.get("rays"))
    is_judged = run.is_good and bool(pixels)
    return Row(
        scene=scene.name, percent=percent, budget_mib=budget_mib, cache=cache, status=run.status,
        same=run.pixels == pixels if is_judged else None, secs=run.secs,
        ratio=ratio(run.secs, first.secs) if first and run.is_good else None, cpu_secs=run.cpu_secs,
        cpu_ratio=ratio(run.cpu_secs, first.cpu_secs) if first and run.is_good else None, tracing_secs=tracing,
        tracing_ratio=ratio(tracing, first.tracing_secs) if first and run.is_good else None, rays=rays,
        rays_per_sec=ratio(rays, tracing), loads=usage.get("loads"), reloads=usage.get("reloads"),
        paged_bytes=usage.get("bytesPaged"), device_peak=usage.get("gpuPeakBytes"),
        driver_peak=usage.get("driverPeakBytes"), host_peak=run.host_peak,
        in_core=usage.get("inCore"), messages=run.messages,
    )  # fmt: skip


def ratio(a, b) -> float | None:
    return a / b if a is not None and b else None


def budget_of(percent: float, peak: int) -> int:
    """MiB, rounded up."""
    return max(math.ceil(peak * percent / 100 / MIB), 1)


def worst_first(rows: list[Row], by: str = "secs") -> list[Row]:
    """Rows without a picture, then those with another one or too much memory, then by ratio; ties as they came."""

    def badness(row: Row) -> tuple:
        return (row.status != "ok", row.is_bad, (row.cpu_ratio if by == "cpu" else row.ratio) or 0.0)

    return sorted(rows, key=badness, reverse=True)


def measure(host: Host, scene: Scene, percents: list[float], caches: list[str], tell) -> list[Row]:
    """All rows of a scene; `tell` is called with each as it comes."""
    rows: list[Row] = []
    first: dict[str, Row] = {}
    pixels, peak = "", 0
    for percent in [None, *percents]:
        budget = 0 if percent is None else budget_of(percent, peak)
        record(host, scene, budget, is_cold=True, samples=1)
        for cache in caches:
            run = record(host, scene, budget, is_cold=cache == "cold")
            pixels = pixels or run.pixels
            row = row_of(scene, percent, budget, cache, run, first.get(cache), pixels)
            if percent is None:
                first[cache] = row
                row.ratio = row.cpu_ratio = 1.0 if run.is_good else None
                peak = max(peak, row.device_peak or 0)
            rows.append(row)
            tell(row)
        if not peak:
            break
    return rows


COLUMNS = (
    ("scene", 10), ("%", 6), ("budget", 8), ("cache", 6), ("status", 14), ("same", 6), ("s", 8), ("ratio", 6),
    ("cpu s", 7), ("ratio", 6), ("tracing", 8), ("ratio", 6), ("Mray/s", 7), ("loads", 7), ("paged", 7), ("device", 8),
    ("host", 8),
)  # fmt: skip


def head() -> str:
    return " ".join(f"{name:>{width}}" for name, width in COLUMNS)


def line(row: Row) -> str:
    """A row of the table; sizes are MiB."""

    def number(value, digits=2, scale=1.0):
        return "-" if value is None else f"{value / scale:.{digits}f}"

    words = [
        row.scene[:10], "none" if row.percent is None else f"{row.percent:g}", str(row.budget_mib or "-"), row.cache,
        row.status[:14], {True: "yes", False: "NO", None: "-"}[row.same], number(row.secs), number(row.ratio),
        number(row.cpu_secs), number(row.cpu_ratio), number(row.tracing_secs), number(row.tracing_ratio),
        number(row.rays_per_sec, 2, 1e6), number(row.loads, 0),
        number(row.paged_bytes, 0, MIB), number(row.device_peak, 1, MIB) + ("!" if row.is_over else ""),
        number(row.host_peak, 0, MIB),
    ]  # fmt: skip
    return " ".join(f"{word:>{width}}" for word, (_, width) in zip(words, COLUMNS))


@dataclass
class Made:
    """A set and the process that writes it, None if it was there."""

    scene: Scene
    process: subprocess.Popen | None
    mark: pathlib.Path

    def wait(self) -> Scene:
        """Raises CalledProcessError if it was not written."""
        if self.process:
            if self.process.wait():
                raise subprocess.CalledProcessError(self.process.returncode, self.process.args)
            self.mark.write_text(shlex.join(map(str, self.process.args)) + "\n")
        return self.scene


def made_set(name: str, arguments) -> Made:
    """Begins to write a set unless the folder holds it, made with the same arguments."""
    options = ["--seed", str(arguments.seed), "--size", f"{arguments.size:g}"]
    options += ["--texture", str(arguments.texture)] if arguments.texture else []
    folder = arguments.work / "sets" / f"{name}-{arguments.seed}-{arguments.size:g}-{arguments.texture or 'own'}"
    file, mark = folder / f"{name}.usda", folder / "made.txt"
    process = None
    if not (mark.exists() and file.exists()):
        command = [arguments.python, "-m", f"sets.{name}", str(folder), *options]
        process = subprocess.Popen(command, cwd=SCENES, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    return Made(Scene(name, file, frame=FRAMES.get(name, "")), process, mark)


def scenes_of(arguments) -> list[Scene]:
    """The scenes that were asked for; sets are written side by side, one that cannot be is told and left out."""
    made = [scene_of(text) for text in arguments.scene]
    begun = []
    for name in arguments.sets:
        try:
            begun.append(made_set(name, arguments))
        except OSError as error:
            print(f"{name}: not made: {error}", file=sys.stderr)
    for one in begun:
        try:
            made.append(one.wait())
        except subprocess.CalledProcessError as error:
            print(f"{one.scene.name}: not made: {error}", file=sys.stderr)
    return made


def names(text: str, known=SETS) -> list[str]:
    found = [word for word in text.split(",") if word]
    for word in found:
        if word not in known:
            raise argparse.ArgumentTypeError(f"{word} is none of {', '.join(known)}")
    return found


def percents(text: str) -> list[float]:
    found = [float(word) for word in text.split(",") if word]
    if not all(0 < value <= 1000 for value in found):
        raise argparse.ArgumentTypeError("only numbers above 0")
    return found


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="cargo xtask bench sets")
    add = parser.add_argument
    add("--sets", type=names, default=list(SETS), help="made here; '' for none (default: all four)")
    add("--scene", action="append", default=[], help="any file: FILE[,camera=PATH][,frame=TIME]; may be repeated")
    add("--seed", type=int, default=1, help="odd: held out, for figures; even: for tuning")
    add("--size", type=float, default=0.05, help="1 is for a GPU")
    add("--texture", type=int, default=0, help="texels along a side of the larger files; 0: as each set has it")
    add("--percents", type=percents, default=[100.0, 75.0, 50.0, 27.0, 14.0])
    add("--caches", choices=("cold", "warm", "both"), default="both")
    add("--samples", type=int, default=16)
    add("--bounces", type=int)
    add("--width", type=int, default=320)
    add("--limit", type=float, default=600.0, help="seconds for one render")
    add("--by", choices=("secs", "cpu"), default="secs", help="what the order goes by")
    add("--device", default="", help="as oocpt:device")
    add("--work", type=pathlib.Path, default=HERE.parents[1] / "build" / "sets", help="sets, caches; they stay")
    add("--usdrecord", type=shlex.split, default=["usdrecord"], help="command line of the host's usdrecord")
    add("--python", default=os.environ.get("OOCPT_USD_PYTHON", sys.executable), help="one with pxr and numpy")
    add("--json", type=pathlib.Path)
    return parser


def machine(device: str) -> dict:
    return {"cpus": os.cpu_count(), "system": platform.platform(), "device": device}


def main() -> int:
    arguments = make_parser().parse_args()
    arguments.work = arguments.work.resolve()
    arguments.work.mkdir(parents=True, exist_ok=True)
    host = Host(
        arguments.usdrecord, arguments.work, arguments.width, arguments.samples, arguments.limit, arguments.bounces,
        arguments.device,
    )
    caches = list(CACHES) if arguments.caches == "both" else [arguments.caches]
    rows: list[Row] = []

    def tell(row: Row) -> None:
        rows.append(row)
        print(line(row), file=sys.stderr, flush=True)
        # After each row: what is measured is not lost when a later one takes too long.
        if arguments.json:
            options = {key: getattr(arguments, key) for key in ("seed", "size", "texture", "samples", "width", "limit")}
            made = {"bench": "sets", "machine": machine(arguments.device), **options}
            arguments.json.write_text(json.dumps(made | {"rows": [asdict(row) for row in rows]}, indent=1) + "\n")

    print(head(), file=sys.stderr)
    for scene in scenes_of(arguments):
        measure(host, scene, arguments.percents, caches, tell)
    made = f"{arguments.width} px, {arguments.samples} samples, seed {arguments.seed}, size {arguments.size:g}"
    print(f"\nworst first; sizes in MiB; {made}\n{head()}")
    for row in worst_first(rows, arguments.by):
        print(line(row))
        for message in row.messages if row.is_bad else ():
            print(f"    {message}")
    return 1 if not rows or any(row.is_bad for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
