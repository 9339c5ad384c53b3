# SPDX-License-Identifier: Apache-2.0
"""What the measured chess set adds to the asset."""

import pathlib
import sys

import numpy as np
import pytest
from pxr import Usd, UsdGeom

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent))

import chess_set

CORNERS = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
QUADS = [0, 1, 3, 2, 4, 6, 7, 5, 0, 4, 5, 1, 2, 3, 7, 6, 0, 2, 6, 4, 1, 5, 7, 3]


def test_normals_of_a_cube_point_out_of_its_corners():
    points = np.array(CORNERS, float)
    found = chess_set.smooth_normals(points, np.full(6, 4), np.array(QUADS))
    assert found == pytest.approx(points / 3**0.5), "outwards, all three faces alike"


def test_larger_faces_weigh_more():
    points = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 3), (9, 9, 9)], float)
    found = chess_set.smooth_normals(points, np.array([3, 3]), np.array([0, 1, 2, 0, 2, 3]))
    assert found[0] == pytest.approx(np.array([3, 0, 1]) / 10**0.5), "areas 1/2 towards +z, 3/2 towards +x"
    assert found[4] == pytest.approx([0, 0, 0]), "of no face"


@pytest.mark.parametrize("left_handed", [False, True])
def test_a_cage_becomes_a_plain_mesh(left_handed):
    stage = Usd.Stage.CreateInMemory()
    mesh = UsdGeom.Mesh.Define(stage, "/cube")
    mesh.GetPointsAttr().Set(CORNERS)
    mesh.GetFaceVertexCountsAttr().Set([4] * 6)
    # Left-handed faces turn the other way.
    mesh.GetFaceVertexIndicesAttr().Set(QUADS[::-1] if left_handed else QUADS)
    if left_handed:
        mesh.GetOrientationAttr().Set(UsdGeom.Tokens.leftHanded)
    chess_set.make_plain(mesh)
    assert mesh.GetSubdivisionSchemeAttr().Get() == UsdGeom.Tokens.none
    assert mesh.GetNormalsInterpolation() == UsdGeom.Tokens.vertex
    assert np.array(mesh.GetNormalsAttr().Get()) == pytest.approx(np.array(CORNERS) / 3**0.5)


def test_the_view_is_wide_and_looks_at_the_board():
    stage = Usd.Stage.CreateInMemory()
    chess_set._add_view(stage)
    camera = UsdGeom.Camera(stage.GetPrimAtPath("/World/Camera")).GetCamera(Usd.TimeCode.Default())
    assert camera.horizontalAperture / camera.verticalAperture == pytest.approx(16 / 9)
    at = camera.frustum.ComputeViewMatrix().Transform(chess_set.TARGET)
    assert (at[0], at[1]) == pytest.approx((0, 0), abs=1e-9) and at[2] < 0, "the target is in the middle, in front"
