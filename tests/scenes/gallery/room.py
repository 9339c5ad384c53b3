# SPDX-License-Identifier: Apache-2.0
"""A room lit by one light of each kind: a rectangle in the ceiling, a disk behind a cone, a bulb, a tube on the
wall."""

from pxr import Gf, UsdLux

import parts
import shading
import solids

VASE = [
    (0.0, 0.0), (0.22, 0.0), (0.25, 0.03), (0.33, 0.2), (0.36, 0.38), (0.3, 0.58), (0.16, 0.74), (0.13, 0.84),
    (0.19, 0.95), (0.175, 0.95), (0.115, 0.84), (0.14, 0.74), (0.0, 0.7),
]


def light(stage, kind, path, intensity, color=(1, 1, 1), position=(0, 0, 0), turn=0.0, tilt=0.0, **inputs):
    """A UsdLux light; `inputs` are attributes of its schema without `inputs:`."""
    made = kind.Define(stage, path)
    made.CreateIntensityAttr(intensity)
    made.CreateColorAttr(Gf.Vec3f(*color))
    for name, value in inputs.items():
        getattr(made, f"Create{name[0].upper()}{name[1:]}Attr")(value)
    return solids.put(made, position, turn, tilt)


def shape(made, angle, softness=0.0, focus=0.0):
    """Gives a light a cone."""
    shaping = UsdLux.ShapingAPI.Apply(made.GetPrim())
    shaping.CreateShapingConeAngleAttr(angle)
    shaping.CreateShapingConeSoftnessAttr(softness)
    shaping.CreateShapingFocusAttr(focus)
    return made


def walls(stage):
    for name, size, place, color in (
        ("Floor", (6, 0.1, 5), (0, -0.05, 0), (0.42, 0.36, 0.30)),
        ("Ceiling", (6, 0.1, 5), (0, 3.05, 0), (0.75, 0.75, 0.73)),
        ("Back", (6, 3.2, 0.1), (0, 1.5, -2.55), (0.70, 0.68, 0.62)),
        ("Left", (0.1, 3.2, 5), (-3.05, 1.5, 0), (0.62, 0.16, 0.10)),
        ("Right", (0.1, 3.2, 5), (3.05, 1.5, 0), (0.12, 0.32, 0.45)),
    ):
        solids.put(solids.block(stage, f"/World/Walls/{name}", size, color), place)


def build(stage, folder, options):
    walls(stage)
    glaze = shading.material(stage, "/World/Looks/Glaze", diffuseColor=(0.08, 0.25, 0.22), roughness=0.12)
    vase = solids.put(solids.lathe(stage, "/World/Vase", VASE, 64), (-0.2, 0.7, -0.3), scale=0.9)
    shading.bind(vase, glaze)
    solids.put(solids.block(stage, "/World/Plinth", (0.9, 0.7, 0.9), (0.72, 0.7, 0.66)), (-0.2, 0.35, -0.3), turn=20)
    solids.put(solids.sphere(stage, "/World/Ball", 0.35, 32, (0.8, 0.62, 0.15)), (1.3, 0.35, 0.5))
    solids.put(solids.block(stage, "/World/Box", (0.7, 1.3, 0.7), (0.5, 0.5, 0.55)), (-1.9, 0.65, -1.1), turn=-28)
    light(
        stage, UsdLux.RectLight, "/World/Panel", 5.0, (1.0, 0.94, 0.85), (0.5, 2.97, -0.3), tilt=-90, width=1.6,
        height=0.8,
    )
    bulb = light(stage, UsdLux.SphereLight, "/World/Bulb", 22.0, position=(2.2, 1.5, -1.6), radius=0.12)
    bulb.CreateEnableColorTemperatureAttr(True)
    bulb.CreateColorTemperatureAttr(2700.0)
    light(
        stage, UsdLux.CylinderLight, "/World/Tube", 9.0, (0.55, 0.75, 1.0), (-2.86, 2.0, -0.6), turn=90, length=2.0,
        radius=0.05,
    )
    spot = light(
        stage, UsdLux.DiskLight, "/World/Spot", 160.0, (1.0, 0.97, 0.9), (-0.2, 2.9, 0.9), tilt=-58, radius=0.10
    )
    shape(spot, 24.0, 0.35)
    wash = light(
        stage, UsdLux.DiskLight, "/World/Wash", 120.0, (1.0, 0.6, 0.3), (1.1, 2.95, -2.1), tilt=-80, radius=0.08
    )
    shape(wash, 35.0, 0.8, 4.0)
    parts.camera(stage, "/World/Camera", (0.1, 1.6, 6.3), (0.0, 1.35, 0.0), aperture=(36.0, 20.25), focal=33.0)
