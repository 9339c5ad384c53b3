# SPDX-License-Identifier: Apache-2.0
"""Blender for these tests. The wheel that the host's libraries come from is a whole Blender; it is unpacked, without
what no test needs, and removed."""

import os
import pathlib
import shutil
import zipfile

import pytest

# Kernels of GPUs, fonts, translations, brushes: 200 MB.
NOT_NEEDED = ("/addons_core/cycles/lib/", "/datafiles/fonts/Noto", "/datafiles/locale/", "/datafiles/assets/")


@pytest.fixture(scope="session")
def blender(tmp_path_factory):
    """The folder of Blender's Python module."""
    root = pathlib.Path(os.environ["OOCPT_HOST_ROOT"])
    (installed,) = (root / "python").glob("bpy-*.dist-info")
    (wheel,) = (root.parent / "downloads").glob(f"{installed.stem}-*.whl")
    folder = tmp_path_factory.mktemp("blender")
    with zipfile.ZipFile(wheel) as archive:
        wanted = [name for name in archive.namelist() if not any(part in name for part in NOT_NEEDED)]
        archive.extractall(folder, wanted)
    yield folder
    shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def variables():
    """The environment of a user who has nothing set for OocPT."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("PXR_", "PYTHONPATH", "LD_LIB"))}
    return {**kept, "OOCPT_VALIDATION": "0"}
