# SPDX-License-Identifier: Apache-2.0
"""Pictures of domes in other layouts than longitude and latitude."""

import math

import numpy as np
from cases.case import Case

_NORMALS = [(0, 0, 1), (1, 0, 1), (-1, 0, 1), (0, 1, 1), (0, -1, 1), (1, 1, 1), (-1, 1, 0.5), (0.5, -1, 0.3)]
_WHY = "half of the sphere of radiance 1 about the axis a gives a square of normal n the irradiance pi (1 + n . a) / 2"


def _directions(edit: str | None, variant: str, turn=lambda n: n) -> Case:
    """`turn`: from the world to the dome."""
    cells = {}
    for i, normal in enumerate(_NORMALS):
        n = turn(np.array(normal) / np.linalg.norm(normal))
        cells[i % 4, i // 4] = tuple(float(0.5 * (1 + c) / 2) for c in n)
    # Edges in the picture are half a texel wide or more: 1 % of the irradiance at most.
    return Case(
        "dome_directions", (4, 2), cells, _WHY, edit=edit, variant=variant, inset=0.1875, bounces=0, samples=512,
        absolute=4e-3, silent=True,
    )


def _format(file: str, token: str) -> str:
    return (
        "dome = UsdLux.DomeLight(stage.GetPrimAtPath('/L'))\n"
        f"dome.GetTextureFileAttr().Set('./tex/{file}')\ndome.GetTextureFormatAttr().Set('{token}')"
    )


_TURN = "UsdGeom.Xformable(stage.GetPrimAtPath('/L')).AddRotateYOp().Set(90.0)"

# The picture of the next scenes has four upright bars: red, green, blue, white. The middle of the cell is a square that
# faces +z and sees all of that half of the sphere; its irradiance is the sum over directions, spread by the cosine, of
# the bar where each layout has them.
_BARS = np.array([(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 1.0, 1.0)])


def _irradiated(column) -> tuple[float, ...]:
    """`column(d)`: where directions (3, ...) are in the picture, from 0 to 1 to the right."""
    steps = (np.arange(1024) + 0.5) / 1024
    square, azimuth = np.meshgrid(steps, 2 * math.pi * steps)
    across = np.sqrt(square)
    d = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), np.sqrt(1 - square)])
    bars = _BARS[np.clip((4 * column(d)).astype(int), 0, 3)]
    return tuple(float(v) for v in 0.5 * bars.mean(axis=(0, 1)))


def _ball(d):
    """The normal half way to +z."""
    return 0.5 + 0.5 * d[0] / np.sqrt(d[0] ** 2 + d[1] ** 2 + (d[2] + 1) ** 2)


def _angular(d):
    return 0.5 + 0.5 * np.arccos(d[2]) / math.pi * d[0] / np.hypot(d[0], d[1])


def _cross(d):
    """The faces -x, +z, +x side by side; +y and -y are above and below +z."""
    x, y, z = d
    largest = np.abs(d).max(axis=0)
    place = x / largest
    beside = (np.abs(x) == largest) * np.sign(x)
    return np.where(beside != 0, 0.5 + beside / 3 - beside * z / largest / 6, 0.5 + place / 6)


def _silent(layout: str, column) -> Case:
    why = "the bars that the layout has in that half, half of each reflected"
    value = _irradiated(column)
    # The picture is 32 texels wide, and a texel's edge is soft.
    return Case(
        f"29_silent_dome_{layout}", (1, 1), {(0, 0): value}, why, inset=0.25, absolute=6e-3, samples=512, silent=True
    )


CASES = [
    _directions(None, "ball"),
    _directions(_format("angular.png", "angular"), "angular"),
    _directions(_format("cross.png", "cubeMapVerticalCross"), "cross"),
    # The dome's +x is the world's -z, its +z the world's +x.
    _directions(_TURN, "turned", lambda n: (-n[2], n[1], n[0])),
    _silent("mirroredBall", _ball),
    _silent("angular", _angular),
    _silent("cubeMapVerticalCross", _cross),
]
