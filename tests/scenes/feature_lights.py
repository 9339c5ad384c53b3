# SPDX-License-Identifier: Apache-2.0
"""Feature scenes of lights: one thing each, answers in tests/hydra/test_features_lights.py. Written by features.py.

Where not said otherwise: a Lambertian floor of albedo 1/2 in the plane y = 0, seen from straight above by an
orthographic camera two units wide that stands at y = 1; lights are above the camera, which does not see them.
"""

from __future__ import annotations

import math

import numpy as np
from pxr import Gf, UsdLux

import images
import parts
import patterns
import shading

ALBEDO = 0.5


def floor_and_camera(stage, color=(ALBEDO,) * 3):
    parts.quad(stage, "/World/Floor", 6.0, color).AddRotateXOp().Set(-90.0)
    return parts.orthographic(stage, "/World/Camera", (0, 1, 0), (0, 0, 0), 2.0, up=(0, 0, -1))


def place(light, position, turn_x=0.0, turn_z=0.0, scale=None):
    light.AddTranslateOp().Set(Gf.Vec3d(*position))
    if turn_z:
        light.AddRotateZOp().Set(turn_z)
    if turn_x:
        light.AddRotateXOp().Set(turn_x)
    if scale:
        light.AddScaleOp().Set(Gf.Vec3f(*scale))
    return light


def lamp(stage, kind, path="/World/Light", intensity=1.0, color=(1, 1, 1), **attributes):
    light = kind.Define(stage, path)
    light.CreateIntensityAttr(intensity)
    light.CreateColorAttr(Gf.Vec3f(*color))
    for name, value in attributes.items():
        getattr(light, f"Create{name[0].upper()}{name[1:]}Attr")(value)
    return light


def light_rect(stage, folder):
    """A rectangle of 1.2 x 0.8, radiance (2, 1, 0.5), facing down from y = 1.5, off the middle."""
    floor_and_camera(stage)
    place(
        lamp(stage, UsdLux.RectLight, intensity=2.0, color=(1, 0.5, 0.25), width=1.2, height=0.8), (0.3, 1.5, -0.2), -90
    )


def light_rect_tilted(stage, folder):
    """A rectangle with a scaled and turned transform; parts of the floor are behind it."""
    floor_and_camera(stage)
    place(
        lamp(stage, UsdLux.RectLight, intensity=3.0, width=0.5, height=1.0), (-0.8, 1.6, 0.1), -90, 35, (2.0, 0.5, 1.0)
    )


def light_rect_texture(stage, folder):
    """A rectangle whose picture is red, green (upper half: left, right), blue and white (lower half), seen by a mirror:
    which way round it is."""
    write_quarters(folder)
    light = place(lamp(stage, UsdLux.RectLight, intensity=1.0, width=2.0, height=2.0), (0.0, 3.0, 0.0), -90)
    light.CreateTextureFileAttr("./maps/quarters.png")
    mirror = parts.quad(stage, "/World/Mirror", 6.0, None)
    mirror.AddRotateXOp().Set(-90.0)
    shading.bind(
        mirror, shading.material(stage, "/World/Looks/Mirror", diffuseColor=(1, 1, 1), metallic=1.0, roughness=0.0)
    )
    parts.orthographic(stage, "/World/Camera", (0, 1, 0), (0, 0, 0), 2.0, up=(0, 0, -1))


def light_disk(stage, folder):
    """A disk of radius 0.6 facing down from y = 1.4."""
    floor_and_camera(stage)
    place(lamp(stage, UsdLux.DiskLight, intensity=2.0, radius=0.6), (-0.2, 1.4, 0.1), -90)


def light_sphere(stage, folder):
    """A ball of radius 0.4 at y = 1.7."""
    floor_and_camera(stage)
    place(lamp(stage, UsdLux.SphereLight, intensity=4.0, color=(0.5, 1.0, 0.75), radius=0.4), (0.25, 1.7, 0.3))


def light_sphere_point(stage, folder):
    """A point light: a ball with treatAsPoint and normalize, so that its intensity is what a facing square a unit away
    gets, times pi / pi."""
    floor_and_camera(stage)
    light = lamp(stage, UsdLux.SphereLight, intensity=4.0 * math.pi, radius=0.05, treatAsPoint=True)
    light.CreateNormalizeAttr(True)
    place(light, (0.25, 1.7, 0.3))


def light_cylinder(stage, folder):
    """A tube of length 1.5 and radius 0.2 along x, turned a little about y."""
    floor_and_camera(stage)
    light = lamp(stage, UsdLux.CylinderLight, intensity=3.0, length=1.5, radius=0.2)
    light.AddTranslateOp().Set(Gf.Vec3d(0.1, 1.6, -0.1))
    light.AddRotateYOp().Set(25.0)


