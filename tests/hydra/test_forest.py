# SPDX-License-Identifier: Apache-2.0
"""A small forest from the generator of the main job, through Hydra: nested instancers as they are meant to be used."""

import numpy as np
import pytest

import compare
import forest

INSTANCES = 4000
SETTINGS = {"oocpt:samplesPerPixel": 2, "oocpt:maxBounces": 2}


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("forest") / "forest.usdc"
    forest.build(str(path), instances=INSTANCES, terrain=32)
    return path


def test_forest(host, scene):
    aovs = ["color", "cameraDepth", "primId", "instanceId", "elementId"]
    with host.open(scene, (64, 36), aovs=aovs, settings=SETTINGS) as view:
        picture, stats = view.render(), view.stats()
        hit = picture["primId"] >= 0
        pairs = sorted({(int(a), int(b)) for a, b in zip(picture["primId"][hit], picture["instanceId"][hit])})
        decoded = view.decode(pairs)
    assert stats["oocpt:instances"] == INSTANCES + 4, "every plant once, terrain and three ridges"
    assert stats["oocpt:dropped"] == 0, stats["oocpt:droppedData"]
    assert np.isfinite(picture["color"]).all() and hit.mean() > 0.4
    assert all(answer is not None for answer in decoded), "every pixel leads to a prim"
    paths = {answer["prim"] for answer in decoded}
    assert (
        "/World/Terrain" in paths and sum(path.startswith("/World/Groves/Prototypes/") for path in paths) >= 8
    ), sorted(paths)
    nested = [answer for answer in decoded if any("/Clumps/" in path for path, _ in answer["levels"])]
    assert nested and all(
        "/World/Groves" in {path for path, _ in answer["levels"]} for answer in nested
    ), "clumps stand in groves"


def test_both_front_ends_show_the_same_forest(pool, scene):
    """Up to rounding: UsdImaging converts a camera's aperture in f32 in one front end and in f64 in the other."""
    aovs = ["color", "cameraDepth", "elementId"]
    legacy, modern = (
        pool.get(mode).picture(scene, (64, 36), aovs=aovs, settings=SETTINGS) for mode in ("legacy", "scene_index")
    )
    assert (legacy["elementId"] == modern["elementId"]).mean() > 0.995, "faces"
    close = np.isclose(legacy["cameraDepth"], modern["cameraDepth"], rtol=1e-5) & np.isclose(
        legacy["color"], modern["color"], rtol=1e-3, atol=1e-4
    ).all(axis=-1)
    assert close.mean() > 0.97, f"{100 * (1 - close.mean()):.1f} % of the pixels differ by more than rounding"
    compare.near(legacy["color"].mean(axis=(0, 1)), modern["color"].mean(axis=(0, 1)), 1e-3, "means")
