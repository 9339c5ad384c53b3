# SPDX-License-Identifier: Apache-2.0
"""Subdivision surfaces through both front ends: creases, corners, boundaries, holes and refine levels arrive, and the
surface is the one that Catmull-Clark's rule, applied many times, converges to."""

from __future__ import annotations

import numpy as np
import pytest
from pxr import Gf, UsdGeom, Vt

import catmull_clark
import compare
import reference
import small

SIZE = (72, 72)
SETTINGS = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0, "oocpt:dicingRate": 1.0}
DOC = "subdivision"
AOVS = ["color", "cameraDepth", "normal", "elementId"]
CUBE = [(x, y, z) for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)]
FACES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
# Along the top, and down one edge of it: the point 7 has three of them, and is a corner.
CREASE = [2, 3, 7, 6, 2]
SPUR = [7, 5]


def control(stage, creases=()):
    """The cube; each of `creases` is a list of points."""
    mesh = small.mesh(stage, "/World/Cube", CUBE, [4] * 6, [k for face in FACES for k in face], (0.5, 0.5, 0.5))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
    if creases:
        mesh.CreateCreaseIndicesAttr([point for crease in creases for point in crease])
        mesh.CreateCreaseLengthsAttr([len(crease) for crease in creases])
        mesh.CreateCreaseSharpnessesAttr([10.0] * len(creases))
    surroundings(stage)
    return mesh


def surroundings(stage):
    small.dome(stage)
    small.camera(stage, "/World/Camera", (2.5, 3.5, 5.0), (0, 0, 0))


def limit(stage, creases=(), levels=5):
    """The same cube, refined so often that only 4^-levels is left to the limit."""
    sharp = {frozenset(pair) for crease in creases for pair in zip(crease, crease[1:])}
    points, quads, owners = catmull_clark.refine(np.array(CUBE, dtype=float), FACES, sharp, levels)
    small.mesh(stage, "/World/Cube", points.tolist(), [4] * len(quads), quads.ravel().tolist(), (0.5, 0.5, 0.5))
    surroundings(stage)
    return owners


@pytest.fixture(scope="module", params=[(), (CREASE,), (CREASE, SPUR)], ids=["smooth", "crease", "corner"])
def answer(request):
    """Creases, the first hits of the refined cube, and the authored face of each of its faces."""
    owners = []
    stage = small.build(lambda stage: owners.append(limit(stage, request.param, 4)), DOC)
    return request.param, reference.first_hits(stage, "/World/Camera", *SIZE), owners[0]


def test_the_limit_surface_matches_catmull_clark(host, answer):
    creases, hits, owners = answer
    settings = {**SETTINGS, "oocpt:dicingRate": 0.25}
    picture = host.picture(small.build(lambda stage: control(stage, creases), DOC), SIZE, aovs=AOVS, settings=settings)
    clear = compare.clear_pixels(hits.unclear, "limit") & (hits.item >= 0)
    clear &= picture["elementId"] >= 0
    assert clear.sum() > 400, f"{clear.sum()} pixels"
    # After four steps the answer's points and facets are within some thousandths of the limit.
    # Along the normal: at grazing angles depth moves by more.
    towards = reference.pixel_rays(small.build(surroundings, DOC), "/World/Camera", *SIZE).directions.reshape(*SIZE, 3)
    facing = np.abs((towards * hits.normal).sum(axis=-1)) / np.linalg.norm(towards, axis=-1)
    off = (np.abs(picture["cameraDepth"] - hits.camera_depth.reshape(SIZE)) * facing)[clear]
    assert np.quantile(off, 0.99) < 4e-3 and np.median(off) < 2e-3, f"{np.quantile(off, [0.5, 0.99, 1])} from the limit"
    dots = (picture["normal"] * hits.normal).sum(axis=-1)[clear]
    # Those of the answer are those of its facets.
    assert np.quantile(dots, 0.02) > 0.99, f"normals: {np.quantile(dots, [0, 0.02, 0.5])}"
    same = picture["elementId"][clear] == owners[hits.face[clear]]
    assert same.mean() > 0.97, "elements are authored faces"


def test_the_comparison_distinguishes_creases():
    """The comparison above would see a crease that is lost."""
    depths = []
    for creases in ((), (CREASE,), (CREASE, SPUR)):
        hits = reference.first_hits(small.build(lambda stage: limit(stage, creases, 3), DOC), "/World/Camera", *SIZE)
        depths.append(np.where(hits.item >= 0, hits.camera_depth.reshape(SIZE), np.inf))
    for a, b in ((0, 1), (1, 2)):
        both = np.isfinite(depths[a]) & np.isfinite(depths[b])
        assert np.quantile(np.abs(depths[a] - depths[b])[both], 0.9) > 0.02, "pictures differ by ten times the bound"


