# SPDX-License-Identifier: Apache-2.0
"""Blender as a host, headless, through a bare engine: principled materials, instances, both ways in which it exports
its scene."""

import os
import pathlib
import subprocess

import numpy as np
import pytest

import compare

SCENE = pathlib.Path(__file__).resolve().parent / "scene.py"


@pytest.mark.parametrize("method", ["HYDRA", "USD"])
def test_blender_renders(blender, variables, tmp_path, method):
    output = tmp_path / "picture.npy"
    variables = {**variables, "PXR_MTLX_STDLIB_SEARCH_PATHS": str(blender / "bpy/lib/materialx/libraries")}
    command = [os.environ["OOCPT_HOST_PYTHON"], "-W", "ignore", str(SCENE)]
    resources = os.environ["PXR_PLUGINPATH_NAME"].split(":")[0]
    command += [str(blender), resources, str(output), method]
    done = subprocess.run(
        command, env=variables, capture_output=True, text=True, timeout=300, start_new_session=True
    )
    assert done.returncode == 0 and output.exists(), f"{done.returncode}: {done.stdout[-2000:]}{done.stderr[-2000:]}"
    image = np.load(output)[..., :3]
    # 96 pixels are 6 units: spheres at x = -2, 0, 2, y = 1, cubes at y = -1.
    red, glow, glass = (image[40:44, 16 * (x + 3) - 2 : 16 * (x + 3) + 2].mean(axis=(0, 1)) for x in (-2, 0, 2))
    assert red[0] > 4 * red[1] and 0.2 < red[0] < 0.6, f"red: {red}"
    compare.near(glow, (0, 1, 0), 0.05, "what glows")
    compare.near(glass, (0.5, 0.5, 0.5), 0.05, "the sky through glass")
    row = image[15:17]
    cubes = np.array([row[:, 4 + 8 * k].mean(axis=0) for k in range(12)])
    assert (cubes[:, 2] > 4 * cubes[:, 0]).all() and (cubes[:, 2] > 0.2).all(), f"cubes: {cubes}"
    gaps = np.array([row[:, 8 + 8 * k].mean(axis=0) for k in range(11)])
    compare.near(gaps, 0.5, 1e-3, "the sky between the cubes")
    # It asks without pause, tens of thousands of times a second, and copies all images in between. The first 64 times
    # it gets an answer at once, and again where it had to wait for locks meanwhile, as beside other tests.
    polls = np.load(f"{output}.polls.npy")
    assert 1 <= len(polls) <= 4 * 64 + (polls[-1] - polls[0]) / 0.045, f"{len(polls)} in {polls[-1] - polls[0]} s"
