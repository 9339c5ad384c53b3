# SPDX-License-Identifier: Apache-2.0
"""`oocpt texture` as a user runs it: files, sets, folders and scenes through a real host; what it keeps is what a
render then finds."""

from __future__ import annotations

import json
import os
import pathlib
import subprocess

import numpy as np
import ptex_files
import pytest
from PIL import Image
from pxr import Sdf, Usd, UsdShade

REPO = pathlib.Path(__file__).resolve().parents[2]
SCENE = """#usda 1.0
(
    defaultPrim = "World"
    upAxis = "Y"
)
def Xform "World" {
    def Camera "Camera" {
        double3 xformOp:translate = (0.5, 0.5, 2)
        uniform token[] xformOpOrder = ["xformOp:translate"]
    }
    def DomeLight "Sky" {
        float inputs:intensity = 1
    }
    def Mesh "Board" (
        prepend apiSchemas = ["MaterialBindingAPI"]
    ) {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]
        uniform token subdivisionScheme = "none"
        texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1), (0, 1)] (interpolation = "vertex")
        rel material:binding = </World/Paint>
    }
    def Material "Paint" {
        token outputs:surface.connect = </World/Paint/Surface.outputs:surface>
        def Shader "Surface" {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor.connect = </World/Paint/Texture.outputs:rgb>
            token outputs:surface
        }
        def Shader "Texture" {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./wood.png@
            float2 inputs:st.connect = </World/Paint/Coordinates.outputs:result>
            token inputs:sourceColorSpace = "raw"
            float3 outputs:rgb
        }
        def Shader "Coordinates" {
            uniform token info:id = "UsdPrimvarReader_float2"
            string inputs:varname = "st"
            float2 outputs:result
        }
    }
}
"""


@pytest.fixture(scope="module")
def oocpt():
    built = os.environ.get("OOCPT_CLI")
    base = (
        [built]
        if built
        else [
            "cargo", "run", "--quiet", "--locked", "--profile", "fast", "--package", "oocpt-cli", "--bin", "oocpt",
            "--",
        ]
    )
    path = f"{os.environ['OOCPT_BUILD']}/bin{os.pathsep}{os.environ['PATH']}"

    def run(*arguments):
        variables = {**os.environ, "RUST_BACKTRACE": "0", "PATH": path}
        return subprocess.run(
            base + [str(a) for a in arguments], cwd=REPO, env=variables, capture_output=True, text=True, timeout=1800
        )

    return run


def info(oocpt, *arguments) -> list[dict]:
    done = oocpt("texture", "info", "--json", *arguments)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def picture(path: pathlib.Path, size=(300, 200)) -> None:
    path.parent.mkdir(exist_ok=True, parents=True)
    Image.fromarray(np.random.default_rng(5).integers(0, 256, (size[1], size[0], 3), np.uint8)).save(path)


def test_files_sets_and_folders_are_converted_and_listed(oocpt, tmp_path):
    cache = tmp_path / "cache"
    for name in ("one/wood.1001.png", "one/wood.1002.png", "two/deep/stone.tif", "two/cut.png"):
        picture(tmp_path / name)
    cut = tmp_path / "two/cut.png"
    cut.write_bytes(cut.read_bytes()[:5000])
    set_of_two = tmp_path / "one/wood.<UDIM>.png"
    [first, second] = info(oocpt, "--cache", cache, set_of_two)
    assert first["file"].endswith("wood.1001.png") and second["file"].endswith("wood.1002.png"), "in order"
    assert (first["size"], first["channels"], first["format"], first["is_srgb"], first["cache"]["bytes"]) == (
        [300, 200], 3, "u8", True, None
    )
    done = oocpt("texture", "convert", "--cache", cache, set_of_two, tmp_path / "two", tmp_path / "none.png")
    assert done.returncode == 1
    lines = done.stderr.splitlines()
    assert len(lines) == 3 and "2 files cannot be used" in lines[2], done.stderr
    assert any("cut.png: " in line for line in lines) and any(
        "none.png: cannot be found" in line for line in lines
    ), done.stderr
    assert "3 files are ready" in done.stdout, done.stdout
    assert len(list(cache.iterdir())) == 3, "an entry for each file that is whole"
    for told in info(oocpt, "--cache", cache, set_of_two, tmp_path / "two/deep"):
        assert (
            told["cache"]["first_level"] == 0
            and pathlib.Path(told["cache"]["path"]).stat().st_size == told["cache"]["bytes"]
        ), told
    words = oocpt("texture", "info", "--cache", cache, set_of_two).stdout
    assert "300 x 200, levels: 1, not tiled" in words and "cache         all levels" in words, words


