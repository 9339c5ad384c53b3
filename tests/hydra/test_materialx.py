# SPDX-License-Identifier: Apache-2.0
"""MaterialX through Hydra, both front ends: documents that a scene references, networks that USD encodes, which of a
material's networks counts, warnings."""

import math

import pytest

import compare

SETTINGS = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 1}

SCENE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World"
{{
    def Camera "Camera"
    {{
        token projection = "orthographic"
        float horizontalAperture = 20
        float verticalAperture = 20
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }}
    def Mesh "Board" (prepend apiSchemas = ["MaterialBindingAPI"])
    {{
        uniform token subdivisionScheme = "none"
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
        rel material:binding = <{binding}>
    }}
    {materials}
}}
"""

DOCUMENT = """<?xml version="1.0"?>
<materialx version="1.38" colorspace="lin_rec709">
  <nodegraph name="NG">
    <ramplr name="across" type="color3">
      <input name="valuel" type="color3" value="1, 0, 0" />
      <input name="valuer" type="color3" value="0, 0, 1" />
    </ramplr>
    <multiply name="half" type="color3">
      <input name="in1" type="color3" nodename="across" />
      <input name="in2" type="float" value="0.5" />
    </multiply>
    <output name="out" type="color3" nodename="half" />
  </nodegraph>
  <standard_surface name="SR" type="surfaceshader">
    <input name="base" type="float" value="0" />
    <input name="specular" type="float" value="0" />
    <input name="emission" type="float" value="2" />
    <input name="emission_color" type="color3" nodegraph="NG" output="out" />
  </standard_surface>
  <surfacematerial name="Glow" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="SR" />
  </surfacematerial>
</materialx>
"""

OPEN_PBR = """
    def Material "M"
    {
        token outputs:mtlx:surface.connect = </World/M/S.outputs:out>
        token outputs:surface.connect = </World/M/P.outputs:surface>
        def Shader "S"
        {
            uniform token info:id = "ND_open_pbr_surface_surfaceshader"
            float inputs:base_weight = 0
            float inputs:specular_weight = 0
            float inputs:emission_luminance = 1
            color3f inputs:emission_color.connect = </World/M/C.outputs:out>
            token outputs:out
        }
        def Shader "C"
        {
            uniform token info:id = "ND_mix_color3"
            color3f inputs:fg = (1, 0, 0.5)
            color3f inputs:bg = (0, 1, 0.5)
            float inputs:mix = 0.25
            color3f outputs:out
        }
        def Shader "P"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:emissiveColor = (9, 9, 9)
            token outputs:surface
        }
    }
