# SPDX-License-Identifier: Apache-2.0
"""The small scene of damaged prims, and which of them have to be named in a warning."""

from __future__ import annotations

import math

from pxr import Gf, UsdGeom, UsdLux, Vt

from parts import dome, instancer, mesh, orthographic, quad


def bad_data(stage):
    """One fault per prim beside one good square; every fault must give a warning with the prim's path, and the square
    must be seen."""
    nan, inf = math.nan, math.inf
    square = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]
    quad(stage, "/World/Good", 1.0, (0.2, 0.8, 0.2))
    fault = lambda name, *args: mesh(stage, f"/World/{name}", *args, (0.9, 0.1, 0.1))
    fault("NanPoint", square[:3] + [(nan, 0.5, 0)], [4], range(4))
    fault("InfPoint", square[:3] + [(inf, 0.5, 0)], [4], range(4))
    fault("IndexPastEnd", square, [4], [0, 1, 2, 9])
    fault("NegativeIndex", square, [4], [0, 1, 2, -1])
    fault("CountsPastEnd", square, [4, 4], [0, 1, 2, 3])
    fault("NegativeCount", square, [-4], [0, 1, 2, 3])
    fault("TinyFace", square, [2, 1], [0, 1, 2])
    fault("NoFaces", square, [], [])
    fault("NoPoints", [], [4], [0, 1, 2, 3])
    fault("ZeroArea", [(0, 0, 0)] * 4, [4], range(4))
    fault("Collinear", [(0, 0, 0), (1, 0, 0), (2, 0, 0)], [3], range(3))
    fault("HugeIndex", square, [4], [0, 1, 2, 2**31 - 1])
    fault("HoleOutOfRange", square, [4], range(4)).CreateHoleIndicesAttr(Vt.IntArray([7]))
    short = fault("ShortColors", square, [4], range(4))
    short.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(Vt.Vec3fArray([Gf.Vec3f(1, 0, 0)] * 2))
    for name, color in (("NanColor", nan), ("NegativeColor", -3.0)):
        fault(name, square, [4], range(4)).CreateDisplayColorPrimvar(UsdGeom.Tokens.constant).Set(
            Vt.Vec3fArray([Gf.Vec3f(color, 0.5, 0.5)])
        )
    fault("NanOpacity", square, [4], range(4)).CreateDisplayOpacityPrimvar(UsdGeom.Tokens.constant).Set(
        Vt.FloatArray([nan])
    )
    singular = fault("SingularTransform", square, [4], range(4))
    singular.AddScaleOp().Set(Gf.Vec3f(1, 0, 1))
    broken = fault("NanTransform", square, [4], range(4))
    broken.AddTranslateOp().Set(Gf.Vec3d(nan, 0, 0))
    for index, prim in enumerate(
        child
        for child in stage.GetPrimAtPath("/World").GetChildren()
        if child.GetName() not in ("Good", "NanTransform")
    ):
        # Below the good square, out of its way, in a row.
        ops = UsdGeom.Xformable(prim)
        op = ops.AddTranslateOp(opSuffix="row")
        op.Set(Gf.Vec3d(0.2 * index - 2, -1.5, 0))
    instancer(
        stage, "/World/Swarm", ["/World/Swarm/Quad"], [0] * 4,
        [(nan, 0, 0), (-1.2, 1.2, 0), (0, 1.2, 0), (1.2, 1.2, 0)],
        scales=[(1, 1, 1), (0.5, 0.5, 0.5), (0, 0, 0), (0.5, inf, 0.5)],
    )
    quad(stage, "/World/Swarm/Quad", 1.0, (0.2, 0.2, 0.9))
    light = UsdLux.DistantLight.Define(stage, "/World/NanLight")
    light.CreateIntensityAttr(nan)
    dome(stage)
    orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 4.0)


BAD_PRIMS = {
    # Prims of bad_data that must be named in a warning. Not NegativeColor: negative colours are taken as 0, which loses
    # nothing.
    "NanPoint", "InfPoint", "IndexPastEnd", "NegativeIndex", "CountsPastEnd", "NegativeCount", "TinyFace", "NoFaces",
    "NoPoints", "ZeroArea", "Collinear", "HugeIndex", "HoleOutOfRange", "ShortColors", "NanColor", "NanOpacity",
    "SingularTransform", "NanTransform", "Swarm", "NanLight",
}  # fmt: skip
