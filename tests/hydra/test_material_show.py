# SPDX-License-Identifier: Apache-2.0
"""`oocpt material show`: what a host's renders make of the materials of a file, as text."""

import json

import pytest

import small
from test_doctor import oocpt  # noqa: F401  a fixture
from test_materialx import DOCUMENT, OPEN_PBR, SCENE

PREVIEW = """
    def Material "M"
    {
        token outputs:surface.connect = </World/M/P.outputs:surface>
        def Shader "P"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/M/T.outputs:rgb>
            float inputs:roughness = 0.25
            token outputs:surface
        }
        def Shader "T"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @gone.png@
            float4 inputs:fallback = (0.5, 0.25, 0.125, 1)
            float3 outputs:rgb
        }
    }
"""
BINDING = "rel material:binding = </World/M>"


def shown(oocpt, *arguments):  # noqa: F811
    done = oocpt("material", "show", *arguments)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_document_is_shown_as_authored_folded_and_as_bytecode(oocpt, tmp_path):  # noqa: F811
    (tmp_path / "glow.mtlx").write_text(DOCUMENT)
    scene = tmp_path / "a scene.usda"
    looks = 'def "Looks" (references = @glow.mtlx@</MaterialX>) { }'
    scene.write_text(SCENE.format(binding="/World/Looks/Materials/Glow", materials=looks))
    text = shown(oocpt, scene, "/World/Looks/Materials/Glow")
    assert text.startswith("/World/Looks/Materials/Glow: ND_standard_surface_surfaceshader\n"), text
    arrived, folded = text.split("folded")
    assert "ND_ramplr_color3" in arrived and "valuer = (0, 0, 1)" in arrived, text
    assert "in1 <- /World/Looks/Materials/Glow/NG/across.out" in arrived, text
    assert 'mix((1, 0, 0, 0), (0, 0, 1, 0), clamp(swizzle(uv "st", x), 0, 1))' in folded, text
    assert "bytecode: 6 instructions (0 of noise), 1 register, 6 constants, 0 texture lookups" in folded, text
    light = folded.split("bytecode of the emission, for points of the light: ")[1]
    assert light.startswith("6 instructions (0 of noise), 1 register, 6 constants, 0 texture lookups"), text
    assert 'r0 = uv "st"' in light.split("for each hit")[0] and "r0 = multiply(2, r0)" in light, text
    assert 'r0 = uv "st"' in folded and "r0 = multiply(2, r0)" in folded and "EMISSIVE" in folded, text
    assert "warnings" not in text, text


def test_all_materials_that_are_shown_are_listed(oocpt, tmp_path):  # noqa: F811
    scene = tmp_path / "two.usda"
    preview = PREVIEW.replace('"M"', '"N"').replace("World/M", "World/N")
    board = f'def Sphere "Ball" (prepend apiSchemas = ["MaterialBindingAPI"]) {{\n{BINDING.replace("M>", "N>")}\n}}'
    scene.write_text(SCENE.format(binding="/World/M", materials=OPEN_PBR + preview + board))
    lines = shown(oocpt, scene).splitlines()
    assert lines[0].split(None, 1) == [
        "/World/M", "ND_open_pbr_surface_surfaceshader, 2 nodes, 0 instructions, 0 textures, 0 warnings",
    ], lines  # fmt: skip
    assert lines[1].split(None, 1) == [
        "/World/N", "UsdPreviewSurface, 2 nodes, 0 instructions, 0 textures, 1 warning",
    ], lines  # fmt: skip
    assert lines[2] == "2 materials", lines


def test_a_preview_surface_is_shown_with_its_warning_once(oocpt, tmp_path):  # noqa: F811
    scene = tmp_path / "preview.usda"
    scene.write_text(SCENE.format(binding="/World/M", materials=PREVIEW))
    text = shown(oocpt, scene, "/World/M")
    inputs = dict(line.strip().rsplit("  ", 1) for line in text.splitlines() if line.startswith("  diffuse color "))
    assert list(inputs.values()) == ["(0.5, 0.25, 0.125)"] and "bytecode: none" in text, text
    assert text.count("was not found") == 1 and "/World/M/T" in text.split("warnings")[1], text


def test_a_material_that_nothing_shows_is_found_by_its_path(oocpt, tmp_path, monkeypatch):  # noqa: F811
    """A library of materials: no camera, no mesh, no default prim. The new front end lists it without being asked."""
    monkeypatch.setenv("USDIMAGINGGL_ENGINE_ENABLE_SCENE_INDEX", "0")
    scene = tmp_path / "library.usda"
    scene.write_text("#usda 1.0\n" + OPEN_PBR.replace("World/M", "M").replace('"ND_mix_color3"', '"ND_blur_color3"'))
    assert shown(oocpt, scene) == "0 materials\n"
    said = json.loads(shown(oocpt, scene, "/M", "--json"))
    [material] = said["materials"]
    assert material["path"] == "/M" and material["surface"] == "ND_open_pbr_surface_surfaceshader", material
    assert [node["kind"] for node in material["nodes"]] == ["ND_blur_color3", "ND_open_pbr_surface_surfaceshader"]
    [warning] = material["warnings"]
    assert "`blur`" in warning and "/M/C" in warning, "the node is named"
    assert said["warnings"] == [], "and told once"


@pytest.mark.parametrize(
    "scene, path, words",
    [
        ("/no/such.usda", None, "cannot open /no/such.usda"),
        (small.FOLDER / "lambert.usda", "/World/Nowhere", "there is no material /World/Nowhere"),
        (small.FOLDER / "lambert.usda", "Nowhere", "is no path of a prim"),
        (small.FOLDER / "lambert.usda", "/World/Camera", "there is no material /World/Camera"),
    ],
    ids=["file", "path", "relative", "camera"],
)
def test_a_missing_material_gives_one_message(oocpt, scene, path, words):  # noqa: F811
    done = oocpt("material", "show", scene, *([path] if path else []))
    assert done.returncode == 1 and done.stderr.count(words) == 1 and not done.stdout, done.stderr


def test_a_report_is_written_over_nothing_else(host, tmp_path):
    """`oocpt:materialReport` may come from a file of strangers."""
    precious, report = tmp_path / "precious.txt", tmp_path / "report.json"
    precious.write_text("precious")
    scene = SCENE.format(binding="/World/M", materials=OPEN_PBR)
    settings = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}
    with host.open(scene, (4, 4), settings=settings | {"oocpt:materialReport": str(precious)}) as view:
        assert "left as it is" in view.render().log
        view.edit(f"engine.SetRendererSetting('oocpt:materialReport', {str(report)!r})")
        view.render()
        first = json.loads(report.read_text())
        view.edit("stage.GetAttributeAtPath('/World/M/C.inputs:mix').Set(1.0)")
        view.render()
        second = json.loads(report.read_text())
    assert precious.read_text() == "precious"
    emitted = [dict(map(tuple, text["materials"][0]["inputs"]))["emissive color"] for text in (first, second)]
    assert emitted == ["(0.25, 0.75, 0.5)", "(1, 0, 0.5)"], "as of the last edit"
