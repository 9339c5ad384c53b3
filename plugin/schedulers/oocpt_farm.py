#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A task of a farm: renders some blocks of a frame's samples as a part of a film, or makes the picture of the parts.

    oocpt_farm.py part --scene SCENE --folder FOLDER --frame 7 --samples 1024 --blocks 16 --block 3-4 -- FLAGS
    oocpt_farm.py picture --folder FOLDER --frame 7 --samples 1024 --blocks 16 --out shot.%04d.exr

Needs `oocpt` and `usdrecord` in the path, and nothing but Python. Lines `openjd_progress:` tell the progress.

- A frame of N samples has K blocks: block b (from 1) has the samples from (b - 1) N / K to b N / K, rounded down. The
  farm may give a task any run of blocks: parts merge to the same bits however samples are cut.
- A part that is there and whole is not rendered again, so a retry costs nothing.
- SIGTERM and SIGINT go to the renderer, which writes what it has. A task that ends without all of its samples exits
  with 75 ("try again"): the next one goes on from its file, on any machine that has the folder.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

# Exit status for what may succeed the next time (EX_TEMPFAIL of sysexits.h).
TRY_AGAIN = 75
# The renderer's line of progress begins with the share of its samples.
PROGRESS = re.compile(r"(?:^|\s)(\d+)\s?%")


def blocks(text: str) -> tuple[int, int]:
    """First and last block of a chunk as farms write them: `3`, `3-5`, `3,4,5`."""
    numbers: list[int] = []
    for piece in text.split(","):
        found = re.fullmatch(r"\s*(\d+)(?:-(\d+))?\s*", piece)
        if not found:
            raise argparse.ArgumentTypeError(f"{text!r} is no block and no run of blocks such as 3-5")
        first, last = int(found[1]), int(found[2] or found[1])
        if numbers and first != numbers[-1] + 1 or last < first or last - first > 1_000_000:
            raise argparse.ArgumentTypeError(f"{text!r}: blocks of a task have to follow each other")
        numbers += [first, last]
    return numbers[0], numbers[-1]


def number(least: int, most: int):
    """A whole number in these bounds."""

    def parse(text: str) -> int:
        if not text.isdecimal() or not least <= int(text) <= most:
            raise argparse.ArgumentTypeError(f"{text!r} is no whole number from {least} to {most}")
        return int(text)

    return parse


def span(chunk: tuple[int, int], samples: int, count: int) -> tuple[int, int]:
    """The samples of a run of blocks."""
    first, last = chunk
    if not 1 <= first <= last <= count:
        sys.exit(f"blocks {first} to {last} are not of 1 to {count}")
    return (first - 1) * samples // count, last * samples // count


def folder_of(arguments: argparse.Namespace) -> Path:
    return Path(arguments.folder).absolute() / f"frame.{arguments.frame:04d}"


def samples_of(films: list[Path]) -> list[tuple[int, int]]:
    """The samples that these films have; a file that is no film has none."""
    ranges: list[tuple[int, int]] = []
    for film in films:
        done = subprocess.run(
            ["oocpt", "film", "info", str(film), "--json"], capture_output=True, text=True, check=False
        )
        for line in done.stdout.splitlines() if done.returncode == 0 else ():
            ranges += [(one["begin"], one["end"]) for one in json.loads(line).get("samples", ())]
    return sorted(ranges)


def command(arguments: argparse.Namespace, part: Path, samples: tuple[int, int]) -> list[str]:
    """The line that renders these samples."""
    preview = part.with_name(f"{part.stem}.{os.getpid()}.####.exr")
    named = (("camera", arguments.camera), *(("set", one) for one in arguments.set if not one.endswith("=")))
    line = ["oocpt", "film", "render", arguments.scene, "--width", str(arguments.width)]
    line += ["--samples", "{}..{}".format(*samples), "--out", str(part), "--picture", str(preview)]
    line += [word for name, value in named if value for word in (f"--{name}", value)]
    prims = (("renderSettingsPrimPath", arguments.settings), ("renderPassPrimPath", arguments.render_pass))
    flags = [word for name, value in prims if value for word in (f"--{name}", value)]
    return [*line, "--", "--progress", "--frames", str(arguments.frame), *flags, *arguments.flags]


