# SPDX-License-Identifier: Apache-2.0
"""Shadow catchers by primvars of other renderers, shadows and material ids as layers, in real runs of usdrecord."""

import os
import subprocess

import numpy as np
import OpenEXR
import pytest

SCENE = """#usda 1.0
(
    renderSettingsPrimPath = "/Render/Settings"
    upAxis = "Y"
)
def Camera "Eye"
{{
    token projection = "orthographic"
    float horizontalAperture = 40
    float verticalAperture = 20
    double3 xformOp:translate = (0, 9, 0)
    float xformOp:rotateX = -90
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateX"]
}}
def Xform "World"
{{
    def DistantLight "Sun"
    {{
        float inputs:angle = 0
        color3f inputs:color = (1, 0.5, 0)
        float xformOp:rotateX = -90
        uniform token[] xformOpOrder = ["xformOp:rotateX"]
    }}
    def Mesh "Floor"
    {{
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-9, 0, 9), (9, 0, 9), (9, 0, -9), (-9, 0, -9)]
        uniform token subdivisionScheme = "none"
        {floor}
    }}
    def Mesh "Roof" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    )
    {{
        rel material:binding = </World/Grey>
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-9, 1, 9), (0, 1, 9), (0, 1, -9), (-9, 1, -9)]
        uniform token subdivisionScheme = "none"
        {roof}
    }}
    def Material "Grey"
    {{
        token outputs:surface.connect = </World/Grey/S.outputs:surface>
        def Shader "S"
        {{
            uniform token info:id = "UsdPreviewSurface"
            token outputs:surface
        }}
    }}
}}
def Scope "Render"
{{
    def RenderSettings "Settings"
    {{
        rel products = </Render/P>
    }}
    def RenderProduct "P"
    {{
        token productName = "{product}"
        rel camera = </Eye>
        int2 resolution = (20, 10)
        rel orderedVars = [</Render/c>, </Render/s>, </Render/y>, </Render/m>]
    }}
    def RenderVar "c"
    {{
        token dataType = "color4f"
        string sourceName = "Ci"
    }}
    def RenderVar "s"
    {{
        token dataType = "color3h"
        string sourceName = "occluded"
    }}
    def RenderVar "y"
    {{
        token dataType = "float"
        string sourceName = "shadow"
    }}
    def RenderVar "m"
    {{
        token dataType = "int"
        string sourceName = "materialId"
    }}
}}
"""
CATCHERS = {
    "own": "bool primvars:oocpt:shadowCatcher = 1",
    "renderman": "int primvars:ri:attributes:trace:holdout = 1",
    "karma": "int primvars:karma:object:holdoutmode = 2",
    "cycles": "bool primvars:cycles:object:is_shadow_catcher = 1",
}
CONSTANT = ' (interpolation = "constant")'
UNSEEN = 'string primvars:oocpt:visibility = "-camera"' + CONSTANT


def record(folder, floor, roof, *words):
    """What a run writes: the channels of its file, the first row at the top."""
    scene, product = folder / "scene.usda", folder / "product.exr"
    scene.write_text(SCENE.format(floor=floor, roof=roof, product=product))
    out = folder / "out.exr"
    command = ["usdrecord", "--disableCameraLight", "--imageWidth", "20", "--samples", "4", "--camera", "/Eye"]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run(
        [*command, "--set", "oocpt:maxBounces=1", *words, str(scene), str(out)], env=environment, capture_output=True,
        text=True, timeout=300, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0 and "warning" not in done.stderr.lower(), done.stderr
    with OpenEXR.File(str(product if "--products" in words else out), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}


@pytest.mark.parametrize("renderer", CATCHERS)
def test_a_catcher_shows_its_shadow_alone(tmp_path, renderer):
    channels = record(tmp_path, CATCHERS[renderer] + CONSTANT, UNSEEN, "--aov", "shadowCatcher")
    assert all((channels[name] == 0).all() for name in "RGB"), "no colour"
    for name in ("A", "shadowCatcher"):
        assert (channels[name][:, :10] == 1).all() and (channels[name][:, 10:] == 0).all(), channels[name]


def test_what_is_over_a_catcher_covers_it(tmp_path):
    channels = record(tmp_path, CATCHERS["own"] + CONSTANT, "")
    assert (channels["A"][:, :10] == 1).all() and (channels["A"][:, 10:] == 0).all(), channels["A"]
    assert (channels["G"][:, :10] > 0.05).all() and (channels["G"][:, 10:] == 0).all(), "the roof has its colour"


def test_products_have_shadows_and_materials(tmp_path):
    channels = record(tmp_path, "", UNSEEN, "--products")
    half = {"s.R": 1, "s.G": 1, "s.B": 0, "y": 1}
    for name, share in half.items():
        shadow = np.asarray(channels[name], dtype=np.float32)
        assert (shadow[:, :10] == share).all() and (shadow[:, 10:] == 0).all(), f"{name}: {shadow}"
    assert channels["s.R"].dtype == np.float16
    nothing = np.uint32(0xFFFFFFFF)
    assert (channels["m"] == nothing).all(), "the floor has no material"
    shown = record(tmp_path, "", "", "--products")
    assert (shown["m"][:, :10] == 0).all() and (shown["m"][:, 10:] == nothing).all(), shown["m"]
    assert (shown["y"] == 0).all(), "nothing is in the way of the roof's light, and of half of the floor's"
