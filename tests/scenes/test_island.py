# SPDX-License-Identifier: Apache-2.0
"""`oocpt scene island` writes a stage that opens, holds exactly what was asked for, and says in one sentence what is
missing."""

import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from pxr import Usd, UsdGeom, UsdLux, UsdRender

import island

REPO = pathlib.Path(__file__).resolve().parents[2]
QUADS = 20_000


@pytest.fixture(scope="session")
def oocpt():
    """Runs the program of this checkout: the one that `cargo xtask test` built, else built here with its profile."""
    built = os.environ.get("OOCPT_CLI")
    base = (
        [built]
        if built
        else [
            "cargo", "run", "--quiet", "--locked", "--profile", "fast", "--package", "oocpt-cli", "--bin", "oocpt",
            "--",
        ]
    )

    def run(*arguments, python=sys.executable):
        environment = {**os.environ, "OOCPT_USD_PYTHON": str(python), "RUST_BACKTRACE": "0"}
        return subprocess.run(
            base + list(arguments), cwd=REPO, env=environment, capture_output=True, text=True, timeout=1800
        )

    return run


def stage_of(oocpt, path, *options):
    done = oocpt("scene", "island", "--instances", "20000", "--unique-quads", str(QUADS), "--out", str(path), *options)
    assert done.returncode == 0, done.stderr
    return Usd.Stage.Open(str(path))


def test_a_scene_may_ask_for_a_report(oocpt, tmp_path):
    stage = stage_of(oocpt, tmp_path / "asks.usdc", "--report", "error of it.jsonl")
    settings = stage.GetPrimAtPath(stage.GetMetadata("renderSettingsPrimPath"))
    assert settings.IsA(UsdRender.Settings) and settings.GetAttribute("oocpt:report").Get() == "error of it.jsonl"
    assert not stage_of(oocpt, tmp_path / "plain.usdc").HasAuthoredMetadata(
        "renderSettingsPrimPath"
    ), "only when asked for"


@pytest.mark.parametrize(
    "options, copies",
    [((), 1), (("--flatten",), 1), (("--copies", "3"), 3), (("--copies", "3", "--flatten"), 3)],
    ids=["nested", "flat", "copies", "flat_copies"],
)
def test_island_has_the_counts_asked_for(oocpt, tmp_path, options, copies):
    stage = stage_of(oocpt, tmp_path / "island.usdc", *options)
    assert island.count_instances(stage) == 20_000 * copies + 1, "every copy's meshes, and the ocean"
    meshes = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    assert sum(len(mesh.GetFaceVertexCountsAttr().Get()) for mesh in meshes) == QUADS
    for mesh in meshes:
        points = np.array(mesh.GetPointsAttr().Get())
        indices = np.array(mesh.GetFaceVertexIndicesAttr().Get())
        assert np.isfinite(points).all() and indices.min() >= 0 and indices.max() < len(points), str(mesh.GetPath())
    instancers = [UsdGeom.PointInstancer(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.PointInstancer)]
    for instancer in instancers:
        kinds = instancer.GetProtoIndicesAttr().Get()
        if kinds:
            transforms = np.array(instancer.ComputeInstanceTransformsAtTime(0, 0))
            assert len(transforms) == len(kinds) and np.isfinite(transforms).all(), str(instancer.GetPath())
    is_nested = any(
        str(target).rsplit("/", 1)[-1].startswith("grove")
        for i in instancers
        for target in i.GetPrototypesRel().GetTargets()
    )
    assert is_nested == ("--flatten" not in options)


def test_island_can_be_seen(oocpt, tmp_path):
    stage = stage_of(oocpt, tmp_path / "island.usdc")
    assert stage.GetDefaultPrim().GetPath() == "/World"
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera()
    terrain = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Island/Unique/Terrain"))
    points = np.array(terrain.GetPointsAttr().Get(), dtype=np.float64)
    view = np.array(camera.transform.GetInverse())
    seen = np.hstack([points, np.ones((len(points), 1))]) @ view
    ahead = -seen[:, 2]
    inside = (ahead > 0) & (
        np.abs(seen[:, 0]) < ahead * np.tan(np.radians(camera.GetFieldOfView(camera.FOVHorizontal) / 2))
    )
    assert inside.mean() > 0.25, "the camera looks at the island"
    eye = np.array(camera.transform.ExtractTranslation())
    assert 1.0 < eye[1] < 6.0, "from the height of a person"
    assert stage.GetPrimAtPath("/World/Sky").IsA(UsdLux.DomeLight) and stage.GetPrimAtPath("/World/Sun").IsA(
        UsdLux.DistantLight
    )


def test_same_arguments_same_stage(oocpt, tmp_path):
    # Held: a layer of a stage that is gone is gone too.
    stages = [stage_of(oocpt, tmp_path / f"{name}.usdc") for name in "ab"]
    texts = [stage.GetRootLayer().ExportToString() for stage in stages]
    assert texts[0] == texts[1]


def test_a_missing_python_gives_one_sentence(oocpt, tmp_path):
    done = oocpt("scene", "island", "--out", str(tmp_path / "x.usdc"), python="")
    assert done.returncode == 1 and not (tmp_path / "x.usdc").exists()
    assert "set OOCPT_USD_PYTHON" in done.stderr and len(done.stderr.strip().splitlines()) == 1, done.stderr


def test_nonsense_is_refused(oocpt, tmp_path):
    done = oocpt("scene", "island", "--instances", "3", "--out", str(tmp_path / "x.usdc"))
    assert done.returncode == 1 and "--instances: 10 000 to" in done.stderr, done.stderr