def environment(arguments: argparse.Namespace) -> dict[str, str]:
    """That of the renderer, with the caches in their folder."""
    variables = dict(os.environ)
    if arguments.caches:
        for name, folder in (("TEXTURE", "textures"), ("GEOMETRY", "geometry"), ("PIPELINE", "pipelines")):
            variables[f"OOCPT_{name}_CACHE"] = str(Path(arguments.caches).absolute() / folder)
    return variables


def render(arguments: argparse.Namespace) -> int:
    begin, end = span(arguments.block, arguments.samples, arguments.blocks)
    if begin == end:
        return 0
    folder = folder_of(arguments)
    folder.mkdir(parents=True, exist_ok=True)
    part = folder / f"samples.{begin:08d}-{end:08d}.film"
    if part.exists() and samples_of([part]) == [(begin, end)]:
        print(f"{part.name} is there\nopenjd_progress: 100", flush=True)
        return 0
    child = subprocess.Popen(
        command(arguments, part, (begin, end)), stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        errors="replace", env=environment(arguments),
    )  # fmt: skip
    stopped: list[int] = []

    def stop(number: int, _frame: object) -> None:
        stopped.append(number)
        child.send_signal(number)

    for name in (signal.SIGTERM, signal.SIGINT):
        signal.signal(name, stop)
    error = ""
    for said in child.stderr:
        error = said.strip() or error
        print(said, end="", file=sys.stderr, flush=True)
        if found := PROGRESS.search(said):
            print(f"openjd_progress: {min(int(found[1]), 100)}", flush=True)
    status = child.wait()
    for preview in folder.glob(f"{part.stem}.{os.getpid()}.*.exr"):
        preview.unlink(missing_ok=True)
    if samples_of([part]) == [(begin, end)]:
        print("openjd_progress: 100", flush=True)
        return 0
    print(f"openjd_fail: samples {begin}..{end} of frame {arguments.frame} are not all there: {error}", flush=True)
    # A mistake in the scene or in the settings stays one.
    return status if status > 0 and not (stopped or part.exists()) else TRY_AGAIN


def picture(arguments: argparse.Namespace) -> int:
    parts = sorted(folder_of(arguments).glob("samples.*.film"))
    at = 0
    for begin, end in samples_of(parts):
        if begin != at:
            break
        at = end
    if at != arguments.samples:
        sys.exit(f"frame {arguments.frame}: sample {at} of {arguments.samples} is missing, or is there twice")
    out = Path(arguments.out % arguments.frame if "%" in arguments.out else arguments.out).absolute()
    out.parent.mkdir(parents=True, exist_ok=True)
    done = subprocess.run(["oocpt", "film", "picture", *map(str, parts), "--out", str(out)], check=False)
    return done.returncode


def parser() -> argparse.ArgumentParser:
    commands = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    subparsers = commands.add_subparsers(required=True)
    common = argparse.ArgumentParser(add_help=False)
    common.add_argument("--folder", required=True, help="where the parts of all frames are")
    common.add_argument("--frame", type=number(0, 10**9), required=True)
    common.add_argument("--samples", type=number(1, 1 << 24), required=True, help="samples of each pixel")
    common.add_argument("--blocks", type=number(1, 10**6), default=1, help="blocks that the samples of a frame make")
    part = subparsers.add_parser("part", parents=[common], help="renders a part")
    part.add_argument("--scene", required=True)
    part.add_argument("--block", type=blocks, required=True, help="B, or a run of blocks B-C")
    part.add_argument("--camera", default="")
    part.add_argument("--settings", default="", help="path of the RenderSettings prim")
    part.add_argument("--render-pass", default="", help="path of the RenderPass prim")
    part.add_argument("--caches", default="", help="folder of decoded textures, built geometry, compiled passes")
    part.add_argument("--width", type=number(1, 65536), default=960)
    left_out = "any setting; one without a value is left out"
    part.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help=left_out)
    part.add_argument("flags", nargs="*", help="more flags of usdrecord, behind --")
    part.set_defaults(run=render)
    whole = subparsers.add_parser("picture", parents=[common], help="makes the picture of the parts")
    whole.add_argument("--out", required=True, help="EXR file; %%04d stands for the frame")
    whole.set_defaults(run=picture)
    return commands


def main() -> int:
    arguments = parser().parse_args()
    return arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(main())
