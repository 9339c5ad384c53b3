# SPDX-License-Identifier: Apache-2.0
"""Files of textures through a whole render: what is in the file is on the surface, in both front ends; what is wrong
with a file is said once.

The albedo output of a square that fills an orthographic view has one texel of the texture in each pixel's middle, so it
is the file.
"""

from __future__ import annotations

import numpy as np
import OpenEXR
import pytest
from PIL import Image
from pxr import Usd, UsdUtils

SIZE = (8, 8)
QUICK = {"oocpt:samplesPerPixel": 4, "oocpt:maxBounces": 1}
FALLBACK = (1.0, 0.0, 1.0)
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
    def Mesh "Square" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]
        texCoord2f[] primvars:st = [(0, 0), (EXTENT, 0), (EXTENT, EXTENT), (0, EXTENT)] ( interpolation = "vertex" )
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
            token outputs:surface
        }
        def Shader "Texture"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @FILE@
            token inputs:sourceColorSpace = "raw"
            token inputs:wrapS = "clamp"
            token inputs:wrapT = "clamp"
            float4 inputs:fallback = (1, 0, 1, 1)
            float2 inputs:st.connect = </World/Material/Reader.outputs:result>
            float3 outputs:rgb
        }
        def Shader "Reader"
        {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }
}
"""


def texels(kind) -> np.ndarray:
    random = np.random.default_rng(11).random((SIZE[1], SIZE[0], 3))
    return (random * 255).astype(np.uint8) if kind == np.uint8 else random.astype(kind)


def write(path, array) -> None:
    if path.suffix == ".exr":
        OpenEXR.File(
            {"type": OpenEXR.scanlineimage, "compression": OpenEXR.ZIP_COMPRESSION},
            {name: np.ascontiguousarray(array[:, :, i]) for i, name in enumerate("RGB")},
        ).write(str(path))
    else:
        Image.fromarray(array).save(path)


def picture(host, folder, file, extent=1):
    (folder / "scene.usda").write_text(STAGE.replace("FILE", str(file)).replace("EXTENT", str(extent)))
    return host.picture(folder / "scene.usda", SIZE, aovs=["color", "albedo"], settings=QUICK)


def is_quiet(picture) -> None:
    lines = [line for line in picture.log.splitlines() if "OocPT" in line]
    assert not lines, lines


def is_file(picture, array) -> None:
    is_quiet(picture)
    expected = array[::-1] / 255.0 if array.dtype == np.uint8 else array[::-1].astype(np.float64)
    np.testing.assert_allclose(picture["albedo"], expected, atol=2e-3)


@pytest.mark.parametrize(
    "name, kind", [("a.png", np.uint8), ("a.tif", np.uint8), ("a.exr", np.float16), ("b.exr", np.float32)]
)
def test_the_file_is_on_the_surface(host, tmp_path, name, kind):
    write(tmp_path / name, texels(kind))
    is_file(picture(host, tmp_path, f"./{name}"), texels(kind))


def test_a_texture_in_a_package(host, tmp_path):
    write(tmp_path / "inside.png", texels(np.uint8))
    (tmp_path / "scene.usda").write_text(STAGE.replace("FILE", "./inside.png").replace("EXTENT", "1"))
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "scene.usda"), str(tmp_path / "scene.usdz"))
    (tmp_path / "inside.png").unlink()
    is_file(host.picture(tmp_path / "scene.usdz", SIZE, aovs=["color", "albedo"], settings=QUICK), texels(np.uint8))


def test_a_texture_in_a_package_is_known_by_its_content(fresh_host, tmp_path_factory, tmp_path):
    """One entry in the cache for the same texels in two packages, another for other ones."""
    cache = tmp_path / "cache"
    host = fresh_host(OOCPT_TEXTURE_CACHE=str(cache))
    for shift, count in ((0, 1), (0, 1), (1, 2)):
        folder, array = tmp_path_factory.mktemp("package"), texels(np.uint8) // 2 + np.uint8(shift)
        write(folder / "inside.png", array)
        (folder / "scene.usda").write_text(STAGE.replace("FILE", "./inside.png").replace("EXTENT", "1"))
        assert UsdUtils.CreateNewUsdzPackage(str(folder / "scene.usda"), str(folder / "scene.usdz"))
        (folder / "inside.png").unlink()
        is_file(host.picture(folder / "scene.usdz", SIZE, aovs=["color", "albedo"], settings=QUICK), array)
        entries = [path for path in cache.rglob("*") if path.is_file() and path.stat().st_size > 100]
        assert len(entries) == count, entries


def test_tiles_by_number(host, tmp_path):
    """Three of the four tiles that the square reaches are there, the fourth has the fallback: no reason to complain.
    One that cannot be read is."""
    colors = {1001: (255, 0, 0), 1002: (0, 255, 0), 1011: (0, 0, 255)}
    for number, color in colors.items():
        write(tmp_path / f"t.{number}.png", np.full((4, 4, 3), color, np.uint8))
    shown = picture(host, tmp_path, "./t.<UDIM>.png", extent=2)
    is_quiet(shown)
    albedo = shown["albedo"]
    for (row, column), color in {(0, 0): (1, 0, 0), (0, 1): (0, 1, 0), (1, 0): (0, 0, 1), (1, 1): FALLBACK}.items():
        quarter = albedo[4 * row : 4 * row + 4, 4 * column : 4 * column + 4]
        np.testing.assert_allclose(quarter, np.broadcast_to(color, quarter.shape), atol=1e-3)
    (tmp_path / "t.1002.png").write_bytes(b"")
    log = picture(host, tmp_path, "./t.<UDIM>.png", extent=2).log
    assert len([line for line in log.splitlines() if "t.1002.png" in line and "is empty" in line]) == 1, log


def cut(path) -> None:
    write(path, texels(np.uint8 if path.suffix == ".png" else np.float32))
    path.write_bytes(path.read_bytes()[:70])


ACESCG = np.array([[1.70505, -0.62179, -0.08326], [-0.13026, 1.14080, -0.01055], [-0.02400, -0.12897, 1.15297]])


def colored(host, folder, file, source: str = "", metadata: str = ""):
    """The scene with another `sourceColorSpace` (none where empty) and `colorSpace` metadata of the file."""
    stage = STAGE.replace(
        'token inputs:sourceColorSpace = "raw"', f'token inputs:sourceColorSpace = "{source}"' if source else ""
    )
    stage = stage.replace("@FILE@", f"@{file}@" + (f' ( colorSpace = "{metadata}" )' if metadata else ""))
    (folder / "scene.usda").write_text(stage.replace("EXTENT", "1"))
    return host.picture(folder / "scene.usda", SIZE, aovs=["color", "albedo"], settings=QUICK)


def pale() -> np.ndarray:
    """Colours that stay between 0 and 1 in other spaces."""
    return (texels(np.uint8) * 0.3 + 90).astype(np.uint8)


def decoded(array) -> np.ndarray:
    v = array / 255.0
    return np.where(v <= 0.04045, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


@pytest.mark.parametrize(
    "source, metadata, expected",
    [
        ("ACEScg", "", lambda array: array / 255.0 @ ACESCG.T),
        ("", "lin_ap1", lambda array: array / 255.0 @ ACESCG.T),
        ("auto", "ACEScg", lambda array: array / 255.0 @ ACESCG.T),
        ("raw", "ACEScg", lambda array: array / 255.0),
        ("sRGB", "lin_ap1", decoded),
        ("", "srgb_texture", decoded),
        ("", "lin_rec709", lambda array: array / 255.0),
        ("", "", decoded),
    ],
)
def test_color_spaces_by_name(host, tmp_path, source, metadata, expected):
    write(tmp_path / "a.png", pale())
    shown = colored(host, tmp_path, "./a.png", source, metadata)
    is_quiet(shown)
    if source == "auto" and host.scene_index and Usd.GetVersion() >= (0, 26, 3):
        # A fault of the host: a `sourceColorSpace` that is authored replaces the metadata of the file, also `auto`.
        expected = decoded
    np.testing.assert_allclose(shown["albedo"], expected(pale()[::-1]), atol=4e-3)


@pytest.mark.parametrize("source, metadata", [("no such space", ""), ("", "no such space")])
def test_an_unknown_color_space_gives_one_warning_and_the_files_own(host, tmp_path, source, metadata):
    write(tmp_path / "a.png", pale())
    shown = colored(host, tmp_path, "./a.png", source, metadata)
    lines = [line for line in shown.log.splitlines() if "OocPT" in line]
    assert len(lines) == 1, shown.log
    for word in ("no such space", "a.png", "/World/Material/Texture"):
        assert word in lines[0], lines[0]
    np.testing.assert_allclose(shown["albedo"], decoded(pale()[::-1]), atol=4e-3)


BAD = {
    "absent.png": lambda path: None,
    "empty.png": lambda path: path.write_bytes(b""),
    "folder.png": lambda path: path.mkdir(),
    "text.exr": lambda path: path.write_text("This is no image.\n" * 40),
    "cut.png": cut,
    "cut.exr": cut,
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_warning_and_the_fallback(host, tmp_path, name):
    BAD[name](tmp_path / name)
    shown = picture(host, tmp_path, f"./{name}")
    lines = [line for line in shown.log.splitlines() if name in line or "/World/Material" in line]
    assert len(lines) == 1, "one line:\n" + shown.log
    assert name in lines[0] and "/World/Material" in lines[0], "it names the file and the prim: " + lines[0]
    np.testing.assert_allclose(shown["albedo"], np.broadcast_to(FALLBACK, shown["albedo"].shape), atol=1e-3)
    write(tmp_path / "good.png", texels(np.uint8))
    is_file(picture(host, tmp_path, "./good.png"), texels(np.uint8))
