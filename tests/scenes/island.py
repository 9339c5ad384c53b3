#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the island as USD from what `oocpt scene island` made. Run by that command:

    island.py FOLDER OUT.usdc

FOLDER holds `contents.json` (prims, with places of arrays) and `arrays` (their bytes, native order). Needs usd-core (or
any pxr) and numpy.

Layout of the stage, where BASE is /World/Island, or /World/Copies/Island below the point instancer /World/Copies:
    BASE/Unique/... terrain, reefs and trees, one mesh each (flattened copies: prototypes of the instancer BASE/Unique)
    BASE/Library/... meshes, and point instancers of them: the prototypes. Library is an instancer of nothing, so that
        what
                         is below it shows only through the others
    BASE/Palms ...       point instancers, one per species (flattened copies: one per species and copy, Palms_c000 ...)
    /World/Ocean, /World/Sky, /World/Sun, /World/Camera
"""

from __future__ import annotations

import argparse
import json
import math
import pathlib

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdRender, Vt


class Arrays:
    """The arrays of a folder; each is read once."""

    def __init__(self, path: pathlib.Path) -> None:
        self._path, self._known = path, {}

    def numpy(self, place: dict) -> np.ndarray:
        shape = (place["count"], place["width"]) if place["width"] > 1 else (place["count"],)
        count = place["count"] * place["width"]
        return np.fromfile(self._path, dtype=place["type"], count=count, offset=place["at"]).reshape(shape)

    def vt(self, place: dict, kind: type):
        key = (place["at"], place["count"], kind)
        if key not in self._known:
            self._known[key] = kind.FromNumpy(self.numpy(place))
        return self._known[key]


def place(prim, matrix: list[float]) -> None:
    gf = Gf.Matrix4d(*matrix)
    if gf != Gf.Matrix4d(1.0):
        UsdGeom.Xformable(prim).AddTransformOp().Set(gf)


def add_mesh(stage: Usd.Stage, arrays: Arrays, spec: dict) -> None:
    mesh = UsdGeom.Mesh.Define(stage, spec["path"])
    place(mesh, spec["matrix"])
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    mesh.CreateDoubleSidedAttr(spec["double_sided"])
    points = arrays.vt(spec["points"], Vt.Vec3fArray)
    mesh.CreatePointsAttr(points)
    mesh.CreateExtentAttr(UsdGeom.PointBased.ComputeExtent(points))
    mesh.CreateFaceVertexCountsAttr(arrays.vt(spec["counts"], Vt.IntArray))
    mesh.CreateFaceVertexIndicesAttr(arrays.vt(spec["indices"], Vt.IntArray))
    mesh.CreateDisplayColorPrimvar(spec["interpolation"]).Set(arrays.vt(spec["colors"], Vt.Vec3fArray))
    if spec["normals"]:
        mesh.CreateNormalsAttr(arrays.vt(spec["normals"], Vt.Vec3fArray))
        mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)


def add_instancer(stage: Usd.Stage, arrays: Arrays, spec: dict) -> None:
    instancer = UsdGeom.PointInstancer.Define(stage, spec["path"])
    place(instancer, spec["matrix"])
    instancer.CreatePrototypesRel().SetTargets([Sdf.Path(prototype["root"]) for prototype in spec["prototypes"]])
    kinds = np.full(spec["positions"]["count"], -1, dtype=np.int32)
    for kind, prototype in enumerate(spec["prototypes"]):
        kinds[arrays.numpy(prototype["indices"])] = kind
    if (kinds < 0).any():
        raise ValueError(f"{spec['path']}: {(kinds < 0).sum()} instances show no prototype")
    instancer.CreateProtoIndicesAttr(Vt.IntArray.FromNumpy(kinds))
    instancer.CreatePositionsAttr(arrays.vt(spec["positions"], Vt.Vec3fArray))
    # Vt keeps quaternions as (x, y, z, w), as we do.
    if spec["orientations"]["type"] == "f2":
        instancer.CreateOrientationsAttr(arrays.vt(spec["orientations"], Vt.QuathArray))
    else:
        instancer.CreateOrientationsfAttr(arrays.vt(spec["orientations"], Vt.QuatfArray))
    instancer.CreateScalesAttr(arrays.vt(spec["scales"], Vt.Vec3fArray))


def add_light(stage: Usd.Stage, spec: dict) -> None:
    if spec["angle"] is None:
        light = UsdLux.DomeLight.Define(stage, spec["path"])
    else:
        light = UsdLux.DistantLight.Define(stage, spec["path"])
        light.CreateAngleAttr(spec["angle"])
        light.CreateNormalizeAttr(True)
    place(light, spec["matrix"])
    light.CreateColorAttr(Gf.Vec3f(*spec["color"]))
    light.CreateIntensityAttr(spec["intensity"])


def add_camera(stage: Usd.Stage, spec: dict) -> None:
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    place(camera, spec["matrix"])
    # Lengths are in tenths of a scene unit: 0.36 is 36 mm when the unit is a metre.
    camera.CreateHorizontalApertureAttr(0.36)
    camera.CreateVerticalApertureAttr(0.36 * 429 / 1024)
    camera.CreateFocalLengthAttr(0.18 / math.tan(spec["field_of_view"] / 2))
    camera.CreateClippingRangeAttr(Gf.Vec2f(*spec["clipping"]))


def add_render_settings(stage: Usd.Stage, report: str) -> None:
    """Active settings of the stage that ask OocPT for a report of error against time."""
    settings = UsdRender.Settings.Define(stage, "/Render/Settings")
    settings.CreateCameraRel().SetTargets(["/World/Camera"])
    settings.GetPrim().CreateAttribute("oocpt:report", Sdf.ValueTypeNames.String).Set(report)
    stage.SetMetadata("renderSettingsPrimPath", str(settings.GetPath()))


def build(folder: str, out: str) -> Usd.Stage:
    """Makes and saves the stage; returns it."""
    contents = json.loads((pathlib.Path(folder) / "contents.json").read_text())
    arrays = Arrays(pathlib.Path(folder) / "arrays")
    stage = Usd.Stage.CreateNew(out)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    paths = [Sdf.Path(spec["path"]) for spec in contents["meshes"] + contents["instancers"]]
    for parent in sorted({path.GetParentPath() for path in paths}):
        if parent.name == "Library":
            library = UsdGeom.PointInstancer.Define(stage, parent)
            library.CreatePrototypesRel().SetTargets([next(path for path in paths if path.HasPrefix(parent))])
            library.CreateProtoIndicesAttr(Vt.IntArray())
            library.CreatePositionsAttr(Vt.Vec3fArray())
        elif parent not in paths:
            UsdGeom.Xform.Define(stage, parent)
    for spec in contents["instancers"]:
        add_instancer(stage, arrays, spec)
    for spec in contents["meshes"]:
        add_mesh(stage, arrays, spec)
    for spec in contents["lights"]:
        add_light(stage, spec)
    add_camera(stage, contents["camera"])
    if contents.get("report"):
        add_render_settings(stage, contents["report"])
    stage.Save()
    return stage


def count_instances(stage: Usd.Stage) -> int:
    """Placements of meshes that the stage shows, nesting multiplied out."""
    known: dict = {}

    def shown(prim: Usd.Prim) -> int:
        if prim.GetPath() not in known:
            if prim.IsA(UsdGeom.PointInstancer):
                instancer = UsdGeom.PointInstancer(prim)
                kinds = np.array(instancer.GetProtoIndicesAttr().Get() or [], dtype=np.int64)
                targets = instancer.GetPrototypesRel().GetTargets()
                sizes = [shown(prim.GetStage().GetPrimAtPath(target)) for target in targets]
                known[prim.GetPath()] = int(np.dot(np.bincount(kinds, minlength=len(sizes)), sizes))
            else:
                known[prim.GetPath()] = int(prim.IsA(UsdGeom.Mesh)) + sum(shown(child) for child in prim.GetChildren())
        return known[prim.GetPath()]

    return shown(stage.GetPseudoRoot())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder")
    parser.add_argument("out")
    arguments = parser.parse_args()
    build(arguments.folder, arguments.out)


if __name__ == "__main__":
    main()
