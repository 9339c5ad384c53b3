# SPDX-License-Identifier: Apache-2.0
"""UsdLux lights as Mitsuba's emitters. The variant must be set before this is imported.

Rectangles, disks, spheres and cylinders are Mitsuba's shapes of the same name with an `area` emitter: exact. Lights of
UsdLux are no geometry: nothing is in their shadow, and a ray goes on behind them (as in hdPrman, where lights are not
in the way unless asked for). With `blocks` off they are the same here, index-matched surfaces that `volpath` goes
through; with it they are black. A distant light is `directional`, or with an angle a far disk of that size. A latlong
follows the same rule in both (OpenEXR's: its middle is +z); Mitsuba's rows stand on texel edges, so the picture is
resampled to those. Cones, focus, IES, links, shadow and diffuse/specular settings have no counterpart: one note each,
the light shines without.
"""

from __future__ import annotations

import math

import mitsuba as mi
import numpy as np
from pxr import UsdGeom, UsdLux

import materials
import networks

FAR = 1e4
"""Distance of a distant light's disk, in radii of the scene."""


def _get(prim, name, default):
    value = prim.GetAttribute(f"inputs:{name}").Get() if prim.HasAttribute(f"inputs:{name}") else None
    return default if value is None else value


def radiance(prim) -> np.ndarray:
    """intensity * 2^exposure * color * blackbody."""
    api = UsdLux.LightAPI(prim)
    value = (
        np.array(_get(prim, "color", (1, 1, 1)), dtype=np.float64)
        * _get(prim, "intensity", 1.0)
        * 2.0 ** _get(prim, "exposure", 0.0)
    )
    if _get(prim, "enableColorTemperature", False):
        value = value * np.array(UsdLux.BlackbodyTemperatureAsRgb(api.GetColorTemperatureAttr().Get()))
    return value


def _rgb(value) -> dict:
    return {"type": "rgb", "value": [float(x) for x in value]}


def _note(prim, notes) -> None:
    if prim.HasAPI(UsdLux.ShapingAPI):
        angle, focus = _get(prim, "shaping:cone:angle", 90.0), _get(prim, "shaping:focus", 0.0)
        if focus != 0 or angle < 90 or prim.GetAttribute("inputs:shaping:ies:file").Get():
            notes.append(f"{prim.GetPath()}: shaping left out")
    if prim.HasAPI(UsdLux.ShadowAPI) and not _get(prim, "shadow:enable", True):
        notes.append(f"{prim.GetPath()}: shadow:enable left out")
    for name in ("lightLink", "shadowLink"):
        if (
            not prim.GetAttribute(f"collection:{name}:includeRoot").Get()
            or prim.GetRelationship(f"collection:{name}:excludes").GetTargets()
        ):
            notes.append(f"{prim.GetPath()}: {name} left out")
    if _get(prim, "diffuse", 1.0) != 1 or _get(prim, "specular", 1.0) != 1:
        notes.append(f"{prim.GetPath()}: diffuse and specular multipliers left out")