def light_cone(stage, folder):
    """A small disk behind a cone of 25 degrees with a hard edge, straight down from y = 1.5; softness and focus are set
    by edits."""
    floor_and_camera(stage)
    light = place(lamp(stage, UsdLux.DiskLight, intensity=200.0, radius=0.03), (0, 1.5, 0), -90)
    shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
    shaping.CreateShapingConeAngleAttr(25.0)
    shaping.CreateShapingConeSoftnessAttr(0.0)
    shaping.CreateShapingFocusAttr(0.0)


IES = (0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0)
IES_CANDELA = (1000.0, 900.0, 600.0, 300.0, 100.0, 20.0, 0.0)


def light_ies(stage, folder):
    """A small ball with an IES profile that is the same all around and falls from 1000 candela straight down to 0 at
    the side."""
    floor_and_camera(stage)
    numbers = " ".join(f"{angle:g}" for angle in IES) + "\n0\n" + " ".join(f"{value:g}" for value in IES_CANDELA)
    (folder / "maps/fall.ies").write_text(
        "IESNA:LM-63-2002\n"
        "[TEST] made by a script\n"
        "TILT=NONE\n"
        f"1 -1 1 {len(IES)} 1 1 2 0 0 0\n"
        "1 1 1\n"
        f"{numbers}\n"
    )
    # The light's -z is straight down.
    light = place(lamp(stage, UsdLux.SphereLight, intensity=100.0, radius=0.02), (0, 1.5, 0), -90)
    shaping = UsdLux.ShapingAPI.Apply(light.GetPrim())
    shaping.CreateShapingIesFileAttr("./maps/fall.ies")
    shaping.CreateShapingConeAngleAttr(180.0)


def write_quarters(folder):
    quarters = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)]], dtype=np.uint8)
    images.png(folder / "maps/quarters.png", patterns.blocks(quarters, 8))


def slope_map(folder):
    """A latlong of radiance 1 + d.x, 1 + d.y, 1 + d.z: its irradiance on a face n is pi + 2/3 pi n."""
    images.exr(folder / "maps/slope.exr", 1.0 + patterns.latlong_directions(64, 32))


def light_dome_texture(stage, folder):
    """A box under a latlong that is brighter towards +x in red, +y in green, +z in blue; three of its faces are
    seen."""
    slope_map(folder)
    parts.box(stage, "/World/Box", (ALBEDO,) * 3, 1.0)
    parts.dome(stage).CreateTextureFileAttr("./maps/slope.exr")
    parts.orthographic(stage, "/World/Camera", (3, 3, 3), (0, 0, 0), 2.0)


def light_dome_axis(stage, folder):
    """As light_dome_texture with a DomeLight_1 whose pole is z: the picture's top is +z, its middle -y."""
    slope_map(folder)
    parts.box(stage, "/World/Box", (ALBEDO,) * 3, 1.0)
    light = UsdLux.DomeLight_1.Define(stage, "/World/Dome")
    light.CreateTextureFileAttr("./maps/slope.exr")
    light.CreatePoleAxisAttr(UsdLux.Tokens.Z)
    parts.orthographic(stage, "/World/Camera", (3, 3, 3), (0, 0, 0), 2.0)


def light_dome_sun(stage, folder):
    """A floor under a dark latlong with one square of 2 x 2 texels, 1e4 bright, 45 degrees up: what only importance
    sampling gets quiet."""
    floor_and_camera(stage)
    picture = np.full((64, 128, 3), 0.02)
    picture[15:17, 40:42] = 1e4
    images.exr(folder / "maps/sun.exr", picture, half=True)
    parts.dome(stage).CreateTextureFileAttr("./maps/sun.exr")


def light_shadow(stage, folder):
    """A square over the left half of the floor, in the light of a sun straight above; shadow:enable is switched by
    edits."""
    floor_and_camera(stage)
    parts.quad(stage, "/World/Roof", 2.0, (0.1, 0.1, 0.1)).AddTransformOp().Set(
        Gf.Matrix4d().SetRotate(Gf.Rotation(Gf.Vec3d(1, 0, 0), -90)) * Gf.Matrix4d().SetTranslate(Gf.Vec3d(-1, 1.5, 0))
    )
    sun = parts.distant(stage, "/World/Sun", (0, -1, 0), math.pi)
    UsdLux.ShadowAPI.Apply(sun.GetPrim()).CreateShadowEnableAttr(True)