def test_ptex_is_converted_and_listed(oocpt, tmp_path):
    cache, file = tmp_path / "cache", tmp_path / "folder/a.ptx"
    file.parent.mkdir()
    faces = [[0, 1, 2, 3], [1, 4, 2]]
    ptex_files.write(file, faces, [np.full((8, 4, 3), 40 * k, np.uint8) for k in range(4)])
    [before] = info(oocpt, "--cache", cache, file.parent)
    assert (before["faces"], before["channels"], before["format"], before["is_srgb"]) == (4, 3, "u8", True), before
    assert before["cache"]["bytes"] is None and not before["is_direct"]
    done = oocpt("texture", "convert", "--cache", cache, file)
    assert done.returncode == 0 and "1 files are ready" in done.stdout, done.stdout + done.stderr
    [after] = info(oocpt, "--cache", cache, file)
    [entry] = cache.iterdir()
    assert after["cache"]["first_level"] == 0 and entry.stat().st_size == after["cache"]["bytes"], after
    assert "Ptex, faces: 4" in oocpt("texture", "info", "--cache", cache, file).stdout
    file.write_bytes(file.read_bytes()[:200])
    done = oocpt("texture", "convert", "--cache", cache, file)
    assert done.returncode == 1 and "a.ptx: " in done.stderr, done.stderr


def test_a_render_uses_the_converted_textures(oocpt, tmp_path):
    cache, scene = tmp_path / "cache", tmp_path / "scene.usda"
    picture(tmp_path / "wood.png", (512, 512))
    scene.write_text(SCENE)
    done = oocpt("texture", "convert", "--cache", cache, scene)
    assert done.returncode == 0, done.stderr
    [entry] = cache.iterdir()
    [told] = info(oocpt, "--cache", cache, scene)
    assert told["space"] == "raw" and pathlib.Path(told["cache"]["path"]) == entry, "read as the scene reads it"
    # The file is damaged, but its size and time are the same: only the entry can give the texels.
    wood, before = tmp_path / "wood.png", (tmp_path / "wood.png").stat()
    wood.write_bytes(bytes(before.st_size))
    os.utime(wood, ns=(before.st_atime_ns, before.st_mtime_ns))
    rendered = record(scene, tmp_path / "picture.png", cache)
    assert rendered.mean() > 150, "texels, not the fallback"
    assert [path.name for path in cache.iterdir()] == [entry.name], "no other entry was made"
    lost = record(scene, tmp_path / "lost.png", tmp_path / "elsewhere")
    assert lost.mean() < 100, "without the entry there is the fallback: black, but for what it reflects"


def record(scene, out, cache) -> np.ndarray:
    """The middle of the picture."""
    command = [
        f"{os.environ['OOCPT_BUILD']}/bin/usdrecord", "--disableCameraLight", "--imageWidth", "32", "--camera",
        "Camera", scene, out,
    ]
    variables = {**os.environ, "OOCPT_SAMPLES_PER_PIXEL": "4", "OOCPT_TEXTURE_CACHE": str(cache)}
    done = subprocess.run([str(word) for word in command], env=variables, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    pixels = np.asarray(Image.open(out))[..., :3].astype(float)
    return pixels[pixels.shape[0] // 2 - 4 : pixels.shape[0] // 2 + 4, 12:20]


def test_a_member_of_a_package_and_a_scene_that_is_none(oocpt, tmp_path):
    from pxr import UsdUtils

    picture(tmp_path / "inside.png", (40, 30))
    stage = Usd.Stage.CreateNew(str(tmp_path / "scene.usda"))
    shader = UsdShade.Shader.Define(stage, "/Texture")
    shader.CreateIdAttr("UsdUVTexture")
    shader.CreateInput("file", Sdf.ValueTypeNames.Asset).Set("./inside.png")
    stage.GetRootLayer().Save()
    assert UsdUtils.CreateNewUsdzPackage(str(tmp_path / "scene.usda"), str(tmp_path / "scene.usdz"))
    [told] = info(oocpt, "--cache", tmp_path / "cache", tmp_path / "scene.usdz")
    assert told["file"].endswith("scene.usdz[inside.png]") and told["cache"]["key"].startswith("hash:"), told
    [member] = info(oocpt, "--cache", tmp_path / "cache", f"{tmp_path / 'scene.usdz'}[inside.png]")
    assert member == told, "the same file by its own name"
    (tmp_path / "bad.usda").write_text("no scene")
    done = oocpt("texture", "info", tmp_path / "bad.usda")
    assert done.returncode == 1 and "cannot be opened" in done.stdout, done
