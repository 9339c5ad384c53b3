#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Renders the gallery and makes its contact sheet: what `cargo xtask gallery` runs, in the usd-core environment with
`usdrecord` in PATH.

    render.py [--out build/gallery] [--only NAME ...] [--samples 64] [--width 640] [--bounces 6] [--set
        NAME.OPTION=VALUE ...]

Writes OUT/scenes/NAME, OUT/NAME.exr (linear), OUT/NAME.log (what the renderer said) and OUT/gallery.jpg. Warnings are
counted, not judged: this makes pictures to look at. Exits with 1 if a scene gave no picture.
"""

from __future__ import annotations

import argparse
import os
import pathlib
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve().parent
SCENES = HERE.parent / "scenes"
sys.path[:0] = [str(SCENES), str(HERE)]

import contact_sheet  # noqa: E402
import gallery  # noqa: E402


def record(scene: pathlib.Path, out: pathlib.Path, width: int, samples: int, bounces: int) -> float | None:
    """Renders by usdrecord; seconds of the whole process, None if it failed."""
    environment = {
        **os.environ, "OOCPT_SAMPLES_PER_PIXEL": str(samples), "OOCPT_MAX_BOUNCES": str(bounces),
        "OOCPT_ENABLE_INTERACTIVE": "false",
    }
    command = [
        "usdrecord", "--renderer", "OocPT", "--disableCameraLight", "--enableDomeLightVisibility", "--camera",
        "/World/Camera", "--imageWidth", str(width), str(scene), str(out),
    ]
    out.unlink(missing_ok=True)
    start = time.monotonic()
    with open(out.with_suffix(".log"), "wb") as log:
        status = subprocess.run(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=log, check=False
        ).returncode
    return time.monotonic() - start if status == 0 and out.exists() else None


def main() -> int:
    parser = argparse.ArgumentParser(prog="cargo xtask gallery")
    parser.add_argument("--out", type=pathlib.Path, default=HERE.parents[1] / "build" / "gallery")
    parser.add_argument("--only", action="append", choices=gallery.NAMES)
    parser.add_argument("--set", action="append", default=[], metavar="NAME.OPTION=VALUE")
    for name, default in (("samples", 64), ("width", 640), ("bounces", 6)):
        parser.add_argument(f"--{name}", type=int, default=default)
    arguments = parser.parse_args()
    # The scenes' process is another one: usd-core is not loaded where it is not needed, and large scenes give their
    # memory back.
    make = [sys.executable, "-m", "gallery", str(arguments.out / "scenes")]
    for name in arguments.only or ():
        make += ["--only", name]
    for text in arguments.set:
        make += ["--set", text]
    arguments.out.mkdir(parents=True, exist_ok=True)
    subprocess.run(make, cwd=SCENES, check=True)
    failed = []
    for name in arguments.only or gallery.NAMES:
        out = arguments.out / f"{name}.exr"
        seconds = record(
            arguments.out / "scenes" / name / f"{name}.usdc", out, arguments.width, arguments.samples, arguments.bounces
        )
        said = out.with_suffix(".log").read_text(errors="replace")
        warnings = sum("Warning" in line for line in said.splitlines())
        if seconds is None:
            failed.append(name)
            print(f"{name}: no picture; {out.with_suffix('.log')} ends with: {said[-300:]}", file=sys.stderr)
        else:
            print(f"{name}: {seconds:.1f} s, {warnings} warnings", file=sys.stderr)
    pictures = [(name.replace("_", " "), arguments.out / f"{name}.exr") for name in gallery.NAMES]
    page = contact_sheet.sheet(
        [(label, contact_sheet.load(path, 0.0) if path.exists() else None) for label, path in pictures], 3, 426
    )
    page.save(arguments.out / "gallery.jpg", quality=82, optimize=True)
    print(arguments.out / "gallery.jpg")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
