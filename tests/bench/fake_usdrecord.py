# SPDX-License-Identifier: Apache-2.0
"""Stands for usdrecord in test_sets.py: writes a small EXR file and a report; the scene's name says what goes wrong at
a budget."""

import json
import os
import pathlib
import struct
import sys
import time

MIB = 1 << 20


def exr(pixels: bytes, note: bytes) -> bytes:
    """A header with a note, a table of one offset, a block."""
    head = b"\x76\x2f\x31\x01\x02\0\0\0" + b"note\0string\0" + struct.pack("<I", len(note)) + note + b"\0"
    return head + struct.pack("<Q", len(head) + 8) + pixels


def main() -> None:
    scene, out = pathlib.Path(sys.argv[-2]).stem, pathlib.Path(sys.argv[-1])
    budget = int(os.environ["OOCPT_MEMORY_BUDGET"])
    cache = pathlib.Path(os.environ["OOCPT_GEOMETRY_CACHE"]) / "mesh"
    is_cold = not cache.exists()
    cache.write_text("built")
    peak = min(budget, 100) * MIB if budget else 100 * MIB
    if budget and "hangs" in scene:
        time.sleep(60)
    if budget and "fails" in scene:
        print("OocPT: error: a scene that needs more", file=sys.stderr)
        sys.exit(3)
    if budget and "dies" in scene:
        os.kill(os.getpid(), 9)
    if budget and "over" in scene:
        peak += MIB
    pixels = b"other" if budget and "differs" in scene else b"pixels"
    seconds = 0.4 if is_cold else 0.1
    report = [
        {"oocptErrorReport": 1, "device": "fake"}, {"samples": 4, "secondsTracing": seconds, "rays": 1000},
        {"usage": {"gpuPeakBytes": peak, "raysTraced": 1000, "loads": 7, "bytesPaged": 2 * MIB, "inCore": not budget}},
    ]  # fmt: skip
    pathlib.Path(os.environ["OOCPT_REPORT"]).write_text("\n".join(map(json.dumps, report)) + "\ncut off {")
    out.with_name(out.name.replace("###", "012")).write_bytes(exr(pixels, os.urandom(9).hex().encode()))


main()
