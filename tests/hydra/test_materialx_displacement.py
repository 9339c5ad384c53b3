# SPDX-License-Identifier: Apache-2.0
"""MaterialX's `displacement` nodes through Hydra, both front ends: networks that USD encodes and documents that a scene
references against their height fields in numpy, vectors, subsets, same bits at budgets, what is not known."""

from __future__ import annotations

import numpy as np
import pytest

import compare
import test_streaming
from test_displacement import AOVS, EYE, SETTINGS, SIZE, is_quiet, pixels
from test_material_show import oocpt, shown  # noqa: F401  a fixture

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
    LOOKS
    def Mesh "Square" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] ( interpolation = "varying" )
        uniform token subdivisionScheme = "none"
        SUBSETS
    }
}
"""
BINDING = "rel material:binding = <BOUND>"
SUBSET = """def GeomSubset "All" ( prepend apiSchemas = ["MaterialBindingAPI"] )
        {
            uniform token elementType = "face"
            uniform token familyName = "materialBind"
            int[] indices = [0]
            rel material:binding = <BOUND>
        }"""
MATERIAL = """def Material "M"
    {
        token outputs:mtlx:surface.connect = </World/M/S.outputs:out>
        token outputs:mtlx:displacement.connect = </World/M/D.outputs:out>
        def Shader "S"
        {
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            token outputs:out
        }
        NODES
    }"""
# sin(5 s + 3 t) of the texture coordinates, times 0.25.
WAVES = """
        def Shader "D"
        {
            uniform token info:id = "ND_displacement_float"
            float inputs:displacement.connect = </World/M/Wave.outputs:out>
            float inputs:scale = 0.25
            token outputs:out
        }
        def Shader "Wave"
        {
            uniform token info:id = "ND_sin_float"
            float inputs:in.connect = </World/M/Along.outputs:out>
            float outputs:out
        }
        def Shader "Along"
        {
            uniform token info:id = "ND_dotproduct_vector2"
            float2 inputs:in1.connect = </World/M/Place.outputs:out>
            float2 inputs:in2 = (5, 3)
            float outputs:out
        }
        def Shader "Place"
        {
            uniform token info:id = "ND_texcoord_vector2"
            float2 outputs:out
        }"""
VECTOR = """
        def Shader "D"
        {
            uniform token info:id = "ND_displacement_vector3"
            float3 inputs:displacement = (0.125, -0.25, 0.5)
            float inputs:scale = 2
            token outputs:out
        }"""
VIEW = """
        def Shader "D"
        {
            uniform token info:id = "ND_displacement_vector3"
            float3 inputs:displacement.connect = </World/M/View.outputs:out>
            token outputs:out
        }
        def Shader "View"
        {
            uniform token info:id = "ND_viewdirection_vector3"
            float3 outputs:out
        }"""
WORLD = """
        def Shader "D"
        {
            uniform token info:id = "ND_displacement_vector3"
            float3 inputs:displacement.connect = </World/M/Point.outputs:out>
            float inputs:scale = -0.25
            token outputs:out
        }
        def Shader "Point"
        {
            uniform token info:id = "ND_position_vector3"
            string inputs:space = "world"
            float3 outputs:out
        }"""
DOCUMENT = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709">
  <nodegraph name="NG">
    <texcoord name="place" type="vector2" />
    <dotproduct name="along" type="float">
      <input name="in1" type="vector2" nodename="place" />
      <input name="in2" type="vector2" value="5, 3" />
    </dotproduct>
    <sin name="wave" type="float">
      <input name="in" type="float" nodename="along" />
    </sin>
    <output name="out" type="float" nodename="wave" />
  </nodegraph>
  <standard_surface name="SR" type="surfaceshader" />
  <displacement name="DR" type="displacementshader">
    <input name="displacement" type="float" nodegraph="NG" output="out" />
    <input name="scale" type="float" value="0.25" />
  </displacement>
  <surfacematerial name="Rough" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR" />
    <input name="displacementshader" type="displacementshader" nodename="DR" />
  </surfacematerial>
</materialx>
"""


def stage(nodes, *, material="/World/M", looks=None, by_subset=False):
    bound = (SUBSET if by_subset else BINDING).replace("BOUND", material)
    looks = MATERIAL.replace("NODES", nodes) if looks is None else looks
    return STAGE.replace("LOOKS", looks).replace("SUBSETS", bound)


def picture(host, folder, text, **arguments):
    (folder / "scene.usda").write_text(text)
    return host.picture(folder / "scene.usda", SIZE, **{"aovs": AOVS, "settings": SETTINGS, **arguments})


def waves(x, y):
    return 0.25 * np.sin(5 * (x + 1) / 2 + 3 * (y + 1) / 2)


