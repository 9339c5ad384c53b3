# SPDX-License-Identifier: Apache-2.0
"""Files that lie give texels or one reason, soon, in bounded memory, and the process lives on.

OOCPT_HOSTILE_FILES=N makes N variants of each sort of file in place of a few.
"""

from __future__ import annotations

import json
import os
import pathlib
import selectors
import time

import hostile
import numpy as np
import pytest
import tifffile
from image_host import Reader, noise, write_exr
from PIL import Image

VARIANTS = int(os.environ.get("OOCPT_HOSTILE_FILES", "8"))
# A second of work at most is in any of the files; the rest is room for a busy machine.
SECONDS = 20
# Addresses, of which the host's libraries take about half before anything is read.
BYTES = 6 << 30
# Addresses that any of these files may make it take.
GROWTH = 1 << 30


class Patient(Reader):
    """A reader that may be killed."""

    def peak(self) -> int:
        """Most bytes of addresses that the process had so far."""
        status = pathlib.Path(f"/proc/{self._process.pid}/status").read_text()
        return 1024 * int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmPeak")))

    def ask(self, function: str, *arguments) -> dict:
        watch = selectors.DefaultSelector()
        watch.register(self._process.stdout, selectors.EVENT_READ)
        self._process.stdin.write(
            json.dumps([f"oocpt_image_{function}", *[str(a) if isinstance(a, os.PathLike) else a for a in arguments]])
            + "\n"
        )
        self._process.stdin.flush()
        assert watch.select(SECONDS), f"{function}{arguments} takes more than {SECONDS} s"
        line = self._process.stdout.readline()
        assert line, f"the host died of {function}{arguments}, status {self._process.wait()}"
        answer = json.loads(line)
        assert "host" not in answer, answer["host"]
        return answer


@pytest.fixture
def patient(image_build, tmp_path):
    write_exr(tmp_path / "own.exr", noise((8, 8, 3), np.float16))
    patient = Patient(image_build, tmp_path / "own.exr", BYTES)
    yield patient
    patient._process.kill()
    patient._process.wait()


def is_reason(answer) -> None:
    """In words, and not that memory ran out: nobody asked for that much."""
    reason = answer.get("error", "because")
    assert reason and len(reason) < 2000, answer
    assert not any(word in reason.lower() for word in ("alloc", "memory")), answer


def survives(patient, path) -> None:
    """Decoded and read from its end: a result of the right form, or a reason in words."""
    facts = patient.ask("facts", path)
    assert ("error" in facts) != ("levels" in facts), facts
    if "error" in facts:
        is_reason(facts)
        return
    width, height = facts["levels"][-1]
    for answer in (
        patient.ask("walk", path, 0),
        patient.ask("read", path, len(facts["levels"]) - 1, 0, height - 1, min(width, 8), 1),
    ):
        assert answer.keys() & {"error", "sum", "texels"}, answer
        is_reason(answer)


def all_survive(patient, folder, files) -> int:
    patient.facts(folder / "own.exr")
    count, before = 0, patient.peak()
    for name, content in files:
        path = folder / name
        path.write_bytes(content)
        survives(patient, path)
        grown = patient.peak() - before
        assert grown < GROWTH, f"{name} takes {grown >> 20} MiB"
        path.unlink()
        count += 1
    return count


def test_impossible_headers_are_refused(patient, tmp_path):
    assert all_survive(patient, tmp_path, hostile.lies(tmp_path)) > 200


