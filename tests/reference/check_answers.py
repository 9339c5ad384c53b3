#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of the feature scenes with Mitsuba in the renderer's place: are their answers right, and is the
translation?

    check_answers.py [FILTER]

A test that asks for something without a counterpart in Mitsuba (links, cones, ...) must fail here: those are listed in
MISSING with the reason, and it is an error if one of them passes. Prints a line per case; exits with 1 if anything is
not as expected.
"""

from __future__ import annotations

import importlib
import inspect
import itertools
import pathlib
import sys

HERE = pathlib.Path(__file__).resolve().parent
sys.path[:0] = [str(HERE), str(HERE.parent / "scenes"), str(HERE.parent / "hydra")]

import to_mitsuba  # noqa: E402  (sets Mitsuba's variant)
import materials  # noqa: E402
import mitsuba as mi  # noqa: E402
import numpy as np  # noqa: E402
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, Vt  # noqa: E402

MODULES = ("test_features_lights", "test_features_materials", "test_features_textures", "test_features_references")
MORE_SAMPLES = 16
"""Mitsuba's independent samples against our Sobol points."""

MISSING = {
    "test_cone": "no cones on area lights", "test_ies_profile": "no IES profiles",
    "test_shadow_enable[False]": "all lights cast shadows", "test_light_and_shadow_links": "no links",
    "test_light_multipliers": "no multipliers", "test_cutout": "emitters have no holes",
    "test_texture_values": "emitters have no holes",
    "test_coat_straight_on": "another coat", "test_fresnel_straight_on": "real Fresnel",
    "test_primvar_readers": "readers are not translated",
    "test_instance_primvars": "readers are not translated", "test_texture_wrap": "no black outside",
    "test_white_plastic_furnace": "another base",
}  # fmt: skip


class Engine:
    """The one method of a UsdImagingGL.Engine that edits call."""

    def __init__(self) -> None:
        self.settings: dict = {}

    def SetRendererSetting(self, key, value) -> None:  # noqa: N802
        self.settings[key] = value


class Picture(dict):
    """Arrays by AOV."""


def _stage(scene: str) -> Usd.Stage:
    """A stage by its path, or of the text of a layer."""
    if not scene.startswith("#usda"):
        return Usd.Stage.Open(scene)
    layer = Sdf.Layer.CreateAnonymous(".usda")
    layer.ImportFromString(scene)
    return Usd.Stage.Open(layer)


class View:
    """As host.View, over a stage of usd-core."""

    def __init__(self, path, size, camera, settings, aovs) -> None:
        self.stage, self.size, self.camera, self.aovs, self.engine = _stage(str(path)), size, camera, aovs, Engine()
        self.engine.settings.update(settings)

    def __enter__(self) -> "View":
        return self

    def __exit__(self, *_) -> None:
        pass

    def edit(self, code: str) -> None:
        exec(
            code,
            {
                "stage": self.stage, "engine": self.engine, "Gf": Gf, "Sdf": Sdf, "Usd": Usd, "UsdGeom": UsdGeom,
                "UsdLux": UsdLux, "Vt": Vt,
            },
        )  # noqa: S102

    def render(self) -> Picture:
        settings = self.engine.settings
        scene, _ = to_mitsuba.translate(
            self.stage, *self.size, camera=self.camera, bounces=settings["oocpt:maxBounces"], blocks=False
        )
        color = to_mitsuba.render(
            scene, MORE_SAMPLES * settings["oocpt:samplesPerPixel"], settings.get("oocpt:seed", 0)
        )[::-1]
        made = Picture(color=np.concatenate([color, np.ones_like(color[..., :1])], axis=-1))
        if "normal" in self.aovs:
            integrator = mi.load_dict({"type": "aov", "aovs": "n:sh_normal"})
            made["normal"] = np.array(mi.render(scene, integrator=integrator, spp=16), dtype=np.float64)[::-1, :, -3:]
        return made


class Host:
    def open(self, path, size, settings, camera="/World/Camera", aovs=("color",)) -> View:
        return View(path, size, camera, settings, aovs)


def cases(function):
    """(label, arguments) of a test by its parametrize marks."""
    axes = []
    for mark in getattr(function, "pytestmark", []):
        names = (
            [name.strip() for name in mark.args[0].split(",")] if isinstance(mark.args[0], str) else list(mark.args[0])
        )
        values = [value if len(names) > 1 else (value,) for value in mark.args[1]]
        axes.append([dict(zip(names, value)) for value in values])
    for combination in itertools.product(*axes):
        arguments = {name: value for part in combination for name, value in part.items()}
        yield f"[{'-'.join(str(value) for value in arguments.values())}]" if arguments else "", arguments


def main() -> int:
    materials.EXACT_METALS = True
    wanted = sys.argv[1] if len(sys.argv) > 1 else ""
    wrong = 0
    for name in MODULES:
        module = importlib.import_module(name)
        for test, function in inspect.getmembers(module, inspect.isfunction):
            if not test.startswith("test_") or "host" not in inspect.signature(function).parameters:
                continue
            for label, arguments in cases(function):
                if wanted not in test + label:
                    continue
                reason = MISSING.get(test, MISSING.get(test + label))
                try:
                    function(Host(), **arguments)
                    result = "as expected" if reason is None else "PASSES, though listed as missing"
                except AssertionError as error:
                    result = (
                        f"WRONG: {str(error).splitlines()[0][:300]}" if reason is None else f"not in Mitsuba ({reason})"
                    )
                wrong += result.startswith(("WRONG", "PASSES"))
                print(f"{test}{label}: {result}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
