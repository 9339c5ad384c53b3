# SPDX-License-Identifier: Apache-2.0
"""Cryptomatte layers, read by a decoder of their own: names and shares are those that colours say.

Each thing in the scene emits one of the three primaries and reflects nothing, so a channel of the picture is the share
of the pixel that this thing has: with nested instances, motion, hair and depth of field.
"""

import json
import os
import struct
import subprocess

import numpy as np
import OpenEXR
import pytest

MATERIAL = """
    def Material "{name}"
    {{
        token outputs:surface.connect = </World/Looks/{name}/S.outputs:surface>
        def Shader "S"
        {{
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            color3f inputs:emissiveColor = {color}
            float inputs:ior = 1
            float inputs:roughness = 1
            token outputs:surface
        }}
    }}
"""
CARD = """
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)]
        uniform token subdivisionScheme = "none"
"""
SCENE = (
    """#usda 1.0
(
    endTimeCode = 2
    startTimeCode = 1
    timeCodesPerSecond = 24
)
def Camera "Eye"
{
    float focalLength = 35
    float fStop = 0.5
    float focusDistance = 9
    double shutter:open = 0
    double shutter:close = 0.5
    double3 xformOp:translate = (0.13, 0.09, 9)
    uniform token[] xformOpOrder = ["xformOp:translate"]
}
def Xform "World"
{
    def Scope "Looks"
    {
"""
    + MATERIAL.format(name="Red", color=(1, 0, 0))
    + MATERIAL.format(name="Green", color=(0, 1, 0))
    + MATERIAL.format(name="Blue", color=(0, 0, 1))
    + """
    }
    def Mesh "Mover" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </World/Looks/Red>
        double3 xformOp:translate.timeSamples = { 1: (-1.4, 0.4, 0.5), 2: (0.6, 0.4, 0.5) }
        uniform token[] xformOpOrder = ["xformOp:translate"]
"""
    + CARD
    + """
    }
    def BasisCurves "Hair" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        rel material:binding = </World/Looks/Blue>
        uniform token type = "linear"
        int[] curveVertexCounts = [2, 2, 2]
        point3f[] points = [(-2, -1, 1), (2, 1.2, 1), (-2, 0, 1), (2, 0.3, 1), (-1, -1.5, 1), (-0.6, 1.5, 1)]
        float[] widths = [0.08] (interpolation = "constant")
    }
    def PointInstancer "Forest"
    {
        int[] protoIndices = [0, 0, 0]
        point3f[] positions = [(-1.2, -0.6, 0), (0, -0.8, -1), (1.1, -0.5, 0)]
        rel prototypes = </World/Forest/Tree>
        def Xform "Tree"
        {
            def PointInstancer "Leaves"
            {
                int[] protoIndices = [0, 0]
                point3f[] positions = [(-0.3, 0, 0), (0.35, 0.2, 0.1)]
                rel prototypes = </World/Forest/Tree/Leaves/Leaf>
                def Mesh "Leaf" (prepend apiSchemas = ["MaterialBindingAPI"])
                {
                    rel material:binding = </World/Looks/Green>
"""
    + CARD
    + """
                }
            }
        }
    }
}
"""
)


def murmur3(text):
    """MurmurHash3_x86_32 with seed 0, as its reference has it, in Python."""
    data, mask = text.encode(), 0xFFFFFFFF

    def mixed(k):
        k = k * 0xCC9E2D51 & mask
        return ((k << 15 | k >> 17) & mask) * 0x1B873593 & mask

    h = 0
    whole = len(data) - len(data) % 4
    for at in range(0, whole, 4):
        h ^= mixed(struct.unpack_from("<I", data, at)[0])
        h = ((h << 13 | h >> 19) & mask) * 5 + 0xE6546B64 & mask
    h ^= mixed(int.from_bytes(data[whole:], "little"))
    h ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        h = (h ^ h >> shift) * factor & mask
    return h ^ h >> 16


