# SPDX-License-Identifier: Apache-2.0
"""oocpt-texture-file, which `oocpt bench texture-files` writes and decodes its files with: what it writes is read by
other programs."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess

import numpy as np
import OpenEXR
import pytest
from PIL import Image

SIZE = 96


def call(*words) -> subprocess.CompletedProcess:
    tool = pathlib.Path(os.environ["OOCPT_BUILD"]) / "bin/oocpt-texture-file"
    return subprocess.run([str(tool), *map(str, words)], capture_output=True, text=True, timeout=60)


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> dict[str, pathlib.Path]:
    folder = tmp_path_factory.mktemp("files")
    paths = {end: folder / f"a.{end}" for end in ("png", "tif", "jpg", "exr")}
    for path in paths.values():
        done = call("write", SIZE, 1001, path)
        assert done.returncode == 0 and json.loads(done.stdout)["seconds"] > 0, done
    return paths


def test_all_kinds_hold_the_same_picture(files):
    png = np.asarray(Image.open(files["png"])).astype(float)
    assert png.shape == (SIZE, SIZE, 3)
    np.testing.assert_array_equal(png, np.asarray(Image.open(files["tif"])))
    assert (
        np.abs(png - np.asarray(Image.open(files["jpg"]))).mean() < 12
    ), "within the loss of quality 92 and halved color"
    exr = OpenEXR.File(str(files["exr"])).channels()["RGB"].pixels
    assert exr.dtype == np.float16
    assert (
        np.abs(png / 255 - np.sqrt(exr.astype(float))).max() < 0.003
    ), "its square, within half a step of 8 bits and of half floats"


def test_the_written_texture_is_deterministic_noise(files, tmp_path):
    png = np.asarray(Image.open(files["png"]))
    assert png.std() > 20 and files["png"].stat().st_size > png.size * 0.3, "it does not compress to nothing"
    assert call("write", SIZE, 1001, tmp_path / "again.png").returncode == 0
    np.testing.assert_array_equal(np.asarray(Image.open(tmp_path / "again.png")), png)
    assert call("write", SIZE, 1002, tmp_path / "other.png").returncode == 0
    assert (np.asarray(Image.open(tmp_path / "other.png")) != png).mean() > 0.9, "another seed, another picture"


@pytest.mark.parametrize("threads", [0, 1, 3])
def test_it_decodes_each_file(files, tmp_path, threads):
    done = call("read", threads, *files.values())
    assert done.returncode == 0 and json.loads(done.stdout)["seconds"] > 0, done
    cut = tmp_path / "cut.png"
    cut.write_bytes(files["png"].read_bytes()[:2000])
    failed = call("read", threads, files["tif"], cut, files["exr"])
    assert failed.returncode == 1 and "cut.png" in failed.stderr and not failed.stdout, "one that ends early fails all"


@pytest.mark.parametrize(
    "words",
    [[], ["write", 3, 1, "a.png"], ["write", 8, "x", "a.png"], ["read", 0], ["read", -1, "a"], ["read", "1x", "a"]],
)
def test_bad_arguments_are_refused(words):
    done = call(*words)
    assert done.returncode == 2 and done.stderr.startswith("usage:"), done


def test_failures_give_one_line(tmp_path):
    for words in (
        ["write", 8, 1, tmp_path / "a.txt"],
        ["write", 8, 1, tmp_path / "none/a.png"],
        ["read", 1, tmp_path / "none.png"],
    ):
        done = call(*words)
        assert done.returncode == 1 and str(words[-1]) in done.stderr and len(done.stderr.splitlines()) == 1, done
