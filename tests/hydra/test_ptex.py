# SPDX-License-Identifier: Apache-2.0
"""Ptex through the host: a mesh of quads, triangles and other n-gons whose texels are a function of their places."""

from __future__ import annotations

import numpy as np
import ptex_files
import pytest
from pxr import UsdUtils

SIZE = (64, 64)
QUICK = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}
SIDE = 6

STAGE = """#usda 1.0
def Xform "World"
{
    def Camera "Camera"
    {
        token projection = "orthographic"
        float horizontalAperture = 20
        float verticalAperture = 20
        double3 xformOp:translate = (0, 0, 10)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def Mesh "Mesh" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        int[] faceVertexCounts = COUNTS
        int[] faceVertexIndices = INDICES
        point3f[] points = POINTS
        texCoord2f[] primvars:st = ST ( interpolation = "vertex" )
        uniform token subdivisionScheme = "none"
        rel material:binding = </World/Material>
    }
    def DomeLight "Dome" { float inputs:intensity = 1; }
    def Material "Material"
    {
        token outputs:surface.connect = </World/Material/Surface.outputs:surface>
        def Shader "Surface"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/Material/Texture.outputs:rgb>
            float inputs:roughness = 1
            OPACITY
            token outputs:surface
        }
        def Shader "Texture"
        {
            uniform token info:id = "NODE"
            asset inputs:file = @FILE@
            token inputs:sourceColorSpace = "raw"
            float4 inputs:fallback = (1, 0, 1, 1)
            float3 outputs:rgb
            float outputs:a
        }
    }
}
"""


def mesh() -> tuple[list[list[int]], np.ndarray]:
    """A square of quads whose first corners vary, of triangles, and of hexagons that two quads make."""
    at = lambda x, y: y * (SIDE + 1) + x  # noqa: E731
    points = np.array([[2 * x / SIDE - 1, 2 * y / SIDE - 1, 0.0] for y in range(SIDE + 1) for x in range(SIDE + 1)])
    faces = []
    for y in range(SIDE):
        for x in range(SIDE):
            quad = [at(x, y), at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]
            turn = (3 * x + 5 * y) % 4
            if (x, y) in ((1, 1), (3, 2), (4, 2), (0, 5)):
                faces += [[quad[0], quad[1], quad[2]], [quad[2], quad[3], quad[0]]]
            elif (x, y) in ((1, 3), (3, 4)):
                faces.append([quad[0], quad[1], at(x + 2, y), at(x + 2, y + 1), quad[2], quad[3]])
            elif (x - 1, y) not in ((1, 3), (3, 4)):
                faces.append(quad[turn:] + quad[:turn])
    return faces, points


def color(places: np.ndarray) -> np.ndarray:
    x, y = places[..., 0], places[..., 1]
    return np.stack(
        [0.5 + 0.4 * np.sin(2.1 * x + 0.7 * y), 0.5 + 0.4 * np.cos(1.7 * y - x), 0.5 + 0.3 * x * y], axis=-1
    )


def sizes(number: int) -> tuple[int, int]:
    return [(6, 6), (5, 6), (7, 5)][number % 3]


def stage(folder, file="./a.ptx", node="UsdUVTexture", opacity="") -> str:
    faces, points = mesh()
    tuples = (
        lambda rows: "[" + ", ".join("(" + ", ".join(f"{v:.9g}" for v in row) + ")" for row in rows) + "]"
    )  # noqa: E731
    text = STAGE.replace("COUNTS", str([len(face) for face in faces])).replace("INDICES", str(sum(faces, [])))
    text = text.replace("POINTS", tuples(points)).replace("ST", tuples(points[:, :2] / 2 + 0.5))
    (folder / "scene.usda").write_text(text.replace("FILE", file).replace("NODE", node).replace("OPACITY", opacity))
    return folder / "scene.usda"


def paint(path, kind=np.float32, channels=3, size=sizes, picture=color) -> None:
    faces, points = mesh()
    values = ptex_files.texels(faces, points, size, picture)
    if np.issubdtype(kind, np.integer):
        values = [np.round(value * np.iinfo(kind).max) for value in values]
    ptex_files.write(path, faces, [value[..., :channels].astype(kind) for value in values])


def expected(size=SIZE) -> np.ndarray:
    x = (np.arange(size[0]) + 0.5) / size[0] * 2 - 1
    grid = np.stack(np.meshgrid(x, x), axis=-1)
    return color(grid)


def says(picture) -> list[str]:
    return [line for line in picture.log.splitlines() if "OocPT" in line]


def off(picture) -> np.ndarray:
    # The sample of a pixel is somewhere in it.
    return np.abs(picture["albedo"] - expected())


@pytest.mark.parametrize("kind", [np.uint8, np.uint16, np.float16, np.float32])
@pytest.mark.parametrize("node", ["UsdUVTexture", "HwPtexTexture_1"])
def test_texels_are_where_they_were_painted(host, tmp_path, kind, node):
    paint(tmp_path / "a.ptx", kind)
    shown = host.picture(stage(tmp_path, node=node), SIZE, aovs=["color", "albedo"], settings=QUICK)
    assert not says(shown), shown.log
    assert off(shown).max() < 0.05 and off(shown).mean() < 0.012, (off(shown).max(), off(shown).mean())


