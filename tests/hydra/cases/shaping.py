# SPDX-License-Identifier: Apache-2.0
"""Cones, focus and profiles of lamps (UsdLuxShapingAPI).

A small lamp 2 above a floor of albedo 0.5; what the floor reflects is `0.5 / pi * E`, the irradiance E of a ball of
radius r and radiance L at distance d under the angle t to the floor's normal is `pi L (r / d)^2 cos t`, of a small
body seen from the side area times L cos t / d^2. Cells' means are sums over a grid of points.
"""

import math

import numpy as np
from cases.case import Case

_STEPS = 32


def _grid(size: tuple[float, float], inset: float = 0.0):
    """Points of a cell of the floor."""
    steps = inset + (np.arange(_STEPS) + 0.5) / _STEPS * (1 - 2 * inset)
    x, y = np.meshgrid(steps * size[0], steps * size[1])
    return x, y


def _ball(x, y, at, radiance: float, radius: float, shape=lambda forwards: 1.0):
    """What a floor of albedo 0.5 in z = 0 reflects of a ball; `shape` scales it by the cosine of the direction that
    leaves the lamp to straight down."""
    square = (x - at[0]) ** 2 + (y - at[1]) ** 2 + at[2] ** 2
    cosine = at[2] / np.sqrt(square)
    return 0.5 * radiance * radius**2 / square * cosine * shape(cosine)


def _whole(*_):
    return 1.0


# A floor of 4 x 4 with the lamp of radiance 40 and radius 0.1 over its middle; the camera sees the lamp at the corners
# of the four cells in the middle, which are cut.
_INSET = 0.125


def _ies(file: str, shape, why: str) -> Case:
    x, y = _grid((1, 1), _INSET)
    cells = {
        (i, j): float(_ball(x + i, y + j, (2, 2, 2), 40.0, 0.1, shape).mean()) for i in range(4) for j in range(4)
    }
    return Case(file, (4, 4), cells, why, inset=_INSET)


# One cell with the lamp at (1.3, 0.5, 2), radiance 500 and radius 0.05: what reaches the floor leaves it 8 to 36
# degrees from straight down.
_AT = (1.3, 0.5, 2.0)


def _floor(shape=_whole, cylinder: bool = False) -> float:
    x, y = _grid((1, 1))
    if not cylinder:
        return float(_ball(x, y, _AT, 500.0, 0.05, shape).mean())
    # The side of a cylinder along x, seen from the angle a to it, has the area 2 r l sin a.
    square = (x - _AT[0]) ** 2 + (y - _AT[1]) ** 2 + _AT[2] ** 2
    cosine = _AT[2] / np.sqrt(square)
    area = 2 * 0.05 * 0.1 * np.sqrt(1 - (x - _AT[0]) ** 2 / square)
    return float((0.5 / math.pi * 500.0 * area * cosine / square * shape(cosine)).mean())


def _sideways(shape) -> float:
    """The same for a lamp that points along +x: `shape` of the angle to that, degrees."""
    x, y = _grid((1, 1))
    square = (x - _AT[0]) ** 2 + (y - _AT[1]) ** 2 + _AT[2] ** 2
    angle = np.degrees(np.arccos((x - _AT[0]) / np.sqrt(square)))
    return float((_ball(x, y, _AT, 500.0, 0.05) * shape(angle)).mean())


def _one(file: str, value: float, why: str, variant: str = "", turn=None, **more) -> Case:
    """`turn`: rotateXYZ of the lamp; `more`: shaping inputs by name, 2 underscores for a colon; `edit` comes first."""
    lines = [more.pop("edit", "")]
    lines.append("light = stage.GetPrimAtPath('/World/L0_0')")
    if turn:
        lines.append(f"light.GetAttribute('xformOp:rotateXYZ').Set(Gf.Vec3f{turn})")
    says = more.pop("says", ())
    for name, value_ in more.items():
        kind = "Asset" if isinstance(value_, str) else "Bool" if isinstance(value_, bool) else "Float"
        name = f"inputs:shaping:{name.replace('__', ':')}"
        lines.append(f"light.CreateAttribute('{name}', Sdf.ValueTypeNames.{kind}).Set({value_!r})")
    edit = "\n".join(lines) if variant else None
    return Case(file, (1, 1), {(0, 0): value}, why, edit=edit, variant=variant, says=says)


_PLAIN = "22_focus_1_0"
_UP, _ASIDE = (180, 0, 0), (0, -90, 0)
_DEFAULT_CONE = "stage.GetPrimAtPath('/World/L0_0').RemoveProperty('inputs:shaping:cone:angle')"
_NO_SCHEMA = _DEFAULT_CONE + "\nstage.GetPrimAtPath('/World/L0_0').ClearMetadata('apiSchemas')"
_FADE = lambda angle: 1 - np.clip((angle - 90) / 90, 0, 1) ** 2 * (3 - 2 * np.clip((angle - 90) / 90, 0, 1))

