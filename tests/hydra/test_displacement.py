# SPDX-License-Identifier: Apache-2.0
"""Displacement through both front ends: a square against its height field and a ball against a larger one in numpy, the
texture's inputs, edits, same bits at budgets, what cannot be read."""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from PIL import Image

import compare
import test_streaming

SIZE = (64, 64)
WIDTH = 2.5
EYE = 6.0
AOVS = ["color", "cameraDepth", "normal", "elementId"]
SETTINGS = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0, "oocpt:dicingRate": 0.5}
SIDE = 64
STAGE = """#usda 1.0
( upAxis = "Y" )
def Xform "World"
{
    def Camera "Camera"
    {
        token projection = "orthographic"
        float horizontalAperture = 25
        float verticalAperture = 25
        double3 xformOp:translate = (0, 0, 6)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "Dome" { float inputs:intensity = 1; }
    def Material "Material"
    {
        token outputs:surface.connect = </World/Material/Surface.outputs:surface>
        TERMINAL
        def Shader "Surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            DISPLACEMENT
            token outputs:surface
            token outputs:displacement
        }
        def Shader "Texture"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @FILE@
            token inputs:sourceColorSpace = "SPACE"
            token inputs:wrapS = "WRAP"
            token inputs:wrapT = "WRAP"
            float4 inputs:scale = (0.5, 0.25, 0.125, 1)
            float4 inputs:bias = (0.1, 0.2, 0.3, -0.4)
            float4 inputs:fallback = (1, 2, 3, 1)
            float2 inputs:st.connect = </World/Material/Place.outputs:result>
            float outputs:r
            float outputs:g
            float outputs:b
            float outputs:a
        }
        def Shader "Place"
        {
            uniform token info:id = "UsdTransform2d"
            float2 inputs:in.connect = </World/Material/Reader.outputs:result>
            float2 inputs:scale = (1.5, 1)
            float2 inputs:translation = (-0.25, 0.125)
            float2 outputs:result
        }
        def Shader "Reader"
        {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }
    MESH
}
"""
TERMINAL = "token outputs:displacement.connect = </World/Material/Surface.outputs:displacement>"
SQUARE = """def Mesh "Square" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "varying" )
        uniform token subdivisionScheme = "SCHEME"
        rel material:binding = </World/Material>
    }"""


def stage(mesh, *, displacement=None, output="r", file="./height.exr", wrap="clamp", space="raw", terminal=TERMINAL):
    source = f"float inputs:displacement.connect = </World/Material/Texture.outputs:{output}>"
    wanted = {
        "MESH": mesh, "TERMINAL": terminal, "FILE": file, "WRAP": wrap, "SPACE": space,
        "DISPLACEMENT": source if displacement is None else f"float inputs:displacement = {displacement}",
    }  # fmt: skip
    text = STAGE
    for name, value in wanted.items():
        text = text.replace(name, value)
    return text


def square(scheme="none"):
    return SQUARE.replace("SCHEME", scheme)


def smooth_texels():
    """Of slow waves, one for each channel."""
    x, y = np.meshgrid(np.arange(SIDE) / SIDE, np.arange(SIDE) / SIDE)
    waves = [np.sin(4 * x + k) * np.cos(3 * y - k) for k in range(4)]
    return np.stack(waves, axis=-1).astype(np.float32)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("displacement")
    texels = smooth_texels()
    channels = {name: np.ascontiguousarray(texels[::-1, :, k]) for k, name in enumerate("RGBA")}
    OpenEXR.File({"type": OpenEXR.scanlineimage}, channels).write(str(folder / "height.exr"))
    grey = np.round(127.5 + 127.5 * texels[::-1, :, :3]).astype(np.uint8)
    Image.fromarray(grey).save(folder / "height.png")
    return folder


def picture(host, folder, text, **arguments):
    (folder / "scene.usda").write_text(text)
    return host.picture(folder / "scene.usda", SIZE, **{"aovs": AOVS, "settings": SETTINGS, **arguments})


def pixels():
    place = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * WIDTH - WIDTH / 2
    return np.meshgrid(place, place)


