# SPDX-License-Identifier: Apache-2.0
"""Curves, points, spheres and capsules through both front ends: depth, coverage and ids against closed forms and
numpy."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, UsdGeom, Vt

import compare
import small

SIZE = (96, 96)
WIDTH = 4.0
SETTINGS = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0, "oocpt:dicingRate": 0.2}
AOVS = ["color", "cameraDepth", "normal", "elementId", "primId"]
DOC = "curves and points"
EYE = 6.0


def seen(host, build, **arguments):
    """What an orthographic camera along -z sees."""
    def whole(stage):
        build(stage)
        small.dome(stage)
        small.orthographic(stage, "/World/Camera", (0, 0, EYE), (0, 0, 0), WIDTH)

    return host.picture(small.build(whole, DOC), SIZE, **{"aovs": AOVS, "settings": SETTINGS, **arguments})


def pixels():
    """x and y of the pixels' centres."""
    place = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * WIDTH - WIDTH / 2
    return np.meshgrid(place, place)


def agree(picture, front, what):
    """`front`: z of the surface at each pixel, NaN beside it."""
    on, expected = picture["primId"] >= 0, np.isfinite(front)
    assert expected.sum() > 300, f"{what}: {expected.sum()} pixels"
    assert (on != expected).sum() <= 8, f"{what}: {(on != expected).sum()} pixels of the outline differ"
    both = on & expected
    off = np.abs((EYE - picture["cameraDepth"]) - front)[both]
    # Pieces are within a hundredth of a pixel, 4e-4, of their curves; depth moves by more where they are seen aslant.
    assert np.quantile(off, 0.99) < 3e-3 and np.median(off) < 4e-4, f"{what}: {np.quantile(off, [0.5, 0.99, 1])}"


def ball(x, y, centre, radius):
    with np.errstate(invalid="ignore"):
        return centre[2] + np.sqrt(radius**2 - (x - centre[0]) ** 2 - (y - centre[1]) ** 2)


def test_spheres_are_exact(host):
    def build(stage):
        sphere = UsdGeom.Sphere.Define(stage, "/World/Ball")
        sphere.CreateRadiusAttr(1.3)
        sphere.AddTranslateOp().Set(Gf.Vec3d(0.3, -0.2, 0.5))

    x, y = pixels()
    picture = seen(host, build)
    front = ball(x, y, (0.3, -0.2, 0.5), 1.3)
    agree(picture, front, "sphere")
    on = (picture["primId"] >= 0) & np.isfinite(front)
    normal = np.stack([x - 0.3, y + 0.2, front - 0.5], axis=-1) / 1.3
    compare.near(picture["normal"][on], normal[on], 2e-3, "normals of a sphere")


@pytest.mark.parametrize("axis", "XYZ")
def test_capsules_are_exact(host, axis):
    def build(stage):
        capsule = UsdGeom.Capsule.Define(stage, "/World/Capsule")
        capsule.CreateAxisAttr(axis)
        capsule.CreateHeightAttr(1.6)
        capsule.CreateRadiusAttr(0.7)

    x, y = pixels()
    along = {"X": x, "Y": y, "Z": np.zeros_like(x)}[axis]
    across = {"X": y, "Y": x, "Z": np.hypot(x, y)}[axis]
    beyond = np.maximum(np.abs(along) - 0.8, 0)
    with np.errstate(invalid="ignore"):
        front = np.sqrt(0.7**2 - across**2 - beyond**2) + (0.8 if axis == "Z" else 0.0)
    agree(seen(host, build), front, f"capsule along {axis}")


def bezier(points, t):
    s = 1 - t[:, None]
    t = t[:, None]
    return s**3 * points[0] + 3 * s * s * t * points[1] + 3 * s * t * t * points[2] + t**3 * points[3]


CONTROL = np.array([(-1.5, -1.0, 0.0), (-1.0, 2.0, 0.6), (1.0, -2.0, -0.4), (1.5, 1.2, 0.2)])


def test_a_cubic_tube_is_the_hull_of_its_balls(host):
    def build(stage):
        curves = UsdGeom.BasisCurves.Define(stage, "/World/Tube")
        curves.CreateTypeAttr("cubic")
        curves.CreateBasisAttr("bezier")
        curves.CreateCurveVertexCountsAttr([4])
        curves.CreatePointsAttr([Gf.Vec3f(*map(float, p)) for p in CONTROL])
        curves.CreateWidthsAttr([0.2, 0.7])
        curves.SetWidthsInterpolation("varying")

    x, y = pixels()
    t = np.linspace(0, 1, 3001)
    front = np.full(x.shape, np.nan)
    for place, radius in zip(bezier(CONTROL, t), 0.1 + 0.25 * t):
        front = np.fmax(front, ball(x, y, place, radius))
    agree(seen(host, build), front, "tube")