_FOCUS = [
    ("22_focus_0", lambda c: c**2, False, "cos^2"),
    ("22_focus_1", _whole, False, "no focus"),
    ("22_focus_2", lambda c: 0.25 + 0.75 * c**2, False, "0.25 + 0.75 cos^2"),
    ("22_focus_3", lambda c: c**2, True, "cos^2 of a cylinder"),
]

CASES = [
    _ies("20_ies_none", _whole, "no profile"),
    _ies("20_ies_iso", lambda c: 3.0, "3 cd to all sides"),
    _ies("20_ies_iso_normalized", _whole, "3 cd over the mean of the sphere, 3"),
    _ies("20_ies_half", lambda c: 3.0, "3 cd downwards"),
    _ies("20_ies_half_normalized", _whole, "3 cd over the mean of the half, 3"),
    _ies("20_ies_cosine_normalized", lambda c: 2 * c, "3 cos cd over the mean of the half, 1.5"),
    *(
        _one(f"{name}_{turn}", _floor(shape, cylinder), f"{why}, forwards and backwards")
        for name, shape, cylinder, why in _FOCUS for turn in (0, 180)
    ),
    # A cone from 90 to 180 degrees; the floor is at 99 to 123 degrees from the axis of a lamp that points aside.
    _one(_PLAIN, _floor(), "within 130 degrees", "cone130", _ASIDE, cone__angle=130.0),
    _one(_PLAIN, _sideways(lambda a: a < 110), "cut at 110 degrees", "cone110", _ASIDE, cone__angle=110.0),
    _one(_PLAIN, 0.0, "behind 95 degrees", "cone95", _ASIDE, cone__angle=95.0),
    _one(_PLAIN, 0.0, "140 degrees, pointing up", "cone140up", _UP, cone__angle=140.0),
    _one(_PLAIN, _sideways(_FADE), "fades from 90 to 180", "soft", _ASIDE, cone__angle=180.0, cone__softness=0.5),
    _one(_PLAIN, _floor(), "the default cone, 90 degrees, in front", "default_front", edit=_DEFAULT_CONE),
    _one(_PLAIN, 0.0, "the default cone, from behind", "default_behind", _UP, edit=_DEFAULT_CONE),
    _one(_PLAIN, _floor(), "no schema, no cone", "no_schema", _UP, edit=_NO_SCHEMA),
    # A reflection turns the axis, and only one along it.
    _one(
        _PLAIN, 0.0, "mirrored along z: it points up", "mirrored", cone__angle=90.0,
        edit="UsdGeom.Xformable(stage.GetPrimAtPath('/World/L0_0')).AddScaleOp().Set(Gf.Vec3f(1, 1, -1))",
    ),
    _one(
        _PLAIN, _floor(lambda c: c**3), "mirrored along x", "mirrored_x", focus=3.0,
        edit="UsdGeom.Xformable(stage.GetPrimAtPath('/World/L0_0')).AddScaleOp().Set(Gf.Vec3f(-1, 1, 1))",
    ),
    # The cone is not the profile's (UsdLux): neither its default nor another one.
    _one(
        _PLAIN, _floor(lambda c: 3.0), "3 cd upwards too", "ies_up", _UP, edit=_DEFAULT_CONE,
        ies__file="./tex/iso.ies",
    ),
    _one(
        _PLAIN, _floor(lambda c: 3.0), "a cone of 10 degrees", "ies_cone", ies__file="./tex/iso.ies",
        cone__angle=10.0,
    ),
    _one(_PLAIN, 0.0, "nothing upwards", "ies_half_up", _UP, ies__file="./tex/half.ies"),
    # ramp.ies: angle / 90 degrees candela from 0 to 180, whose mean over the sphere is 1.
    _one(
        _PLAIN, _floor(lambda c: np.arccos(c) / (math.pi / 2)), "angle / 90", "ies_ramp", ies__file="./tex/ramp.ies",
    ),
    _one(
        _PLAIN, _floor(lambda c: 2 - np.arccos(c) / (math.pi / 2)), "angle / 90 over 1", "ies_ramp_normalized", _UP,
        ies__file="./tex/ramp.ies", ies__normalize=True,
    ),
    # Positive scales are about straight down, negative ones about straight up (UsdLux).
    _one(
        _PLAIN, _floor(lambda c: np.arccos(c) / math.pi), "half the angle", "ies_wide", ies__file="./tex/ramp.ies",
        ies__angleScale=2.0,
    ),
    _one(
        _PLAIN, _floor(lambda c: 4 * np.arccos(c) / math.pi), "twice the angle", "ies_narrow",
        ies__file="./tex/ramp.ies", ies__angleScale=0.5,
    ),
    _one(
        _PLAIN, _floor(lambda c: 1 + np.arccos(c) / math.pi), "180 - (180 - angle) / 2", "ies_wide_up",
        ies__file="./tex/ramp.ies", ies__angleScale=-2.0,
    ),
    _one(
        _PLAIN, _floor(), "a profile that is missing leaves the lamp", "ies_missing", ies__file="./tex/none.ies",
        says=("none.ies",),
    ),
]
