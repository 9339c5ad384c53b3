# SPDX-License-Identifier: Apache-2.0
"""The texture cache of a user, through real hosts: what is in it, what is taken from it, when a file is decoded
again."""

from __future__ import annotations

import os
import pathlib

import numpy as np
import pytest
import tifffile
from host import Host
from test_textures import STAGE
from PIL import Image

SIZE = (260, 260)
QUICK = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}


def texels(seed: int) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (SIZE[1], SIZE[0], 3), np.uint8)


def shown(folder: pathlib.Path, cache: str, size=SIZE):
    """A picture by a host of its own, its log, and the libraries that it loaded."""
    (folder / "scene.usda").write_text(STAGE.replace("FILE", "./a.png").replace("EXTENT", "1"))
    host = Host(folder, environment={"OOCPT_TEXTURE_CACHE": cache})
    try:
        picture = host.picture(folder / "scene.usda", size, aovs=["color", "albedo"], settings=QUICK)
        maps = pathlib.Path(f"/proc/{host.pid}/maps").read_text()
        return picture["albedo"], picture.log, "hdOocPTImages" in maps
    finally:
        host.close()


def entries(folder: pathlib.Path) -> list[pathlib.Path]:
    return sorted(folder.glob("*")) if folder.exists() else []


def says(log: str) -> list[str]:
    return [line for line in log.splitlines() if "OocPT" in line]


def test_a_file_is_decoded_by_the_first_host_alone(tmp_path):
    cache, file = tmp_path / "cache", tmp_path / "a.png"
    Image.fromarray(texels(1)).save(file)
    first, log, decodes = shown(tmp_path, str(cache))
    assert decodes and not says(log), log
    np.testing.assert_allclose(first, texels(1)[::-1] / 255.0, atol=2e-3)
    [entry] = entries(cache)
    # Another program reads it: tiles of all levels, rows from the bottom up.
    with tifffile.TiffFile(entry) as tiff:
        assert [page.shape[:2] for page in tiff.pages] == [
            (max(1, SIZE[1] >> level), max(1, SIZE[0] >> level)) for level in range(9)
        ]
        assert tiff.pages[0].is_tiled and tiff.pages[0].tags["Orientation"].value == 4
        np.testing.assert_array_equal(tiff.pages[0].asarray(), texels(1)[::-1])
        mean = tiff.pages[8].asarray().astype(float).ravel()
        np.testing.assert_allclose(mean, texels(1).mean(axis=(0, 1)), atol=2)
    # The same size and time, and nothing that could be decoded: the file is not opened.
    times = file.stat()
    file.write_bytes(b"\0" * times.st_size)
    os.utime(file, ns=(times.st_atime_ns, times.st_mtime_ns))
    second, log, decodes = shown(tmp_path, str(cache))
    assert not decodes and not says(log), log
    assert np.array_equal(first, second)


def test_a_file_that_has_changed_is_decoded_again(tmp_path):
    cache, file = tmp_path / "cache", tmp_path / "a.png"
    for seed in (1, 2):
        Image.fromarray(texels(seed)).save(file)
        albedo, _, _ = shown(tmp_path, str(cache))
        np.testing.assert_allclose(albedo, texels(seed)[::-1] / 255.0, atol=2e-3)
    assert len(entries(cache)) == 2


def test_a_damaged_entry_is_made_again(tmp_path):
    cache = tmp_path / "cache"
    Image.fromarray(texels(1)).save(tmp_path / "a.png")
    first, _, _ = shown(tmp_path, str(cache))
    [entry] = entries(cache)
    whole = entry.read_bytes()
    for damaged in (
        whole[:-1000],
        whole[:3000] + bytes([whole[3000] ^ 255]) + whole[3001:],
        b"",
        b"II+\0\x08\0\0\0" + b"\xff" * 100,
    ):
        entry.write_bytes(damaged)
        again, log, _ = shown(tmp_path, str(cache))
        assert np.array_equal(first, again) and not says(log), log
        assert entries(cache) == [entry] and entry.read_bytes() == whole


def test_distant_textures_cache_only_coarse_levels(tmp_path):
    """Of 4096 x 4096 texels, seen on 16 pixels, the cache and the host's memory have a thousandth."""
    Image.fromarray(np.tile(texels(3)[:128, :256], (32, 16, 1))).save(tmp_path / "a.png", compress_level=1)
    albedo, log, _ = shown(tmp_path, str(tmp_path / "cache"), size=(16, 16))
    np.testing.assert_allclose(albedo.mean(axis=(0, 1)), texels(3)[:128, :256].mean(axis=(0, 1)) / 255.0, atol=0.02)
    [entry] = entries(tmp_path / "cache")
    assert entry.stat().st_size < 4096 * 4096 * 3 / 100, entry.stat().st_size
    assert not says(log), log


@pytest.mark.parametrize("cache", ["0", "file/below"])
def test_without_a_cache_pictures_are_the_same(tmp_path, cache):
    """Turned off, or in a folder that cannot be made, of which one line tells."""
    Image.fromarray(texels(1)).save(tmp_path / "a.png")
    (tmp_path / "file").write_text("no folder")
    folder = cache if cache == "0" else str(tmp_path / cache)
    albedo, log, _ = shown(tmp_path, folder)
    np.testing.assert_allclose(albedo, texels(1)[::-1] / 255.0, atol=2e-3)
    assert len(says(log)) == (0 if cache == "0" else 1), log
    assert {path.name for path in tmp_path.glob("**/*.tx")} == set()