def is_wavy(seen):
    x, y = pixels()
    inside = np.maximum(np.abs(x), np.abs(y)) < 0.97
    assert (seen["elementId"][inside] >= 0).all(), "no hole"
    off = np.abs(EYE - seen["cameraDepth"] - waves(x, y))[inside]
    # A piece of half a pixel is 0.02 wide: chords are 0.25 (sqrt(34) / 2)^2 0.02^2 / 8 = 1e-4 off.
    assert off.max() < 2e-4, f"{off.max()} off"
    phase = 0.25 * np.cos(5 * (x + 1) / 2 + 3 * (y + 1) / 2)
    normal = np.stack([-2.5 * phase, -1.5 * phase, np.ones_like(x)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    dots = (seen["normal"] * normal).sum(axis=-1)[inside]
    assert dots.min() > 0.9995, f"normals: {dots.min()}"


def document(tmp_path):
    (tmp_path / "rough.mtlx").write_text(DOCUMENT)
    return 'def "Looks" (references = @./rough.mtlx@</MaterialX>) { }'


@pytest.mark.parametrize("by_subset", [False, True])
def test_a_network_is_its_height_field(host, tmp_path, by_subset):
    seen = picture(host, tmp_path, stage(WAVES, by_subset=by_subset))
    is_quiet(seen)
    is_wavy(seen)


def test_a_document_is_its_height_field(host, tmp_path):
    text = stage("", material="/World/Looks/Materials/Rough", looks=document(tmp_path))
    seen = picture(host, tmp_path, text)
    is_quiet(seen)
    is_wavy(seen)


def test_vectors_go_along_the_frame_of_the_surface(host, tmp_path):
    """A square of side 2 is moved as a whole, by twice (0.125, -0.25, 0.5)."""
    seen = picture(host, tmp_path, stage(VECTOR))
    is_quiet(seen)
    x, y = pixels()
    expected = (np.abs(x - 0.25) < 1) & (np.abs(y + 0.5) < 1)
    assert ((seen["elementId"] >= 0) == expected).all(), "where it is"
    compare.near(EYE - seen["cameraDepth"][expected], 1.0, 1e-5, "how high")


def test_edits_show_and_are_fresh_pictures(host, tmp_path):
    (tmp_path / "scene.usda").write_text(stage(WAVES))
    with host.open(tmp_path / "scene.usda", SIZE, aovs=AOVS, settings=SETTINGS) as view:
        first = view.render()
        shader = "UsdShade.Shader(stage.GetPrimAtPath('/World/M/{}'))"
        edits = [
            (shader.format("Along") + ".GetInput('in2').Set((5, 4))", {"(5, 3)": "(5, 4)"}),
            (shader.format("D") + ".GetInput('scale').Set(0.5)", {"(5, 3)": "(5, 4)", "scale = 0.25": "scale = 0.5"}),
        ]
        for code, changes in edits:
            view.edit("from pxr import UsdShade\n" + code)
            after = view.render()
            assert (after["cameraDepth"] != first["cameraDepth"]).any(), f"{changes} does not show"
            now = WAVES
            for old, new in changes.items():
                now = now.replace(old, new)
            compare.same_picture(after, picture(host, tmp_path, stage(now)), f"{changes}")


def test_same_bits_at_every_budget(host, tmp_path):
    settings = {**SETTINGS, "oocpt:maxBounces": 2, "oocpt:chunkSize": 64}
    (tmp_path / "scene.usda").write_text(stage(WAVES))
    with host.open(tmp_path / "scene.usda", SIZE, aovs=AOVS, settings=settings) as view:
        expected, stats = view.render(), view.stats()
    test_streaming.assert_everything_resident(stats)
    kib = test_streaming.budget_kib(stats, 0, 15)
    limited = settings | {"oocpt:geometryBudget": kib}
    with host.open(tmp_path / "scene.usda", SIZE, aovs=AOVS, settings=limited) as view:
        seen = view.render()
        test_streaming.assert_within_budget(view.stats(), kib, True)
    compare.same_picture(seen, expected, f"{kib} KiB")


def test_unsupported_displacement_gives_one_warning(host, tmp_path):
    x, y = pixels()
    inside = np.maximum(np.abs(x), np.abs(y)) < 0.9
    seen = picture(host, tmp_path, stage(VIEW))
    assert seen.log.count("is not known where meshes are displaced") == 1, seen.log
    assert seen.log.count("/World/M/View") == 1, seen.log
    compare.near(EYE - seen["cameraDepth"][inside], 0.0, 1e-5, "it stays")
    # Where the square stands does not count: it shrinks by a quarter around its own origin.
    moved = """double3 xformOp:translate = (0.25, 0, 0)
        uniform token[] xformOpOrder = ["xformOp:translate"]
        uniform token subdivisionScheme"""
    seen = picture(host, tmp_path, stage(WORLD).replace("uniform token subdivisionScheme", moved))
    assert seen.log.count("it is the object's space") == 1 and seen.log.count("/World/M/Point") == 1, seen.log
    assert ((seen["elementId"] >= 0) == ((np.abs(x - 0.25) < 0.75) & (np.abs(y) < 0.75))).all(), "where it is"


def test_materials_are_shown_with_their_displacement(oocpt, tmp_path):  # noqa: F811
    scene = tmp_path / "scene.usda"
    scene.write_text(stage(WAVES))
    text = shown(oocpt, scene, "/World/M")
    assert 'displacement  multiply(sin(dot[2](uv "st", (5, 3, 0, 0))), 0.25)' in text, text
    assert "bytecode of the displacement, for vertices: 4 instructions" in text, text
    scene.write_text(stage(VECTOR))
    text = shown(oocpt, scene, "/World/M")
    assert "displacement  (0.25, -0.5, 1) along tangent, bitangent and normal" in text, text
