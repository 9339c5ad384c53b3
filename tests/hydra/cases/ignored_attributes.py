# SPDX-License-Identifier: Apache-2.0
"""What was once ignored in silence: how far shadows reach, switches and purposes of render settings, prims left out.

Lights give irradiance pi on what faces them, so albedo 0.5 shines with 0.5. Direct light only, middles of cells.
"""

import math
import os

from cases.case import Case

ACTIVE = "engine.SetActiveRenderSettingsPrimPath(Sdf.Path('/Render/S'))"
RED, GREEN, BLUE, NONE = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)


def _shadow(file, value, why):
    return Case(file, (1, 1), {(0, 0): value}, why, bounces=0, inset=0.25, samples=256, silent=True)


def _settings(file, values, why, **more):
    cells = {(x, 0): value for x, value in enumerate(values)}
    return Case(file, (4, 1), cells, why, **{"inset": 0.25, "samples": 16, **more})


# What we say of prims that the old front end hands over from OpenUSD 26.03 on; before, the host said that it did not.
_HANDED_OVER = ("/G: a pluginLight", "/V: a volume")


def _left_out(file, value, why, *says):
    """What the old front end's host says, and what the new one's or we do."""
    if os.environ.get("OOCPT_HOST_ROOT", "").endswith("26.03") and says[1].startswith(_HANDED_OVER):
        says = (says[1], says[1])
    return [
        Case(
            file, (1, 1), {(0, 0): value}, why, bounces=0, inset=0.25, samples=256, variant=variant,
            front_end=front_end, says=(text,),
        )
        for front_end, variant, text in zip(("legacy", "scene_index"), ("legacy", ""), says)
    ]


def _corner(x, y):
    """Configuration factor of a point under the corner of a rectangle x wide and y high at a distance of 1."""
    a, b = math.hypot(1, x), math.hypot(1, y)
    return (x / a * math.atan(y / a) + y / b * math.atan(x / b)) / math.tau


def _under_a_square(distance, corner, albedo, cells=64):
    """Mean radiance over the middle half of the cell at (0, 0) under a parallel square of side 1 and radiance 1."""
    total = 0.0
    for i in range(cells):
        for j in range(cells):
            sides = []
            for at, low in ((i, corner[0]), (j, corner[1])):
                p = 0.25 + 0.5 * (at + 0.5) / cells
                sides.append(((low + 1 - p) / distance, (low - p) / distance))
            (right, left), (top, bottom) = sides
            total += _corner(right, top) - _corner(left, top) - _corner(right, bottom) + _corner(left, bottom)
    return albedo * total / cells**2


_PURPOSES = "quads of no purpose, proxy, render, guide; material red for all purposes, of the first green for full"

CASES = [
    _shadow("29_silent_plain", 0, "the quad at z = 1 is in the light's way"),
    _shadow("29_silent_shadow_distance", 0.5, "shadows end at a distance of 0.5"),
    _shadow(
        "29_silent_shadow_falloff",
        0.25,
        "shadows fade from a distance of 0 to 2, so at 1 half of it is left",
    ),
    Case(
        "29_shadow_reach",
        (4, 1),
        {(0, 0): (0, 0.5, 0), (1, 0): (0.375, 0.5, 0), (2, 0): (0.5, 0.5, 0.5), (3, 0): (0.375, 0.5, 0)},
        "casters at z = 0.5, 1.5, 2.5, and at 1.5 and 1.8. Red, distant, fades from 1 to 2 with exponent 2: at 1.5 a"
        " quarter of the shadow is left, and the nearest caster decides. Blue, a ball of radius 1 at z = 1000 of"
        " intensity 4e6 pi over its area 4 pi, ends at 2. Green, a dome, ends at 0.1 and has no shadow here",
        bounces=0,
        inset=0.25,
        samples=1024,
        silent=True,
    ),
    _settings("30_settings_none", (GREEN, RED, NONE, NONE), _PURPOSES + "; the host shows proxy", silent=True),
    _settings(
        "30_settings_flag_render", (GREEN, NONE, RED, NONE), _PURPOSES + "; the host shows render",
        purposes=("render",), silent=True,
    ),
    _settings("30_settings_flag_proxy", (GREEN, RED, NONE, NONE), _PURPOSES + "; the host shows proxy", silent=True),
    _settings(
        "30_settings_included",
        (GREEN, RED, NONE, NONE),
        _PURPOSES + "; the host shows proxy, whatever the settings want",
        edit=ACTIVE,
        says=("/Render/S: its includedPurposes are not those that the host shows",),
    ),
    _settings(
        "30_settings_included",
        (GREEN, NONE, RED, NONE),
        _PURPOSES + "; the host shows render, as the settings want",
        purposes=("render",),
        edit=ACTIVE,
        variant="agreed",
        silent=True,
    ),
    _settings(
        "30_settings_preview", (BLUE, RED, NONE, NONE), "of the first quad the material bound for preview",
        edit=ACTIVE, front_end="scene_index", says=("its includedPurposes are not those",),
    ),
    _settings(
        "30_settings_preview", (GREEN, RED, NONE, NONE), "this front end has the material for full alone, and says so",
        edit=ACTIVE, front_end="legacy", variant="legacy", says=("its materialBindingPurposes are not used",),
    ),
    _settings(
        "30_settings_all_purpose", (RED, RED, NONE, NONE), "of the first quad the material for all purposes",
        edit=ACTIVE, front_end="scene_index",
    ),
    _settings(
        "30_settings_all_purpose", (GREEN, RED, NONE, NONE), "as with preview",
        edit=ACTIVE, front_end="legacy", variant="legacy", says=("its materialBindingPurposes are not used",),
    ),
    Case(
        "30_settings_lens",
        (2, 1),
        {(0, 0): BLUE, (1, 0): GREEN},
        "in focus whatever the lens, a disk of radius 50 / (2 * 2) = 12.5 tenths that is focused on half the distance",
        edit=ACTIVE,
        inset=0.125,
        silent=True,
    ),
    Case(
        "30_settings_lens",
        (2, 1),
        {(0, 0): BLUE, (1, 0): GREEN},
        "the same by a setting of the host",
        edit="engine.SetRendererSetting('disableDepthOfField', True)",
        inset=0.125,
        silent=True,
        variant="by_host",
    ),
    *_left_out(
        "29_silent_geometry_light",
        0,
        "there is no other light",
        "doesn't support prim type 'GeometryLight'",
        "UsdImagingGeometryLightAdapter",
    ),
    *_left_out(
        "29_silent_plugin_light",
        0,
        "there is no other light",
        "doesn't support prim type 'PluginLight'",
        "/G: a pluginLight is not supported yet",
    ),
    *_left_out(
        "29_silent_portal",
        0.5,
        "the dome shines without its portal",
        "doesn't support prim type 'PortalLight'",
        "/D: has portals, which are not supported yet",
    ),
    *_left_out(
        "29_silent_volume",
        0,
        "there is no light",
        "doesn't support prim type 'Volume'",
        "/V: a volume is not supported yet",
    ),
    *_left_out(
        "29_silent_light_shader_id",
        _under_a_square(2.0, (-0.5, -0.5), 0.5),
        "a square of side 1 and radiance 1 about (0, 0, 3), over the quad at z = 1",
        "PxrRectLight node: /G",
        "/G: its shader PxrRectLight is not supported",
    ),
    Case(
        "29_silent_unknown_type",
        (1, 1),
        {(0, 0): 0},
        "a prim of an unknown type reaches no renderer, and there is no light",
        bounces=0,
        inset=0.25,
        samples=16,
    ),
]
