# SPDX-License-Identifier: Apache-2.0
"""Textured props: a brick wall and crates with normal maps, a tall vase painted over six UDIM tiles, a globe that comes
in a .usdz."""

from pxr import Sdf, Usd, UsdGeom, UsdUtils

import images
import numpy as np
import parts
import patterns
import shading
import solids
from .room import VASE


def textured(stage, path, name, strength=None, wrap="repeat", **inputs):
    """A material of NAME.png, NAME_normal.png and constants."""
    inputs["diffuseColor"] = shading.sample(stage, f"{path}/Color", f"./{name}.png", wrap=wrap)
    if strength is not None:
        inputs["normal"] = shading.normal_map(stage, f"{path}/Normal", f"./{name}_normal.png", wrap=wrap)
    return shading.material(stage, path, **inputs)


def write_pair(folder, name, color, height, strength):
    images.png(folder / f"{name}.png", images.to_8_bit(images.to_srgb(color)), packed=True)
    images.png(folder / f"{name}_normal.png", images.to_8_bit(patterns.normals_of(height, strength)), packed=True)


def paint_udims(folder):
    """1001 .. 1003 and 1011 .. 1013: bands whose colour tells the tile."""
    hues = {
        1001: (0.55, 0.10, 0.08), 1002: (0.75, 0.45, 0.08), 1003: (0.20, 0.42, 0.12), 1011: (0.08, 0.35, 0.50),
        1012: (0.20, 0.12, 0.45), 1013: (0.50, 0.12, 0.35),
    }
    for tile, hue in hues.items():
        s, t = patterns.plane(256, 256)
        waves = 0.5 + 0.5 * np.sin(2 * np.pi * (4 * s + 0.35 * np.sin(2 * np.pi * 3 * t)))
        ring = np.abs((t * 5) % 1.0 - 0.5) < 0.12
        picture = patterns.mix(np.array(hue) * 0.8, (0.85, 0.8, 0.68), patterns.smooth_step(0.55, 0.75, waves))
        picture = np.where(ring[..., None], hue, picture)
        images.png(folder / f"vase.{tile}.png", images.to_8_bit(images.to_srgb(picture)), packed=True)


def pack_globe(folder):
    """globe.usdz: a sphere, its material and its picture in one package."""
    s, t = patterns.plane(512, 256)
    land = patterns.noise(s, t, 4, 21, 5) > 0.53
    ice = np.abs(t - 0.5) > 0.41
    picture = np.where(
        land[..., None], patterns.mix((0.12, 0.22, 0.06), (0.45, 0.36, 0.2), patterns.noise(s, t, 8, 5, 4)),
        (0.03, 0.10, 0.26),
    )
    picture = np.where(ice[..., None], (0.85, 0.88, 0.9), picture)
    images.png(folder / "globe.png", images.to_8_bit(images.to_srgb(picture)), packed=True)
    layer = Sdf.Layer.CreateNew(str(folder / "globe.usda"))
    stage = Usd.Stage.Open(layer)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    root = UsdGeom.Xform.Define(stage, "/Globe")
    stage.SetDefaultPrim(root.GetPrim())
    look = shading.material(
        stage, "/Globe/Look", diffuseColor=shading.sample(stage, "/Globe/Look/Color", "./globe.png"), roughness=0.35
    )
    shading.bind(solids.sphere(stage, "/Globe/Ball", 0.5, 40), look)
    layer.Save()
    if not UsdUtils.CreateNewUsdzPackage(str(folder / "globe.usda"), str(folder / "globe.usdz")):
        raise RuntimeError("globe.usdz could not be written")
    for name in ("globe.usda", "globe.png"):
        (folder / name).unlink()


def build(stage, folder, options):
    write_pair(folder, "bricks", *patterns.bricks(512), 0.02)
    color, _ = patterns.wood(512, 8, (0.22, 0.11, 0.05), (0.60, 0.38, 0.18))
    s, t = patterns.plane(512, 512)
    frame = np.minimum(np.minimum(s, 1 - s), np.minimum(t, 1 - t)) < 0.09
    height = np.where(frame, 1.0, 0.6 * patterns.smooth_step(0.0, 0.03, np.abs((t * 4) % 1.0 - 0.5) * -1 + 0.5))
    write_pair(folder, "crate", np.where(frame[..., None], 0.75 * color, color), height, 0.012)
    paint_udims(folder)
    pack_globe(folder)
    images.exr(folder / "sky.exr", patterns.sky(512, haze=0.2, sun=(-0.5, 0.75, 0.6)), half=True, packed=True)
    wall = textured(stage, "/World/Looks/Bricks", "bricks", 1, roughness=0.85)
    back = solids.put(
        solids.raw_mesh(
            stage, "/World/Wall", [(-5, 0, 0), (5, 0, 0), (5, 4, 0), (-5, 4, 0)], [4], range(4), [(0, 0, 1)] * 4,
            [(0, 0), (5, 0), (5, 2), (0, 2)],
        ),
        (0, 0, -1.6),
    )
    shading.bind(back, wall)
    images.png(
        folder / "paving.png",
        images.to_8_bit(images.to_srgb(patterns.checker(256, 8, (0.36, 0.35, 0.33), (0.29, 0.28, 0.27)))), packed=True,
    )
    shading.bind(
        solids.ground(stage, "/World/Ground", 12.0, 3.0),
        textured(stage, "/World/Looks/Paving", "paving", roughness=0.7),
    )
    crate = textured(stage, "/World/Looks/Crate", "crate", 1, roughness=0.6)
    for index, (place, size, turn) in enumerate(
        (((-1.55, 0.5, 0.0), 1.0, 18), ((-1.5, 1.3, -0.05), 0.6, -12), ((-2.55, 0.35, 0.5), 0.7, 40))
    ):
        shading.bind(solids.put(solids.block(stage, f"/World/Crate{index}", (size,) * 3), place, turn), crate)
    paint = textured(
        stage, "/World/Looks/Painted", "vase.<UDIM>", wrap="clamp", roughness=0.25, clearcoat=0.6,
        clearcoatRoughness=0.05,
    )
    vase = solids.put(solids.lathe(stage, "/World/Vase", VASE, 72, tiles=(2.999, 1.999)), (0.05, 0.0, 0.2), scale=1.9)
    shading.bind(vase, paint)
    globe = UsdGeom.Xform.Define(stage, "/World/Globe")
    globe.GetPrim().GetReferences().AddReference("./globe.usdz")
    solids.put(globe, (1.75, 0.62, 0.2), turn=35, scale=1.24)
    parts.dome(stage).CreateTextureFileAttr("./sky.exr")
    parts.camera(stage, "/World/Camera", (0.0, 1.75, 6.6), (-0.1, 0.95, 0.0), aperture=(36.0, 20.25), focal=44.0)
