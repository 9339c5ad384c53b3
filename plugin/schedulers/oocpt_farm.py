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
import ctypes
import json
import os
import re
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

# Exit status for what may succeed the next time (EX_TEMPFAIL of sysexits.h).
TRY_AGAIN = 75
# `PR_SET_PDEATHSIG` of Linux.
SET_DEATH_SIGNAL = 1
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


def ends_with_parent():
    """What a child calls before it runs its program (`preexec_fn`): it is killed when the thread that started it ends.
    A task that is killed would leave a renderer behind, which takes the device from the next one."""
    if not sys.platform.startswith("linux"):
        return None
    library, parent = ctypes.CDLL(None), os.getpid()

    def ask() -> None:
        library.prctl(SET_DEATH_SIGNAL, signal.SIGKILL)
        if os.getppid() != parent:
            os.kill(os.getpid(), signal.SIGKILL)

    return ask


def folder_of(arguments: argparse.Namespace) -> Path:
    return Path(arguments.folder).absolute() / f"frame.{arguments.frame:04d}"


def part_name(samples: tuple[int, int]) -> str:
    return "samples.{:08d}-{:08d}.film".format(*samples)


def facts_of(films: list[Path]) -> Iterator[tuple[Path, dict]]:
    """What `oocpt film info` says of each of these files that is a film."""
    for film in films:
        done = subprocess.run(
            ["oocpt", "film", "info", str(film), "--json"], capture_output=True, text=True, check=False
        )
        if done.returncode == 0:
            yield film, json.loads(done.stdout.splitlines()[0])


def samples_of(film: dict) -> list[tuple[int, int]]:
    """The samples that a film has, as ranges that do not touch."""
    ranges: list[tuple[int, int]] = []
    for begin, end in sorted((one["begin"], one["end"]) for one in film["samples"]):
        if ranges and ranges[-1][1] == begin:
            begin = ranges.pop()[0]
        ranges.append((begin, end))
    return ranges


def has_all(film: Path, samples: tuple[int, int]) -> bool:
    """Whether a film is there and has these samples and no others."""
    return film.exists() and [samples_of(facts) for _, facts in facts_of([film])] == [[samples]]


def chain(spans: dict[Path, tuple[int, int]], samples: int) -> tuple[list[Path], int]:
    """The fewest films that follow each other from sample 0 to the last, each sample once, and that last sample. Where
    they do not reach it, those that come farthest. Tasks of other runs of blocks leave films that overlap these."""
    reached: dict[int, list[Path]] = {0: []}
    for film, (begin, end) in sorted(spans.items(), key=lambda one: (one[1], one[0])):
        if begin in reached and begin < end <= samples:
            if end not in reached or len(reached[begin]) + 1 < len(reached[end]):
                reached[end] = [*reached[begin], film]
    return reached[max(reached)], max(reached)


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
    part = folder / part_name((begin, end))
    if has_all(part, (begin, end)):
        print(f"{part.name} is there\nopenjd_progress: 100", flush=True)
        return 0
    child = subprocess.Popen(
        command(arguments, part, (begin, end)), stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        errors="replace", env=environment(arguments), preexec_fn=ends_with_parent(),
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
    if has_all(part, (begin, end)):
        print("openjd_progress: 100", flush=True)
        return 0
    print(f"openjd_fail: samples {begin}..{end} of frame {arguments.frame} are not all there: {error}", flush=True)
    # A mistake in the scene or in the settings stays one.
    return status if status > 0 and not (stopped or part.exists()) else TRY_AGAIN


def picture(arguments: argparse.Namespace) -> int:
    every = {film: samples_of(facts) for film, facts in facts_of(sorted(folder_of(arguments).glob("samples.*.film")))}
    parts, end = chain({film: spans[0] for film, spans in every.items() if len(spans) == 1}, arguments.samples)
    if end != arguments.samples:
        sys.exit(f"frame {arguments.frame}: no part has the samples from {end} of {arguments.samples} on")
    return make_picture(parts, picture_file(arguments.out, arguments.frame))


def picture_file(out: str, frame: int) -> Path:
    return Path(out % frame if "%" in out else out).absolute()


def make_picture(films: list[Path], out: Path) -> int:
    out.parent.mkdir(parents=True, exist_ok=True)
    return subprocess.run(["oocpt", "film", "picture", *map(str, films), "--out", str(out)], check=False).returncode


def frame_options() -> argparse.ArgumentParser:
    """What every command takes."""
    options = argparse.ArgumentParser(add_help=False)
    options.add_argument("--folder", required=True, help="where the parts of all frames are")
    options.add_argument("--frame", type=number(0, 10**9), required=True)
    options.add_argument("--samples", type=number(1, 1 << 24), required=True, help="samples of each pixel")
    options.add_argument("--blocks", type=number(1, 10**6), default=1, help="blocks that the samples of a frame make")
    return options


def scene_options() -> argparse.ArgumentParser:
    """What is rendered, and how."""
    options = argparse.ArgumentParser(add_help=False)
    options.add_argument("--scene", required=True)
    options.add_argument("--camera", default="")
    options.add_argument("--settings", default="", help="path of the RenderSettings prim")
    options.add_argument("--render-pass", default="", help="path of the RenderPass prim")
    options.add_argument("--caches", default="", help="folder of decoded textures, built geometry, compiled passes")
    options.add_argument("--width", type=number(1, 65536), default=960)
    left_out = "any setting; one without a value is left out"
    options.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help=left_out)
    options.add_argument("flags", nargs="*", help="more flags of usdrecord, behind --")
    return options


def parser() -> argparse.ArgumentParser:
    commands = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    subparsers = commands.add_subparsers(required=True)
    part = subparsers.add_parser("part", parents=[frame_options(), scene_options()], help="renders a part")
    part.add_argument("--block", type=blocks, required=True, help="B, or a run of blocks B-C")
    part.set_defaults(run=render)
    whole = subparsers.add_parser("picture", parents=[frame_options()], help="makes the picture of the parts")
    whole.add_argument("--out", required=True, help="EXR file; %%04d stands for the frame")
    whole.set_defaults(run=picture)
    return commands


def main() -> int:
    arguments = parser().parse_args()
    return arguments.run(arguments)


if __name__ == "__main__":
    sys.exit(main())
