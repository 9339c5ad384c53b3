# SPDX-License-Identifier: Apache-2.0
"""Parts of the light add up to the picture on the gallery's scenes: parts by path, and light groups.

Two scenes, all of them with `--full`. Lights are labelled one by one, in three groups of which one has no label.
"""

import os
import subprocess

import gallery
import numpy as np
import OpenEXR
import pytest
from pxr import Gf, Sdf, Usd, UsdLux, UsdRender

from test_gallery import SMALL

# Each path has one of these.
PATHS = {
    "shines": "C[LO]", "direct": "C<RD>[LO]", "indirect": "C<RD>.+[LO]", "mirrored": "C<R[^D]>.*[LO]",
    "through": "C<T.>.*[LO]",
}  # fmt: skip
GROUPS = {name: f"C.*<[LO].'{name}'>" for name in ("one", "two", "default")}
SIZE = (32, 18)
NAMES = gallery.NAMES if os.environ.get("OOCPT_TEST_FULL") else ("lanterns", "glass")


def label(stage):
    """Gives lights, and what shines by its material, labels; the number of lights."""
    lights = [prim for prim in stage.Traverse() if prim.HasAPI(UsdLux.LightAPI)]
    for at, prim in enumerate(lights):
        if at % 3 < 2:
            attribute = prim.CreateAttribute("primvars:oocpt:lightGroup", Sdf.ValueTypeNames.String)
            attribute.Set(("one", "two")[at % 3])
    return len(lights)


def ask(stage, path):
    """Adds render settings with a product that has the colour and all parts."""
    settings = UsdRender.Settings.Define(stage, "/Sums")
    product = UsdRender.Product.Define(stage, "/Sums/All")
    product.CreateProductNameAttr(str(path))
    product.CreateCameraRel().SetTargets([Sdf.Path("/World/Camera")])
    product.CreateResolutionAttr(Gf.Vec2i(*SIZE))
    settings.CreateProductsRel().SetTargets([product.GetPath()])
    variables = []
    for name, expression in {"color": "Ci", **PATHS, **GROUPS}.items():
        var = UsdRender.Var.Define(stage, f"/Sums/{name}")
        var.CreateDataTypeAttr("color3f")
        var.CreateSourceNameAttr(expression)
        var.CreateSourceTypeAttr("raw" if expression == "Ci" else "lpe")
        variables.append(var.GetPath())
    product.CreateOrderedVarsRel().SetTargets(variables)
    stage.SetMetadata("renderSettingsPrimPath", "/Sums")


@pytest.mark.parametrize("name", NAMES)
def test_parts_of_light_add_up_to_the_picture(name, tmp_path):
    scene = gallery.write(name, tmp_path, SMALL.get(name))
    layer = Sdf.Layer.CreateNew(str(scene.parent / "sums.usda"))
    layer.subLayerPaths.append(scene.name)
    stage = Usd.Stage.Open(layer)
    lights = label(stage)
    ask(stage, tmp_path / "all.exr")
    stage.Save()
    variables = dict(os.environ, OOCPT_SAMPLES_PER_PIXEL="4", OOCPT_MAX_BOUNCES="4")
    variables.pop("PYTHONPATH", None)
    words = ["--disableCameraLight", "--enableDomeLightVisibility", "--products", layer.realPath]
    done = subprocess.run(
        ["usdrecord", *words, str(tmp_path / "unused.exr")], env=variables, capture_output=True, text=True, timeout=300,
        check=False, stdin=subprocess.DEVNULL, start_new_session=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    with OpenEXR.File(str(tmp_path / "all.exr"), separate_channels=True) as file:
        pixels = {channel: values.pixels.astype(np.float64) for channel, values in file.channels().items()}
    picture = np.stack([pixels[channel] for channel in "RGB"], -1)
    parts = {name: np.stack([pixels[f"{name}.{c}"] for c in "RGB"], -1) for name in {**PATHS, **GROUPS}}
    assert picture.mean() > 1e-3 and lights > 0, "something is lit"
    lit = {part for part, values in parts.items() if values.any()}
    assert len(lit & set(PATHS)) > 1 and lit & set(GROUPS), lit
    for of in (PATHS, GROUPS):
        total = sum(parts[part] for part in of)
        error = np.abs(total - picture) / np.maximum(np.abs(picture), 1e-3)
        print(f"{name}: {lights} lights, {sorted(of)}: largest difference {error.max():.2e}")
        assert error.max() < 1e-6, (error.max(), np.unravel_index(error.argmax(), error.shape))