@pytest.mark.parametrize(
    "name, content, reason",
    [
        ("table.exr", hostile.exr_of((0, 0, 65535, 65535), 0), "more parts than a file of"),
        ("tiles.exr", hostile.exr_of((0, 0, 65535, 65535), 3, (1, 1, 0)), "more parts than a file of"),
        ("block.exr", hostile.exr_of((0, 0, 65535, 255), 9, channels=100), "compresses together"),
        ("window.exr", hostile.exr_of((0, 0, 65536, 9)), "65536 x 65536 are the most"),
        ("deep.exr", hostile.exr_of((0, 0, 9, 9), version=0x802), "a deep image"),
        (
            "note.exr", hostile.exr_of((0, 0, 9, 9), extra=hostile.exr_attribute("note", "string", b"x", 0x7FFFFFFF)),
            "breaks off",
        ),
        ("large.png", hostile.png_of(40000, 30000), "cannot hold that many"),
        (
            "woven.png", hostile.png_of(30000, 30000, interlaced=1, data=bytes(4 << 20)) + bytes(3 << 20),
            "without interlacing",
        ),
        (
            "texts.png", hostile.png_of(9, 9) + b"".join(hostile.handmade.chunk(b"zTXt", b"a\0\0") for _ in range(20)),
            "texts",
        ),
        ("large.tga", hostile.handmade.tga(65535, 65535, 10, 32, bytes(100)), "is too large for that"),
        ("run.tga", hostile.handmade.tga(20000, 20000, 10, 32, bytes(100)), "cannot hold that many"),
        (
            "tile.tif", hostile.tiff_of(64, 64, {322: (4, 0xFFFFFFFF), 323: (4, 1), 324: (4, 8), 325: (4, 100)}),
            "has tiles of",
        ),
        ("flat.tif", hostile.tiff_of(60000, 60000, {278: (4, 1)}), "cannot hold that many"),
    ],
)
def test_contradictory_headers_give_their_reason(patient, tmp_path, name, content, reason):
    (tmp_path / name).write_bytes(content)
    assert reason in patient.ask("facts", tmp_path / name).get("error", "")


def test_truncated_files_are_survived(patient, tmp_path):
    assert all_survive(patient, tmp_path, hostile.cuts(tmp_path, VARIANTS)) > 300


def test_flipped_bits_are_survived(patient, tmp_path):
    assert all_survive(patient, tmp_path, hostile.flips(tmp_path, VARIANTS, 1)) == VARIANTS * len(
        hostile.good(tmp_path)
    )


def test_unmodified_files_are_read(patient, tmp_path):
    for name, content in hostile.good(tmp_path).items():
        (tmp_path / name).write_bytes(content)
        assert "sum" in patient.ask("walk", tmp_path / name, 0), name


@pytest.mark.parametrize(
    "name, reason",
    [
        ("pipe.png", "pipe"), ("zero.png", "device"), ("folder.png", "folder"), ("circle.png", "circle"),
        ("empty.png", "empty"), ("dangling.png", "cannot be found"),
    ],
)
def test_irregular_files_are_not_opened(patient, tmp_path, name, reason):
    path = tmp_path / name
    {
        "pipe.png": lambda: os.mkfifo(path),
        "zero.png": lambda: path.symlink_to("/dev/zero"),
        "folder.png": path.mkdir,
        "circle.png": lambda: path.symlink_to(path),
        "empty.png": path.touch,
        "dangling.png": lambda: path.symlink_to(tmp_path / "nowhere.png"),
    }[name]()
    assert reason in patient.ask("facts", path)["error"]
    assert "error" in patient.ask("file", path, 100) or name == "empty.png"
    if name != "empty.png":
        assert patient.ask("exists", path) == {"exists": False}
        assert patient.ask("exists", f"{path}[member.png]") == {"exists": False}


def test_a_file_that_shrinks_while_it_is_read(patient, tmp_path):
    """Opened whole, then cut: a reason, or what was read before."""
    for name, content in hostile.good(tmp_path).items():
        path = tmp_path / name
        path.write_bytes(content)
        assert "levels" in patient.ask("facts", path)
        answer = patient.ask("shrink", path, len(content) // 3)
        assert "error" in answer or "sum" in answer, (name, answer)


def test_non_finite_texels_are_kept(patient, tmp_path):
    values = np.array([np.nan, np.inf, -np.inf, 1e38, -1e38, 1e-45] * 3, np.float32).reshape(2, 3, 3)
    tifffile.imwrite(tmp_path / "n.tif", values, photometric="rgb", metadata=None)
    np.testing.assert_array_equal(patient.texels(tmp_path / "n.tif"), values)


def test_large_constant_images_are_accepted(patient, tmp_path):
    """Texels that are all the same compress a thousand times: such files are sound."""
    flat = Image.new("RGB", (6000, 6000), (10, 20, 30))
    for name in ("flat.png", "flat.jpg", "flat.tif", "flat.tga"):
        options = {
            "flat.tif": {"compression": "tiff_lzw"}, "flat.tga": {"compression": "tga_rle"},
            "flat.jpg": {"progressive": True},
        }.get(name, {})
        flat.save(tmp_path / name, **options)
        start = time.monotonic()
        assert "sum" in patient.ask("walk", tmp_path / name, 0), name
        assert time.monotonic() - start < SECONDS
