# SPDX-License-Identifier: Apache-2.0
"""What Hydra's own filters make of NURBS and tetrahedral meshes, through both front ends, against planes and
splines."""

from __future__ import annotations

import numpy as np
from pxr import Gf, UsdGeom

import small
from test_curves_and_points import agree, pixels, seen

CORNERS = np.array([(-1.2, -1.0, 0.0), (1.1, -0.9, 0.2), (0.1, 1.2, -0.1), (0.0, 0.0, 1.3), (0.3, 0.1, -1.0)])


def plane(x, y, corners):
    """z of the plane through three corners where they cover a pixel, NaN elsewhere."""
    a, b, c = corners
    area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    s = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area
    t = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area
    z = a[2] + s * (b[2] - a[2]) + t * (c[2] - a[2])
    return np.where((s >= 0) & (t >= 0) & (s + t <= 1), z, np.nan)


def test_two_tetrahedra_are_their_surface(host):
    def build(stage):
        tets = UsdGeom.TetMesh.Define(stage, "/World/Tets")
        tets.CreatePointsAttr([Gf.Vec3f(*map(float, corner)) for corner in CORNERS])
        tets.CreateTetVertexIndicesAttr([Gf.Vec4i(0, 1, 2, 3), Gf.Vec4i(0, 2, 1, 4)])
        tets.CreateSurfaceFaceVertexIndicesAttr(UsdGeom.TetMesh.ComputeSurfaceFaces(tets))

    x, y = pixels()
    picture = seen(host, build)
    front = np.fmax.reduce([plane(x, y, CORNERS[list(face)]) for face in ((0, 1, 3), (1, 2, 3), (2, 0, 3))])
    if not host.scene_index:
        # The old front end hands over a subdivision surface, whose limit is inside, and not what it was.
        on = picture["primId"] >= 0
        assert 300 < on.sum() and not (on & np.isnan(front)).any()
        return
    agree(picture, front, "tetrahedra")
    assert np.unique(picture["elementId"][picture["primId"] >= 0]).size == 3, "the face between them is inside"


def test_a_bicubic_patch(host):
    """Its knots are whole numbers, so the subdivision surface of its control points is the patch, which goes from -1.5
    to 1.5, and goes on around it. Of values k^2 a uniform cubic spline makes x^2 + 1/3."""

    def build(stage):
        across = np.arange(6) - 2.5
        nurbs = UsdGeom.NurbsPatch.Define(stage, "/World/Patch")
        nurbs.CreatePointsAttr([Gf.Vec3f(x, y, 0.3 * x * x - 0.1 * y) for y in across for x in across])
        for count, order, knots, limits in (
            (nurbs.CreateUVertexCountAttr, nurbs.CreateUOrderAttr, nurbs.CreateUKnotsAttr, nurbs.CreateURangeAttr),
            (nurbs.CreateVVertexCountAttr, nurbs.CreateVOrderAttr, nurbs.CreateVKnotsAttr, nurbs.CreateVRangeAttr),
        ):
            count(6)
            order(4)
            knots([float(k) for k in range(10)])
            limits(Gf.Vec2d(3, 6))

    x, y = pixels()
    picture = seen(host, build)
    assert (picture["primId"] >= 0).all(), "the control points reach beyond the picture"
    off = np.abs(6.0 - picture["cameraDepth"] - (0.3 * (x * x + 1 / 3) - 0.1 * y))
    inside = np.maximum(np.abs(x), np.abs(y)) < 1.4
    assert off[inside].max() < 2e-3, off[inside].max()