def test_points_have_their_widths_and_numbers(host):
    places = [(-1.0, -1.0, 0.2), (0.8, 0.9, -0.3), (1.0, -0.8, 0.0), (-0.7, 0.8, 0.4)]
    widths = [0.8, 1.2, 0.5, 1.0]

    def build(stage):
        points = UsdGeom.Points.Define(stage, "/World/Points")
        points.CreatePointsAttr([Gf.Vec3f(*p) for p in places])
        points.CreateWidthsAttr(widths)
        points.CreateDisplayColorPrimvar("vertex").Set(Vt.Vec3fArray([Gf.Vec3f(k / 4, 0, 0) for k in range(4)]))

    x, y = pixels()
    picture = seen(host, build)
    fronts = np.stack([ball(x, y, p, w / 2) for p, w in zip(places, widths)])
    agree(picture, np.fmax.reduce(fronts), "points")
    sure = (picture["primId"] >= 0) & np.isfinite(fronts).any(axis=0)
    numbers = np.nanargmax(np.where(np.isfinite(fronts), fronts, -np.inf), axis=0)
    assert (picture["elementId"][sure] == numbers[sure]).mean() > 0.999, "elements are points"
    red = picture["color"][..., 0]
    for k in range(1, 4):
        inner = sure & (numbers == k)
        inner &= np.roll(inner, 1, 0) & np.roll(inner, -1, 0) & np.roll(inner, 1, 1) & np.roll(inner, -1, 1)
        assert np.median(red[inner]) == pytest.approx(k / 4, rel=0.1), f"the colour of point {k}"


@pytest.mark.parametrize("basis", ["bspline", "catmullRom"])
@pytest.mark.parametrize("wrap", ["nonperiodic", "pinned", "periodic"])
def test_bases_and_wraps(host, basis, wrap):
    """Where a thin curve goes, against the same curve given by many points of numpy's."""
    control = np.array([(-1.2, -1.0), (-1.0, 0.8), (0.2, 1.3), (1.1, 0.4), (0.9, -1.1)])

    def build(stage):
        curves = UsdGeom.BasisCurves.Define(stage, "/World/Curve")
        curves.CreateTypeAttr("cubic")
        curves.CreateBasisAttr(basis)
        curves.CreateWrapAttr(wrap)
        curves.CreateCurveVertexCountsAttr([len(control)])
        curves.CreatePointsAttr([Gf.Vec3f(float(a), float(b), 0) for a, b in control])
        curves.CreateWidthsAttr([0.3])
        curves.SetWidthsInterpolation("constant")

    matrix = {
        "bspline": np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6,
        "catmullRom": np.array([[0, 2, 0, 0], [-1, 0, 1, 0], [2, -5, 4, -1], [-1, 3, -3, 1]]) / 2,
    }[basis]
    points = control
    if wrap == "periodic":
        points = np.concatenate([control, control[:3]])
    elif wrap == "pinned":
        points = np.concatenate([[2 * control[0] - control[1]], control, [2 * control[-1] - control[-2]]])
    t = np.linspace(0, 1, 201)
    powers = np.stack([np.ones_like(t), t, t**2, t**3], axis=-1)
    places = np.concatenate([powers @ matrix @ points[k : k + 4] for k in range(len(points) - 3)])
    x, y = pixels()
    away = np.min([np.hypot(x - px, y - py) for px, py in places], axis=0)
    front = np.sqrt(np.where(away <= 0.15, 0.15**2 - away**2, np.nan))
    agree(seen(host, build), front, f"{basis}, {wrap}")


def test_ribbons_lie_across_their_normals(host):
    def build(stage):
        curves = UsdGeom.BasisCurves.Define(stage, "/World/Ribbon")
        curves.CreateTypeAttr("linear")
        curves.CreateCurveVertexCountsAttr([3])
        curves.CreatePointsAttr([Gf.Vec3f(-1.5, 0, 0), Gf.Vec3f(0, 0, 0), Gf.Vec3f(1.5, 0, 0)])
        curves.CreateWidthsAttr([1.0])
        curves.SetWidthsInterpolation("constant")
        curves.CreateNormalsAttr([Gf.Vec3f(0, 0, 1)] * 3)
        curves.SetNormalsInterpolation("vertex")

    x, y = pixels()
    agree(seen(host, build), np.where((np.abs(x) < 1.5) & (np.abs(y) < 0.5), 0.0, np.nan), "ribbon")


def test_edits_of_points_and_widths_show(host):
    def build(stage):
        points = UsdGeom.Points.Define(stage, "/World/Points")
        points.CreatePointsAttr([Gf.Vec3f(0, 0, 0)])
        points.CreateWidthsAttr([1.0])
        small.dome(stage)
        small.orthographic(stage, "/World/Camera", (0, 0, EYE), (0, 0, 0), WIDTH)

    x, y = pixels()
    with host.open(small.build(build, DOC), SIZE, aovs=AOVS, settings=SETTINGS) as view:
        agree(view.render(), ball(x, y, (0, 0, 0), 0.5), "first")
        view.edit("UsdGeom.Points(stage.GetPrimAtPath('/World/Points')).GetWidthsAttr().Set([2.0])")
        agree(view.render(), ball(x, y, (0, 0, 0), 1.0), "wider")
        view.edit("UsdGeom.Points(stage.GetPrimAtPath('/World/Points')).GetPointsAttr().Set([Gf.Vec3f(0.5, 0, 0)])")
        agree(view.render(), ball(x, y, (0.5, 0, 0), 1.0), "moved")


def test_bad_curves_are_one_warning(host):
    def build(stage):
        curves = UsdGeom.BasisCurves.Define(stage, "/World/Curves")
        curves.CreateTypeAttr("linear")
        curves.CreateCurveVertexCountsAttr([2, -1, 7])
        curves.CreatePointsAttr([Gf.Vec3f(-1, 0, 0), Gf.Vec3f(1, 0, 0), Gf.Vec3f(float("nan"), 0, 0)])
        curves.CreateWidthsAttr([1.0])
        curves.SetWidthsInterpolation("constant")

    picture = seen(host, build)
    assert (picture["primId"] >= 0).sum() > 500, "the good curve is there"
    assert "/World/Curves" in picture.log and "2 curves with too few or unusable points" in picture.log, picture.log
