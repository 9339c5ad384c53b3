# SPDX-License-Identifier: Apache-2.0
"""The gallery: one module per scene, each with `build(stage, folder, options)`, which fills a y-up stage in metres and
writes pictures beside it.

Nothing made is committed: `cargo xtask gallery` writes and renders all of them, and

    python -m gallery OUT [--only NAME ...] [--set NAME.OPTION=VALUE ...]

(in this folder's parent, in the usd-core environment) writes them only. Same arguments, same files.
"""

from __future__ import annotations

import importlib
import pathlib

from pxr import Usd, UsdGeom

NAMES = ("still_life", "room", "glass", "props", "bush", "links", "lanterns", "sign", "woods")
"""In the order of the contact sheet."""


def write(name: str, root: pathlib.Path, options: dict | None = None) -> pathlib.Path:
    """Writes a scene and its pictures into `root`/NAME; the path of its .usdc."""
    module = importlib.import_module(f"{__name__}.{name}")
    folder = pathlib.Path(root) / name
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{name}.usdc"
    path.unlink(missing_ok=True)
    # A layer with a place of its own: what lies beside it can be referenced.
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    stage.GetRootLayer().comment = " ".join(module.__doc__.split("\n\n")[0].split())
    module.build(stage, folder, options or {})
    stage.GetRootLayer().Save()
    return path
