# SPDX-License-Identifier: Apache-2.0
"""Three busts and a wall: each coloured light shines on one of them only, one light casts no shadow, one is shadowed by
one bust only."""

from pxr import UsdLux

import parts
import shading
import solids
from .room import VASE, light

BUST = [
    (0.0, 0.0), (0.34, 0.0), (0.36, 0.06), (0.22, 0.1), (0.16, 0.28), (0.3, 0.42), (0.4, 0.62), (0.3, 0.78),
    (0.16, 0.86), (0.15, 0.94), (0.26, 1.06), (0.3, 1.22), (0.24, 1.4), (0.0, 1.5),
]


def link(api, *paths):
    """Makes a light's collection hold just these prims."""
    collection = api
    collection.CreateIncludeRootAttr(False)
    for path in paths:
        collection.CreateIncludesRel().AddTarget(path)


def build(stage, folder, options):
    clay = shading.material(stage, "/World/Looks/Clay", diffuseColor=(0.62, 0.6, 0.57), roughness=0.45)
    for index, x in enumerate((-1.7, 0.0, 1.7)):
        shading.bind(
            solids.put(
                solids.lathe(stage, f"/World/Bust{index}", BUST if index != 1 else VASE, 64), (x, 0, 0),
                scale=1.0 if index != 1 else 1.5,
            ),
            clay,
        )
    solids.put(solids.block(stage, "/World/Stage/Floor", (9, 0.1, 6), (0.45, 0.44, 0.43)), (0, -0.05, 0))
    solids.put(solids.block(stage, "/World/Stage/Wall", (9, 4, 0.1), (0.5, 0.5, 0.5)), (0, 1.95, -1.8))
    for index, color in enumerate(((1.0, 0.25, 0.15), (0.2, 1.0, 0.3), (0.25, 0.4, 1.0))):
        lamp = light(
            stage, UsdLux.SphereLight, f"/World/Lamp{index}", 70.0, color, (1.7 * index - 1.7 + 0.7, 3.1, 1.6),
            radius=0.15,
        )
        link(UsdLux.LightAPI(lamp).GetLightLinkCollectionAPI(), f"/World/Bust{index}")
    fill = light(
        stage, UsdLux.RectLight, "/World/Fill", 1.6, position=(-3.2, 2.6, 3.2), turn=-45, tilt=-25, width=2.0,
        height=2.0,
    )
    UsdLux.ShadowAPI.Apply(fill.GetPrim()).CreateShadowEnableAttr(False)
    key = light(
        stage, UsdLux.RectLight, "/World/Key", 34.0, (1.0, 0.95, 0.85), (2.6, 3.2, 3.0), turn=42, tilt=-38, width=0.5,
        height=0.5,
    )
    link(UsdLux.LightAPI(key).GetShadowLinkCollectionAPI(), "/World/Bust1")
    parts.camera(stage, "/World/Camera", (0.0, 1.7, 6.6), (0.0, 0.95, 0.0), aperture=(36.0, 20.25), focal=40.0)
