# SPDX-License-Identifier: Apache-2.0
"""Exposure of cameras: what the colour is multiplied by, and nothing else.

A square of albedo 0.4 from 0.05 to 0.95 of the only cell lies under a constant dome of radiance 1, which nothing
shadows: it reflects 0.4. The cell is cut to what the square covers.
"""

from cases.case import Case

_SCALE = "0.4 times responsivity * time * (iso / 100) * 2^exposure / fStop^2"


def _case(file: str, value: float, edit: str | None = None, variant: str = "", **more) -> Case:
    why = f"{_SCALE} = {value}"
    return Case(file, (1, 1), {(0, 0): value}, why, inset=0.125, samples=16, edit=edit, variant=variant, **more)


def _attributes(*pairs: tuple[str, str]) -> str:
    """Authors attributes of the camera; the values are Python."""
    lines = [f"camera.CreateAttribute('{name}', Sdf.ValueTypeNames.Float).Set({value})" for name, value in pairs]
    return "\n".join(["from pxr import Sdf", "camera = stage.GetPrimAtPath('/Cam')", *lines])


_PLAIN = "01_camera_exposure_none"

CASES = [
    _case(_PLAIN, 0.4, silent=True),
    _case("01_camera_exposure_exposure1", 0.8, silent=True),
    _case("01_camera_exposure_fstop2", 0.1),
    _case("01_camera_exposure_iso200", 0.8),
    _case("01_camera_exposure_responsivity", 0.2),
    _case(_PLAIN, 0.1, _attributes(("exposure:time", "0.25")), "time"),
    _case(_PLAIN, 0.1, _attributes(("exposure", "-2.0")), "negative"),
    _case(
        _PLAIN, 0.4 * 0.5 * 0.125 * 4 * 8 / 4,
        _attributes(
            ("exposure:responsivity", "0.5"), ("exposure:time", "0.125"), ("exposure:iso", "400"), ("exposure", "3"),
            ("exposure:fStop", "2"),
        ), "all",
    ),
    # As real cameras have it: 1/50 s at f/4 under ISO 100, and a scene that is brighter by as much.
    _case(
        _PLAIN, 0.4, _attributes(("exposure:time", "0.02"), ("exposure:fStop", "4"))
        + "\nstage.GetPrimAtPath('/Sky').GetAttribute('inputs:intensity').Set(800.0)", "physical",
    ),
    # Halfway between 1 and -1 at frame 24.
    _case(
        _PLAIN, 0.4, "exposure = stage.GetPrimAtPath('/Cam').CreateAttribute('exposure', Sdf.ValueTypeNames.Float)\n"
        "exposure.Set(1.0, 0.0)\nexposure.Set(-1.0, 48.0)\nview.params.frame = Usd.TimeCode(24.0)", "halfway",
    ),
    _case(
        _PLAIN, 0.2, "exposure = stage.GetPrimAtPath('/Cam').CreateAttribute('exposure', Sdf.ValueTypeNames.Float)\n"
        "exposure.Set(1.0, 0.0)\nexposure.Set(-1.0, 48.0)\nview.params.frame = Usd.TimeCode(48.0)", "animated",
    ),
    _case(_PLAIN, 0.0, _attributes(("exposure:time", "0")), "closed", says=("picture black",)),
    _case(_PLAIN, 0.4, _attributes(("exposure:fStop", "0")), "no_stop", says=("/Cam", "exposure is not a number")),
    _case(_PLAIN, 0.4, _attributes(("exposure", "200")), "huge", says=("/Cam", "too large")),
    _case(_PLAIN, 0.4, _attributes(("exposure", "float('nan')")), "nan", says=("/Cam", "exposure is not a number")),
    _case(_PLAIN, 0.4, _attributes(("exposure:time", "-1")), "below", says=("/Cam", "negative")),
]
