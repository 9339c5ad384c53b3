#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes a terrain for live hosts: one subdivision surface of a kilometre with a displacement texture, seen from its
edge at a height of a few metres, so that its tessellation rates differ by hundreds from one end to the other.

    terrain.py OUT.usdc [--side 512]

`--side` is the number of quads along a side. Writes a picture beside OUT, `terrain_relief.png`. Same arguments, same
scene. Needs usd-core (or any pxr) and numpy. y up, metres.
"""

from __future__ import annotations

import argparse
import pathlib

import numpy as np
from pxr import Gf, Sdf, Usd, UsdGeom, UsdLux, UsdShade, Vt

import images

LENGTH = 1000.0
RELIEF = "terrain_relief.png"
# Metres that the relief repeats after, and its height.
TILE, HEIGHT = 80.0, 1.2
PIXELS = 1024


def hills(x: np.ndarray, z: np.ndarray) -> np.ndarray:
    return 22 * np.sin(0.011 * x) * np.cos(0.013 * z) + 3 * np.sin(0.07 * x + 0.05 * z)


def relief() -> np.ndarray:
    """Heights from 0 to 1 that repeat: waves of random directions, ever shorter and lower."""
    rng = np.random.default_rng(7)
    at = 2 * np.pi * np.arange(PIXELS) / PIXELS
    x, y = np.meshgrid(at, at)
    sum_ = np.zeros_like(x)
    for octave in range(8):
        for _ in range(6):
            kx, ky = rng.integers(-(2 << octave), (2 << octave) + 1, 2)
            sum_ += 0.55**octave * np.sin(kx * x + ky * y + rng.uniform(0, 2 * np.pi))
    return (sum_ - sum_.min()) / (sum_.max() - sum_.min())


def add_terrain(stage: Usd.Stage, side: int) -> None:
    steps = np.linspace(-LENGTH / 2, LENGTH / 2, side + 1)
    z, x = np.meshgrid(steps, steps, indexing="ij")
    points = np.stack([x, hills(x, z), z], axis=-1).reshape(-1, 3).astype(np.float32)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    quads = np.stack([first, first + side + 1, first + side + 2, first + 1], axis=1)
    mesh = UsdGeom.Mesh.Define(stage, "/World/Terrain")
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(quads), 4, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.reshape(-1).astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
    low, high = points.min(0), points.max(0) + (0, HEIGHT, 0)
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.array([low, high], np.float32)))
    st = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("st", Sdf.ValueTypeNames.TexCoord2fArray, UsdGeom.Tokens.vertex)
    st.Set(Vt.Vec2fArray.FromNumpy((np.stack([x, z], axis=-1).reshape(-1, 2) / TILE).astype(np.float32)))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material(stage))


def material(stage: Usd.Stage) -> UsdShade.Material:
    """Diffuse, displaced by the relief."""
    made = UsdShade.Material.Define(stage, "/World/Ground")
    surface, texture, reader = (
        UsdShade.Shader.Define(stage, f"/World/Ground/{name}") for name in ("Surface", "Relief", "Reader")
    )
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set(Gf.Vec3f(0.35, 0.4, 0.25))
    surface.CreateInput("roughness", Sdf.ValueTypeNames.Float).Set(1.0)
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("st")
    texture.CreateIdAttr("UsdUVTexture")
    texture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(f"./{RELIEF}")
    texture.CreateInput("sourceColorSpace", Sdf.ValueTypeNames.Token).Set("raw")
    texture.CreateInput("scale", Sdf.ValueTypeNames.Float4).Set(Gf.Vec4f(HEIGHT))
    for axis in ("wrapS", "wrapT"):
        texture.CreateInput(axis, Sdf.ValueTypeNames.Token).Set("repeat")
    texture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(reader.ConnectableAPI(), "result")
    displacement = surface.CreateInput("displacement", Sdf.ValueTypeNames.Float)
    displacement.ConnectToSource(texture.ConnectableAPI(), "r")
    made.CreateSurfaceOutput().ConnectToSource(surface.ConnectableAPI(), "surface")
    made.CreateDisplacementOutput().ConnectToSource(surface.ConnectableAPI(), "displacement")
    return made


def build(stage: Usd.Stage, side: int) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    add_terrain(stage, side)
    UsdLux.DomeLight.Define(stage, "/World/Sky").CreateIntensityAttr(0.6)
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(3.0)
    sun.AddRotateXYZOp().Set((-35.0, 40.0, 0.0))
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateFocalLengthAttr(24.0)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(20.25)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.05, 5000.0))
    z = LENGTH / 2 - 5
    camera.AddTranslateOp().Set((0.0, float(hills(np.float64(0), np.float64(z))) + HEIGHT + 4.0, z))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out")
    parser.add_argument("--side", type=int, default=512)
    arguments = parser.parse_args()
    heights = (255 * relief()[:, :, None]).round().astype(np.uint8)
    images.png(pathlib.Path(arguments.out).with_name(RELIEF), heights, packed=True)
    stage = Usd.Stage.CreateNew(arguments.out)
    build(stage, arguments.side)
    stage.Save()


if __name__ == "__main__":
    main()