def emitter(lamp, center: np.ndarray, radius: float, notes: list[str], blocks: bool = True) -> dict | None:
    """The emitter of a light; `center` and `radius` bound the scene."""
    prim, matrix = lamp.prim, lamp.to_world
    _note(prim, notes)
    if prim.IsA(UsdLux.DomeLight) or prim.IsA(UsdLux.DomeLight_1):
        return _dome(prim, matrix, notes)
    if prim.IsA(UsdLux.DistantLight):
        return _distant(prim, matrix, center, radius)
    value = radiance(prim)
    # Lengths of the axes: what a scaled transform makes of the light.
    sx, sy, sz = np.linalg.norm(matrix[:3, :3], axis=0)
    normalize = _get(prim, "normalize", False)
    if prim.IsA(UsdLux.RectLight):
        width, height = _get(prim, "width", 1.0), _get(prim, "height", 1.0)
        # Shines along -z: turned about y.
        local = np.diag([-width / 2, height / 2, -1.0, 1.0])
        kind, area = "rectangle", width * height * sx * sy
    elif prim.IsA(UsdLux.DiskLight):
        r = _get(prim, "radius", 0.5)
        local, kind, area = np.diag([-r, r, -1.0, 1.0]), "disk", math.pi * r * r * sx * sy
    elif prim.IsA(UsdLux.SphereLight):
        r = _get(prim, "radius", 0.5)
        local, kind, area = np.diag([r, r, r, 1.0]), "sphere", 4 * math.pi * r * r * (sx * sy * sz) ** (2 / 3)
    else:
        r, length = _get(prim, "radius", 0.5), _get(prim, "length", 1.0)
        # Mitsuba's axis is z from 0 to 1; UsdLux's is x about the middle.
        local = np.array([[0, 0, length, -length / 2], [r, 0, 0, 0], [0, r, 0, 0], [0, 0, 0, 1.0]])
        kind, area = "cylinder", 2 * math.pi * r * length * sx * math.sqrt(sy * sz)
    if normalize:
        value = value / area
    shine = _rgb(value)
    texture = prim.GetAttribute("inputs:texture:file")
    if texture and texture.Get() and texture.Get().resolvedPath:
        pixels = networks.load(texture.Get().resolvedPath, "auto", materials.decode)[..., :3] * value
        # s runs along the light's x and t along its y, seen from the back, as in OpenUSD's own hdEmbree; the shape
        # above is turned about y.
        shine = materials.texture(
            networks.Picture(np.ascontiguousarray(pixels[:, ::-1], np.float32), ("clamp", "clamp"), np.eye(3)), notes
        )
    return {
        "type": kind, "to_world": mi.ScalarTransform4f(matrix @ local), "emitter": {"type": "area", "radiance": shine},
        "bsdf": {"type": "diffuse", "reflectance": 0.0} if blocks else {"type": "null"},
    }


def _distant(prim, matrix, center, radius) -> dict:
    angle = _get(prim, "angle", 0.53)
    value = radiance(prim)
    direction = -matrix[:3, 2] / np.linalg.norm(matrix[:3, 2])
    half = math.radians(angle) / 2
    factor = math.pi * math.sin(half) ** 2 if half <= math.pi / 2 else math.pi * (2 - math.sin(half) ** 2)
    if angle == 0:
        return {"type": "directional", "direction": [float(x) for x in direction], "irradiance": _rgb(value)}
    if _get(prim, "normalize", False):
        value = value / factor
    distance = FAR * radius
    up = [0, 1, 0] if abs(direction[1]) < 0.9 else [1, 0, 0]
    place = mi.ScalarTransform4f().look_at(
        origin=list(map(float, center - distance * direction)), target=list(map(float, center)), up=up
    )
    size = distance * math.tan(half)
    return {
        "type": "disk", "to_world": place @ mi.ScalarTransform4f().scale([size, size, 1]),
        "emitter": {"type": "area", "radiance": _rgb(value)},
    }


def _dome(prim, matrix, notes) -> dict:
    texture = prim.GetAttribute("inputs:texture:file").Get()
    value = radiance(prim)
    if texture is None or not texture.resolvedPath:
        return {"type": "constant", "radiance": _rgb(value)}
    pixels = networks.load(texture.resolvedPath, "auto", materials.decode)[::-1, :, :3] * value
    turn = matrix[:3, :3] / np.linalg.norm(matrix[:3, :3], axis=0)
    if prim.IsA(UsdLux.DomeLight_1):
        pole = prim.GetAttribute("poleAxis").Get()
        up = UsdGeom.GetStageUpAxis(prim.GetStage())
        # The picture's pole is +y; Z: a quarter about x brings it to +z (middle of the picture to -y).
        if pole == "Z" or (pole == "scene" and up == UsdGeom.Tokens.z):
            turn = turn @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])
    to_world = np.eye(4)
    to_world[:3, :3] = turn
    return {
        "type": "envmap", "bitmap": mi.Bitmap(_rows_on_edges(pixels).astype(np.float32)),
        "to_world": mi.ScalarTransform4f(to_world),
    }


def _rows_on_edges(pixels: np.ndarray) -> np.ndarray:
    """From rows at (j + 1/2) / n of the height to Mitsuba's at j / (n - 1), twice as many, so that little is smeared;
    columns are the same."""
    rows = pixels.shape[0]
    positions = np.arange(2 * rows + 1) / 2 - 0.5
    low = np.floor(positions).astype(int)
    weight = (positions - low)[:, None, None]
    at = lambda k: pixels[np.clip(k, 0, rows - 1)]
    return at(low) * (1 - weight) + at(low + 1) * weight