def filtered(texels, s, t, wrap):
    """Bilinear, texels' middles at half numbers; row 0 is at t = 0."""
    side = texels.shape[0]
    x, y = s * side - 0.5, t * side - 0.5
    total = np.zeros_like(s)
    for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = np.floor(x) + dx, np.floor(y) + dy
        weight = (1 - np.abs(x - column)) * (1 - np.abs(y - row))
        inside = (column >= 0) & (column < side) & (row >= 0) & (row < side)
        if wrap == "clamp":
            value = texels[np.clip(row, 0, side - 1).astype(int), np.clip(column, 0, side - 1).astype(int)]
        elif wrap == "repeat":
            value = texels[(row % side).astype(int), (column % side).astype(int)]
        else:
            value = np.where(inside, texels[(row % side).astype(int), (column % side).astype(int)], 0.0)
        total += weight * value
    return total


def height_of(texels, x, y, output="r", wrap="clamp"):
    channel = "rgba".index(output)
    s, t = 1.5 * (x + 1) / 2 - 0.25, (y + 1) / 2 + 0.125
    scale, bias = (0.5, 0.25, 0.125, 1)[channel], (0.1, 0.2, 0.3, -0.4)[channel]
    return scale * filtered(texels[..., channel].astype(np.float64), s, t, wrap) + bias


