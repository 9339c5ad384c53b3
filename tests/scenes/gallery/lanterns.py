# SPDX-License-Identifier: Apache-2.0
"""A thousand small sphere lights in many colours, spiralling over a court with columns: many lights. `lights` sets how
many."""

import colorsys
import math

import numpy as np
from pxr import Gf, UsdLux

import parts
import solids


def build(stage, folder, options):
    count = int(options.get("lights", 1000))
    solids.ground(stage, "/World/Floor", 40.0, color=(0.32, 0.31, 0.30))
    column = [
        (0.0, 0.0), (0.34, 0.0), (0.34, 0.16), (0.24, 0.2), (0.2, 1.9), (0.24, 1.95), (0.34, 2.05), (0.34, 2.2),
        (0.0, 2.2),
    ]
    parts.instancer(
        stage, "/World/Columns", ["/World/Columns/Column"], [0] * 12,
        [(4.2 * math.sin(a), 0, 4.2 * math.cos(a)) for a in np.arange(12) * math.pi / 6],
    )
    solids.lathe(stage, "/World/Columns/Column", column, 32, (0.66, 0.64, 0.6))
    solids.put(solids.sphere(stage, "/World/Orb", 0.9, 40, (0.75, 0.75, 0.75)), (0, 0.9, 0))
    solids.lathe(
        stage, "/World/Steps", [(0.0, 0.0), (2.4, 0.0), (2.4, 0.12), (1.9, 0.12), (1.9, 0.24), (0.0, 0.24)], 64,
        (0.5, 0.48, 0.45),
    )
    random = np.random.default_rng(12)
    # The power of all together does not depend on how many they are.
    power = 42.0 * 1000 / count
    for index in range(count):
        f = index / count
        turn = 2 * math.pi * 17 * f + 0.3 * random.normal()
        radius = 1.3 + 4.6 * f**0.7 + 0.15 * random.normal()
        height = 2.9 - 2.4 * f + 0.25 * math.sin(40 * f) + 0.1 * random.normal()
        lamp = UsdLux.SphereLight.Define(stage, f"/World/Lanterns/Lamp{index:06}")
        lamp.CreateRadiusAttr(0.018)
        lamp.CreateIntensityAttr(power)
        lamp.CreateColorAttr(
            Gf.Vec3f(*colorsys.hsv_to_rgb((0.02 + 0.55 * f + 0.04 * random.normal()) % 1.0, 0.72, 1.0))
        )
        lamp.AddTranslateOp().Set(Gf.Vec3d(radius * math.sin(turn), max(height, 0.05), radius * math.cos(turn)))
    parts.camera(stage, "/World/Camera", (0.0, 3.1, 9.2), (0.0, 1.05, 0.0), aperture=(36.0, 20.25), focal=34.0)
