# SPDX-License-Identifier: Apache-2.0
"""The committed feature scenes and their pictures are what features.py writes; references belong to the scenes they lie
beside; writers of pictures write what they say."""

import hashlib
import json
import zipfile

import images
import numpy as np
import pytest
from PIL import Image

import feature_references
import features


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    folder = tmp_path_factory.mktemp("features")
    for scene in features.SCENES:
        features.write(scene, folder)
    return folder


def content(path):
    """What a file holds; a package's members without the time that stands in it."""
    if path.suffix != ".usdz":
        return path.read_bytes()
    with zipfile.ZipFile(path) as package:
        return {name: package.read(name) for name in package.namelist()}


def test_committed_files_are_current(written):
    listed = lambda root: {
        path.relative_to(root) for path in root.rglob("*") if path.is_file() and path.suffix != ".json"
    }
    assert listed(written) == listed(features.FOLDER), f"run {features.__file__}"
    stale = [
        str(path) for path in sorted(listed(written)) if content(written / path) != content(features.FOLDER / path)
    ]
    assert not stale, f"run {features.__file__}: {stale}"


@pytest.mark.parametrize("scene", feature_references.SCENES, ids=lambda scene: scene.__name__)
def test_references_were_made_from_the_committed_scene(scene):
    path = features.FOLDER / f"{scene.__name__}.usda"
    reference = json.loads(path.with_suffix(".json").read_text())
    assert reference["sha256"] == hashlib.sha256(path.read_bytes()).hexdigest(), "run `cargo xtask reference`"
    mean, error = np.array(reference["mean"]), np.array(reference["error"])
    columns, rows = feature_references.BLOCKS
    assert mean.shape == error.shape == (rows, columns, 3) and (mean > 0).all()
    assert (error < 0.004 * mean).all(), "references are converged to 0.4 %"


def test_png_is_read_back(tmp_path):
    random = np.random.default_rng(1)
    for shape, mode in (((5, 7), "L"), ((5, 7, 2), "LA"), ((5, 7, 3), "RGB"), ((5, 7, 4), "RGBA")):
        values = random.integers(0, 256, shape, dtype=np.uint8)
        for packed in (False, True):
            images.png(tmp_path / "a.png", values, packed)
            with Image.open(tmp_path / "a.png") as read:
                assert read.mode == mode and (np.array(read) == values).all(), f"{mode}, packed {packed}"
    deep = random.integers(0, 65536, (5, 7), dtype=np.uint16)
    images.png(tmp_path / "b.png", deep)
    with Image.open(tmp_path / "b.png") as read:
        assert (np.array(read) == deep).all(), "16 bits"


def test_exr_and_hdr_are_read_back(tmp_path):
    import OpenEXR

    values = np.random.default_rng(2).uniform(0, 50, (4, 6, 3)).astype(np.float32)
    images.exr(tmp_path / "a.exr", values)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert all((file.channels()[name].pixels == values[..., index]).all() for index, name in enumerate("RGB"))
    values[0, 0] = 0
    images.hdr(tmp_path / "a.hdr", values)
    data = (tmp_path / "a.hdr").read_bytes()
    texels = np.frombuffer(data[-4 * 24 :], np.uint8).reshape(4, 6, 4).astype(np.float64)
    decoded = texels[..., :3] * 2.0 ** (texels[..., 3:] - 136) * (texels[..., 3:] > 0)
    assert (
        np.abs(decoded - values) <= values.max(axis=2, keepdims=True) / 128
    ).all(), "eight bits of the largest channel"
