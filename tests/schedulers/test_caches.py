# SPDX-License-Identifier: Apache-2.0
"""Jobs that share the folders of their caches, one of them killed while it writes."""

import os
import shutil
import signal
import subprocess
import time

import numpy as np
from PIL import Image
from test_textures import STAGE

import compare
import exr
import stopped


def start(folder, out, caches):
    variables = dict(os.environ, OOCPT_MAX_BOUNCES="0", OOCPT_SAMPLES_PER_PIXEL="1")
    for name in ("TEXTURE", "GEOMETRY"):
        variables[f"OOCPT_{name}_CACHE"] = str(folder / caches / name.lower()) if caches else "0"
    variables.pop("PYTHONPATH", None)
    line = ["usdrecord", "--renderer", "OocPT", "--imageWidth", "256", "--disableCameraLight"]
    return subprocess.Popen(
        [*line, str(folder / "scene.usda"), str(folder / out)], env=variables, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True,
    )  # fmt: skip


def ends(process):
    said = process.communicate(timeout=300)[0]
    assert process.returncode == 0, said
    assert "WARNING" not in said.upper() and "cache" not in said, said


def test_a_job_that_is_killed_while_it_writes_costs_another_nothing(tmp_path):
    """Both begin with empty folders; a third one takes what the second has left."""
    texels = np.random.default_rng(1).integers(0, 256, (1024, 1024, 3), np.uint8)
    Image.fromarray(texels).save(tmp_path / "a.png", compress_level=1)
    (tmp_path / "scene.usda").write_text(STAGE.replace("FILE", "./a.png").replace("EXTENT", "1"))
    ends(start(tmp_path, "alone.exr", None))

    def begin():
        shutil.rmtree(tmp_path / "caches", ignore_errors=True)
        return start(tmp_path, "killed.exr", "caches")

    killed, part = stopped.while_it_writes(begin, lambda: next(tmp_path.glob("caches/texture/*.part"), None))
    other = start(tmp_path, "other.exr", "caches")
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    assert part.exists(), "it had no time to end its file"
    ends(other)
    [entry] = tmp_path.glob("caches/texture/*.tx")
    before = entry.stat().st_mtime_ns
    ends(start(tmp_path, "third.exr", "caches"))
    for name in ("other.exr", "third.exr"):
        compare.same_bits(exr.read(tmp_path / name), exr.read(tmp_path / "alone.exr"), name)
    assert [file.stat().st_mtime_ns for file in tmp_path.glob("caches/texture/*.tx")] == [before], "read, not made"
    assert list(tmp_path.glob("caches/geometry/*.oocptgeo")), "built geometry too"
