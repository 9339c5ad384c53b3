#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The Open Chess Set (usd-wg/assets, full_assets/OpenChessSet; CC BY 4.0, never committed) as a scene to measure with.

    chess_set.py FOLDER_OF_THE_ASSET OUT

Writes OUT/chess_set/chess_set.usdc and its textures: the stage flattened (MaterialX read by UsdMtlx), a camera and two
lights added. The cages are plain meshes with smooth normals, so that every renderer gets the same triangles (as
subdivision surfaces they are one for us only). Run by the wheel host's Python, which has UsdMtlx: after
`eval "$(cargo xtask env)"`, `$OOCPT_HOST_PYTHON tests/reference/chess_set.py ...`.
"""

from __future__ import annotations

import argparse
import pathlib
import shutil
import sys

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade

NAME = "chess_set"
EYE, TARGET = Gf.Vec3d(0.34, 0.3, 0.52), Gf.Vec3d(0, 0.015, 0.02)


def smooth_normals(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> np.ndarray:
    """One a point: the mean of its faces', weighted by area (Newell's sum over each face's edges)."""
    ends = np.cumsum(counts)
    follows = np.arange(1, len(indices) + 1)
    follows[ends - 1] = ends - counts
    faces = np.repeat(np.arange(len(counts)), counts)
    crossed = np.cross(points[indices], points[indices[follows]])
    normals = np.zeros((len(counts), 3))
    np.add.at(normals, faces, crossed)
    summed = np.zeros_like(points)
    np.add.at(summed, indices, normals[faces])
    length = np.linalg.norm(summed, axis=1, keepdims=True)
    return summed / np.where(length > 0, length, 1)


def make_plain(mesh: UsdGeom.Mesh) -> None:
    """The cage as a polygon mesh with smooth normals."""
    points = np.array(mesh.GetPointsAttr().Get(), dtype=np.float64)
    counts = np.array(mesh.GetFaceVertexCountsAttr().Get())
    normals = smooth_normals(points, counts, np.array(mesh.GetFaceVertexIndicesAttr().Get()))
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        normals = -normals
    mesh.GetSubdivisionSchemeAttr().Set(UsdGeom.Tokens.none)
    mesh.GetNormalsAttr().Set(normals.astype(np.float32))
    mesh.SetNormalsInterpolation(UsdGeom.Tokens.vertex)


def _bring_textures(stage: Usd.Stage, folder: pathlib.Path) -> int:
    """Copies what shaders read; their names are unique in the set."""
    folder.mkdir(parents=True, exist_ok=True)
    brought = set()
    for prim in Usd.PrimRange(stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()):
        file = UsdShade.Shader(prim).GetInput("file") if prim.IsA(UsdShade.Shader) else None
        asset = file.Get() if file else None
        if isinstance(asset, Sdf.AssetPath):
            path = pathlib.Path(asset.resolvedPath or asset.path)
            shutil.copyfile(path, folder / path.name)
            file.Set(Sdf.AssetPath(f"./{folder.name}/{path.name}"))
            brought.add(path.name)
    return len(brought)


def _add_view(stage: Usd.Stage) -> None:
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.AddTransformOp().Set(Gf.Matrix4d().SetLookAt(EYE, TARGET, Gf.Vec3d.YAxis()).GetInverse())
    camera.GetHorizontalApertureAttr().Set(36.0)
    camera.GetVerticalApertureAttr().Set(20.25)
    camera.GetFocalLengthAttr().Set(46.0)
    camera.GetClippingRangeAttr().Set(Gf.Vec2f(0.01, 100))
    dome = UsdLux.DomeLight.Define(stage, "/World/Sky")
    dome.GetIntensityAttr().Set(0.4)
    key = UsdLux.RectLight.Define(stage, "/World/Key")
    key.GetIntensityAttr().Set(12.0)
    key.GetWidthAttr().Set(0.8)
    key.GetHeightAttr().Set(0.8)
    place = Gf.Matrix4d().SetLookAt(Gf.Vec3d(-0.9, 1.1, 0.3), Gf.Vec3d(0), Gf.Vec3d.YAxis()).GetInverse()
    key.AddTransformOp().Set(place)


def write(asset: pathlib.Path, out: pathlib.Path) -> pathlib.Path:
    """The scene's file."""
    source = Usd.Stage.Open(str(asset / "chess_set.usda"))
    flat = source.Flatten()
    folder = out / NAME
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"{NAME}.usdc"
    path.unlink(missing_ok=True)
    stage = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    if not Sdf.CopySpec(flat, "/ChessSet", stage.GetRootLayer(), "/World/ChessSet"):
        raise SystemExit(f"{asset}: no prim /ChessSet")
    if not _bring_textures(stage, folder / "textures"):
        raise SystemExit("no texture was found: is PXR_MTLX_STDLIB_SEARCH_PATHS set?")
    for prim in stage.Traverse():
        if prim.IsA(UsdGeom.Mesh):
            make_plain(UsdGeom.Mesh(prim))
    _add_view(stage)
    stage.GetRootLayer().Save()
    return path


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("asset", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    arguments = parser.parse_args()
    print(write(arguments.asset, arguments.out), file=sys.stderr)


if __name__ == "__main__":
    main()
