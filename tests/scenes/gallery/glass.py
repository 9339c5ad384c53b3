# SPDX-License-Identifier: Apache-2.0
"""Glasses, a glass ball, and painted balls with and without clear coat, in a studio of soft boxes."""

from pxr import UsdLux

import images
import parts
import patterns
import shading
import solids
from .room import light

GOBLET = [
    (0.0, 0.0), (0.34, 0.0), (0.34, 0.015), (0.2, 0.035), (0.05, 0.07), (0.032, 0.2), (0.03, 0.5), (0.06, 0.58),
    (0.2, 0.68), (0.32, 0.85),
    (0.36, 1.05), (0.33, 1.3), (0.3, 1.42), (0.285, 1.42), (0.312, 1.3), (0.34, 1.05), (0.3, 0.86), (0.18, 0.7),
    (0.0, 0.63),
]  # fmt: skip


def build(stage, folder, options):
    images.exr(folder / "studio.exr", patterns.studio(512), half=True, packed=True)
    images.png(
        folder / "tiles.png",
        images.to_8_bit(images.to_srgb(patterns.checker(64, 2, (0.55, 0.53, 0.5), (0.10, 0.10, 0.11)))), packed=True,
    )
    tiles = shading.material(
        stage, "/World/Looks/Tiles", diffuseColor=shading.sample(stage, "/World/Looks/Tiles/Color", "./tiles.png"),
        roughness=0.25,
    )
    shading.bind(solids.ground(stage, "/World/Floor", 16.0, 12.0), tiles)
    clear = shading.material(stage, "/World/Looks/Glass", diffuseColor=(1, 1, 1), opacity=0.0, roughness=0.0, ior=1.5)
    green = shading.material(
        stage, "/World/Looks/GreenGlass", diffuseColor=(0.35, 0.85, 0.55), opacity=0.0, roughness=0.0, ior=1.5
    )
    for index, (x, z, look) in enumerate(((-1.7, 0.2, clear), (-0.75, -0.75, green), (0.35, -0.2, clear))):
        goblet = solids.put(solids.lathe(stage, f"/World/Goblet{index}", GOBLET, 72), (x, 0, z))
        shading.bind(goblet, look)
    ball = solids.put(solids.sphere(stage, "/World/GlassBall", 0.42, 40), (-0.55, 0.42, 0.75))
    shading.bind(ball, clear)
    paints = (
        ("Matt", dict(roughness=0.6)), ("Coated", dict(roughness=0.6, clearcoat=1.0, clearcoatRoughness=0.03)),
        ("Flake", dict(roughness=0.35, metallic=0.8, clearcoat=1.0, clearcoatRoughness=0.01)),
    )
    for index, (name, inputs) in enumerate(paints):
        paint = shading.material(stage, f"/World/Looks/{name}", diffuseColor=(0.55, 0.02, 0.03), **inputs)
        ball = solids.put(
            solids.sphere(stage, f"/World/{name}", 0.42, 36), (1.15 + 0.62 * index, 0.42, 0.75 - 0.75 * index)
        )
        shading.bind(ball, paint)
    parts.dome(stage).CreateTextureFileAttr("./studio.exr")
    light(
        stage, UsdLux.RectLight, "/World/Back", 6.0, (0.8, 0.9, 1.0), (0.0, 2.6, -4.0), turn=180, tilt=0, width=5.0,
        height=1.4,
    )
    parts.camera(stage, "/World/Camera", (0.2, 1.75, 6.2), (0.15, 0.58, 0.0), aperture=(36.0, 20.25), focal=48.0)
