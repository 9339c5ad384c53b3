#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the feature scenes: one thing to test per scene, into `features/`, with their small pictures in
`features/maps/`.

The scenes are in feature_lights.py, feature_surfaces.py, feature_textures.py and feature_references.py; the last have
Mitsuba's answers beside them (`cargo xtask reference` makes those). Committed files are checked against this source by
test_features.py. Needs usd-core, numpy, OpenEXR.
"""

from __future__ import annotations

import pathlib
import sys

from pxr import Usd, UsdGeom

import feature_lights
import feature_references
import feature_surfaces
import feature_textures

FOLDER = pathlib.Path(__file__).parent / "features"
SCENES = [
    *feature_lights.SCENES, *feature_surfaces.SCENES, *feature_textures.SCENES, *feature_references.SCENES,
]  # fmt: skip


def write(scene, folder: pathlib.Path) -> pathlib.Path:
    """Writes a scene and its pictures below `folder`; the path of its .usda."""
    (folder / "maps").mkdir(parents=True, exist_ok=True)
    path = folder / f"{scene.__name__}.usda"
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    stage.GetRootLayer().comment = " ".join(scene.__doc__.split())
    scene(stage, folder)
    stage.GetRootLayer().Save()
    return path


def main() -> None:
    for scene in SCENES:
        write(scene, FOLDER)
    print(f"wrote {len(SCENES)} scenes to {FOLDER}", file=sys.stderr)


if __name__ == "__main__":
    main()
