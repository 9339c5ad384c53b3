# SPDX-License-Identifier: Apache-2.0
"""Fixtures: the reading process, one for each file of tests."""

from __future__ import annotations

import os
import pathlib
import subprocess

import numpy as np
import pytest
from image_host import Reader, noise, write_exr


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> pathlib.Path:
    return tmp_path_factory.mktemp("images")


@pytest.fixture(scope="session")
def image_build() -> pathlib.Path:
    for name in ("OOCPT_BUILD", "OOCPT_HOST_PYTHON"):
        assert os.environ.get(name), f"{name} is not set: run the tests by `cargo xtask test`"
    build = pathlib.Path(os.environ["OOCPT_BUILD"])
    subprocess.run(["cmake", "--build", str(build), "--target", "oocpt_images_probe"], check=True)
    return build


@pytest.fixture(scope="module")
def reader(image_build, folder):
    write_exr(folder / "own.exr", noise((8, 8, 3), np.float16))
    reader = Reader(image_build, folder / "own.exr")
    yield reader
    reader.close()
