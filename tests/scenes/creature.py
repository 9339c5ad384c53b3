#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes a creature: subdivision surfaces as characters are made of them, for live hosts: close to the camera, refined
by what a pixel is, nothing instanced.

    creature.py OUT.usdc [--side 28]

`--side` is the number of quads along a side of the cube that the body is blown up from: the body has 6 * side^2. Same
arguments, same scene. Needs usd-core (or any pxr) and numpy. y up, metres.
"""

from __future__ import annotations

import argparse

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdLux, Vt

# Direction, height above the ball, how narrow.
LIMBS = [
    ((0.0, 0.3, 1.0), 0.55, 9.0), ((0.0, 0.1, -1.0), 0.9, 30.0), ((0.0, 1.0, 0.15), 0.25, 5.0),
    ((0.65, -1.0, 0.6), 0.8, 28.0), ((-0.65, -1.0, 0.6), 0.8, 28.0), ((0.65, -1.0, -0.6), 0.8, 28.0),
    ((-0.65, -1.0, -0.6), 0.8, 28.0), ((0.35, 0.75, 0.9), 0.45, 90.0), ((-0.35, 0.75, 0.9), 0.45, 90.0),
]  # fmt: skip


def blown_up_cube(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Points on the unit ball and quads, welded."""
    known: dict[tuple, int] = {}
    quads = []
    for axis in range(3):
        for sign in (-1, 1):
            for u in range(side):
                for v in range(side):
                    corners = [(u, v), (u + 1, v), (u + 1, v + 1), (u, v + 1)]
                    quad = []
                    for a, b in corners if sign > 0 else reversed(corners):
                        key = [0, 0, 0]
                        key[axis], key[(axis + 1) % 3], key[(axis + 2) % 3] = sign * side, 2 * a - side, 2 * b - side
                        quad.append(known.setdefault(tuple(key), len(known)))
                    quads.append(quad)
    points = np.array(list(known), dtype=float)
    return points / np.linalg.norm(points, axis=1, keepdims=True), np.array(quads)


def body(side: int) -> tuple[np.ndarray, np.ndarray]:
    directions, quads = blown_up_cube(side)
    radius = np.ones(len(directions))
    for direction, height, narrow in LIMBS:
        axis = np.array(direction) / np.linalg.norm(direction)
        radius += height * np.exp(narrow * (directions @ axis - 1))
    return directions * radius[:, None] * (0.8, 0.75, 1.1), quads


def add_mesh(stage: Usd.Stage, path: str, points: np.ndarray, quads: np.ndarray, colour: tuple) -> None:
    mesh = UsdGeom.Mesh.Define(stage, path)
    mesh.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(points.astype(np.float32)))
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray.FromNumpy(np.full(len(quads), 4, np.int32)))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(quads.reshape(-1).astype(np.int32)))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.catmullClark)
    mesh.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(np.array([points.min(0), points.max(0)], np.float32)))
    mesh.CreateDisplayColorAttr([Gf.Vec3f(*colour)])


def ground(side: int, length: float) -> tuple[np.ndarray, np.ndarray]:
    steps = np.linspace(-length / 2, length / 2, side + 1)
    z, x = np.meshgrid(steps, steps, indexing="ij")
    y = 0.08 * np.sin(1.7 * x) * np.cos(1.3 * z) - 1.35
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).reshape(-1)
    quads = np.stack([first, first + side + 1, first + side + 2, first + 1], axis=1)
    return np.stack([x, y, z], axis=-1).reshape(-1, 3), quads


def build(stage: Usd.Stage, side: int) -> None:
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.y)
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, "/World").GetPrim())
    add_mesh(stage, "/World/Body", *body(side), (0.45, 0.32, 0.25))
    add_mesh(stage, "/World/Ground", *ground(64, 40.0), (0.35, 0.4, 0.3))
    eye, faces = blown_up_cube(2)
    for name, x in (("Left", 0.28), ("Right", -0.28)):
        add_mesh(stage, f"/World/{name}Eye", 0.12 * eye + (x, 0.75, 1.35), faces, (0.9, 0.9, 0.85))
    UsdLux.DomeLight.Define(stage, "/World/Sky").CreateIntensityAttr(0.6)
    sun = UsdLux.DistantLight.Define(stage, "/World/Sun")
    sun.CreateIntensityAttr(2.0)
    sun.AddRotateXYZOp().Set((-50.0, 35.0, 0.0))
    camera = UsdGeom.Camera.Define(stage, "/World/Camera")
    camera.CreateFocalLengthAttr(35.0)
    camera.CreateHorizontalApertureAttr(36.0)
    camera.CreateVerticalApertureAttr(20.25)
    camera.CreateClippingRangeAttr(Gf.Vec2f(0.01, 1000.0))
    look = Gf.Matrix4d().SetLookAt(Gf.Vec3d(2.6, 0.9, 4.2), Gf.Vec3d(0.0, -0.1, 0.0), Gf.Vec3d(0, 1, 0))
    camera.AddTransformOp().Set(look.GetInverse())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out")
    parser.add_argument("--side", type=int, default=28)
    arguments = parser.parse_args()
    stage = Usd.Stage.CreateNew(arguments.out)
    build(stage, arguments.side)
    stage.Save()


if __name__ == "__main__":
    main()
