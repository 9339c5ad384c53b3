#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes scenes that show how textures are filtered, works out the same pictures without a filter, and says how far a
render is from them.

    filtering.py write FOLDER                           ground.usda and wall.usda, with their textures
    filtering.py reference SCENE WIDTH OUT.exr SAMPLES x SAMPLES points in each pixel, each the texture as it is between
        its texels
    filtering.py compare REFERENCE.exr PICTURE.exr ...  relMSE, and how much of the reference's edges is there

Both surfaces glow with their texture and nothing else shines, so a picture is an integral over its pixels alone. Needs
numpy, and OpenEXR but for `write`.
"""

from __future__ import annotations

import argparse
import math
import pathlib
from dataclasses import dataclass

import numpy as np

import images

ASPECT = 16 / 9
APERTURE = 20.0
SAMPLES = 128

STAGE = """#usda 1.0
( upAxis = "Y" )
def Xform "World"
{
    def Camera "Camera"
    {
        float focalLength = %(focal)r
        float horizontalAperture = %(aperture)r
        float verticalAperture = %(vertical)r
        double3 xformOp:translate = (0, 1, 0)
        float3 xformOp:rotateXYZ = (%(pitch)r, %(yaw)r, 0)
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:rotateXYZ"]
    }
    def Mesh "Surface" ( prepend apiSchemas = ["MaterialBindingAPI"] )
    {
        int[] faceVertexCounts = [4]
        int[] faceVertexIndices = [0, 1, 2, 3]
        point3f[] points = %(points)s
        texCoord2f[] primvars:st = %(st)s ( interpolation = "vertex" )
        uniform token subdivisionScheme = "none"
        rel material:binding = </World/Material>
    }
    def Material "Material"
    {
        token outputs:surface.connect = </World/Material/Shader.outputs:surface>
        def Shader "Shader"
        {
            uniform token info:id = "UsdPreviewSurface"
            color3f inputs:diffuseColor = (0, 0, 0)
            color3f inputs:emissiveColor.connect = </World/Material/Texture.outputs:rgb>
            token outputs:surface
        }
        def Shader "Texture"
        {
            uniform token info:id = "UsdUVTexture"
            asset inputs:file = @./%(name)s.png@
            token inputs:sourceColorSpace = "raw"
            token inputs:wrapS = "repeat"
            token inputs:wrapT = "repeat"
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


@dataclass
class Scene:
    """A rectangle from `corner` along two edges, on which st go from 0 to `st`, seen from a unit above the origin."""

    corner: tuple[float, float, float]
    edges: tuple[tuple[float, float, float], tuple[float, float, float]]
    st: tuple[float, float]
    pitch: float
    yaw: float
    focal: float


SCENES = {
    # To 2000 units away, where a pixel is some thousand checks long.
    "ground": Scene((-2000, 0, 2000), ((4000, 0, 0), (0, 0, -4000)), (1000, 1000), -12, 30, 16),
    # A texel is eight times as long as high where the wall is seen from in front.
    "wall": Scene((0.8, 0, 0), ((0, 0, -40), (0, 2, 0)), (1, 1), 0, -25, 16),
}


def texture(name: str) -> np.ndarray:
    """Grey, 0 to 255, row 0 at the top."""
    if name == "ground":
        y, x = np.mgrid[0:512, 0:512] // 64
        return np.where((x + y) % 2 == 1, 204, 26).astype(np.uint8)
    height, width = 1024, 2048
    random = np.random.default_rng(5)
    noise = sum(np.kron(random.random((height >> k, width >> k)), np.ones((1 << k, 1 << k))) for k in range(7)) / 7
    y, x = np.mgrid[0:height, 0:width]
    lines = (x % 64 < 3) | (y % 128 < 5)
    return images.to_8_bit(np.where(lines, 0.05, 0.15 + 0.7 * noise))


def write(folder: pathlib.Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for name, scene in SCENES.items():
        a, (e, f), (s, t) = np.array(scene.corner, float), np.array(scene.edges, float), scene.st
        points = [tuple(float(v) for v in p) for p in (a, a + e, a + e + f, a + f)]
        values = {
            "name": name, "points": points, "st": [(0, 0), (s, 0), (s, t), (0, t)], "focal": scene.focal,
            "aperture": APERTURE,
        }
        values |= {"vertical": APERTURE / ASPECT, "pitch": scene.pitch, "yaw": scene.yaw}
        (folder / f"{name}.usda").write_text(STAGE % values)
        images.png(folder / f"{name}.png", texture(name), packed=True)


def look_up(texels: np.ndarray, s: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Between four texels, repeated."""
    height, width = texels.shape
    x, y = s * width - 0.5, (1.0 - t) * height - 0.5
    left, top = np.floor(x), np.floor(y)
    fx, fy = x - left, y - top
    at = lambda dx, dy: texels[np.mod(top + dy, height).astype(np.int64), np.mod(left + dx, width).astype(np.int64)]
    return (1 - fy) * ((1 - fx) * at(0, 0) + fx * at(1, 0)) + fy * ((1 - fx) * at(0, 1) + fx * at(1, 1))


def reference(name: str, width: int, samples: int = SAMPLES) -> np.ndarray:
    """The mean of samples x samples points, evenly spread over each pixel; row 0 at the top."""
    scene, texels = SCENES[name], texture(name) / 255.0
    height = round(width / ASPECT)
    a, (e, f) = np.array(scene.corner, float), np.array(scene.edges, float)
    n = np.cross(e, f)
    pitch, yaw = math.radians(scene.pitch), math.radians(scene.yaw)
    turn = np.array([[math.cos(yaw), 0, math.sin(yaw)], [0, 1, 0], [-math.sin(yaw), 0, math.cos(yaw)]])
    turn = turn @ np.array([[1, 0, 0], [0, math.cos(pitch), -math.sin(pitch)], [0, math.sin(pitch), math.cos(pitch)]])
    eye, scale = np.array([0.0, 1.0, 0.0]), APERTURE / scene.focal / width
    x = (np.arange(width * samples) + 0.5) / samples - width / 2
    picture = np.zeros((height, width))
    for row in range(height):
        for k in range(samples):
            y = height / 2 - row - (k + 0.5) / samples
            d = np.stack([x * scale, np.full_like(x, y * scale), np.full_like(x, -1.0)]).T @ turn.T
            with np.errstate(divide="ignore", invalid="ignore"):
                t = ((a - eye) @ n) / (d @ n)
                p = eye + t[:, None] * d - a
                u, v = p @ e / (e @ e), p @ f / (f @ f)
            met = (t > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)
            value = np.zeros_like(x)
            value[met] = look_up(texels, u[met] * scene.st[0], v[met] * scene.st[1])
            picture[row] += value.reshape(width, samples).sum(axis=1)
    return picture / samples**2


def error(picture: np.ndarray, expected: np.ndarray) -> float:
    """relMSE."""
    return float(np.mean((picture - expected) ** 2 / (expected**2 + 0.01)))


def sharpness(picture: np.ndarray, expected: np.ndarray) -> float:
    """How much of the reference's second differences the picture has: 1 for all, 0 for none; noise counts for
    nothing."""
    edges = lambda i: 4 * i[1:-1, 1:-1] - i[1:-1, :-2] - i[1:-1, 2:] - i[:-2, 1:-1] - i[2:, 1:-1]
    a, b = edges(picture), edges(expected)
    return float(np.sum(a * b) / np.sum(b * b))


def _read(path: pathlib.Path) -> np.ndarray:
    import OpenEXR

    pixels = OpenEXR.File(str(path)).channels()
    name = next(iter(pixels))
    array = pixels[name].pixels if name != "R" else pixels["R"].pixels
    return np.asarray(array[..., 0] if array.ndim == 3 else array, dtype=np.float64)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    commands.add_parser("write").add_argument("folder", type=pathlib.Path)
    made = commands.add_parser("reference")
    made.add_argument("scene", choices=SCENES)
    made.add_argument("width", type=int)
    made.add_argument("out", type=pathlib.Path)
    compared = commands.add_parser("compare")
    compared.add_argument("reference", type=pathlib.Path)
    compared.add_argument("pictures", type=pathlib.Path, nargs="+")
    given = parser.parse_args()
    if given.command == "write":
        write(given.folder)
    elif given.command == "reference":
        images.exr(given.out, np.repeat(reference(given.scene, given.width)[:, :, None], 3, axis=2).astype(np.float32))
    else:
        expected = _read(given.reference)
        for path in given.pictures:
            picture = _read(path)
            print(f"{path.name}: relMSE {error(picture, expected):.2e}, edges {sharpness(picture, expected):.3f}")


if __name__ == "__main__":
    main()
