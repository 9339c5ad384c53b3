# SPDX-License-Identifier: Apache-2.0
"""Compiled passes are kept from run to run, wherever the user says; what is damaged or foreign there does not show."""

from __future__ import annotations

import os
import pathlib
import subprocess

import pytest
import small


def record(folder: pathlib.Path, out: pathlib.Path, **environment: str) -> bytes:
    """The picture of a run of `usdrecord`, which has nothing to say."""
    variables = {**os.environ, "XDG_CACHE_HOME": str(folder / "user"), "OOCPT_SAMPLES_PER_PIXEL": "1", **environment}
    arguments = ["--renderer", "OocPT", "--imageWidth", "16", "--camera", "Camera", "--disableCameraLight"]
    run = subprocess.run(
        ["usdrecord", *arguments, str(small.FOLDER / "nested.usda"), str(out)],
        capture_output=True, text=True, env=variables, timeout=180,
    )  # fmt: skip
    assert run.returncode == 0 and "warning" not in run.stdout + run.stderr, run.stdout + run.stderr
    return out.read_bytes()


def kept(folder: pathlib.Path) -> list[pathlib.Path]:
    return sorted(folder.rglob("*")) if folder.is_dir() else []


@pytest.mark.parametrize("place", ["named", "user's own", "none"])
def test_compiled_passes_are_stored_in_the_users_folder(tmp_path, place):
    """In the folder of the setting, else in the user's cache folder; with `0` nowhere."""
    named = tmp_path / "named"
    value = {"named": str(named), "user's own": "", "none": "0"}[place]
    record(tmp_path, tmp_path / "out.png", OOCPT_PIPELINE_CACHE=value)
    own = tmp_path / "user" / "oocpt" / "pipelines"
    found = {"named": kept(named), "user's own": kept(own), "none": []}
    assert [len(found[name]) for name in ("named", "user's own")] == [
        int(place == "named"), int(place == "user's own")
    ]  # fmt: skip
    for path in found[place]:
        assert path.stat().st_size > 16, "at least what Vulkan's header has"


@pytest.mark.parametrize("damage", ["cut", "noise", "zeros", "huge", "folder"])
def test_a_damaged_file_does_not_show(tmp_path, damage):
    """The picture is the same, nothing is said, and the file is whole again."""
    folder = tmp_path / "named"
    first = record(tmp_path, tmp_path / "first.png", OOCPT_PIPELINE_CACHE=str(folder))
    (path,) = kept(folder)
    whole = path.read_bytes()
    if damage == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "noise":
        path.write_bytes(bytes((7 * i) % 256 for i in range(len(whole))))
    elif damage == "zeros":
        path.write_bytes(bytes(len(whole)))
    elif damage == "huge":
        os.truncate(path, 1 << 40)
    else:
        path.unlink()
        path.mkdir()
    again = record(tmp_path, tmp_path / "again.png", OOCPT_PIPELINE_CACHE=str(folder))
    assert again == first, "the same picture"
    if damage != "folder":
        assert path.read_bytes()[:4] == whole[:4] and path.stat().st_size < 1 << 27, "it is whole again"
