# SPDX-License-Identifier: Apache-2.0
"""How many time codes of a stage make a second, in hosts whose front end does not say it: found by the layers that are
loaded. A card goes 24 units a second while half a time code passes, to the right, from x = 1 to x = 1.2 + 12 / rate."""

from __future__ import annotations

import os
import subprocess

import numpy as np
import pytest

import exr

CAMERA = """
def Camera "Cam" {
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 10
    double shutter:open = 0
    double shutter:close = 0.5
    double3 xformOp:translate = (2, 0.5, 20)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
"""
CARD = """
def Mesh "Card" {
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(1, 0, 0), (1.2, 0, 0), (1.2, 1, 0), (1, 1, 0)]
    vector3f[] velocities = [(24, 0, 0), (24, 0, 0), (24, 0, 0), (24, 0, 0)]
}
"""
SETTINGS = {"oocpt:samplesPerPixel": 64, "oocpt:maxBounces": 0}
DISAGREE = "its layers disagree"


def layer(metadata: str, content: str) -> str:
    return f'#usda 1.0\n(\n    upAxis = "Y"\n    {metadata}\n)\n{content}'


def referring(path: str) -> str:
    return f'def Xform "World" (\n    references = @{path}@</Asset>\n) {{\n}}\n'


def asset(content: str) -> str:
    return f'def Xform "Asset" {{\n{content}\n}}\n'


def rate_by(alpha) -> float:
    """Time codes a second by how far the card gets: the mean of its centre is 1.1 + 6 / rate."""
    columns = np.asarray(alpha, dtype=np.float64).mean(axis=0)
    center = float((columns * (np.arange(columns.size) + 0.5)).sum() / columns.sum() * 4 / columns.size)
    return 6.0 / (center - 1.1)


def rate_of(view) -> tuple[float, str]:
    """Of a picture, and the log."""
    picture = view.render()
    return rate_by(picture["color"][..., 3]), picture.log


def opened(host, stage, camera="/Cam"):
    return host.open(stage, (80, 20), camera=camera, settings=SETTINGS)


@pytest.mark.parametrize(
    ("metadata", "rate"),
    [
        ("timeCodesPerSecond = 48", 48), ("framesPerSecond = 48", 48), ("", 24),
        ("timeCodesPerSecond = 12\n framesPerSecond = 60", 12),
    ],
)  # fmt: skip
def test_the_root_layer_sets_the_rate(host, tmp_path, metadata, rate):
    """As UsdStage has it; a sublayer and an asset of other rates change nothing."""
    (tmp_path / "below.usda").write_text(layer("timeCodesPerSecond = 30", CARD))
    (tmp_path / "asset.usda").write_text(layer("timeCodesPerSecond = 60", asset("")))
    path = tmp_path / "root.usda"
    path.write_text(layer(metadata + "\n subLayers = [@./below.usda@]", CAMERA + referring("./asset.usda")))
    with opened(host, path) as view:
        found, log = rate_of(view)
    assert found == pytest.approx(rate, rel=0.02)
    assert DISAGREE not in log


def test_the_root_layer_sets_the_rate_of_referenced_prims(host, tmp_path):
    """The camera, too."""
    (tmp_path / "asset.usda").write_text(layer("timeCodesPerSecond = 60", asset(CAMERA + CARD)))
    path = tmp_path / "root.usda"
    path.write_text(layer("timeCodesPerSecond = 48", referring("./asset.usda")))
    with opened(host, path, camera="/World/Cam") as view:
        found, log = rate_of(view)
    assert found == pytest.approx(48, rel=0.02)
    assert DISAGREE not in log


def test_other_open_stages_do_not_change_the_rate(host, tmp_path):
    """One of other prims does no harm; one of the same prims cannot be told apart, which is said."""
    path, other, like = tmp_path / "root.usda", tmp_path / "other.usda", tmp_path / "like.usda"
    path.write_text(layer("timeCodesPerSecond = 48", CAMERA + CARD))
    other.write_text(layer("timeCodesPerSecond = 12", 'def Xform "Else" {\n}\n'))
    like.write_text(layer("timeCodesPerSecond = 12", CAMERA))
    with opened(host, path) as view:
        view.edit(f"view.other = Usd.Stage.Open({str(other)!r})")
        found, log = rate_of(view)
        assert found == pytest.approx(48, rel=0.02)
        assert DISAGREE not in log
        view.edit(f"view.other = Usd.Stage.Open({str(like)!r})")
        found, log = rate_of(view)
        assert found == pytest.approx(48 if host.scene_index else 24, rel=0.02)
        assert (DISAGREE in log) != host.scene_index, log


def test_editing_the_rate_updates_the_shutter(host):
    """The rate is changed while the stage is on show. (The scene indices of hosts keep the first: they have no word for
    it.)"""
    with opened(host, layer("timeCodesPerSecond = 48", CAMERA + CARD)) as view:
        assert rate_of(view)[0] == pytest.approx(48, rel=0.02)
        view.edit("stage.SetTimeCodesPerSecond(30)")
        assert host.scene_index or rate_of(view)[0] == pytest.approx(30, rel=0.02)


@pytest.mark.parametrize("scene_index", ["0", "1"])
def test_usdrecord_passes_the_rate_of_its_stage(tmp_path, scene_index):
    """usdrecord tells the rate of its stage: that of the session layer, which the layers alone do not settle."""
    root, session, out = tmp_path / "root.usda", tmp_path / "session.usda", tmp_path / "out.exr"
    root.write_text(layer("timeCodesPerSecond = 48", CAMERA + CARD))
    session.write_text(layer("timeCodesPerSecond = 12", 'over "Card" {\n}\n'))
    variables = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=scene_index, OOCPT_SAMPLES_PER_PIXEL="64")
    variables.pop("PYTHONPATH", None)
    command = ["usdrecord", "--renderer", "OocPT", "--disableCameraLight", "--imageWidth", "80", "--camera", "/Cam"]
    done = subprocess.run(
        [*command, "--sessionLayer", str(session), str(root), str(out)],
        env=variables, capture_output=True, text=True, timeout=120, check=True, start_new_session=True,
    )  # fmt: skip
    assert DISAGREE not in done.stderr
    assert rate_by(exr.read(out)[..., 3]) == pytest.approx(12, rel=0.02)