def test_a_swapped_face_is_noticed(host, tmp_path):
    """The test above sees two faces that are exchanged, and an n-gon whose faces begin at another corner."""
    faces, points = mesh()
    values = ptex_files.texels(faces, points, lambda _: (5, 5), color)
    for shift in (slice(0, 2), slice(8, 11)):
        wrong = list(values)
        wrong[shift] = wrong[shift][1:] + wrong[shift][:1]
        ptex_files.write(tmp_path / "a.ptx", faces, [value.astype(np.float32) for value in wrong])
        shown = host.picture(stage(tmp_path), SIZE, aovs=["color", "albedo"], settings=QUICK)
        assert off(shown).max() > 0.05, shift


def test_edges_of_faces_are_filtered_across(host, tmp_path):
    """Few texels: without those of neighbours each face would be flat near its edges, with a step between two."""
    faces, points = mesh()
    ramp = lambda places: np.repeat(0.5 + 0.45 * places[..., :1], 3, axis=-1)  # noqa: E731
    values = ptex_files.texels(faces, points, lambda _: (1, 1), ramp)
    ptex_files.write(tmp_path / "a.ptx", faces, [value.astype(np.float32) for value in values])
    settings = {"oocpt:samplesPerPixel": 1, "oocpt:maxBounces": 0}
    size = (120, 120)
    shown = host.picture(stage(tmp_path), size, aovs=["color", "albedo"], settings=settings)["albedo"][..., 0]
    x = (np.arange(size[0]) + 0.5) / size[0] * 2 - 1
    # A row of plain quads, away from the border of the mesh.
    row = shown[5]
    inside = slice(15, 105)
    assert np.abs(row - (0.5 + 0.45 * x))[inside].max() < 0.02, np.abs(row - (0.5 + 0.45 * x))[inside].max()


def test_bits_are_the_same_at_every_budget_and_from_the_cache(fresh_host, tmp_path):
    paint(tmp_path / "a.ptx", np.uint8, size=lambda _: (8, 8))
    aovs, pictures = ["color", "albedo"], []
    settings = {"oocpt:samplesPerPixel": 16, "oocpt:maxBounces": 2}
    for run in (
        {},
        {},
        {"oocpt:chunkSize": 16, "oocpt:geometryBudget": 3000},
        {"oocpt:chunkSize": 16, "oocpt:geometryBudget": 600},
    ):
        host = fresh_host(OOCPT_TEXTURE_CACHE=str(tmp_path / "cache"))
        shown = host.picture(stage(tmp_path), SIZE, aovs=aovs, settings={"oocpt:chunkSize": 16, **settings, **run})
        assert not says(shown), shown.log
        pictures.append(shown)
        assert len(list((tmp_path / "cache").glob("*.tx"))) == 1, "one entry"
    for shown in pictures[1:]:
        np.testing.assert_array_equal(shown["color"], pictures[0]["color"])
        np.testing.assert_array_equal(shown["albedo"], pictures[0]["albedo"])


def test_alpha_cuts_out(host, tmp_path):
    """The fourth channel as opacity, which traversal asks for."""
    hole = lambda places: np.concatenate(  # noqa: E731
        [color(places), np.where(np.hypot(places[..., :1], places[..., 1:2]) < 0.5, 0.0, 1.0)], axis=-1)
    paint(tmp_path / "a.ptx", np.uint8, channels=4, size=lambda _: (6, 6), picture=hole)
    opacity = (
        "float inputs:opacity.connect = </World/Material/Texture.outputs:a>\n"
        "            float inputs:opacityThreshold = 0.5"
    )
    shown = host.picture(stage(tmp_path, opacity=opacity), SIZE, aovs=["color", "depth"], settings=QUICK)
    x = (np.arange(SIZE[0]) + 0.5) / SIZE[0] * 2 - 1
    radius = np.hypot(*np.meshgrid(x, x))
    clear = shown["depth"] >= 1.0
    assert clear[radius < 0.45].all() and not clear[radius > 0.55].any()


def test_a_package_may_hold_ptex(host, tmp_path):
    paint(tmp_path / "a.ptx")
    assert UsdUtils.CreateNewUsdzPackage(str(stage(tmp_path)), str(tmp_path / "scene.usdz"))
    (tmp_path / "a.ptx").unlink()
    shown = host.picture(tmp_path / "scene.usdz", SIZE, aovs=["color", "albedo"], settings=QUICK)
    assert not says(shown), shown.log
    assert off(shown).max() < 0.05


def test_files_that_cannot_be_read_are_one_warning_and_the_fallback(host, tmp_path):
    paint(tmp_path / "whole.ptx")
    whole = (tmp_path / "whole.ptx").read_bytes()
    triangles = whole[:8] + bytes(4) + whole[12:]
    few = ptex_files.content([[0, 1, 2, 3]], [np.zeros((4, 4, 3), np.float32)])
    cases = {"short": whole[: len(whole) // 2], "none": b"", "other": b"#!/bin/sh", "triangles": triangles}
    for name, content in cases.items():
        (tmp_path / f"{name}.ptx").write_bytes(content)
        shown = host.picture(stage(tmp_path, f"./{name}.ptx"), SIZE, aovs=["color", "albedo"], settings=QUICK)
        lines = says(shown)
        assert len(lines) == 1 and "/World/Material/Texture" in lines[0] and f"{name}.ptx" in lines[0], shown.log
        np.testing.assert_allclose(shown["albedo"], np.broadcast_to([1, 0, 1], shown["albedo"].shape), atol=1e-6)
    # Faces that the file does not have.
    (tmp_path / "few.ptx").write_bytes(few)
    shown = host.picture(stage(tmp_path, "./few.ptx"), SIZE, aovs=["color", "albedo"], settings=QUICK)
    is_fallback = (np.abs(shown["albedo"] - [1, 0, 1]) < 1e-6).all(axis=-1)
    assert 0.9 < is_fallback.mean() < 1.0, "all but the first face"