def is_height_field(seen, texels, output="r", wrap="clamp"):
    x, y = pixels()
    inside = np.maximum(np.abs(x), np.abs(y)) < 0.97
    assert (seen["elementId"][inside] >= 0).all(), "no hole"
    off = np.abs(EYE - seen["cameraDepth"] - height_of(texels, x, y, output, wrap))[inside]
    # Pieces are half a pixel wide, and the filter bends at every texel; what does not fit at the border is a step.
    scale = (0.5, 0.25, 0.125, 1)["rgba".index(output)]
    most = 1.0 if wrap == "clamp" else 0.95
    found = np.quantile(off, [0.5, most]) / scale
    assert found[0] < 3e-4 and found[1] < 8e-3, f"{found} of the height"
    step = 1e-3
    slope = [
        (height_of(texels, x + dx, y + dy, output, wrap) - height_of(texels, x - dx, y - dy, output, wrap)) / (2 * step)
        for dx, dy in ((step, 0), (0, step))
    ]
    normal = np.stack([-slope[0], -slope[1], np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    dots = (seen["normal"] * normal).sum(axis=-1)[inside]
    assert np.quantile(dots, 0.05 if wrap == "clamp" else 0.2) > 0.998, f"normals: {np.quantile(dots, [0, 0.05, 0.5])}"


def is_quiet(seen):
    lines = [line for line in seen.log.splitlines() if "OocPT" in line]
    assert not lines, lines


@pytest.mark.parametrize("scheme", ["none", "bilinear"])
def test_a_square_is_its_height_field(host, folder, scheme):
    for output, wrap in (("r", "clamp"), ("g", "repeat"), ("b", "black"), ("a", "clamp")):
        seen = picture(host, folder, stage(square(scheme), output=output, wrap=wrap))
        is_quiet(seen)
        is_height_field(seen, smooth_texels(), output, wrap)


def test_bytes_are_read_by_their_color_space(host, folder):
    grey = np.round(127.5 + 127.5 * smooth_texels()[..., :3]) / 255
    linear = np.where(grey <= 0.04045, grey / 12.92, ((grey + 0.055) / 1.055) ** 2.4)
    for space, texels in (("raw", grey), ("auto", linear), ("sRGB", linear)):
        seen = picture(host, folder, stage(square(), output="g", file="./height.png", space=space))
        is_quiet(seen)
        is_height_field(seen, texels, "g")


def grid(count):
    """A subdivision surface that is flat, from -1 to 1."""
    side = count + 1
    points = ", ".join(f"({2 * x / count - 1}, {2 * y / count - 1}, 0)" for y in range(side) for x in range(side))
    places = ", ".join(f"({x / count}, {y / count})" for y in range(side) for x in range(side))
    corners = [
        k for y in range(count) for x in range(count)
        for k in (y * side + x, y * side + x + 1, (y + 1) * side + x + 1, (y + 1) * side + x)
    ]  # fmt: skip
    return f"""def Mesh "Grid" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {{
        int[] faceVertexCounts = {[4] * count**2}
        int[] faceVertexIndices = {corners}
        point3f[] points = [{points}]
        texCoord2f[] primvars:st = [{places}] ( interpolation = "varying" )
        rel material:binding = </World/Material>
    }}"""


def test_a_subdivision_surface_is_its_height_field(host, folder):
    seen = picture(host, folder, stage(grid(3)))
    is_quiet(seen)
    is_height_field(seen, smooth_texels())


def test_a_constant_moves_along_the_normals(host, folder):
    """A cube whose faces move outwards by 0.25, edges rounded off by one piece; left-handed, inwards."""
    points = [(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)]
    faces = [0, 2, 3, 1, 4, 5, 7, 6, 0, 1, 5, 4, 2, 6, 7, 3, 0, 4, 6, 2, 1, 3, 7, 5]
    for hand, front in (("rightHanded", 0.75), ("leftHanded", 0.25)):
        mesh = f"""def Mesh "Cube" ( prepend apiSchemas = ["MaterialBindingAPI"] )
        {{
            int[] faceVertexCounts = {[4] * 6}
            int[] faceVertexIndices = {faces}
            point3f[] points = {points}
            uniform bool doubleSided = 1
            uniform token orientation = "{hand}"
            uniform token subdivisionScheme = "none"
            rel material:binding = </World/Material>
        }}"""
        seen = picture(host, folder, stage(mesh, displacement=0.25))
        is_quiet(seen)
        x, y = pixels()
        face = (np.maximum(np.abs(x), np.abs(y)) < 0.2) & (seen["elementId"] >= 0)
        assert face.sum() > 60, "the front is seen"
        compare.near(EYE - seen["cameraDepth"][face], front, 1e-5, hand)
        side = 1.0 if hand == "rightHanded" else -1.0
        compare.near(seen["normal"][face] * side, (0, 0, 1), 1e-5, "normals of a flat face")


def test_edits_show_and_are_fresh_pictures(host, folder):
    (folder / "scene.usda").write_text(stage(square()))
    with host.open(folder / "scene.usda", SIZE, aovs=AOVS, settings=SETTINGS) as view:
        first = view.render()
        fine = view.stats()["oocpt:uniqueTriangles"]
        shader = "UsdShade.Shader(stage.GetPrimAtPath('/World/Material/{}'))"
        edits = [
            (shader.format("Texture") + ".GetInput('file').Set(Sdf.AssetPath('./height.png'))",
             {"file": "./height.png"}),
            (shader.format("Texture") + ".GetInput('wrapS').Set('repeat')\n"
             + shader.format("Texture") + ".GetInput('wrapT').Set('repeat')",
             {"file": "./height.png", "wrap": "repeat"}),
            (shader.format("Surface") + ".GetInput('displacement').GetAttr().ClearConnections()\n"
             + shader.format("Surface") + ".GetInput('displacement').Set(0.5)", {"displacement": 0.5}),
            (shader.format("Surface") + ".GetInput('displacement').Set(0.0)", {"displacement": 0}),
        ]  # fmt: skip
        for code, now in edits:
            view.edit("from pxr import UsdShade, Sdf\n" + code)
            after = view.render()
            assert (after["cameraDepth"] != first["cameraDepth"]).any(), f"{now} does not show"
            compare.same_picture(after, picture(host, folder, stage(square(), **now)), f"{now}")
        assert view.stats()["oocpt:uniqueTriangles"] == 2 < fine, "what is not displaced is not cut"


def test_same_bits_at_every_budget(host, folder):
    settings = {**SETTINGS, "oocpt:maxBounces": 2, "oocpt:chunkSize": 64}
    (folder / "scene.usda").write_text(stage(square()))
    with host.open(folder / "scene.usda", SIZE, aovs=AOVS, settings=settings) as view:
        expected, stats = view.render(), view.stats()
    test_streaming.assert_everything_resident(stats)
    for share in (50, 15):
        kib = test_streaming.budget_kib(stats, 0, share)
        limited = settings | {"oocpt:geometryBudget": kib}
        with host.open(folder / "scene.usda", SIZE, aovs=AOVS, settings=limited) as view:
            seen = view.render()
            test_streaming.assert_within_budget(view.stats(), kib, share == 15)
        compare.same_picture(seen, expected, f"{kib} KiB")


def test_undisplaceable_prims_give_one_warning(host, folder):
    x, y = pixels()
    inside = np.maximum(np.abs(x), np.abs(y)) < 0.9
    cases = [
        (stage(square(), terminal=""), 0.0, "displacement output is not connected"),
        (stage(square(), displacement="nan"), 0.0, "`displacement` of /World/Material/Surface is not finite"),
        (stage(square(), displacement=1e30), 0.0, "displacements that are not finite or too large"),
        (stage(square(), file="./gone.exr"), 1.0, "the texture ./gone.exr of /World/Material/Texture was not found"),
    ]
    for text, height, message in cases:
        seen = picture(host, folder, text)
        compare.near(EYE - seen["cameraDepth"][inside], height, 1e-5, message)
        assert seen.log.count(message) == 1, f"{message}: {seen.log}"