def matte(layers, header, layer):
    """Shares by name: arrays of the picture's size."""
    key = f"cryptomatte/{murmur3(layer):08x}"[: len("cryptomatte/") + 7]
    assert header[f"{key}/name"] == layer and header[f"{key}/hash"] == "MurmurHash3_32", sorted(header)
    assert header[f"{key}/conversion"] == "uint32_to_float32"
    names = {int(value, 16): name for name, value in json.loads(header[f"{key}/manifest"]).items()}
    for value, name in names.items():
        hashed = murmur3(name)
        assert value in (hashed, hashed ^ 1 << 23), name
    shares = {}
    for level in range(3):
        for id_channel, share_channel in ("RG", "BA"):
            ids = layers[f"{layer}{level:02}.{id_channel}"].view(np.uint32)
            share = layers[f"{layer}{level:02}.{share_channel}"]
            for value in np.unique(ids[share > 0]):
                name = names[int(value)]
                have = shares.setdefault(name, np.zeros(ids.shape, np.float32))
                have += np.where(ids == value, share, 0)
    return shares


@pytest.fixture(scope="module", params=["0", "1"], ids=["legacy", "scene_index"])
def picture(request, tmp_path_factory):
    """All layers of the scene's picture, and the header."""
    folder = tmp_path_factory.mktemp("matte")
    scene, out = folder / "scene.usda", folder / "out.exr"
    scene.write_text(SCENE)
    variables = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=request.param)
    variables.pop("PYTHONPATH", None)
    words = ["--disableCameraLight", "--imageWidth", "96", "--samples", "32", "--set", "oocpt:maxBounces=0"]
    words += ["--aov", "CryptoObject,CryptoMaterial,CryptoAsset", "--frames", "1:1", "--camera", "Eye"]
    done = subprocess.run(
        ["usdrecord", *words, str(scene), str(folder / "out.#.exr")], env=variables, capture_output=True, text=True,
        timeout=300, check=False, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == 0 and "warning" not in done.stderr, done.stderr
    with OpenEXR.File(str(out.with_name("out.1.exr")), separate_channels=True) as file:
        return {name: channel.pixels for name, channel in file.channels().items()}, dict(file.header())


def named_scene():
    """The scene with texts in the primvar `dept`, of a prim, of instances and of nested ones, and in Arnold's."""
    added = {
        'def Mesh "Mover"': 'string primvars:dept = "hero"\n        string primvars:crypto_asset = "props"',
        'def BasisCurves "Hair"': 'token primvars:dept = "hero"',
        'def PointInstancer "Forest"': 'string[] primvars:dept = ["far", "oak", "", "樹é"] (interpolation = "varying")',
        'def PointInstancer "Leaves"': 'string[] primvars:dept = ["", "low"] (interpolation = "varying")',
    }
    # One more prototype, out of sight, so that numbers of instances are not their indices in a prototype.
    text = SCENE.replace("[0, 0, 0]", "[1, 0, 0, 0]", 1).replace("[(-1.2, -0.6, 0)", "[(99, 0, 0), (-1.2, -0.6, 0)", 1)
    text = text.replace("rel prototypes = </World/Forest/Tree>", "rel prototypes = [</World/Forest/Tree>, </World/Forest/Far>]", 1)
    tree = '        def Xform "Tree"'
    text = text.replace(tree, f'        def Mesh "Far"\n        {{\n{CARD}        }}\n{tree}', 1)
    for head, line in added.items():
        start = text.index("{", text.index(head)) + 1
        text = f"{text[:start]}\n        {line}{text[start:]}"
    odd = CARD + '        string[] primvars:dept = ["by face"] (interpolation = "uniform")\n'
    odd += (
        "        double3 xformOp:translate = (99, 0, 0)\n"
        '        uniform token[] xformOpOrder = ["xformOp:translate"]\n'
    )
    mover = '    def Mesh "Mover"'
    return text.replace(mover, f'    def Mesh "Odd"\n    {{\n{odd}    }}\n{mover}', 1)


@pytest.mark.parametrize("front_end", ["0", "1"], ids=["legacy", "scene_index"])
def test_a_primvar_names_prims_and_instances(tmp_path, front_end):
    """Names are the texts of the prim or of the innermost instance that has one, paths elsewhere, in every frame."""
    scene = tmp_path / "scene.usda"
    scene.write_text(named_scene())
    variables = dict(os.environ, USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX=front_end)
    variables.pop("PYTHONPATH", None)
    words = ["--disableCameraLight", "--imageWidth", "64", "--samples", "16", "--set", "oocpt:maxBounces=0"]
    words += ["--aov", "CryptoObject,CryptoObject:dept,CryptoAsset", "--frames", "1:2", "--camera", "Eye"]
    done = subprocess.run(
        ["usdrecord", *words, str(scene), str(tmp_path / "out.#.exr")], env=variables, capture_output=True, text=True,
        timeout=300, check=False, stdin=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("no text for the whole prim") == 1 and "/World/Odd" in done.stderr, done.stderr
    found = []
    for frame in (1, 2):
        with OpenEXR.File(str(tmp_path / f"out.{frame}.exr"), separate_channels=True) as file:
            layers = {name: channel.pixels for name, channel in file.channels().items()}
            header = dict(file.header())
        objects, named = matte(layers, header, "CryptoObject"), matte(layers, header, "CryptoObject_dept")
        own = next(name for name in objects if name.endswith("[1][0]"))
        assert set(named) == {"hero", "oak", "樹é", "low", own}, sorted(named)
        for name, ends in {"oak": ["[0][0]"], "樹é": ["[2][0]"], "low": ["[0][1]", "[1][1]", "[2][1]"]}.items():
            share = sum(share for thing, share in objects.items() if thing[-6:] in ends)
            assert share.any()
            close(named[name], share, name)
        close(named["hero"], layers["R"] + layers["B"], "two things of one name are one")
        close(named[own], objects[own], "an empty text is none")
        close(matte(layers, header, "CryptoAsset")["props"], layers["R"], "Arnold's primvar")
        found.append({key: value for key, value in header.items() if key.endswith("/manifest")})
    assert found[0] == found[1], "frames"


def close(share, expected, what):
    assert np.abs(share - expected).max() < 1e-5, what


def test_shares_are_what_colours_say(picture):
    layers, header = picture
    objects = matte(layers, header, "CryptoObject")
    by_end = {}
    for name, share in objects.items():
        end = name.split("[")[0].rsplit("/", 1)[-1]
        kind = next(kind for kind in ("Mover", "Hair", "Leaf") if kind.lower() in end.lower())
        by_end.setdefault(kind, []).append((name, share))
    assert {kind: len(all_of) for kind, all_of in by_end.items()} == {"Mover": 1, "Hair": 1, "Leaf": 6}, sorted(objects)
    for kind, channel in (("Mover", "R"), ("Leaf", "G"), ("Hair", "B")):
        total = sum(share for _, share in by_end[kind])
        close(total, layers[channel], kind)
        assert ((total > 0.05) & (total < 0.95)).sum() > 100, f"{kind} has soft edges"
    indices = sorted(name[name.index("[") :] for name, _ in by_end["Leaf"])
    assert indices == [f"[{outer}][{inner}]" for outer in range(3) for inner in range(2)]


def test_materials_and_assets(picture):
    layers, header = picture
    materials = matte(layers, header, "CryptoMaterial")
    assert sorted(materials) == [f"/World/Looks/{name}" for name in ("Blue", "Green", "Red")]
    for name, channel in (("Red", "R"), ("Green", "G"), ("Blue", "B")):
        close(materials[f"/World/Looks/{name}"], layers[channel], name)
    assets = matte(layers, header, "CryptoAsset")
    assert sorted(assets) == ["/World", "/World/Forest[0]", "/World/Forest[1]", "/World/Forest[2]"]
    close(assets["/World"], layers["R"] + layers["B"], "what no instancer places")
    close(sum(assets[f"/World/Forest[{at}]"] for at in range(3)), layers["G"], "placements")
    objects = matte(layers, header, "CryptoObject")
    for outer in range(3):
        leaves = sum(share for name, share in objects.items() if f"[{outer}][" in name)
        close(assets[f"/World/Forest[{outer}]"], leaves, f"placement {outer}")
