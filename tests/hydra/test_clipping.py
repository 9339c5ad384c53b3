# SPDX-License-Identifier: Apache-2.0
"""Clipping planes of cameras through both front ends: what is cut against the planes in numpy, what a range of clipping
does not cut, and planes that cannot be used."""

from __future__ import annotations

import numpy as np
import pytest

SIZE = (48, 48)
SETTINGS = {"oocpt:samplesPerPixel": 16, "oocpt:maxBounces": 0}
AOVS = ("color", "primId", "cameraDepth")

# A card of 4 x 4 units five units from the eye, in front of one at ten; the eye sees 2 x 2 units at distance 5.
STAGE = """#usda 1.0
(
    upAxis = "Y"
)
def Xform "World"
{{
    def Camera "Camera"
    {{
        float horizontalAperture = 20
        float verticalAperture = 20
        float focalLength = 50
        double3 xformOp:translate = (3, 2, 10)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        float2 clippingRange = {range}
        float4[] clippingPlanes = {planes}
    }}
    def Mesh "Near"
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(1, 0, 5), (5, 0, 5), (5, 4, 5), (1, 4, 5)]
        uniform bool doubleSided = 1
        uniform token subdivisionScheme = "none"
    }}
    def Mesh "Far"
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-7, -8, 0), (13, -8, 0), (13, 12, 0), (-7, 12, 0)]
        uniform bool doubleSided = 1
        uniform token subdivisionScheme = "none"
    }}
}}
"""


def render(host, planes, clipping_range="(0.1, 100)"):
    with host.open(STAGE.format(planes=planes, range=clipping_range), SIZE, aovs=AOVS, settings=SETTINGS) as view:
        return view.render()


def distances(planes):
    """Depth of the first card that no plane cuts off, by pixel; 0: none. NaN: too near to a plane to tell."""
    # 20 / 50 of the distance is seen; images have their last line first.
    at = (np.arange(SIZE[0]) + 0.5) / SIZE[0] - 0.5
    x, y = np.meshgrid(at * 0.4, at * 0.4)
    depth = np.zeros(SIZE[::-1])
    for z in (10.0, 5.0):
        point = np.stack([x * z, y * z, np.full_like(x, -z), np.ones_like(x)], axis=-1)
        sides = [point @ np.asarray(plane) for plane in planes]
        least = np.min(sides, axis=0) if sides else np.ones_like(x)
        depth = np.where(least > 0, z, depth)
        depth = np.where(np.abs(least) < 1e-5, np.nan, depth)
    return depth


@pytest.mark.parametrize("planes", [
    [],
    [(0, 0, -1, -6)],
    [(1, 0.3, 0, 0.1)],
    [(0.5, 0, -1, -5.0), (0, 1, 0.2, 1.7)],
    [(0, 0, 1, 7), (-1, 0, 0, 0.2), (1, 0, 0, 0.4)],
    [(0, 0, 1, 4)],
])
def test_geometry_below_a_clipping_plane_is_not_seen(host, planes):
    picture = render(host, str([tuple(plane) for plane in planes]))
    known = distances(planes)
    told = ~np.isnan(known)
    assert told.sum() > 2200
    depth = picture["cameraDepth"]
    assert np.allclose(depth[told], known[told], atol=2e-5), np.abs(depth - known)[told].max()
    assert ((picture["primId"] >= 0) == (known > 0))[told].all()
    alpha = picture["color"][..., 3]
    # Pixels whose neighbours see the same are covered whole, or not at all.
    inner = told & (known == np.roll(known, 1, 0)) & (known == np.roll(known, 1, 1))
    inner &= (known == np.roll(known, -1, 0)) & (known == np.roll(known, -1, 1))
    inner &= known == np.roll(np.roll(known, 1, 0), 1, 1)
    share = (np.abs(alpha - (known > 0)) < 1e-6)[inner].mean()
    assert share > 0.97, share


def test_a_clipping_range_cuts_nothing(host):
    whole = render(host, "[]")
    near = render(host, "[]", "(6, 7)")
    assert (near["cameraDepth"] == whole["cameraDepth"]).all()
    assert (near["primId"] == whole["primId"]).all() and (near["primId"] >= 0).all()


def test_invalid_clipping_planes_are_reported_with_the_camera(host):
    picture = render(host, "[(nan, 0, 0, 1), (0, 0, -1, -6), (0, inf, 0, 0)]")
    said = [line for line in picture.log.splitlines() if "clipping planes" in line]
    assert len(said) == 1 and "/World/Camera" in said[0] and "not finite" in said[0], picture.log
    assert np.allclose(picture["cameraDepth"], 10.0, atol=2e-5), "the one that can be is"
    many = render(host, str([(0, 0, -1, 0)] * 16 + [(0, 0, -1, -6)]))
    said = [line for line in many.log.splitlines() if "clipping planes" in line]
    assert len(said) == 1 and "/World/Camera" in said[0] and "16" in said[0] and "17" in said[0], many.log
    assert np.allclose(many["cameraDepth"], 5.0, atol=2e-5), "the first sixteen count"


def test_planes_may_be_edited(host):
    with host.open(STAGE.format(planes="[]", range="(0.1, 100)"), SIZE, aovs=AOVS, settings=SETTINGS) as view:
        assert np.allclose(view.render()["cameraDepth"], 5.0, atol=2e-5)
        view.edit("stage.GetPrimAtPath('/World/Camera').GetAttribute('clippingPlanes').Set([(0, 0, -1, -6)])")
        assert np.allclose(view.render()["cameraDepth"], 10.0, atol=2e-5)
