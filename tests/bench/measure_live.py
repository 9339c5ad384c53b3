#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What an artist waits for in a live host: what `cargo xtask bench live` runs.

    measure_live.py [--scenes forest1000,forest100000,creature,terrain] [--scene FILE[,camera=PATH][,frame=TIME]]
        [--width 1280] [--height 720] [--samples 16] [--moves 12] [--limit 60] [--json FILE] [--host PYTHON]

Each scene is opened in a Hydra engine without a window, in a process of its own (live_process.py): the camera tumbles,
zooms and walks, a light and an instance are dragged; each step waits for its picture, or comes 30 times a second. Told
of each kind of move: how long the host's own thread was held, when the first picture was shown, when one with a sample
at full resolution, and the emptiest picture that was shown. The worst row by the first picture comes first. Exits with
1 if a scene failed, or a picture with pixels that nobody knows was shown.
"""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
SCENES = HERE.parent / "scenes"
sys.path.insert(0, str(HERE))

from measure_sets import machine, names  # noqa: E402
from usdrecord_runs import MIB, Scene, scene_of  # noqa: E402

MADE = {
    "forest1000": ["forest.py", "--instances", "1000"],
    "forest100000": ["forest.py", "--instances", "100000"],
    "creature": ["creature.py"],
    "terrain": ["terrain.py"],
}
COLUMNS = (
    ("scene", 14), ("move", 20), ("held ms", 8), ("p99", 7), ("first ms", 8), ("p99", 7), ("full ms", 8), ("p99", 7),
    ("of", 7), ("shown", 6), ("empty", 6), ("meshes", 7), ("device", 7), ("host", 7),
)  # fmt: skip


def made_scene(name: str, arguments) -> Scene:
    """A scene of the project; raises CalledProcessError if it cannot be written."""
    file = arguments.work / "live" / f"{name}.usdc"
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        script, *options = MADE[name]
        part = file.with_suffix(".part.usdc")
        command = [arguments.python, script, str(part), *options]
        subprocess.run(command, cwd=SCENES, check=True, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
        part.rename(file)
    return Scene(name, file)


def measure(scene: Scene, arguments) -> tuple[list[dict], str]:
    """The rows of a scene as far as they came, and what went wrong, or nothing."""
    numbers = (arguments.width, arguments.height, arguments.samples, arguments.moves, arguments.limit)
    command = [arguments.host, str(HERE / "live_process.py"), str(scene.file), scene.camera, scene.frame]
    environment = {**os.environ, "USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX": "1"}
    if arguments.device:
        environment["OOCPT_DEVICE"] = arguments.device
    whole = arguments.limit * (2 + 20 * arguments.moves)
    try:
        done = subprocess.run(
            command + [str(number) for number in numbers], env=environment, capture_output=True, text=True,
            timeout=whole, errors="replace", stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        return [], str(error)
    rows = [json.loads(text) for text in done.stdout.splitlines() if text.startswith("{")]
    failed = "" if done.returncode == 0 else (done.stderr.strip().splitlines() or [f"exit {done.returncode}"])[-1]
    return [{"scene": scene.name, **row} for row in rows], failed


def milliseconds(value: float | None) -> str:
    return "never" if value is None else f"{value * 1e3:.0f}"


def line(row: dict) -> str:
    sizes = ["-" if row[key] is None else f"{row[key] / MIB:.0f}" for key in ("device", "host")]
    if row["move"] == "start":
        words = [milliseconds(row["held"]), "", milliseconds(row["first"]), "", milliseconds(row["converged"])]
        words += ["", "", "", "", ""]
    else:
        words = [milliseconds(row[key][part]) for key in ("held", "first", "full") for part in ("median", "p99")]
        words += [f"{row['full']['count']}/{row['moves']}", str(row["shown"])]
        words += [f"{row['emptiest']:.2f}", str(row["meshesMade"])]
    words = [row["scene"][:14], row["move"], *words, *sizes]
    return " ".join(f"{word:>{width}}" for word, (_, width) in zip(words, COLUMNS))


def head() -> str:
    return " ".join(f"{name:>{width}}" for name, width in COLUMNS)


def worst_first(rows: list[dict]) -> list[dict]:
    """Rows in which a move had no picture, then those with the longest wait for one."""

    def badness(row: dict) -> tuple:
        if row["move"] == "start":
            return (0, 0, -1.0)
        first = row["first"]
        return (row["emptiest"] > 0, first["median"] is None, first["median"] or 0.0)

    return sorted(rows, key=badness, reverse=True)


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="cargo xtask bench live")
    add = parser.add_argument
    made = lambda text: names(text, MADE)
    add("--scenes", type=made, default=list(MADE), help="made here; '' for none (default: all)")
    add("--scene", action="append", default=[], help="any file: FILE[,camera=PATH][,frame=TIME]; may be repeated")
    add("--width", type=int, default=1280)
    add("--height", type=int, default=720)
    add("--samples", type=int, default=16)
    add("--moves", type=int, default=12, help="of each kind that waits; five times as many of those that do not")
    add("--limit", type=float, default=60.0, help="seconds to wait for one picture")
    add("--device", default="", help="as oocpt:device")
    add("--work", type=pathlib.Path, default=HERE.parents[1] / "build", help="where scenes are written; they stay")
    add("--python", default=os.environ.get("OOCPT_USD_PYTHON", sys.executable), help="one with pxr and numpy")
    add("--host", default=os.environ.get("OOCPT_HOST_PYTHON", sys.executable), help="the host's Python")
    add("--json", type=pathlib.Path)
    return parser


def main() -> int:
    arguments = make_parser().parse_args()
    arguments.work = arguments.work.resolve()
    rows, failures = [], []
    print(head(), file=sys.stderr)
    for named in [*arguments.scenes, *arguments.scene]:
        try:
            scene = made_scene(named, arguments) if named in MADE else scene_of(named)
        except (OSError, ValueError, subprocess.CalledProcessError) as error:
            failures.append(f"{named}: {error}")
            continue
        found, failed = measure(scene, arguments)
        rows += found
        failures += [f"{scene.name}: {failed}"] if failed else []
        for row in found:
            print(line(row), file=sys.stderr, flush=True)
        if arguments.json:
            options = {key: getattr(arguments, key) for key in ("width", "height", "samples", "moves", "limit")}
            made = {"bench": "live", "machine": machine(arguments.device), **options, "rows": rows}
            arguments.json.write_text(json.dumps(made, indent=1) + "\n")
    print(f"\nworst first; sizes in MiB; {arguments.width} x {arguments.height}, {arguments.samples} samples\n{head()}")
    for row in worst_first(rows):
        print(line(row))
    for failure in failures:
        print(f"not measured: {failure}")
    has_holes = any(row["move"] != "start" and row["emptiest"] > 0 for row in rows)
    return 1 if failures or has_holes or not rows else 0


if __name__ == "__main__":
    sys.exit(main())
