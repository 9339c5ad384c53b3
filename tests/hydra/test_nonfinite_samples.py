# SPDX-License-Identifier: Apache-2.0
"""Samples that single precision does not hold: left out, and told once with their number and a place."""

from __future__ import annotations

import numpy as np

# A card of 8 x 8 pixels, from pixel 8, 16 on, under a lamp that no float is large enough for: an albedo of 0.95 under
# half a sphere of 3e38 is beyond 3.4e38 for most samples, and the sum of 64 of the others always is.
SCENE = """#usda 1.0
(
    upAxis = "Y"
)
def Camera "Cam" {{
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 40
    double3 xformOp:translate = (2, 2, 0.5)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
def Mesh "Card" {{
    uniform token subdivisionScheme = "none"
    int[] faceVertexCounts = [4]
    int[] faceVertexIndices = [0, 1, 2, 3]
    point3f[] points = [(1, 2, 0), (2, 2, 0), (2, 3, 0), (1, 3, 0)]
    color3f[] primvars:displayColor = [(0.95, 0.95, 0.95)]
}}
def RectLight "Lamp" {{
    float inputs:intensity = {intensity}
    float inputs:width = 40
    float inputs:height = 40
    double3 xformOp:translate = (0, 0, 1)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}}
"""
SETTINGS = {"oocpt:samplesPerPixel": 64, "oocpt:maxBounces": 1}
MESSAGE = "samples are not finite"


def test_non_finite_samples_are_dropped_with_one_warning(host):
    with host.open(SCENE.format(intensity=3e38), (32, 32), camera="/Cam", settings=SETTINGS) as view:
        picture = view.render()
        dropped = view.stats()["oocpt:nonFiniteSamples"]
        assert np.isfinite(picture["color"]).all() and 64 < dropped <= 64 * 64 * 2, dropped
        told = [line for line in picture.log.splitlines() if MESSAGE in line]
        assert len(told) == 1 and f"{dropped} {MESSAGE}" in told[0] and "is 8, 16 from the lower left" in told[0], told
        # Hosts begin anew at each edit: that is no other warning.
        view.edit("stage.GetPrimAtPath('/Lamp').GetAttribute('inputs:width').Set(30)")
        assert MESSAGE not in view.render().log
        view.edit("stage.GetPrimAtPath('/Lamp').GetAttribute('inputs:intensity').Set(1)")
        assert MESSAGE not in view.render().log
        assert view.stats()["oocpt:nonFiniteSamples"] == 0
        view.edit("stage.GetPrimAtPath('/Lamp').GetAttribute('inputs:intensity').Set(3e38)")
        assert MESSAGE in view.render().log
