# SPDX-License-Identifier: Apache-2.0
"""Files of products, flat and deep, are whole or those from before: when a disk is full, when the process is killed."""

import os
import shlex
import signal
import subprocess

import numpy as np
import OpenEXR
import pytest

import stopped
from test_products import CAMERA, product, stage

# What a file is of: an empty picture packs to nothing, noise does not.
BOARD = """
def Mesh "Board"
{{
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(-9, -9, 0), (9, -9, 0), (9, 9, 0), (-9, 9, 0)]
}}
def SphereLight "Lamp"
{{
    double3 xformOp:translate = (1, 2, 3)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
KINDS = {"flat": "", "deep": 'uniform token productType = "deepRaster"'}
# A file system of $1 KiB in a name space of its own, with the file $3 in it; then the command $4.
FULL_DISK = """set -e
mount -t tmpfs -o size=$1k none "$2"
cp "$3" "$2/a.exr"
set +e
eval "$4" >/dev/null 2>"$3.said"
status=$?
cmp "$2/a.exr" "$3" && ls -A "$2" && exit $status
"""


def variables():
    kept = dict(os.environ)
    kept.pop("PYTHONPATH", None)
    return kept


def write(folder, kind, path, size, samples=1):
    """A stage with a product of this kind that is the file `path`; the words that render it."""
    scene = folder / f"{kind}{size[0]}.usda"
    text = stage({"A": product("A", str(path), ("beauty",), size, KINDS[kind])}, camera=CAMERA + BOARD)
    scene.write_text(text)
    return ["usdrecord", "--disableCameraLight", "--products", "--samples", str(samples), str(scene),
            str(folder / "out.exr")]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_a_full_disk_is_an_error_and_the_old_file_stays(tmp_path, kind):
    unshare = ["unshare", "--map-root-user", "--mount"]
    if subprocess.run([*unshare, "true"], check=False).returncode:
        pytest.skip("no name spaces of one's own here")
    disk, old = tmp_path / "disk", tmp_path / "old.exr"
    disk.mkdir()
    subprocess.run(write(tmp_path, kind, old, (16, 12)), env=variables(), check=True, capture_output=True, timeout=120)
    kib = (old.stat().st_size >> 10) + 24
    line = shlex.join(write(tmp_path, kind, disk / "a.exr", (128, 96)))
    done = subprocess.run(
        [*unshare, "sh", "-c", FULL_DISK, "sh", str(kib), str(disk), str(old), line], env=variables(), cwd=tmp_path,
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    said = (tmp_path / "old.exr.said").read_text()
    assert done.returncode == 1, (done.stdout, done.stderr, said)
    assert done.stdout.split() == ["a.exr"], "nothing is beside it"
    told = [line for line in said.splitlines() if "/Settings/A: the product is not written" in line]
    assert told and all("No space left" in line for line in told), said


@pytest.mark.parametrize("kind", KINDS)
def test_a_kill_while_it_is_written_leaves_the_old_file(tmp_path, kind):
    folder, size = tmp_path / "files", (640, 480)
    folder.mkdir()
    path = folder / "a.exr"
    with OpenEXR.File({"type": OpenEXR.scanlineimage}, {"Y": np.ones((4, 4), np.float32)}) as file:
        file.write(str(path))
    before = path.read_bytes()
    line = write(tmp_path, kind, path, size)

    def start():
        for file in folder.iterdir():
            file.unlink()
        path.write_bytes(before)
        return subprocess.Popen(line, env=variables(), stderr=subprocess.DEVNULL, start_new_session=True)

    def find():
        return next((file for file in folder.iterdir() if file != path), None)

    process, beside = stopped.while_it_writes(start, find)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    assert list(folder.iterdir()) != [path], "it was being written"
    assert path.read_bytes() == before, "the old file"
    assert not beside.suffix == ".exr", "what is half done is no picture by its name"