def test_a_curve_goes_through_its_control_points(host):
    """Hydra approximates NURBS curves by straight lines between their control points."""
    points = np.array([(-1.5, -0.3, 0), (-0.5, 1, 0), (0.5, -1, 0), (1.5, 0.2, 0)])

    def build(stage):
        curve = UsdGeom.NurbsCurves.Define(stage, "/World/Curve")
        curve.CreatePointsAttr([Gf.Vec3f(*map(float, point)) for point in points])
        curve.CreateCurveVertexCountsAttr([4])
        curve.CreateOrderAttr([4])
        curve.CreateKnotsAttr([0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
        curve.CreateRangesAttr([Gf.Vec2d(0, 1)])
        curve.CreateWidthsAttr([0.4])

    x, y = pixels()
    picture = seen(host, build)
    away = np.full(x.shape, np.inf)
    for a, b in zip(points[:-1, :2], points[1:, :2]):
        along = np.clip(((x - a[0]) * (b - a)[0] + (y - a[1]) * (b - a)[1]) / ((b - a) @ (b - a)), 0, 1)
        away = np.minimum(away, np.hypot(x - a[0] - along * (b - a)[0], y - a[1] - along * (b - a)[1]))
    with np.errstate(invalid="ignore"):
        agree(picture, np.sqrt(0.2**2 - away**2), "curve")


BAD = {
    "Bare": "def NurbsPatch",
    "Few": "def NurbsPatch { int uVertexCount = 100; int vVertexCount = 100; int uOrder = 4; int vOrder = 4;"
    " point3f[] points = [(0, 0, 0), (1, 0, 0)] }",
    "One": "def NurbsPatch { int uVertexCount = 1; int vVertexCount = 2; point3f[] points = [(0, 0, 0), (1, 0, 0)] }",
    "Beyond": "def TetMesh { point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)];"
    " int4[] tetVertexIndices = [(0, 1, 2, 9)]; int3[] surfaceFaceVertexIndices = [(0, 1, 9), (-1, 2, 3)] }",
    "Inside": "def TetMesh { point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)];"
    " int4[] tetVertexIndices = [(0, 1, 2, 3)] }",
    "Counts": "def NurbsCurves { int[] curveVertexCounts = [-4, 2000000000];"
    " point3f[] points = [(0, 0, 0), (1, 0, 0)] }",
}
# The host's old front end ends the process over these.
WORSE = {
    "Negative": "def NurbsPatch { int uVertexCount = -5; int vVertexCount = 7; int uOrder = 4; int vOrder = 4;"
    " point3f[] points = [(0, 0, 0), (1, 0, 0)] }",
    "Huge": "def NurbsPatch { int uVertexCount = 2000000000; int vVertexCount = 2000000000; int uOrder = 4;"
    " int vOrder = 4; point3f[] points = [(0, 0, 0), (1, 0, 0)] }",
}


def test_invalid_patches_and_tets_are_dropped_by_name(host):
    bad = BAD | (WORSE if host.scene_index else {})
    prims = dict(bad)
    prims["Box"] = "def Cube { double size = 2 }"
    prims["Camera"] = (
        'def Camera { token projection = "orthographic"; float horizontalAperture = 40; float verticalAperture = 40;'
        ' double3 xformOp:translate = (0, 0, 6); uniform token[] xformOpOrder = ["xformOp:translate"] }'
    )
    scene = '#usda 1.0\ndef Xform "World" {\n'
    for name, prim in prims.items():
        kind, _, body = prim.partition(" {")
        scene += f'{kind} "{name}" {{\n' + body.rstrip(" }").replace(";", "\n") + "\n}\n"
    scene += "}\n"
    settings = {"oocpt:samplesPerPixel": 1}
    picture = host.picture(scene, (32, 32), camera="/World/Camera", aovs=["primId"], settings=settings)
    on = (picture["primId"] >= 0).mean()
    assert on == 0.25, f"the box, and nothing else: {on}"
    for name in bad:
        assert f"/World/{name}" in picture.log, f"{name} is named in {picture.log}"


def test_a_prim_that_becomes_invalid_is_dropped_alone_and_returns(pool):
    """The host's filter runs out of memory over it; what is below it stays."""

    def build(stage):
        nurbs = UsdGeom.NurbsPatch.Define(stage, "/World/Patch")
        nurbs.CreatePointsAttr([(x, y, 0) for y in (-1, 1) for x in (-1.5, 0.5)])
        for make in (nurbs.CreateUVertexCountAttr, nurbs.CreateVVertexCountAttr):
            make(2)
        below = UsdGeom.Cube.Define(stage, "/World/Patch/Below")
        below.CreateSizeAttr(0.5)
        below.AddTranslateOp().Set(Gf.Vec3d(1.2, 0, 0))
        small.dome(stage)
        small.orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 4.0)

    stage, host = small.build(build, "a patch with a cube below it"), pool.get("scene_index")
    settings = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}
    seen_in_turn = []
    with host.open(stage, (64, 64), aovs=["primId"], settings=settings) as view:
        for vertices in (2, 2_000_000_000, 2):
            # Both, so that it is asked for more than there can be, and no memory is filled in vain.
            for name in ("uVertexCount", "vVertexCount"):
                view.edit(f"stage.GetPrimAtPath('/World/Patch').GetAttribute('{name}').Set({vertices})")
            picture = view.render()
            is_told = "/World/Patch: it could not be read" in picture.log
            seen_in_turn.append((int((picture["primId"] >= 0).sum()), is_told))
    (both, _), (cube, is_told), (again, _) = seen_in_turn
    assert is_told and cube == 64 and again == both > 2 * cube, seen_in_turn
