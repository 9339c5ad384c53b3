# SPDX-License-Identifier: Apache-2.0
"""UsdPreviewSurface networks read for a reference renderer: constants, pictures with all of UsdUVTexture's rules
applied. Needs usd-core, numpy.

Pictures are decoded with Mitsuba's reader (`decode`, handed in), converted to linear by the `sourceColorSpace` rules,
scaled and biased, and turned so that row 0 is t = 0.
"""

from __future__ import annotations

import dataclasses
import math
import pathlib

import numpy as np
from pxr import Sdf, UsdShade

DEFAULTS = {
    "diffuseColor": (0.18, 0.18, 0.18), "emissiveColor": (0.0, 0.0, 0.0), "useSpecularWorkflow": 0,
    "specularColor": (0.0, 0.0, 0.0), "metallic": 0.0, "roughness": 0.5,
    "clearcoat": 0.0, "clearcoatRoughness": 0.01, "opacity": 1.0, "opacityThreshold": 0.0, "ior": 1.5,
    "normal": (0.0, 0.0, 1.0),
}  # fmt: skip
CHANNELS = {"r": [0], "g": [1], "b": [2], "a": [3], "rgb": [0, 1, 2]}


@dataclasses.dataclass
class Picture:
    """A texture as (height, width, channels) float32, row 0 at t = 0; `transform` maps st to the picture's own unit
    square."""

    pixels: np.ndarray
    wrap: tuple[str, str]
    transform: np.ndarray


def _value(shader, name, default=None):
    port = shader.GetInput(name)
    value = port.Get() if port else None
    return default if value is None else value


def _source(shader, name):
    """(shader, output name) that an input is connected to."""
    port = shader.GetInput(name)
    if not port:
        return None
    found, _ = port.GetConnectedSources()
    return (UsdShade.Shader(found[0].source.GetPrim()), found[0].sourceName) if found else None


def surface(material: UsdShade.Material):
    """The UsdPreviewSurface of a material, or None."""
    shader, _, _ = material.ComputeSurfaceSource()
    return shader if shader and shader.GetIdAttr().Get() == "UsdPreviewSurface" else None


def inputs(material: UsdShade.Material, decode, notes: list[str]) -> dict:
    """Every input: a float, a tuple or a Picture."""
    shader, made = surface(material), dict(DEFAULTS)
    if shader is None:
        notes.append(f"{material.GetPath()}: no UsdPreviewSurface, defaults taken")
        return made
    for name, default in DEFAULTS.items():
        found = _source(shader, name)
        if found is not None:
            made[name] = _follow(found, material, decode, notes, default)
        else:
            value = _value(shader, name, default)
            made[name] = tuple(value) if hasattr(value, "__len__") else value
    return made


def _follow(found, material, decode, notes, default):
    node, output = found
    kind = node.GetIdAttr().Get()
    if kind == "UsdUVTexture":
        return _texture(node, output, decode, notes)
    notes.append(f"{material.GetPath()}: {kind} is not translated, the default is taken")
    return default


def _coordinates(node) -> np.ndarray:
    """The chain of UsdTransform2d nodes in front of `st` as a 3 x 3 matrix."""
    matrix = np.eye(3)
    found = _source(node, "st")
    while found is not None and found[0].GetIdAttr().Get() == "UsdTransform2d":
        shader = found[0]
        scale, rotation, move = (
            _value(shader, "scale", (1, 1)), math.radians(_value(shader, "rotation", 0.0)),
            _value(shader, "translation", (0, 0)),
        )
        c, s = math.cos(rotation), math.sin(rotation)
        own = np.array([[c * scale[0], -s * scale[1], move[0]], [s * scale[0], c * scale[1], move[1]], [0, 0, 1]])
        matrix = matrix @ own
        found = _source(shader, "in")
    return matrix


def _linear(pixels: np.ndarray, bits: int, space: str) -> np.ndarray:
    """`sourceColorSpace`: auto is sRGB for 8-bit pictures of three or four channels."""
    decoded = space == "sRGB" or (space == "auto" and bits == 8 and pixels.shape[2] >= 3)
    colors = 1 if pixels.shape[2] < 3 else 3
    if decoded:
        low = pixels[..., :colors]
        pixels = pixels.copy()
        pixels[..., :colors] = np.where(low <= 0.04045, low / 12.92, ((low + 0.055) / 1.055) ** 2.4)
    return pixels


def load(file: str, space: str, decode) -> np.ndarray:
    """(height, width, 4), linear, row 0 at the bottom."""
    pixels, bits = decode(file)
    pixels = _linear(pixels.astype(np.float64), bits, space)
    ones = np.ones_like(pixels[..., :1])
    count = pixels.shape[2]
    if count == 1:
        pixels = np.concatenate([pixels, pixels, pixels, ones], axis=2)
    elif count == 2:
        pixels = np.concatenate([pixels[..., :1]] * 3 + [pixels[..., 1:2]], axis=2)
    elif count == 3:
        pixels = np.concatenate([pixels, ones], axis=2)
    return pixels[::-1]


def _texture(node, output, decode, notes) -> Picture:
    asset = _value(node, "file", Sdf.AssetPath(""))
    space = _value(node, "sourceColorSpace", "auto")
    transform = _coordinates(node)
    anchor = node.GetInput("file").GetAttr().GetPropertyStack()[0].layer
    if "<UDIM>" in asset.path:
        folder = pathlib.Path(anchor.realPath).parent
        tiles = {
            int(path.name.split(".")[-2]): path
            for path in folder.glob(asset.path.replace("<UDIM>", "1[0-9][0-9][0-9]"))
        }
        across, rows = max((tile - 1001) % 10 for tile in tiles) + 1, max((tile - 1001) // 10 for tile in tiles) + 1
        loaded = {tile: load(str(path), space, decode) for tile, path in tiles.items()}
        height, width = next(iter(loaded.values())).shape[:2]
        pixels = np.zeros((rows * height, across * width, 4))
        for tile, picture in loaded.items():
            x, y = (tile - 1001) % 10 * width, (tile - 1001) // 10 * height
            pixels[y : y + height, x : x + width] = picture
        transform = np.diag([1 / across, 1 / rows, 1.0]) @ transform
    elif not asset.resolvedPath:
        notes.append(f"{node.GetPath()}: {asset.path} is not there, the fallback is taken")
        pixels = np.broadcast_to(np.array(_value(node, "fallback", (0, 0, 0, 1)), dtype=np.float64), (1, 1, 4))
    else:
        pixels = load(asset.resolvedPath, space, decode)
    if asset.resolvedPath or "<UDIM>" in asset.path:
        pixels = pixels * np.array(_value(node, "scale", (1, 1, 1, 1))) + np.array(_value(node, "bias", (0, 0, 0, 0)))
    wrap = tuple(str(_value(node, name, "useMetadata")) for name in ("wrapS", "wrapT"))
    return Picture(np.ascontiguousarray(pixels[..., CHANNELS[output]], dtype=np.float32), wrap, transform)
