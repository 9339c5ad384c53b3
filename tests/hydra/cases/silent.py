# SPDX-License-Identifier: Apache-2.0
"""What was once ignored in silence: the length of shadows, switches and purposes of render settings, prims without code.

Lights give irradiance pi on what faces them, so albedo 0.5 shines with 0.5. Direct light only, middles of cells.
"""

from cases.case import Case

ACTIVE = "engine.SetActiveRenderSettingsPrimPath(Sdf.Path('/Render/S'))"
RED, GREEN, BLUE, NONE = (1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, 0)


def _shadow(file, value, why):
    return Case(file, (1, 1), {(0, 0): value}, why, bounces=0, inset=0.25, samples=256, silent=True)


def _settings(file, values, why, **more):
    cells = {(x, 0): value for x, value in enumerate(values)}
    return Case(file, (4, 1), cells, why, **{"inset": 0.25, "samples": 16, **more})


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
        "30_settings_preview", (GREEN, RED, NONE, NONE), "this front end has the material for full only, and it is said",
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
]