"""


def pixels(view):
    return view.render()["color"][..., :3]


def test_a_document_is_rendered(host, tmp_path):
    """A referenced .mtlx: its ramp goes from red to blue over the board."""
    (tmp_path / "glow.mtlx").write_text(DOCUMENT)
    reference = f'def "Looks" (references = @{tmp_path}/glow.mtlx@</MaterialX>) {{ }}'
    scene = tmp_path / "scene.usda"
    scene.write_text(SCENE.format(binding="/World/Looks/Materials/Glow", materials=reference))
    with host.open(scene, (16, 16), settings=SETTINGS) as view:
        image = pixels(view)
    for column in range(16):
        u = (column + 0.5) / 16
        # Samples of a pixel are spread over its width.
        compare.near(image[:, column].mean(axis=0), (1 - u, 0, u), 0.02, f"column {column}")


def test_the_mtlx_network_wins_over_the_universal_one(host):
    """Where a material has one for `mtlx` and one for every renderer, it is the first."""
    with host.open(SCENE.format(binding="/World/M", materials=OPEN_PBR), (8, 8), settings=SETTINGS) as view:
        compare.near(pixels(view), (0.25, 0.75, 0.5), 1e-5, "a mix that is constant")


def test_an_edit_of_a_pattern_is_seen(host):
    with host.open(SCENE.format(binding="/World/M", materials=OPEN_PBR), (8, 8), settings=SETTINGS) as view:
        pixels(view)
        view.edit("stage.GetAttributeAtPath('/World/M/C.inputs:mix').Set(1.0)")
        compare.near(pixels(view), (1, 0, 0.5), 1e-5, "the front of the mix")


@pytest.mark.parametrize(
    "old, new, words",
    [
        ('"ND_mix_color3"', '"ND_blur_color3"', "`blur`"),
        ('"ND_mix_color3"', '"ND_no_such_node"', "no_such_node"),
        ("color3f inputs:fg = (1, 0, 0.5)", "color3f inputs:fg.connect = </World/M/C.outputs:out>", "in a circle"),
        (
            "float inputs:specular_weight = 0",
            "color3f inputs:transmission_scatter = (0.5, 0.5, 0.5)",
            "not supported yet: scattering inside",
        ),
    ],
    ids=["unsupported", "unknown", "circle", "left out"],
)
def test_unsupported_nodes_give_one_warning_with_the_prim(host, old, new, words):
    assert old in OPEN_PBR
    scene = SCENE.format(binding="/World/M", materials=OPEN_PBR.replace(old, new))
    with host.open(scene, (8, 8), settings=SETTINGS) as view:
        log = view.render().log
    lines = [line for line in log.splitlines() if "/World/M" in line and "arning" in line]
    assert len(lines) == 1 and words in lines[0], log


DEFINITIONS = """<?xml version="1.0"?>
<materialx version="1.38"{space}>
  <nodedef name="ND_half_color3" node="half">
    <input name="in" type="color3" value="1, 1, 1" />
    <output name="out" type="color3" />
  </nodedef>
  <nodegraph name="NG_half" nodedef="ND_half_color3">
    <multiply name="m" type="color3">
      <input name="in1" type="color3" interfacename="in" />
      <input name="in2" type="float" value="0.5" />
    </multiply>
    <output name="out" type="color3" nodename="m" />
  </nodegraph>
</materialx>
"""

USER = """<?xml version="1.0"?>
<materialx version="1.38">
  <xi:include href="{include}" />
  <nodegraph name="NG">
    <half name="h" type="color3"{space}><input name="in" type="color3" value="0.2, 0.4, 0.6" /></half>
    <output name="out" type="color3" nodename="h" />
  </nodegraph>
  <surface_unlit name="S" type="surfaceshader">
    <input name="emission_color" type="color3" nodegraph="NG" output="out" />
  </surface_unlit>
  <surfacematerial name="Half" type="material">
    <input name="surfaceshader" type="surfaceshader" nodename="S" />
  </surfacematerial>
