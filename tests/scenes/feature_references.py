# SPDX-License-Identifier: Apache-2.0
"""Feature scenes without a closed form: Mitsuba's converged means lie beside them as .json. Written by features.py.

What these show together no formula does: many bounces, rough reflections, caustic-free glass, a sky on a rough metal.
"""

from __future__ import annotations

from pxr import Gf, UsdLux

import images
import parts
import patterns
import shading
import solids


def corner(stage):
    """A corner of three walls that bleed colour."""
    for name, size, place, color in (
        ("Floor", (4, 0.1, 4), (0, -0.05, 0), (0.6, 0.6, 0.6)), ("Back", (4, 3, 0.1), (0, 1.5, -2.05), (0.6, 0.6, 0.6)),
        ("Left", (0.1, 3, 4), (-2.05, 1.5, 0), (0.7, 0.15, 0.1)),
        ("Right", (0.1, 3, 4), (2.05, 1.5, 0), (0.15, 0.5, 0.2)),
    ):  # fmt: skip
        solids.put(solids.block(stage, f"/World/{name}", size, color), place)
    parts.camera(stage, "/World/Camera", (0, 1.4, 6.5), (0, 1.1, 0), aperture=(24.0, 18.0), focal=30.0)


def reference_bounces(stage, folder):
    """Diffuse walls and a box under a dull sky and a sun: five bounces of light."""
    corner(stage)
    solids.put(solids.block(stage, "/World/Box", (1.0, 1.4, 1.0), (0.7, 0.7, 0.7)), (-0.5, 0.7, -0.5), turn=25)
    parts.dome(stage, 0.4)
    parts.distant(stage, "/World/Sun", (-0.5, -1.0, -0.4), 2.5, color=(1.0, 0.9, 0.8))


def reference_area_light(stage, folder):
    """The same corner lit by a rectangle and a ball."""
    corner(stage)
    solids.put(parts.ball(stage, "/World/Ball", 0.6, 12, (0.7, 0.7, 0.7)), (0.5, 0.6, -0.3))
    panel = UsdLux.RectLight.Define(stage, "/World/Panel")
    panel.CreateIntensityAttr(6.0)
    panel.CreateWidthAttr(1.4)
    solids.put(panel, (-0.4, 2.95, 0.2), tilt=-90)
    bulb = UsdLux.SphereLight.Define(stage, "/World/Bulb")
    bulb.CreateIntensityAttr(9.0)
    bulb.CreateRadiusAttr(0.15)
    bulb.CreateColorAttr(Gf.Vec3f(0.4, 0.7, 1.0))
    solids.put(bulb, (1.4, 1.8, 1.9))


def reference_metal(stage, folder):
    """Metal balls of roughness 0.1, 0.2, 0.3 on a dark floor in a smooth sky."""
    picture = patterns.sky(128, sun_radiance=0.0)
    images.exr(folder / "maps/dull_sky.exr", picture, half=True)
    solids.ground(stage, "/World/Ground", 8.0, color=(0.2, 0.2, 0.2))
    for index, value in enumerate((0.1, 0.2, 0.3)):
        ball = solids.put(parts.ball(stage, f"/World/Ball{index}", 0.5, 12, None), (1.15 * index - 1.15, 0.5, 0))
        shading.bind(
            ball,
            shading.material(
                stage, f"/World/Looks/Metal{index}", diffuseColor=(0.9, 0.7, 0.4), metallic=1.0, roughness=value
            ),
        )
    parts.dome(stage).CreateTextureFileAttr("./maps/dull_sky.exr")
    parts.camera(stage, "/World/Camera", (0, 1.3, 5), (0, 0.45, 0), aperture=(24.0, 18.0), focal=36.0)


def reference_glass(stage, folder):
    """A glass ball in front of a checker wall in a dull sky: refraction, total reflection, twelve bounces."""
    images.png(folder / "maps/checker.png", images.to_8_bit(patterns.checker(64, 8, (0.8, 0.3, 0.1), (0.1, 0.2, 0.6))))
    wall = solids.put(solids.card(stage, "/World/Wall", 4.0, 4.0), (0, -2, -1.2))
    color = shading.sample(stage, "/World/Looks/Wall/Color", "./maps/checker.png", color_space="raw")
    shading.bind(
        wall,
        shading.material(
            stage, "/World/Looks/Wall", diffuseColor=(0, 0, 0), emissiveColor=color, useSpecularWorkflow=1,
            specularColor=(0, 0, 0), roughness=1.0,
        ),
    )
    ball = parts.ball(stage, "/World/Ball", 0.8, 12, None)
    shading.bind(
        ball, shading.material(stage, "/World/Looks/Glass", diffuseColor=(1, 1, 1), opacity=0.0, roughness=0.0, ior=1.5)
    )
    parts.dome(stage, 0.5)
    parts.camera(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), aperture=(24.0, 18.0), focal=36.0)


def reference_frosted_glass(stage, folder):
    """A frosted ball and a frosted plate in front of a wall of stripes that glow, under a lamp: rough refraction, lit
    and seen from either side."""
    images.png(folder / "maps/stripes.png", images.to_8_bit(patterns.checker(64, 8, (0.8, 0.3, 0.1), (0.1, 0.2, 0.6))))
    wall = solids.put(solids.card(stage, "/World/Wall", 4.0, 4.0), (0, -2, -1.2))
    color = shading.sample(stage, "/World/Looks/Wall/Color", "./maps/stripes.png", color_space="raw")
    shading.bind(
        wall,
        shading.material(
            stage, "/World/Looks/Wall", diffuseColor=(0, 0, 0), emissiveColor=color, useSpecularWorkflow=1,
            specularColor=(0, 0, 0), roughness=1.0,
        ),
    )
    frosted = shading.material(
        stage, "/World/Looks/Frosted", diffuseColor=(1, 1, 1), opacity=0.0, roughness=0.1, ior=1.5
    )
    ball = parts.ball(stage, "/World/Ball", 0.6, 12, None)
    ball.AddTranslateOp().Set(Gf.Vec3d(-0.75, 0, 0))
    shading.bind(ball, frosted)
    plate = parts.box(stage, "/World/Plate", None, 1.0)
    plate.AddTranslateOp().Set(Gf.Vec3d(0.75, 0, 0))
    plate.AddRotateXYZOp().Set(Gf.Vec3f(10, 30, 0))
    plate.AddScaleOp().Set(Gf.Vec3f(1.0, 1.2, 0.1))
    shading.bind(plate, frosted)
    parts.dome(stage, 0.3)
    lamp = UsdLux.RectLight.Define(stage, "/World/Lamp")
    lamp.CreateIntensityAttr(8.0)
    lamp.CreateWidthAttr(1.0)
    lamp.CreateHeightAttr(1.0)
    lamp.AddTranslateOp().Set(Gf.Vec3d(0, 2.5, 1.0))
    lamp.AddRotateXOp().Set(-70.0)
    parts.camera(stage, "/World/Camera", (0, 0, 5), (0, 0, 0), aperture=(24.0, 18.0), focal=36.0)


SCENES = [reference_bounces, reference_area_light, reference_metal, reference_glass, reference_frosted_glass]
BOUNCES = {"reference_glass": 12, "reference_frosted_glass": 12}
"""Indirect bounces where five are not enough."""
SIZE = (64, 48)
BLOCKS = (4, 3)
"""Regions of a reference: the picture in columns and rows."""
