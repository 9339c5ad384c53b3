# SPDX-License-Identifier: Apache-2.0
"""The committed scenes are what small.py writes, parse, and hold what the other tests take for granted; so does the
forest."""

import math

import numpy as np
import pytest
from pxr import Usd, UsdGeom

import forest
import small


@pytest.mark.parametrize("scene", small.SCENES, ids=lambda scene: scene.__name__)
def test_committed_scene_is_current(scene):
    path = small.FOLDER / f"{scene.__name__}.usda"
    assert path.read_text() == small.text(scene), f"run {small.__file__}"
    assert Usd.Stage.Open(str(path)).GetDefaultPrim().GetPath() == "/World"


def test_no_other_files_are_committed():
    assert {path.stem for path in small.FOLDER.glob("*")} == {scene.__name__ for scene in small.SCENES}


def test_bad_numbers_survive_the_file():
    stage = Usd.Stage.Open(str(small.FOLDER / "bad_data.usda"))
    assert math.isnan(UsdGeom.Mesh(stage.GetPrimAtPath("/World/NanPoint")).GetPointsAttr().Get()[3][0])
    assert math.isinf(UsdGeom.Mesh(stage.GetPrimAtPath("/World/InfPoint")).GetPointsAttr().Get()[3][0])
    assert all(stage.GetPrimAtPath(f"/World/{name}") for name in small.BAD_PRIMS)


def test_forest_is_as_large_as_asked_and_the_same_twice(tmp_path):
    stages = [forest.build(str(tmp_path / f"{name}.usdc"), instances=3000, terrain=16, seed=5) for name in "ab"]
    texts = [stage.GetRootLayer().ExportToString() for stage in stages]
    assert texts[0] == texts[1], "same arguments, same scene"
    stage = stages[0]
    assert forest.count_instances(stage) == 3000
    meshes = stage.GetPrimAtPath("/World/Groves/Prototypes").GetChildren()
    assert len(meshes) == 16 and all(mesh.IsA(UsdGeom.Mesh) for mesh in meshes)
    terrain = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Terrain"))
    assert len(terrain.GetFaceVertexCountsAttr().Get()) == 16 * 16
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.PointInstancer):
            kinds = np.array(UsdGeom.PointInstancer(prim).GetProtoIndicesAttr().Get())
            transforms = np.array(UsdGeom.PointInstancer(prim).ComputeInstanceTransformsAtTime(0, 0))
            assert len(transforms) == len(kinds) and np.isfinite(transforms).all(), str(prim.GetPath())
            used = len(UsdGeom.PointInstancer(prim).GetPrototypesRel().GetTargets())
            assert kinds.min() >= 0 and kinds.max() < used, str(prim.GetPath())


def test_forest_plants_stand_on_the_ground(tmp_path):
    stage = forest.build(str(tmp_path / "f.usdc"), instances=3000, terrain=16, seed=5)
    land = forest.Land(5)
    for path in ("/World/Groves", "/World/Trees"):
        places = np.array(UsdGeom.PointInstancer(stage.GetPrimAtPath(path)).GetPositionsAttr().Get(), dtype=np.float64)
        above = places[:, 1] - land.height(places[:, 0], places[:, 2])
        assert -2.0 < above.min() and above.max() <= 0.0, f"{path}: {above.min()} to {above.max()} m above ground"


def test_forest_refuses_nonsense(tmp_path):
    with pytest.raises(ValueError, match="at least"):
        forest.build(str(tmp_path / "f.usdc"), instances=1)