def test_complexity_is_the_minimum_refinement(host):
    """With the rate switched off, the host's complexity decides alone: 1.0 is the cage."""
    settings = {**SETTINGS, "oocpt:dicingRate": 0.0}
    with host.open(small.build(control, DOC), SIZE, aovs=AOVS, settings=settings) as view:
        covered = []
        for complexity in (1.0, 1.1, 1.2, 1.3):
            view.edit(f"view.params.complexity = {complexity}")
            covered.append(int((view.render()["elementId"] >= 0).sum()))
            triangles = view.stats()["oocpt:uniqueTriangles"]
            assert triangles == 12 * 4 ** round((complexity - 1) * 10), f"{triangles} at {complexity}"
    assert covered[0] > 1.4 * covered[1], f"the cage is larger than the surface: {covered}"


def test_edits_of_creases_and_rates_show(host):
    stage = small.build(control, DOC)
    with host.open(stage, SIZE, aovs=AOVS, settings=SETTINGS) as view:
        view.render()
        view.edit(
            "mesh = UsdGeom.Mesh(stage.GetPrimAtPath('/World/Cube'))\n"
            f"mesh.CreateCreaseIndicesAttr({CREASE}); mesh.CreateCreaseLengthsAttr([{len(CREASE)}])\n"
            "mesh.CreateCreaseSharpnessesAttr([10.0])"
        )
        edited = view.render()
        fine = view.stats()["oocpt:uniqueTriangles"]
        view.edit("engine.SetRendererSetting('oocpt:dicingRate', 8.0)")
        view.render()
        coarse = view.stats()["oocpt:uniqueTriangles"]
    fresh = host.picture(small.build(lambda s: control(s, (CREASE,)), DOC), SIZE, aovs=AOVS, settings=SETTINGS)
    compare.same_picture(edited, fresh, "a crease that came later")
    assert coarse * 16 < fine, f"{coarse} triangles at eight pixels, {fine} at one"


def test_holes_boundaries_and_rules_arrive(host):
    """A 4 x 4 grid with a hole: without interpolated boundaries only the middle is left."""
    def grid(stage, rule):
        points = [(x - 2.0, y - 2.0, 0.0) for y in range(5) for x in range(5)]
        quads = [[y * 5 + x, y * 5 + x + 1, y * 5 + x + 6, y * 5 + x + 5] for y in range(4) for x in range(4)]
        mesh = small.mesh(stage, "/World/Grid", points, [4] * 16, [k for q in quads for k in q], (0.5, 0.5, 0.5))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
        mesh.CreateInterpolateBoundaryAttr(rule)
        mesh.CreateHoleIndicesAttr([5])
        small.dome(stage)
        small.orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 5.0)

    seen = {}
    for rule in ("none", "edgeOnly", "edgeAndCorner"):
        stage = small.build(lambda stage: grid(stage, rule), DOC)
        seen[rule] = host.picture(stage, SIZE, aovs=["elementId"], settings=SETTINGS)["elementId"]
    assert set(np.unique(seen["none"])) == {-1, 6, 9, 10}, "the inner faces but the hole"
    assert set(np.unique(seen["edgeAndCorner"])) == {-1, *range(16)} - {5}, "all but the hole"
    square, rounded = ((seen[rule] >= 0).sum() for rule in ("edgeAndCorner", "edgeOnly"))
    assert square == pytest.approx(15 * (72 / 5) ** 2, rel=0.03), "straight edges, sharp corners"
    assert 0.9 * square < rounded < 0.99 * square, "round corners"


def test_primvars_by_corner_are_smoothed_by_their_rule(host):
    """Colours by corner, white in the middle: linear with `all`, a bicubic spline (4/9 in its middle) with `none`."""
    def grid(stage, rule):
        points = [(x - 2.0, y - 2.0, 0.0) for y in range(5) for x in range(5)]
        quads = [[y * 5 + x, y * 5 + x + 1, y * 5 + x + 6, y * 5 + x + 5] for y in range(4) for x in range(4)]
        corners = [k for quad in quads for k in quad]
        mesh = small.mesh(stage, "/World/Grid", points, [4] * 16, corners, (0.5, 0.5, 0.5))
        mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
        mesh.CreateFaceVaryingLinearInterpolationAttr(rule)
        primvar = mesh.CreateDisplayColorPrimvar(UsdGeom.Tokens.faceVarying)
        primvar.Set(Vt.Vec3fArray([Gf.Vec3f(0), Gf.Vec3f(1)]))
        primvar.SetIndices(Vt.IntArray([int(k == 12) for k in corners]))
        small.dome(stage)
        small.orthographic(stage, "/World/Camera", (0, 0, 6), (0, 0, 0), 5.0)

    peak = {}
    for rule in ("all", "none"):
        stage = small.build(lambda stage: grid(stage, rule), DOC)
        picture = host.picture(stage, SIZE, aovs=["color"], settings={**SETTINGS, "oocpt:maxBounces": 1})
        peak[rule] = picture["color"][35:37, 35:37, 0].mean()
    assert peak["none"] == pytest.approx(4 / 9, abs=0.015) and peak["all"] > 0.9, f"{peak}"