def light_links(stage, folder):
    """Three squares and three suns of one colour each: each sun is linked to one square. A roof over all casts the
    shadow of the green sun only."""
    for index in range(3):
        square = parts.quad(stage, f"/World/Square{index}", 1.0, (ALBEDO,) * 3)
        square.AddTranslateOp().Set(Gf.Vec3d(1.2 * index - 1.2, 0, 0))
        square.AddRotateXOp().Set(-90.0)
    roof = parts.quad(stage, "/World/Roof", 8.0, (0.1, 0.1, 0.1))
    roof.AddTranslateOp().Set(Gf.Vec3d(0, 3, 0))
    roof.AddRotateXOp().Set(-90.0)
    for index, color in enumerate(((1, 0, 0), (0, 1, 0), (0, 0, 1))):
        sun = parts.distant(stage, f"/World/Sun{index}", (0, -1, 0), math.pi, color=color)
        links = UsdLux.LightAPI(sun).GetLightLinkCollectionAPI()
        links.CreateIncludeRootAttr(False)
        links.CreateIncludesRel().AddTarget(f"/World/Square{index}")
        if index != 1:
            shadows = UsdLux.LightAPI(sun).GetShadowLinkCollectionAPI()
            shadows.CreateIncludeRootAttr(False)
            shadows.CreateIncludesRel().AddTarget("/World/Square0")
    parts.orthographic(stage, "/World/Camera", (0, 1, 0), (0, 0, 0), 3.6, up=(0, 0, -1))


def light_multipliers(stage, folder):
    """A Lambertian floor, and a sun whose diffuse multiplier is 0.25 and whose specular one is 0."""
    floor_and_camera(stage)
    sun = parts.distant(stage, "/World/Sun", (0, -1, 0), math.pi)
    sun.CreateDiffuseAttr(0.25)
    sun.CreateSpecularAttr(0.0)


def grid_places():
    return [(0.5 * (k % 10) - 2.25, 1.6 + 0.05 * ((7 * k) % 10), 0.5 * (k // 10) - 2.25) for k in range(100)]


def lights_hundred(stage, folder):
    """A hundred balls of radius 0.05 with powers 1, 2, 3, 4 in turn, in three colours: the sum of a hundred known
    answers."""
    floor_and_camera(stage)
    for number, position in enumerate(grid_places()):
        color = [1.0 if number % 3 == channel else 0.2 for channel in range(3)]
        place(
            lamp(
                stage, UsdLux.SphereLight, f"/World/Lights/Ball{number:03}", 10.0 * (1 + number % 4), color, radius=0.05
            ),
            position,
        )


def lights_instanced(stage, folder):
    """The same hundred balls by a point instancer of twelve lights."""
    floor_and_camera(stage)
    kinds = [f"/World/Lights/Ball{kind:02}" for kind in range(12)]
    parts.instancer(stage, "/World/Lights", kinds, [number % 12 for number in range(100)], grid_places())
    for kind in range(12):
        color = [1.0 if kind % 3 == channel else 0.2 for channel in range(3)]
        lamp(stage, UsdLux.SphereLight, kinds[kind], 10.0 * (1 + kind % 4), color, radius=0.05)


def light_mesh(stage, folder):
    """light_rect's rectangle as a mesh with an emissive material, facing down."""
    floor_and_camera(stage)
    panel = parts.mesh(
        stage, "/World/Panel", [(-0.6, 0, -0.4), (0.6, 0, -0.4), (0.6, 0, 0.4), (-0.6, 0, 0.4)], [4], range(4), None
    )
    panel.AddTranslateOp().Set(Gf.Vec3d(0.3, 1.5, -0.2))
    shading.bind(
        panel,
        shading.material(
            stage, "/World/Looks/Glow", diffuseColor=(0, 0, 0), emissiveColor=(2.0, 1.0, 0.5), roughness=1.0
        ),
    )


def light_mesh_api(stage, folder):
    """light_rect's rectangle as a mesh that is a light by MeshLightAPI: no material, two stops of 1/2, a scale; and a
    material that glows, bound to nothing."""
    floor_and_camera(stage)
    panel = parts.mesh(
        stage, "/World/Panel", [(-0.3, 0, -0.8), (0.3, 0, -0.8), (0.3, 0, 0.8), (-0.3, 0, 0.8)], [4], range(4), None
    )
    panel.AddTranslateOp().Set(Gf.Vec3d(0.3, 1.5, -0.2))
    panel.AddScaleOp().Set(Gf.Vec3f(2.0, 1.0, 0.5))
    UsdLux.MeshLightAPI.Apply(panel.GetPrim())
    light = UsdLux.LightAPI(panel.GetPrim())
    light.CreateIntensityAttr(0.5)
    light.CreateExposureAttr(2.0)
    light.CreateColorAttr(Gf.Vec3f(1, 0.5, 0.25))
    shading.material(
        stage, "/World/Looks/Glow", diffuseColor=(0.5, 0.5, 0.5), emissiveColor=(0.5, 1.0, 3.0), roughness=1.0
    )


SCENES = [
    light_rect, light_rect_tilted, light_rect_texture, light_disk, light_sphere, light_sphere_point, light_cylinder,
    light_cone, light_ies, light_dome_texture,
    light_dome_axis, light_dome_sun, light_shadow, light_links, light_multipliers, lights_hundred, lights_instanced,
    light_mesh,
    light_mesh_api,
]  # fmt: skip