</materialx>
"""


def half(folder, include: str, space: str = ""):
    """A scene whose material halves (0.2, 0.4, 0.6) by a node that a document of its own defines."""
    (folder / "user.mtlx").write_text(USER.format(include=include, space=space))
    reference = f'def "Looks" (references = @{folder}/user.mtlx@</MaterialX>) {{ }}'
    scene = folder / "scene.usda"
    scene.write_text(SCENE.format(binding="/World/Looks/Materials/Half", materials=reference))
    return scene


def test_definitions_of_a_referenced_document_are_nodes(host, tmp_path):
    """Nobody names them but the document that includes them."""
    (tmp_path / "defs.mtlx").write_text(DEFINITIONS.format(space=""))
    with host.open(half(tmp_path, "defs.mtlx"), (8, 8), settings=SETTINGS) as view:
        picture = view.render()
    compare.near(picture["color"][..., :3], (0.1, 0.2, 0.3), 1e-5, "halved")
    assert "OocPT: warning" not in picture.log, picture.log


@pytest.mark.parametrize("scene_index", [False, True], ids=["legacy", "scene index"])
def test_definitions_of_search_paths_are_nodes(fresh_host, tmp_path, scene_index):
    """OpenUSD finds what a namespace defines where its search paths lead."""
    own = tmp_path / "own"
    own.mkdir()
    (own / "defs.mtlx").write_text(DEFINITIONS.format(space=' namespace="mine"'))
    scene = half(tmp_path, "own/defs.mtlx", ' namespace="mine"')
    host = fresh_host(scene_index, PXR_MTLX_PLUGIN_SEARCH_PATHS=str(own))
    with host.open(scene, (8, 8), settings=SETTINGS) as view:
        picture = view.render()
    compare.near(picture["color"][..., :3], (0.1, 0.2, 0.3), 1e-5, "halved")
    assert "OocPT: warning" not in picture.log, picture.log


FIBRE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World"
{
    def Camera "Camera"
    {
        token projection = "orthographic"
        float horizontalAperture = 20
        float verticalAperture = 20
        double3 xformOp:translate = (0, 0, 5)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def BasisCurves "Fibre" (prepend apiSchemas = ["MaterialBindingAPI"])
    {
        uniform token type = "linear"
        int[] curveVertexCounts = [2]
        point3f[] points = [(-3, 0, 0), (3, 0, 0)]
        float[] widths = [1.6] (interpolation = "constant")
        rel material:binding = </World/Hair>
    }
    def DomeLight "Sky"
    {
        float inputs:intensity = 1
    }
    def Material "Hair"
    {
        token outputs:mtlx:surface.connect = </World/Hair/S.outputs:out>
        def Shader "S"
        {
            uniform token info:id = "ND_surface"
            token inputs:bsdf.connect = </World/Hair/B.outputs:out>
            token outputs:out
        }
        def Shader "B"
        {
            uniform token info:id = "ND_chiang_hair_bsdf"
            float2 inputs:roughness_R.connect = </World/Hair/R.outputs:roughness_R>
            float2 inputs:roughness_TT.connect = </World/Hair/R.outputs:roughness_TT>
            float2 inputs:roughness_TRT.connect = </World/Hair/R.outputs:roughness_TRT>
            vector3f inputs:absorption_coefficient.connect = </World/Hair/A.outputs:absorption>
            token outputs:out
        }
        def Shader "R"
        {
            uniform token info:id = "ND_chiang_hair_roughness"
            float2 outputs:roughness_R
            float2 outputs:roughness_TT
            float2 outputs:roughness_TRT
        }
        def Shader "A"
        {
            uniform token info:id = "ND_chiang_hair_absorption_from_color"
            color3f inputs:color = (0.05, 0.05, 0.05)
            float inputs:azimuthal_roughness = 0.3
            vector3f outputs:absorption
        }
    }
}
"""


def let_through(h, absorption, eta=1.55):
    """All that a fibre across the view scatters where it is met at h: Chiang et al. 2016, eq. 13, and its series."""
    cosine = math.sqrt(1 - h * h)
    inner = math.sqrt(1 - (h / eta) ** 2)
    s = (cosine - eta * inner) / (cosine + eta * inner)
    p = (eta * cosine - inner) / (eta * cosine + inner)
    f = (s * s + p * p) / 2
    t = math.exp(-2 * absorption * inner)
    return f + (1 - f) ** 2 * t / (1 - f * t)


def test_hair_transmits_its_colour(host):
    """A fibre in a white dome: rows are places across it. Helper nodes and their outputs come through Hydra."""
    x = 0.3
    below = 5.969 - 0.215 * x + 2.532 * x**2 - 10.73 * x**3 + 5.574 * x**4 + 0.245 * x**5
    absorption = (math.log(0.05) / below) ** 2
    with host.open(FIBRE, (32, 32), settings=SETTINGS) as view:
        image = pixels(view)
    for row in range(4, 28):
        heights = [((row + (k + 0.5) / 16) / 16 - 1) / 0.8 for k in range(16)]
        known = sum(let_through(h, absorption) for h in heights) / 16
        compare.near(image[row].mean(axis=0), (known,) * 3, 4e-3, f"row {row}")
